/* sched_yield() for the ranks of tests, which are more than the cores: after a few calls that yield, each sleeps.
 *
 * A rank that waits for a message calls sched_yield() in a loop. Linux's EEVDF scheduler (since 6.6) lets such a rank
 * run again only after the slices of all busy processes, milliseconds after its message arrived: beside two busy
 * processes a test of many steps on 3 ranks took 115 to 155 s, and takes 16 to 22 s if its ranks sleep. */
#define _GNU_SOURCE 1
#include <sched.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

__attribute__((visibility("default"))) int sched_yield(void)
{
    enum { FIRST_CALLS = 4, SLEEP_NS = 20000, SLACK_NS = 1000 };
    static _Thread_local int calls;
    if (calls < FIRST_CALLS) {
        calls++;
        return (int)syscall(SYS_sched_yield);
    }
    if (calls == FIRST_CALLS) {
        calls++;
        prctl(PR_SET_TIMERSLACK, (unsigned long)SLACK_NS);
    }
    const struct timespec time = {0, SLEEP_NS};
    return nanosleep(&time, NULL);
}
