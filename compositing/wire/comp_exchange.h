/* How fragments reach the owners of their pixels. */
#ifndef COMP_COMP_EXCHANGE_H
#define COMP_COMP_EXCHANGE_H

#include "comp_mail.h"
#include "comp_pixels.h"
#include "comp_windows.h"

/* Collective: takes the windows' fragments by the rounds of the route. *owned becomes all ranks' fragments of the
 * pixels this rank owns, in memory of its own (base_free()), windows are freed. status: of this rank so far. Returns
 * that of this rank alone, which takes part to the end whatever fails; on an error *owned is empty. */
insitu_status comp_exchange(comp_mailroom *room, const comp_route *route, comp_windows *windows, comp_owned *owned,
                            insitu_status status, base_error *error);

#endif
