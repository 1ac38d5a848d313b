/* Reads the layers of an image. Slices and outer surfaces are read in scene_slice.c and scene_surface.c. */
#include "scene_convert.h"

#include <stdio.h>
#include <string.h>

#include "colour_map.h"
#include "memory.h"

enum { cycle_length = 16 };

/* The default cycle of colours. Consecutive colours differ in both hue and lightness. Viewers who cannot distinguish
 * red from green can still distinguish the first colours. */
static const float cycle[cycle_length][3] = {
    {0.25F, 0.55F, 0.85F}, {0.95F, 0.65F, 0.20F}, {0.20F, 0.65F, 0.50F}, {0.85F, 0.35F, 0.25F},
    {0.95F, 0.88F, 0.35F}, {0.60F, 0.45F, 0.80F}, {0.55F, 0.80F, 0.95F}, {0.88F, 0.55F, 0.75F},
    {0.55F, 0.40F, 0.30F}, {0.65F, 0.85F, 0.45F}, {0.25F, 0.35F, 0.60F}, {0.95F, 0.78F, 0.65F},
    {0.15F, 0.50F, 0.30F}, {0.75F, 0.70F, 0.85F}, {0.60F, 0.20F, 0.40F}, {0.75F, 0.75F, 0.75F}};

static insitu_status check_and_store_isovalues(const scene_document *d, const char *path,
                                               const scene_file_isosurface *in, scene_isosurface *out)
{
    for (int i = 0; i < in->values_count; i++) {
        for (int j = 0; j < i; j++) {
            if (in->values[i] != in->values[j]) continue;
            char key[32];
            snprintf(key, sizeof key, "values[%d]", i);
            return scene_fail_at_key(d, path, key, "%g is there twice, expected each value once", in->values[i]);
        }
    }
    out->values = base_alloc((size_t)in->values_count * sizeof *out->values);
    if (!out->values) return scene_fail_for_memory(d);
    memcpy(out->values, in->values, (size_t)in->values_count * sizeof *out->values);
    out->value_count = in->values_count;
    return INSITU_OK;
}

/* Converts the colours of an isosurface layer. first: number of isovalues of earlier layers. Default colours continue
 * the cycle after this number, so that layers have different colours. */
static insitu_status convert_isosurface_colours(const scene_document *d, const char *path,
                                                const scene_file_isosurface *in, int first, scene_isosurface *out)
{
    if (in->colours && in->colour_by) {
        return scene_fail_at_key(d, path, "colours", "given beside colour_by, expected one of the two");
    }
    if (in->colours_count > in->values_count) {
        return scene_fail_at_key(d, path, "colours", "%d colours for %d values, expected no more than values",
                                 in->colours_count, in->values_count);
    }
    out->colours = base_alloc((size_t)in->values_count * 3 * sizeof *out->colours);
    if (!out->colours) return scene_fail_for_memory(d);
    for (int i = 0; i < in->values_count; i++) {
        const int given = i < in->colours_count ? i : in->colours_count - 1;
        for (int c = 0; c < 3; c++) {
            const float srgb = in->colours ? (float)in->colours[given][c] : cycle[(first + i) % cycle_length][c];
            out->colours[3 * i + c] = colour_linear_from_srgb(srgb);
        }
    }
    return INSITU_OK;
}

static insitu_status convert_isosurface(const scene_document *d, const char *path, const scene_file_isosurface *in,
                                        int first_value, int height, scene_isosurface *out)
{
    out->opacity = in->opacity ? (float)*in->opacity : 1;
    out->material = scene_convert_material(in->material);
    out->normals = in->normals ? (scene_normal)*in->normals : SCENE_GRADIENT;
    out->difference = in->difference ? *in->difference : 1;
    out->field.at_vertices = true;
    out->field.joins_corners = in->interpolate && *in->interpolate == SCENE_BY_VERTEX;
    if (in->interpolate && *in->interpolate == SCENE_BY_CELL)
        return scene_fail_at_key(
            d, path, "interpolate",
            "cell is not allowed, expected vertex: values that are the same throughout a cell have no "
            "surface in it");
    insitu_status status = scene_convert_field(d, path, path, in->field, in->component, &out->field);
    if (status == INSITU_OK) status = check_and_store_isovalues(d, path, in, out);
    if (status == INSITU_OK) status = convert_isosurface_colours(d, path, in, first_value, out);
    out->has_colour_by = in->colour_by != NULL;
    if (status == INSITU_OK && in->colour_by)
        status = scene_convert_colour_by(d, path, in->colour_by, &out->colour_by, &out->colour_map);
    if (status) return status;
    return scene_convert_lines(d, path, in->lines, in->colour_by ? &out->colour_by : NULL, height, &out->lines);
}

static insitu_status convert_opacity_points(const scene_document *d, const char *path, const scene_file_volume *in,
                                            scene_volume *out)
{
    static const double ramp[2][2] = {{0, 0}, {1, 0.9}};
    const int count = in->opacity ? in->opacity_count : 2;
    const double(*points)[2] = in->opacity ? (const double(*)[2])in->opacity : ramp;
    out->opacity = base_alloc((size_t)count * sizeof *out->opacity);
    if (!out->opacity) return scene_fail_for_memory(d);
    out->opacity_count = count;
    for (int i = 0; i < count; i++) {
        char key[32];
        snprintf(key, sizeof key, "opacity[%d]", i);
        if (i > 0 && points[i][0] < points[i - 1][0]) {
            return scene_fail_at_key(d, path, key, "%g comes after %g, expected points that do not fall", points[i][0],
                                     points[i - 1][0]);
        }
        if (i > 1 && points[i][0] == points[i - 2][0]) {
            return scene_fail_at_key(d, path, key, "%g is there three times, expected at most two points at a place",
                                     points[i][0]);
        }
        out->opacity[i] = (scene_opacity_point){points[i][0], (float)points[i][1]};
    }
    return INSITU_OK;
}

static insitu_status convert_volume(const scene_document *d, const char *path, const scene_file_volume *in,
                                    scene_volume *out)
{
    out->unit_distance = in->unit_distance ? *in->unit_distance : 0;
    out->field.at_vertices = out->field.joins_corners = in->interpolate && *in->interpolate == SCENE_BY_VERTEX;
    insitu_status status = scene_convert_field(d, path, path, in->field, in->component, &out->field);
    if (status == INSITU_OK) status = scene_convert_colour_map(d, path, &in->colours, &out->colour_map);
    if (status == INSITU_OK) status = convert_opacity_points(d, path, in, out);
    return status;
}

typedef struct layer_counts {
    int isosurfaces, volumes, slices, surfaces;
    int values; /* number of isovalues, planes and outer surfaces, counted together */
} layer_counts;

static insitu_status check_and_count_layer(const scene_document *d, const char *path, const char *key,
                                           const scene_file_layer *layer, layer_counts *counts)
{
    const int kinds = !!layer->isosurface + !!layer->volume + !!layer->slice + !!layer->surface;
    if (kinds != 1)
        return scene_fail_at_key(d, path, key, "holds %s, expected one of isosurface, volume, slice and surface",
                                 kinds ? "more than one layer" : "nothing");
    counts->isosurfaces += layer->isosurface != NULL;
    counts->volumes += layer->volume != NULL;
    counts->slices += layer->slice != NULL;
    counts->surfaces += layer->surface != NULL;
    counts->values += layer->isosurface ? layer->isosurface->values_count : 0;
    counts->values += layer->slice ? scene_count_planes(layer->slice) : layer->surface != NULL;
    if (counts->values > SCENE_MAX_SURFACES)
        return scene_fail_at_key(
            d, path, key, "%d isovalues%s up to here, expected at most %d in an image", counts->values,
            counts->slices || counts->surfaces ? ", planes and outer surfaces" : "", SCENE_MAX_SURFACES);
    if (counts->volumes > SCENE_MAX_VOLUMES)
        return scene_fail_at_key(d, path, key, "%d volumes up to here, expected at most %d in an image",
                                 counts->volumes, SCENE_MAX_VOLUMES);
    return INSITU_OK;
}

/* Counts the layers of an image, and checks that they do not exceed their maximum numbers, before any layer is
 * converted. */
static insitu_status count_layers(const scene_document *d, const char *path, const scene_file_image *in,
                                  layer_counts *counts)
{
    insitu_status status = INSITU_OK;
    *counts = (layer_counts){0};
    for (int i = 0; i < in->layers_count && !status; i++) {
        char key[32];
        snprintf(key, sizeof key, "layers[%d]", i);
        status = check_and_count_layer(d, path, key, &in->layers[i], counts);
    }
    return status;
}

static const char *get_layer_kind_name(const scene_file_layer *layer)
{
    return layer->volume ? "volume" : layer->slice ? "slice" : layer->surface ? "surface" : "isosurface";
}

/* Converts the clips of a layer. The layer must be the most recently converted one among the image's layers of its type
 * (isosurface, volume, slice or surface). */
static insitu_status convert_layer_clip(const scene_document *d, const char *path, const scene_file_layer *in,
                                        scene_image *out)
{
    scene_volume *volume = in->volume ? &out->volumes[out->volume_count - 1] : NULL;
    if (in->slice)
        return scene_convert_layer_clip(d, path, in->slice->clip, out, &out->slices[out->slice_count - 1].clips);
    if (in->surface)
        return scene_convert_layer_clip(d, path, in->surface->clip, out, &out->surfaces[out->surface_count - 1].clips);
    if (!volume)
        return scene_convert_layer_clip(d, path, in->isosurface->clip, out,
                                        &out->isosurfaces[out->isosurface_count - 1].clips);
    const insitu_status status = scene_convert_layer_clip(d, path, in->volume->clip, out, &volume->clips);
    if (status || volume->clips == out->volumes[0].clips) return status;
    return scene_fail_at_key(d, path, in->volume->clip ? "clip" : "",
                             "the first volume is clipped differently, expected one clip for all volumes of an image");
}

/* Stores the index of a layer in the image's list of layers. The layer must be the most recently converted one among
 * the image's layers of its type (isosurface, volume, slice or surface). */
static void set_layer_index(const scene_file_layer *in, int number, scene_image *out)
{
    if (in->isosurface) out->isosurfaces[out->isosurface_count - 1].number = number;
    if (in->surface) out->surfaces[out->surface_count - 1].number = number;
    if (in->slice) out->slices[out->slice_count - 1].number = number;
}

/* Converts a layer. values: number of isovalues of earlier isosurface layers. */
static insitu_status convert_layer(const scene_document *d, const char *path, const scene_file_layer *in, int values,
                                   scene_image *out)
{
    if (in->volume) return convert_volume(d, path, in->volume, &out->volumes[out->volume_count++]);
    if (in->slice) return scene_convert_slice(d, path, in->slice, out->height, &out->slices[out->slice_count++]);
    if (in->surface)
        return scene_convert_surface(d, path, in->surface, out->height, &out->surfaces[out->surface_count++]);
    return convert_isosurface(d, path, in->isosurface, values, out->height, &out->isosurfaces[out->isosurface_count++]);
}

insitu_status scene_convert_layers(const scene_document *d, const char *path, const scene_file_image *in,
                                   scene_image *out)
{
    int values = 0;
    layer_counts counts;
    insitu_status status = count_layers(d, path, in, &counts);
    if (status != INSITU_OK) return status;
    out->isosurfaces = base_calloc((size_t)counts.isosurfaces, sizeof *out->isosurfaces);
    out->volumes = base_calloc((size_t)counts.volumes, sizeof *out->volumes);
    out->slices = base_calloc((size_t)counts.slices, sizeof *out->slices);
    out->surfaces = base_calloc((size_t)counts.surfaces, sizeof *out->surfaces);
    if (!out->isosurfaces || !out->volumes || !out->slices || !out->surfaces) return scene_fail_for_memory(d);
    for (int i = 0; i < in->layers_count && status == INSITU_OK; i++) {
        const scene_file_layer *layer = &in->layers[i];
        /* shorter than SCENE_PATH_SIZE, so that keys of the layer can be appended */
        char layer_path[SCENE_PATH_SIZE - 16];
        snprintf(layer_path, sizeof layer_path, "%s.layers[%d].%s", path, i, get_layer_kind_name(layer));
        status = convert_layer(d, layer_path, layer, values, out);
        if (!status) status = convert_layer_clip(d, layer_path, layer, out);
        if (!status) set_layer_index(layer, i, out);
        values += layer->isosurface ? layer->isosurface->values_count : 0;
    }
    return status;
}
