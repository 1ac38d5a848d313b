/* Exponentials and logarithms on vectors. */
#ifndef RENDER_KERNEL_EXPONENTIALS_H
#define RENDER_KERNEL_EXPONENTIALS_H

#include "simd.h"

/* Returns 2^x for x <= 0, with a relative error of 2e-7; 0 below -126. x is rounded to an integer, and 2 to the power
 * of the remainder f in [-1/2, 1/2] is computed by a Taylor series, whose first omitted term is (f ln 2)^7 / 7! <
 * 1.2e-7. */
SIMD_INLINE vf vf_exp2(vf x)
{
    const vf whole = vf_floor(x + 0.5f);
    const vf f = x - whole;
    vf p = f * 1.5403530e-4f + 1.3333558e-3f;
    p = p * f + 9.6181291e-3f;
    p = p * f + 5.5504109e-2f;
    p = p * f + 2.4022651e-1f;
    p = p * f + 6.9314718e-1f;
    p = p * f + 1.0f;
    const vf scale = vf_from_bits((vi_from_vf(vf_max(whole, vf_set(-127))) + 127) << 23);
    return vf_select(vf_lt(x, vf_set(-126)), vf_set(0), p * scale);
}

/* Returns log2(x) for x > 0 that is not denormal. x is 2^exponent times m with m in [sqrt(1/2), sqrt(2)), and log2(m)
 * is 2 atanh(s) / ln 2 with s = (m-1)/(m+1), |s| < 0.172, computed as a power series. The first omitted term is s^10 /
 * 11 < 3e-9 of the sum. */
SIMD_INLINE vf vf_log2(vf x)
{
    const vi bits = vi_from_bits(x);
    const vi shifted = bits - 0x3f3504f3; /* 0x3f3504f3 has the bits of the float sqrt(1/2). */
    const vi exponent = shifted >> 23;
    const vf m = vf_from_bits(bits - (exponent << 23));
    const vf s = (m - 1.0f) / (m + 1.0f);
    const vf z = s * s;
    vf p = z * 0.32059890f + 0.41219858f;
    p = p * z + 0.57707802f;
    p = p * z + 0.96179669f;
    p = p * z + 2.8853901f;
    return vf_from_vi(exponent) + s * p;
}

#endif
