/* Computes the constants of a frame from a job, and sets up the memory of the threads that draw it. */
#ifndef RENDER_RENDER_PREPARE_H
#define RENDER_RENDER_PREPARE_H

#include "error.h"
#include "insitu/status.h"
#include "kernel_types.h"
#include "render.h"

/* Checks the job and fills *frame, which must be freed with render_unprepare() if this succeeds. */
insitu_status render_prepare(const render_job *job, kernel_frame *frame, base_error *error);

/* Fills *frame as render_prepare() does, but without the job's volumes. *surfaces becomes a copy of the job without
 * volumes; it must exist as long as the frame, which refers to it. */
insitu_status render_prepare_surfaces(const render_job *job, render_job *surfaces, kernel_frame *frame,
                                      base_error *error);

void render_unprepare(kernel_frame *frame);

/* Computes the minimum and maximum of the field of surface layer number `surface` over this rank's parts; range[0] >
 * range[1] if no part has the field. */
void render_surface_range(const render_job *job, int surface, double range[2]);

/* Allocates and sets up the thread's memory, unless a former call has done so; at first all members of *thread must be
 * zero. It must be called by the thread itself, so that the memory is on the thread's NUMA node. kernels: the result of
 * render_kernels() in the thread that opened the parallel region. Returns false, with thread->out_of_memory set, if
 * there is no memory. */
bool render_thread_begin(const kernel_frame *frame, const kernel_table *kernels, kernel_thread *thread);

/* Frees everything that the thread has. */
void render_thread_end(kernel_thread *thread);

#endif
