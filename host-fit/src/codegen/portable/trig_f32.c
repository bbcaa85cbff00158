/* Sine and cosine as on the host (FreeBSD's k_sinf.c, k_cosf.c, e_rem_pio2f.c).
 * Copyright (C) 1993 by Sun Microsystems, Inc. All rights reserved. Developed at SunPro, a Sun Microsystems, Inc. business.
 * Permission to use, copy, modify, and distribute this software is freely granted, provided that this notice is preserved. */
static float kernel_sine(double x)
{
    const double z = x * x, w = z * z, s = z * x;
    const double r = -0.000198393348360966317347 + z * 0.0000027183114939898219064;
    return (float)((x + s * (-0.166666666416265235595 + z * 0.0083333293858894631756)) + s * w * r);
}

static float kernel_cosine(double x)
{
    const double z = x * x, w = z * z;
    const double r = -0.00138867637746099294692 + z * 0.0000243904487962774090654;
    return (float)(((1.0 + z * -0.499999997251031003120) + w * 0.0416666233237390631894) + (w * z) * r);
}

/* The sine of x plus `turns` quarter turns. */
static real sine_of(real x, uint32_t turns)
{
    const double half_pi = 1.57079632679489661923;
    const double wide = (double)x;
    union { float number; uint32_t bits; } word;
    uint32_t bits;
    double n = 0.0, y = wide;
    word.number = x;
    bits = word.bits & 0x7fffffffu;
    if (bits >= 0x4dc90fdbu) {
        /* Beyond 2^28 quarter turns, or NaN. */
        return turns == 0u ? (float)sin(wide) : (float)cos(wide);
    }
    if (bits > 0x40e231d5u) {
        n = (wide * 6.36619772367581382433e-01 + 6755399441055744.0) - 6755399441055744.0;
        y = wide - n * 1.57079631090164184570 - n * 1.58932547735281966916e-08;
    } else if (bits > 0x3f490fdau) {
        const double quarters = bits <= 0x4016cbe3u ? 1.0 : (bits <= 0x407b53d1u ? 2.0 : (bits <= 0x40afeddfu ? 3.0 : 4.0));
        n = wide < 0.0 ? -quarters : quarters;
        y = wide - n * half_pi;
    } else if (bits < 0x39800000u) {
        return turns == 0u ? x : 1.0f;
    } else {
        /* small enough */
    }
    switch (((uint32_t)(int32_t)n + turns) & 3u) {
    case 0u: return kernel_sine(y);
    case 1u: return kernel_cosine(y);
    case 2u: return kernel_sine(-y);
    default: return -kernel_cosine(y);
    }
}
