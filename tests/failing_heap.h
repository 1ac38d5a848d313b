/* A heap that runs out on demand, for what all libraries of the process ask of it: malloc() and its kin stand in the
 * test program, in front of the C library's, and operator new comes through them.
 *
 * What is asked within MPI, by libgomp, and by the loader is neither counted nor failed: they end the process, and
 * nobody above them can help it. Counts and fails what the thread asks that armed it. */
#ifndef TEST_FAILING_HEAP_H
#define TEST_FAILING_HEAP_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* From now on the n-th allocation of this thread fails (1: the next one), and all after it where it is for good. */
void heap_arm(int64_t n, bool is_for_good);

/* Allocations work again. Returns how many were asked for since heap_arm(). */
int64_t heap_disarm(void);

/* Between these the thread's allocations are neither counted nor failed. They may stand in each other. */
void heap_pause(void);
void heap_resume(void);

/* Whether the program has this heap: sanitizers bring their own. */
bool heap_can_fail(void);

#ifdef __cplusplus
}
#endif

#endif
