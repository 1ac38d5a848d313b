#include "session_shells.h"

#include <string.h>

bool session_has_shells(const session_catalogue *catalogue)
{
    for (int m = 0; m < catalogue->mesh_count; m++)
        if (catalogue->meshes[m].has_shells_alone) return true;
    return false;
}

/* Copies the isovalues and their colours, sorted by value. */
static void copy_isovalues(const scene_isosurface *layer, scene_lines *out)
{
    for (int i = 0; i < layer->value_count; i++) {
        int at = out->count++;
        for (; at > 0 && out->values[at - 1] > layer->values[i]; at--) {
            out->values[at] = out->values[at - 1];
            memcpy(out->colours + 3 * at, out->colours + 3 * (at - 1), 3 * sizeof *out->colours);
        }
        out->values[at] = layer->values[i];
        memcpy(out->colours + 3 * at, layer->colours + 3 * i, 3 * sizeof *out->colours);
    }
}

/* The largest float below 1. With an opacity below 1, a pixel that a line covers only in part also shows the
 * background. */
static const float nearly_opaque = 0.99999994F;

scene_surface session_make_shell_layer(const scene_isosurface *layer, int height)
{
    scene_surface out = {.meshes_field = layer->field,
                         .is_of_shells = true,
                         .has_colour_by = layer->has_colour_by,
                         .colour_by = layer->colour_by,
                         .colour_map = layer->colour_map,
                         .opacity = layer->opacity < nearly_opaque ? layer->opacity : nearly_opaque,
                         .has_material = true,
                         .material = {.ambient = 1},
                         .clips = layer->clips,
                         .number = layer->number};
    out.lines = (scene_lines){.is_given = true,
                              .field = layer->field,
                              .has_values = true,
                              .is_alone = true,
                              .width = scene_get_default_line_width(height)};
    copy_isovalues(layer, &out.lines);
    return out;
}

bool session_is_surface_on_mesh(const scene_surface *layer, const session_mesh *mesh)
{
    return scene_field_selects_mesh(&layer->meshes_field, mesh->name) &&
           (!layer->is_of_shells || mesh->has_shells_alone);
}
