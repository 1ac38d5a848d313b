/* The keys that say how values become colours: one description for all layers. */
#include <string.h>

#include "colour_map.h"
#include "memory.h"
#include "scene_convert.h"

static insitu_status convert_range(const scene_document *d, const char *path, const double *in, scene_range *out)
{
    if (!in) return INSITU_OK;
    *out = (scene_range){true, in[0], in[1]};
    if (in[0] < in[1]) return INSITU_OK;
    return scene_bad(d, path, "range", "[%g, %g] does not rise, expected [low, high] with low < high", in[0], in[1]);
}

static insitu_status take_built_in(const scene_document *d, colour_map map, scene_colour_map *out)
{
    const char *name = colour_map_name(map);
    const float *table = colour_map_table(name, &out->count);
    const size_t bytes = (size_t)out->count * 3 * sizeof *out->colours;
    out->name = base_strdup(name);
    out->colours = base_alloc(bytes);
    if (!out->name || !out->colours) return scene_no_memory(d);
    memcpy(out->colours, table, bytes);
    return INSITU_OK;
}

insitu_status scene_convert_colour_map(const scene_document *d, const char *path, const scene_file_colour_map *in,
                                       scene_colour_map *out)
{
    const insitu_status status = take_built_in(d, in->map ? (colour_map)*in->map : COLOUR_MAP_VIRIDIS, out);
    return status ? status : convert_range(d, path, in->range, &out->range);
}
