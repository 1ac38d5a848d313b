/* Crossed cells kept from one picture to the next (render.h): a frame that has fewer cells to look at, and these side
 * by side, neither goes down trees nor gathers vertices from all over the mesh. */
#ifndef RENDER_RENDER_ACTIVE_CELLS_H
#define RENDER_RENDER_ACTIVE_CELLS_H

#include "kernel_types.h"

/* Sets frame->active to the job's active cells, after adding those of this frame that may be kept. thread_of has a
 * state for each thread. Without memory nothing is kept. */
void render_active_cells_begin(kernel_frame *frame, kernel_thread *thread_of, int threads);
void render_active_cells_end(kernel_frame *frame);

#endif
