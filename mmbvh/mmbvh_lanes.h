/* Eight 16-bit integers at a time, as every processor we build for has them without a flag. */
#ifndef MMBVH_LANES_H
#define MMBVH_LANES_H

#include "mmbvh_vec4.h"

typedef int16_t lanes __attribute__((vector_size(16), may_alias));
typedef uint16_t ulanes __attribute__((vector_size(16), may_alias));

static inline lanes lanes_set1(int x)
{
    const int16_t y = (int16_t)x;
    return (lanes){y, y, y, y, y, y, y, y};
}

static inline lanes lanes_max(lanes a, lanes b)
{
#if defined(__SSE2__)
    return (lanes)_mm_max_epi16((__m128i)a, (__m128i)b);
#else
    const lanes more = (lanes)(a > b);
    return (a & more) | (b & ~more);
#endif
}

/* The halves exchanged. */
static inline lanes lanes_swap(lanes a)
{
#if defined(__SSE2__)
    return (lanes)_mm_shuffle_epi32((__m128i)a, 0x4e);
#else
    return __builtin_shufflevector(a, a, 4, 5, 6, 7, 0, 1, 2, 3);
#endif
}

/* The upper halves of the products, all unsigned. */
static inline lanes lanes_scale(lanes a, lanes factor)
{
#if defined(__SSE2__)
    return (lanes)_mm_mulhi_epu16((__m128i)a, (__m128i)factor);
#else
    lanes product;
    for (int i = 0; i < 8; i++) {
        product[i] = (int16_t)(uint16_t)(((uint32_t)(uint16_t)a[i] * (uint32_t)(uint16_t)factor[i]) >> 16);
    }
    return product;
#endif
}

/* Lanes 0 to 3, signed. */
static inline vec4 lanes_to_vec4(lanes a)
{
#if defined(__SSE2__)
    return (vec4)_mm_cvtepi32_ps(_mm_srai_epi32(_mm_unpacklo_epi16((__m128i)a, (__m128i)a), 16));
#else
    return (vec4){a[0], a[1], a[2], a[3]};
#endif
}

#endif
