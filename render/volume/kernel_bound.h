/* Bounds of a transfer function over a range of values, from its pieces: the ranges of values on which its opacity and
 * colour are linear (kernel_types.h). Extinctions are -ln(1 - opacity), per unit distance. */
#ifndef RENDER_KERNEL_BOUND_H
#define RENDER_KERNEL_BOUND_H

#include <math.h>

#include "kernel_types.h"

/* Upper limit of extinctions, per unit distance. Larger ones, up to infinity at an opacity of 1, are replaced by it. */
static const double kernel_most_extinction = 1e6;

static inline double kernel_extinction_of(double opacity)
{
    return opacity < 1 ? fmin(-log1p(-opacity), kernel_most_extinction) : kernel_most_extinction;
}

/* Returns the opacity at the value x in the piece p, between 0 and 1. */
static inline double kernel_piece_opacity(const kernel_real *p, double x)
{
    const double along = (x - (double)p[KERNEL_PIECE_LOW]) - (double)p[KERNEL_PIECE_LOW_REST];
    return fmin(fmax((double)p[KERNEL_PIECE_OPACITY] + along * (double)p[KERNEL_PIECE_SLOPE], 0), 1);
}

/* Computes the minimum (out[0]) and the maximum (out[1]) of the extinction's absolute slope between two values of a
 * piece, per unit of the transfer function's domain. */
static inline void kernel_bound_piece_extinction_slope(const kernel_real *p, double from, double to, double out[2])
{
    const double a0 = kernel_piece_opacity(p, from), a1 = kernel_piece_opacity(p, to), most = fmax(a0, a1);
    const double steepness = fabs((double)p[KERNEL_PIECE_SLOPE]);
    out[0] = steepness / fmax(1 - fmin(a0, a1), 1e-30);
    out[1] = steepness > 0 ? (most < 1 ? fmin(steepness / (1 - most), 1e30) : 1e30) : 0;
}

/* Widens the bounds *b so that they hold between two values of the piece p, too. */
static inline void kernel_bound_widen(kernel_bound *b, const kernel_real *p, double from, double to)
{
    const double a0 = kernel_piece_opacity(p, from), a1 = kernel_piece_opacity(p, to);
    double steepness[2];
    kernel_bound_piece_extinction_slope(p, from, to, steepness);
    b->extinction_low = fminf(b->extinction_low, (float)kernel_extinction_of(fmin(a0, a1)));
    b->extinction_high = fmaxf(b->extinction_high, (float)kernel_extinction_of(fmax(a0, a1)));
    b->extinction_slope = fmaxf(b->extinction_slope, (float)steepness[1]);
    for (int c = 0; c < 3; c++)
        b->colour_slope = fmaxf(b->colour_slope, fabsf((float)p[KERNEL_PIECE_COLOUR_SLOPE + c]));
}

#endif
