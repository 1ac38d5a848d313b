/* Reads the keys that describe how values are mapped to colours. All kinds of layers use the same keys. Every colour
 * map is stored as a table of colours, so that other code need not distinguish built-in maps, files and lists of
 * colours. If the scene requests it, the table is reversed and divided into bands here. */
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "colour_map.h"
#include "memory.h"
#include "scene_convert.h"

enum { path_size = SCENE_PATH_SIZE + 64 };

__attribute__((format(printf, 2, 3))) static void format_path(char path[path_size], const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(path, path_size, format, arguments);
    va_end(arguments);
}

/* Maximum ratio of the ends of a logarithmic range. As a fraction of the high end, the low end is then well above the
 * smallest normal float32 number, 1.2e-38. */
static const double widest_log_range = 1e30;

/* ---- tables of colours ----------------------------------------------------------------------------------------- */

static insitu_status allocate_colour_table(const scene_document *d, const char *name, int count, scene_colour_map *out)
{
    out->count = count;
    out->name = base_strdup(name);
    out->colours = base_alloc((size_t)count * 3 * sizeof *out->colours);
    return out->name && out->colours ? INSITU_OK : scene_fail_for_memory(d);
}

static insitu_status copy_built_in_map(const scene_document *d, const char *name, scene_colour_map *out)
{
    int count = 0;
    const float *table = colour_map_table(name, &count);
    const insitu_status status = allocate_colour_table(d, name, count, out);
    if (status == INSITU_OK) memcpy(out->colours, table, (size_t)count * 3 * sizeof *table);
    return status;
}

static insitu_status fill_table_with_bands(const scene_document *d, const scene_colour_points *bands, const char *name,
                                           scene_colour_map *out)
{
    const insitu_status status = allocate_colour_table(d, name, bands->count, out);
    out->is_banded = true;
    for (int i = 0; i < 3 * bands->count && status == INSITU_OK; i++)
        out->colours[i] = colour_linear_from_srgb((float)bands->items[i / 3].srgb[i % 3]);
    return status;
}

static insitu_status fill_table_from_points(const scene_document *d, const scene_colour_points *points,
                                            const char *name, scene_colour_map *out)
{
    if (points->is_banded) return fill_table_with_bands(d, points, name, out);
    const insitu_status status =
        allocate_colour_table(d, name, colour_choose_table_size(points->items, points->count), out);
    if (status == INSITU_OK) colour_fill_table(points->items, points->count, points->space, out->colours, out->count);
    return status;
}

/* ---- lists of colours ------------------------------------------------------------------------------------------ */

static insitu_status read_positions_of_colour_points(const scene_document *d, const char *path,
                                                     scene_colour_points *points)
{
    const int last = points->count - 1;
    char key[path_size];
    format_path(key, "%s.at", path);
    const int count = scene_get_list_length_at_path(d, key);
    if (count && count != points->count)
        return scene_fail_at_key(d, key, "", "%d places for %d colours, expected one each", count, points->count);
    for (int i = 0; i <= last; i++) {
        colour_point *p = &points->items[i];
        format_path(key, "%s.at[%d]", path, i);
        p->at = count ? scene_get_number_at_path(d, key) : (double)i / last;
        if (i > 0 && p->at < p[-1].at)
            return scene_fail_at_key(d, key, "", "%g comes after %g, expected places that do not fall", p->at,
                                     p[-1].at);
        if ((i == 0 && p->at != 0) || (i == last && p->at != 1))
            return scene_fail_at_key(d, key, "", "%g is the %s place, expected %d", p->at, i ? "last" : "first", i > 0);
    }
    return INSITU_OK;
}

static insitu_status read_colour_list(const scene_document *d, const char *path, scene_colour_map *out)
{
    char key[path_size];
    scene_colour_points points = {.space = COLOUR_RGB};
    format_path(key, "%s.colours", path);
    points.count = scene_get_list_length_at_path(d, key);
    points.items = base_calloc((size_t)points.count, sizeof *points.items);
    if (!points.items) return scene_fail_for_memory(d);
    for (int i = 0; i < points.count; i++)
        for (int c = 0; c < 3; c++) {
            format_path(key, "%s.colours[%d][%d]", path, i, c);
            points.items[i].srgb[c] = scene_get_number_at_path(d, key);
        }
    insitu_status status = read_positions_of_colour_points(d, path, &points);
    if (status == INSITU_OK) status = fill_table_from_points(d, &points, "", out);
    base_free(points.items);
    return status;
}

/* ---- files with colour maps ------------------------------------------------------------------------------------ */

/* Returns the path by which a file is opened. Paths in a scene are relative to the scene's folder. */
static char *resolve_path_relative_to_scene(const char *scene_path, const char *name)
{
    const char *slash = strrchr(scene_path, '/');
    const size_t folder = slash && name[0] != '/' ? (size_t)(slash - scene_path) + 1 : 0;
    char *path = base_alloc(folder + strlen(name) + 1);
    if (!path) return NULL;
    memcpy(path, scene_path, folder);
    memcpy(path + folder, name, strlen(name) + 1);
    return path;
}

static const scene_attachment *find_attachment(const scene_attachments *all, const char *path)
{
    for (int i = 0; i < all->count; i++)
        if (strcmp(all->items[i].path, path) == 0) return &all->items[i];
    return NULL;
}

/* Reads a file, and adds it to the scene's attachments. After a success the attachments own the path; after an error
 * the caller still owns it. */
static insitu_status read_and_add_attachment(const scene_document *d, const char *key, char *path)
{
    scene_attachments *all = d->attachments;
    base_error reason = {.status = INSITU_OK};
    if (!all->read) return scene_fail_at_key(d, key, "", "\"%s\": no file can be read here", path);
    if (all->count == SCENE_MAX_ATTACHMENTS)
        return scene_fail_at_key(d, key, "", "\"%s\" is one file too many, expected at most %d", path,
                                 SCENE_MAX_ATTACHMENTS);
    scene_attachment *items = base_realloc(all->items, ((size_t)all->count + 1) * sizeof *items);
    if (!items) return scene_fail_for_memory(d);
    all->items = items;
    const insitu_status status = all->read(path, &items[all->count].text, &items[all->count].size, &reason);
    if (status == INSITU_ERROR_MEMORY) return scene_fail_for_memory(d);
    if (status != INSITU_OK) return scene_fail_at_key(d, key, "", "%s", reason.message);
    items[all->count++].path = path;
    return INSITU_OK;
}

static insitu_status find_or_read_attachment(const scene_document *d, const char *key, const char *name,
                                             const scene_attachment **out)
{
    const scene_attachments *all = d->attachments;
    if (!all) return scene_fail_at_key(d, key, "", "\"%s\": no file can be read here", name);
    char *path = resolve_path_relative_to_scene(d->file_name, name);
    if (!path) return scene_fail_for_memory(d);
    *out = find_attachment(all, path);
    const insitu_status status = *out ? INSITU_OK : read_and_add_attachment(d, key, path);
    if (*out || status != INSITU_OK)
        base_free(path);
    else
        *out = &all->items[all->count - 1];
    return status;
}

static insitu_status read_colour_map_file(const scene_document *d, const char *path, scene_colour_map *out)
{
    char key[path_size], name_key[path_size];
    const char *file = NULL, *name = NULL;
    const scene_attachment *attachment = NULL;
    scene_colour_points points = {0};
    base_error reason = {.status = INSITU_OK};
    format_path(key, "%s.file", path);
    format_path(name_key, "%s.name", path);
    scene_list_texts_at_path(d, key, &file, 1);
    scene_list_texts_at_path(d, name_key, &name, 1);
    insitu_status status = find_or_read_attachment(d, key, file, &attachment);
    if (status != INSITU_OK) return status;
    status = scene_read_colour_file(attachment, file, name, &points, &reason);
    if (status == INSITU_OK)
        status = fill_table_from_points(d, &points, name ? name : "", out);
    else if (status == INSITU_ERROR_MEMORY)
        status = scene_fail_for_memory(d);
    else
        status = scene_fail_at_key(d, key, "", "%s", reason.message);
    base_free(points.items);
    return status;
}

/* ---- choice of the colour map ---------------------------------------------------------------------------------- */

static bool is_key_present_at_path(const scene_document *d, const char *path, const char *key)
{
    char whole[path_size];
    format_path(whole, "%s.%s", path, key);
    return scene_get_node_type_at_path(d, whole) != SCENE_NOTHING;
}

static insitu_status create_colour_table(const scene_document *d, const char *parent, scene_colour_map *out)
{
    char path[path_size];
    const char *name = "viridis";
    format_path(path, "%s.map", parent);
    if (scene_get_node_type_at_path(d, path) != SCENE_MAPPING) {
        scene_list_texts_at_path(d, path, &name, 1);
        return copy_built_in_map(d, name, out);
    }
    const bool has_list = is_key_present_at_path(d, path, "colours"),
               has_file = is_key_present_at_path(d, path, "file");
    if (has_list == has_file)
        return scene_fail_at_key(d, path, "", "holds %s, expected one of colours and file",
                                 has_list ? "both" : "neither");
    if (has_file && is_key_present_at_path(d, path, "at"))
        return scene_fail_at_key(d, path, "at", "given beside file, expected with colours");
    if (has_list && is_key_present_at_path(d, path, "name"))
        return scene_fail_at_key(d, path, "name", "given beside colours, expected with file");
    return has_list ? read_colour_list(d, path, out) : read_colour_map_file(d, path, out);
}

static void reverse_colour_table(scene_colour_map *map)
{
    for (int i = 0, j = map->count - 1; i < j; i++, j--) {
        float kept[3];
        memcpy(kept, map->colours + 3 * (size_t)i, sizeof kept);
        memcpy(map->colours + 3 * (size_t)i, map->colours + 3 * (size_t)j, sizeof kept);
        memcpy(map->colours + 3 * (size_t)j, kept, sizeof kept);
    }
}

/* Replaces the table by its colours at `bands` evenly spaced positions, including both ends. A single band gets the
 * colour of the middle. */
static insitu_status quantize_colour_map(const scene_document *d, int bands, scene_colour_map *map)
{
    float *colours = base_alloc((size_t)bands * 3 * sizeof *colours);
    if (!colours) return scene_fail_for_memory(d);
    for (int band = 0; band < bands; band++) {
        const double place = (bands > 1 ? (double)band / (bands - 1) : 0.5) * (map->count - 1);
        const int entry = place >= map->count - 1 ? map->count - 2 : (int)place;
        const float *low = map->colours + 3 * (size_t)entry, *high = low + 3;
        for (int c = 0; c < 3; c++)
            colours[3 * band + c] = (float)((double)low[c] + (place - entry) * ((double)high[c] - (double)low[c]));
    }
    base_free(map->colours);
    map->colours = colours;
    map->count = bands;
    map->is_banded = true;
    return INSITU_OK;
}

static void convert_srgb_colour_to_linear(float to[3], const double *srgb)
{
    for (int c = 0; c < 3; c++) to[c] = colour_linear_from_srgb((float)srgb[c]);
}

static void convert_outside_colours(const scene_file_colour_map *in, scene_colour_map *out)
{
    static const double grey[3] = {0.6, 0.6, 0.6};
    out->has_below = in->below != NULL;
    out->has_above = in->above != NULL;
    out->has_nan = in->nan != NULL;
    memcpy(out->outside_colours[0], out->colours, sizeof out->outside_colours[0]);
    memcpy(out->outside_colours[1], out->colours + 3 * (size_t)(out->count - 1), sizeof out->outside_colours[1]);
    if (in->below) convert_srgb_colour_to_linear(out->outside_colours[0], in->below);
    if (in->above) convert_srgb_colour_to_linear(out->outside_colours[1], in->above);
    convert_srgb_colour_to_linear(out->outside_colours[2], in->nan ? in->nan : grey);
}

/* ---- ranges and scales ----------------------------------------------------------------------------------------- */

static insitu_status read_range_ends(const scene_document *d, const char *path, double ends[2])
{
    char key[path_size];
    for (int i = 0; i < 2; i++) {
        format_path(key, "%s[%d]", path, i);
        ends[i] = scene_get_number_at_path(d, key);
    }
    if (ends[0] < ends[1]) return INSITU_OK;
    return scene_fail_at_key(d, path, "", "[%g, %g] does not rise, expected [low, high] with low < high", ends[0],
                             ends[1]);
}

static scene_range_source find_range_source(const char *word)
{
    return strcmp(word, "run") == 0         ? SCENE_RANGE_RUN
           : strcmp(word, "symmetric") == 0 ? SCENE_RANGE_SYMMETRIC
                                            : SCENE_RANGE_DATA;
}

static insitu_status convert_value_range(const scene_document *d, const char *parent, scene_range *out)
{
    char path[path_size], percentile[path_size];
    const char *word = "data";
    double ends[2] = {0, 0};
    insitu_status status = INSITU_OK;
    format_path(path, "%s.range", parent);
    format_path(percentile, "%s.range.percentile", parent);
    const scene_node kind = scene_get_node_type_at_path(d, path);
    if (kind == SCENE_LIST) status = read_range_ends(d, path, ends);
    if (kind == SCENE_MAPPING) status = read_range_ends(d, percentile, ends);
    if (kind == SCENE_SCALAR) scene_list_texts_at_path(d, path, &word, 1);
    *out = (scene_range){.is_fixed = kind == SCENE_LIST,
                         .low = ends[0],
                         .high = ends[1],
                         .source = kind == SCENE_MAPPING ? SCENE_RANGE_PERCENTILES : find_range_source(word)};
    return status;
}

static insitu_status check_fixed_range(const scene_document *d, const char *path, const scene_colour_map *map)
{
    const scene_range *r = &map->range;
    if (map->scale == SCENE_LOG && !(r->low > 0))
        return scene_fail_at_key(d, path, "range", "begins with %g, expected above 0 for scale: log", r->low);
    if (map->scale == SCENE_LOG && r->high / r->low > widest_log_range)
        return scene_fail_at_key(d, path, "range",
                                 "[%g, %g] is too wide for scale: log, expected a ratio of at most %g", r->low, r->high,
                                 widest_log_range);
    return INSITU_OK;
}

static insitu_status convert_colour_scale(const scene_document *d, const char *path, const scene_file_colour_map *in,
                                          scene_colour_map *out)
{
    out->scale = in->scale ? (scene_scale)*in->scale : SCENE_LINEAR;
    out->threshold = in->threshold ? *in->threshold : 0;
    if (out->scale == SCENE_SYMLOG && !in->threshold)
        return scene_fail_at_key(d, path, "threshold", "missing, expected a number above 0 for scale: symlog");
    if (out->scale != SCENE_SYMLOG && in->threshold)
        return scene_fail_at_key(d, path, "threshold", "given without scale: symlog, expected with it");
    if (out->scale == SCENE_LOG && out->range.source == SCENE_RANGE_SYMMETRIC)
        return scene_fail_at_key(d, path, "range",
                                 "symmetric is not allowed beside scale: log, expected scale: symlog");
    return out->range.is_fixed ? check_fixed_range(d, path, out) : INSITU_OK;
}

insitu_status scene_convert_colour_map(const scene_document *d, const char *path, const scene_file_colour_map *in,
                                       scene_colour_map *out)
{
    insitu_status status = create_colour_table(d, path, out);
    if (status != INSITU_OK) return status;
    if (in->reversed && *in->reversed) reverse_colour_table(out);
    if (in->discrete && out->is_banded)
        return scene_fail_at_key(d, path, "discrete", "given beside a map of %d bands, expected one of the two",
                                 out->count);
    if (in->discrete) status = quantize_colour_map(d, *in->discrete, out);
    if (status == INSITU_OK) convert_outside_colours(in, out);
    if (status == INSITU_OK) status = convert_value_range(d, path, &out->range);
    return status == INSITU_OK ? convert_colour_scale(d, path, in, out) : status;
}
