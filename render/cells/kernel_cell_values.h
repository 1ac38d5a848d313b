/* A cell's values as layers need them: beside an isovalue, in the domain of a transfer function, as colours. */
#ifndef RENDER_KERNEL_CELL_VALUES_H
#define RENDER_KERNEL_CELL_VALUES_H

#include <math.h>
#include <string.h>

#include "grid.h"
#include "kernel_cell.h"
#include "kernel_interest.h"
#include "kernel_types.h"
#include "simd.h"

SIMD_INLINE bool kernel_cell_straddles(const kernel_cell *c, double value)
{
    bool below = false, above = false;
    for (int i = 0; i < c->count; i++) {
        below = below || c->values[i] < value;
        above = above || c->values[i] >= value;
    }
    return below && above;
}

/* Returns a power of two that scales `largest` to near 1. It is computed from the bits, by negating the exponent, which
 * is limited so that the result is a normal number. */
SIMD_INLINE double kernel_mirrored_power(double largest)
{
    uint64_t bits;
    memcpy(&bits, &largest, sizeof bits);
    const uint64_t exponent = bits >> 52;
    const uint64_t mirrored = exponent < 23 ? 2023 : exponent > 2023 ? 23 : 2046 - exponent;
    bits = mirrored << 52;
    double scale;
    memcpy(&scale, &bits, sizeof scale);
    return scale;
}

/* Sets f to the values minus the isovalue, times a power of two that scales the largest to near 1. */
SIMD_INLINE void kernel_cell_relative(kernel_cell *c, double value)
{
    double largest = 0;
    for (int i = 0; i < c->count; i++) {
        const double size = fabs(c->values[i] - value);
        largest = size > largest ? size : largest;
    }
    const double scale = kernel_mirrored_power(largest);
    for (int i = 0; i < c->count; i++) c->f[i] = (float)((c->values[i] - value) * scale);
}

/* Sets g to the colour field in the domain of its transfer function. Cells keep the field's order of vertices. */
SIMD_INLINE void kernel_cell_colours(kernel_cell *c, const kernel_surface *s, int part)
{
    const grid_field *field = &s->layer->colour_field.fields[part];
    for (int i = 0; i < c->count; i++) {
        const double v = grid_field_value(field, field->is_cell_centred ? c->index : c->vertices[i]);
        c->g[i] = (float)((v - s->colour.low) * s->colour.inverse_width);
    }
}

/* Returns v clamped to the interval [-limit, limit] and rounded to float32. */
SIMD_INLINE float kernel_hold(double v, double limit)
{
    return (float)(v < -limit ? -limit : v > limit ? limit : v);
}

/* Returns whether some value between the smallest and the largest of these is visible with the transfer function. */
SIMD_INLINE bool kernel_values_show(const double *values, int count, const kernel_transfer *t)
{
    double low = values[0], high = low;
    for (int i = 1; i < count; i++) {
        low = values[i] < low ? values[i] : low;
        high = values[i] > high ? values[i] : high;
    }
    return kernel_interest_meets(&t->interest, kernel_hold(low, 3e38), kernel_hold(high, 3e38));
}

SIMD_INLINE bool kernel_cell_shows(const kernel_cell *c, const kernel_transfer *t)
{
    return kernel_values_show(c->values, c->count, t);
}

/* Sets f to the values in the transfer function's domain, clamped to +-1e18 so that interpolation cannot overflow. */
SIMD_INLINE void kernel_cell_domain(kernel_cell *c, const kernel_transfer *t)
{
    c->is_constant = true;
    for (int i = 0; i < c->count; i++) {
        c->f[i] = kernel_hold((c->values[i] - t->low) * t->inverse_width, 1e18);
        c->is_constant = c->is_constant && c->values[i] == c->values[0];
    }
}

#endif
