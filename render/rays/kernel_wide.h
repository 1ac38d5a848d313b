/* Vectors of doubles, and permutations that give each ray the numbers of its own cell. A kernel_half has SIMD_WIDTH / 2
 * doubles and fills one register; compilers split larger vectors and compare their lanes one by one. */
#ifndef RENDER_KERNEL_WIDE_H
#define RENDER_KERNEL_WIDE_H

#include <stdint.h>
#include <string.h>

#include "simd.h"

enum { KERNEL_HALF = SIMD_WIDTH / 2 };
typedef vd kernel_half;
typedef int64_t kernel_half_mask __attribute__((vector_size(8 * KERNEL_HALF)));
typedef float kernel_half_floats __attribute__((vector_size(4 * KERNEL_HALF)));

/* Returns of[lane] for each ray, where `lane` is the lane that holds the ray's cell. */
SIMD_INLINE vf kernel_gather_lane(const float *of, vi lane)
{
    return vf_permute(vf_load(of), lane);
}

SIMD_INLINE kernel_half kernel_half_widen(kernel_half_floats v)
{
    return __builtin_convertvector(v, kernel_half);
}

SIMD_INLINE kernel_half_floats kernel_half_narrow(kernel_half v)
{
    return __builtin_convertvector(v, kernel_half_floats);
}

/* Returns the first half (0) or the second half (1) of a mask's lanes. */
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

/* Returns the first half (0) or the second half (1) of v's lanes, converted to double. */
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

/* Returns v with each lane clamped to the interval [-limit, limit]. */
SIMD_INLINE kernel_half kernel_half_hold(kernel_half v, double limit)
{
    const kernel_half most = (kernel_half){0} + limit;
    v = kernel_half_select((kernel_half_mask)(v < -most), -most, v);
    return kernel_half_select((kernel_half_mask)(most < v), most, v);
}

/* A vector of SIMD_WIDTH doubles, one per lane, stored as two halves. */
typedef struct kernel_whole {
    kernel_half half[2];
} kernel_whole;

SIMD_INLINE vm kernel_whole_lt(const kernel_whole *a, const kernel_whole *b)
{
    return vd_lt(a->half, b->half);
}

SIMD_INLINE vm kernel_whole_eq(const kernel_whole *a, const kernel_whole *b)
{
    return vd_eq(a->half, b->half);
}

SIMD_INLINE kernel_whole kernel_whole_select(vm m, const kernel_whole *a, const kernel_whole *b)
{
    kernel_whole out;
    vd_select(m, a->half, b->half, out.half);
    return out;
}

SIMD_INLINE kernel_whole kernel_whole_set(double x)
{
    const kernel_half all = (kernel_half){0} + x;
    return (kernel_whole){{all, all}};
}

SIMD_INLINE kernel_whole kernel_whole_widen(vf v)
{
    return (kernel_whole){{kernel_half_of(&v, 0), kernel_half_of(&v, 1)}};
}

SIMD_INLINE vf kernel_whole_narrow(const kernel_whole *v)
{
    vf out;
    for (int half = 0; half < 2; half++) kernel_half_put(&out, half, v->half[half]);
    return out;
}

/* Returns the double in the given lane. */
SIMD_INLINE double kernel_whole_lane(const kernel_whole *v, int lane)
{
    return v->half[lane / KERNEL_HALF][lane % KERNEL_HALF];
}

#endif
