/* How fragments reach the owners of their pixels. */
#ifndef COMP_COMP_EXCHANGE_H
#define COMP_COMP_EXCHANGE_H

#include "comp_mail.h"
#include "comp_pixels.h"
#include "comp_windows.h"

/* Sends the windows' fragments by the rounds of the route. *owned gets all ranks' fragments of the pixels this rank
 * owns, in memory of its own (base_free()); windows are freed. status is this rank's so far. Returns this rank's own
 * status; the rank takes part to the end whatever fails. On an error *owned is empty. Collective. */
insitu_status comp_exchange(comp_mailroom *room, const comp_route *route, comp_windows *windows, comp_owned *owned,
                            insitu_status status, base_error *error);

#endif
