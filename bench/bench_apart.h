/* A peer in a process of its own, that may crash or never end. */
#ifndef BENCH_APART_H
#define BENCH_APART_H

#include "bench_vtk.h"

/* bench_vtk_draw() in a child, stopped after so many seconds. "ok", or what became of it. The calling process has no X
 * connection and no threads of VTK's. */
const char *bench_apart_draw(const bench_vtk_request *request, int seconds, bench_vtk_result *result, float *rgba);

#endif
