/* Converts colour maps and opacities to transfer functions in the renderer's form. */
#ifndef SESSION_TRANSFER_H
#define SESSION_TRANSFER_H

#include "render.h"
#include "scene.h"

typedef struct session_transfer {
    render_transfer transfer;                         /* the transfer function; it points into this struct */
    double opacity_values[RENDER_MAX_OPACITY_POINTS]; /* value of the field at each point of the opacity curve */
    float opacities[RENDER_MAX_OPACITY_POINTS];       /* opacity at each of these values */
    /* field values at the two ends of the colour map. The range of the transfer function is larger if a volume has
     * colours for values outside of [low, high]. */
    double low, high;
    bool is_constant; /* set if all values are equal; the value is then in the middle of low and high */
    double constant;
    float *table; /* table of colours that this struct owns; NULL: the map's table is used */
} session_transfer;

/* Computes the transfer function of a colour map over [low, high] with the opacity of the volume. low > high: there are
 * no values. volume: NULL for a surface. half_diagonal: half the diagonal of the global bounds. *out points into the
 * map. Returns false if memory ran out, with nothing to free. Local. */
bool session_make_transfer(double half_diagonal, const scene_colour_map *map, double low, double high,
                           const scene_volume *volume, session_transfer *out);
/* Returns whether session_make_transfer() allocates memory for this map and volume, so that it may fail. The result is
 * the same on all ranks. */
bool session_transfer_needs_memory(const scene_colour_map *map, const scene_volume *volume);
void session_transfer_free(session_transfer *transfer);

/* Computes the intervals of values in which a volume is not transparent, and returns their number. If the colour map's
 * range is not fixed, it depends on the data; the result is then all values, or none if the volume's opacity is 0 at
 * all values. Local, the same on every rank. */
int session_find_visible_intervals(const scene_volume *volume, mmbvh_interval out[RENDER_MAX_INTERVALS]);

/* Returns whether a range is so narrow that the colours of its values show rounding errors. This is the case if the
 * range's width is only a few dozen rounding errors of its values in double, or below the smallest normal float32. */
bool session_is_range_too_narrow(double low, double high);

#endif
