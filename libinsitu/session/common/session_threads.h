/* The threads of a step. Determines how many are requested, how many can be started, and whether their stacks are large
 * enough. A trial starts the requested number of threads to find this out. */
#ifndef SESSION_THREADS_H
#define SESSION_THREADS_H

#include <pthread.h>
#include <stdbool.h>
#include <stdint.h>

#include "session_guard.h"
#include "session_report.h"
#include "session_team.h"

/* Bytes of stack that a step must have free, below the frame of insitu_step() on the calling thread, and below the
 * frames of OpenMP on all other threads. A step uses less than three quarters of them (measured by
 * test_session_stack.c): on the calling thread 119 kB with plain and SSE4.2 kernels and 142 kB with AVX2, on a worker
 * 99 and 122 kB. The stack frames of AVX-512 kernels are a quarter larger. */
enum { SESSION_WORKER_STACK = 256 << 10, SESSION_CALLER_STACK = 320 << 10 };

/* The threads available to the caller's thread that most recently called insitu_step(). They exist already, or could be
 * started in a trial. */
typedef struct session_threads {
    int count; /* number of threads, including the caller's thread; 0: not tried yet */
    pthread_t caller;
    int64_t ended_count; /* number of OpenMP workers of this process that had ended when `count` was determined */
} session_threads;

/* Returns whether this rank must make a new trial: the rank requests more threads than are available, insitu_step() is
 * called by another thread than before, or threads have ended. scene_threads is the number of threads that the scene
 * sets. If scene_threads is 0, the rank requests its share of the cores (cores) or OpenMP's maximum, whichever is
 * lower. Local. */
bool session_needs_thread_trial(const session_threads *threads, int scene_threads, int cores);

/* Determines how many threads can be started, and sets team->threads. Warns if there are fewer than requested. If
 * is_new is set (because some rank lacks threads, or the scene was edited), threads are started and their stacks
 * measured; a stack that is too small is an error. Collective. */
insitu_status session_prepare_threads(session_threads *threads, session_team *team, int scene_threads, bool is_new,
                                      const session_guard *guard, session_report *report, base_error *error);

#endif
