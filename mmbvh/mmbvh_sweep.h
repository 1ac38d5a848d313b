/* Bottom-up passes over a tree: leaves from their cells, inner nodes from their children.
 *
 * Nodes are numbered depth first by pairs, so all below a node are one run of indices, children after parents: a run
 * swept backwards meets every child before its parent, and the runs below two siblings are independent work. */
#ifndef MMBVH_SWEEP_H
#define MMBVH_SWEEP_H

#include "mmbvh.h"

typedef struct sweep sweep;

/* Nodes end - 1 down to first; returns how many cells were found unusable. */
typedef int64_t (*sweep_run)(const sweep *s, int64_t first, int64_t end);

struct sweep {
    sweep_run run;
    const mmbvh *tree;
    const grid *g;
    const grid_field *field;
    grid_array values;       /* of the field's component */
    const float *box_ranges; /* of a parent tree */
    mmbvh_node *nodes;       /* written by a sweep of bounds */
    char *low, *high;        /* written by a sweep of ranges, stride bytes from node to node */
    int64_t stride;
};

/* Over the whole tree; returns the sum of what the runs returned. */
int64_t sweep_tree(const sweep *s, int threads);

/* The sweep that writes ranges of field (NULL: infinite ones) to low and high. */
sweep sweep_of_ranges(const mmbvh *tree, const grid *g, const grid_field *field, float *low, float *high,
                      int64_t stride);

/* The same for a parent tree: ranges by mesh, low and high. */
sweep sweep_of_box_ranges(const mmbvh *tree, const float *ranges);

/* How many threads options ask for. */
int sweep_threads(const mmbvh_options *options);

#endif
