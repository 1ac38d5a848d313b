/* The serial SAH builder of one subtree, in memory that fits a core's cache. */
#ifndef MMBVH_SUBTREE_H
#define MMBVH_SUBTREE_H

#include "mmbvh_bins.h"
#include "mmbvh_bounds.h"
#include "mmbvh_topology.h"

/* Tells whether the grid is too coarse for items of these bounds. */
bool subtree_wants_finer_grid(lanes bounds, const item_grid *grid);

/* The grid over the bounds, which are in steps of grid. */
item_grid subtree_finer_grid(lanes bounds, const item_grid *grid);

/* Builds a tree over at most TOPOLOGY_SUBTREE_CELLS items in steps of grid, and leaves the items in the order of the
 * leaves. depth is that of its root in the whole tree. Returns the root's link. */
topology_link subtree_build(topology_scratch *scratch, const bounds_source *source, item *items, int64_t count,
                            const item_grid *grid, int depth);

#endif
