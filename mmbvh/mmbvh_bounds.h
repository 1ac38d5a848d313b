/* The boxes a tree is built over: a grid's cells', or given ones. */
#ifndef MMBVH_BOUNDS_H
#define MMBVH_BOUNDS_H

#include "mmbvh_branch.h"
#include "mmbvh_sweep.h"

typedef struct bounds_source {
    const grid *g;         /* NULL: the boxes are given */
    const uint32_t *cells; /* boxes are of these cells of the grid; NULL: of all */
    double origin[3];
    double scale;
    const float *lower, *upper; /* given boxes, count x 3 */
} bounds_source;

/* Boxes begin to end, ghosts passed over, each to its own place; set grows by them. */
typedef void (*bounds_fill)(const bounds_source *source, int64_t begin, int64_t end, branch_box *boxes, bin_set *set);

bounds_fill bounds_choose_fill(const grid *g);

#endif
