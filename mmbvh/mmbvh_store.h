/* Stores and reads the boxes of a tree's nodes, in the reference layout or in the compact layout (mmbvh_layout in
 * mmbvh.h). */
#ifndef MMBVH_STORE_H
#define MMBVH_STORE_H

#include "mmbvh.h"

static inline void store_link(const mmbvh *tree, int64_t index, int64_t ref, int count)
{
    if (tree->compact) {
        tree->compact[index].link = (uint32_t)ref << 3 | (uint32_t)count;
        return;
    }
    tree->nodes[index].ref = (uint64_t)ref & (UINT64_MAX >> 3);
    tree->nodes[index].count = (unsigned)count & 7;
}

/* Returns the quantization grid of the compact layout for a tree whose boxes all lie in the given box. The coordinates
 * of the given box must be finite. */
mmbvh_grid store_make_grid(const float lower[3], const float upper[3]);

/* Corrects the box that store_compact() has stored in a node if rounding has made it too small: enlarges the stored box
 * step by step, until it contains the box from `lower` to `upper`. Returns false if the box from `lower` to `upper` is
 * not within the grid. */
bool store_compact_slowly(const mmbvh *tree, int64_t index, vec4 lower, vec4 upper);

/* Stores the smallest representable box that contains the given box. The given box is in lanes 0 to 2; lane 3 must be
 * 0. Returns false if the given box is not within the grid. */
static inline bool store_compact(const mmbvh *tree, int64_t index, vec4 lower, vec4 upper)
{
    mmbvh_compact_node *node = &tree->compact[index];
    const vec4 origin = *(const compact_vec4 *)(const void *)tree->grid.origin;
    const vec4 step = *(const compact_vec4 *)(const void *)tree->grid.step;
    const vec4 zero = {0},
               inverse = (vec4)(0x7f000000 - (ivec4)step); /* 1 / step; a step is a power of two, so that its inverse is
                                                              computed by negating its exponent */
    const ivec4 place =
        vec4_truncate(vec4_min(vec4_max((lower - origin) * inverse, zero), vec4_set1(COMPACT_LOWER_MAX)));
    const vec4 extent = vec4_max((upper - (vec4_from_int(place) * step + origin)) * inverse, zero) + 16.0f;
    const int shift = 23 - COMPACT_MANTISSA_BITS;
    const ivec4 code = ((ivec4)extent + ((1 << shift) - 1) - COMPACT_ONE) >> shift;
    const ivec4 over = (ivec4)(code > COMPACT_EXTENT_MAX);
    const ivec4 words = place | ((code & ~over) | (COMPACT_EXTENT_MAX & over)) << COMPACT_LOWER_BITS;
    for (int axis = 0; axis < 3; axis++) node->axis[axis] = (uint32_t)words[axis];
    vec4 low, high;
    compact_decode_words(words, &tree->grid, &low, &high);
    const ivec4 holds = (ivec4)(low <= lower) & (ivec4)(high >= upper);
    return vec4_all(holds) || store_compact_slowly(tree, index, lower, upper);
}

static inline void store_reference(const mmbvh *tree, int64_t index, vec4 lower, vec4 upper)
{
    mmbvh_node *node = &tree->nodes[index];
    for (int axis = 0; axis < 3; axis++) {
        node->lower[axis] = lower[axis];
        node->upper[axis] = upper[axis];
    }
}

/* Stores a box in the node, rounded outward. Returns false if the grid of the compact layout cannot represent it. */
static inline bool store_box(const mmbvh *tree, int64_t index, vec4 lower, vec4 upper)
{
    if (tree->compact) return store_compact(tree, index, lower, upper);
    store_reference(tree, index, lower, upper);
    return true;
}

/* Reads a node's box as two corners whose lane 3 is 0. */
static inline void store_read_box(const mmbvh *tree, int64_t index, vec4 *lower, vec4 *upper)
{
    if (tree->compact) {
        compact_decode(&tree->compact[index], &tree->grid, lower, upper);
        return;
    }
    const mmbvh_node *node = &tree->nodes[index];
    *lower = (vec4){node->lower[0], node->lower[1], node->lower[2], 0};
    *upper = (vec4){node->upper[0], node->upper[1], node->upper[2], 0};
}

#endif
