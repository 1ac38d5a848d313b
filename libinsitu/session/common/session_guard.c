/* Simulations trap floating-point exceptions to find their own errors (gfortran's -ffpe-trap, feenableexcept()), or
 * flush denormal numbers to zero (icc's -ftz, gcc's -ffast-math). A trap would end the run in a box test that
 * intentionally divides by zero, or at the number 1e999 in a scene; flushing would change pictures. Traps and flushing
 * are settings of each thread. GNU's OpenMP workers inherit these settings from the thread that first started them.
 * LLVM's workers inherit the settings from the thread that opens a parallel region, and LLVM's OpenMP restores the
 * settings of all threads at the end of the region. Therefore every call sets the default environment and restores the
 * calling thread's environment afterwards, outside of parallel regions. Workers have the default environment within
 * each region (region.h), and their own between regions. */
#include "session_guard.h"

#include <omp.h>

void session_guard_save_settings(session_guard *guard)
{
    fegetenv(&guard->caller_environment);
    fesetenv(FE_DFL_ENV);
    guard->is_dynamic = omp_get_dynamic();
    omp_set_dynamic(0);
}

void session_guard_restore_settings(const session_guard *guard)
{
    omp_set_dynamic(guard->is_dynamic);
    fesetenv(&guard->caller_environment);
}

void session_guard_set_caller_fenv(const session_guard *guard)
{
    fesetenv(&guard->caller_environment);
}

void session_guard_set_default_fenv(void)
{
    fesetenv(FE_DFL_ENV);
}
