/* Computes the ticks of an axis or of a colour bar. Ticks are at round numbers. */
#ifndef SESSION_TICKS_H
#define SESSION_TICKS_H

#include "insitu/image_output.h"
#include "render.h"
#include "scene.h"

enum { SESSION_MAX_TICKS = 12 };

/* A range of values along a scale, with low < high, and low > 0 for a logarithmic one. */
typedef struct session_scale {
    render_scale kind;
    double threshold; /* threshold of a symmetric logarithmic scale (RENDER_SYMLOG) */
    double low, high;
    scene_number_form number_form;
} session_scale;

/* Computes at most `most` (2 .. SESSION_MAX_TICKS) ticks at round numbers in the range, and returns their number. On a
 * linear scale ticks are at multiples of a step, which is 1, 2 or 5 times a power of ten. On other scales they are at
 * powers of ten, at 2 and 5 times these if there is space, and at 0. If the range covers less than a factor of ten,
 * they are chosen as on a linear scale. Numbers are written in the format of the C locale, with enough digits to
 * distinguish neighbours, unless the scale sets the number of digits. Local. */
int session_make_ticks(const session_scale *scale, int most, insitu_tick ticks[SESSION_MAX_TICKS]);

/* Computes ticks like session_make_ticks() for a range that is divided into `bands` bands of equal width. If the scale
 * is linear and each band contains one integer, as for ids, the ticks are in the centres of the bands, or of every n-th
 * band. Local. */
int session_make_band_ticks(const session_scale *scale, int bands, int most, insitu_tick ticks[SESSION_MAX_TICKS]);

/* Computes the single tick of a range whose values are all equal, in its middle. Returns 1. Local. */
int session_make_constant_tick(double value, const scene_number_form *form, insitu_tick *tick);

#endif
