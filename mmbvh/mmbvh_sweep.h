/* Bottom-up passes over a tree: leaves from their cells, inner nodes from their children.
 *
 * Nodes are numbered depth first by pairs, so all below a node are one run of indices, children after parents: a run
 * swept backwards meets every child before its parent, and the runs below two siblings are independent work. */
#ifndef MMBVH_SWEEP_H
#define MMBVH_SWEEP_H

#include <math.h>

#include "mmbvh.h"

typedef struct sweep sweep;
typedef struct bounds_source bounds_source;

typedef struct sweep_sum {
    int64_t count; /* cells that were found unusable, or boxes that the nodes do not hold */
    double grown;  /* growth of the tree's area (mmbvh.area), in sweeps of bounds that measure it */
} sweep_sum;

/* Sweeps nodes end - 1 down to first: the root, a pair, or a pair and all below it. There may be none. */
typedef sweep_sum (*sweep_run)(const sweep *s, int64_t first, int64_t end);

struct sweep {
    sweep_run run;
    const mmbvh *tree;
    const grid *g;
    const grid_field *field;
    grid_array values;           /* values of the field's component */
    const float *box_ranges;     /* ranges of the boxes, for a parent tree */
    const bounds_source *source; /* source of the bounds, for a sweep of bounds */
    mmbvh_ranges ranges;         /* written by a sweep of ranges */
    int64_t run_max;             /* nodes in a run; 0: as many as are worth a task */
    bool is_measured;            /* for a sweep of bounds: the nodes have bounds already, and grown is wanted */
    int visible_count;           /* 0: all nodes are swept; else those below nodes that one of these shows */
    const mmbvh_visible *visible;
    const sweep *then; /* NULL, or another sweep of the same tree, which follows each run of this one while it is in the
                          cache */
};

/* Sweeps the whole tree. Returns the sum of what the runs returned (those of the last sweep, if one follows another),
 * to the same bits for any number of threads. */
sweep_sum sweep_tree(const sweep *s, int threads);

/* The sweep that writes ranges of field (NULL: infinite ones). */
sweep sweep_of_ranges(const mmbvh *tree, const grid *g, const grid_field *field, mmbvh_ranges ranges);

/* As above, for a parent tree. ranges has a low and a high value for each mesh. */
sweep sweep_of_box_ranges(const mmbvh *tree, const float *ranges);

/* The sweep that writes the bounds. */
sweep sweep_of_bounds(const mmbvh *tree, const bounds_source *source);

/* Makes a sweep of bounds read cells by runs, if their coordinates are floats. */
void sweep_bounds_as_floats(sweep *bounds);

/* Tells whether the values are floats at the vertices. */
bool sweep_reads_floats(const sweep *ranges);

/* Does both sweeps' work for a grid's cells in one, so that a cell is read once. ranges is from sweep_of_ranges() for
 * the same tree. If either cannot be read as floats, they run one after the other. */
sweep sweep_of_both(const mmbvh *tree, const bounds_source *source, const sweep *ranges);

/* Makes the sweep that does both sweeps' work in one pass. Returns false if either cannot be read as floats. */
bool sweep_both_as_floats(const sweep *ranges, const bounds_source *source, sweep *both);

/* Returns how many threads options ask for. */
int sweep_threads(const mmbvh_options *options);

static inline sweep_sum sweep_add(sweep_sum a, sweep_sum b)
{
    return (sweep_sum){a.count + b.count, a.grown + b.grown};
}

/* Tells whether the sweep goes below the node. */
bool sweep_shows(const sweep *s, int64_t node);

/* ---- the ranges that sweeps write ------------------------------------------------------------------------------- */

typedef struct range {
    float low, high;
} range;

static inline range range_empty(void)
{
    return (range){INFINITY, -INFINITY};
}

static inline range get_range(const sweep *s, int64_t node)
{
    return (range){*(const float *)(const void *)(s->ranges.low + node * s->ranges.stride),
                   *(const float *)(const void *)(s->ranges.high + node * s->ranges.stride)};
}

static inline void set_range(const sweep *s, int64_t node, range r)
{
    *(float *)(void *)(uintptr_t)(s->ranges.low + node * s->ranges.stride) = r.low;
    *(float *)(void *)(uintptr_t)(s->ranges.high + node * s->ranges.stride) = r.high;
}

static inline range united(range a, range b)
{
    return (range){a.low < b.low ? a.low : b.low, a.high > b.high ? a.high : b.high};
}

static inline range children_range(const sweep *s, int64_t left)
{
    return united(get_range(s, left), get_range(s, left + 1));
}

#endif
