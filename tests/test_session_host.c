/* Checks a session in restricted processes: ones that can start few threads or none, in which OpenMP makes smaller
 * teams than requested, or in which floating-point exceptions trap. The test replaces the functions that return the
 * number of cores, start threads and open GNU's parallel regions, so that it can set any limit on any machine. The
 * session must not run into a limit inside OpenMP, because the process ends if OpenMP itself fails to start a
 * thread. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fenv.h>
#include <limits.h>
#include <omp.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "region.h"
#include "test_session_fixture.h"

#define VISIBLE __attribute__((visibility("default")))

/* ---- the process ---------------------------------------------------------------------------------------------- */

static int cores = 8;

VISIBLE int omp_get_num_procs(void)
{
    return cores;
}

static atomic_int live_threads;
static atomic_int most_threads = INT_MAX;

typedef struct thread_start {
    void *(*function)(void *);
    void *argument;
} thread_start;

static void count_end(void *value)
{
    (void)value;
    atomic_fetch_sub(&live_threads, 1);
}

static void *run_counted(void *given)
{
    const thread_start start = *(thread_start *)given;
    void *result;
    free(given);
    pthread_cleanup_push(count_end, NULL);
    result = start.function(start.argument);
    pthread_cleanup_pop(1);
    return result;
}

typedef int create_function(pthread_t *, const pthread_attr_t *, void *(*)(void *), void *);

VISIBLE int pthread_create(pthread_t *thread, const pthread_attr_t *attributes, void *(*function)(void *),
                           void *argument)
{
    create_function *real = NULL;
    *(void **)&real = dlsym(RTLD_NEXT, "pthread_create");
    thread_start *start = malloc(sizeof *start);
    int code = EAGAIN;
    if (start && atomic_fetch_add(&live_threads, 1) < atomic_load(&most_threads)) {
        *start = (thread_start){function, argument};
        code = real(thread, attributes, run_counted, start);
    }
    if (code == 0) return 0;
    free(start);
    atomic_fetch_sub(&live_threads, 1);
    return code;
}

/* Allows this number of threads to be started in addition to those that are running. */
static void allow_additional_threads(int more)
{
    atomic_store(&most_threads, atomic_load(&live_threads) + more);
}

static int other_threads; /* number of threads that MPI has started */

/* Ends idle threads, as far as OpenMP does so: GNU's ends threads that the next region does not need, LLVM's keeps
 * them. */
static void end_threads(void)
{
    int given = 0;
    atomic_store(&most_threads, INT_MAX);
#pragma omp parallel num_threads(2) reduction(+ : given)
    given++;
    assert_int_equal(given, 2);
    for (int wait = 0; wait < 500 && atomic_load(&live_threads) > other_threads + 1; wait++)
        nanosleep(&(struct timespec){.tv_nsec = 1000000}, NULL);
}

static bool gives_smaller_teams;
static unsigned team_turn;

static unsigned limit_team_size(unsigned asked)
{
    if (!gives_smaller_teams || asked < 2 || omp_get_level() > 0) return asked;
    team_turn = team_turn * 1664525 + 1013904223;
    return 1 + (team_turn >> 16) % asked;
}

typedef void parallel_function(void (*)(void *), void *, unsigned, unsigned);
typedef void loop_function(void (*)(void *), void *, unsigned, long, long, long, long, unsigned);

VISIBLE void GOMP_parallel(void (*body)(void *), void *data, unsigned threads, unsigned flags);
VISIBLE void GOMP_parallel(void (*body)(void *), void *data, unsigned threads, unsigned flags)
{
    parallel_function *real = NULL;
    *(void **)&real = dlsym(RTLD_NEXT, "GOMP_parallel");
    real(body, data, limit_team_size(threads), flags);
}

VISIBLE void GOMP_parallel_loop_nonmonotonic_dynamic(void (*body)(void *), void *data, unsigned threads, long begin,
                                                     long end, long step, long chunk, unsigned flags);
VISIBLE void GOMP_parallel_loop_nonmonotonic_dynamic(void (*body)(void *), void *data, unsigned threads, long begin,
                                                     long end, long step, long chunk, unsigned flags)
{
    loop_function *real = NULL;
    *(void **)&real = dlsym(RTLD_NEXT, "GOMP_parallel_loop_nonmonotonic_dynamic");
    real(body, data, limit_team_size(threads), begin, end, step, chunk, flags);
}

/* ---- a session ------------------------------------------------------------------------------------------------ */

static session_input input;
static caught_picture expected; /* the picture drawn with one thread */

static const char *write_scene_with_threads(int threads)
{
    char text[1024];
    snprintf(text, sizeof text,
             "threads: %d\n"
             "images:\n"
             "  - name: a\n"
             "    size: [120, 90]\n"
             "    layers:\n"
             "      - isosurface: {field: f, values: [0.1]}\n"
             "      - volume: {field: f}\n"
             "    outputs:\n"
             "      - path: a_{cycle}.exr\n",
             threads);
    return write_scene(text);
}

static insitu_session *open_session_with_threads(int threads)
{
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene_with_threads(threads));
    everywhere(submit_input(session, &input) == INSITU_OK);
    return session;
}

/* Checks that a step draws the picture that one thread draws. */
static void check_step_draws_expected_picture(insitu_session *session, int cycle)
{
    const size_t pixels = (size_t)120 * 90;
    check_step_succeeds(session, cycle);
    const bool is_first = own_rank == 0 && !expected.rgba;
    if (is_first) {
        expected = caught[0];
        caught_count = 0;
    }
    everywhere(own_rank != 0 || is_first ||
               (!memcmp(expected.rgba, caught[0].rgba, 4 * pixels * sizeof(float)) &&
                !memcmp(expected.depth, caught[0].depth, pixels * sizeof(float))));
}

static bool has_warning(const insitu_session *session, const char *words)
{
    return strstr(insitu_last_report(session)->warnings, words) != NULL;
}

static int begin_test(void **context)
{
    (void)context;
    gives_smaller_teams = false;
    end_threads();
    cores = 8;
    return 0;
}

/* ---- threads -------------------------------------------------------------------------------------------------- */

static void one_thread_draws_the_picture(void **context)
{
    (void)context;
    insitu_session *session = open_session_with_threads(1);
    check_step_draws_expected_picture(session, 0);
    everywhere(!*insitu_last_report(session)->warnings);
    insitu_destroy(&session);
}

static void thread_count_is_at_most_core_count(void **context)
{
    (void)context;
    cores = 3;
    allow_additional_threads(3 - 1 + 4); /* the session tries to start the missing threads and four spare ones */
    insitu_session *session = open_session_with_threads(1024);
    check_step_draws_expected_picture(session, 0);
    everywhere(has_warning(session,
                           "the scene asks for 1024 threads, at most 3 are used: this rank may run on no more cores"));
    everywhere(!has_warning(session, "can be started"));
    insitu_destroy(&session);
}

static void step_succeeds_without_threads_that_fail_to_start(void **context)
{
    (void)context;
    static const struct {
        int allowed;
        const char *words;
    } cases[] = {{0, "1 of 8 threads"}, {1, "1 of 8 threads"}, {4, "1 of 8 threads"},
                 {5, "2 of 8 threads"}, {9, "6 of 8 threads"}, {10, "7 of 8 threads"}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        end_threads();
        allow_additional_threads(cases[i].allowed);
        insitu_session *session = open_session_with_threads(8);
        check_step_draws_expected_picture(session, 0);
        everywhere(has_warning(session, cases[i].words));
        everywhere(has_warning(session, "are used: no more can be started"));
        for (int cycle = 1; cycle < 4; cycle++) check_step_draws_expected_picture(session, cycle);
        allow_additional_threads(30);
        check_step_draws_expected_picture(session, 4);
        everywhere(!*insitu_last_report(session)->warnings);
        insitu_destroy(&session);
    }
}

static void scene_edit_starts_at_most_the_possible_threads(void **context)
{
    (void)context;
    cores = 2;
    insitu_session *session = open_session_with_threads(2);
    check_step_draws_expected_picture(session, 0);
    cores = 64;
    allow_additional_threads(20);
    write_scene_with_threads(4096);
    check_step_draws_expected_picture(session, 1);
    everywhere(has_warning(session, "the scene asks for 4096 threads, at most 64 are used"));
    everywhere(has_warning(session, "18 of 64 threads are used: no more can be started"));
    for (int cycle = 2; cycle < 5; cycle++) check_step_draws_expected_picture(session, cycle);
    insitu_destroy(&session);
}

static void threads_that_ended_are_tried_again(void **context)
{
    (void)context;
    insitu_session *session = open_session_with_threads(8);
    check_step_draws_expected_picture(session, 0);
    end_threads();
    allow_additional_threads(5);
    check_step_draws_expected_picture(session, 1);
    insitu_destroy(&session);
}

/* Checks the number of parallel regions in a step. It should be small, because at the end of each region the team waits
 * for threads whose core is in use by another process. Only the values are new in the step: their ranges are refitted
 * (by one thread if trees are small), cells are binned, and tiles are traced. */
static void a_step_opens_few_regions(void **context)
{
    (void)context;
    static const char *const layers[2] = {"isosurface: {field: f, values: [0.1]}", "volume: {field: f}"};
    for (int i = 0; i < 2; i++) {
        char text[512];
        snprintf(text, sizeof text,
                 "threads: 2\nimages:\n  - {name: a, size: [120, 90], layers: [%s], outputs: [{path: a.png}]}\n",
                 layers[i]);
        insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(text));
        everywhere(submit_input(session, &input) == INSITU_OK);
        for (int cycle = 0; cycle < 6; cycle++) {
            const int64_t before = region_count();
            everywhere(insitu_set_field(session, "m", &input.field) == INSITU_OK);
            check_step_succeeds(session, cycle);
            const int64_t regions = region_count() - before;
            everywhere(cycle < 4 || (regions > 0 && regions <= (rank_count == 1 ? 3 : 6)));
        }
        insitu_destroy(&session);
    }
}

static void fewer_threads_draw_the_same_picture(void **context)
{
    (void)context;
    cores = 5;
    gives_smaller_teams = true;
    insitu_session *session = open_session_with_threads(5);
    for (int cycle = 0; cycle < 30; cycle++) {
        everywhere(submit_input(session, &input) == INSITU_OK);
        input.mesh.changed = cycle % 3 == 0 ? INSITU_CHANGED_ALL : cycle % 3 == 1 ? INSITU_CHANGED_GEOMETRY : 0;
        check_step_draws_expected_picture(session, cycle);
    }
    input.mesh.changed = INSITU_CHANGED_ALL;
    insitu_destroy(&session);
}

static void team_size_of_the_caller_is_not_changed(void **context)
{
    (void)context;
    insitu_session *session = open_session_with_threads(4);
    omp_set_dynamic(1);
    check_step_draws_expected_picture(session, 0);
    everywhere(omp_get_dynamic());
    omp_set_dynamic(0);
    check_step_draws_expected_picture(session, 1);
    everywhere(!omp_get_dynamic());
    insitu_destroy(&session);
}

static void a_parallel_region_of_the_caller_gets_one_thread(void **context)
{
    (void)context;
    omp_set_max_active_levels(2);
    insitu_session *session = open_session_with_threads(4);
#pragma omp parallel num_threads(2)
#pragma omp master
    {
        allow_additional_threads(0);
        check_step_draws_expected_picture(session, 0);
        everywhere(has_warning(session, "within a parallel region"));
    }
    insitu_destroy(&session);
    omp_set_max_active_levels(1);
}

/* ---- floating-point exceptions -------------------------------------------------------------------------------- */

enum { TRAPS = FE_DIVBYZERO | FE_INVALID | FE_OVERFLOW };

static const char too_large[] = "images:\n"
                                "  - name: a\n"
                                "    camera: {automatic: {zoom: 1e999}}\n"
                                "    layers: [isosurface: {field: f, values: [1]}]\n"
                                "    outputs: [path: a.png]\n";

static void oversized_number_in_a_scene_raises_no_trap(void **context)
{
    (void)context;
    insitu_session *session = NULL, *open = open_session_with_threads(2);
    check_step_succeeds(open, 0);
    const char *path = write_scene(too_large);
    feclearexcept(FE_ALL_EXCEPT);
    feenableexcept(TRAPS);
    const insitu_status created = insitu_create(MPI_COMM_WORLD, path, &session);
    const bool is_refused = created == INSITU_ERROR_SCENE && !session && strstr(insitu_error(NULL), "1e999");
    const insitu_status stepped = insitu_step(open, 1, 0);
    const bool is_as_before = fegetexcept() == TRAPS && fetestexcept(FE_ALL_EXCEPT) == 0;
    fedisableexcept(FE_ALL_EXCEPT);
    everywhere(is_refused && is_as_before);
    everywhere(stepped == INSITU_OK && has_warning(open, "1e999"));
    insitu_destroy(&open);
}

static int set_up_test_group(void **state)
{
    (void)state;
    other_threads = atomic_load(&live_threads);
    input_create(&input, TEST_MIXED, 7, TEST_BLOCK, own_rank, rank_count);
    test_mesh_to_polyhedra(&input.part, 0.3);
    input_describe(&input);
    return 0;
}

static int tear_down_test_group(void **state)
{
    (void)state;
    input_free(&input);
    free(expected.rgba);
    free(expected.depth);
    return 0;
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(one_thread_draws_the_picture, begin_test),
        cmocka_unit_test_setup(thread_count_is_at_most_core_count, begin_test),
        cmocka_unit_test_setup(step_succeeds_without_threads_that_fail_to_start, begin_test),
        cmocka_unit_test_setup(scene_edit_starts_at_most_the_possible_threads, begin_test),
        cmocka_unit_test_setup(threads_that_ended_are_tried_again, begin_test),
        cmocka_unit_test_setup(a_step_opens_few_regions, begin_test),
        cmocka_unit_test_setup(fewer_threads_draw_the_same_picture, begin_test),
        cmocka_unit_test_setup(team_size_of_the_caller_is_not_changed, begin_test),
        cmocka_unit_test_setup(a_parallel_region_of_the_caller_gets_one_thread, begin_test),
        cmocka_unit_test_setup(oversized_number_in_a_scene_raises_no_trap, begin_test),
    };
    return run_session_tests(argc, argv, tests, set_up_test_group, tear_down_test_group);
}
