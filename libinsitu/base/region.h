/* Functions that every thread calls at the start and at the end of a parallel region. A region is written as
 *
 *     #pragma omp parallel num_threads(threads)
 *         {
 *             region_enter();
 *     #pragma omp for schedule(dynamic, REGION_ITEMS) nowait
 *             for (...) ...
 *             region_leave();
 *         }
 *
 * Reductions of floating-point numbers are clauses of the loop and not of the region, so that they end before
 * region_leave() restores the settings of the thread. Regions are expensive if another process uses a core: at the end
 * of each region, and at each barrier, all threads wait about 4 ms until the thread that has lost its core gets it
 * back. The code therefore has few regions, none without work, and schedules their loops dynamically. */
#ifndef BASE_REGION_H
#define BASE_REGION_H

#include <stdint.h>

/* Number of items (vertices, cells, pixels) per chunk of a loop if an item takes little work. A chunk then takes about
 * 10 µs. */
enum { REGION_ITEMS = 8192 };

/* Sets a worker's floating-point environment to the default. Moves a worker that runs on the core of the region's first
 * thread to another core. */
void region_enter(void);

/* Restores a worker's own floating-point environment. */
void region_leave(void);

/* Returns the number of regions with more than one thread in this process so far. */
int64_t region_count(void);

#endif
