/* Defines a vector for one row of a strip: 16 numbers of 32 bits. The compiler splits the vector into registers of the
 * instruction set's width. */
#ifndef COMP_COMP_LANES_H
#define COMP_COMP_LANES_H

#include <stdint.h>
#include <string.h>
#if defined(__AVX512F__)
#include <immintrin.h>
#endif

#include "comp_grid.h"

#define ROWS_INLINE static inline __attribute__((always_inline))

typedef uint32_t lanes __attribute__((vector_size(4 * COMP_LANES)));
typedef int32_t signed_lanes __attribute__((vector_size(4 * COMP_LANES)));
typedef float float_lanes __attribute__((vector_size(4 * COMP_LANES)));
typedef uint16_t two_byte_lanes __attribute__((vector_size(2 * COMP_LANES)));
typedef uint8_t byte_lanes __attribute__((vector_size(COMP_LANES)));
typedef uint32_t quad __attribute__((vector_size(16)));

ROWS_INLINE lanes load_lanes(const uint32_t *from)
{
    lanes loaded;
    memcpy(&loaded, from, sizeof loaded);
    return loaded;
}

ROWS_INLINE void store_lanes(uint32_t *to, lanes values)
{
    memcpy(to, &values, sizeof values);
}

/* Returns a vector whose lanes in the mask have all bits set and whose other lanes are 0. */
ROWS_INLINE lanes mask_lanes(unsigned mask)
{
#if defined(__AVX512F__)
    return (lanes)_mm512_maskz_set1_epi32((__mmask16)mask, -1);
#endif
    const lanes bits = {1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1024, 2048, 4096, 8192, 16384, 32768};
    return (lanes)((mask & bits) == bits);
}

ROWS_INLINE lanes select_lanes(lanes which, lanes a, lanes b)
{
    return (which & a) | (~which & b);
}

/* Returns the bitwise OR of all lanes. */
ROWS_INLINE uint32_t or_all_lanes(lanes values)
{
    quad parts[4];
    uint64_t halves[2];
    memcpy(parts, &values, sizeof parts);
    parts[0] = (parts[0] | parts[1]) | (parts[2] | parts[3]);
    memcpy(halves, &parts[0], sizeof halves);
    halves[0] |= halves[1];
    return (uint32_t)(halves[0] | halves[0] >> 32);
}

#endif
