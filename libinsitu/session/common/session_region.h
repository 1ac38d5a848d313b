/* The number of threads for a loop over the cells or vertices of a mesh: blocks are many and small. */
#ifndef SESSION_REGION_H
#define SESSION_REGION_H

#include "region.h"

/* Returns 1 for fewer items than two threads' shares: a region would cost more than it saves. */
static inline int session_region_threads(int threads, int64_t items)
{
    return items < 2 * REGION_ITEMS ? 1 : threads;
}

#endif
