#include "reference_base.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

void *reference_reallocate(void *block, size_t bytes)
{
    void *p = realloc(block, bytes ? bytes : 1);
    if (!p) {
        fprintf(stderr, "reference: out of memory\n");
        exit(1);
    }
    return p;
}

/* Maps a value to the scale of the transfer function (linear, log or symlog) by the scale's definition. */
static double map_to_scale(const render_transfer *t, double value)
{
    const double size = fabs(value) / t->threshold;
    if (t->scale == RENDER_LOG) return value > 0 ? log10(value) : -INFINITY;
    if (t->scale == RENDER_SYMLOG && size > 1) return (value < 0 ? -1 : 1) * (1 + log10(size) / log10(exp(1)));
    return t->scale == RENDER_SYMLOG ? value / t->threshold : value;
}

double reference_compute_opacity(const render_transfer *t, double value)
{
    const int last = t->opacity_count - 1;
    if (value < t->opacity_values[0]) return (double)t->opacities[0];
    for (int i = 0; i < last; i++) {
        const double low = t->opacity_values[i], high = t->opacity_values[i + 1];
        const double from = map_to_scale(t, low), to = map_to_scale(t, high);
        if (value < high)
            return (double)t->opacities[i] + (map_to_scale(t, value) - from) / (to - from) *
                                                 ((double)t->opacities[i + 1] - (double)t->opacities[i]);
    }
    return (double)t->opacities[last];
}

double reference_find_table_position(const render_transfer *t, double value)
{
    const double low = map_to_scale(t, t->low), range = map_to_scale(t, t->high) - low;
    return range > 0 ? (map_to_scale(t, value) - low) / range : 0;
}

void reference_compute_colour(const render_transfer *t, double value, double colour[3])
{
    const double x = reference_find_table_position(t, value);
    const double place = fmin(fmax(x, 0), 1) * (t->colour_count - (t->is_banded ? 0 : 1));
    const bool is_last = place >= t->colour_count - 1;
    const int i = t->is_banded ? (int)fmin(place, t->colour_count - 1) : is_last ? t->colour_count - 2 : (int)place;
    for (int c = 0; c < 3; c++) {
        const double low = (double)t->colours[3 * i + c];
        const double high = t->is_banded ? low : (double)t->colours[3 * i + 3 + c];
        colour[c] = low + (place - i) * (high - low);
        if (t->outside && x < -(double)RENDER_END) colour[c] = (double)t->outside[c];
        if (t->outside && x > 1 + (double)RENDER_END) colour[c] = (double)t->outside[3 + c];
        if (isnan(value)) colour[c] = t->outside ? (double)t->outside[6 + c] : (double)RENDER_NO_COLOUR;
    }
}
