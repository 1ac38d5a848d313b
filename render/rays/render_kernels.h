/* The kernels of the instruction set in use. */
#ifndef RENDER_RENDER_KERNELS_H
#define RENDER_RENDER_KERNELS_H

#include "kernel_types.h"

/* Of the calling thread: for the whole of a frame they are asked for on the one that draws it. */
const kernel_table *render_kernels(void);

#endif
