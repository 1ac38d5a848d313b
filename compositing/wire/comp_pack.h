/* Fragments into messages, and out of them. */
#ifndef COMP_COMP_PACK_H
#define COMP_COMP_PACK_H

#include "comp_mail.h"
#include "comp_route.h"
#include "comp_strips.h"

/* Who owns the blocks of a picture. */
typedef struct comp_owners {
    int32_t *places; /* the place of each block; -1: nobody has anything there */
    int count;       /* the number of places that may own some */
} comp_owners;

/* Writes the rank's fragments for other owners into messages. *out gets those to the partners of the first round, or,
 * if the rank is beyond the owners, to the partner that takes all; *kept gets those that a later round sends. Both are
 * empty at first, and on an error. Local. */
insitu_status comp_pack(const comp_strips *strips, const comp_owners *owners, const comp_route *route, int rank,
                        comp_messages *out, comp_messages *kept, base_error *error);

/* Writes the parcels of in for other owners into messages to the partners of the round. Local. */
insitu_status comp_forward(const comp_messages *in, const comp_route *route, int round, int rank, comp_messages *out,
                           base_error *error);

/* The sheets that came for an owner, by strip. They point into the messages. */
typedef struct comp_arrivals {
    const unsigned char **sheets;
    uint32_t *starts; /* where those of each strip begin, and one more */
} comp_arrivals;

/* Finds the sheets of in that are for owner. Local; on an error *out is empty. */
insitu_status comp_arrivals_find(const comp_grid *grid, int owner, const comp_messages *in, comp_arrivals *out,
                                 base_error *error);

void comp_arrivals_free(comp_arrivals *arrivals);

#endif
