/* Transfer functions, as the renderer takes them. */
#ifndef SESSION_TRANSFER_H
#define SESSION_TRANSFER_H

#include "render.h"
#include "scene.h"

typedef struct session_transfer {
    render_transfer transfer; /* points into this */
    double opacity_values[RENDER_MAX_OPACITY_POINTS];
    float opacities[RENDER_MAX_OPACITY_POINTS];
    double low, high; /* the values that the map's ends stand for; the transfer's go farther where a volume shows what
                         is outside of them */
    bool is_constant; /* the values are one, in the middle of low and high */
    double constant;
    float *table; /* its own table; NULL: the map's */
} session_transfer;

/* Makes the transfer function of a colour map over [low, high] (low > high: there are no values), and the opacity of
 * the volume, NULL: of a surface. half_diagonal: of the global bounds. Points into the map. False where memory ran out,
 * with nothing to free. Local. */
bool session_make_transfer(double half_diagonal, const scene_colour_map *map, double low, double high,
                           const scene_volume *volume, session_transfer *out);
/* Tells whether making the transfer function takes memory, and so may fail; the same on all ranks. */
bool session_takes_memory(const scene_colour_map *map, const scene_volume *volume);
void session_transfer_free(session_transfer *transfer);

/* The values at which a volume is not transparent, for all that is known before the data's range is; returns how many
 * intervals. Local, the same everywhere. */
int session_visible_intervals(const scene_volume *volume, mmbvh_interval out[RENDER_MAX_INTERVALS]);

/* Tells whether the values of a range are so near to one another that float32, after the range's low end was taken from
 * them in double, shows their rounding. */
bool session_is_too_narrow(double low, double high);

#endif
