/* Simulations trap floating-point exceptions to find their own faults (gfortran's -ffpe-trap, feenableexcept()), or
 * flush small numbers to zero (icc's -ftz, gcc's -ffast-math). Under the first, a box test of ours that divides by
 * zero on purpose would kill the run; under the second, pictures would change. Both are settings of a thread, which
 * OpenMP's workers inherit from whoever first needed them (GNU's), or at the begin of every parallel region from the
 * thread that opens it (LLVM's, which also undoes at its end what the region changed on any thread). So a step works
 * under the default environment, on every thread, and leaves each as it was; the calling thread is set outside of
 * parallel regions. */
#include "session_guard.h"

#include <omp.h>

void session_guard_begin(session_guard *guard, int threads)
{
    guard->threads = threads;
    fegetenv(&guard->environments[0]);
    fesetenv(FE_DFL_ENV);
#pragma omp parallel num_threads(threads)
    if (omp_get_thread_num() > 0) {
        fegetenv(&guard->environments[omp_get_thread_num()]);
        fesetenv(FE_DFL_ENV);
    }
}

void session_guard_end(session_guard *guard)
{
#pragma omp parallel num_threads(guard->threads)
    if (omp_get_thread_num() > 0) fesetenv(&guard->environments[omp_get_thread_num()]);
    fesetenv(&guard->environments[0]);
}
