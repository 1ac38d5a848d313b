/* Selects the kernels of the instruction set in use. */
#ifndef RENDER_RENDER_KERNELS_H
#define RENDER_RENDER_KERNELS_H

#include "kernel_types.h"

/* Returns the kernels for the instruction set that the calling thread may use. The thread that draws a frame calls this
 * once for the whole frame. */
const kernel_table *render_kernels(void);

#endif
