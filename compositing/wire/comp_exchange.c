/* A rank passes parcels on as they came: nothing is unpacked on the way, and fragments are merged only when all of
 * their pixel's are together. For "over" rounds, and merging on the way would make the picture depend on the schedule.
 *
 * A rank on which something fails goes on in the rounds with nothing to send, so that nobody waits for it, and returns
 * its error in the end. */
#include "comp_exchange.h"

#include "comp_pack.h"
#include "memory.h"

/* Each round after the first forwards what came in those before. */
static insitu_status run_rounds(comp_mailroom *room, const comp_route *route, comp_messages *out, comp_messages *held,
                                insitu_status status, base_error *error)
{
    for (int i = 0; i < route->round_count; i++) {
        comp_messages on_the_way = {NULL, NULL};
        if (!status) status = comp_forward(held, route, i, room->rank, &on_the_way, error);
        if (i == 0) comp_messages_append(&on_the_way, out);
        status = comp_mail_round(room, route, i, &on_the_way, held, status, error);
    }
    return status;
}

insitu_status comp_exchange(comp_mailroom *room, const comp_route *route, comp_windows *windows, comp_owned *owned,
                            insitu_status status, base_error *error)
{
    const int place = comp_route_place(route, room->rank);
    const bool is_owner = place < route->owners;
    comp_messages out = {NULL, NULL}, held = {NULL, NULL};
    *owned = (comp_owned){NULL, NULL};
    if (!status) status = comp_pack(windows, route, room->rank, &out, &held, error);
    status = comp_mail_fold(room, route, is_owner ? &(comp_messages){NULL, NULL} : &out, &held, status, error);
    status = run_rounds(room, route, &out, &held, status, error);
    if (!status && is_owner) {
        const int64_t first = comp_windows_first(windows, (uint32_t)place);
        const int64_t count = comp_windows_first(windows, (uint32_t)place + 1) - first;
        status = comp_unpack(windows->layout, (uint32_t)place, &held, windows->items + first, count, owned, error);
    }
    comp_messages_free(&held);
    comp_windows_free(windows);
    return status;
}
