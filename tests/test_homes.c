/* Checks homes of vertices that several ranks share (session_homes.h): the home is the rank that collects the vertex's
 * data. Many ranks are simulated without MPI. All ranks that have a vertex must compute the same home, and the home
 * must be one of their neighbours, so that a rank sends to few others, however many ranks there are. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "session_homes.h"

enum { SIDE = 12, RANKS = SIDE * SIDE * SIDE, MOST_NEAR = 27, MOST_SHARES = 64 };

/* Rank (i, j, k) of a block partition. It has the unit cube at (i, j, k). near, boxes: its neighbours including
 * itself. */
typedef struct block_rank {
    session_homes homes;
    int near[MOST_NEAR];
    session_box boxes[MOST_NEAR];
} block_rank;

static void block_create(block_rank *b, int rank)
{
    const int at[3] = {rank % SIDE, rank / SIDE % SIDE, rank / SIDE / SIDE};
    int count = 0;
    for (int other = 0; other < RANKS; other++) {
        const int there[3] = {other % SIDE, other / SIDE % SIDE, other / SIDE / SIDE};
        if (abs(there[0] - at[0]) > 1 || abs(there[1] - at[1]) > 1 || abs(there[2] - at[2]) > 1) continue;
        b->near[count] = other;
        for (int a = 0; a < 3; a++) {
            b->boxes[count].lower[a] = there[a];
            b->boxes[count].upper[a] = there[a] + 1;
        }
        count++;
    }
    b->homes = (session_homes){
        .is_computed = true, .rank = rank, .near_count = count, .near_ranks = b->near, .boxes = b->boxes};
}

static uint64_t hash_position(const double point[3])
{
    uint64_t h = 1469598103934665603u;
    for (int a = 0; a < 3; a++) h = (h ^ (uint64_t)(point[a] * 8 + 0.5)) * 1099511628211u;
    return h ^ h >> 29;
}

/* Checks every vertex on the faces of a block, on a lattice of eighths: all neighbours that have the vertex must
 * compute the same home as the block's rank. Returns the number of distinct homes. */
static int check_homes_of_block(const block_rank *own, block_rank *neighbours, int neighbour_count, int64_t *shared)
{
    bool is_home[RANKS] = {false};
    const double *low = own->homes.boxes[0].lower;
    int homes = 0;
    for (int n = 0; n < own->homes.near_count; n++)
        if (own->near[n] == own->homes.rank) low = own->boxes[n].lower;
    for (int v = 0; v < 9 * 9 * 9; v++) {
        const double point[1][3] = {{low[0] + v % 9 / 8.0, low[1] + v / 9 % 9 / 8.0, low[2] + v / 81 / 8.0}};
        if (!session_is_in_other_box(&own->homes, point[0])) continue;
        const int home = session_find_home_rank(&own->homes, point, 1, hash_position(point[0]), 0);
        (*shared)++;
        homes += !is_home[home];
        is_home[home] = true;
        for (int n = 0; n < neighbour_count; n++) {
            const session_box *box = NULL;
            for (int k = 0; k < neighbours[n].homes.near_count; k++)
                if (neighbours[n].near[k] == neighbours[n].homes.rank) box = &neighbours[n].boxes[k];
            bool has_it = true;
            for (int a = 0; a < 3; a++) has_it = has_it && box->lower[a] <= point[0][a] && point[0][a] <= box->upper[a];
            if (has_it)
                assert_int_equal(session_find_home_rank(&neighbours[n].homes, point, 1, hash_position(point[0]), 0),
                                 home);
        }
    }
    return homes;
}

static void home_ranks_by_coordinates_agree_on_all_ranks(void **state)
{
    static const int ranks[] = {0, SIDE / 2, SIDE * SIDE / 2 + SIDE / 2, RANKS / 2 + SIDE * SIDE / 2 + SIDE / 2,
                                RANKS - 1};
    (void)state;
    for (size_t i = 0; i < sizeof ranks / sizeof *ranks; i++) {
        block_rank own, *neighbours = calloc(MOST_NEAR, sizeof *neighbours);
        int64_t shared = 0;
        assert_non_null(neighbours);
        block_create(&own, ranks[i]);
        for (int n = 0; n < own.homes.near_count; n++) block_create(&neighbours[n], own.near[n]);
        const int homes = check_homes_of_block(&own, neighbours, own.homes.near_count, &shared);
        assert_true(shared > 100);
        assert_true(homes > 1 && homes <= own.homes.near_count);
        free(neighbours);
    }
}

/* Checks homes by id. The home of a vertex is the owner of the share that contains its id. A share begins with its
 * first id, and ids below the first share belong to the first share. */
static void home_ranks_by_id_match_partition_owners(void **state)
{
    (void)state;
    int64_t firsts[MOST_SHARES];
    int owners[MOST_SHARES];
    session_homes homes = {.is_computed = true,
                           .by_id = true,
                           .rank = 3,
                           .share_count = MOST_SHARES,
                           .first_ids = firsts,
                           .owners = owners};
    for (int i = 0; i < MOST_SHARES; i++) {
        firsts[i] = 100 * i + 40;
        owners[i] = (i * 37) % MOST_SHARES;
    }
    const double nowhere[1][3] = {{0, 0, 0}};
    for (int64_t id = -50; id < 100 * MOST_SHARES + 200; id++) {
        int expected = 0;
        while (expected + 1 < MOST_SHARES && firsts[expected + 1] <= id) expected++;
        assert_int_equal(session_find_home_rank(&homes, nowhere, 1, 0, id), owners[expected]);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(home_ranks_by_coordinates_agree_on_all_ranks),
                                       cmocka_unit_test(home_ranks_by_id_match_partition_owners)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
