#include "session_discontinuous.h"

#include <string.h>

#include "memory.h"
#include "region.h"
#include "session_agree.h"
#include "session_cell_order.h"
#include "session_field_input.h"
#include "session_split.h"
#include "session_topology.h"

/* ---- meshes with fields at corners --------------------------------------------------------------------------- */

static const session_catalogue_mesh *find_mesh_of_all_ranks(const session_catalogue *catalogue, const char *name)
{
    for (int m = 0; m < catalogue->mesh_count; m++)
        if (strcmp(catalogue->meshes[m].name, name) == 0) return &catalogue->meshes[m];
    return NULL;
}

/* Returns whether the mesh has the field with values at corners, and no rank has found an error in the field. */
static bool is_field_at_corners(const session_mesh *mesh, const session_catalogue *catalogue, const scene_field *field)
{
    if (!scene_field_selects_mesh(field, mesh->name)) return false;
    const int index = session_find_field(mesh, field->name);
    if (index < 0 || mesh->fields[index].given.centring != INSITU_CORNER) return false;
    const session_catalogue_mesh *whole = find_mesh_of_all_ranks(catalogue, mesh->name);
    const session_catalogue_field *known = whole ? session_catalogue_find_field(whole, field->name) : NULL;
    return known && !known->fault && !mesh->fields[index].problem.status;
}

static bool is_corner_field_used_by_image(const session_mesh *mesh, const session_catalogue *catalogue,
                                          const scene_image *image)
{
    scene_field_walk walk = {.image = image};
    bool is_in = image->condition.is_given && is_field_at_corners(mesh, catalogue, &image->condition.field);
    for (const scene_field *field; !is_in && (field = scene_find_next_field_of_layers(&walk)) != NULL;)
        is_in = is_field_at_corners(mesh, catalogue, field);
    return is_in;
}

static bool is_corner_field_used_by_scene(const session_mesh *mesh, const session_catalogue *catalogue,
                                          const scene *scene)
{
    bool is_in = false;
    for (int i = 0; i < scene->statistics_count; i++)
        is_in = is_in || is_field_at_corners(mesh, catalogue, &scene->statistics[i].field);
    for (int i = 0; i < scene->derived_count; i++)
        for (int k = 0; k < scene->derived[i].input_count; k++)
            is_in = is_in || is_field_at_corners(mesh, catalogue, &scene->derived[i].inputs[k]);
    for (int i = 0; i < scene->image_count && !is_in; i++)
        is_in = is_corner_field_used_by_image(mesh, catalogue, &scene->images[i]);
    return is_in;
}

/* ---- making one mesh discontinuous ---------------------------------------------------------------------------- */

static int64_t find_shared_vertex_of_corner(const session_discontinuous *vertices, const insitu_mesh *given,
                                            int64_t corner)
{
    if (vertices->are_corners_entries)
        return grid_read_index(&vertices->shared_connectivity, session_find_connectivity_index(given, corner));
    return grid_read_index(&vertices->shared_connectivity, grid_read_index(&vertices->corners, corner));
}

int64_t session_vertex_of_corner(const session_mesh *mesh, int64_t corner)
{
    return find_shared_vertex_of_corner(&mesh->discontinuous, &mesh->given, corner);
}

static insitu_status refuse_polyhedra(const session_mesh *mesh, base_error *error)
{
    const bool is_mixed = mesh->given.cell_types.data && !mesh->topology.is_split;
    for (int64_t cell = 0; is_mixed && cell < mesh->given.cell_count; cell++)
        if (session_caller_type(mesh, cell) == GRID_POLYHEDRON)
            return base_fail(error, INSITU_ERROR_FIELD,
                             "mesh \"%s\": a field has values at corners, and cell %lld is a polyhedron, whose corners "
                             "have no order",
                             mesh->label, (long long)cell);
    return INSITU_OK;
}

/* Copies the vertex positions to all corners, packed and without changing their type. Entries of the connectivity that
 * belong to no cell may be invalid indices; they get the first vertex's position. */
static bool copy_coordinates(const session_mesh *mesh, int threads, session_discontinuous *vertices)
{
    const grid *shared = &mesh->cells;
    for (int axis = 0; axis < 3; axis++) {
        const grid_array from = shared->coordinates[axis];
        const size_t size = from.is_wide ? 8 : 4;
        char *to = base_alloc((size_t)(vertices->corner_count + 1) * size);
        if (!to) return false;
        vertices->coordinates[axis] = (grid_array){.data = to, .stride = (int64_t)size, .is_wide = from.is_wide};
        vertices->bytes += vertices->corner_count * (int64_t)size;
#pragma omp parallel num_threads(threads)
        {
            region_enter();
#pragma omp for schedule(static) nowait
            for (int64_t corner = 0; corner < vertices->corner_count; corner++) {
                const int64_t vertex = find_shared_vertex_of_corner(vertices, &mesh->given, corner);
                const bool is_vertex = vertex >= 0 && vertex < shared->vertex_count;
                memcpy(to + corner * (int64_t)size, from.data + (is_vertex ? vertex : 0) * from.stride, size);
            }
            region_leave();
        }
    }
    return true;
}

/* Creates the connectivity of the discontinuous mesh, in which each corner of a cell is a vertex. */
static insitu_status make_discontinuous_connectivity(const session_mesh *mesh, int threads,
                                                     session_discontinuous *vertices, base_error *error)
{
    vertices->are_corners_entries = mesh->topology.is_split;
    vertices->shared_connectivity = vertices->are_corners_entries
                                        ? session_index_array(&mesh->given, &mesh->given.connectivity)
                                        : mesh->cells.connectivity;
    if (vertices->are_corners_entries) {
        vertices->bytes = mesh->topology.connectivity_count * mesh->topology.connectivity.stride;
        return session_make_entry_connectivity(mesh, threads, &vertices->corners, error);
    }
    if (!session_allocate_indices(mesh, "cells' corners", vertices->corner_count, vertices->corner_count,
                                  &vertices->corners, error))
        return error->status;
    for (int64_t i = 0; i < vertices->corner_count; i++) session_store_index(&vertices->corners, i, i);
    session_permute_corners_of_cells(mesh, vertices->corner_count, threads, &vertices->corners);
    vertices->bytes = vertices->corner_count * vertices->corners.stride;
    return INSITU_OK;
}

static insitu_status make_discontinuous(session_mesh *mesh, int threads, base_error *error)
{
    session_discontinuous vertices = {.is_active = true, .corner_count = session_count_corners(&mesh->given)};
    insitu_status status = make_discontinuous_connectivity(mesh, threads, &vertices, error);
    if (status) return status;
    vertices.is_made = copy_coordinates(mesh, threads, &vertices);
    if (!vertices.is_made) {
        session_drop_discontinuous(&vertices);
        return session_fail_for_memory(error, session_count_corners(&mesh->given) * 24, "corners' coordinates");
    }
    session_drop_discontinuous(&mesh->discontinuous);
    mesh->discontinuous = vertices;
    session_select_grid_arrays(mesh);
    return INSITU_OK;
}

/* Drops all data that was computed for the previous vertices: outer faces, scalars, the tree and copies of values. */
static void drop_vertex_data(session_meshes *meshes, session_mesh *mesh)
{
    mesh->cells_stamp = mesh->coordinates_stamp = ++meshes->stamp;
    session_drop_outer_surfaces(mesh, true);
    session_drop_scalars(mesh);
    session_drop_tree(mesh);
    for (int i = 0; i < mesh->field_count; i++) session_drop_copy(&mesh->fields[i]);
}

static insitu_status update_discontinuous_mesh(session_meshes *meshes, session_mesh *mesh, bool is_discontinuous,
                                               int threads, base_error *error)
{
    const bool was_discontinuous = mesh->discontinuous.is_active;
    if (!is_discontinuous && was_discontinuous) {
        session_drop_discontinuous(&mesh->discontinuous);
        session_select_grid_arrays(mesh);
    }
    if (is_discontinuous != was_discontinuous) drop_vertex_data(meshes, mesh);
    return is_discontinuous && !mesh->discontinuous.is_made ? make_discontinuous(mesh, threads, error) : INSITU_OK;
}

static void store_problem_with_corner_fields(session_mesh *mesh, const base_error *problem, base_error *first)
{
    for (int f = 0; f < mesh->field_count; f++)
        if (mesh->fields[f].given.centring == INSITU_CORNER && !mesh->fields[f].problem.status)
            session_store_problem(&mesh->fields[f], problem, first);
}

/* ---- making meshes discontinuous ------------------------------------------------------------------------------- */

static bool has_any_corner_field(const session_catalogue *catalogue)
{
    for (int m = 0; m < catalogue->mesh_count; m++)
        for (int f = 0; f < catalogue->meshes[m].field_count; f++)
            if (catalogue->meshes[m].fields[f].centring == INSITU_CORNER) return true;
    return false;
}

/* If cells of higher order are evaluated at additional nodes (finer.parts), cells do not share nodes, and the mesh need
 * not be made discontinuous. */
static bool is_made_discontinuous(const session_mesh *mesh, const session_catalogue *catalogue, const scene *scene)
{
    return !mesh->finer.parts && is_corner_field_used_by_scene(mesh, catalogue, scene);
}

static void refuse_meshes_without_order(const session_meshes *meshes, const session_catalogue *catalogue,
                                        const scene *scene, base_error *error)
{
    for (int m = 0; m < meshes->count; m++) {
        session_mesh *mesh = meshes->items[m];
        base_error own = {.status = INSITU_OK};
        if (mesh->is_given && !mesh->discontinuous.is_made && is_made_discontinuous(mesh, catalogue, scene) &&
            refuse_polyhedra(mesh, &own))
            store_problem_with_corner_fields(mesh, &own, error);
    }
}

insitu_status session_make_discontinuous(session_meshes *meshes, const session_catalogue *catalogue, const scene *scene,
                                         const session_team *team, base_error *error)
{
    const bool has_any = has_any_corner_field(catalogue);
    /* Ranks agree before any of them changes a mesh. Otherwise a mesh that is refused in every step would be made
     * discontinuous and changed back in every step, and all data of its vertices would be computed again. */
    refuse_meshes_without_order(meshes, catalogue, scene, error);
    const insitu_status status = has_any ? session_agree(team->comm, error) : INSITU_OK;
    if (status) return status;
    for (int m = 0; m < meshes->count; m++) {
        session_mesh *mesh = meshes->items[m];
        base_error own = {.status = INSITU_OK};
        if (mesh->is_given)
            update_discontinuous_mesh(meshes, mesh, is_made_discontinuous(mesh, catalogue, scene), team->threads, &own);
        if (!error->status) *error = own;
    }
    return has_any ? session_agree(team->comm, error) : INSITU_OK;
}
