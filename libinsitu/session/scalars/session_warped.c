#include "session_warped.h"

#include <string.h>

#include "session_filled.h"
#include "session_hash.h"
#include "session_mesh_input.h"
#include "session_warp.h"

/* The data that is needed to warp the meshes of a step. */
typedef struct warp_step {
    const scene *scene;
    const char *scene_path;
    session_meshes *meshes;
    int threads;
} warp_step;

/* ---- the field of displacements ---------------------------------------------------------------------------------- */

/* Stores an error of the field of displacements. The message begins with the field's position in the scene. */
#define REFUSE(step, warp, error, format, ...)                                                                         \
    base_fail((error), INSITU_ERROR_FIELD, "%s:%d: meshes.%.200s.warp.field: " format, (step)->scene_path,             \
              (warp)->field_line, (warp)->mesh, __VA_ARGS__)

/* Returns whether displacements with only the components x and y are allowed. They are allowed if all cells are shells
 * of one type, or if no z coordinates are given. */
static bool may_displacement_lack_z(const insitu_mesh *mesh)
{
    return session_may_lack_z(mesh) && (!mesh->coordinates[2].data || !mesh->cell_types.data);
}

static insitu_status check_field(const warp_step *step, const scene_warp *warp, const session_mesh *mesh, int index,
                                 base_error *error)
{
    static const char *const centrings[] = {"vertices", "cells", "corners of cells"};
    if (scene_find_derived(step->scene, warp->field) >= 0)
        return REFUSE(step, warp, error,
                      "\"%s\" is derived by the scene, expected a field that the simulation gives mesh \"%s\"",
                      warp->field, mesh->label);
    if (index < 0)
        return REFUSE(step, warp, error, "mesh \"%s\" has no field \"%s\", expected one at its vertices", mesh->label,
                      warp->field);
    const session_field *field = &mesh->fields[index];
    const insitu_field *given = &field->given;
    if (field->problem.status) {
        *error = field->problem;
        return error->status;
    }
    if (given->centring != INSITU_VERTEX)
        return REFUSE(step, warp, error, "field \"%s\" of mesh \"%s\" has values at %s, expected values at vertices",
                      warp->field, mesh->label, centrings[given->centring]);
    const bool has_two = may_displacement_lack_z(&mesh->given);
    if (given->component_count == 3 || (given->component_count == 2 && has_two)) return INSITU_OK;
    return REFUSE(step, warp, error, "field \"%s\" of mesh \"%s\" has %d component%s, expected %s", warp->field,
                  mesh->label, given->component_count, given->component_count == 1 ? "" : "s",
                  has_two ? "2 or 3" : "3");
}

/* Returns a hash of all data that determine the displacements. */
static uint64_t hash_displacement(const scene_warp *warp, const session_field *field)
{
    uint64_t hash = SESSION_HASH_BEGIN;
    session_hash_text(&hash, warp->field);
    session_hash_bytes(&hash, &warp->scale, sizeof warp->scale);
    session_hash_bytes(&hash, &field->version, sizeof field->version);
    return hash;
}

static session_displacement read_displacement(const scene_warp *warp, const session_mesh *mesh, int index)
{
    const session_field *field = &mesh->fields[index];
    const grid_field values = {.values = field->values,
                               .component_stride = field->component_stride,
                               .component_arrays = field->component_arrays,
                               .component_count = field->given.component_count};
    session_displacement out = {.field = index,
                                .key = hash_displacement(warp, field),
                                .component_count = field->given.component_count,
                                .index =
                                    session_index_array(session_get_mesh_of_caller_nodes(mesh), &field->given.index),
                                .count = field->given.count,
                                .scale = warp->scale};
    for (int c = 0; c < out.component_count; c++) out.components[c] = grid_field_component(&values, c);
    return out;
}

/* ---- warping meshes ---------------------------------------------------------------------------------------------- */

/* Moves the vertices by the field. A part without cells may lack the field. If the field has a fill function, it is
 * called on such a part too, because it may be collective. */
static insitu_status warp_by_field(const warp_step *step, const scene_warp *warp, session_mesh *mesh, base_error *error)
{
    const int index = session_find_field(mesh, warp->field);
    const bool has_cells = mesh->given.vertex_count > 0 && mesh->given.cell_count > 0;
    if (!has_cells && index < 0) return INSITU_OK;
    insitu_status status = check_field(step, warp, mesh, index, error);
    if (!status) status = session_fill_field(step->meshes, mesh, index, error);
    if (status || !has_cells) return status;
    mesh->fields[index].is_displacement = true;
    const session_displacement by = read_displacement(warp, mesh, index);
    return session_warp_mesh(step->meshes, mesh, &by, step->threads, error);
}

/* Warps the mesh if the scene requests it. An error is stored with the mesh, and the check of the mesh returns it. */
static void update_warp_of_mesh(const warp_step *step, session_mesh *mesh)
{
    const scene_warp *warp = scene_find_warp(step->scene, mesh->name);
    base_error problem = {.status = INSITU_OK};
    for (int f = 0; f < mesh->field_count; f++) mesh->fields[f].is_displacement = false;
    if (!warp || warp->scale == 0) {
        session_unwarp_mesh(step->meshes, mesh);
        return;
    }
    warp_by_field(step, warp, mesh, &problem);
    mesh->warp.problem = problem;
    if (!problem.status) return;
    mesh->is_check_stale = true;
    step->meshes->are_cells_changed = true;
}

void session_update_warps(const scene *scene, const char *scene_path, session_meshes *meshes, int threads)
{
    const warp_step step = {scene, scene_path, meshes, threads};
    for (int i = 0; i < meshes->count; i++)
        if (meshes->items[i]->is_given && !meshes->items[i]->source) update_warp_of_mesh(&step, meshes->items[i]);
}

/* ---- warnings ---------------------------------------------------------------------------------------------------- */

void session_warn_of_absent_mesh(const char *name, int line, session_transform transform,
                                 const session_catalogue *catalogue, session_report *report)
{
    bool is_any = false;
    for (int m = 0; m < catalogue->mesh_count; m++)
        is_any = is_any || scene_name_selects_mesh(name, catalogue->meshes[m].name);
    session_warn(report, &(session_warning){WARNING_MESH, NULL, name, (int)transform}, !is_any,
                 "meshes.%s (line %d of the scene): no mesh has this name: nothing is %s", name, line,
                 transform == SESSION_WARP ? "warped" : "mirrored");
}

/* Warns of the first derived field on the mesh that depends on gradients. */
static void warn_of_gradients(const scene *scene, const session_catalogue_mesh *mesh, session_report *report)
{
    const scene_warp *warp = scene_find_warp(scene, mesh->name);
    const char *name = NULL;
    for (int f = 0; f < mesh->field_count && !name && warp && warp->scale != 0; f++) {
        const int derived = mesh->fields[f].derived_index;
        if (derived >= 0 && scene->derived[derived].kind != SCENE_EXPRESSION) name = mesh->fields[f].name;
    }
    session_warn(report, &(session_warning){WARNING_WARP, NULL, mesh->name, 0}, name != NULL,
                 "mesh \"%s\": gradients, as in the derived field \"%s\", are those of the warped mesh", mesh->name,
                 name ? name : "");
}

void session_check_warps(const scene *scene, const session_catalogue *catalogue, session_report *report)
{
    for (int i = 0; i < scene->warp_count; i++)
        session_warn_of_absent_mesh(scene->warps[i].mesh, scene->warps[i].line, SESSION_WARP, catalogue, report);
    for (int m = 0; m < catalogue->mesh_count && scene->warp_count; m++)
        warn_of_gradients(scene, &catalogue->meshes[m], report);
}
