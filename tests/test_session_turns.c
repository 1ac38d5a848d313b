/* Checks volumes that fill the same space, for which every cell on a ray makes a fragment. They are drawn in several
 * turns, so that no rank has all of its fragments in memory at once. The number of turns must be small, because all
 * ranks wait for each other in each turn. */
#include <stdio.h>

#include "test_effort.h"
#include "test_session_fixture.h"

#define IMAGE(width, height, layers)                                                                                   \
    "images:\n  - name: a\n    size: [" #width ", " #height "]\n    layers:\n" layers                                  \
    "    sampling: {method: segments}\n    camera: {automatic: {zoom: 1.24}}\n    outputs: [{path: a.exr}]\n"
#define THIN "      - volume: {field: f, opacity: [[0, 0.1], [1, 0.3]], unit_distance: 1}\n"
#define DENSE "      - volume: {field: f, opacity: [[0, 0.4], [0.5, 0.1], [1, 0.3]], unit_distance: 1}\n"

static insitu_report totals; /* fragments: sum over all ranks; bytes_peak: maximum over all ranks */

static void draw_and_count_passes(const char *text, int side)
{
    session_input in;
    input_create(&in, TEST_TETS, side, TEST_BLOCK, own_rank, rank_count);
    insitu_session *session = open_session_and_draw(MPI_COMM_WORLD, write_scene(text), &in);
    totals = *insitu_last_report(session);
    const int64_t own[3] = {totals.turns, -totals.turns, totals.bytes_peak};
    int64_t most[3];
    MPI_Allreduce(own, most, 3, MPI_INT64_T, MPI_MAX, MPI_COMM_WORLD);
    MPI_Allreduce(MPI_IN_PLACE, &totals.fragments, 1, MPI_INT64_T, MPI_SUM, MPI_COMM_WORLD);
    everywhere(most[0] == -most[1]);
    totals.bytes_peak = most[2];
    insitu_destroy(&session);
    input_free(&in);
    discard_pictures();
}

static void one_volume_needs_no_further_pass(void **context)
{
    (void)context;
    draw_and_count_passes(IMAGE(64, 48, THIN), 4);
    everywhere(totals.turns == 0);
}

/* Checks that a picture with few fragments per ray is drawn in one turn. */
static void two_volumes_take_a_further_pass(void **context)
{
    (void)context;
    draw_and_count_passes(IMAGE(40, 30, THIN DENSE), 4);
    everywhere(totals.turns == 1);
}

/* Checks a picture with many fragments. It took 124 turns when a turn was limited to an estimated 4 million fragments
 * of all ranks together. Now a rank can hold 2 million fragments at once (64 MiB), and as many packed and unpacked
 * ones. At least half of that must be used on average, so that a turn has a million fragments per rank. */
static void many_fragments_take_few_passes(void **context)
{
    (void)context;
    enum { LEAST_FRAGMENTS = 58900000, LEAST_PER_TURN = 1000000 };
    if (!test_is_long_run()) skip();
    draw_and_count_passes(IMAGE(960, 540, THIN DENSE), 48);
    if (own_rank == 0)
        fprintf(stderr, "%lld fragments in %d turns, %lld MB at most on a rank\n", (long long)totals.fragments,
                totals.turns, (long long)(totals.bytes_peak / 1000000));
    everywhere(totals.fragments >= LEAST_FRAGMENTS);
    everywhere((int64_t)totals.turns * rank_count * LEAST_PER_TURN <= totals.fragments);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(one_volume_needs_no_further_pass),
        cmocka_unit_test(two_volumes_take_a_further_pass),
        cmocka_unit_test(many_fragments_take_few_passes),
    };
    return run_session_tests(argc, argv, tests, NULL, NULL);
}
