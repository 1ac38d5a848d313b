/* Reads the keys that make several pictures of an image: its sweep's fields, isovalues and planes, and its orbit's
 * views. */
#include <stdio.h>
#include <string.h>

#include "memory.h"
#include "scene_convert.h"

static bool sweeps_over_isovalues(const scene_file_image *in)
{
    return in->sweep && in->sweep->isovalues && *in->sweep->isovalues;
}

static bool sweeps_over_planes(const scene_file_image *in)
{
    return in->sweep && in->sweep->planes && *in->sweep->planes;
}

/* Stores the image's first isosurface in *found, and returns how many isosurfaces the image has. */
static int find_and_count_isosurfaces(const scene_file_image *in, const scene_file_isosurface **found)
{
    int count = 0;
    for (int i = 0; i < in->layers_count; i++)
        if (in->layers[i].isosurface && count++ == 0) *found = in->layers[i].isosurface;
    return count;
}

static int find_and_count_slices(const scene_file_image *in, const scene_file_slice **found)
{
    int count = 0;
    for (int i = 0; i < in->layers_count; i++)
        if (in->layers[i].slice && count++ == 0) *found = in->layers[i].slice;
    return count;
}

static int list_swept_fields(const scene_document *d, const char *path, const char *fields[SCENE_MAX_NAMES])
{
    char fields_path[SCENE_PATH_SIZE];
    snprintf(fields_path, sizeof fields_path, "%s.sweep.fields", path);
    return scene_list_texts_at_path(d, fields_path, fields, SCENE_MAX_NAMES);
}

static insitu_status check_swept_fields(const scene_document *d, const char *path, const char *const *fields, int count)
{
    for (int i = 0; i < count; i++) {
        char key[32];
        snprintf(key, sizeof key, "sweep.fields[%d]", i);
        if (strchr(fields[i], '/'))
            return scene_fail_at_key(d, path, key, "\"%.100s\" holds a /, expected a name without", fields[i]);
        for (int k = 0; k < i; k++)
            if (strcmp(fields[i], fields[k]) == 0)
                return scene_fail_at_key(d, path, key, "\"%.100s\" is there twice, expected another field", fields[i]);
    }
    return INSITU_OK;
}

static insitu_status count_swept_isovalues_and_planes(const scene_document *d, const char *path,
                                                      const scene_file_image *in, scene_series *out)
{
    const scene_file_isosurface *isosurface = NULL;
    const scene_file_slice *slice = NULL;
    const int isosurfaces = find_and_count_isosurfaces(in, &isosurface), slices = find_and_count_slices(in, &slice);
    if (sweeps_over_isovalues(in) && isosurfaces != 1)
        return scene_fail_at_key(d, path, "sweep.isovalues", "the image has %d isosurface layers, expected one",
                                 isosurfaces);
    if (sweeps_over_planes(in) && slices != 1)
        return scene_fail_at_key(d, path, "sweep.planes", "the image has %d slice layers, expected one", slices);
    if (sweeps_over_isovalues(in)) out->isovalues = isosurface->values_count;
    if (sweeps_over_planes(in)) out->planes = scene_count_planes(slice);
    return INSITU_OK;
}

insitu_status scene_count_sweep_dimensions(const scene_document *d, const char *path, const scene_file_image *in,
                                           scene_series *out)
{
    char camera[SCENE_PATH_SIZE];
    const char *fields[SCENE_MAX_NAMES];
    const int field_count = in->sweep ? list_swept_fields(d, path, fields) : 0;
    snprintf(camera, sizeof camera, "%s.camera", path);
    *out = (scene_series){field_count ? field_count : 1, 1, 1, scene_count_orbit_views(d, camera, in->camera)};
    if (!in->sweep) return INSITU_OK;
    if (!sweeps_over_isovalues(in) && !sweeps_over_planes(in) && field_count == 0)
        return scene_fail_at_key(d, path, "sweep",
                                 "holds nothing, expected isovalues: true, planes: true, fields or several");
    const insitu_status status = count_swept_isovalues_and_planes(d, path, in, out);
    return status ? status : check_swept_fields(d, path, fields, field_count);
}

insitu_status scene_count_pictures(const scene_document *d, const scene_file *in, int *count)
{
    int64_t sum = 0;
    for (int i = 0; i < in->images_count; i++) {
        char path[32];
        scene_series s;
        snprintf(path, sizeof path, "images[%d]", i);
        const insitu_status status = scene_count_sweep_dimensions(d, path, &in->images[i], &s);
        if (status) return status;
        sum += (int64_t)s.fields * s.isovalues * s.planes * s.views;
        if (sum > SCENE_MAX_PICTURES)
            return scene_fail_at_key(d, path, "",
                                     "%lld pictures a step up to here, by orbits and sweeps, expected at most %d",
                                     (long long)sum, SCENE_MAX_PICTURES);
    }
    *count = (int)sum;
    return INSITU_OK;
}

/* ---- reducing the layers to what one picture of a sweep shows ---------------------------------------------------- */

static bool replace_field_name(scene_field *field, const char *name, int line)
{
    char *copy = base_strdup(name);
    if (!copy) return false;
    base_free(field->name);
    field->name = copy;
    field->line = line;
    return true;
}

/* Replaces the field that colours a layer. If the layer's contour lines are contours of the same field, they become
 * contour lines of the new field. */
static bool replace_colour_and_contour_field(scene_field *field, scene_lines *lines, const char *name, int line)
{
    return replace_field_name(field, name, line) &&
           (!lines->is_of_colours || replace_field_name(&lines->field, name, line));
}

/* Replaces the field in all layers that are coloured by a field. *count receives the number of these layers. */
static bool replace_field_of_coloured_layers(scene_image *image, const char *name, int line, int *count)
{
    bool is_done = true;
    *count = image->slice_count + image->volume_count;
    for (int i = 0; i < image->slice_count && is_done; i++)
        is_done = replace_colour_and_contour_field(&image->slices[i].field, &image->slices[i].lines, name, line);
    for (int i = 0; i < image->volume_count && is_done; i++)
        is_done = replace_field_name(&image->volumes[i].field, name, line);
    for (int i = 0; i < image->isosurface_count && is_done; i++) {
        if (!image->isosurfaces[i].has_colour_by) continue;
        is_done = replace_colour_and_contour_field(&image->isosurfaces[i].colour_by, &image->isosurfaces[i].lines, name,
                                                   line);
        ++*count;
    }
    for (int i = 0; i < image->surface_count && is_done; i++) {
        if (!image->surfaces[i].has_colour_by) continue;
        is_done =
            replace_colour_and_contour_field(&image->surfaces[i].colour_by, &image->surfaces[i].lines, name, line);
        ++*count;
    }
    return is_done;
}

static void keep_only_isovalue(scene_image *image, int index)
{
    scene_isosurface *layer = &image->isosurfaces[0];
    layer->values[0] = layer->values[index];
    memmove(layer->colours, layer->colours + 3 * (size_t)index, 3 * sizeof *layer->colours);
    layer->value_count = 1;
    image->has_isovalue = true;
    image->isovalue = layer->values[0];
}

static void keep_only_plane(scene_image *image, int index)
{
    scene_slice *layer = &image->slices[0];
    layer->planes[0] = layer->planes[index];
    layer->plane_count = 1;
    image->has_plane = true;
}

insitu_status scene_apply_sweep(const scene_document *d, const char *path, const scene_file_image *in, scene_image *out)
{
    const char *fields[SCENE_MAX_NAMES];
    const int field_count = in->sweep ? list_swept_fields(d, path, fields) : 0;
    if (sweeps_over_isovalues(in)) keep_only_isovalue(out, out->variant.isovalue);
    if (sweeps_over_planes(in)) keep_only_plane(out, out->variant.plane);
    if (field_count == 0) return INSITU_OK;
    char key[SCENE_PATH_SIZE];
    int replaced;
    snprintf(key, sizeof key, "%s.sweep.fields[%d]", path, out->variant.field);
    const char *field = fields[out->variant.field];
    out->swept_field = base_strdup(field);
    if (!out->swept_field ||
        !replace_field_of_coloured_layers(out, field, scene_get_line_number_at_path(d, key), &replaced))
        return scene_fail_for_memory(d);
    if (replaced) return INSITU_OK;
    return scene_fail_at_key(d, path, "sweep.fields",
                             "no layer is coloured by a field, expected a slice, a volume or a colour_by");
}
