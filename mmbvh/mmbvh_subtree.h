/* The serial builder of one subtree in memory that fits a core's cache, and the scratch a thread keeps for it. */
#ifndef MMBVH_SUBTREE_H
#define MMBVH_SUBTREE_H

#include "mmbvh_bins.h"

enum {
    SUBTREE_MAX_ITEMS = 16384,
    SUBTREE_MAX_NODES = 2 * SUBTREE_MAX_ITEMS,
    SUBTREE_MEDIAN_DEPTH = MMBVH_MAX_DEPTH - 32 /* from here on halves: 2^32 cells end within the depth allowed */
};

typedef struct subtree {
    bin_item *items;   /* given by the caller; left in the order of the leaves */
    mmbvh_node *nodes; /* written: all below the root, numbered depth first by pairs from 0 */
    int64_t node_count;
    uint64_t first_entry; /* where the items will stand in the tree's cells */
    bins bins;
} subtree;

/* The root of a tree over the first count items; its references count from the start of nodes. */
mmbvh_node subtree_build(subtree *s, int64_t count, const bin_set *set, int depth);

#endif
