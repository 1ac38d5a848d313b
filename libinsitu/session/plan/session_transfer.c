#include "session_transfer.h"

#include <float.h>
#include <math.h>

/* A constant field has its value in the middle of a range that float32 numbers can tell from nothing. */
static void widen(double *low, double *high)
{
    if (*low > *high) {
        *low = 0;
        *high = 1;
    }
    const double least = fmax(1e-6 * fmax(fabs(*low), fabs(*high)), FLT_MIN);
    if (*high - *low >= least) return;
    const double middle = 0.5 * *low + 0.5 * *high;
    *low = middle - 0.5 * least;
    *high = middle + 0.5 * least;
}

void session_make_transfer(double half_diagonal, const scene_colour_map *map, double low, double high,
                           const scene_volume *volume, session_transfer *out)
{
    render_transfer *t = &out->transfer;
    *out = (session_transfer){0};
    widen(&low, &high);
    t->low = low;
    t->high = high;
    t->colours = map->colours;
    t->colour_count = map->count;
    t->unit_distance = 1;
    if (!volume) return;
    t->opacity_count = volume->opacity_count;
    for (int i = 0; i < volume->opacity_count; i++) {
        out->opacity_values[i] = low + volume->opacity[i].at * (high - low);
        out->opacities[i] = volume->opacity[i].opacity;
    }
    t->opacity_values = out->opacity_values;
    t->opacities = out->opacities;
    t->unit_distance = volume->unit_distance > 0 ? volume->unit_distance : half_diagonal / 10;
    if (!(t->unit_distance > 0)) t->unit_distance = 1;
}
