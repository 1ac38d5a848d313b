/* Transfer functions, as the renderer takes them. */
#ifndef SESSION_TRANSFER_H
#define SESSION_TRANSFER_H

#include "render.h"
#include "scene.h"

typedef struct session_transfer {
    render_transfer transfer; /* points into this */
    double opacity_values[RENDER_MAX_OPACITY_POINTS];
    float opacities[RENDER_MAX_OPACITY_POINTS];
} session_transfer;

/* out points into the map. Of a colour map over [low, high] (low > high: there are no values), and the opacity of the
 * volume, NULL: of a surface. half_diagonal: of the global bounds. Local. */
void session_make_transfer(double half_diagonal, const scene_colour_map *map, double low, double high,
                           const scene_volume *volume, session_transfer *out);

#endif
