/* Estimates which schedule takes least time by LogGP (Alexandrov, Ionescu, Schauser, Scheiman, 1995): a message costs
 * its sender and its receiver an overhead each, the network a latency, and every byte a gap.
 *
 * In any schedule each fragment is packed once and unpacked once, so only rounds are counted: how many messages a rank
 * sends, and how often its bytes travel. In a dense round empty messages count too. */
#ifndef COMP_COMP_COST_H
#define COMP_COMP_COST_H

#include "comp_route.h"

/* Seconds; the gap is a byte's. */
typedef struct comp_machine {
    double latency, overhead, gap;                /* between nodes */
    double node_latency, node_overhead, node_gap; /* within one */
} comp_machine;

/* A present-day cluster: 10 GB/s a rank, a microsecond of overhead, two of latency; half of these times within a node.
 */
extern const comp_machine comp_usual_machine;

/* The load of the busiest rank. */
typedef struct comp_load {
    int64_t fragments;
    double bytes;          /* that a fragment takes on its way (comp_sheet.h) */
    uint32_t block_pixels; /* the pixels of a block, all of which one rank owns (comp_grid.h) */
} comp_load;

/* The cost of a route for the busiest rank. */
typedef struct comp_cost {
    double messages; /* that it sends, empty ones included */
    double bytes;    /* bytes of all messages */
    double seconds;
} comp_cost;

comp_cost comp_cost_of(const comp_route *route, const comp_load *load, const comp_machine *machine);

/* The route that takes least. radix: as comp_route_of(). */
comp_route comp_cheapest_route(int ranks, comp_nodes nodes, const comp_load *load, const comp_machine *machine);

/* The exact number of messages that a place sends in the rounds of a route, where all rounds are dense and no message
 * has to be cut. */
int64_t comp_route_messages(const comp_route *route, int place);

#endif
