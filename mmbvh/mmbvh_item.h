/* A cell during the construction of a SAH tree: its box and index in one vector of 16 bytes.
 *
 *     lane     0   1   2     3       4  5  6     7
 *           TOP - lower   index    upper      index           lower, upper: 0 .. TOP, in steps of an item_grid
 *                         (low)               (high)
 *
 * The union of two boxes is therefore the maximum of each lane. Subtracting the vector with its halves exchanged gives
 * twice the centroid minus TOP in the upper half, and the negative of that in the lower half; bounds of centroids are
 * therefore maxima too. TOP is ITEM_TOP. The rounded boxes of items determine only the choice of planes, not the bounds
 * of the nodes. */
#ifndef MMBVH_ITEM_H
#define MMBVH_ITEM_H

#include <stdbool.h>

#include "mmbvh_lanes.h"

enum { ITEM_TOP = 32767 };

typedef lanes item;

/* A grid in the tree's coordinates. The steps have the same length on all axes, so that surface areas are products of
 * steps. */
typedef struct item_grid {
    double origin[3];
    double step;            /* length of a step; 0 if no axis has a finite extent */
    double inverse_step[3]; /* 1 / step for each axis, or 0 on an axis without a finite extent */
    bool is_finest;         /* set if a finer grid would not distinguish more cells */
} item_grid;

/* The bounds of a set of items and of their centroids. */
typedef struct item_set {
    lanes bounds;
    lanes centroids;
} item_set;

static inline uint32_t item_index(item i)
{
    return (uint32_t)(uint16_t)i[3] | (uint32_t)(uint16_t)i[7] << 16;
}

/* Returns an item that has an index but no box yet. */
static inline item item_of_index(uint32_t index)
{
    return (item){0, 0, 0, (int16_t)(uint16_t)(index & 0xffff), 0, 0, 0, (int16_t)(uint16_t)(index >> 16)};
}

/* Returns (2 * centroid - TOP) in lanes 4 to 6, and its negative in lanes 0 to 2. */
static inline lanes item_centroid(item i)
{
    return (lanes)((ulanes)i - (ulanes)lanes_swap(i)); /* the lanes that hold the index may wrap around */
}

static inline item_set item_set_empty(void)
{
    return (item_set){lanes_set1(INT16_MIN), lanes_set1(INT16_MIN)};
}

static inline void item_set_add(item_set *set, item i)
{
    set->bounds = lanes_max(set->bounds, i);
    set->centroids = lanes_max(set->centroids, item_centroid(i));
}

static inline void item_set_merge(item_set *set, const item_set *other)
{
    set->bounds = lanes_max(set->bounds, other->bounds);
    set->centroids = lanes_max(set->centroids, other->centroids);
}

static inline item_set item_set_of(const item *items, int64_t count)
{
    item_set set = item_set_empty(), other = set;
    for (int64_t i = 0; i < count / 2; i++) {
        item_set_add(&set, items[2 * i]);
        item_set_add(&other, items[2 * i + 1]);
    }
    if (count & 1) item_set_add(&set, items[count - 1]);
    item_set_merge(&set, &other);
    return set;
}

/* Returns a box's extent in steps, in lanes 0 to 2. */
static inline lanes item_extent(lanes box)
{
    return (lanes)((ulanes)box + (ulanes)lanes_swap(box) -
                   (ulanes)lanes_set1(ITEM_TOP)); /* the extent of an empty box wraps around */
}

/* Returns half the surface area as two summands, xy + yz and zx, for two boxes whose extents are in lanes 0 to 2 and in
 * lanes 4 to 6. Lanes 0 and 1 of the result belong to the first box, lanes 2 and 3 to the second one. Lanes 3 and 7 of
 * the extents are ignored. */
static inline ivec4 item_half_area_summands(lanes extents)
{
    const lanes turned = __builtin_shufflevector(extents, extents, 1, 2, 0, 3, 5, 6, 4, 7);
    return lanes_multiply_add(extents, turned & (lanes){-1, -1, -1, 0, -1, -1, -1, 0});
}

/* Returns half the surface area of a box, in squared steps. */
static inline float item_half_area(lanes box)
{
    const vec4 terms = vec4_from_int(item_half_area_summands(item_extent(box)));
    return terms[0] + terms[1];
}

/* Returns the grid over a box, with ITEM_TOP steps on its longest side. */
item_grid item_grid_make(const double lower[3], const double upper[3]);

/* Rounds a box of doubles to the nearest steps of the grid. */
static inline item item_make(const item_grid *grid, const double lower[3], const double upper[3], uint32_t index)
{
    item made;
    for (int axis = 0; axis < 3; axis++) {
        const double low = (lower[axis] - grid->origin[axis]) * grid->inverse_step[axis] + 0.5;
        const double high = (upper[axis] - grid->origin[axis]) * grid->inverse_step[axis] + 0.5;
        made[axis] = (int16_t)(ITEM_TOP - (int)(low > 0 ? low < ITEM_TOP ? low : ITEM_TOP : 0));
        made[4 + axis] = (int16_t)(high > 0 ? high < ITEM_TOP ? high : ITEM_TOP : 0);
    }
    made[3] = (int16_t)(uint16_t)(index & 0xffff);
    made[7] = (int16_t)(uint16_t)(index >> 16);
    return made;
}

#endif
