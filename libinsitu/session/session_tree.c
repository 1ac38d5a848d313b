/* What is up to date is left alone: new cells build a tree, moved vertices refit its bounds (until its cost has grown
 * by half, then it is built again), new values refit ranges. The first scalar that a mesh is drawn with has the nodes'
 * own ranges, further ones have pairs beside the tree. */
#include "session_tree.h"

#include "memory.h"

static const double worst_cost = 1.5; /* of a refitted tree, in costs when built */

static mmbvh_options options_of(const insitu_session *session)
{
    return (mmbvh_options){.threads = session->threads};
}

static session_scalar *own_scalar(const session_mesh *mesh)
{
    for (int i = 0; i < mesh->scalar_count; i++)
        if (mesh->scalars[i].has_own_ranges) return &mesh->scalars[i];
    return NULL;
}

/* The scalar of the nodes' own ranges; where there is none, the first that is drawn. */
static session_scalar *choose_own_scalar(session_mesh *mesh)
{
    session_scalar *own = own_scalar(mesh);
    for (int i = 0; i < mesh->scalar_count && !own; i++)
        if (mesh->scalars[i].wants_ranges) own = &mesh->scalars[i];
    if (!own->has_own_ranges) {
        base_free(own->pairs);
        own->pairs = NULL;
        own->has_own_ranges = true;
        own->are_ranges_stale = true;
    }
    return own;
}

static insitu_status build_tree(insitu_session *session, session_mesh *mesh, base_error *error)
{
    const double start = MPI_Wtime();
    const mmbvh_options options = options_of(session);
    session_drop_tree(mesh);
    session->is_parent_stale = true;
    session_scalar *own = choose_own_scalar(mesh);
    const grid_field field = session_scalar_field(mesh, own);
    const insitu_status status =
        mmbvh_build(&mesh->cells, &field, session->origin, session->scale, &options, &mesh->tree, error);
    if (status) return status;
    mesh->has_tree = true;
    mesh->is_topology_stale = false;
    mesh->is_geometry_stale = false;
    own->are_ranges_stale = false;
    own->unusable = mesh->tree.unusable_cells;
    session->report.build_ms += 1e3 * (MPI_Wtime() - start);
    return INSITU_OK;
}

static insitu_status refit_bounds(insitu_session *session, session_mesh *mesh, base_error *error)
{
    const double start = MPI_Wtime();
    const mmbvh_options options = options_of(session);
    const insitu_status status = mmbvh_refit_bounds(&mesh->tree, &mesh->cells, &options);
    if (status) return base_fail(error, status, "mesh \"%s\": its tree could not be refitted", mesh->name);
    session->is_parent_stale = true;
    session->report.refit_ms += 1e3 * (MPI_Wtime() - start);
    if (mmbvh_cost(&mesh->tree) > worst_cost * mesh->tree.built_cost) return build_tree(session, mesh, error);
    mesh->is_geometry_stale = false;
    return INSITU_OK;
}

static insitu_status refit_scalar(session_mesh *mesh, session_scalar *scalar, const mmbvh_options *options)
{
    const grid_field field = session_scalar_field(mesh, scalar);
    if (scalar->has_own_ranges) {
        const insitu_status status = mmbvh_refit_ranges(&mesh->tree, &mesh->cells, &field, options);
        scalar->unusable = mesh->tree.unusable_cells;
        return status;
    }
    if (!scalar->pairs) scalar->pairs = base_alloc((size_t)mesh->tree.node_count * 2 * sizeof *scalar->pairs);
    if (!scalar->pairs) return INSITU_ERROR_MEMORY;
    return mmbvh_compute_ranges(&mesh->tree, &mesh->cells, &field, options, scalar->pairs, &scalar->unusable);
}

static insitu_status refit_ranges(insitu_session *session, session_mesh *mesh, base_error *error)
{
    const mmbvh_options options = options_of(session);
    choose_own_scalar(mesh);
    for (int i = 0; i < mesh->scalar_count; i++) {
        session_scalar *scalar = &mesh->scalars[i];
        if (!scalar->wants_ranges || !scalar->are_ranges_stale) continue;
        const double start = MPI_Wtime();
        const insitu_status status = refit_scalar(mesh, scalar, &options);
        if (status)
            return base_fail(error, status, "mesh \"%s\": no memory for the ranges of field \"%s\"", mesh->name,
                             mesh->fields[scalar->field].given.name);
        scalar->are_ranges_stale = false;
        session->report.refit_ms += 1e3 * (MPI_Wtime() - start);
    }
    return INSITU_OK;
}

/* ---- the parent tree ----------------------------------------------------------------------------------------- */

static uint64_t parts_key(const insitu_session *session, int *count)
{
    uint64_t key = 0;
    *count = 0;
    for (int i = 0; i < session->mesh_count; i++) {
        const session_mesh *mesh = session->meshes[i];
        if (!mesh->is_needed || mesh->tree.node_count == 0) continue;
        key = (key ^ (uint64_t)(uintptr_t)mesh) * 0x100000001b3u;
        (*count)++;
    }
    return key;
}

/* Ranges of all parts are full: several fields share the tree, and culling by range begins at the parts' roots. */
static void fill_boxes(const insitu_session *session, float *boxes, int count)
{
    int part = 0;
    for (int i = 0; i < session->mesh_count; i++) {
        const session_mesh *mesh = session->meshes[i];
        if (!mesh->is_needed || mesh->tree.node_count == 0) continue;
        float lower[4], upper[4];
        mmbvh_node_box(&mesh->tree, 0, lower, upper);
        for (int axis = 0; axis < 3; axis++) {
            boxes[3 * part + axis] = lower[axis];
            boxes[3 * (count + part) + axis] = upper[axis];
        }
        boxes[6 * count + 2 * part] = -INFINITY;
        boxes[6 * count + 2 * part + 1] = INFINITY;
        part++;
    }
}

static insitu_status update_parent(insitu_session *session, base_error *error)
{
    int count = 0;
    const uint64_t key = parts_key(session, &count);
    if (!session->is_parent_stale && key == session->parent_key) return INSITU_OK;
    mmbvh_free(&session->parent);
    session->parent_key = key;
    session->is_parent_stale = false;
    if (count < 2) return INSITU_OK;
    const double start = MPI_Wtime();
    session->is_parent_stale = true;
    float *boxes = base_alloc((size_t)count * 8 * sizeof *boxes);
    if (!boxes) return session_no_memory(error, count * 32, "boxes of meshes");
    fill_boxes(session, boxes, count);
    const mmbvh_options options = options_of(session);
    const insitu_status status = mmbvh_build_boxes(boxes, boxes + 3 * (size_t)count, boxes + 6 * (size_t)count, count,
                                                   &options, &session->parent, error);
    base_free(boxes);
    session->is_parent_stale = status != INSITU_OK;
    session->report.build_ms += 1e3 * (MPI_Wtime() - start);
    return status;
}

static insitu_status update_tree(insitu_session *session, session_mesh *mesh, base_error *error)
{
    insitu_status status = INSITU_OK;
    if (!mesh->has_tree || mesh->is_topology_stale)
        status = build_tree(session, mesh, error);
    else if (mesh->is_geometry_stale)
        status = refit_bounds(session, mesh, error);
    return status ? status : refit_ranges(session, mesh, error);
}

insitu_status session_update_trees(insitu_session *session, base_error *error)
{
    for (int i = 0; i < session->mesh_count; i++) {
        if (!session->meshes[i]->is_needed) continue;
        const insitu_status status = update_tree(session, session->meshes[i], error);
        if (status) return status;
    }
    return update_parent(session, error);
}

/* ---- ranges and extents -------------------------------------------------------------------------------------- */

mmbvh_ranges session_scalar_ranges(const session_mesh *mesh, const session_scalar *scalar)
{
    return scalar->has_own_ranges ? mmbvh_own_ranges(&mesh->tree) : mmbvh_pair_ranges(scalar->pairs);
}

/* False where one of the cell's values is not finite. */
static bool cell_extent(const grid *g, const grid_field *field, int64_t cell, double *low, double *high)
{
    grid_walk walk = grid_walk_cell(g, cell);
    int64_t vertex;
    *low = INFINITY;
    *high = -INFINITY;
    while (grid_walk_next(&walk, &vertex)) {
        const double v = grid_field_value(field, field->is_cell_centred ? cell : vertex);
        if (!isfinite(v)) return false;
        *low = fmin(*low, v);
        *high = fmax(*high, v);
        if (field->is_cell_centred) break;
    }
    return true;
}

static void find_extent(const grid *g, const grid_field *field, int threads, double *low, double *high)
{
    double least = INFINITY, most = -INFINITY;
#pragma omp parallel for num_threads(threads) schedule(static) reduction(min : least) reduction(max : most)
    for (int64_t cell = 0; cell < g->cell_count; cell++) {
        if (grid_is_ghost(g, cell)) continue;
        double lowest, highest;
        if (!cell_extent(g, field, cell, &lowest, &highest)) continue;
        least = fmin(least, lowest);
        most = fmax(most, highest);
    }
    *low = least;
    *high = most;
}

void session_scalar_extent(const session_mesh *mesh, session_scalar *scalar, int threads, double *low, double *high)
{
    if (!scalar->is_extent_known) {
        const grid_field field = session_scalar_field(mesh, scalar);
        find_extent(&mesh->cells, &field, threads, &scalar->low, &scalar->high);
        scalar->is_extent_known = true;
    }
    *low = scalar->low;
    *high = scalar->high;
}
