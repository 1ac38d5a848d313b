/* Bottom-up passes that compute the bounds or ranges of a tree's nodes: those of leaves from their cells, and those of
 * inner nodes from their children.
 *
 * Nodes are numbered depth first by pairs: the descendants of a node are contiguous, and children come after parents. A
 * pass from the last node to the first therefore visits every child before its parent, and the descendants of two
 * siblings can be processed independently. */
#ifndef MMBVH_SWEEP_H
#define MMBVH_SWEEP_H

#include <math.h>

#include "mmbvh.h"

typedef struct sweep sweep;
typedef struct bounds_source bounds_source;

typedef struct sweep_sum {
    /* If the sweep computes ranges: the number of cells with non-finite values. If it computes only bounds: the number
     * of boxes that the nodes' layout cannot represent. */
    int64_t count;
    double area_change; /* change of the tree's area (mmbvh.area), if the sweep measures it */
} sweep_sum;

/* Computes the bounds or ranges of the nodes from end - 1 down to `first`. These nodes are the root alone, a pair of
 * siblings alone, or a pair of siblings and all their descendants. The interval may be empty. */
typedef sweep_sum (*sweep_run)(const sweep *s, int64_t first, int64_t end);

struct sweep {
    sweep_run run;
    const mmbvh *tree;
    const grid *g;
    const grid_field *field;
    grid_array values;           /* values of the field's component, one per vertex or cell */
    const float *box_ranges;     /* for a tree over the boxes of meshes: the low and the high end of each box's range */
    const bounds_source *source; /* reads the cells' boxes in a sweep of bounds */
    mmbvh_ranges ranges;         /* receives the results of a sweep of ranges */
    int64_t range_max;           /* maximum number of nodes per run; 0: no limit other than the size of a task */
    /* set if the change of area is measured; allowed only in a refit, in which all nodes have bounds before the
     * sweep */
    bool measures_area;
    /* number of visible parts of the tree; if not 0, the sweep visits only the root and the children of nodes in these
     * parts */
    int visible_count;
    const mmbvh_visible *visible;
    const sweep *follower; /* another sweep of the same tree, or NULL; it processes each group of nodes directly after
                              this sweep, while they are in the cache */
};

/* Sweeps the whole tree. Returns the sum of the results of all calls of `run`. If the sweep has followers, returns the
 * sum for the last follower's `run` instead. The rounding of the sum does not depend on the number of threads. */
sweep_sum sweep_tree(const sweep *s, int threads);

/* Returns a sweep that computes the ranges of the field; if field is NULL, they are infinite. */
sweep sweep_of_ranges(const mmbvh *tree, const grid *g, const grid_field *field, mmbvh_ranges ranges);

/* Returns a sweep that computes the ranges of a parent tree, whose leaves contain the boxes of meshes instead of cells.
 * `ranges` has a low and a high value per mesh. */
sweep sweep_of_box_ranges(const mmbvh *tree, const float *ranges);

/* Returns a sweep that computes the bounds of the nodes from the boxes of the source. */
sweep sweep_of_bounds(const mmbvh *tree, const bounds_source *source);

/* If the coordinates are floats, changes a sweep of bounds so that it reads the cells of many nodes in one pass. */
void sweep_bounds_as_floats(sweep *bounds);

/* Returns whether the sweep reads values that are floats at vertices. */
bool sweep_reads_floats(const sweep *ranges);

/* Returns a sweep that computes both bounds and ranges of a grid's cells, so that each cell is read only once. `ranges`
 * must be from sweep_of_ranges() for the same tree. If bounds or values cannot be read as floats, the two sweeps run
 * one after the other. */
sweep sweep_of_bounds_and_ranges(const mmbvh *tree, const bounds_source *source, const sweep *ranges);

/* Makes a sweep that computes bounds and ranges in one pass. Returns false if either cannot be read as floats. */
bool sweep_bounds_and_ranges_as_floats(const sweep *ranges, const bounds_source *source, sweep *both);

/* Returns the number of threads that the options request, or the default of OpenMP. */
int sweep_threads(const mmbvh_options *options);

static inline sweep_sum sweep_add(sweep_sum a, sweep_sum b)
{
    return (sweep_sum){a.count + b.count, a.area_change + b.area_change};
}

/* Returns whether the sweep visits the node's descendants. */
bool sweep_visits(const sweep *s, int64_t node);

/* ---- ranges of nodes -------------------------------------------------------------------------------------------- */

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

static inline range range_union(range a, range b)
{
    return (range){a.low < b.low ? a.low : b.low, a.high > b.high ? a.high : b.high};
}

static inline range unite_ranges_of_children(const sweep *s, int64_t left)
{
    return range_union(get_range(s, left), get_range(s, left + 1));
}

#endif
