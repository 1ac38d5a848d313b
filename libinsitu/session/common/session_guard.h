/* Saves and restores settings of the caller with which the library cannot work, and which it must not change
 * permanently: the floating-point environment, and OpenMP's permission to vary the size of teams (OMP_DYNAMIC). */
#ifndef SESSION_GUARD_H
#define SESSION_GUARD_H

#include <fenv.h>

typedef struct session_guard {
    fenv_t caller_environment; /* floating-point environment of the caller, which is restored at the end of the call */
    int is_dynamic;            /* result of omp_get_dynamic() at the start of the call */
} session_guard;

/* Saves the calling thread's settings, then sets the default floating-point environment and fixed team sizes. */
void session_guard_save_settings(session_guard *guard);

/* Restores the saved settings, including exception flags. */
void session_guard_restore_settings(const session_guard *guard);

/* Between session_guard_set_caller_fenv() and session_guard_set_default_fenv(), the calling thread has the caller's
 * floating-point environment. OpenMP starts threads in a parallel region between these calls, so that the new threads
 * inherit the caller's environment, as if the caller had started them. Both functions must be called between
 * session_guard_save_settings() and session_guard_restore_settings(). */
void session_guard_set_caller_fenv(const session_guard *guard);
void session_guard_set_default_fenv(void);

#endif
