/* A surface is coloured by the map as it is. A volume is integrated over transfer functions that are linear between
 * points of value, so other maps are made of such: each band has 16 entries of a table, so that colours change within
 * 1/16 of a band; colours outside of the range are one more entry at an end; and a ramp of opacity that is straight
 * along a scale becomes several pieces that are straight along the values. Pieces are equal along the scale, and are
 * cut until all 32 points are in use. Over six decades of a logarithm a single ramp is then off by less than 0.002 of
 * its height, and seven ramps by less than 0.02; with as many decades on both sides of 0, by twice that. */
#include "session_transfer.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "memory.h"

enum { band_entries = 16 };

/* A range must be at least this share of its larger end. Values are float32, relative to the range or, with a scale, to
 * its larger end; rounding then moves them by up to 1e-4 of the map. */
static const double narrowest_linear = 1e-6, narrowest_scaled = 1e-3, widest_log = 1e30;

static render_scale scale_of(const scene_colour_map *map)
{
    switch (map->scale) {
    case SCENE_LINEAR: return RENDER_LINEAR;
    case SCENE_LOG: return RENDER_LOG;
    case SCENE_SYMLOG: return RENDER_SYMLOG;
    }
    return RENDER_LINEAR;
}

/* A constant field has its value in the middle of a range that float32 numbers can tell from nothing. */
void session_usable_range(const scene_colour_map *map, double *low, double *high)
{
    const bool is_log = map->scale == SCENE_LOG;
    if (is_log && *high > 0 && *low > *high) *low = *high / 1000;
    if (*low > *high || (is_log && !(*high > 0))) {
        *low = is_log ? 1 : 0;
        *high = is_log ? 10 : 1;
    }
    if (is_log) *low = fmax(*low, *high / widest_log);
    const double narrowest = map->scale == SCENE_LINEAR ? narrowest_linear : narrowest_scaled;
    const double least = fmax(narrowest * fmax(fabs(*low), fabs(*high)), FLT_MIN);
    if (*high - *low >= least) return;
    const double middle = 0.5 * *low + 0.5 * *high;
    *low = middle - 0.5 * least;
    *high = middle + 0.5 * least;
}

/* ---- colours --------------------------------------------------------------------------------------------------- */

static double value_at(const render_transfer *t, double place)
{
    if (t->scale == RENDER_LINEAR) return t->low + place * (t->high - t->low);
    const double low = render_scaled(t->scale, t->threshold, t->low);
    const double high = render_scaled(t->scale, t->threshold, t->high);
    return render_unscaled(t->scale, t->threshold, low + place * (high - low));
}

static void copy_colour(float *to, const float *from)
{
    memcpy(to, from, 3 * sizeof *to);
}

bool session_takes_memory(const scene_colour_map *map, const scene_volume *volume)
{
    return volume && (map->is_banded || map->has_below || map->has_above);
}

/* Makes a table of bands and of the colours outside. */
static bool expand_table(const scene_colour_map *map, session_transfer *out)
{
    render_transfer *t = &out->transfer;
    const int repeated = map->is_banded ? band_entries : 1, inner = map->count * repeated;
    const int count = inner + map->has_below + map->has_above;
    out->table = base_alloc((size_t)count * 3 * sizeof *out->table);
    if (!out->table) return false;
    float *entry = out->table;
    if (map->has_below) copy_colour(entry, map->outside[0]), entry += 3;
    for (int i = 0; i < inner; i++, entry += 3) copy_colour(entry, map->colours + 3 * (size_t)(i / repeated));
    if (map->has_above) copy_colour(entry, map->outside[1]);
    const double low = value_at(t, map->has_below ? -1.0 / (inner - 1) : 0);
    const double high = value_at(t, map->has_above ? 1 + 1.0 / (inner - 1) : 1);
    if (map->has_below) t->low = low;
    if (map->has_above) t->high = high;
    t->colours = out->table;
    t->colour_count = count;
    return true;
}

/* ---- opacity --------------------------------------------------------------------------------------------------- */

typedef struct opacity_points {
    int count;
    scene_opacity_point items[RENDER_MAX_OPACITY_POINTS];
} opacity_points;

/* Returns the largest difference, over 15 places between two points, between a ramp that is straight by value and one
 * that is straight by place. */
static double chord_error(const render_transfer *t, const scene_opacity_point *a, const scene_opacity_point *b)
{
    enum { PARTS = 16 };
    const double low = value_at(t, a->at), high = value_at(t, b->at);
    double most = 0;
    if (!(low < high) || a->opacity == b->opacity) return 0;
    for (int i = 1; i < PARTS; i++) {
        const double share = (double)i / PARTS, value = value_at(t, a->at + share * (b->at - a->at));
        most = fmax(most, fabs((value - low) / (high - low) - share));
    }
    return most * fabs((double)b->opacity - (double)a->opacity);
}

static scene_opacity_point point_between(const scene_opacity_point *a, const scene_opacity_point *b, double share)
{
    return (scene_opacity_point){a->at + share * (b->at - a->at),
                                 (float)(a->opacity + share * (b->opacity - a->opacity))};
}

/* The same difference for a ramp that is cut into pieces of equal length by place. */
static double ramp_error(const render_transfer *t, const scene_opacity_point *ramp, int pieces)
{
    double most = 0;
    for (int i = 0; i < pieces; i++) {
        const scene_opacity_point a = point_between(ramp, ramp + 1, (double)i / pieces);
        const scene_opacity_point b = point_between(ramp, ramp + 1, (double)(i + 1) / pieces);
        most = fmax(most, chord_error(t, &a, &b));
    }
    return most;
}

static int worst_of(const double *errors, int count)
{
    int worst = 0;
    for (int i = 1; i < count; i++)
        if (errors[i] > errors[worst]) worst = i;
    return worst;
}

/* Cuts the ramps that bend along the values. It cuts the worst one into one more piece at a time, until no ramp or no
 * point is left. */
static void cut_ramps(const render_transfer *t, const scene_volume *volume, opacity_points *out)
{
    static const double good_enough = 1e-4;
    const int ramps = volume->opacity_count - 1;
    int pieces[RENDER_MAX_OPACITY_POINTS] = {0}, total = ramps;
    double errors[RENDER_MAX_OPACITY_POINTS] = {0};
    for (int i = 0; i < ramps; i++) errors[i] = ramp_error(t, &volume->opacity[i], pieces[i] = 1);
    while (total + 1 < RENDER_MAX_OPACITY_POINTS) {
        const int i = worst_of(errors, ramps);
        if (errors[i] <= good_enough) break;
        errors[i] = ramp_error(t, &volume->opacity[i], ++pieces[i]);
        total++;
    }
    out->count = 0;
    for (int i = 0; i < ramps; i++)
        for (int piece = 0; piece < pieces[i]; piece++)
            out->items[out->count++] =
                point_between(&volume->opacity[i], &volume->opacity[i] + 1, (double)piece / pieces[i]);
    out->items[out->count++] = volume->opacity[ramps];
}

static void set_opacity(const scene_volume *volume, double half_diagonal, session_transfer *out)
{
    render_transfer *t = &out->transfer;
    opacity_points points = {.count = volume->opacity_count};
    memcpy(points.items, volume->opacity, (size_t)volume->opacity_count * sizeof *points.items);
    if (t->scale != RENDER_LINEAR) cut_ramps(t, volume, &points);
    t->opacity_count = points.count;
    for (int i = 0; i < points.count; i++) {
        out->opacity_values[i] = value_at(t, points.items[i].at);
        out->opacities[i] = points.items[i].opacity;
    }
    t->opacity_values = out->opacity_values;
    t->opacities = out->opacities;
    t->unit_distance = volume->unit_distance > 0 ? volume->unit_distance : half_diagonal / 10;
    if (!(t->unit_distance > 0)) t->unit_distance = 1;
}

/* ---- the whole ------------------------------------------------------------------------------------------------- */

bool session_make_transfer(double half_diagonal, const scene_colour_map *map, double low, double high,
                           const scene_volume *volume, session_transfer *out)
{
    session_usable_range(map, &low, &high);
    *out = (session_transfer){.transfer = {.low = low,
                                           .high = high,
                                           .colour_count = map->count,
                                           .colours = map->colours,
                                           .scale = scale_of(map),
                                           .threshold = fmax(map->threshold, fmax(fabs(low), fabs(high)) / widest_log),
                                           .unit_distance = 1},
                              .low = low,
                              .high = high};
    if (volume) {
        set_opacity(volume, half_diagonal, out);
        return !session_takes_memory(map, volume) || expand_table(map, out);
    }
    out->transfer.is_banded = map->is_banded;
    if (map->has_below || map->has_above || map->has_nan) out->transfer.outside = map->outside[0];
    return true;
}

void session_transfer_free(session_transfer *transfer)
{
    base_free(transfer->table);
    transfer->table = NULL;
}
