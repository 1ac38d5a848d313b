/* Moved coordinates have the type of the caller's coordinates, except if a lattice has coordinates along its axes: then
 * the moved coordinates are stored by vertex, in double. A coordinate is computed as x + scale * u in double and
 * rounded once, so that vertices of different blocks and ranks remain equal if their positions and displacements are
 * equal. New coordinates are compared with the old ones, so that the mesh is not marked as moved if the caller has set
 * the field again with the same values. */
#include "session_warp.h"

#include <string.h>

#include "session_agree.h"
#include "session_conform.h"
#include "session_finer.h"
#include "session_lattice.h"
#include "session_own_coordinates.h"
#include "session_region.h"
#include "session_topology.h"

void session_use_moved_coordinates(session_mesh *mesh)
{
    session_warp *warp = &mesh->warp;
    insitu_mesh *nodal = mesh->finer.parts ? &mesh->finer.nodal : &mesh->given;
    for (int axis = 0; axis < 3; axis++) {
        warp->unmoved[axis] = nodal->coordinates[axis];
        if (warp->coordinates[axis].data) nodal->coordinates[axis] = warp->coordinates[axis];
    }
    if (!mesh->given.lattice) return;
    warp->lattice = *mesh->given.lattice;
    for (int axis = 0; axis < 3; axis++) {
        warp->lattice.origin[axis] = warp->lattice.spacing[axis] = 0;
        warp->lattice.axes[axis] = (insitu_array){0};
    }
    mesh->given.lattice = &warp->lattice;
}

/* Makes the description refer to the caller's coordinates again. */
static void restore_coordinates(session_mesh *mesh)
{
    if (!mesh->warp.is_applied) return;
    memcpy(mesh->given.coordinates, mesh->warp.unmoved, sizeof mesh->given.coordinates);
    if (mesh->given.lattice) mesh->given.lattice = &mesh->lattice.given;
    mesh->warp.is_applied = false;
    session_select_grid_arrays(mesh);
}

static void mark_moved(session_meshes *meshes, session_mesh *mesh)
{
    if (mesh->topology.depends_on_coordinates) session_drop_cell_data(meshes, mesh);
    session_mark_moved(meshes, mesh);
}

void session_unwarp_mesh(session_meshes *meshes, session_mesh *mesh)
{
    const bool was_on = mesh->warp.is_applied;
    /* The check of the mesh has stored this problem as the mesh's error, which is removed only if the check runs
     * again. */
    if (mesh->warp.problem.status) {
        mesh->is_check_stale = true;
        meshes->are_cells_changed = true;
    }
    if (was_on) session_free_finer_lattices_of_mesh(meshes, mesh);
    restore_coordinates(mesh);
    session_drop_moved_coordinates(mesh);
    if (was_on) {
        mark_moved(meshes, mesh);
        session_select_grid_arrays(mesh);
    }
}

/* ---- moving the vertices ----------------------------------------------------------------------------------------- */

/* Returns the type of the moved coordinates along an axis. If the caller gives no z coordinates, the moved ones get the
 * type of the x coordinates. */
static insitu_type choose_type_of_moved_coordinates(const insitu_mesh *given, int axis)
{
    if (session_has_axis_coordinates(given)) return INSITU_FLOAT64;
    return given->coordinates[given->coordinates[axis].data ? axis : 0].type;
}

/* Ensures that there is memory for the moved coordinates. *is_new is set if memory was allocated. Returns false if
 * memory runs out. Coordinates along z get no memory if they are not given and do not move. */
static bool reserve_coordinates(session_mesh *mesh, int component_count, bool *is_new)
{
    enum { IN_PLANE = 3, ALL = 7 };
    const insitu_mesh *given = &mesh->given;
    const bool has_z = component_count == 3 || given->coordinates[2].data || session_has_axis_coordinates(given);
    const insitu_type types[3] = {choose_type_of_moved_coordinates(given, 0),
                                  choose_type_of_moved_coordinates(given, 1),
                                  choose_type_of_moved_coordinates(given, 2)};
    session_warp *warp = &mesh->warp;
    return session_reserve_coordinates(&warp->coordinate_memory, warp->coordinates, given->vertex_count,
                                       has_z ? ALL : IN_PLANE, types, &warp->bytes, is_new);
}

/* The arrays of coordinates along one axis before and after vertices are moved. */
typedef struct moved_axis {
    grid_array from;
    /* displacements along the axis, one per tuple of the field; without data, vertices do not move along the axis */
    grid_array by;
    const insitu_array *to; /* receives the moved coordinates; NULL: coordinates along this axis are not stored */
} moved_axis;

/* Stores a vertex's moved coordinate. Returns whether it differs from the coordinate stored before. */
static bool move_coordinate(const moved_axis *axis, double scale, int64_t vertex, int64_t tuple)
{
    double coordinate = grid_read_number(&axis->from, vertex);
    if (axis->by.data) coordinate += scale * grid_read_number(&axis->by, tuple);
    return session_store_coordinate(axis->to, vertex, coordinate);
}

/* Moves all vertices. *bad becomes the first vertex for which the index of its tuple is out of range, or the number of
 * vertices if there is none. Returns whether a coordinate has changed. */
static bool move_vertices(const session_mesh *mesh, const session_displacement *by, const moved_axis axes[3],
                          int threads, int64_t *bad)
{
    const int64_t count = mesh->given.vertex_count;
    int64_t first_bad = count;
    bool is_moved = false;
#pragma omp parallel num_threads(session_choose_loop_threads(threads, count))
    {
        region_enter();
#pragma omp for schedule(static) reduction(min : first_bad) reduction(|| : is_moved) nowait
        for (int64_t v = 0; v < count; v++) {
            const int64_t tuple = by->index.data ? grid_read_index(&by->index, v) : v;
            if (tuple < 0 || tuple >= by->count) {
                first_bad = v < first_bad ? v : first_bad;
                continue;
            }
            for (int axis = 0; axis < 3; axis++)
                if (axes[axis].to) is_moved = move_coordinate(&axes[axis], by->scale, v, tuple) || is_moved;
        }
        region_leave();
    }
    *bad = first_bad;
    return is_moved;
}

static insitu_status report_invalid_tuple_index(const session_mesh *mesh, const session_displacement *by,
                                                int64_t vertex, base_error *error)
{
    const long long base = mesh->given.index_base;
    return base_fail(error, INSITU_ERROR_FIELD,
                     "mesh \"%s\": field \"%s\": the index of vertex %lld is %lld, outside %lld..%lld (index_base is "
                     "%lld)",
                     mesh->label, mesh->fields[by->field].given.name, (long long)vertex + base,
                     (long long)grid_read_index(&by->index, vertex) + base, base, (long long)by->count - 1 + base,
                     base);
}

/* Computes the moved coordinates from the caller's coordinates. *differ is set if a moved coordinate has changed or its
 * memory is new. */
static insitu_status compute_moved_coordinates(session_mesh *mesh, const session_displacement *by, int threads,
                                               bool *differ, base_error *error)
{
    moved_axis axes[3] = {{.to = NULL}};
    int64_t bad;
    if (!reserve_coordinates(mesh, by->component_count, differ))
        return session_fail_for_memory(error, mesh->given.vertex_count * 24, "coordinates of a warped mesh");
    const bool has_axes = session_has_axis_coordinates(&mesh->given);
    insitu_status status = has_axes ? session_compute_axis_coordinates(mesh, error) : INSITU_OK;
    if (status) return status;
    for (int axis = 0; axis < 3; axis++) {
        const insitu_array *own = &mesh->warp.coordinates[axis];
        if (!own->data) continue;
        axes[axis] = (moved_axis){
            .from = has_axes ? mesh->cells.coordinates[axis] : session_coordinates(&mesh->given, axis), .to = own};
        if (axis < by->component_count) axes[axis].by = by->components[axis];
    }
    *differ = move_vertices(mesh, by, (const moved_axis *)axes, threads, &bad) || *differ;
    if (has_axes) session_drop_axes(&mesh->lattice);
    return bad < mesh->given.vertex_count ? report_invalid_tuple_index(mesh, by, bad, error) : INSITU_OK;
}

insitu_status session_warp_mesh(session_meshes *meshes, session_mesh *mesh, const session_displacement *by, int threads,
                                base_error *error)
{
    session_warp *warp = &mesh->warp;
    const bool was_on = warp->is_applied;
    bool differ = !was_on;
    if (warp->is_applied && !warp->is_stale && warp->key == by->key) return INSITU_OK;
    session_free_finer_lattices_of_mesh(meshes, mesh); /* finer lattices must be computed again from the moved nodes */
    if (warp->is_stale) session_convert_arrays(mesh, threads);
    restore_coordinates(mesh);
    if (compute_moved_coordinates(mesh, by, threads, &differ, error)) {
        if (was_on) mark_moved(meshes, mesh);
        session_select_grid_arrays(mesh);
        return error->status;
    }
    warp->key = by->key;
    warp->is_stale = false;
    if (differ) mark_moved(meshes, mesh);
    session_use_moved_coordinates(mesh);
    warp->is_applied = true;
    session_select_grid_arrays(mesh);
    return INSITU_OK;
}
