/* Reads contour lines on slices, outer surfaces and isosurfaces. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "colour_map.h"
#include "memory.h"
#include "scene_convert.h"

static int compare_values(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static insitu_status check_and_sort_contour_values(const scene_document *d, const char *path,
                                                   const scene_file_lines *in, scene_lines *out)
{
    if (in->values && in->count)
        return scene_fail_at_key(d, path, "count", "given beside values, expected one of the two");
    if (!in->values && !in->count)
        return scene_fail_at_key(d, path, "", "says of no value where lines are, expected values or count");
    for (int i = 0; i < in->values_count; i++)
        for (int j = 0; j < i; j++) {
            char key[32];
            snprintf(key, sizeof key, "values[%d]", i);
            if (in->values[i] == in->values[j])
                return scene_fail_at_key(d, path, key, "%g is there twice, expected each value once", in->values[i]);
        }
    out->count = in->count ? *in->count : in->values_count;
    out->has_values = in->values != NULL;
    if (!in->values) return INSITU_OK;
    memcpy(out->values, in->values, (size_t)in->values_count * sizeof *out->values);
    qsort(out->values, (size_t)out->count, sizeof *out->values, compare_values);
    return INSITU_OK;
}

/* Sets the field of contour lines if the scene gives none: the lines are contours of the field that colours the layer.
 */
static insitu_status set_contour_field_to_colour_field(const scene_document *d, const char *layer, const char *path,
                                                       const scene_file_lines *in, const scene_field *colours,
                                                       scene_lines *out)
{
    if (in->component) return scene_fail_at_key(d, path, "component", "given without field, expected both");
    if (!colours)
        return scene_fail_at_key(d, path, "", "no field colours the layer, expected a field whose lines are drawn");
    out->is_of_colours = true;
    out->field.line = colours->line;
    out->field.component = colours->component;
    out->field.name = base_strdup(colours->name);
    return out->field.name ? scene_convert_mesh_names(d, layer, &out->field) : scene_fail_for_memory(d);
}

float scene_get_default_line_width(int height)
{
    return fmaxf(1.5F, (float)height / 600);
}

insitu_status scene_convert_lines(const scene_document *d, const char *layer, const scene_file_lines *in,
                                  const scene_field *colours, int height, scene_lines *out)
{
    char path[SCENE_PATH_SIZE];
    if (!in) return INSITU_OK;
    snprintf(path, sizeof path, "%s.lines", layer);
    out->is_given = true;
    out->width = in->width ? (float)*in->width : scene_get_default_line_width(height);
    for (int i = 0; i < 3 * SCENE_MAX_LINES; i++)
        out->colours[i] = colour_linear_from_srgb(in->colour ? (float)in->colour[i % 3] : 0.1F);
    out->field.at_vertices = true;
    out->field.joins_corners = colours && colours->joins_corners;
    const insitu_status status = check_and_sort_contour_values(d, path, in, out);
    if (status) return status;
    if (!in->field) return set_contour_field_to_colour_field(d, layer, path, in, colours, out);
    return scene_convert_field(d, layer, path, in->field, in->component, &out->field);
}
