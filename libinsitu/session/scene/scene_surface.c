/* Reads the surface layers of an image: their edges, thresholds, colours and contour lines. */
#include <math.h>
#include <stdio.h>

#include "colour_map.h"
#include "scene_convert.h"

static void convert_edge_style(const scene_file_edges *in, int height, scene_surface *out)
{
    if (!in) return;
    out->edge_width = in->width ? (float)*in->width : fmaxf(1, (float)height / 900);
    for (int c = 0; c < 3; c++) out->edge_colour[c] = colour_linear_from_srgb(in->colour ? (float)in->colour[c] : 0.1F);
}

static insitu_status convert_threshold(const scene_document *d, const char *layer, const scene_file_threshold *in,
                                       scene_threshold *out)
{
    char path[SCENE_PATH_SIZE];
    if (!in) return INSITU_OK;
    snprintf(path, sizeof path, "%s.threshold", layer);
    out->is_given = out->field.is_as_given = true;
    out->low = in->from ? *in->from : -(double)INFINITY;
    out->high = in->to ? *in->to : (double)INFINITY;
    if (!in->from && !in->to) return scene_fail_at_key(d, path, "", "has no bounds, expected from, to or both");
    if (out->low > out->high)
        return scene_fail_at_key(d, path, "to", "is %g, expected no less than from, which is %g", out->high, out->low);
    return scene_convert_field(d, layer, path, in->field, in->component, &out->field);
}

insitu_status scene_convert_surface(const scene_document *d, const char *path, const scene_file_surface *in, int height,
                                    scene_surface *out)
{
    convert_edge_style(in->edges, height, out);
    out->opacity = in->opacity ? (float)*in->opacity : 1;
    out->has_material = in->material != NULL;
    out->material = scene_convert_material(in->material);
    out->has_colour_by = in->colour_by != NULL;
    for (int c = 0; c < 3; c++) out->colour[c] = colour_linear_from_srgb(in->colour ? (float)in->colour[c] : 0.8F);
    if (in->colour && in->colour_by)
        return scene_fail_at_key(d, path, "colour", "given beside colour_by, expected one of the two");
    insitu_status status = scene_convert_mesh_names(d, path, &out->meshes_field);
    if (!status) status = convert_threshold(d, path, in->threshold, &out->threshold);
    if (!status && in->colour_by)
        status = scene_convert_colour_by(d, path, in->colour_by, &out->colour_by, &out->colour_map);
    if (status) return status;
    return scene_convert_lines(d, path, in->lines, in->colour_by ? &out->colour_by : NULL, height, &out->lines);
}
