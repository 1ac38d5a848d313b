/* The kernels' integral of light along a segment, compiled for float (integral_floats.c) and for double
 * (integral_doubles.c). */
#ifndef INTEGRAL_DOUBLE_H
#define INTEGRAL_DOUBLE_H

#include "render.h"

/* Compute the colour (rgb) and the transmittance of a segment: the kernels integrate in double or in float. length is
 * in unit distances of the transfer function, and the values at both ends are in the transfer function's domain. */
void integrate_in_double(const render_transfer *t, double length, double v_in, double v_out, double out[4]);
void integrate_in_float(const render_transfer *t, double length, double v_in, double v_out, double out[4]);

/* For each range of values, computes the four bounds of kernel_look_up_light_error_bounds(): variation, cost,
 * extinction, steepness. They bound how much an error of the field can change the light. */
void integral_compute_variations(const render_transfer *t, int count, const double (*ranges)[2], double (*out)[4]);

#endif
