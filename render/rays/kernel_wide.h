/* Vectors of doubles, a lane for each of a vf's half: they fill a register. Vectors of more are taken apart by compilers,
 * and their comparisons lane by lane. */
#ifndef RENDER_KERNEL_WIDE_H
#define RENDER_KERNEL_WIDE_H

#include <stdint.h>
#include <string.h>

#include "simd.h"

enum { KERNEL_HALF = SIMD_WIDTH / 2 };
typedef double kernel_half __attribute__((vector_size(8 * KERNEL_HALF)));
typedef int64_t kernel_half_mask __attribute__((vector_size(8 * KERNEL_HALF)));
typedef float kernel_half_floats __attribute__((vector_size(4 * KERNEL_HALF)));

SIMD_INLINE kernel_half kernel_half_widen(kernel_half_floats v)
{
    return __builtin_convertvector(v, kernel_half);
}

SIMD_INLINE kernel_half_floats kernel_half_narrow(kernel_half v)
{
    return __builtin_convertvector(v, kernel_half_floats);
}

/* The first half or the second. */
SIMD_INLINE kernel_half_mask kernel_half_of_mask(vm m, int half)
{
    typedef int32_t kernel_half_ints __attribute__((vector_size(4 * KERNEL_HALF)));
    int32_t lanes[SIMD_WIDTH];
    kernel_half_ints ints;
    const vi all = (vi)vf_select(m, (vf)vi_set(-1), (vf)vi_set(0));
    memcpy(lanes, &all, sizeof all);
    memcpy(&ints, lanes + half * KERNEL_HALF, sizeof ints);
    return __builtin_convertvector(ints, kernel_half_mask);
}

SIMD_INLINE kernel_half kernel_half_select(kernel_half_mask m, kernel_half a, kernel_half b)
{
    return (kernel_half)(((kernel_half_mask)a & m) | ((kernel_half_mask)b & ~m));
}

/* The first half of v's lanes or the second. */
SIMD_INLINE kernel_half kernel_half_of(const vf *v, int half)
{
    kernel_half_floats f;
    memcpy(&f, (const char *)v + half * (int)sizeof f, sizeof f);
    return kernel_half_widen(f);
}

SIMD_INLINE void kernel_half_put(vf *v, int half, kernel_half d)
{
    const kernel_half_floats f = kernel_half_narrow(d);
    memcpy((char *)v + half * (int)sizeof f, &f, sizeof f);
}

SIMD_INLINE kernel_half kernel_half_abs(kernel_half a)
{
    return (kernel_half)((kernel_half_mask)a & INT64_MAX);
}

SIMD_INLINE kernel_half kernel_half_sqrt(kernel_half v)
{
    double d[KERNEL_HALF];
    memcpy(d, &v, sizeof d);
    for (int i = 0; i < KERNEL_HALF; i++) d[i] = __builtin_sqrt(d[i]);
    memcpy(&v, d, sizeof d);
    return v;
}

SIMD_INLINE kernel_half kernel_half_max(kernel_half a, kernel_half b)
{
    return kernel_half_select((kernel_half_mask)(b < a), a, b);
}

#endif
