/* How fragments reach the owners of their pixels. */
#ifndef COMP_COMP_EXCHANGE_H
#define COMP_COMP_EXCHANGE_H

#include "comp_mail.h"
#include "comp_pack.h"
#include "comp_strips.h"

/* Sends the strips' fragments by the rounds of the route. *held gets the messages that hold those of other ranks for
 * the strips this rank owns (comp_messages_free()). status is this rank's so far. Returns this rank's own status; the
 * rank takes part to the end whatever fails. On an error *held is empty. Collective. */
insitu_status comp_exchange(comp_mailroom *room, const comp_route *route, const comp_strips *strips,
                            const comp_owners *owners, comp_messages *held, insitu_status status, base_error *error);

#endif
