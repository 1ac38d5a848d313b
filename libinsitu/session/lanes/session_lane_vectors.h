/* Defines vectors of doubles, and vectors of the same number of floats, for the instruction set for which the including
 * file is compiled; simd.h does not have vectors with equal numbers of floats and doubles. The minimum (maximum) of a
 * and b is `a` if it is less (greater) than `b`, and otherwise `b`, so that a NaN in `a` is ignored. */
#ifndef SESSION_LANE_VECTORS_H
#define SESSION_LANE_VECTORS_H

#include <stdbool.h>
#include <stdint.h>
#include <string.h>
#if defined(__SSE2__)
#include <immintrin.h>
#endif

#if defined(__AVX512F__)
#define LANE_WIDTH 8
#else
#define LANE_WIDTH 4 /* on SSE2, a vector of doubles takes two registers */
#endif

#define LANE_INLINE static inline __attribute__((always_inline))

typedef double doubles __attribute__((vector_size(8 * LANE_WIDTH), may_alias));
typedef int64_t words __attribute__((vector_size(8 * LANE_WIDTH), may_alias));
typedef uint64_t bits __attribute__((vector_size(8 * LANE_WIDTH), may_alias));
typedef float floats __attribute__((vector_size(4 * LANE_WIDTH), may_alias));

LANE_INLINE doubles doubles_set(double x)
{
    doubles v;
    for (int lane = 0; lane < LANE_WIDTH; lane++) v[lane] = x;
    return v;
}

LANE_INLINE floats floats_set(float x)
{
    floats v;
    for (int lane = 0; lane < LANE_WIDTH; lane++) v[lane] = x;
    return v;
}

LANE_INLINE doubles doubles_load(const double *p)
{
    doubles v;
    memcpy(&v, p, sizeof v);
    return v;
}

LANE_INLINE void doubles_store(double *p, doubles v)
{
    memcpy(p, &v, sizeof v);
}

#if defined(__SSE2__) && LANE_WIDTH == 4
typedef struct doubles_halves {
    __m128d low, high;
} doubles_halves;
#endif

LANE_INLINE doubles doubles_min(doubles a, doubles b)
{
#if defined(__AVX512F__)
    return (doubles)_mm512_min_pd((__m512d)a, (__m512d)b);
#elif defined(__AVX2__)
    return (doubles)_mm256_min_pd((__m256d)a, (__m256d)b);
#elif defined(__SSE2__)
    doubles_halves x, y;
    memcpy(&x, &a, sizeof x);
    memcpy(&y, &b, sizeof y);
    x.low = _mm_min_pd(x.low, y.low);
    x.high = _mm_min_pd(x.high, y.high);
    memcpy(&a, &x, sizeof a);
    return a;
#else
    for (int lane = 0; lane < LANE_WIDTH; lane++) a[lane] = a[lane] < b[lane] ? a[lane] : b[lane];
    return a;
#endif
}

LANE_INLINE doubles doubles_max(doubles a, doubles b)
{
#if defined(__AVX512F__)
    return (doubles)_mm512_max_pd((__m512d)a, (__m512d)b);
#elif defined(__AVX2__)
    return (doubles)_mm256_max_pd((__m256d)a, (__m256d)b);
#elif defined(__SSE2__)
    doubles_halves x, y;
    memcpy(&x, &a, sizeof x);
    memcpy(&y, &b, sizeof y);
    x.low = _mm_max_pd(x.low, y.low);
    x.high = _mm_max_pd(x.high, y.high);
    memcpy(&a, &x, sizeof a);
    return a;
#else
    for (int lane = 0; lane < LANE_WIDTH; lane++) a[lane] = a[lane] > b[lane] ? a[lane] : b[lane];
    return a;
#endif
}

LANE_INLINE floats floats_min(floats a, floats b)
{
#if defined(__AVX512F__)
    return (floats)_mm256_min_ps((__m256)a, (__m256)b);
#elif defined(__SSE2__)
    return (floats)_mm_min_ps((__m128)a, (__m128)b);
#else
    for (int lane = 0; lane < LANE_WIDTH; lane++) a[lane] = a[lane] < b[lane] ? a[lane] : b[lane];
    return a;
#endif
}

LANE_INLINE floats floats_max(floats a, floats b)
{
#if defined(__AVX512F__)
    return (floats)_mm256_max_ps((__m256)a, (__m256)b);
#elif defined(__SSE2__)
    return (floats)_mm_max_ps((__m128)a, (__m128)b);
#else
    for (int lane = 0; lane < LANE_WIDTH; lane++) a[lane] = a[lane] > b[lane] ? a[lane] : b[lane];
    return a;
#endif
}

/* Converts floats to doubles. On AVX-512 an intrinsic replaces the built-in conversion, because gcc 12 compiles the
 * latter to two conversions of four floats each. */
LANE_INLINE doubles doubles_from_floats(floats v)
{
#if defined(__AVX512F__)
    return (doubles)_mm512_cvtps_pd((__m256)v);
#else
    return __builtin_convertvector(v, doubles);
#endif
}

LANE_INLINE doubles doubles_magnitude(doubles v)
{
    return (doubles)((words)v & INT64_MAX);
}

/* Returns whether any bit of the vector is set. */
LANE_INLINE bool words_any(words v)
{
    int64_t any = 0;
    for (int lane = 0; lane < LANE_WIDTH; lane++) any |= v[lane];
    return any != 0;
}

#endif
