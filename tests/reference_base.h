/* Functions that the reference's parts share. */
#ifndef REFERENCE_BASE_H
#define REFERENCE_BASE_H

#include <stddef.h>

#include "render.h"

/* Does as realloc(); running out of memory ends the process. */
void *reference_reserve(void *block, size_t bytes);

/* Colour and opacity of a value, as render.h says. */
double reference_opacity(const render_transfer *t, double value);
/* A value's place in the colour table, not clamped. */
double reference_place(const render_transfer *t, double value);
void reference_colour(const render_transfer *t, double value, double colour[3]);

static inline double reference_dot(const double *a, const double *b)
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

#endif
