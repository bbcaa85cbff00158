/* e to the power x as on the host, after S. Moshier's Cephes library. */
static real exponential(real x)
{
    static const float series[6] = {
        1.9875691e-4f, 1.3981999e-3f, 8.333452e-3f, 4.1665796e-2f, 0.16666666f, 0.5f
    };
    union { float number; uint32_t bits; } shifted, power;
    float n, rest, sum;
    uint32_t i;
    if (x < -87.33654f) {
        return 0.0f;
    }
    if (x > 88.72284f || x != x) {
        return x + (float)INFINITY;
    }
    shifted.number = x * 1.44269504088896340736f + 12582912.0f;
    n = shifted.number - 12582912.0f;
    rest = x - n * 0.6933594f - n * -2.1219444e-4f;
    sum = series[0];
    for (i = 1u; i < 6u; i++) {
        sum = sum * rest + series[i];
    }
    power.number = sum * (rest * rest) + rest + 1.0f;
    power.bits += shifted.bits << 23;
    return power.number;
}
