/* Maps values of a field to the domain in which a transfer function is evaluated (kernel_transfer). */
#ifndef RENDER_RENDER_SCALE_H
#define RENDER_RENDER_SCALE_H

#include "render.h"

/* Computes the value at which the transfer function's domain begins, and 1 / the domain's width. */
void render_transfer_domain(const render_transfer *t, double *low, double *inverse_width);
/* render_domain_of() maps a value to the transfer function's domain. render_entry_position() returns the position in
 * the domain of the i-th entry of the colour table. */
double render_domain_of(const render_transfer *t, double value);
double render_entry_position(const render_transfer *t, int i);

#endif
