/* Settings of the caller that the library must neither work under nor change: the floating-point
 * environment, and OpenMP's leave to give teams of any size (OMP_DYNAMIC). */
#ifndef SESSION_GUARD_H
#define SESSION_GUARD_H

#include <fenv.h>

typedef struct session_guard {
    fenv_t caller;
    int is_dynamic;
} session_guard;

/* Give the calling thread the default environment and teams of the size asked for, and keep what it had. */
void session_guard_begin(session_guard *guard);

/* Give it back, exception flags too. */
void session_guard_end(const session_guard *guard);

/* Gives the calling thread its environment back for the region that OpenMP starts threads in: they begin under the
 * caller's own environment, as if the caller had needed them first. Call both between the two calls above. */
void session_guard_lend(const session_guard *guard);
void session_guard_return(void);

#endif
