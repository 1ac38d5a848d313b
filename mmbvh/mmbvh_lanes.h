/* Vectors of eight 16-bit integers. Every supported processor has them without compiler flags. */
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

/* Returns the vector with its halves exchanged. */
static inline lanes lanes_swap(lanes a)
{
#if defined(__SSE2__)
    return (lanes)_mm_shuffle_epi32((__m128i)a, 0x4e);
#else
    return __builtin_shufflevector(a, a, 4, 5, 6, 7, 0, 1, 2, 3);
#endif
}

/* Returns the upper 16 bits of each lane's product, as unsigned numbers. */
static inline lanes lanes_multiply_high(lanes a, lanes factor)
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

/* Returns lanes 0 to 3, converted to signed 32-bit integers. */
static inline ivec4 lanes_lower(lanes a)
{
#if defined(__SSE2__)
    return (ivec4)_mm_unpacklo_epi16((__m128i)a, (__m128i)a) >> 16;
#else
    return (ivec4){a[0], a[1], a[2], a[3]};
#endif
}

/* Returns lanes 4 to 7, converted to signed 32-bit integers. */
static inline ivec4 lanes_upper(lanes a)
{
    return lanes_lower(lanes_swap(a));
}

/* Packs two vectors of 32-bit integers into lanes 0 to 3 (a) and 4 to 7 (b). The integers must be in the range of
 * int16_t. */
static inline lanes lanes_pack(ivec4 a, ivec4 b)
{
#if defined(__SSE2__)
    return (lanes)_mm_packs_epi32((__m128i)a, (__m128i)b);
#else
    return (lanes){(int16_t)a[0], (int16_t)a[1], (int16_t)a[2], (int16_t)a[3],
                   (int16_t)b[0], (int16_t)b[1], (int16_t)b[2], (int16_t)b[3]};
#endif
}

/* Multiplies the lanes, and returns the sums of the products of each even lane and the next one. */
static inline ivec4 lanes_multiply_add(lanes a, lanes b)
{
#if defined(__SSE2__)
    return (ivec4)_mm_madd_epi16((__m128i)a, (__m128i)b);
#else
    ivec4 sums;
    for (int i = 0; i < 4; i++) sums[i] = a[2 * i] * b[2 * i] + a[2 * i + 1] * b[2 * i + 1];
    return sums;
#endif
}

#endif
