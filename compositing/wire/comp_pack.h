/* Fragments into messages, and out of them. */
#ifndef COMP_COMP_PACK_H
#define COMP_COMP_PACK_H

#include "comp_mail.h"
#include "comp_pixels.h"
#include "comp_route.h"
#include "comp_windows.h"

/* Writes the rank's fragments for other owners into messages. *out gets those to the partners of the first round, or,
 * if the rank is beyond the owners, to the partner that takes all; *kept gets those that a later round sends. Both are
 * empty at first, and on an error. Local. */
insitu_status comp_pack(const comp_windows *windows, const comp_route *route, int rank, comp_messages *out,
                        comp_messages *kept, base_error *error);

/* Writes the parcels of in for other owners into messages to the partners of the round. Local. */
insitu_status comp_forward(const comp_messages *in, const comp_route *route, int round, int rank, comp_messages *out,
                           base_error *error);

/* *out gets the fragments of in that are for owner, and own_count ones that the rank has itself. Local; on an error
 * *out is empty. */
insitu_status comp_unpack(const comp_layout *layout, uint32_t owner, const comp_messages *in, const fragment *own,
                          int64_t own_count, comp_owned *out, base_error *error);

#endif
