/* Defines the compact node layout: 24 bytes per node instead of the 40 bytes of the thesis's node.
 *
 * The tree has a grid of 2^20 steps per axis; a step is a power of two. A box has one 32-bit word per axis: its lower
 * bound in whole steps in the low bits, and its extent as a small floating-point number in the high bits. A box is
 * rounded by about a millionth of the tree's size or 1/256 of the box's size, whichever is larger, so that boxes of
 * cells much smaller than others still have a useful shape:
 *
 *      31    28 27          20 19                     0
 *     | exponent | mantissa   | lower bound in steps   |     extent = 16 (1 + mantissa / 256) 2^exponent - 16
 *
 * Decoding all three axes takes one load and about ten operations on four floats, without a table and without
 * denormals. Products with steps are exact, because steps are powers of two; a fused multiply-add therefore gives the
 * same result. */
#ifndef MMBVH_COMPACT_H
#define MMBVH_COMPACT_H

#include "mmbvh_vec4.h"

enum {
    COMPACT_LOWER_BITS = 20,
    COMPACT_EXTENT_BITS = 32 - COMPACT_LOWER_BITS,
    COMPACT_MANTISSA_BITS = COMPACT_EXTENT_BITS - 4,
    COMPACT_LOWER_MAX = (1 << COMPACT_LOWER_BITS) - 1,
    COMPACT_EXTENT_MAX = (1 << COMPACT_EXTENT_BITS) - 1,
    COMPACT_ONE = (127 + 4) << 23, /* bit pattern of 16.0f, which encodes an extent of 0 */
    COMPACT_REF_BITS = 29
};

typedef struct mmbvh_compact_node {
    uint32_t axis[3];
    uint32_t link; /* number of cells in the 3 low bits, reference in the other bits; both as in mmbvh_node */
    float range_low;
    float range_high;
} mmbvh_compact_node;

typedef struct mmbvh_grid {
    float origin[4];
    float step[4]; /* step of each axis, a power of two; element 3 of origin and step is 0 */
} mmbvh_grid;

typedef float compact_vec4 __attribute__((vector_size(16), may_alias, aligned(4)));
typedef int32_t compact_ivec4 __attribute__((vector_size(16), may_alias, aligned(4)));

/* Decodes the words of three axes to the corners of the box. Lane 3 of both corners is 0. */
static inline void compact_decode_words(ivec4 word, const mmbvh_grid *grid, vec4 *lower, vec4 *upper)
{
    const vec4 step = *(const compact_vec4 *)(const void *)grid->step;
    const vec4 origin = *(const compact_vec4 *)(const void *)grid->origin;
    const ivec4 bits = (word >> (COMPACT_LOWER_BITS + COMPACT_MANTISSA_BITS - 23)) &
                       (COMPACT_EXTENT_MAX << (23 - COMPACT_MANTISSA_BITS));
    const vec4 extent = (vec4)(bits + COMPACT_ONE) - 16.0f;
    *lower = vec4_from_int(word & COMPACT_LOWER_MAX) * step + origin;
    *upper = extent * step + *lower;
}

static inline void compact_decode(const mmbvh_compact_node *node, const mmbvh_grid *grid, vec4 *lower, vec4 *upper)
{
    compact_decode_words(*(const compact_ivec4 *)(const void *)node, grid, lower, upper);
}

static inline void compact_box(const mmbvh_compact_node *node, const mmbvh_grid *grid, float lower[4], float upper[4])
{
    vec4 low, high;
    compact_decode(node, grid, &low, &high);
    *(compact_vec4 *)(void *)lower = low;
    *(compact_vec4 *)(void *)upper = high;
}

#endif
