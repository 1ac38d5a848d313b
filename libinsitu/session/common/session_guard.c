/* Simulations trap floating-point exceptions to find their own faults (gfortran's -ffpe-trap, feenableexcept()), or
 * flush small numbers to zero (icc's -ftz, gcc's -ffast-math). Traps would kill the run at a box test that divides by
 * zero on purpose, or at a scene's 1e999; flushing would change pictures. Both are settings of a thread. GNU's OpenMP
 * workers inherit them from the thread that first needed them; LLVM's from the thread that opens a parallel region, at
 * whose end changes on any thread are undone. So every call works under the default environment, a step on every
 * thread, and restores each thread's afterwards; the calling thread's is set outside of parallel regions. Each worker
 * keeps its own old settings, as OpenMP chooses the threads of a team. */
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
