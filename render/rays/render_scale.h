/* Positions of values in a transfer function. */
#ifndef RENDER_RENDER_SCALE_H
#define RENDER_RENDER_SCALE_H

#include "render.h"

/* Computes the begin of the transfer function's domain, and 1 / its width (kernel_types.h). */
void render_transfer_domain(const render_transfer *t, double *low, double *inverse_width);
/* Return the position in the domain of a value, and of entry i of the colour table. */
double render_domain_of(const render_transfer *t, double value);
double render_entry_place(const render_transfer *t, int i);

#endif
