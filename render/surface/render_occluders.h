/* Builds, for a frame, the trees of the cells that may block rays from hits (kernel_occluders.h). */
#ifndef RENDER_RENDER_OCCLUDERS_H
#define RENDER_RENDER_OCCLUDERS_H

#include "error.h"
#include "insitu/status.h"
#include "kernel_occluders.h"
#include "kernel_types.h"

/* Collects the cells that the frame's opaque surfaces cross, and builds their trees for kernels with `width` lanes. The
 * caller must free the result with occluders_free(), even after an error. Parallel. */
insitu_status occluders_build(const kernel_frame *frame, int width, int threads, kernel_occluders *out,
                              base_error *error);
void occluders_free(kernel_occluders *occluders);

#endif
