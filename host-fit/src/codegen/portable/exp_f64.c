/* e to the power x as on the host (FreeBSD's e_exp.c).
 * Copyright (C) 2004 by Sun Microsystems, Inc. All rights reserved.
 * Permission to use, copy, modify, and distribute this software is freely granted, provided that this notice is preserved. */
static real exponential(real x)
{
    double hi, lo, square, c, y;
    int32_t k;
    const double size = x < 0.0 ? -x : x;
    union { double number; uint64_t bits; } word;
    uint32_t high;
    if (x != x) {
        return x;
    }
    if (x > 709.782712893383973096) {
        return x * 8.98846567431157953865e+307;
    }
    if (x < -745.13321910194110842) {
        return 0.0;
    }
    word.number = size;
    high = (uint32_t)(word.bits >> 32);
    if (high > 0x3fd62e42u) {
        if (high >= 0x3ff0a2b2u) {
            k = (int32_t)(1.44269504088896338700 * x + (x < 0.0 ? -0.5 : 0.5));
        } else {
            k = x < 0.0 ? -1 : 1;
        }
        hi = x - (double)k * 6.93147180369123816490e-01;
        lo = (double)k * 1.90821492927058770002e-10;
        x = hi - lo;
    } else if (high > 0x3e300000u) {
        k = 0;
        hi = x;
        lo = 0.0;
    } else {
        return 1.0 + x;
    }
    square = x * x;
    c = x - square * (1.66666666666666019037e-01 + square * (-2.77777777770155933842e-03
        + square * (6.61375632143793436117e-05 + square * (-1.65339022054652515390e-06
        + square * 4.13813679705723846039e-08))));
    y = 1.0 + (x * c / (2.0 - c) - lo + hi);
    return k == 0 ? y : ldexp(y, k);
}
