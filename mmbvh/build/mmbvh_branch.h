/* Builds the top of a SAH tree. All threads split nodes together, until each remaining part is small enough to be built
 * as a subtree by one thread (mmbvh_subtree.h). */
#ifndef MMBVH_BRANCH_H
#define MMBVH_BRANCH_H

#include "mmbvh_subtree.h"

typedef struct branch_builder {
    topology_build *build;
    const bounds_source *source;
    item *items; /* items; the builder sorts them in the order of the leaves */
    int64_t count;
} branch_builder;

/* Builds the tree; returns NULL if an allocation failed. `set` contains the bounds of all items, in steps of the
 * grid. */
topology *branch_build(const branch_builder *builder, const item_set *set, const item_grid *grid);

#endif
