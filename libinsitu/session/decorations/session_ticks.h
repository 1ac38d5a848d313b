/* Computes the ticks of an axis or of a colour bar. Ticks are at round numbers. */
#ifndef SESSION_TICKS_H
#define SESSION_TICKS_H

#include "insitu/image_output.h"
#include "render.h"
#include "scene.h"

enum { SESSION_MAX_TICKS = 12 };

/* The range of values that a scale shows: low < high; if the scale is logarithmic, low > 0. */
typedef struct session_scale {
    render_scale kind;
    double threshold; /* threshold of a symmetric logarithmic scale (RENDER_SYMLOG) */
    double low, high;
    scene_number_form number_form;
} session_scale;

/* Computes at most `most` (2 .. SESSION_MAX_TICKS) ticks at round numbers in the range, and returns their number. On a
 * linear scale ticks are at multiples of a step, which is 1, 2 or 5 times a power of ten. On other scales ticks are at
 * powers of ten, at 2 and 5 times these powers if there is space, and at 0 if the range contains it. If the range
 * contains fewer than two such values, ticks are chosen as on a linear scale. Numbers are written in the format of the
 * C locale, with enough digits to distinguish neighbouring ticks, unless the scale sets the number of digits. Local. */
int session_make_ticks(const session_scale *scale, int most, insitu_tick ticks[SESSION_MAX_TICKS]);

/* Computes ticks like session_make_ticks() for a range that is divided into `bands` bands of equal width, each with one
 * colour. If the scale is linear and each band contains one integer, such as an id, the ticks are instead in the
 * centres of the bands, or of every n-th band. Local. */
int session_make_ticks_for_colour_bands(const session_scale *scale, int bands, int most,
                                        insitu_tick ticks[SESSION_MAX_TICKS]);

/* Computes the single tick, in the middle of the scale, of data whose values are all equal. Returns 1. Local. */
int session_make_constant_tick(double value, const scene_number_form *form, insitu_tick *tick);

#endif
