/* Simulations trap floating-point exceptions to find their own faults (gfortran's -ffpe-trap, feenableexcept()), or
 * flush small numbers to zero (icc's -ftz, gcc's -ffast-math). Under the first, a box test of ours that divides by
 * zero on purpose, or a scene's 1e999, would kill the run; under the second, pictures would change. Both are settings
 * of a thread, which OpenMP's workers inherit from whoever first needed them (GNU's), or at the begin of every parallel
 * region from the thread that opens it (LLVM's, which also undoes at its end what the region changed on any thread). So
 * every call works under the default environment, a step on every thread, and leaves each as it was; the calling thread
 * is set outside of parallel regions. A worker keeps its own: which threads a team has is OpenMP's choice. */
#include "session_guard.h"

#include <omp.h>
#include <stdbool.h>

static _Thread_local fenv_t worker_environment;
static _Thread_local bool is_worker_guarded;

void session_guard_begin(session_guard *guard)
{
    fegetenv(&guard->caller);
    fesetenv(FE_DFL_ENV);
    guard->is_dynamic = omp_get_dynamic();
    omp_set_dynamic(0);
}

void session_guard_end(const session_guard *guard)
{
    omp_set_dynamic(guard->is_dynamic);
    fesetenv(&guard->caller);
}

void session_guard_begin_team(const session_guard *guard, int threads)
{
    fesetenv(&guard->caller);
#pragma omp parallel num_threads(threads)
    if (omp_get_thread_num() > 0) {
        fegetenv(&worker_environment);
        is_worker_guarded = true;
        fesetenv(FE_DFL_ENV);
    }
    fesetenv(FE_DFL_ENV);
}

void session_guard_end_team(int threads)
{
#pragma omp parallel num_threads(threads)
    if (omp_get_thread_num() > 0 && is_worker_guarded) {
        is_worker_guarded = false;
        fesetenv(&worker_environment);
    }
}
