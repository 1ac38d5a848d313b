/* Writing nodes, whatever their layout. */
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

/* The grid of a compact layout, over a box that must be finite. */
mmbvh_grid store_grid(const float lower[3], const float upper[3]);

/* Where the quick way rounds the wrong way: a step further at a time. False where the grid ends before. */
bool store_compact_slowly(const mmbvh *tree, int64_t index, const float lower[4], const float upper[4]);

static inline bool store_holds(const mmbvh *tree, int64_t index, const float lower[4], const float upper[4])
{
    float low[4], high[4];
    compact_box(&tree->compact[index], &tree->grid, low, high);
    return low[0] <= lower[0] && low[1] <= lower[1] && low[2] <= lower[2] && high[0] >= upper[0] &&
           high[1] >= upper[1] && high[2] >= upper[2];
}

/* To the nearest of what the layout has outside the box. False where the compact layout's grid does not reach so far.
 */
static inline bool store_box(const mmbvh *tree, int64_t index, const float lower[4], const float upper[4])
{
    if (!tree->compact) {
        mmbvh_node *node = &tree->nodes[index];
        for (int axis = 0; axis < 3; axis++) {
            node->lower[axis] = lower[axis];
            node->upper[axis] = upper[axis];
        }
        return true;
    }
    const vec4 origin = *(const compact_vec4 *)(const void *)tree->grid.origin;
    const vec4 step = *(const compact_vec4 *)(const void *)tree->grid.step;
    const vec4 low = *(const compact_vec4 *)(const void *)lower, high = *(const compact_vec4 *)(const void *)upper;
    const vec4 zero = {0}, inverse = 1.0f / step;
    const vec4 place = vec4_min(vec4_max((low - origin) * inverse, zero), vec4_set1(COMPACT_LOWER_MAX));
    const ivec4 word = vec4_truncate(place);
    const vec4 extent = vec4_max((high - (vec4_from_int(word) * step + origin)) * inverse, zero) + 16.0f;
    const int shift = 23 - COMPACT_MANTISSA_BITS;
    const ivec4 code = (((ivec4)extent + ((1 << shift) - 1)) - COMPACT_ONE) >> shift;
    const ivec4 most = {COMPACT_EXTENT_MAX, COMPACT_EXTENT_MAX, COMPACT_EXTENT_MAX, COMPACT_EXTENT_MAX};
    const ivec4 over = (ivec4)(code > most);
    const ivec4 words = word | ((code & ~over) | (most & over)) << COMPACT_LOWER_BITS;
    for (int axis = 0; axis < 3; axis++) tree->compact[index].axis[axis] = (uint32_t)words[axis];
    return store_holds(tree, index, lower, upper) || store_compact_slowly(tree, index, lower, upper);
}

#endif
