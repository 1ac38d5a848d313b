/* What every thread does at the begin and at the end of a parallel region. A region is written as
 *
 *     #pragma omp parallel num_threads(threads)
 *         {
 *             region_enter();
 *     #pragma omp for schedule(dynamic, REGION_ITEMS) nowait
 *             for (...) ...
 *             region_leave();
 *         }
 *
 * with reductions of floating-point numbers on the loop, so that they end before region_leave(). Regions are dear where
 * another process uses a core: at each one's end, and at each barrier, the team waits until the thread that has lost
 * its core has it back, some 4 ms. So there are few, none without work, and their loops are shared out dynamically. */
#ifndef BASE_REGION_H
#define BASE_REGION_H

#include <stdint.h>

/* Items (vertices, cells, pixels) that a thread takes at a time where each is little work: some 10 µs. */
enum { REGION_ITEMS = 8192 };

/* Gives a worker the default floating-point environment, and moves it off the core of the region's first thread. */
void region_enter(void);

/* Gives a worker its own environment back. */
void region_leave(void);

/* The number of regions of this process so far that had more than one thread. */
int64_t region_count(void);

#endif
