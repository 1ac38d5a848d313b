/* Chooses the number of threads for a loop over the cells or vertices of a mesh. Many meshes are small blocks, for
 * which fewer threads are faster. */
#ifndef SESSION_REGION_H
#define SESSION_REGION_H

#include "region.h"

/* Returns the number of threads for a loop over `items` cells or vertices. Returns 1 if there is not enough work for
 * two threads, because a parallel region would then cost more than it saves. */
static inline int session_choose_loop_threads(int threads, int64_t items)
{
    return items < 2 * REGION_ITEMS ? 1 : threads;
}

#endif
