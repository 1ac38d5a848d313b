/* The kernels of the instruction set in use. */
#ifndef RENDER_RENDER_KERNELS_H
#define RENDER_RENDER_KERNELS_H

#include "kernel_types.h"

/* The calling thread's choice: the thread that draws a frame asks once for all of it. */
const kernel_table *render_kernels(void);

/* Readies a thread's memory at its first use, by that thread, which so touches it first. The kernels are those of the
 * thread that opened the region. False, and thread->out_of_memory, where there is none. */
bool render_thread_begin(const kernel_table *kernels, kernel_thread *thread);

#endif
