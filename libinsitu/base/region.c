/* Floating-point traps and flushing to zero are settings of a thread, and a worker may have the settings of the
 * simulation (session_guard.h). A worker therefore gets the default settings at the start of each region, and its own
 * settings back at the end; each change takes about 50 ns. A thread that OpenMP starts for a region begins with the
 * settings of the thread that opened the region.
 *
 * If all cores are busy when a region begins, the scheduler may wake a worker on the core of the thread that opened
 * the region, and leave it there for tens of milliseconds. For the scheduler, two runnable threads on one core and
 * one thread of another process on the other core are a balanced load. Then all threads together are no faster than
 * one. A worker on that core therefore moves to another core on which it may run, and immediately afterwards allows
 * the scheduler to move it again. */
#define _GNU_SOURCE 1
#include "region.h"

#include <fenv.h>
#include <omp.h>
#include <sched.h>
#include <stdatomic.h>
#include <stdbool.h>

static _Thread_local fenv_t environment;
/* The core of the thread that opened the most recent region. If another session opened that region, workers may be
 * moved needlessly, which does no harm. */
static atomic_int first_core = -1;
static atomic_llong regions;

static void migrate_off_core(int core)
{
    cpu_set_t own, others;
    if (core < 0 || core >= CPU_SETSIZE || sched_getaffinity(0, sizeof own, &own)) return;
    others = own;
    CPU_CLR((size_t)core, &others);
    if (CPU_COUNT(&others) == 0 || sched_setaffinity(0, sizeof others, &others)) return;
    sched_setaffinity(0, sizeof own, &own);
}

void region_enter(void)
{
    const int core = sched_getcpu();
    if (omp_get_num_threads() == 1) return;
    if (omp_get_thread_num() == 0) {
        atomic_store_explicit(&first_core, core, memory_order_relaxed);
        atomic_fetch_add_explicit(&regions, 1, memory_order_relaxed);
        return;
    }
    fegetenv(&environment);
    fesetenv(FE_DFL_ENV);
    if (core == atomic_load_explicit(&first_core, memory_order_relaxed)) migrate_off_core(core);
}

void region_leave(void)
{
    if (omp_get_thread_num() > 0) fesetenv(&environment);
}

int64_t region_count(void)
{
    return (int64_t)atomic_load(&regions);
}
