/* The boxes a tree is built over: a grid's cells', or given ones. */
#ifndef MMBVH_BOUNDS_H
#define MMBVH_BOUNDS_H

#include "mmbvh_fetch.h"
#include "mmbvh_item.h"
#include "mmbvh_sweep.h"

/* Reads the boxes of so many cells, in the source's own coordinates. */
typedef void bounds_read(const bounds_source *source, const uint32_t *cells, int count, fetch_box *boxes);

/* As above, for coordinates that are floats. */
typedef void bounds_read_spans(const bounds_source *source, const uint32_t *cells, int count, fetch_span *spans);

/* box grows by so many cells. As many from soon on, if not NULL, will be read later and may be prefetched. */
typedef void bounds_unite(const bounds_source *source, const uint32_t *cells, int count, const uint32_t *soon,
                          fetch_box *box);

struct bounds_source {
    const grid *g; /* NULL: the boxes are given */
    double origin[3];
    double scale;
    const float *lower, *upper; /* given boxes, count x 3 */
    int64_t box_count;          /* with ghosts */
    bounds_read *read;
    bounds_read_spans *read_spans; /* NULL: not all coordinates are floats */
    bounds_unite *unite;
};

enum { BOUNDS_BLOCK = 64 }; /* boxes that are read at a time */

/* g NULL: given boxes. */
bounds_source bounds_source_make(const grid *g, const float *lower, const float *upper, int64_t count,
                                 const double origin[3], double scale);

/* Takes a box from the source's coordinates to the tree's, without rounding outward. */
static inline void bounds_transform(const bounds_source *source, fetch_box *box)
{
    for (int axis = 0; axis < 3; axis++) {
        box->lower[axis] = (box->lower[axis] - source->origin[axis]) * source->scale;
        box->upper[axis] = (box->upper[axis] - source->origin[axis]) * source->scale;
    }
}

/* Quickly finds a box, in the tree's coordinates, that holds all cells whose coordinates are numbers: the box of all
 * vertices, used by cells or not. */
fetch_box bounds_guess(const bounds_source *source, int threads);

/* Gives boxes to items that have only an index. set grows by them, and exact, if not NULL, by the boxes in the source's
 * coordinates. */
void bounds_place(const bounds_source *source, const item_grid *grid, item *items, int64_t count, item_set *set,
                  fetch_box *exact);

#endif
