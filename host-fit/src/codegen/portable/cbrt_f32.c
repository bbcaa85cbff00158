/* The cube root as on the host (FreeBSD's s_cbrtf.c). Copyright (C) 1993 by Sun Microsystems, Inc. All rights reserved.
 * Permission to use, copy, modify, and distribute this software is freely granted, provided that this notice is preserved. */
static real cube_root(real x)
{
    union { float number; uint32_t bits; } word;
    const double wide = (double)x;
    double root3, cube;
    uint32_t size, i;
    word.number = x;
    size = word.bits & 0x7fffffffu;
    if (size >= 0x7f800000u || size == 0u) {
        return x + x;
    }
    if (size < 0x00800000u) {
        word.number = x * 16777216.0f;
        size = (word.bits & 0x7fffffffu) / 3u + 642849266u;
    } else {
        size = size / 3u + 709958130u;
    }
    word.bits = (word.bits & 0x80000000u) | size;
    root3 = (double)word.number;
    for (i = 0u; i < 2u; i++) {
        cube = root3 * root3 * root3;
        root3 = root3 * (wide + wide + cube) / (wide + cube + cube);
    }
    return (float)root3;
}
