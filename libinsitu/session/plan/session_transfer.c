/* Converts colour maps to transfer functions. A surface is coloured by the map itself. The integration of volumes
 * requires colours that are linear between the entries of a table. For volumes, maps with bands or with colours outside
 * the range are therefore converted to such a table: each band gets 16 entries, so that the colour changes from one
 * band to the next within 1/16 of a band, and each colour outside the range becomes one more entry at an end. Opacity
 * is linear along the map's scale, as the renderer requires. */
#include "session_transfer.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "memory.h"

enum { band_entries = 16 };

/* least_of_data: a range that is computed from the data is treated as a single value if its width is below this
 * fraction of its larger end, because means over cells and ranks have rounding errors of a few times 2^-53. A range
 * that the scene gives may be as narrow as its digits allow, because values are stored relative to its low end in
 * double. widest_log: maximum ratio of the ends of a logarithmic range. */
static const double least_of_data = 64 * DBL_EPSILON, widest_log = 1e30;

/* Width of the range that is used for a constant field, as a fraction of the field's value: constant_linear for a
 * linear scale, constant_scaled for other scales. */
static const double constant_linear = 1e-6, constant_scaled = 1e-3;

/* With a logarithmic scale, values are stored relative to 0 in float32. If a range were narrower than this fraction of
 * its larger end, the rounding of values would be visible. A linear scale is used for such a range instead; this
 * changes positions in the map by at most an eighth of this fraction, 1.3e-4. */
static const double straight = 1e-3;

static double larger_magnitude(double low, double high)
{
    return fmax(fabs(low), fabs(high));
}

static render_scale choose_scale(const scene_colour_map *map, double low, double high)
{
    if (high - low < straight * larger_magnitude(low, high)) return RENDER_LINEAR;
    switch (map->scale) {
    case SCENE_LINEAR: return RENDER_LINEAR;
    case SCENE_LOG: return RENDER_LOG;
    case SCENE_SYMLOG: return RENDER_SYMLOG;
    }
    return RENDER_LINEAR;
}

bool session_is_range_too_narrow(double low, double high)
{
    return low < high && high - low < fmax(least_of_data * larger_magnitude(low, high), FLT_MIN);
}

/* Widens a range so that it is not empty and, for a logarithmic scale, positive. If the field is constant, its value
 * becomes the middle of the range. Returns whether there is a single value, and stores it in *constant. */
static bool make_range_usable(const scene_colour_map *map, double *low, double *high, double *constant)
{
    const bool is_log = map->scale == SCENE_LOG;
    if (is_log && *high > 0 && *low > *high) *low = *high / 1000;
    if (*low > *high || (is_log && !(*high > 0))) {
        *low = is_log ? 1 : 0;
        *high = is_log ? 10 : 1;
    }
    if (is_log) *low = fmax(*low, *high / widest_log);
    const double narrowest = map->range.is_fixed ? 0 : least_of_data * larger_magnitude(*low, *high);
    const double width = *high - *low;
    const bool is_constant = width <= 0 || width < narrowest;
    if (!is_constant && width >= FLT_MIN) return false;
    const double share = map->scale == SCENE_LINEAR ? constant_linear : constant_scaled;
    const double least = fmax(is_constant ? share * larger_magnitude(*low, *high) : 0, FLT_MIN);
    const double middle = 0.5 * *low + 0.5 * *high;
    *constant = middle;
    *low = middle - 0.5 * least;
    *high = middle + 0.5 * least;
    return is_constant;
}

/* ---- colours --------------------------------------------------------------------------------------------------- */

static double find_value_at_fraction(const render_transfer *t, double fraction)
{
    if (t->scale == RENDER_LINEAR) return t->low + fraction * (t->high - t->low);
    const double low = render_scaled(t->scale, t->threshold, t->low);
    const double high = render_scaled(t->scale, t->threshold, t->high);
    return render_unscaled(t->scale, t->threshold, low + fraction * (high - low));
}

static void copy_colour(float *to, const float *from)
{
    memcpy(to, from, 3 * sizeof *to);
}

bool session_transfer_needs_memory(const scene_colour_map *map, const scene_volume *volume)
{
    return volume && (map->is_banded || map->has_below || map->has_above);
}

/* Fills out->table with the colours of a volume: the colour of each band, repeated, or of each entry of the map; and
 * one entry at an end for each colour outside the range. Widens the range of the transfer function by these entries. */
static bool expand_table(const scene_colour_map *map, session_transfer *out)
{
    render_transfer *t = &out->transfer;
    const int repeated = map->is_banded ? band_entries : 1, inner = map->count * repeated;
    const int count = inner + map->has_below + map->has_above;
    out->table = base_alloc((size_t)count * 3 * sizeof *out->table);
    if (!out->table) return false;
    float *entry = out->table;
    if (map->has_below) copy_colour(entry, map->outside_colours[0]), entry += 3;
    for (int i = 0; i < inner; i++, entry += 3) copy_colour(entry, map->colours + 3 * (size_t)(i / repeated));
    if (map->has_above) copy_colour(entry, map->outside_colours[1]);
    const double low = find_value_at_fraction(t, map->has_below ? -1.0 / (inner - 1) : 0);
    const double high = find_value_at_fraction(t, map->has_above ? 1 + 1.0 / (inner - 1) : 1);
    if (map->has_below) t->low = low;
    if (map->has_above) t->high = high;
    t->colours = out->table;
    t->colour_count = count;
    return true;
}

/* ---- opacity --------------------------------------------------------------------------------------------------- */

static void set_opacity(const scene_volume *volume, double half_diagonal, session_transfer *out)
{
    render_transfer *t = &out->transfer;
    t->opacity_count = volume->opacity_count;
    for (int i = 0; i < t->opacity_count; i++) {
        out->opacity_values[i] = find_value_at_fraction(t, volume->opacity[i].position);
        out->opacities[i] = volume->opacity[i].opacity;
    }
    t->opacity_values = out->opacity_values;
    t->opacities = out->opacities;
    t->unit_distance = volume->unit_distance > 0 ? volume->unit_distance : half_diagonal / 10;
    if (!(t->unit_distance > 0)) t->unit_distance = 1;
}

/* ---- transfer functions ---------------------------------------------------------------------------------------- */

bool session_make_transfer(double half_diagonal, const scene_colour_map *map, double low, double high,
                           const scene_volume *volume, session_transfer *out)
{
    double constant = 0;
    const bool is_constant = make_range_usable(map, &low, &high, &constant);
    *out = (session_transfer){.transfer = {.low = low,
                                           .high = high,
                                           .colour_count = map->count,
                                           .colours = map->colours,
                                           .scale = choose_scale(map, low, high),
                                           .threshold = fmax(map->threshold, larger_magnitude(low, high) / widest_log),
                                           .unit_distance = 1},
                              .low = low,
                              .high = high,
                              .is_constant = is_constant,
                              .constant = constant};
    if (volume) {
        set_opacity(volume, half_diagonal, out);
        return !session_transfer_needs_memory(map, volume) || expand_table(map, out);
    }
    out->transfer.is_banded = map->is_banded;
    if (map->has_below || map->has_above || map->has_nan) out->transfer.outside = map->outside_colours[0];
    return true;
}

int session_find_visible_intervals(const scene_volume *volume, mmbvh_interval out[RENDER_MAX_INTERVALS])
{
    const scene_range *range = &volume->colour_map.range;
    /* the members for bands and for colours outside the range are cleared below, because a map with a single colour
     * allocates no memory */
    scene_colour_map map = volume->colour_map;
    map.is_banded = map.has_below = map.has_above = false;
    session_transfer t;
    session_make_transfer(1, &map, range->is_fixed ? range->low : 0, range->is_fixed ? range->high : 1, volume, &t);
    const int count = render_visible_intervals(&t.transfer, out);
    if (count == 0 || range->is_fixed) return count;
    out[0] = (mmbvh_interval){-INFINITY, INFINITY};
    return 1;
}

void session_transfer_free(session_transfer *transfer)
{
    base_free(transfer->table);
    transfer->table = NULL;
}
