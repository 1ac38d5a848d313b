/* Which schedule takes least, by arithmetic: LogGP (Alexandrov, Ionescu, Schauser, Scheiman, 1995), in which a message
 * costs its sender and its receiver an overhead each, the network a latency, and every byte a gap.
 *
 * A rank's fragments are its own to pack and an owner's to unpack whatever the schedule, so rounds alone are counted:
 * how many messages a rank sends, and how often its bytes travel. What is empty is a message too where a round is
 * dense. */
#ifndef COMP_COMP_COST_H
#define COMP_COMP_COST_H

#include "comp_route.h"

/* Seconds; the gap is a byte's. */
typedef struct comp_machine {
    double latency, overhead, gap;                /* between nodes */
    double node_latency, node_overhead, node_gap; /* within one */
} comp_machine;

/* Of a present-day cluster: 10 GB/s a rank, a microsecond of overhead, two of latency; half of that within a node. */
extern const comp_machine comp_usual_machine;

/* What the busiest rank has to send. */
typedef struct comp_load {
    int64_t fragments;
    double bytes; /* that each of them takes on its way (comp_block.h) */
} comp_load;

/* What the busiest rank's fragments take on a route. */
typedef struct comp_cost {
    double messages; /* that it sends, those that say no more than that there is nothing included */
    double bytes;    /* of them all */
    double seconds;
} comp_cost;

comp_cost comp_cost_of(const comp_route *route, const comp_load *load, const comp_machine *machine);

/* The route that takes least. radix: as comp_route_of(). */
comp_route comp_cheapest_route(int ranks, comp_nodes nodes, const comp_load *load, const comp_machine *machine);

/* Messages that a place sends in the rounds of a route where all are dense and none is cut: exactly. */
int64_t comp_route_messages(const comp_route *route, int place);

#endif
