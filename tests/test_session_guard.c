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

#include "session_guard.h"

/* Kept from the optimizer, so that the divisions happen where they stand. */
static volatile double zero = 0;

static void divide_by_zero_on(int threads)
{
#pragma omp parallel num_threads(threads)
    {
        volatile double infinite = 1 / zero;
        (void)infinite;
    }
}

static void arm_traps(void)
{
    feclearexcept(FE_ALL_EXCEPT);
    feenableexcept(FE_DIVBYZERO | FE_INVALID | FE_OVERFLOW);
}

static void traps_are_off_inside_and_on_again_after(void **state)
{
    (void)state;
    enum { threads = 3 };
    session_guard guard;
    arm_traps(); /* where workers take the calling thread's settings */
#pragma omp parallel num_threads(threads)
    arm_traps(); /* where they keep their own */
    session_guard_begin(&guard, threads);
    divide_by_zero_on(threads); /* unguarded, this ends the process */
    session_guard_end(&guard);
    int armed = 0, flags = 0;
#pragma omp parallel num_threads(threads) reduction(+ : armed, flags)
    {
        armed += fegetexcept() == (FE_DIVBYZERO | FE_INVALID | FE_OVERFLOW);
        flags += fetestexcept(FE_DIVBYZERO) != 0;
        fedisableexcept(FE_ALL_EXCEPT);
    }
    fedisableexcept(FE_ALL_EXCEPT);
    assert_int_equal(armed, threads);
    assert_int_equal(flags, 0);
}

static void rounding_is_to_nearest_inside(void **state)
{
    (void)state;
    session_guard guard;
    fesetround(FE_UPWARD);
    session_guard_begin(&guard, 1);
    assert_int_equal(fegetround(), FE_TONEAREST);
    session_guard_end(&guard);
    assert_int_equal(fegetround(), FE_UPWARD);
    fesetround(FE_TONEAREST);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(traps_are_off_inside_and_on_again_after),
        cmocka_unit_test(rounding_is_to_nearest_inside),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
