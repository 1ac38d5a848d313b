/* What is up to date is left alone: new cells build a tree, moved vertices refit its bounds (until its cost has grown
 * by half, then it is built again), new values refit ranges. The first scalar that a mesh is drawn with has the nodes'
 * own ranges, further ones have pairs beside the tree.
 *
 * A full tree is dear to build and cheap to keep; a partial one, over the cells that the images can show, is cheap to
 * build where they show little, but ends with the values. Which serves better depends on how long the cells will stay,
 * which nobody tells. So partial trees are rented until the rent since the cells last changed comes to the price of
 * the full tree, and then that is bought: never more than twice what the best choice in hindsight would have cost
 * (Karlin, Manasse, Rudolph and Sleator 1988). Prices are as measured in this run. */
#include "session_tree.h"

#include "memory.h"
#include "mmbvh_fetch.h"
#include "session_shown.h"
#include "session_values.h"

static const double worst_cost = 1.5; /* of a refitted tree, in costs when built */

/* Seconds a cell on one thread, before anything was measured. */
static const session_rates first_rates = {.build = 3e-7, .select = 2e-8, .refit = 1e-8};
/* What takes no longer than so many cells' work says little about more. */
enum { MEASURED_CELLS = 10000 };

static double rate_of(const insitu_session *session, double measured, double first)
{
    return measured > 0 ? measured : first / session->threads;
}

static void measure(double *rate, double seconds, int64_t cells)
{
    if (cells < MEASURED_CELLS) return;
    const double now = seconds / (double)cells;
    *rate = *rate > 0 ? 0.5 * (*rate + now) : now;
}

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

/* Over the selection, or over all cells where that is NULL. */
static insitu_status build_tree(insitu_session *session, session_mesh *mesh, const mmbvh_selection *selection,
                                base_error *error)
{
    const double start = MPI_Wtime();
    mmbvh_options options = options_of(session);
    options.selection = selection;
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
    mesh->is_partial = selection != NULL;
    if (!selection) own->unusable = mesh->tree.unusable_cells;
    const double seconds = MPI_Wtime() - start;
    measure(&session->rates.build, seconds, mesh->tree.cell_count);
    session->report.build_ms += 1e3 * seconds;
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
    if (mmbvh_cost(&mesh->tree, &options) > worst_cost * mesh->tree.built_cost) return build_tree(session, mesh, NULL, error);
    mesh->is_geometry_stale = false;
    return INSITU_OK;
}

static insitu_status refit_scalar(session_mesh *mesh, session_scalar *scalar, const mmbvh_options *options)
{
    const grid_field field = session_scalar_field(mesh, scalar);
    if (scalar->has_own_ranges) {
        const insitu_status status = mmbvh_refit_ranges(&mesh->tree, &mesh->cells, &field, options);
        if (!mesh->is_partial) scalar->unusable = mesh->tree.unusable_cells;
        return status;
    }
    if (!scalar->pairs) scalar->pairs = base_alloc((size_t)mesh->tree.node_count * 2 * sizeof *scalar->pairs);
    if (!scalar->pairs) return INSITU_ERROR_MEMORY;
    int64_t unusable;
    const insitu_status status =
        mmbvh_compute_ranges(&mesh->tree, &mesh->cells, &field, options, scalar->pairs, &unusable);
    if (!mesh->is_partial) scalar->unusable = unusable;
    return status;
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
        const double seconds = MPI_Wtime() - start;
        measure(&session->rates.refit, seconds, mesh->tree.cell_count);
        session->report.refit_ms += 1e3 * seconds;
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

/* ---- full or partial ----------------------------------------------------------------------------------------- */

static double full_price(const insitu_session *session, const session_mesh *mesh)
{
    return rate_of(session, session->rates.build, first_rates.build) * (double)mesh->drawn_count;
}

/* Is there a full tree, of these cells? */
static bool has_full_tree(const session_mesh *mesh)
{
    return mesh->has_tree && !mesh->is_partial && !mesh->is_topology_stale;
}

static bool wants_partial(const insitu_session *session, const session_mesh *mesh)
{
    if (session->scene.tree == SCENE_TREE_FULL || !session_shown_is_bounded(mesh)) return false;
    if (session->scene.tree == SCENE_TREE_PARTIAL) return true;
    return !has_full_tree(mesh) && mesh->rent < full_price(session, mesh);
}

/* Nothing has changed that decides on the cells that show. */
static bool is_partial_fresh(const session_mesh *mesh, uint64_t key)
{
    if (!mesh->has_tree || !mesh->is_partial || mesh->is_topology_stale || mesh->is_geometry_stale) return false;
    for (int i = 0; i < mesh->scalar_count; i++)
        if (mesh->scalars[i].wants_ranges && mesh->scalars[i].are_ranges_stale) return false;
    return mesh->shown_key == key;
}

static insitu_status update_partial(insitu_session *session, session_mesh *mesh, base_error *error)
{
    const uint64_t key = session_shown_key(mesh);
    if (is_partial_fresh(mesh, key)) return INSITU_OK;
    const double start = MPI_Wtime();
    mmbvh_selection selection;
    insitu_status status = session_shown_select(mesh, session->threads, &selection, error);
    if (status) return status;
    const double seconds = MPI_Wtime() - start;
    measure(&session->rates.select, seconds, mesh->given.cell_count);
    session->report.build_ms += 1e3 * seconds;
    /* Half of the full price or more: buy. */
    const bool is_forced = session->scene.tree == SCENE_TREE_PARTIAL;
    const bool is_partial = is_forced || 2 * selection.count <= mesh->drawn_count;
    status = build_tree(session, mesh, is_partial ? &selection : NULL, error);
    mmbvh_selection_free(&selection);
    mesh->shown_key = key;
    mesh->rent += MPI_Wtime() - start;
    mesh->rent -= rate_of(session, session->rates.refit, first_rates.refit) * (double)mesh->drawn_count;
    return status;
}

static insitu_status update_full(insitu_session *session, session_mesh *mesh, base_error *error)
{
    if (!has_full_tree(mesh)) return build_tree(session, mesh, NULL, error);
    return mesh->is_geometry_stale ? refit_bounds(session, mesh, error) : INSITU_OK;
}

static insitu_status update_tree(insitu_session *session, session_mesh *mesh, base_error *error)
{
    const insitu_status status =
        wants_partial(session, mesh) ? update_partial(session, mesh, error) : update_full(session, mesh, error);
    return status ? status : refit_ranges(session, mesh, error);
}

insitu_status session_update_trees(insitu_session *session, base_error *error)
{
    session_settle_values(session);
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

static void find_extent(const grid *g, const grid_field *field, int threads, double *low, double *high)
{
    double least = INFINITY, most = -INFINITY;
#pragma omp parallel for num_threads(threads) schedule(static) reduction(min : least) reduction(max : most)
    for (int64_t cell = 0; cell < g->cell_count; cell++) {
        if (!grid_is_drawn(g, cell)) continue;
        const fetch_range of_cell = fetch_any_cell_range(g, field, cell);
        if (!of_cell.is_finite) continue;
        least = fmin(least, of_cell.low);
        most = fmax(most, of_cell.high);
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
