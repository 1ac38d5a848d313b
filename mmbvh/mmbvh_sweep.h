/* Bottom-up passes over a tree: leaves from their cells, inner nodes from their children.
 *
 * Nodes are numbered depth first by pairs, so all below a node are one run of indices, children after parents: a run
 * swept backwards meets every child before its parent, and the runs below two siblings are independent work. */
#ifndef MMBVH_SWEEP_H
#define MMBVH_SWEEP_H

#include "mmbvh.h"

typedef struct sweep sweep;
typedef struct bounds_source bounds_source;

/* Nodes end - 1 down to first; returns how many cells were found unusable, or boxes that the nodes do not hold. */
typedef int64_t (*sweep_run)(const sweep *s, int64_t first, int64_t end);

struct sweep {
    sweep_run run;
    const mmbvh *tree;
    const grid *g;
    const grid_field *field;
    grid_array values;           /* of the field's component */
    const float *box_ranges;     /* of a parent tree */
    const bounds_source *source; /* of a sweep of bounds */
    mmbvh_ranges ranges;         /* written by a sweep of ranges */
    const sweep *then; /* NULL, or one of the same tree that runs where this one has just been, in the cache */
};

/* Over the whole tree; returns the sum of what the runs returned, of the last sweep's if one follows the other. */
int64_t sweep_tree(const sweep *s, int threads);

/* The sweep that writes ranges of field (NULL: infinite ones). */
sweep sweep_of_ranges(const mmbvh *tree, const grid *g, const grid_field *field, mmbvh_ranges ranges);

/* The same for a parent tree: ranges by mesh, low and high. */
sweep sweep_of_box_ranges(const mmbvh *tree, const float *ranges);

/* The sweep that writes the bounds. */
sweep sweep_of_bounds(const mmbvh *tree, const bounds_source *source);

/* How many threads options ask for. */
int sweep_threads(const mmbvh_options *options);

#endif
