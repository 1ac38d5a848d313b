/* Packs fragments into messages, forwards messages, and finds the received sheets. */
#ifndef COMP_COMP_PACK_H
#define COMP_COMP_PACK_H

#include "comp_messages.h"
#include "comp_route.h"
#include "comp_strips.h"

/* The owners of the blocks of a picture. */
typedef struct comp_owners {
    int32_t *places; /* for each block, the place of its owner (the owner's number on the route, comp_route.h); -1 if
                        no rank has a fragment in the block */
    int count;       /* number of owners; their places are 0 .. count - 1 */
} comp_owners;

/* Packs this rank's fragments for other owners into messages. *out receives the messages to the partners of the first
 * round. If this rank cannot own blocks, *out receives instead the messages to the rank that forwards its fragments.
 * *kept receives the messages that are sent in later rounds. Both must be empty before the call, and are empty after an
 * error. Local. */
insitu_status comp_pack(const comp_strips *strips, const comp_owners *owners, const comp_route *route, int rank,
                        comp_messages *out, comp_messages *kept, base_error *error);

/* Copies those parcels (packed fragments for one owner) in `in` that other ranks must get in this round into messages
 * to these ranks, the partners of the round. Local. */
insitu_status comp_forward_parcels(const comp_messages *in, const comp_route *route, int round, int rank,
                                   comp_messages *out, base_error *error);

/* The received sheets of an owner, sorted by strip. `sheets` has their addresses within the messages. */
typedef struct comp_received {
    const unsigned char **sheets;
    uint32_t *starts; /* for each strip, the index of its first sheet in `sheets`; the last entry is the total number of
                         sheets */
} comp_received;

/* Lists, in *out, the sheets in `in` that are for this owner. Local; after an error *out is empty. */
insitu_status comp_received_list_sheets(const comp_grid *grid, int owner, const comp_messages *in, comp_received *out,
                                        base_error *error);

void comp_received_free(comp_received *arrivals);

#endif
