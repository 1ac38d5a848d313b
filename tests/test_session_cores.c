/* Checks the number of cores that a rank receives, for different bindings of ranks to cores: by arithmetic, and with
 * this machine's cores. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <mpi.h>
#include <omp.h>

#include "session_cores.h"

enum { MOST_CORES = 128, MOST_RANKS = 16 };

/* The cores to which a rank is bound: `count` cores from number `first` on. */
typedef struct binding {
    int first, count;
} binding;

static void check_shares(const binding *ranks, int rank_count, const int *expected)
{
    int32_t counts[MOST_CORES] = {0}, own[MOST_RANKS][MOST_CORES] = {{0}};
    for (int r = 0; r < rank_count; r++)
        for (int k = ranks[r].first; k < ranks[r].first + ranks[r].count; k++) {
            own[r][k] = 1;
            counts[k]++;
        }
    for (int r = 0; r < rank_count; r++)
        assert_int_equal(session_compute_share_of_cores(own[r], counts, MOST_CORES), expected[r]);
}

/* Checks the numbers of cores of ranks that are all bound to the same cores. */
static void check_equal_shares(binding one, int rank_count, int expected)
{
    binding ranks[MOST_RANKS];
    int shares[MOST_RANKS];
    for (int r = 0; r < rank_count; r++) {
        ranks[r] = one;
        shares[r] = expected;
    }
    check_shares(ranks, rank_count, shares);
}

static void ranks_divide_the_cores_of_their_affinity_mask(void **context)
{
    (void)context;
    check_equal_shares((binding){0, 64}, 1, 64);
    check_equal_shares((binding){0, 64}, 8, 8);
    check_equal_shares((binding){0, 64}, 7, 9);
    check_equal_shares((binding){0, 2}, 8, 1);
    check_equal_shares((binding){40, 12}, 3, 4); /* the container's cores do not begin at 0 */
    check_shares((const binding[]){{0, 32}, {32, 32}, {0, 32}, {32, 32}}, 4, (const int[]){16, 16, 16, 16});
    check_shares((const binding[]){{0, 4}, {4, 4}, {8, 4}}, 3, (const int[]){4, 4, 4});
    check_shares((const binding[]){{0, 1}, {0, 4}}, 2, (const int[]){1, 3});
}

static void ranks_of_one_node_divide_its_cores(void **context)
{
    (void)context;
    int ranks = 1;
    MPI_Comm_size(MPI_COMM_WORLD, &ranks);
    const int share = omp_get_num_procs() / ranks;
    assert_int_equal(session_count_cores_of_rank(MPI_COMM_WORLD), share > 1 ? share : 1);
}

int main(int argc, char **argv)
{
    MPI_Init(&argc, &argv);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(ranks_divide_the_cores_of_their_affinity_mask),
        cmocka_unit_test(ranks_of_one_node_divide_its_cores),
    };
    const int failed = cmocka_run_group_tests(tests, NULL, NULL);
    MPI_Finalize();
    return failed;
}
