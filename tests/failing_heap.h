/* A heap that runs out on demand, for all libraries of the process: malloc() and its kin in the test program take the
 * place of the C library's, and operator new calls them.
 *
 * Allocations within MPI, by libgomp and by the loader are neither counted nor failed, for these would end the process.
 * Only allocations of the thread that armed the heap are counted and failed. */
#ifndef TEST_FAILING_HEAP_H
#define TEST_FAILING_HEAP_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Makes the n-th allocation of this thread from now on fail (1: the next one), and all after it if is_for_good. */
void heap_start_failing(int64_t n, bool is_for_good);

/* Allocations work again. Returns how many were asked for since heap_start_failing(). */
int64_t heap_stop_failing(void);

/* Between these the thread's allocations are neither counted nor failed. They may stand in each other. */
void heap_pause(void);
void heap_resume(void);

/* Tells whether the program has this heap: sanitizers bring their own. */
bool heap_can_fail(void);

#ifdef __cplusplus
}
#endif

#endif
