/* Settings of the caller under which the library must not work, and which it must not change: the floating-point
 * environment, and OpenMP's permission to vary the size of teams (OMP_DYNAMIC). */
#ifndef SESSION_GUARD_H
#define SESSION_GUARD_H

#include <fenv.h>

typedef struct session_guard {
    fenv_t caller;
    int is_dynamic;
} session_guard;

/* Sets the calling thread's default environment and fixed team sizes, and saves its own settings. */
void session_guard_begin(session_guard *guard);

/* Restores the saved settings, including exception flags. */
void session_guard_end(const session_guard *guard);

/* Restore the calling thread's environment for the parallel region in which OpenMP starts threads: these then begin
 * with the caller's own environment, as if the caller had started them. Both calls must be between the two calls
 * above. */
void session_guard_lend(const session_guard *guard);
void session_guard_return(void);

#endif
