/* Four floats at a time for the builder: three axes and one lane to spare. Every processor we build for has them
 * without an instruction set flag, so the builder is not a kernel of several instruction sets. */
#ifndef MMBVH_VEC4_H
#define MMBVH_VEC4_H

#include <stdbool.h>
#include <stdint.h>
#if defined(__SSE2__)
#include <emmintrin.h>
#endif

typedef float vec4 __attribute__((vector_size(16), may_alias));
typedef int32_t ivec4 __attribute__((vector_size(16), may_alias));

static inline vec4 vec4_set1(float x)
{
    return (vec4){x, x, x, x};
}

/* a where a < b, else b: a NaN in a is passed over. */
static inline vec4 vec4_min(vec4 a, vec4 b)
{
#if defined(__SSE2__)
    return (vec4)_mm_min_ps((__m128)a, (__m128)b);
#else
    const ivec4 less = (ivec4)(a < b);
    return (vec4)(((ivec4)a & less) | ((ivec4)b & ~less));
#endif
}

/* a where a > b, else b. */
static inline vec4 vec4_max(vec4 a, vec4 b)
{
#if defined(__SSE2__)
    return (vec4)_mm_max_ps((__m128)a, (__m128)b);
#else
    const ivec4 more = (ivec4)(a > b);
    return (vec4)(((ivec4)a & more) | ((ivec4)b & ~more));
#endif
}

/* The spare lane to zero. */
static inline vec4 vec4_xyz(vec4 a)
{
    return (vec4)((ivec4)a & (ivec4){-1, -1, -1, 0});
}

/* Towards zero; the lanes must be in an int's range. */
static inline ivec4 vec4_truncate(vec4 a)
{
#if defined(__SSE2__)
    return (ivec4)_mm_cvttps_epi32((__m128)a);
#else
    return __builtin_convertvector(a, ivec4);
#endif
}

static inline vec4 vec4_from_int(ivec4 a)
{
#if defined(__SSE2__)
    return (vec4)_mm_cvtepi32_ps((__m128i)a);
#else
    return __builtin_convertvector(a, vec4);
#endif
}

/* Are all lanes' sign bits set? */
static inline bool vec4_all(ivec4 a)
{
#if defined(__SSE2__)
    return _mm_movemask_ps((__m128)a) == 15;
#else
    return (a[0] & a[1] & a[2] & a[3]) < 0;
#endif
}

#endif
