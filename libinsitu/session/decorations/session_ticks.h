/* Ticks of an axis at round numbers. */
#ifndef SESSION_TICKS_H
#define SESSION_TICKS_H

#include "insitu/image_output.h"
#include "render.h"
#include "scene.h"

enum { SESSION_MAX_TICKS = 12 };

/* A range of values along a scale, low < high; a logarithmic one has low > 0. */
typedef struct session_scale {
    render_scale kind;
    double threshold; /* threshold of RENDER_SYMLOG */
    double low, high;
    scene_number_form numbers;
} session_scale;

/* Fills in at most `most` (2 .. SESSION_MAX_TICKS) round numbers of the range. On a linear scale they are multiples of
 * 1, 2 or 5 times a power of ten; on the others powers of ten, 2 and 5 times these if there is space, and 0. A scale
 * that spans less than a power of ten has a linear scale's numbers. Numbers have enough digits to distinguish
 * neighbours, unless the scale sets the number of digits, in the C locale's form. Returns their number. Local. */
int session_make_ticks(const session_scale *scale, int most, insitu_tick ticks[SESSION_MAX_TICKS]);

/* As session_make_ticks(), for a range of `bands` bands of equal width. If each band contains one whole number of a
 * linear range, as with ids, the ticks are in the bands' middles: in all of them, or in every n-th. Local. */
int session_make_band_ticks(const session_scale *scale, int bands, int most, insitu_tick ticks[SESSION_MAX_TICKS]);

/* Makes the only tick of a range whose values are all the same, in its middle. Returns 1. Local. */
int session_make_constant_tick(double value, const scene_number_form *form, insitu_tick *tick);

#endif
