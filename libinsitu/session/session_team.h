/* The threads of a step: how many are wanted, how many can be started, and whether their stacks suffice. */
#ifndef SESSION_TEAM_H
#define SESSION_TEAM_H

#include "session.h"

/* Bytes of stack that a step is given at least, below insitu_step() on the calling thread and below OpenMP on the
 * others. What it takes is less than three quarters of these (test_session_stack.c measures it): of the calling thread
 * 119 kB with plain and SSE4.2 kernels and 142 with AVX2, of a worker 99 and 122; AVX-512's frames are a quarter
 * larger. */
enum { SESSION_WORKER_STACK = 256 << 10, SESSION_CALLER_STACK = 320 << 10 };

/* Does this rank want more threads than it is known to be able to start? Local. */
bool session_team_grows(const insitu_session *session);

/* Find out how many threads can be started. Where any rank's team grows, before its first parallel region. Collective:
 * the ranks of a node share its limits, and try at the same time. */
insitu_status session_team_probe(insitu_session *session, base_error *error);

/* The threads of this step; tells in the report where they are fewer than were asked for. Local. */
int session_team_threads(insitu_session *session);

/* An error where a stack is too small. After session_team_probe(), in the first parallel region of session->threads.
 * Collective. */
insitu_status session_team_check(insitu_session *session, base_error *error);

#endif
