/* A rank's fragments by owner and window: 64 consecutive owned indices. */
#ifndef COMP_COMP_WINDOWS_H
#define COMP_COMP_WINDOWS_H

#include "comp_block.h"
#include "comp_schedule.h"
#include "error.h"
#include "fragment.h"

typedef struct comp_windows {
    const comp_layout *layout;
    fragment *items;    /* by owner, then window */
    uint32_t *starts;   /* of windows: owners × per_owner + 1 */
    uint32_t per_owner; /* windows that an owner has at most */
} comp_windows;

/* Sorts the fragments. The list is emptied and its memory given back; on an error it stays as it was. layout must
 * outlive out. Local. */
insitu_status comp_windows_make(const comp_layout *layout, fragment_list *items, comp_windows *out, base_error *error);

void comp_windows_free(comp_windows *windows);

/* One owner's fragments are at items[comp_windows_first(owner)] .. items[comp_windows_first(owner + 1)]. */
static inline int64_t comp_windows_first(const comp_windows *windows, uint32_t owner)
{
    return windows->starts[(uint64_t)owner * windows->per_owner];
}

/* Takes a block; false ends the walk. */
typedef bool comp_block_taker(void *state, comp_block *block);

/* Hands an owner's fragments over in blocks, layer by layer within a window: the first of all pixels, then the second
 * of those that have another, from front to back. block is scratch. Local, and any number of threads at once. */
bool comp_windows_walk(const comp_windows *windows, uint32_t owner, comp_block *block, comp_block_taker *take,
                       void *state);

#endif
