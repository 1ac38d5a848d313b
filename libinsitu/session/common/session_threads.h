/* The threads of a step: how many are wanted, how many can be started, and whether their stacks suffice. */
#ifndef SESSION_THREADS_H
#define SESSION_THREADS_H

#include <pthread.h>
#include <stdbool.h>
#include <stdint.h>

#include "session_guard.h"
#include "session_report.h"
#include "session_team.h"

/* Bytes of stack that a step must have, below insitu_step() on the calling thread and below OpenMP on the others. It
 * uses less than three quarters of them (test_session_stack.c measures that): 119 kB of the calling thread's with plain
 * and SSE4.2 kernels and 142 with AVX2, 99 and 122 of a worker's; AVX-512's frames are a quarter larger. */
enum { SESSION_WORKER_STACK = 256 << 10, SESSION_CALLER_STACK = 320 << 10 };

/* The number of threads that are known to be there, or to be possible, for the thread that called last. */
typedef struct session_threads {
    int count; /* 0: not yet tried */
    pthread_t caller;
    int64_t ended; /* threads of any team that had ended by then */
} session_threads;

/* Tells whether this rank wants more threads than it is known to be able to start. asked is the scene's number, 0 where
 * it names none: then it wants its share of the cores, or fewer if OpenMP would take fewer. Local. */
bool session_lacks_threads(const session_threads *threads, int asked, int cores);

/* Find out how many threads can be started, and set team->threads. The report says so if there are fewer than asked
 * for. If is_new (some rank lacks threads, or the scene was edited), threads are tried, started and their stacks
 * measured; too small ones are an error. Collective. */
insitu_status session_begin_threads(session_threads *threads, session_team *team, int asked, bool is_new,
                                    const session_guard *guard, session_report *report, base_error *error);

#endif
