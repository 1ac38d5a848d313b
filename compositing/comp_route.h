/* The ranks by which a fragment goes to the owner of its pixel, in plain arithmetic without MPI and memory, so that
 * tests can try any number of ranks.
 *
 * Ranks are numbered by place: one rank of a node after the other, then the next node's. The first places are owners;
 * their number is a product of radices. A place is written with one digit a radix, the least one first: in round i,
 * places that differ only in digit i are partners, and each hands over the fragments for owners with the partner's
 * digit. After the last round all fragments are at their owners:
 *
 *     direct send   one round, of all ranks
 *     by nodes      a round within each node, then one among the ranks that have the same number on their nodes
 *     radix-k       a round within each node, then rounds of at most k
 *     binary swap   rounds of two, whatever the nodes
 *
 * Ranks beyond the owners give all they have to a partner before the first round; an owner has at most one such
 * partner. */
#ifndef COMP_COMP_ROUTE_H
#define COMP_COMP_ROUTE_H

#include <stdbool.h>
#include <stdint.h>

#include "comp_grid.h"

enum { COMP_MOST_ROUNDS = 32, COMP_LONGEST_DENSE = 64 };

typedef enum comp_schedule {
    COMP_AUTOMATIC,
    COMP_DIRECT,
    COMP_NODES,
    COMP_RADIX,
    COMP_BINARY,
    COMP_SCHEDULE_COUNT
} comp_schedule;

/* How ranks lie on nodes: the same number on each, either one node after the other or in turn. ranks is 1 where neither
 * is so. */
typedef struct comp_nodes {
    int ranks; /* the ranks of each node */
    bool is_cyclic;
} comp_nodes;

typedef struct comp_route {
    comp_schedule schedule;
    int ranks, owners;
    comp_nodes nodes;
    int round_count;
    int radix[COMP_MOST_ROUNDS];
    int longest_dense; /* at most COMP_LONGEST_DENSE, which comp_route_of() gives */
} comp_route;

/* The route of a schedule other than COMP_AUTOMATIC. radix is the most ranks that exchange in a round of COMP_RADIX. */
comp_route comp_route_of(comp_schedule schedule, int ranks, comp_nodes nodes, int radix);

/* A rank's place, and back. */
int comp_route_place(const comp_route *route, int rank);
int comp_route_rank(const comp_route *route, int place);

/* The distance between partners of the round: the product of the radices before. */
int comp_route_stride(const comp_route *route, int round);

static inline int comp_route_digit(const comp_route *route, int round, int stride, int place)
{
    return place / stride % route->radix[round];
}

/* The place of the partner with the digit. */
static inline int comp_route_partner(const comp_route *route, int round, int stride, int place, int digit)
{
    return place + (digit - comp_route_digit(route, round, stride, place)) * stride;
}

/* Tells whether every partner of the round sends to every other, or only those that have something do. */
static inline bool comp_route_is_dense(const comp_route *route, int round)
{
    return route->radix[round] <= route->longest_dense;
}

/* Makes the claims' owners places. Ranks beyond the route's owners own nothing: their partners own it for them. */
void comp_route_fold(const comp_route *route, comp_claim *claims, uint32_t blocks);

/* "direct", "nodes", "radix", "binary". */
const char *comp_schedule_name(comp_schedule schedule);

#endif
