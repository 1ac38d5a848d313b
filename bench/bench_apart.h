/* Runs a peer in a process of its own, for it may crash or never end. */
#ifndef BENCH_APART_H
#define BENCH_APART_H

#include "bench_vtk.h"

/* Calls bench_vtk_draw() in a child, which is stopped after so many seconds. Returns "ok", or what became of it. The
 * calling process gets no X connection and no VTK threads. */
const char *bench_unindexed_draw(const bench_vtk_request *request, int seconds, bench_vtk_result *result, float *rgba);

#endif
