/* Checks that the calling thread and the worker threads use less stack in a step than the sizes that the step requires
 * (session_threads.h). The stacks are filled with a pattern before a step, and the pattern is searched for the part
 * that was overwritten afterwards.
 *
 * If SMALL_STACKS is set in the environment, OpenMP's stacks are too small: the step must fail and state a sufficient
 * size. If TOLD_STACKS is set, the stacks have this sufficient size. */
#define _GNU_SOURCE
#include <omp.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "render.h"
#include "render_isa.h"
#include "session_threads.h"
#include "test_session_fixture.h"

enum { MOST_TOLD = 280 }; /* largest size in kB that the error about workers' stacks may suggest */
enum { PAINT = 0xa5, PAINTED = 1 << 20, NEAR = 1024 /* NEAR: stack of the painting function itself */ };

/* Replaces OpenMP's function, so that two threads are used on any machine. */
__attribute__((visibility("default"))) int omp_get_num_procs(void)
{
    return 2;
}

static __attribute__((noinline)) void paint_stack(volatile unsigned char **top)
{
    volatile unsigned char *here = __builtin_frame_address(0);
    *top = here;
    for (int i = NEAR; i < PAINTED; i++) here[-i] = PAINT;
}

/* Returns the largest distance below `top` at which the pattern was overwritten. */
static __attribute__((noinline)) int measure_painted_stack(volatile unsigned char *top)
{
    int taken = PAINTED - 1;
    while (taken > NEAR && top[-taken] == PAINT) taken--;
    return taken;
}

static volatile unsigned char *tops[2];

static void paint_stacks_of_threads(void)
{
#pragma omp parallel num_threads(2)
    paint_stack(&tops[omp_get_thread_num()]);
}

static void measure_stacks_of_threads(int most[2])
{
#pragma omp parallel num_threads(2)
    {
        const int me = omp_get_thread_num(), taken = measure_painted_stack(tops[me]);
        if (taken > most[me]) most[me] = taken;
    }
}

static const char *const layers[] = {
    "isosurface: {field: f, values: [0.1, 0.5]}",
    "isosurface: {field: f, values: [0.1], normals: differences, opacity: 0.5}",
    "volume: {field: f}\n    sampling: {method: samples}",
    "volume: {field: f}\n    sampling: {method: segments}",
    "volume: {field: f, opacity: [[0, 0], [0.5, 0], [0.5, 1], [1, 1]]}\n    sampling: {max_error: 0.01}",
    "volume: {field: f}\n    sampling: {max_error: 0.0001}",
    "volume: {field: f}\n      - volume: {field: f, map: grey}\n      - isosurface: {field: f, values: [0.3]}",
};

enum { LAYERS = sizeof layers / sizeof layers[0] };

static const char *write_layer_scene(const char *layer)
{
    char text[1024];
    snprintf(text, sizeof text,
             "threads: 2\nimages:\n  - name: a\n    size: [24, 16]\n    layers:\n      - %s\n"
             "    outputs:\n      - path: a_{cycle}.exr\n",
             layer);
    return write_scene(text);
}

static void measure_stack_of_layer(const session_input *in, const char *layer, int most[2])
{
    insitu_session *session = open_session(MPI_COMM_WORLD, write_layer_scene(layer));
    for (int cycle = 0; cycle < 2; cycle++) {
        insitu_mesh mesh = in->mesh;
        mesh.changed = cycle == 1 ? INSITU_CHANGED_GEOMETRY : INSITU_CHANGED_ALL;
        everywhere(insitu_set_mesh(session, "m", &mesh) == INSITU_OK);
        everywhere(insitu_set_field(session, "m", &in->field) == INSITU_OK);
        paint_stacks_of_threads();
        check_step_succeeds(session, cycle);
        measure_stacks_of_threads(most);
    }
    insitu_destroy(&session);
}

static void steps_use_less_stack_than_checked(void **context)
{
    (void)context;
    int most[2] = {0, 0};
    for (int kind = 0; kind < TEST_KIND_COUNT; kind++) {
        session_input in;
        input_create(&in, (test_mesh_kind)kind, 3, TEST_BLOCK, 0, 1);
        for (int layer = 0; layer < LAYERS; layer++) measure_stack_of_layer(&in, layers[layer], most);
        input_free(&in);
    }
    session_input in; /* enough cells for several threads to build the tree */
    input_create(&in, TEST_TETS, 15, TEST_BLOCK, 0, 1);
    measure_stack_of_layer(&in, layers[0], most);
    input_free(&in);
    printf("%s: of %d kB the calling thread takes %d, of %d kB a worker %d\n", render_isa(), SESSION_CALLER_STACK >> 10,
           most[0] >> 10, SESSION_WORKER_STACK >> 10, most[1] >> 10);
    assert_true(most[0] > 4 * NEAR && most[1] > 4 * NEAR); /* both stacks were really measured */
    assert_true(4 * most[0] <= 3 * SESSION_CALLER_STACK);
    assert_true(4 * most[1] <= 3 * SESSION_WORKER_STACK);
}

static void small_stacks_are_reported(void **context)
{
    (void)context;
    session_input in;
    input_create(&in, TEST_MIXED, 5, TEST_BLOCK, own_rank, rank_count);
    insitu_session *session = open_session(MPI_COMM_WORLD, write_layer_scene(layers[0]));
    everywhere(submit_input(session, &in) == INSITU_OK);
    for (int cycle = 0; cycle < 2; cycle++) {
        const insitu_status status = insitu_step(session, cycle, 0);
        check_reported_everywhere(session, status, INSITU_ERROR_ARGUMENT, "rank 0: OpenMP's threads have ",
                                  "of stack left, a step needs 256 kB: expected stacks of ", "(OMP_STACKSIZE=");
        const char *figure = strstr(insitu_error(session), "OMP_STACKSIZE=");
        const long reported = figure ? strtol(figure + strlen("OMP_STACKSIZE="), NULL, 10) : 0;
        everywhere(reported > SESSION_WORKER_STACK >> 10 && reported <= MOST_TOLD);
    }
    insitu_destroy(&session);
    input_free(&in);
}

/* Checks that stacks of the suggested size suffice: the test runs with OMP_STACKSIZE=MOST_TOLD in the environment. */
static void suggested_stacks_suffice(void **context)
{
    (void)context;
    session_input in;
    input_create(&in, TEST_MIXED, 5, TEST_BLOCK, own_rank, rank_count);
    insitu_session *session = open_session(MPI_COMM_WORLD, write_layer_scene(layers[0]));
    everywhere(submit_input(session, &in) == INSITU_OK);
    check_step_succeeds(session, 0);
    insitu_destroy(&session);
    input_free(&in);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest usual[] = {cmocka_unit_test(steps_use_less_stack_than_checked)};
    const struct CMUnitTest small[] = {cmocka_unit_test(small_stacks_are_reported)};
    const struct CMUnitTest reported[] = {cmocka_unit_test(suggested_stacks_suffice)};
    if (getenv("TOLD_STACKS")) return run_session_tests(argc, argv, reported, NULL, NULL);
    if (getenv("SMALL_STACKS")) return run_session_tests(argc, argv, small, NULL, NULL);
    return run_session_tests(argc, argv, usual, NULL, NULL);
}
