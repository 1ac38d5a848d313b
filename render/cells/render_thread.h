/* Sets up and frees the memory of a thread that draws a frame. */
#ifndef RENDER_RENDER_THREAD_H
#define RENDER_RENDER_THREAD_H

#include <stdbool.h>

#include "kernel_types.h"

/* Allocates and sets up the thread's memory, unless a former call has done so. Before the first call all members of
 * *thread must be zero. The thread itself must call this function, so that the memory is on the thread's NUMA node.
 * kernels: the result of render_kernels() in the thread that opened the parallel region. Returns false, with
 * thread->out_of_memory set, if there is no memory. */
bool render_thread_begin(const kernel_frame *frame, const kernel_table *kernels, kernel_thread *thread);

/* Frees everything that the thread has. */
void render_thread_end(kernel_thread *thread);

#endif
