#include "session_run_ranges.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "memory.h"
#include "session_agree.h"
#include "text_file.h"

enum { MOST_BYTES = 1 << 20 }; /* maximum size of a file of ranges that is read */

/* ---- layers whose colour ranges widen over the run --------------------------------------------------------------- */

typedef struct layer_list {
    int count;
    session_run_range *items; /* the layers with ranges over the run; NULL: layers are only counted */
} layer_list;

/* Returns whether the range belongs to a layer of this type that shows this component of the field. */
static bool is_range_of(const session_run_range *range, const char *kind, const char *field, int component)
{
    return strcmp(range->kind, kind) == 0 && range->field->component == component &&
           strcmp(range->field->name, field) == 0;
}

static void append_layer_with_run_range(layer_list *list, const char *kind, const scene_field *field,
                                        const scene_colour_map *map)
{
    int number = 0;
    if (map->range.is_fixed || map->range.source != SCENE_RANGE_RUN) return;
    for (int i = 0; list->items && i < list->count; i++)
        number += is_range_of(&list->items[i], kind, field->name, field->component);
    if (list->items) list->items[list->count] = (session_run_range){kind, number, field, map, INFINITY, -INFINITY};
    list->count++;
}

static void list_layers_with_run_ranges(const scene_image *image, layer_list *list)
{
    for (int i = 0; i < image->isosurface_count; i++) {
        const scene_isosurface *layer = &image->isosurfaces[i];
        if (layer->has_colour_by)
            append_layer_with_run_range(list, "isosurface", &layer->colour_by, &layer->colour_map);
    }
    for (int i = 0; i < image->surface_count; i++) {
        const scene_surface *layer = &image->surfaces[i];
        if (layer->has_colour_by) append_layer_with_run_range(list, "surface", &layer->colour_by, &layer->colour_map);
    }
    for (int i = 0; i < image->slice_count; i++)
        append_layer_with_run_range(list, "slice", &image->slices[i].field, &image->slices[i].colour_map);
    for (int i = 0; i < image->volume_count; i++)
        append_layer_with_run_range(list, "volume", &image->volumes[i].field, &image->volumes[i].colour_map);
}

static int count_layers_with_run_ranges(const scene_image *image)
{
    layer_list list = {0};
    list_layers_with_run_ranges(image, &list);
    return list.count;
}

/* ---- the file of an image's ranges ----------------------------------------------------------------------------- */

/* Stores an error that the file could not be `what` ("read" or "written"), and returns its status. */
static insitu_status fail_at_file(const session_image_ranges *ranges, const char *what, const file_failure *failure,
                                  base_error *error)
{
    return base_fail(error, failure->is_out_of_memory ? INSITU_ERROR_MEMORY : INSITU_ERROR_IO,
                     "image \"%s\": %.300s: cannot be %s: %s", ranges->image, ranges->path, what, failure->reason);
}

/* Returns NULL if memory runs out. The image must have an output. */
static char *make_ranges_file_path(const scene_image *image)
{
    const char *output = image->outputs[0].path;
    size_t folder = strcspn(output, "{");
    while (folder > 0 && output[folder - 1] != '/') folder--;
    const size_t size = folder + strlen(image->name) + sizeof ".ranges" + 12;
    char number[12] = "", *path = base_alloc(size);
    if (image->variant.layers > 0) snprintf(number, sizeof number, ".%d", image->variant.layers);
    if (path) snprintf(path, size, "%.*s%s%s.ranges", (int)folder, output, image->name, number);
    return path;
}

/* Stores the range of a line of the file for its layer. It is not stored if the layer's scale has become logarithmic
 * and the range has values that this scale does not show. */
static void store_line(session_image_ranges *ranges, const session_run_range *line, int component, const char *field)
{
    for (int i = 0; i < ranges->count; i++) {
        session_run_range *layer = &ranges->items[i];
        if (layer->number != line->number || !is_range_of(layer, line->kind, field, component)) continue;
        if (layer->map->scale == SCENE_LOG && !(line->low > 0)) continue;
        layer->low = line->low;
        layer->high = line->high;
    }
}

static bool read_line(session_image_ranges *ranges, const char *text)
{
    char kind[16];
    session_run_range line = {.kind = kind};
    int component, at = 0;
    if (text[0] == '#' || text[0] == '\0') return true;
    if (sscanf(text, "%15s %d %d %lf %lf %n", kind, &line.number, &component, &line.low, &line.high, &at) < 5)
        return false;
    if (at == 0 || !(isfinite(line.low) && isfinite(line.high) && line.low <= line.high)) return false;
    store_line(ranges, &line, component, text + at);
    return true;
}

/* Reads the ranges from the lines of the text. Line ends in the text are replaced by NUL. */
static insitu_status read_lines(session_image_ranges *ranges, const file_content *content, base_error *error)
{
    char *line = content->text, *const end = content->text + content->size;
    for (int number = 1; line < end; number++) {
        char *stop = memchr(line, '\n', (size_t)(end - line));
        if (!stop) stop = end; /* the last line ends at the text's terminating NUL */
        *stop = '\0';
        if (line + strlen(line) != stop || !read_line(ranges, line))
            return base_fail(error, INSITU_ERROR_SCENE,
                             "image \"%s\": %.300s:%d: is no range, expected kind, number, component, low, high and "
                             "field (delete the file to begin anew)",
                             ranges->image, ranges->path, number);
        line = stop + 1;
    }
    return INSITU_OK;
}

/* Reads the file of ranges, if the image has one; a missing file is not an error. */
static insitu_status read_ranges(session_image_ranges *ranges, base_error *error)
{
    c_locale numbers;
    file_content content;
    file_failure failure;
    if (!ranges->path) return INSITU_OK;
    if (!file_read_written_by_library(ranges->path, MOST_BYTES, &content, &failure))
        return failure.is_missing ? INSITU_OK : fail_at_file(ranges, "read", &failure, error);
    insitu_status status = INSITU_OK;
    if (c_locale_enter(&numbers)) {
        status = read_lines(ranges, &content, error);
        c_locale_leave(&numbers);
    } else {
        status = session_fail_for_memory(error, (int64_t)content.size, "ranges of a run");
    }
    base_free(content.text);
    return status;
}

static void write_lines(text_output *out, const void *what)
{
    const session_image_ranges *ranges = what;
    text_print(out, "# The widest ranges of the run so far. Delete this file to begin anew.\n");
    for (int i = 0; i < ranges->count; i++) {
        const session_run_range *r = &ranges->items[i];
        if (r->low <= r->high)
            text_print(out, "%s %d %d %.17g %.17g %s\n", r->kind, r->number, r->field->component, r->low, r->high,
                       r->field->name);
    }
}

insitu_status session_write_run_ranges(session_image_ranges *ranges, base_error *error)
{
    if (!ranges->is_changed || !ranges->path) return INSITU_OK;
    file_failure failure;
    if (!text_file_replace(ranges->path, write_lines, ranges, &failure))
        return fail_at_file(ranges, "written", &failure, error);
    ranges->is_changed = false;
    return INSITU_OK;
}

/* ---- the ranges of all images ---------------------------------------------------------------------------------- */

static void free_ranges(session_image_ranges *ranges)
{
    base_free(ranges->image);
    base_free(ranges->path);
    base_free(ranges->items);
}

void session_run_ranges_free(session_run_ranges *all)
{
    for (int i = 0; i < all->count; i++) free_ranges(&all->items[i]);
    base_free(all->items);
    *all = (session_run_ranges){0};
}

static session_image_ranges *find_ranges(const session_run_ranges *all, const scene_image *image)
{
    for (int i = 0; i < all->count; i++)
        if (all->items[i].layers == image->variant.layers && strcmp(all->items[i].image, image->name) == 0)
            return &all->items[i];
    return NULL;
}

/* Stores an error if two images would write the same file: the further pictures of the sweep of an image "a" use
 * a.1.ranges, which is also the file of an image "a.1" in the same folder. */
static void check_that_file_is_unique(const session_run_ranges *all, const session_image_ranges *entry,
                                      base_error *error)
{
    for (int i = 0; i < all->count && entry->path; i++)
        if (all->items[i].path && strcmp(all->items[i].path, entry->path) == 0)
            base_fail(error, INSITU_ERROR_SCENE,
                      "image \"%s\": its ranges of the run would be kept in %.300s, which keeps those of image \"%s\"; "
                      "give one of the two another name",
                      entry->image, entry->path, all->items[i].image);
}

/* Initializes all->items[all->count] for the image, without ranges. The caller increments all->count when the ranges
 * have been read. */
static bool append_empty_image_ranges(session_run_ranges *all, const scene_image *image, base_error *error)
{
    const int count = count_layers_with_run_ranges(image);
    session_image_ranges *items = base_realloc(all->items, ((size_t)all->count + 1) * sizeof *items);
    if (items) {
        all->items = items;
        session_image_ranges *entry = &items[all->count];
        *entry = (session_image_ranges){.image = base_strdup(image->name),
                                        .layers = image->variant.layers,
                                        .path = image->output_count ? make_ranges_file_path(image) : NULL,
                                        .count = count,
                                        .items = base_calloc((size_t)count, sizeof *entry->items)};
        if (entry->items) list_layers_with_run_ranges(image, &(layer_list){0, entry->items});
        if (entry->image && (entry->path || !image->output_count) && entry->items) {
            check_that_file_is_unique(all, entry, error);
            return true;
        }
        free_ranges(entry);
    }
    session_fail_for_memory(error, (int64_t)sizeof *items, "ranges of a run");
    return false;
}

/* Sends the ranges that rank 0 has read to all ranks. Collective. */
static insitu_status broadcast_ranges(session_image_ranges *ranges, MPI_Comm comm, base_error *error)
{
    insitu_status status = INSITU_OK;
    for (int i = 0; i < ranges->count && !status; i++) {
        double ends[2] = {ranges->items[i].low, ranges->items[i].high};
        status = session_check_mpi(error, MPI_Bcast(ends, 2, MPI_DOUBLE, 0, comm), "MPI_Bcast");
        ranges->items[i].low = ends[0];
        ranges->items[i].high = ends[1];
    }
    return status;
}

/* Reads the ranges from the file on rank 0, and sends them to all ranks. Collective. */
static insitu_status load_ranges_on_all_ranks(session_image_ranges *ranges, const session_team *team, base_error *error)
{
    if (team->rank == 0) read_ranges(ranges, error);
    const insitu_status status = session_agree_without_rank(team->comm, error);
    return status ? status : broadcast_ranges(ranges, team->comm, error);
}

insitu_status session_find_or_read_run_ranges(session_run_ranges *all, const scene_image *image,
                                              const session_team *team, session_image_ranges **out, base_error *error)
{
    *out = find_ranges(all, image);
    if (*out || count_layers_with_run_ranges(image) == 0) return INSITU_OK;
    const bool is_prepared = append_empty_image_ranges(all, image, error);
    session_image_ranges *ranges = is_prepared ? &all->items[all->count] : NULL;
    insitu_status status = session_agree(team->comm, error);
    if (!status && ranges) status = load_ranges_on_all_ranks(ranges, team, error);
    if (status && ranges) free_ranges(ranges);
    if (status) return status;
    all->count++;
    *out = ranges;
    return INSITU_OK;
}

static session_run_range *find_range_of_colour_map(session_image_ranges *ranges, const scene_colour_map *map)
{
    for (int i = 0; ranges && i < ranges->count; i++)
        if (ranges->items[i].map == map) return &ranges->items[i];
    return NULL;
}

void session_widen_run_range(session_image_ranges *ranges, const scene_colour_map *map, double *low, double *high)
{
    session_run_range *range = find_range_of_colour_map(ranges, map);
    if (!range) return;
    if (*low <= *high && (*low < range->low || *high > range->high)) {
        range->low = fmin(range->low, *low);
        range->high = fmax(range->high, *high);
        ranges->is_changed = true;
    }
    *low = range->low;
    *high = range->high;
}
