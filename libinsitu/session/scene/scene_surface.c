/* Outer surfaces of meshes: what colours them. */
#include <math.h>

#include "colour_map.h"
#include "scene_convert.h"

static void convert_edges(const scene_file_edges *in, int height, scene_surface *out)
{
    if (!in) return;
    out->edge_width = in->width ? (float)*in->width : fmaxf(1, (float)height / 900);
    for (int c = 0; c < 3; c++) out->edge_colour[c] = colour_linear_from_srgb(in->colour ? (float)in->colour[c] : 0.1F);
}

insitu_status scene_convert_surface(const scene_document *d, const char *path, const scene_file_surface *in, int height,
                                    scene_surface *out)
{
    convert_edges(in->edges, height, out);
    out->opacity = in->opacity ? (float)*in->opacity : 1;
    out->material = scene_convert_material(in->material);
    out->has_colour_by = in->colour_by != NULL;
    for (int c = 0; c < 3; c++) out->colour[c] = colour_linear_from_srgb(in->colour ? (float)in->colour[c] : 0.8F);
    if (in->colour && in->colour_by)
        return scene_bad(d, path, "colour", "given beside colour_by, expected one of the two");
    const insitu_status status = scene_convert_meshes(d, path, &out->on);
    if (status || !in->colour_by) return status;
    return scene_convert_colour_by(d, path, in->colour_by, &out->colour_by, &out->colour_map);
}
