/* Estimates the fastest schedule by the LogGP model (Alexandrov, Ionescu, Schauser, Scheiman, 1995): each message takes
 * an overhead on its sender and its receiver and a latency of the network, and each byte takes a gap.
 *
 * Every schedule packs and unpacks each fragment once. Schedules therefore differ only in the number of messages that a
 * rank sends, and in how often its bytes are sent. In a dense round, in which every partner sends to every other
 * (comp_messages.h), empty messages count too. */
#ifndef COMP_COMP_COST_H
#define COMP_COMP_COST_H

#include "comp_route.h"

/* Times in seconds; the gap is the time per byte. */
typedef struct comp_machine {
    double latency, overhead, gap;                /* times of messages between nodes */
    double node_latency, node_overhead, node_gap; /* times of messages within a node */
} comp_machine;

/* Typical values of a current cluster: 10 GB/s per rank, 1 microsecond of overhead and 2 microseconds of latency
 * between nodes; half of these times within a node. */
extern const comp_machine comp_default_machine;

/* The load of the busiest rank, which is the rank with most fragments. The cost of a route is estimated for this
 * rank. */
typedef struct comp_load {
    int64_t fragments;
    double bytes;          /* average size of a fragment in a message, in bytes (comp_sheet.h) */
    uint32_t block_pixels; /* number of pixels of a block; all pixels of a block have the same owner (comp_grid.h) */
} comp_load;

/* The cost of a route for the busiest rank. */
typedef struct comp_cost {
    double messages; /* number of messages that the rank sends, including empty ones */
    double bytes;    /* total size of the rank's messages */
    double seconds;
} comp_cost;

comp_cost comp_estimate_cost(const comp_route *route, const comp_load *load, const comp_machine *machine);

/* Returns the route with the lowest estimated time. */
comp_route comp_find_fastest_route(int ranks, comp_nodes nodes, const comp_load *load, const comp_machine *machine);

/* Returns the number of messages that a rank sends in all rounds of the route, if every partner sends to every other in
 * each round and no message must be divided because of its length. place: the rank's number in the order of ranks by
 * nodes (comp_route.h). */
int64_t comp_count_route_messages(const comp_route *route, int place);

#endif
