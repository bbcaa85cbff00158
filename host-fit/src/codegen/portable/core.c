//:at_least
static real at_least(real x, real low) { return x < low ? low : x; }
//:at_most
static real at_most(real x, real high) { return x > high ? high : x; }
//:magnitude
static real magnitude(real x) { return x < ZERO ? -x : x; }
//:root
static real root(real x) { return x > ZERO ? REAL_SQRT(x) : ZERO; }
//:truncated
/* The integer part, limited to 32 bits; 0 for NaN. */
static int32_t truncated(real x)
{
    int32_t whole = 0;
    if (x >= (real)2147483648.0) {
        whole = INT32_MAX;
    } else if (x <= (real)-2147483648.0) {
        whole = INT32_MIN;
    } else if (x == x) {
        whole = (int32_t)x;
    } else {
        /* not a number */
    }
    return whole;
}
//:rounded
/* The nearest whole number of samples, halves away from zero. */
static uint32_t rounded(real x)
{
    const int32_t whole = truncated(x);
    const real rest = x - (real)whole;
    const int32_t up = truncated(rest + rest);
    const int32_t nearest = whole > INT32_MAX - 1 ? whole : whole + up;
    return nearest > 0 ? (uint32_t)nearest : 0u;
}
//:below
/* The largest whole number of samples not above x. */
static uint32_t below(real x)
{
    const int32_t whole = truncated(x);
    return whole > 0 ? (uint32_t)whole : 0u;
}
//:exponential
EXPONENTIAL
//:cube_root
CUBE_ROOT
//:sine_of
SINE
//:back
/* The sample `lag` samples before the newest; every sample is stored twice, so that the past is contiguous. */
static real back(const real *samples, uint32_t length, uint32_t newest, uint32_t lag)
{
    return lag < length ? samples[newest + length - lag] : ZERO;
}
//:push
static void push(real *samples, uint32_t length, uint32_t *newest, real value)
{
    *newest = *newest + 1u < length ? *newest + 1u : 0u;
    samples[*newest] = value;
    samples[*newest + length] = value;
}
//:between
/* The value `samples` samples ago, with linear interpolation. */
static real between(const real *line, uint32_t length, uint32_t newest, uint32_t whole, real fraction)
{
    const real newer = back(line, length, newest, whole);
    return newer + fraction * (back(line, length, newest, whole + 1u) - newer);
}
//:ago
static real ago(const real *line, uint32_t length, uint32_t newest, real samples)
{
    const real delay = at_least(samples, ZERO);
    const uint32_t whole = below(delay);
    return between(line, length, newest, whole, delay - (real)whole);
}
