/* The kernels' integral of a segment, compiled on floats and on doubles. */
#ifndef INTEGRAL_DOUBLE_H
#define INTEGRAL_DOUBLE_H

#include "render.h"

/* Computes rgb and transmittance of a segment of the given length in unit distances; values are in the transfer
 * function's domain. */
void integrate_in_double(const render_transfer *t, double length, double v_in, double v_out, double out[4]);
void integrate_in_float(const render_transfer *t, double length, double v_in, double v_out, double out[4]);

/* Computes, for each range of values, how much an error of the field can change the light: the variation of the light,
 * its maximum, and the maxima of the extinction and of its slope (kernel_light_variation). */
void integral_variations(const render_transfer *t, int count, const double (*ranges)[2], double (*out)[4]);

#endif
