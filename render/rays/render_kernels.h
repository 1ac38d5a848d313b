/* Selects the kernels of the instruction set in use. */
#ifndef RENDER_RENDER_KERNELS_H
#define RENDER_RENDER_KERNELS_H

#include "kernel_types.h"

/* Returns the kernels for the instruction set that the calling thread may use. The thread that draws a frame calls this
 * once for the whole frame. */
const kernel_table *render_kernels(void);

/* Allocates and sets up a thread's memory at its first use. It is called by that thread, so that the thread touches the
 * memory first. kernels: those of the thread that opened the parallel region. Returns false, with thread->out_of_memory
 * set, if there is no memory. */
bool render_thread_begin(const kernel_table *kernels, kernel_thread *thread);

#endif
