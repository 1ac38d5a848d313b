/* Reads the keys that all kinds of layers have: fields and meshes, colours by a field, and materials. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "memory.h"
#include "scene_convert.h"

insitu_status scene_convert_component(const scene_document *d, const char *path, const char *text, int *component)
{
    static const struct {
        const char *word;
        int component;
    } words[] = {{"magnitude", SCENE_COMPONENT_MAGNITUDE}, {"x", 0}, {"y", 1}, {"z", 2}};
    *component = SCENE_COMPONENT_DEFAULT;
    if (!text) return INSITU_OK;
    for (size_t i = 0; i < sizeof words / sizeof *words; i++) {
        if (strcmp(text, words[i].word) == 0) {
            *component = words[i].component;
            return INSITU_OK;
        }
    }
    const size_t digits = strspn(text, "0123456789");
    if (digits == 0 || digits > 3 || text[digits]) {
        return scene_fail_at_key(d, path, "component",
                                 "\"%s\" is not allowed, expected magnitude, x, y, z or a number from 0 to 999", text);
    }
    *component = (int)strtol(text, NULL, 10);
    return INSITU_OK;
}

insitu_status scene_copy_texts(const scene_document *d, const char *path, char ***out, int *out_count)
{
    const char *texts[SCENE_MAX_NAMES];
    const int count = path ? scene_list_texts_at_path(d, path, texts, SCENE_MAX_NAMES) : 0;
    *out = base_calloc((size_t)count, sizeof **out);
    if (!*out) return scene_fail_for_memory(d);
    while (*out_count < count) {
        char *text = base_strdup(texts[*out_count]);
        if (!text) return scene_fail_for_memory(d);
        (*out)[(*out_count)++] = text;
    }
    return INSITU_OK;
}

insitu_status scene_convert_mesh_names(const scene_document *d, const char *layer, scene_field *out)
{
    char path[SCENE_PATH_SIZE + 8];
    snprintf(path, sizeof path, "%s.mesh", layer);
    out->meshes_line = scene_get_line_number_at_path(d, path);
    return scene_copy_texts(d, path, &out->meshes, &out->mesh_count);
}

insitu_status scene_convert_field(const scene_document *d, const char *layer, const char *path, const char *name,
                                  const char *component, scene_field *out)
{
    char field_path[SCENE_PATH_SIZE + 8];
    snprintf(field_path, sizeof field_path, "%s.field", path);
    out->line = scene_get_line_number_at_path(d, field_path);
    out->name = base_strdup(name);
    if (!out->name) return scene_fail_for_memory(d);
    const insitu_status status = scene_convert_mesh_names(d, layer, out);
    return status ? status : scene_convert_component(d, path, component, &out->component);
}

void scene_free_field(scene_field *field)
{
    for (int i = 0; i < field->mesh_count; i++) base_free(field->meshes[i]);
    base_free(field->meshes);
    base_free(field->name);
}

insitu_status scene_convert_colour_by(const scene_document *d, const char *path, const scene_file_colour_by *in,
                                      scene_field *out, scene_colour_map *map)
{
    char colour_by_path[SCENE_PATH_SIZE];
    snprintf(colour_by_path, sizeof colour_by_path, "%s.colour_by", path);
    out->at_vertices = out->joins_corners = in->interpolate && *in->interpolate == SCENE_BY_VERTEX;
    const insitu_status status = scene_convert_colour_map(d, colour_by_path, &in->colours, map);
    return status ? status : scene_convert_field(d, path, colour_by_path, in->field, in->component, out);
}

/* ---- iteration over the fields of an image's layers -------------------------------------------------------------- */

/* Returns the contour lines of a layer; NULL for a volume, because volumes have none. */
static scene_lines *find_contour_lines_of_layer(const scene_image *image, scene_layer_kind kind, int layer)
{
    switch (kind) {
    case SCENE_ISOSURFACE: return &image->isosurfaces[layer].lines;
    case SCENE_SURFACE: return &image->surfaces[layer].lines;
    case SCENE_SLICE: return &image->slices[layer].lines;
    default: return NULL;
    }
}

/* Returns the field that the layer uses in this role (scene_field_role); NULL if it uses none. */
static scene_field *get_field_of_role(const scene_image *image, scene_layer_kind kind, int layer, scene_field_role role)
{
    scene_isosurface *isosurface = kind == SCENE_ISOSURFACE ? &image->isosurfaces[layer] : NULL;
    scene_surface *surface = kind == SCENE_SURFACE ? &image->surfaces[layer] : NULL;
    scene_lines *lines = role == SCENE_LINES ? find_contour_lines_of_layer(image, kind, layer) : NULL;
    if (role == SCENE_LINES) return lines && lines->is_given ? &lines->field : NULL;
    if (role == SCENE_THRESHOLD) return surface && surface->threshold.is_given ? &surface->threshold.field : NULL;
    if (surface) return role == SCENE_COLOURS && surface->has_colour_by ? &surface->colour_by : NULL;
    if (role == SCENE_COLOURS) return isosurface && isosurface->has_colour_by ? &isosurface->colour_by : NULL;
    if (isosurface) return &isosurface->field;
    return kind == SCENE_VOLUME ? &image->volumes[layer].field : &image->slices[layer].field;
}

scene_field *scene_find_next_field_of_layers(scene_field_walk *walk)
{
    enum { KINDS = SCENE_SURFACE + 1, ROLES = SCENE_THRESHOLD + 1 };
    const scene_image *image = walk->image;
    const int counts[KINDS] = {image->isosurface_count, image->volume_count, image->slice_count, image->surface_count};
    for (;;) {
        int layer = walk->position / ROLES, kind = 0;
        while (kind < KINDS && layer >= counts[kind]) layer -= counts[kind++];
        if (kind == KINDS) return NULL;
        walk->kind = (scene_layer_kind)kind;
        walk->role = (scene_field_role)(walk->position++ % ROLES);
        scene_field *field = get_field_of_role(image, walk->kind, layer, walk->role);
        if (field) return field;
    }
}

const char *scene_get_layer_word(scene_layer_kind kind)
{
    static const char *const words[] = {"isosurface", "volume", "slice", "surface"};
    return words[kind];
}

/* ---- materials --------------------------------------------------------------------------------------------------- */

static float get_value_or_default(const double *given, float otherwise)
{
    return given ? (float)*given : otherwise;
}

scene_material scene_convert_material(const scene_file_material *in)
{
    static const scene_file_material none;
    if (!in) in = &none;
    return (scene_material){get_value_or_default(in->ambient, 0.15F), get_value_or_default(in->diffuse, 0.75F),
                            get_value_or_default(in->specular, 0.25F), get_value_or_default(in->shininess, 32)};
}
