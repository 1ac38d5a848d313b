/* Sends fragments to the owners of their pixels. */
#ifndef COMP_COMP_EXCHANGE_H
#define COMP_COMP_EXCHANGE_H

#include "comp_messages.h"
#include "comp_pack.h"
#include "comp_strips.h"

/* Sends the strips' fragments to their owners in the rounds of the route. *held receives the messages that contain
 * other ranks' fragments for the strips that this rank owns; the caller must free them with comp_messages_free().
 * `status` is this rank's status before the call; a rank with an error takes part in all rounds without sending
 * fragments. Returns this rank's own status; if it is an error, *held is empty. Collective. */
insitu_status comp_exchange(comp_transport *transport, const comp_route *route, const comp_strips *strips,
                            const comp_owners *owners, comp_messages *held, insitu_status status, base_error *error);

#endif
