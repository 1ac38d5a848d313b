/* Chooses the number of threads for a loop over the cells or vertices of a mesh, because many meshes are small
 * blocks. */
#ifndef SESSION_REGION_H
#define SESSION_REGION_H

#include "region.h"

/* Returns the number of threads for a loop over `items` items. It is 1 if the items are fewer than two threads' shares,
 * since a parallel region would then cost more than it saves. */
static inline int session_region_threads(int threads, int64_t items)
{
    return items < 2 * REGION_ITEMS ? 1 : threads;
}

#endif
