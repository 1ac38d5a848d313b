/* Vectors of doubles. This file also defines kernel_gather_lane(), by which rays, one per lane, gather numbers of their
 * cells from a vector whose lanes are cells. A kernel_f64 has SIMD_WIDTH / 2 doubles and fills one register, because
 * compilers split larger vectors and compare their lanes one by one. SIMD_WIDTH doubles, one per lane, are therefore
 * stored as two halves: half 0 has the first SIMD_WIDTH / 2 lanes, half 1 the others. A parameter `half` selects one of
 * them. */
#ifndef RENDER_KERNEL_WIDE_H
#define RENDER_KERNEL_WIDE_H

#include <stdint.h>
#include <string.h>

#include "simd.h"

enum { KERNEL_HALF = SIMD_WIDTH / 2 };
typedef vd kernel_f64;
typedef int64_t kernel_f64_mask __attribute__((vector_size(8 * KERNEL_HALF)));
typedef float kernel_f64_floats __attribute__((vector_size(4 * KERNEL_HALF)));

/* Returns of[lane] for each ray: the number that belongs to the ray's cell. of: one number per cell; lane: the lane
 * that holds the ray's cell. */
SIMD_INLINE vf kernel_gather_lane(const float *of, vi lane)
{
    return vf_permute(vf_load(of), lane);
}

SIMD_INLINE kernel_f64 kernel_f64_widen(kernel_f64_floats v)
{
    return __builtin_convertvector(v, kernel_f64);
}

SIMD_INLINE kernel_f64_floats kernel_f64_narrow(kernel_f64 v)
{
    return __builtin_convertvector(v, kernel_f64_floats);
}

SIMD_INLINE kernel_f64 kernel_f64_select(kernel_f64_mask m, kernel_f64 a, kernel_f64 b)
{
    return (kernel_f64)(((kernel_f64_mask)a & m) | ((kernel_f64_mask)b & ~m));
}

/* Returns the numbers in the first half (half = 0) or the second half (half = 1) of the lanes of *v, converted to
 * double. */
SIMD_INLINE kernel_f64 kernel_f64_widen_half(const vf *v, int half)
{
    kernel_f64_floats f;
    memcpy(&f, (const char *)v + half * (int)sizeof f, sizeof f);
    return kernel_f64_widen(f);
}

SIMD_INLINE void kernel_f64_store_half_of_vector(vf *v, int half, kernel_f64 d)
{
    const kernel_f64_floats f = kernel_f64_narrow(d);
    memcpy((char *)v + half * (int)sizeof f, &f, sizeof f);
}

/* Rounds doubles to float32 and stores them in one half of an array with one number per lane. */
SIMD_INLINE void kernel_f64_store_half(float lanes[SIMD_WIDTH], int half, kernel_f64 v)
{
    const kernel_f64_floats floats = kernel_f64_narrow(v);
    memcpy(lanes + half * KERNEL_HALF, &floats, sizeof floats);
}

SIMD_INLINE kernel_f64 kernel_f64_abs(kernel_f64 a)
{
    return (kernel_f64)((kernel_f64_mask)a & INT64_MAX);
}

SIMD_INLINE kernel_f64 kernel_f64_sqrt(kernel_f64 v)
{
    double d[KERNEL_HALF];
    memcpy(d, &v, sizeof d);
    for (int i = 0; i < KERNEL_HALF; i++) d[i] = __builtin_sqrt(d[i]);
    memcpy(&v, d, sizeof d);
    return v;
}

SIMD_INLINE kernel_f64 kernel_f64_max(kernel_f64 a, kernel_f64 b)
{
    return kernel_f64_select((kernel_f64_mask)(b < a), a, b);
}

/* Returns v with each lane clamped to the interval [-limit, limit]. */
SIMD_INLINE kernel_f64 kernel_f64_clamp(kernel_f64 v, double limit)
{
    const kernel_f64 most = (kernel_f64){0} + limit;
    v = kernel_f64_select((kernel_f64_mask)(v < -most), -most, v);
    return kernel_f64_select((kernel_f64_mask)(most < v), most, v);
}

/* ---- vectors of SIMD_WIDTH doubles, stored as two halves ---- */

SIMD_INLINE void kernel_halves_widen(vf v, kernel_f64 out[2])
{
    for (int half = 0; half < 2; half++) out[half] = kernel_f64_widen_half(&v, half);
}

SIMD_INLINE vf kernel_halves_narrow(const kernel_f64 v[2])
{
    vf out;
    for (int half = 0; half < 2; half++) kernel_f64_store_half_of_vector(&out, half, v[half]);
    return out;
}

/* Returns the double in the given lane. */
SIMD_INLINE double kernel_halves_lane(const kernel_f64 v[2], int lane)
{
    return v[lane / KERNEL_HALF][lane % KERNEL_HALF];
}

#endif
