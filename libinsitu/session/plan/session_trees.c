/* Updates trees. Trees that are up to date are not changed. New cells require a new tree; moved vertices require a
 * refit of its bounds (or, if its cost has grown by half, a new tree); new values require a refit of ranges. The ranges
 * of the first scalar with which a mesh is drawn are stored in the nodes themselves, and those of further scalars in
 * separate arrays. If values determine which cells are visible and vertices move in every step, only the bounds of
 * visible nodes are refitted. For an isosurface, a fifth of all nodes is visible.
 *
 * A full tree is expensive to build and cheap to keep. A partial tree, over the cells that the images can show, is
 * cheap to build if they show little, but is valid only for the current values. Which is better depends on how long the
 * cells will stay unchanged, which is unknown. Therefore partial trees are "rented" until the time spent on them since
 * the cells last changed reaches the price of the full tree, which is then "bought". This never costs more than twice
 * the best choice in hindsight (Karlin, Manasse, Rudolph and Sleator 1988). Prices are measured in this run.
 *
 * If the previous full tree of a mesh was used in only one step, the next tree will probably also be used only once,
 * for example because the caller sets a new mesh at every step. The next tree is then built along a space-filling
 * curve, in half the time. It is kept if it is used longer after all. */
#include "session_trees.h"

#include <math.h>
#include <omp.h>

#include "memory.h"
#include "region.h"
#include "session_agree.h"
#include "session_candidates.h"
#include "session_scalars.h"

static const double worst_cost = 1.5; /* largest cost of a refitted tree, as a multiple of its cost when it was built */

/* Assumed seconds per cell on one thread, used before anything was measured. */
static const session_rates first_rates = {.build = 3e-7, .select = 2e-8, .refit = 1e-8};
/* Minimum number of cells of a measurement from which costs are extrapolated. */
enum { MEASURED_CELLS = 10000 };

static double choose_measured_or_default_rate(double measured, double first, int threads)
{
    return measured > 0 ? measured : first / threads;
}

static void update_rate(double *rate, double seconds, int64_t cells)
{
    if (cells < MEASURED_CELLS) return;
    const double now = seconds / (double)cells;
    *rate = *rate > 0 ? 0.5 * (*rate + now) : now;
}

/* Input and results that the updates of all trees in a step share. */
typedef struct tree_update {
    session_trees *trees;
    const session_space *space;
    scene_tree choice;
    int threads;
    insitu_report *report;
} tree_update;

static mmbvh_options make_tree_options(const tree_update *u)
{
    return (mmbvh_options){.threads = u->threads};
}

static session_scalar *find_scalar_with_ranges_in_nodes(const session_mesh *mesh)
{
    for (int i = 0; i < mesh->scalar_count; i++)
        if (mesh->scalars[i].has_own_ranges) return &mesh->scalars[i];
    return NULL;
}

/* Returns the scalar whose ranges are stored in the tree's nodes. If there is no such scalar yet, chooses the first one
 * whose ranges an image needs, and marks it. */
static session_scalar *choose_scalar_with_ranges_in_nodes(session_mesh *mesh)
{
    session_scalar *own = find_scalar_with_ranges_in_nodes(mesh);
    for (int i = 0; i < mesh->scalar_count && !own; i++)
        if (mesh->scalars[i].needs_ranges) own = &mesh->scalars[i];
    if (!own->has_own_ranges) {
        base_free(own->node_ranges);
        own->node_ranges = NULL;
        own->has_own_ranges = true;
        own->are_ranges_stale = true;
    }
    return own;
}

/* Returns half the surface area of the mesh's bounding box. */
static double half_box_area(const session_mesh *mesh)
{
    double d[3];
    for (int axis = 0; axis < 3; axis++) d[axis] = mesh->upper[axis] - mesh->lower[axis];
    return d[0] * d[1] + d[1] * d[2] + d[2] * d[0];
}

/* Chooses the tree builder. For trees over a selection of cells the choice hardly matters, because they are small. */
static mmbvh_builder choose_builder(const session_mesh *mesh, const mmbvh_selection *selection)
{
    return !selection && mesh->full_tree_steps == 1 ? MMBVH_MORTON : MMBVH_SAH;
}

/* Builds a tree over the selected cells, or over all cells if `selection` is NULL. */
static insitu_status build_tree(const tree_update *u, session_mesh *mesh, const mmbvh_selection *selection,
                                base_error *error)
{
    const double start = omp_get_wtime();
    mmbvh_options options = make_tree_options(u);
    options.selection = selection;
    options.builder = choose_builder(mesh, selection);
    session_drop_tree(mesh);
    u->trees->is_parent_stale = true;
    session_scalar *own = choose_scalar_with_ranges_in_nodes(mesh);
    const grid_field field = session_get_scalar_values(mesh, own);
    const insitu_status status =
        mmbvh_build(&mesh->cells, &field, u->space->origin, u->space->scale, &options, &mesh->tree, error);
    if (status) return status;
    mesh->has_tree = true;
    mesh->is_topology_stale = false;
    mesh->is_geometry_stale = false;
    own->are_ranges_stale = false;
    mesh->is_partial = selection != NULL;
    mesh->are_bounds_partial = false;
    mesh->built_surface = half_box_area(mesh);
    if (!selection) mesh->full_tree_steps = 0;
    if (!selection) own->unusable_count = mesh->tree.unusable_cells;
    const double seconds = omp_get_wtime() - start;
    update_rate(&u->trees->rates.build, seconds, mesh->tree.cell_count);
    u->report->build_ms += 1e3 * seconds;
    return INSITU_OK;
}

static insitu_status refit_ranges_of_scalar(session_mesh *mesh, session_scalar *scalar, const mmbvh_options *options)
{
    const grid_field field = session_get_scalar_values(mesh, scalar);
    if (scalar->has_own_ranges) {
        const insitu_status status = mmbvh_refit_ranges(&mesh->tree, &mesh->cells, &field, options);
        if (!mesh->is_partial) scalar->unusable_count = mesh->tree.unusable_cells;
        return status;
    }
    if (!scalar->node_ranges)
        scalar->node_ranges = base_alloc((size_t)mesh->tree.node_count * 2 * sizeof *scalar->node_ranges);
    if (!scalar->node_ranges) return INSITU_ERROR_MEMORY;
    int64_t unusable;
    const insitu_status status =
        mmbvh_compute_ranges(&mesh->tree, &mesh->cells, &field, options, scalar->node_ranges, &unusable);
    if (!mesh->is_partial) scalar->unusable_count = unusable;
    return status;
}

static insitu_status refit_ranges(const tree_update *u, session_mesh *mesh, base_error *error)
{
    const mmbvh_options options = make_tree_options(u);
    choose_scalar_with_ranges_in_nodes(mesh);
    for (int i = 0; i < mesh->scalar_count; i++) {
        session_scalar *scalar = &mesh->scalars[i];
        if (!scalar->needs_ranges || !scalar->are_ranges_stale) continue;
        const double start = omp_get_wtime();
        const insitu_status status = refit_ranges_of_scalar(mesh, scalar, &options);
        if (status)
            return base_fail(error, status, "mesh \"%s\": no memory for the ranges of field \"%s\"", mesh->label,
                             session_get_scalar_name(mesh, scalar));
        scalar->are_ranges_stale = false;
        const double seconds = omp_get_wtime() - start;
        update_rate(&u->trees->rates.refit, seconds, mesh->tree.cell_count);
        u->report->refit_ms += 1e3 * seconds;
    }
    return INSITU_OK;
}

/* ---- bounding boxes of nodes ------------------------------------------------------------------------------------- */

static insitu_status build_and_refit(const tree_update *u, session_mesh *mesh, base_error *error)
{
    const insitu_status status = build_tree(u, mesh, NULL, error);
    return status ? status : refit_ranges(u, mesh, error);
}

/* Returns whether the tree's cost, relative to the area of its mesh's box, has grown so much that it should be rebuilt.
 * Nodes that were not refitted are included with their old boxes. */
static bool has_tree_decayed(const session_mesh *mesh)
{
    const double tree = mesh->tree.area * mesh->built_surface, built = mesh->tree.built_area * half_box_area(mesh);
    return tree > worst_cost * built;
}

/* Lists for each scalar the intervals of its values that are shown. Nodes of the tree whose values lie outside of these
 * intervals are invisible. The tree's ranges must be up to date. */
static int list_visible_intervals(const session_mesh *mesh, mmbvh_visible *out)
{
    int count = 0;
    for (int i = 0; i < mesh->scalar_count; i++) {
        const session_scalar *s = &mesh->scalars[i];
        if (!s->needs_ranges) continue;
        out[count++] = (mmbvh_visible){session_get_scalar_ranges(mesh, s), s->interval_count, s->intervals};
    }
    return count;
}

/* Refits all bounds, or only those of visible nodes. */
static insitu_status refit_bounds(const tree_update *u, session_mesh *mesh, bool all, base_error *error)
{
    const double start = omp_get_wtime();
    const mmbvh_options options = make_tree_options(u);
    bool is_whole;
    mmbvh_visible *visible = base_alloc((size_t)(mesh->scalar_count + 1) * sizeof *visible);
    if (!visible)
        return session_fail_for_memory(error, (mesh->scalar_count + 1) * (int64_t)sizeof *visible, "visible nodes");
    const int count = all ? 0 : list_visible_intervals(mesh, visible);
    const insitu_status status =
        mmbvh_refit_visible_bounds(&mesh->tree, &mesh->cells, visible, count, &options, &is_whole);
    base_free(visible);
    if (status) return base_fail(error, status, "mesh \"%s\": its tree could not be refitted", mesh->label);
    u->trees->is_parent_stale = true;
    u->report->refit_ms += 1e3 * (omp_get_wtime() - start);
    mesh->is_geometry_stale = false;
    mesh->are_bounds_partial = !is_whole;
    return has_tree_decayed(mesh) ? build_and_refit(u, mesh, error) : INSITU_OK;
}

/* Updates the bounds. While the candidates (cells that images can show, according to their values) are the same as in
 * the previous step, only bounds of visible nodes must be valid. If the candidates have changed and vertices no longer
 * move, all bounds are refitted one time. */
static insitu_status update_bounds(const tree_update *u, session_mesh *mesh, bool are_values_new, base_error *error)
{
    uint64_t key;
    const bool is_told = session_hash_candidate_queries(mesh, &key);
    const bool is_other = !is_told || are_values_new || key != mesh->candidates_key;
    if (!mesh->is_geometry_stale && !(mesh->are_bounds_partial && is_other)) return INSITU_OK;
    const insitu_status status = refit_bounds(u, mesh, !is_told || !mesh->is_geometry_stale, error);
    mesh->candidates_key =
        /* if refitting failed, the stored key matches no set of candidates, because the bounds are invalid */
        status ? ~key : key;
    return status;
}

/* ---- parent tree over the trees of all parts --------------------------------------------------------------------- */

static uint64_t hash_parts(const session_meshes *meshes, int *count)
{
    uint64_t key = 0;
    *count = 0;
    for (session_part_walk walk = {.meshes = meshes}; session_next_part(&walk);) {
        const session_mesh *mesh = walk.part;
        if (!mesh->is_needed || mesh->tree.node_count == 0) continue;
        key = (key ^ (uint64_t)(uintptr_t)mesh) * 0x100000001b3u;
        (*count)++;
    }
    return key;
}

/* Stores the bounding boxes of the parts, over which the parent tree is built. Several fields share the parent tree, so
 * that its ranges of values are unbounded. A traversal tests ranges only from the root of each part's own tree on. */
static void fill_boxes(const session_meshes *meshes, float *boxes, int count)
{
    int part = 0;
    for (session_part_walk walk = {.meshes = meshes}; session_next_part(&walk);) {
        const session_mesh *mesh = walk.part;
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

static insitu_status update_parent(const tree_update *u, const session_meshes *meshes, base_error *error)
{
    int count = 0;
    const uint64_t key = hash_parts(meshes, &count);
    if (!u->trees->is_parent_stale && key == u->trees->parent_key) return INSITU_OK;
    mmbvh_free(&u->trees->parent);
    u->trees->parent_key = key;
    u->trees->is_parent_stale = false;
    if (count < 2) return INSITU_OK;
    const double start = omp_get_wtime();
    u->trees->is_parent_stale = true;
    float *boxes = base_alloc((size_t)count * 8 * sizeof *boxes);
    if (!boxes) return session_fail_for_memory(error, count * 32, "boxes of meshes");
    fill_boxes(meshes, boxes, count);
    const mmbvh_options options = make_tree_options(u);
    const insitu_status status = mmbvh_build_boxes(boxes, boxes + 3 * (size_t)count, boxes + 6 * (size_t)count, count,
                                                   &options, &u->trees->parent, error);
    base_free(boxes);
    u->trees->is_parent_stale = status != INSITU_OK;
    u->report->build_ms += 1e3 * (omp_get_wtime() - start);
    return status;
}

/* ---- choice between full and partial trees --------------------------------------------------------------------- */

static double estimate_full_tree_cost(const tree_update *u, const session_mesh *mesh)
{
    return choose_measured_or_default_rate(u->trees->rates.build, first_rates.build, u->threads) *
           (double)mesh->drawn_count;
}

/* Returns whether there is a full tree (over all drawn cells) that was built over the current cells. */
static bool has_full_tree(const session_mesh *mesh)
{
    return mesh->has_tree && !mesh->is_partial && !mesh->is_topology_stale;
}

static bool prefers_partial_tree(const tree_update *u, const session_mesh *mesh, uint64_t *key)
{
    if (u->choice == SCENE_TREE_FULL || !session_hash_candidate_queries(mesh, key)) return false;
    if (u->choice == SCENE_TREE_PARTIAL) return true;
    return !has_full_tree(mesh) && mesh->partial_tree_seconds < estimate_full_tree_cost(u, mesh);
}

static bool has_new_values(const session_mesh *mesh)
{
    for (int i = 0; i < mesh->scalar_count; i++)
        if (mesh->scalars[i].needs_ranges && mesh->scalars[i].are_ranges_stale) return true;
    return false;
}

/* Returns whether there is a partial tree that is still valid, because the cells, their vertices, their values and the
 * queries that select visible cells (key) are unchanged. */
static bool is_partial_tree_valid(const session_mesh *mesh, uint64_t key)
{
    if (!mesh->has_tree || !mesh->is_partial || mesh->is_topology_stale || mesh->is_geometry_stale) return false;
    return !has_new_values(mesh) && mesh->candidates_key == key;
}

/* Updates a tree over the candidates, the cells that images can show. key: hash of the queries that select the
 * candidates (session_hash_candidate_queries()). */
static insitu_status update_partial_tree(const tree_update *u, session_mesh *mesh, uint64_t key, base_error *error)
{
    if (is_partial_tree_valid(mesh, key)) return INSITU_OK;
    const double start = omp_get_wtime();
    mmbvh_selection selection;
    insitu_status status = session_select_candidates(mesh, u->threads, &selection, error);
    if (status) return status;
    const double seconds = omp_get_wtime() - start;
    update_rate(&u->trees->rates.select, seconds, mesh->given.cell_count);
    u->report->build_ms += 1e3 * seconds;
    /* a partial tree that costs at least half as much as the full tree is not worth building */
    const bool is_forced = u->choice == SCENE_TREE_PARTIAL;
    const bool is_partial = is_forced || 2 * selection.count <= mesh->drawn_count;
    status = build_tree(u, mesh, is_partial ? &selection : NULL, error);
    mmbvh_selection_free(&selection);
    mesh->candidates_key = key;
    mesh->partial_tree_seconds += omp_get_wtime() - start;
    mesh->partial_tree_seconds -=
        choose_measured_or_default_rate(u->trees->rates.refit, first_rates.refit, u->threads) *
        (double)mesh->drawn_count;
    return status;
}

static insitu_status update_full_tree(const tree_update *u, session_mesh *mesh, base_error *error)
{
    if (!has_full_tree(mesh)) return build_and_refit(u, mesh, error);
    const bool are_values_new = has_new_values(mesh);
    const insitu_status status = refit_ranges(u, mesh, error);
    return status ? status : update_bounds(u, mesh, are_values_new, error);
}

static insitu_status update_tree(const tree_update *u, session_mesh *mesh, base_error *error)
{
    uint64_t key;
    insitu_status status;
    if (prefers_partial_tree(u, mesh, &key)) {
        status = update_partial_tree(u, mesh, key, error);
        if (!status) status = refit_ranges(u, mesh, error);
    } else {
        status = update_full_tree(u, mesh, error);
    }
    if (!status && !mesh->is_partial) mesh->full_tree_steps++;
    return status;
}

/* The data with which one thread updates some of the parts. If a mesh has many small blocks, a parallel region for each
 * block would cost more than it saves. Therefore each part is updated by one thread if there are several parts per
 * thread. In this case the seconds per cell are not measured. */
typedef struct thread_update {
    tree_update update;
    session_trees trees;
    insitu_report report;
    base_error error;
} thread_update;

enum { PARTS_A_THREAD = 4 };

static void merge_results_of_threads(const tree_update *u, const thread_update *each, base_error *error)
{
    double build_ms = 0, refit_ms = 0;
    for (int t = 0; t < u->threads; t++) {
        build_ms = fmax(build_ms, each[t].report.build_ms);
        refit_ms = fmax(refit_ms, each[t].report.refit_ms);
        u->trees->is_parent_stale = u->trees->is_parent_stale || each[t].trees.is_parent_stale;
        if (!error->status) *error = each[t].error;
    }
    u->report->build_ms += build_ms;
    u->report->refit_ms += refit_ms;
}

static insitu_status update_on_threads(const tree_update *u, session_mesh *const *parts, int count, base_error *error)
{
    thread_update *each = base_calloc((size_t)u->threads, sizeof *each);
    if (!each) return session_fail_for_memory(error, u->threads * (int64_t)sizeof *each, "trees of blocks");
    for (int t = 0; t < u->threads; t++) {
        each[t].trees.rates = u->trees->rates;
        each[t].update = *u;
        each[t].update.trees = &each[t].trees;
        each[t].update.report = &each[t].report;
        each[t].update.threads = 1;
    }
#pragma omp parallel num_threads(u->threads)
    {
        region_enter();
        thread_update *own = &each[omp_get_thread_num()];
#pragma omp for schedule(dynamic) nowait
        for (int i = 0; i < count; i++)
            if (!own->error.status) update_tree(&own->update, parts[i], &own->error);
        region_leave();
    }
    merge_results_of_threads(u, each, error);
    base_free(each);
    return error->status;
}

/* Lists the needed parts and returns their number. If parts is NULL, they are only counted. */
static int list_needed_parts(const session_meshes *meshes, session_mesh **parts)
{
    int count = 0;
    for (session_part_walk walk = {.meshes = meshes}; session_next_part(&walk);) {
        if (!walk.part->is_needed) continue;
        if (parts) parts[count] = walk.part;
        count++;
    }
    return count;
}

static insitu_status update_all_trees(const tree_update *u, const session_meshes *meshes, base_error *error)
{
    const int count = list_needed_parts(meshes, NULL);
    session_mesh **parts = base_alloc((size_t)(count + 1) * sizeof *parts);
    if (!parts) return session_fail_for_memory(error, count * (int64_t)sizeof(session_mesh *), "trees");
    list_needed_parts(meshes, parts);
    insitu_status status = INSITU_OK;
    if (u->threads > 1 && count >= PARTS_A_THREAD * u->threads)
        status = update_on_threads(u, parts, count, error);
    else
        for (int i = 0; i < count && !status; i++) status = update_tree(u, parts[i], error);
    base_free(parts);
    return status ? status : update_parent(u, meshes, error);
}

insitu_status session_update_trees(session_trees *trees, const session_meshes *meshes, const session_space *space,
                                   scene_tree choice, const session_team *team, insitu_report *report,
                                   base_error *error)
{
    const tree_update update = {trees, space, choice, team->threads, report};
    return update_all_trees(&update, meshes, error);
}

void session_trees_free(session_trees *trees)
{
    mmbvh_free(&trees->parent);
}
