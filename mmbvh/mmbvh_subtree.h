/* The serial SAH builder of one subtree, in memory that fits a core's cache. */
#ifndef MMBVH_SUBTREE_H
#define MMBVH_SUBTREE_H

#include "mmbvh_bins.h"
#include "mmbvh_bounds.h"
#include "mmbvh_topology.h"

/* Items on their way to be a node. */
typedef struct subtree_node {
    item_set set;
    item_grid grid; /* that the items are in steps of */
    int depth;
} subtree_node;

/* Is the grid too coarse for these items? */
bool subtree_wants_finer_grid(const subtree_node *node);

/* The grid over the node's own bounds. */
item_grid subtree_finer_grid(const subtree_node *node);

/* Links of a tree over at most TOPOLOGY_SUBTREE_CELLS items, which are left in the order of the leaves. */
topology_link subtree_build(topology_scratch *scratch, const bounds_source *source, item *items, int64_t count,
                            const subtree_node *root);

#endif
