#include "session_thresholds.h"

#include <string.h>

#include "memory.h"
#include "mmbvh_fetch.h"
#include "session_region.h"
#include "session_scalars.h"

static session_threshold resolve_threshold(const session_mesh *mesh, const scene_threshold *in)
{
    if (!in->is_given) return (session_threshold){0};
    session_threshold out = {true, session_find_field(mesh, in->field.name), 0, in->low, in->high};
    if (out.field >= 0)
        out.component = session_resolve_component(&in->field, mesh->fields[out.field].given.component_count);
    return out;
}

static bool is_same_threshold(const session_threshold *a, const session_threshold *b)
{
    if (!a->is_given || !b->is_given) return a->is_given == b->is_given;
    return a->field == b->field && a->component == b->component && a->low == b->low && a->high == b->high;
}

session_outer *session_find_outer_surface(const session_mesh *mesh, const scene_threshold *threshold)
{
    const session_threshold resolved = resolve_threshold(mesh, threshold);
    for (int i = 0; i < mesh->outer_count; i++)
        if (is_same_threshold(&mesh->outers[i]->threshold, &resolved)) return mesh->outers[i];
    return NULL;
}

static session_outer *add_outer_surface(session_mesh *mesh, const scene_threshold *threshold)
{
    session_outer **outers = base_realloc(mesh->outers, (size_t)(mesh->outer_count + 1) * sizeof *outers);
    if (!outers) return NULL;
    mesh->outers = outers;
    session_outer *out = base_calloc(1, sizeof *out);
    if (!out) return NULL;
    out->threshold = resolve_threshold(mesh, threshold);
    outers[mesh->outer_count++] = out;
    return out;
}

bool session_mark_outer_surface_needed(session_mesh *mesh, const scene_threshold *threshold)
{
    session_scalar *scalar;
    session_outer *outer = session_find_outer_surface(mesh, threshold);
    if (!outer) outer = add_outer_surface(mesh, threshold);
    if (!outer) return false;
    outer->is_needed = true;
    return !threshold->is_given || session_mark_scalar(mesh, &threshold->field, false, &scalar);
}

void session_drop_unused_outer_surfaces(session_mesh *mesh)
{
    int kept = 0;
    for (int i = 0; i < mesh->outer_count; i++) {
        session_outer *outer = mesh->outers[i];
        if (outer->threshold.is_given && !outer->is_needed) {
            session_drop_outer_surface(outer, true);
            base_free(outer);
        } else {
            mesh->outers[kept++] = outer;
        }
    }
    mesh->outer_count = kept;
}

/* Returns the scalar (field component) whose values the threshold compares with its bounds. Returns NULL if there is no
 * threshold, or if the mesh does not have the field. */
static const session_scalar *find_threshold_scalar(const session_mesh *mesh, const session_threshold *threshold)
{
    for (int i = 0; i < mesh->scalar_count && threshold->is_given && threshold->field >= 0; i++) {
        const session_scalar *scalar = &mesh->scalars[i];
        if (scalar->field == threshold->field && scalar->component == threshold->component && !scalar->is_recentred)
            return scalar;
    }
    return NULL;
}

bool session_are_outer_faces_stale(const session_mesh *mesh, const session_outer *outer)
{
    const session_scalar *scalar = find_threshold_scalar(mesh, &outer->threshold);
    return !outer->are_faces_known || (scalar && scalar->version != outer->version);
}

void session_mark_outer_faces_current(const session_mesh *mesh, session_outer *outer)
{
    const session_scalar *scalar = find_threshold_scalar(mesh, &outer->threshold);
    outer->version = scalar ? scalar->version : 0;
}

/* Hides all pieces of a cell if one of its pieces is hidden, because a cell is hidden if any of its values is outside
 * the threshold. */
static void hide_whole_cells(const session_mesh *mesh, unsigned char *is_hidden)
{
    for (int64_t cell = 0; cell < mesh->given.cell_count; cell++) {
        const int64_t first = session_first_piece(mesh, cell), end = session_first_piece(mesh, cell + 1);
        unsigned char is_any = 0;
        for (int64_t piece = first; piece < end; piece++) is_any |= is_hidden[piece];
        memset(is_hidden + first, is_any, (size_t)(end - first));
    }
}

unsigned char *session_find_hidden_cells(const session_mesh *mesh, const session_threshold *threshold, int threads)
{
    const int64_t count = mesh->cells.cell_count;
    const session_scalar *scalar = find_threshold_scalar(mesh, threshold);
    unsigned char *is_hidden = base_alloc((size_t)(count ? count : 1));
    if (!is_hidden) return NULL;
    const grid_field field = scalar ? session_get_scalar_values(mesh, scalar) : (grid_field){0};
#pragma omp parallel num_threads(session_choose_loop_threads(threads, count))
    {
        region_enter();
#pragma omp for schedule(static) nowait
        for (int64_t cell = 0; cell < count; cell++) {
            is_hidden[cell] = true;
            if (!scalar) continue;
            const fetch_range of_cell = fetch_any_cell_range(&mesh->cells, &field, cell);
            is_hidden[cell] = !of_cell.is_finite || of_cell.low < threshold->low || of_cell.high > threshold->high;
        }
        region_leave();
    }
    if (mesh->topology.is_split) hide_whole_cells(mesh, is_hidden);
    return is_hidden;
}
