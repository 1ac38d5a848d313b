/* The kernels of the instruction set in use, chosen once a process (render_isa() in render.h). */
#ifndef RENDER_RENDER_ISA_H
#define RENDER_RENDER_ISA_H

#include "kernel_types.h"

const kernel_table *render_kernels(void);

#endif
