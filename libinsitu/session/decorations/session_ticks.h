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
    double threshold; /* the threshold of RENDER_SYMLOG */
    double low, high;
    scene_number_form numbers;
} session_scale;

/* Fill in round numbers of the range, `most` (2 .. SESSION_MAX_TICKS) of them at most: multiples of 1, 2 or 5 times a
 * power of ten on a linear scale; powers of ten on the others, with 2 and 5 times these where there is room, and 0. A
 * scale that spans less than a power of ten has the linear one's. Numbers have as many digits as tell neighbours apart,
 * unless the scale says how many, in the C locale's form. Returns how many there are. Local. */
int session_make_ticks(const session_scale *scale, int most, insitu_tick ticks[SESSION_MAX_TICKS]);

/* The same for a range of so many bands of equal width. Where each band has one whole number of a linear range, as
 * those of ids have, the ticks stand in the bands' middles: all of them, or every so many. Local. */
int session_make_band_ticks(const session_scale *scale, int bands, int most, insitu_tick ticks[SESSION_MAX_TICKS]);

/* Makes the only tick of a range whose values are all the same, in its middle. Returns 1. Local. */
int session_make_constant_tick(double value, const scene_number_form *form, insitu_tick *tick);

#endif
