/* Isosurfaces are compared as the scene writes them: one that is the same by other words ("0" of a field of one
 * component) is drawn as if it were another, which costs time alone. Whether a mesh's arrays can be stored the
 * renderer decides, at no cost. */
#include "session_active_cells.h"

#include <string.h>

/* Filling costs up to a third of a frame, of which one that follows may save less (docs/decisions/find.md). */
enum { LEAST_FRAMES = 3 };

/* As the renderer has it (render.h). */
static bool can_be_stored(const scene_isosurface *layer)
{
    return layer->opacity >= 1 && !layer->has_colour_by && layer->normals == SCENE_GRADIENT;
}

static bool are_same_meshes(const scene_field *a, const scene_field *b)
{
    bool is_same = a->mesh_count == b->mesh_count;
    for (int i = 0; i < a->mesh_count && is_same; i++) is_same = strcmp(a->meshes[i], b->meshes[i]) == 0;
    return is_same;
}

static bool is_same(const scene_isosurface *a, const scene_isosurface *b)
{
    return are_same_meshes(&a->field, &b->field) && strcmp(a->field.name, b->field.name) == 0 &&
           a->field.component == b->field.component && a->roots == b->roots && a->value_count == b->value_count &&
           memcmp(a->values, b->values, (size_t)a->value_count * sizeof *a->values) == 0;
}

static bool has_same(const scene_image *image, const scene_isosurface *layer)
{
    for (int i = 0; i < image->isosurface_count; i++)
        if (can_be_stored(&image->isosurfaces[i]) && is_same(&image->isosurfaces[i], layer)) return true;
    return false;
}

bool session_active_cells_pay(const session_plan *plan, const scene_image *image)
{
    for (int i = 0; i < image->isosurface_count; i++) {
        int64_t frames = 0;
        if (!can_be_stored(&image->isosurfaces[i])) continue;
        for (int n = 0; n < plan->image_count; n++)
            if (has_same(plan->images[n], &image->isosurfaces[i])) frames += plan->images[n]->frames;
        if (frames >= LEAST_FRAMES) return true;
    }
    return false;
}
