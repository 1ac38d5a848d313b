/* A heap whose allocations fail on demand, in all libraries of the process. malloc() and the related functions of the
 * test program replace those of the C library, and operator new calls them. Only allocations of the thread that armed
 * the heap count and fail. Allocations by MPI, libgomp and the loader neither count nor fail, because such a failure
 * would end the process. */
#ifndef TEST_FAILING_HEAP_H
#define TEST_FAILING_HEAP_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Makes this thread's n-th allocation from now on fail (1: the next one). If is_for_good is set, all later ones fail
 * too. */
void heap_start_failing(int64_t n, bool is_for_good);

/* Ends the failures. Returns the number of allocations requested since heap_start_failing(). */
int64_t heap_stop_failing(void);

/* Between heap_pause() and heap_resume(), allocations of the calling thread neither count nor fail. Pairs of them may
 * be nested. */
void heap_pause(void);
void heap_resume(void);

/* Returns whether the program uses this heap: programs with sanitizers use the sanitizer's heap. */
bool heap_can_fail(void);

#ifdef __cplusplus
}
#endif

#endif
