/* Checks that a step works under unusual floating-point settings of the caller: enabled traps, as set by gfortran's
 * -ffpe-trap, and subnormal numbers flushed to zero. */
#define _GNU_SOURCE
#include <fenv.h>
#include <omp.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "region.h"
#include "session_guard.h"

enum { TRAPS = FE_DIVBYZERO | FE_INVALID | FE_OVERFLOW, THREADS = 3 };

/* volatile, so that the optimizer does not move or remove the divisions */
static volatile double zero = 0;

static void divide_by_zero_on_threads(int threads)
{
#pragma omp parallel num_threads(threads)
    {
        region_enter();
        volatile double infinite = 1 / zero;
        (void)infinite;
        region_leave();
    }
}

/* Starts a team of threads as the session does before its first parallel region with this number of threads. */
static void start_threads(const session_guard *guard, int threads)
{
    session_guard_set_caller_fenv(guard);
#pragma omp parallel num_threads(threads)
    {
        region_enter();
        region_leave();
    }
    session_guard_set_default_fenv();
}

static void enable_traps(void)
{
    feclearexcept(FE_ALL_EXCEPT);
    feenableexcept(TRAPS);
}

/* Disables the traps of a team. Counts the threads whose traps were enabled (armed), and those whose flag of a division
 * by zero was set (flagged). */
static void disable_and_count_traps(int threads, int *armed, int *flagged)
{
    int traps = 0, flags = 0;
#pragma omp parallel num_threads(threads) reduction(+ : traps, flags)
    {
        traps += fegetexcept() == TRAPS;
        flags += fetestexcept(FE_DIVBYZERO) != 0;
        fedisableexcept(FE_ALL_EXCEPT);
    }
    *armed = traps;
    *flagged = flags;
}

static void floating_point_traps_are_disabled_inside(void **state)
{
    (void)state;
    session_guard guard;
    int armed, flagged;
    enable_traps(); /* for OpenMP libraries whose workers inherit the calling thread's settings */
#pragma omp parallel num_threads(THREADS)
    enable_traps(); /* for OpenMP libraries whose workers keep their own settings */
    session_guard_save_settings(&guard);
    divide_by_zero_on_threads(THREADS); /* without the guard, this terminates the process */
    session_guard_restore_settings(&guard);
    disable_and_count_traps(THREADS, &armed, &flagged);
    assert_int_equal(armed, THREADS);
    assert_int_equal(flagged, 0);
}

/* Checks a team that is larger than any team before, so that new threads are started. */
static void threads_started_inside_inherit_the_callers_settings(void **state)
{
    (void)state;
    session_guard guard;
    int armed, flagged;
    enable_traps();
#pragma omp parallel num_threads(THREADS)
    enable_traps();
    session_guard_save_settings(&guard);
    start_threads(&guard, 2 * THREADS);
    divide_by_zero_on_threads(2 * THREADS);
    session_guard_restore_settings(&guard);
    disable_and_count_traps(2 * THREADS, &armed, &flagged);
    assert_int_equal(armed, 2 * THREADS);
    assert_int_equal(flagged, 0);
}

/* Checks the rounding mode of worker threads: to nearest inside regions, and the worker's own mode between them. */
static void workers_restore_their_settings_between_regions(void **state)
{
    (void)state;
    session_guard guard;
    int nearest = 0, upward = 0;
#pragma omp parallel num_threads(THREADS)
    fesetround(FE_UPWARD);
    session_guard_save_settings(&guard);
    for (int turn = 0; turn < 2; turn++) {
#pragma omp parallel num_threads(THREADS) reduction(+ : nearest)
        {
            region_enter();
            nearest += fegetround() == FE_TONEAREST;
            region_leave();
        }
    }
    /* sets the mode of the calling thread too, because LLVM's workers inherit it whenever a region begins */
    fesetround(FE_UPWARD);
#pragma omp parallel num_threads(THREADS) reduction(+ : upward)
    upward += fegetround() == FE_UPWARD;
    session_guard_restore_settings(&guard);
    assert_int_equal(nearest, 2 * THREADS);
    assert_int_equal(upward, THREADS);
#pragma omp parallel num_threads(THREADS)
    fesetround(FE_TONEAREST);
}

static void rounding_is_to_nearest_inside(void **state)
{
    (void)state;
    session_guard guard;
    fesetround(FE_UPWARD);
    session_guard_save_settings(&guard);
    assert_int_equal(fegetround(), FE_TONEAREST);
    session_guard_restore_settings(&guard);
    assert_int_equal(fegetround(), FE_UPWARD);
    fesetround(FE_TONEAREST);
}

/* Checks that all teams of a step have the same size, even if the caller has allowed OpenMP to choose any size. */
static void thread_teams_have_one_size_inside(void **state)
{
    (void)state;
    for (int is_dynamic = 0; is_dynamic < 2; is_dynamic++) {
        session_guard guard;
        omp_set_dynamic(is_dynamic);
        session_guard_save_settings(&guard);
        assert_false(omp_get_dynamic());
        session_guard_restore_settings(&guard);
        assert_int_equal(omp_get_dynamic(), is_dynamic);
    }
    omp_set_dynamic(0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(floating_point_traps_are_disabled_inside),
        cmocka_unit_test(threads_started_inside_inherit_the_callers_settings),
        cmocka_unit_test(workers_restore_their_settings_between_regions),
        cmocka_unit_test(rounding_is_to_nearest_inside),
        cmocka_unit_test(thread_teams_have_one_size_inside),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
