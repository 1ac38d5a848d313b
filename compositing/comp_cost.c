#include "comp_cost.h"

#include <math.h>

const comp_machine comp_default_machine = {2e-6, 1e-6, 1e-10, 1e-6, 5e-7, 5e-11};

/* Number of pixels of a tile. The renderer traces the picture tile by tile, so that fragments are clustered in tiles.
 * All pixels of a tile, or of a block if blocks are smaller than tiles, have the same owner. */
enum { TILE_PIXELS = 256 };

/* Returns the number of partners to which the busiest rank sends messages in a round. In a dense round, in which empty
 * messages are sent too, these are all partners. In a sparse round, the rank sends only to owners of the tiles in which
 * it has fragments (or of the blocks, if these are smaller than tiles), so that the number of these tiles is an upper
 * bound. */
static double count_partners(const comp_route *route, int round, const comp_load *load)
{
    const uint32_t together = load->block_pixels < TILE_PIXELS ? load->block_pixels : TILE_PIXELS;
    const double all = route->radix[round] - 1, own = ceil((double)load->fragments / together);
    return comp_route_is_dense(route, round) || own > all ? all : own;
}

comp_cost comp_estimate_cost(const comp_route *route, const comp_load *load, const comp_machine *m)
{
    comp_cost cost = {0, 0, 0};
    const double bytes = (double)load->fragments * load->bytes;
    for (int i = 0; i < route->round_count; i++) {
        const bool is_within = i == 0 && route->nodes.ranks > 1;
        const double latency = is_within ? m->node_latency : m->latency;
        const double overhead = is_within ? m->node_overhead : m->overhead;
        const double partners = count_partners(route, i, load), share = 1 - 1.0 / route->radix[i];
        cost.messages += partners;
        cost.bytes += share * bytes;
        cost.seconds += latency + 2 * overhead * partners + (is_within ? m->node_gap : m->gap) * share * bytes;
        /* a sparse round, in which only ranks with fragments send, ends with a barrier, which is modelled as
         * log2(ranks) exchanges between pairs of ranks (a dissemination barrier) */
        if (!comp_route_is_dense(route, i)) cost.seconds += ceil(log2(route->ranks)) * (m->latency + 2 * m->overhead);
    }
    if (route->ranks > route->owners) {
        cost.messages += 1;
        cost.bytes += bytes;
        cost.seconds += m->latency + 2 * m->overhead + m->gap * bytes;
    }
    return cost;
}

comp_route comp_find_fastest_route(int ranks, comp_nodes nodes, const comp_load *load, const comp_machine *machine)
{
    static const struct {
        comp_schedule schedule;
        int radix;
    } tried[] = {{COMP_NODES, 0},  {COMP_RADIX, 4},  {COMP_RADIX, 8},
                 {COMP_RADIX, 16}, {COMP_RADIX, 32}, {COMP_BINARY, 2}};
    /* If all ranks are on one node, a round within the node would already bring all fragments to their owners, so that
     * no schedule needs to distinguish nodes. */
    if (nodes.ranks >= ranks) nodes = (comp_nodes){1, false};
    comp_route best = comp_make_route(COMP_DIRECT, ranks, nodes, 0);
    double least = comp_estimate_cost(&best, load, machine).seconds;
    for (unsigned i = 0; i < sizeof tried / sizeof *tried; i++) {
        const comp_route route = comp_make_route(tried[i].schedule, ranks, nodes, tried[i].radix);
        const double seconds = comp_estimate_cost(&route, load, machine).seconds;
        if (!(seconds < least)) continue;
        best = route;
        least = seconds;
    }
    return best;
}

int64_t comp_count_route_messages(const comp_route *route, int place)
{
    if (place >= route->owners) return 1;
    int64_t messages = 0;
    for (int i = 0; i < route->round_count; i++) messages += route->radix[i] - 1;
    return messages;
}
