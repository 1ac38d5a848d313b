/* Stores the boxes of nodes during a sweep of bounds, and accumulates the change of the tree's area. */
#ifndef MMBVH_MEASURE_H
#define MMBVH_MEASURE_H

#include "mmbvh_store.h"
#include "mmbvh_sweep.h"

/* Returns half the surface area of a box, whose lane 3 must be 0, times the number of tests in the node: each cell of a
 * leaf, or both children's boxes. */
static inline double node_area(const mmbvh *tree, int64_t node, vec4 lower, vec4 upper)
{
    const vec4 d = upper - lower;
    const int count = mmbvh_node_count(tree, node);
    const double x = (double)d[0], y = (double)d[1], z = (double)d[2];
    return (x * y + y * z + z * x) * (count ? count : 2);
}

/* Stores the node's box. If the tree's grid cannot represent the box, increments *misfits. If s->is_measured, adds the
 * change of the node's area to *grown. */
static inline void store_measured(const sweep *s, int64_t node, vec4 lower, vec4 upper, int64_t *misfits, double *grown)
{
    const mmbvh *tree = s->tree;
    vec4 old[2];
    if (s->is_measured) {
        store_decode(tree, node, &old[0], &old[1]);
        *grown -= node_area(tree, node, old[0], old[1]);
    }
    *misfits += !store_box(tree, node, lower, upper);
    if (s->is_measured) {
        store_decode(tree, node, &old[0], &old[1]);
        *grown += node_area(tree, node, old[0], old[1]);
    }
}

/* Stores the union of the children's boxes. If the sweep visited only one child, that child's box is used alone. */
static inline void store_children(const sweep *s, int64_t node, int64_t pair, int64_t *misfits, double *grown)
{
    vec4 lower[2], upper[2];
    for (int side = 0; side < 2; side++) store_decode(s->tree, pair + side, &lower[side], &upper[side]);
    if (s->visible_count) {
        const bool shows[2] = {sweep_shows(s, pair), sweep_shows(s, pair + 1)};
        for (int side = 0; side < 2; side++)
            if (shows[side] && !shows[!side]) lower[!side] = lower[side], upper[!side] = upper[side];
    }
    store_measured(s, node, vec4_min(lower[0], lower[1]), vec4_max(upper[0], upper[1]), misfits, grown);
}

#endif
