/* Computes the ranks through which a fragment is sent to the owner of its pixel. The functions are plain arithmetic
 * without MPI and memory, so that tests can use any number of ranks.
 *
 * Every rank gets a number called its place, so that the ranks of one node have consecutive places. The ranks with the
 * first places are the owners of pixels; the number of owners is a product of radices. A place is written with one
 * digit per radix, the least significant first. In round i, places that differ only in digit i are partners, and each
 * sends its partners the fragments for those owners whose digit i is the partner's. After the last round all fragments
 * are at their owners:
 *
 *     direct send   one round, of all ranks
 *     by nodes      a round within each node, then one among the ranks that have the same number on their nodes
 *     radix-k       a round within each node, then rounds of at most k ranks
 *     binary swap   rounds of two ranks, regardless of nodes
 *
 * A rank whose place comes after those of the owners cannot own pixels. Before the first round it sends all its
 * fragments to one of the owners, its partner. An owner has at most one such partner. */
#ifndef COMP_COMP_ROUTE_H
#define COMP_COMP_ROUTE_H

#include <stdbool.h>
#include <stdint.h>

#include "comp_grid.h"

enum { COMP_MOST_ROUNDS = 32, COMP_MAX_DENSE_RANKS = 64 };

typedef enum comp_schedule {
    COMP_AUTOMATIC,
    COMP_DIRECT,
    COMP_NODES,
    COMP_RADIX,
    COMP_BINARY,
    COMP_SCHEDULE_COUNT
} comp_schedule;

/* The distribution of ranks over nodes: every node has the same number of ranks, and the ranks are numbered either
 * consecutively or cyclically over the nodes. In any other distribution `ranks` is 1. */
typedef struct comp_nodes {
    int ranks; /* number of ranks per node */
    bool is_cyclic;
} comp_nodes;

typedef struct comp_route {
    comp_schedule schedule;
    int ranks, owners;
    comp_nodes nodes;
    int round_count;
    int radix[COMP_MOST_ROUNDS]; /* for each round, the number of ranks that exchange fragments with each other */
    /* Largest number of ranks that exchange fragments in a dense round, in which every partner sends to every other.
     * comp_make_route() sets it to the maximum, COMP_MAX_DENSE_RANKS. */
    int max_dense_ranks;
} comp_route;

/* Returns the route of a schedule; COMP_AUTOMATIC is not allowed. The schedule COMP_RADIX has rounds of at most `radix`
 * ranks; other schedules ignore `radix`. */
comp_route comp_make_route(comp_schedule schedule, int ranks, comp_nodes nodes, int radix);

/* Every rank has a place: its number in an order in which the ranks of a node are consecutive.
 * comp_find_place_of_rank() returns a rank's place, and comp_find_rank_at_place() the rank at a place. */
int comp_find_place_of_rank(const comp_route *route, int rank);
int comp_find_rank_at_place(const comp_route *route, int place);

/* Returns the place value of the round's digit: the product of the radices of earlier rounds. A place is a number with
 * one digit per round; the places of two partners whose digits of this round differ by 1 differ by this value. */
int comp_route_stride(const comp_route *route, int round);

static inline int comp_route_digit(const comp_route *route, int round, int stride, int place)
{
    return place / stride % route->radix[round];
}

/* Returns the place of one of the partners of `place` in the round: the place whose digit of this round is `digit` and
 * whose other digits are those of `place`. stride: result of comp_route_stride() for the round. */
static inline int comp_route_partner(const comp_route *route, int round, int stride, int place, int digit)
{
    return place + (digit - comp_route_digit(route, round, stride, place)) * stride;
}

/* Returns whether the round is dense: every partner sends a message to every other, even an empty one. In a sparse
 * round only partners that have fragments send. */
static inline bool comp_route_is_dense(const comp_route *route, int round)
{
    return route->radix[round] <= route->max_dense_ranks;
}

/* Each claim contains the rank that owns a block. Replaces this rank by its place (comp_find_place_of_rank()). If the
 * place is not one of the first ones, which belong to owners, the block is given to the place of the rank's partner, to
 * which the rank sends its fragments before the first round. */
void comp_convert_claims_to_places(const comp_route *route, comp_claim *claims, uint32_t blocks);

/* Returns "direct", "nodes", "radix" or "binary". */
const char *comp_schedule_name(comp_schedule schedule);

#endif
