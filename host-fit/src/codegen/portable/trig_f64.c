/* Sine and cosine as on the host (FreeBSD's k_sin.c, k_cos.c, e_rem_pio2.c).
 * Copyright (C) 1993 by Sun Microsystems, Inc. All rights reserved. Developed at SunPro, a Sun Microsystems, Inc. business.
 * Permission to use, copy, modify, and distribute this software is freely granted, provided that this notice is preserved. */
static double kernel_sine(double x, double y, int reduced)
{
    const double z = x * x, w = z * z, v = z * x;
    const double r = 8.33333333332248946124e-03 + z * (-1.98412698298579493134e-04 + z * 2.75573137070700676789e-06)
        + z * w * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10);
    if (reduced == 0) {
        return x + v * (-1.66666666666666324348e-01 + z * r);
    }
    return x - ((z * (0.5 * y - v * r) - y) - v * -1.66666666666666324348e-01);
}

static double kernel_cosine(double x, double y)
{
    const double z = x * x, w = z * z;
    const double r = z * (4.16666666666666019037e-02 + z * (-1.38888888888741095749e-03 + z * 2.48015872894767294178e-05))
        + w * w * (-2.75573143513906633035e-07 + z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11));
    const double hz = 0.5 * z, v = 1.0 - hz;
    return v + (((1.0 - v) - hz) + (z * r - x * y));
}

static uint32_t high_word(double x)
{
    union { double number; uint64_t bits; } word;
    word.number = x;
    return (uint32_t)(word.bits >> 32) & 0x7fffffffu;
}

/* The sine of x plus `turns` quarter turns. */
static real sine_of(real x, uint32_t turns)
{
    const uint32_t ix = high_word(x);
    double n = 0.0, y0 = x, y1 = 0.0;
    if (ix >= 0x413921fbu) {
        /* Beyond 2^20 quarter turns, or NaN: the library's function. */
        return turns == 0u ? sin(x) : cos(x);
    }
    if (ix > 0x3fe921fbu) {
        const double quarters = ix <= 0x4002d97cu ? 1.0 : (ix <= 0x400f6a7au ? 2.0 : (ix <= 0x4015fdbcu ? 3.0 : 4.0));
        const int near = (ix <= 0x400f6a7au && (ix & 0xfffffu) == 0x921fbu) || ix == 0x4012d97cu || ix == 0x401921fbu;
        if (ix <= 0x401c463bu && near == 0) {
            double z;
            n = x < 0.0 ? -quarters : quarters;
            z = x - n * 1.57079632673412561417;
            y0 = z - n * 6.07710050650619224932e-11;
            y1 = (z - y0) - n * 6.07710050650619224932e-11;
        } else {
            double r, w, t;
            const double shift = 1.5 / 2.2204460492503131e-16;
            n = (x * 6.36619772367581382433e-01 + shift) - shift;
            r = x - n * 1.57079632673412561417;
            w = n * 6.07710050650619224932e-11;
            y0 = r - w;
            if ((int32_t)(ix >> 20) - (int32_t)(high_word(y0) >> 20) > 16) {
                t = r;
                w = n * 6.07710050630396597660e-11;
                r = t - w;
                w = n * 2.02226624879595063154e-21 - ((t - r) - w);
                y0 = r - w;
                if ((int32_t)(ix >> 20) - (int32_t)(high_word(y0) >> 20) > 49) {
                    t = r;
                    w = n * 2.02226624871116645580e-21;
                    r = t - w;
                    w = n * 8.47842766036889956997e-32 - ((t - r) - w);
                    y0 = r - w;
                }
            }
            y1 = (r - y0) - w;
        }
    } else if (turns == 0u && ix < 0x3e500000u) {
        return x;
    } else {
        /* small enough */
    }
    switch (((uint32_t)(int32_t)n + turns) & 3u) {
    case 0u: return kernel_sine(y0, y1, ix > 0x3fe921fbu);
    case 1u: return kernel_cosine(y0, y1);
    case 2u: return -kernel_sine(y0, y1, ix > 0x3fe921fbu);
    default: return -kernel_cosine(y0, y1);
    }
}
