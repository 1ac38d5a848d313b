/* Vectors of four floats (three axes and an unused lane, or four values) and of two doubles. Every supported processor
 * has them without compiler flags, so that trees need no kernels for several instruction sets. */
#ifndef MMBVH_VEC4_H
#define MMBVH_VEC4_H

#include <stdbool.h>
#include <stdint.h>
#include <string.h>
#if defined(__SSE2__)
#include <emmintrin.h>
#endif

typedef float vec4 __attribute__((vector_size(16), may_alias));
typedef int32_t ivec4 __attribute__((vector_size(16), may_alias));

static inline vec4 vec4_set1(float x)
{
    return (vec4){x, x, x, x};
}

/* Returns a if a < b, otherwise b, per lane. A NaN in a is therefore ignored. */
static inline vec4 vec4_min(vec4 a, vec4 b)
{
#if defined(__SSE2__)
    return (vec4)_mm_min_ps((__m128)a, (__m128)b);
#else
    const ivec4 less = (ivec4)(a < b);
    return (vec4)(((ivec4)a & less) | ((ivec4)b & ~less));
#endif
}

/* Returns a if a > b, otherwise b, per lane. */
static inline vec4 vec4_max(vec4 a, vec4 b)
{
#if defined(__SSE2__)
    return (vec4)_mm_max_ps((__m128)a, (__m128)b);
#else
    const ivec4 more = (ivec4)(a > b);
    return (vec4)(((ivec4)a & more) | ((ivec4)b & ~more));
#endif
}

static inline float vec4_min_lane(vec4 a)
{
    const vec4 two = vec4_min(a, (vec4){a[2], a[3], a[2], a[3]});
    return two[0] < two[1] ? two[0] : two[1];
}

static inline float vec4_max_lane(vec4 a)
{
    const vec4 two = vec4_max(a, (vec4){a[2], a[3], a[2], a[3]});
    return two[0] > two[1] ? two[0] : two[1];
}

/* Vectors of two doubles. Like vec4_min() and vec4_max(), vec2_min() and vec2_max() ignore a NaN in their first
 * argument. */
typedef double vec2 __attribute__((vector_size(16), may_alias));
typedef int64_t ivec2 __attribute__((vector_size(16), may_alias));

static inline vec2 vec2_set1(double x)
{
    return (vec2){x, x};
}

static inline vec2 vec2_min(vec2 a, vec2 b)
{
#if defined(__SSE2__)
    return (vec2)_mm_min_pd((__m128d)a, (__m128d)b);
#else
    const ivec2 less = (ivec2)(a < b);
    return (vec2)(((ivec2)a & less) | ((ivec2)b & ~less));
#endif
}

static inline vec2 vec2_max(vec2 a, vec2 b)
{
#if defined(__SSE2__)
    return (vec2)_mm_max_pd((__m128d)a, (__m128d)b);
#else
    const ivec2 more = (ivec2)(a > b);
    return (vec2)(((ivec2)a & more) | ((ivec2)b & ~more));
#endif
}

/* Sets lane 3 to 0. */
static inline vec4 vec4_xyz(vec4 a)
{
    return (vec4)((ivec4)a & (ivec4){-1, -1, -1, 0});
}

/* Rounds towards 0; the results must be in the range of int. */
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

/* round_down() rounds a double to the nearest float that is not above x, round_up() to the nearest float that is not
 * below x. Outside the range of float the result is the largest finite float or infinity, whichever is in the direction
 * of rounding. A zero result is always positive, so that equal bounds are bitwise equal. */
static inline float round_down(double x)
{
    float f = (float)x;
    uint32_t bits;
    memcpy(&bits, &f, sizeof bits);
    /* adding `step` to the bits moves the result to the next float towards -inf: the bits of positive floats decrease
     * towards -inf, those of negative floats increase */
    const uint32_t step = bits >> 31 ? 1u : UINT32_MAX;
    bits += (double)f > x ? step : 0u; /* f is never +0 if it exceeds x: a tiny negative x rounds to -0 */
    memcpy(&f, &bits, sizeof f);
    return f + 0.0f;
}

static inline float round_up(double x)
{
    return 0.0f - round_down(-x);
}

/* Returns round_down((a - origin) * scale) per lane, computed in double. */
static inline vec4 vec4_transform_down(vec4 a, const double origin[4], double scale)
{
#if defined(__SSE2__)
    const __m128 both = (__m128)a;
    const __m128d factor = _mm_set1_pd(scale);
    const __m128d x01 = (_mm_cvtps_pd(both) - _mm_loadu_pd(origin)) * factor;
    const __m128d x23 = (_mm_cvtps_pd(_mm_movehl_ps(both, both)) - _mm_loadu_pd(origin + 2)) * factor;
    const __m128 nearest = _mm_movelh_ps(_mm_cvtpd_ps(x01), _mm_cvtpd_ps(x23));
    const __m128d over01 = _mm_cmpgt_pd(_mm_cvtps_pd(nearest), x01);
    const __m128d over23 = _mm_cmpgt_pd(_mm_cvtps_pd(_mm_movehl_ps(nearest, nearest)), x23);
    const ivec4 over = (ivec4)_mm_shuffle_ps((__m128)over01, (__m128)over23, 0x88);
    /* all ones for a negative float; towards -inf, the bits of negative floats increase and those of positive floats
     * decrease */
    const ivec4 sign = (ivec4)nearest >> 31;
    return (vec4)((ivec4)nearest + (over & ~(sign + sign))) + 0.0f;
#else
    vec4 placed;
    for (int i = 0; i < 4; i++) placed[i] = round_down(((double)a[i] - origin[i]) * scale);
    return placed;
#endif
}

/* Returns whether the sign bit of any lane is set. */
static inline bool vec4_any(ivec4 a)
{
#if defined(__SSE2__)
    return _mm_movemask_ps((__m128)a) != 0;
#else
    return (a[0] | a[1] | a[2] | a[3]) < 0;
#endif
}

/* Returns whether the sign bits of all lanes are set. */
static inline bool vec4_all(ivec4 a)
{
#if defined(__SSE2__)
    return _mm_movemask_ps((__m128)a) == 15;
#else
    return (a[0] & a[1] & a[2] & a[3]) < 0;
#endif
}

#endif
