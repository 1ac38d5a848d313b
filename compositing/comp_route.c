#include "comp_route.h"

/* Returns the largest divisor of `number` that does not exceed `most`. */
static int find_largest_divisor(int number, int most)
{
    for (int k = most; k > 1; k--)
        if (number % k == 0) return k;
    return 1;
}

static bool has_only_factors_up_to(int number, int most)
{
    for (int k = most; k > 1; k--)
        while (number % k == 0) number /= k;
    return number == 1;
}

/* Returns the largest product of numbers from 2 to `most` that does not exceed `number`. The result is more than half
 * of `number`, because the largest power of two that does not exceed `number` is such a product. */
static int find_largest_product(int number, int most)
{
    while (!has_only_factors_up_to(number, most)) number--;
    return number;
}

static void add_route_round(comp_route *route, int radix)
{
    if (radix > 1) route->radix[route->round_count++] = radix;
}

static void add_route_rounds(comp_route *route, int number, int most)
{
    while (number > 1) {
        const int radix = find_largest_divisor(number, most);
        add_route_round(route, radix);
        number /= radix;
    }
}

comp_route comp_make_route(comp_schedule schedule, int ranks, comp_nodes nodes, int radix)
{
    const bool is_by_nodes = schedule == COMP_NODES || schedule == COMP_RADIX;
    comp_route route = {
        .schedule = schedule, .ranks = ranks, .nodes = {1, false}, .max_dense_ranks = COMP_MAX_DENSE_RANKS};
    if (is_by_nodes) route.nodes = nodes;
    int groups = ranks / route.nodes.ranks;
    if (schedule == COMP_RADIX || schedule == COMP_BINARY) {
        const int most = schedule == COMP_BINARY || radix < 2 ? 2 : radix;
        groups = find_largest_product(groups, most);
        add_route_round(&route, route.nodes.ranks);
        add_route_rounds(&route, groups, most);
    } else {
        add_route_round(&route, route.nodes.ranks);
        add_route_round(&route, groups);
    }
    route.owners = route.nodes.ranks * groups;
    return route;
}

int comp_find_place_of_rank(const comp_route *route, int rank)
{
    if (!route->nodes.is_cyclic) return rank;
    const int count = route->ranks / route->nodes.ranks;
    return rank % count * route->nodes.ranks + rank / count;
}

int comp_find_rank_at_place(const comp_route *route, int place)
{
    if (!route->nodes.is_cyclic) return place;
    const int count = route->ranks / route->nodes.ranks;
    return place % route->nodes.ranks * count + place / route->nodes.ranks;
}

int comp_route_stride(const comp_route *route, int round)
{
    int stride = 1;
    for (int i = 0; i < round; i++) stride *= route->radix[i];
    return stride;
}

void comp_convert_claims_to_places(const comp_route *route, comp_claim *claims, uint32_t blocks)
{
    for (uint32_t b = 0; b < blocks; b++) {
        if (!claims[b].priority) continue;
        const int place = comp_find_place_of_rank(route, comp_priority_rank(claims[b].priority));
        claims[b].priority =
            comp_priority_with_rank(claims[b].priority, place < route->owners ? place : place - route->owners);
    }
}

const char *comp_schedule_name(comp_schedule schedule)
{
    static const char *const names[COMP_SCHEDULE_COUNT] = {"automatic", "direct", "nodes", "radix", "binary"};
    return names[schedule];
}
