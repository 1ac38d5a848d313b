/* Runs a peer in a process of its own, because the peer may crash or never end. */
#ifndef BENCH_APART_H
#define BENCH_APART_H

#include "bench_vtk.h"

/* Calls bench_vtk_draw() in a child process. The child is stopped after the given number of seconds. Returns "ok", or a
 * text that states how the child failed. The calling process gets neither an X connection nor VTK's threads. */
const char *bench_draw_in_child_process(const bench_vtk_request *request, int seconds, bench_vtk_result *result,
                                        float *rgba);

#endif
