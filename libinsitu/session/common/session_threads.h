/* The threads of a step: how many are wanted, how many can be started, and whether their stacks suffice. */
#ifndef SESSION_THREADS_H
#define SESSION_THREADS_H

#include <pthread.h>
#include <stdbool.h>
#include <stdint.h>

#include "session_guard.h"
#include "session_report.h"
#include "session_team.h"

/* Bytes of stack that a step is given at least, below insitu_step() on the calling thread and below OpenMP on the
 * others. What it takes is less than three quarters of these (test_session_stack.c measures it): of the calling thread
 * 119 kB with plain and SSE4.2 kernels and 142 with AVX2, of a worker 99 and 122; AVX-512's frames are a quarter
 * larger. */
enum { SESSION_WORKER_STACK = 256 << 10, SESSION_CALLER_STACK = 320 << 10 };

/* How many threads are known to be there, or to be possible, for the thread that called last. */
typedef struct session_threads {
    int count; /* 0: not yet tried */
    pthread_t caller;
    int64_t ended; /* threads of any team that had ended by then */
} session_threads;

/* Does this rank want more threads than it is known to be able to start? asked: by the scene, 0 where it leaves that to
 * us. Local. */
bool session_lacks_threads(const session_threads *threads, int asked, int node_ranks);

/* Find out how many threads can be started, set team->threads, and give the threads the environment of the library
 * until session_guard_end_team(); tells in the report where they are fewer than were asked for. is_new: some rank lacks
 * threads, or the scene was edited; then threads are tried and stacks are measured, and too small ones are an error.
 * Collective. */
insitu_status session_begin_threads(session_threads *threads, session_team *team, int asked, bool is_new,
                                    const session_guard *guard, session_report *report, base_error *error);

#endif
