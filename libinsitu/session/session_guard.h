/* The floating-point environment while the library works. */
#ifndef SESSION_SESSION_GUARD_H
#define SESSION_SESSION_GUARD_H

#include <fenv.h>

enum { SESSION_MAX_THREADS = 1024 };

/* What each thread of the step's teams had. */
typedef struct session_guard {
    fenv_t environments[SESSION_MAX_THREADS];
    int threads;
} session_guard;

/* Give this thread and the others of teams of this size (at most SESSION_MAX_THREADS) the default environment, and
 * keep theirs. */
void session_guard_begin(session_guard *guard, int threads);

/* Give it back, exception flags too. */
void session_guard_end(session_guard *guard);

#endif
