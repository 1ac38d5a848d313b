/* Makes the constants of a frame from a job. */
#ifndef RENDER_RENDER_PREPARE_H
#define RENDER_RENDER_PREPARE_H

#include "error.h"
#include "insitu/status.h"
#include "kernel_types.h"
#include "render.h"

/* Check the job and fill frame, which is to be freed with render_unprepare() where that succeeded. */
insitu_status render_prepare(const render_job *job, kernel_frame *frame, base_error *error);
void render_unprepare(kernel_frame *frame);

/* The ends of the surface's field on this rank's parts, low > high where it is on none. */
void render_surface_range(const render_job *job, int surface, double range[2]);

#endif
