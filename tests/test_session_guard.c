/* A step under hostile floating-point settings: traps armed as gfortran's -ffpe-trap does, and small numbers flushed.
 */
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

/* Kept from the optimizer, so that the divisions happen where they stand. */
static volatile double zero = 0;

static void divide_by_zero_on(int threads)
{
#pragma omp parallel num_threads(threads)
    {
        region_enter();
        volatile double infinite = 1 / zero;
        (void)infinite;
        region_leave();
    }
}

/* As the session does before its first region of so many threads. */
static void start_threads(const session_guard *guard, int threads)
{
    session_guard_suspend(guard);
#pragma omp parallel num_threads(threads)
    {
        region_enter();
        region_leave();
    }
    session_guard_resume();
}

static void enable_traps(void)
{
    feclearexcept(FE_ALL_EXCEPT);
    feenableexcept(TRAPS);
}

/* Counts the threads of a team that have the traps, and those with the flag of a division by zero, and disarms all. */
static void count_enabled(int threads, int *armed, int *flagged)
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

static void traps_are_off_inside_and_on_again_after(void **state)
{
    (void)state;
    session_guard guard;
    int armed, flagged;
    enable_traps(); /* where workers take the calling thread's settings */
#pragma omp parallel num_threads(THREADS)
    enable_traps(); /* where they keep their own */
    session_guard_begin(&guard);
    divide_by_zero_on(THREADS); /* unguarded, this ends the process */
    session_guard_end(&guard);
    count_enabled(THREADS, &armed, &flagged);
    assert_int_equal(armed, THREADS);
    assert_int_equal(flagged, 0);
}

/* More threads than any team before had. */
static void threads_first_needed_inside_are_as_the_callers_own(void **state)
{
    (void)state;
    session_guard guard;
    int armed, flagged;
    enable_traps();
#pragma omp parallel num_threads(THREADS)
    enable_traps();
    session_guard_begin(&guard);
    start_threads(&guard, 2 * THREADS);
    divide_by_zero_on(2 * THREADS);
    session_guard_end(&guard);
    count_enabled(2 * THREADS, &armed, &flagged);
    assert_int_equal(armed, 2 * THREADS);
    assert_int_equal(flagged, 0);
}

/* Rounding of a worker is its own again between regions, and to nearest within them. */
static void workers_have_their_own_between_regions(void **state)
{
    (void)state;
    session_guard guard;
    int nearest = 0, upward = 0;
#pragma omp parallel num_threads(THREADS)
    fesetround(FE_UPWARD);
    session_guard_begin(&guard);
    for (int turn = 0; turn < 2; turn++) {
#pragma omp parallel num_threads(THREADS) reduction(+ : nearest)
        {
            region_enter();
            nearest += fegetround() == FE_TONEAREST;
            region_leave();
        }
    }
    fesetround(FE_UPWARD); /* LLVM's workers take the caller's at every begin of a region */
#pragma omp parallel num_threads(THREADS) reduction(+ : upward)
    upward += fegetround() == FE_UPWARD;
    session_guard_end(&guard);
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
    session_guard_begin(&guard);
    assert_int_equal(fegetround(), FE_TONEAREST);
    session_guard_end(&guard);
    assert_int_equal(fegetround(), FE_UPWARD);
    fesetround(FE_TONEAREST);
}

/* OpenMP may give teams of any size where the caller has allowed it; a step's are all of one. */
static void teams_are_of_one_size_inside(void **state)
{
    (void)state;
    for (int is_dynamic = 0; is_dynamic < 2; is_dynamic++) {
        session_guard guard;
        omp_set_dynamic(is_dynamic);
        session_guard_begin(&guard);
        assert_false(omp_get_dynamic());
        session_guard_end(&guard);
        assert_int_equal(omp_get_dynamic(), is_dynamic);
    }
    omp_set_dynamic(0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(traps_are_off_inside_and_on_again_after),
        cmocka_unit_test(threads_first_needed_inside_are_as_the_callers_own),
        cmocka_unit_test(workers_have_their_own_between_regions),
        cmocka_unit_test(rounding_is_to_nearest_inside),
        cmocka_unit_test(teams_are_of_one_size_inside),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
