#include "reference_base.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

void *reference_reserve(void *block, size_t bytes)
{
    void *p = realloc(block, bytes ? bytes : 1);
    if (!p) {
        fprintf(stderr, "reference: out of memory\n");
        exit(1);
    }
    return p;
}

double reference_opacity(const render_transfer *t, double value)
{
    const int last = t->opacity_count - 1;
    if (value < t->opacity_values[0]) return (double)t->opacities[0];
    for (int i = 0; i < last; i++) {
        const double low = t->opacity_values[i], high = t->opacity_values[i + 1];
        if (value < high)
            return (double)t->opacities[i] +
                   (value - low) / (high - low) * ((double)t->opacities[i + 1] - (double)t->opacities[i]);
    }
    return (double)t->opacities[last];
}

void reference_colour(const render_transfer *t, double value, double colour[3])
{
    const double range = t->high - t->low, x = range > 0 ? (value - t->low) / range : 0;
    const double place = fmin(fmax(x, 0), 1) * (t->colour_count - 1);
    const int i = place >= t->colour_count - 1 ? t->colour_count - 2 : (int)place;
    for (int c = 0; c < 3; c++) {
        const double low = (double)t->colours[3 * i + c], high = (double)t->colours[3 * i + 3 + c];
        colour[c] = low + (place - i) * (high - low);
    }
}
