/* The serial SAH builder of one subtree. The data of a subtree fit in a core's cache. */
#ifndef MMBVH_SUBTREE_H
#define MMBVH_SUBTREE_H

#include "mmbvh_bins.h"
#include "mmbvh_bounds.h"
#include "mmbvh_topology.h"

/* Returns whether the grid is too coarse to distinguish items with these bounds. */
bool subtree_needs_finer_grid(lanes bounds, const item_grid *grid);

/* Returns a grid over the bounds. The bounds are given in steps of `grid`. */
item_grid subtree_finer_grid(lanes bounds, const item_grid *grid);

/* Builds a tree over at most TOPOLOGY_SUBTREE_CELLS items, and reorders the items to the order of the leaves. The
 * items' boxes are in steps of `grid`. `depth` is the depth of the subtree's root in the whole tree. Returns the root's
 * link. */
topology_link subtree_build(topology_scratch *scratch, const bounds_source *source, item *items, int64_t count,
                            const item_grid *grid, int depth);

#endif
