/* Computes the constants of a frame from a job. */
#ifndef RENDER_RENDER_PREPARE_H
#define RENDER_RENDER_PREPARE_H

#include "error.h"
#include "insitu/status.h"
#include "kernel_types.h"
#include "render.h"

/* Checks the job and computes the constants of its frame, which are stored in *frame. If this succeeds, *frame must be
 * freed with render_free_prepared_frame(). */
insitu_status render_prepare(const render_job *job, kernel_frame *frame, base_error *error);

/* Fills *frame as render_prepare() does, but without the job's volumes. *surfaces becomes a copy of the job without
 * volumes; it must exist as long as the frame, which refers to it. */
insitu_status render_prepare_surfaces(const render_job *job, render_job *surfaces, kernel_frame *frame,
                                      base_error *error);

void render_free_prepared_frame(kernel_frame *frame);

/* Computes the minimum and maximum of the field of surface layer number `surface` over this rank's parts; range[0] >
 * range[1] if no part has the field. */
void render_surface_range(const render_job *job, int surface, double range[2]);

#endif
