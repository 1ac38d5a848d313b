/* The kernels of the instruction set in use. */
#ifndef RENDER_RENDER_KERNELS_H
#define RENDER_RENDER_KERNELS_H

#include "kernel_types.h"

/* The calling thread's choice: the thread that draws a frame asks once for all of it. */
const kernel_table *render_kernels(void);

#endif
