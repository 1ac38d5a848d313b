/* The trees of kernel_occluders.h, built for a frame. */
#ifndef RENDER_RENDER_OCCLUDERS_H
#define RENDER_RENDER_OCCLUDERS_H

#include "error.h"
#include "insitu/status.h"
#include "kernel_occluders.h"
#include "kernel_types.h"

/* Finds the cells that the frame's opaque surfaces cross, for kernels of this many lanes. The caller frees the result,
 * after an error too. Parallel. */
insitu_status occluders_build(const kernel_frame *frame, int width, int threads, kernel_occluders *out,
                              base_error *error);
void occluders_free(kernel_occluders *occluders);

#endif
