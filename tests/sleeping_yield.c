/* Replaces sched_yield() for tests that run more ranks than cores: a rank that waits sleeps while other ranks use the
 * cores. A rank that waits for a message calls sched_yield() in a loop. Linux's EEVDF scheduler (since 6.6) schedules
 * such a rank again only after the time slices of all busy processes, milliseconds after its message arrived. With two
 * busy processes on the machine, a test of many steps on 3 ranks took 115 to 155 s; it takes 16 to 22 s if waiting
 * ranks sleep.
 *
 * On idle cores sched_yield() returns at once, and sleeping would slow tests down by a third. Therefore each thread
 * measures the duration of its calls of sched_yield(): after a slow call, it sleeps in the next calls, and then
 * measures again. MPICH on UCX never yields but calls ucp_worker_progress() in its loop; a call of
 * ucp_worker_progress() that moves no message yields here. */
#define _GNU_SOURCE 1
#include <dlfcn.h>
#include <sched.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

enum { SLEEP_NS = 20000, SLACK_NS = 1000, SLOW_NS = 100000, SLEEPS = 256 };

static long long nanoseconds(void)
{
    struct timespec time;
    clock_gettime(CLOCK_MONOTONIC, &time);
    return time.tv_sec * 1000000000LL + time.tv_nsec;
}

__attribute__((visibility("default"))) int sched_yield(void)
{
    static _Thread_local int sleeps;
    if (sleeps) {
        sleeps--;
        const struct timespec time = {0, SLEEP_NS};
        return nanosleep(&time, NULL);
    }
    const long long start = nanoseconds();
    const int status = (int)syscall(SYS_sched_yield);
    if (nanoseconds() - start > SLOW_NS) {
        prctl(PR_SET_TIMERSLACK, (unsigned long)SLACK_NS);
        sleeps = SLEEPS;
    }
    return status;
}

__attribute__((visibility("default"))) unsigned ucp_worker_progress(void *worker)
{
    static unsigned (*progress)(void *worker);
    if (!progress) {
        *(void **)&progress = dlsym(RTLD_NEXT, "ucp_worker_progress");
    }
    const unsigned moved = progress(worker);
    if (!moved) {
        sched_yield();
    }
    return moved;
}
