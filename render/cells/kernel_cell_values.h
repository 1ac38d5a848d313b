/* Converts a cell's vertex values to the form that a layer needs: for an isosurface, the values minus the isovalue; for
 * a volume, the values in the domain of its transfer function. */
#ifndef RENDER_KERNEL_CELL_VALUES_H
#define RENDER_KERNEL_CELL_VALUES_H

#include <math.h>
#include <string.h>

#include "grid.h"
#include "kernel_cell.h"
#include "kernel_visible_values.h"
#include "kernel_types.h"
#include "simd.h"

/* Returns whether at least one value is below the isovalue and at least one is not. */
SIMD_INLINE bool kernel_values_straddle(const double *values, int count, double isovalue)
{
    bool below = false, above = false;
    for (int i = 0; i < count; i++) {
        below = below || values[i] < isovalue;
        above = above || values[i] >= isovalue;
    }
    return below && above;
}

/* Returns a power of two by which `largest` (>= 0) is multiplied to bring it near 1. The exponent of the result is
 * minus that of `largest`, limited so that the result is a normal number. */
SIMD_INLINE double kernel_compute_normalizing_power(double largest)
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

/* Stores the values minus the isovalue, multiplied by a power of two that brings the largest magnitude near 1. Returns
 * that power of two. */
SIMD_INLINE double kernel_values_subtract_isovalue(const double *values, int count, double isovalue, float *out)
{
    double largest = 0;
    for (int i = 0; i < count; i++) {
        const double size = fabs(values[i] - isovalue);
        largest = size > largest ? size : largest;
    }
    const double scale = kernel_compute_normalizing_power(largest);
    for (int i = 0; i < count; i++) out[i] = (float)((values[i] - isovalue) * scale);
    return scale;
}

SIMD_INLINE void kernel_cell_subtract_isovalue(kernel_cell *c, double isovalue)
{
    kernel_values_subtract_isovalue(c->values, c->count, isovalue, c->f);
}

/* Reads the colour field at a cell's vertices and converts it to the domain of its transfer function. Returns the
 * average of the converted values. */
SIMD_INLINE double kernel_read_colour_values(const kernel_surface *s, int part, uint32_t cell, const int64_t *vertices,
                                             int count, float *out)
{
    const grid_field *field = &s->layer->colour_field.fields[part];
    double mean = 0;
    for (int i = 0; i < count; i++) {
        const double v = grid_field_value(field, field->is_cell_centred ? cell : vertices[i]);
        const double place = (v - s->colour.low) * s->colour.inverse_width;
        out[i] = (float)place;
        mean += place / count;
    }
    return mean;
}

/* Returns v clamped to the interval [-limit, limit] and rounded to float32. */
SIMD_INLINE float kernel_clamp(double v, double limit)
{
    return (float)(v < -limit ? -limit : v > limit ? limit : v);
}

/* Returns whether the range from the smallest to the largest value contains a value at which the volume is visible. */
SIMD_INLINE bool kernel_values_are_visible(const double *values, int count, const kernel_transfer *t)
{
    double low = values[0], high = low;
    for (int i = 1; i < count; i++) {
        low = values[i] < low ? values[i] : low;
        high = values[i] > high ? values[i] : high;
    }
    return kernel_visible_values_overlap(&t->visible_values, kernel_clamp(low, 3e38), kernel_clamp(high, 3e38));
}

SIMD_INLINE bool kernel_cell_is_visible(const kernel_cell *c, const kernel_transfer *t)
{
    return kernel_values_are_visible(c->values, c->count, t);
}

/* Sets c->f to the values in the transfer function's domain, clamped to +-1e18 so that interpolation cannot overflow,
 * and c->is_constant. */
SIMD_INLINE void kernel_cell_map_values_to_domain(kernel_cell *c, const kernel_transfer *t)
{
    c->is_constant = true;
    for (int i = 0; i < c->count; i++) {
        c->f[i] = kernel_clamp((c->values[i] - t->low) * t->inverse_width, 1e18);
        c->is_constant = c->is_constant && c->values[i] == c->values[0];
    }
}

#endif
