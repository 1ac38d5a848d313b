/* The boxes over which a tree is built: either the bounds of a grid's cells, or boxes that the caller gives. */
#ifndef MMBVH_BOUNDS_H
#define MMBVH_BOUNDS_H

#include "mmbvh_fetch.h"
#include "mmbvh_item.h"
#include "mmbvh_sweep.h"

/* Reads the boxes of `count` cells. The boxes are in the source's coordinates, which are those of the grid or of the
 * given boxes; they are not transformed to the tree's coordinates. */
typedef void bounds_read(const bounds_source *source, const uint32_t *cells, int count, fetch_box *boxes);

/* Reads the boxes of `count` cells as boxes of floats, without transforming them to the tree's coordinates. Used only
 * if all coordinates are floats. */
typedef void bounds_read_float_boxes(const bounds_source *source, const uint32_t *cells, int count,
                                     fetch_float_box *float_boxes);

/* Extends *box by the boxes of `count` cells. `later` lists `count` cells that will be read soon, so that their data
 * can be prefetched; NULL: none. */
typedef void bounds_extend(const bounds_source *source, const uint32_t *cells, int count, const uint32_t *later,
                           fetch_box *box);

struct bounds_source {
    const grid *g;    /* grid whose cells are read; NULL if the boxes are given */
    double origin[3]; /* origin and scale define the tree's coordinates, (position - origin) * scale */
    double scale;
    const float *lower, *upper; /* corners of the given boxes, count × 3 values */
    int64_t box_count;          /* number of boxes, including those of ghosts */
    bounds_read *read;
    bounds_read_float_boxes *read_float_boxes; /* reads boxes as floats; NULL unless all coordinates are floats */
    bounds_extend *extend;
};

enum { BOUNDS_BLOCK = 64 }; /* number of boxes that are read at once */

/* Returns a source that reads the cells of g, or the given boxes if g is NULL. */
bounds_source bounds_source_make(const grid *g, const float *lower, const float *upper, int64_t count,
                                 const double origin[3], double scale);

/* Transforms a box from the source's coordinates to the tree's, without rounding outward. */
static inline void bounds_transform(const bounds_source *source, fetch_box *box)
{
    for (int axis = 0; axis < 3; axis++) {
        box->lower[axis] = (box->lower[axis] - source->origin[axis]) * source->scale;
        box->upper[axis] = (box->upper[axis] - source->origin[axis]) * source->scale;
    }
}

/* Returns the box of all vertices with finite coordinates, in the tree's coordinates. It contains all cells whose
 * coordinates are finite, but is larger than necessary if some vertices belong to no cell. */
fetch_box bounds_estimate(const bounds_source *source, int threads);

/* Computes the boxes of `count` items from the cells whose indices the caller has stored in the items. Extends *set by
 * these boxes and their centroids, and *exact by the unquantized boxes of the cells in the source's coordinates. exact
 * may be NULL. */
void bounds_fill_items(const bounds_source *source, const item_grid *grid, item *items, int64_t count, item_set *set,
                       fetch_box *exact);

#endif
