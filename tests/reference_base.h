/* Functions that all files of the reference renderer share. */
#ifndef REFERENCE_BASE_H
#define REFERENCE_BASE_H

#include <stddef.h>

#include "render.h"

/* Reallocates a block of memory like realloc(), but ends the process if memory runs out. */
void *reference_reallocate(void *block, size_t bytes);

/* Returns the opacity of a value as render.h defines it. reference_compute_colour() computes its colour. */
double reference_compute_opacity(const render_transfer *t, double value);
/* Returns the value's position in the colour table, not clamped. */
double reference_find_table_position(const render_transfer *t, double value);
void reference_compute_colour(const render_transfer *t, double value, double colour[3]);

static inline double reference_dot(const double *a, const double *b)
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

#endif
