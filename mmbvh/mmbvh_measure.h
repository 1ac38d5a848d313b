/* Stores the boxes of nodes in a sweep that computes bounds, and accumulates the change of the tree's area
 * (mmbvh.area). */
#ifndef MMBVH_MEASURE_H
#define MMBVH_MEASURE_H

#include "mmbvh_store.h"
#include "mmbvh_sweep.h"

/* Returns half the surface area of a node's box times the number of tests that a ray makes after it has hit the box:
 * one for each cell of a leaf, or two for the boxes of an inner node's children. Lane 3 of the box must be 0. */
static inline double compute_weighted_node_area(const mmbvh *tree, int64_t node, vec4 lower, vec4 upper)
{
    const vec4 d = upper - lower;
    const int count = mmbvh_node_count(tree, node);
    const double x = (double)d[0], y = (double)d[1], z = (double)d[2];
    return (x * y + y * z + z * x) * (count ? count : 2);
}

/* Stores the node's box. If the tree's grid cannot represent the box, increments *outside_grid. If s->measures_area,
 * adds the change of the node's area to *area_change. */
static inline void store_box_and_measure_area(const sweep *s, int64_t node, vec4 lower, vec4 upper,
                                              int64_t *outside_grid, double *area_change)
{
    const mmbvh *tree = s->tree;
    vec4 old[2];
    if (s->measures_area) {
        store_read_box(tree, node, &old[0], &old[1]);
        *area_change -= compute_weighted_node_area(tree, node, old[0], old[1]);
    }
    *outside_grid += !store_box(tree, node, lower, upper);
    if (s->measures_area) {
        store_read_box(tree, node, &old[0], &old[1]);
        *area_change += compute_weighted_node_area(tree, node, old[0], old[1]);
    }
}

/* Stores the union of the children's boxes. If the sweep visited only one of the children, the node gets the box of
 * that child. */
static inline void store_union_of_children(const sweep *s, int64_t node, int64_t pair, int64_t *outside_grid,
                                           double *area_change)
{
    vec4 lower[2], upper[2];
    for (int side = 0; side < 2; side++) store_read_box(s->tree, pair + side, &lower[side], &upper[side]);
    if (s->visible_count) {
        const bool is_visited[2] = {sweep_visits(s, pair), sweep_visits(s, pair + 1)};
        for (int side = 0; side < 2; side++)
            if (is_visited[side] && !is_visited[!side]) lower[!side] = lower[side], upper[!side] = upper[side];
    }
    store_box_and_measure_area(s, node, vec4_min(lower[0], lower[1]), vec4_max(upper[0], upper[1]), outside_grid,
                               area_change);
}

#endif
