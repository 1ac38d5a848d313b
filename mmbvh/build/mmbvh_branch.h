/* The top of a SAH tree under construction: nodes of many items, split by all threads together, down to subtrees that
 * one thread builds alone. */
#ifndef MMBVH_BRANCH_H
#define MMBVH_BRANCH_H

#include "mmbvh_subtree.h"

typedef struct branch_builder {
    topology_build *build;
    const bounds_source *source;
    item *items; /* left in the order of the leaves */
    int64_t count;
} branch_builder;

/* NULL where an allocation failed. */
topology *branch_build(const branch_builder *builder, const item_set *set, const item_grid *grid);

#endif
