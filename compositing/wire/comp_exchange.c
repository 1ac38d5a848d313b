/* Ranks forward the packed fragments for each owner (parcels, comp_messages.h) without unpacking them. The owner merges
 * the fragments of a pixel only after it has received all of them: blending has rounding errors, so that pictures would
 * depend on the schedule if intermediate ranks merged fragments.
 *
 * A rank on which an error occurs takes part in the remaining rounds without sending fragments, so that no rank waits
 * for it, and returns its error at the end. */
#include "comp_exchange.h"

#include "comp_pack.h"

/* Runs the rounds of the route. Each round after the first forwards the parcels (packed fragments for one owner) that
 * were received in earlier rounds. */
static insitu_status run_rounds(comp_transport *transport, const comp_route *route, comp_messages *out,
                                comp_messages *held, insitu_status status, base_error *error)
{
    for (int i = 0; i < route->round_count; i++) {
        comp_messages on_the_way = {NULL, NULL};
        if (!status) status = comp_forward_parcels(held, route, i, transport->rank, &on_the_way, error);
        if (i == 0) comp_messages_append(&on_the_way, out);
        status = comp_messages_run_round(transport, route, i, &on_the_way, held, status, error);
    }
    return status;
}

insitu_status comp_exchange(comp_transport *transport, const comp_route *route, const comp_strips *strips,
                            const comp_owners *owners, comp_messages *held, insitu_status status, base_error *error)
{
    const bool is_owner = comp_find_place_of_rank(route, transport->rank) < route->owners;
    comp_messages out = {NULL, NULL};
    *held = (comp_messages){NULL, NULL};
    if (!status) status = comp_pack(strips, owners, route, transport->rank, &out, held, error);
    status = comp_messages_send_to_owners(transport, route, is_owner ? &(comp_messages){NULL, NULL} : &out, held,
                                          status, error);
    status = run_rounds(transport, route, &out, held, status, error);
    if (status) comp_messages_free(held);
    return status;
}
