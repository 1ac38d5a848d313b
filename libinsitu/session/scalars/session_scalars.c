#include "session_scalars.h"

#include <math.h>

#include "memory.h"
#include "mmbvh_fetch.h"
#include "session_nodes.h"
#include "session_region.h"

int session_resolve_component(const scene_field *field, int component_count)
{
    if (field->component != SCENE_COMPONENT_DEFAULT) return field->component;
    return component_count == 1 ? 0 : -1;
}

bool session_is_distance(const session_scalar *scalar)
{
    return scalar->field < 0;
}

const char *session_get_scalar_name(const session_mesh *mesh, const session_scalar *scalar)
{
    return session_is_distance(scalar) ? "distance from a slice" : mesh->fields[scalar->field].given.name;
}

static uint64_t find_mesh_group_name(const session_mesh *mesh, const scene_field *field)
{
    return mesh->single_group_name ? mesh->single_group_name : field->mesh_group_name;
}

/* Returns the scalar of the mesh with these properties; NULL if there is none. is_recentred: the scalar's values are
 * averaged at vertices. mesh_group_name: hash that identifies the group of meshes over which they are averaged; ignored
 * if is_recentred is false. */
static session_scalar *find_scalar(const session_mesh *mesh, int field, int component, bool is_recentred,
                                   uint64_t mesh_group_name)
{
    for (int i = 0; i < mesh->scalar_count; i++) {
        session_scalar *scalar = &mesh->scalars[i];
        if (scalar->field == field && scalar->component == component && scalar->is_recentred == is_recentred &&
            (!is_recentred || scalar->mesh_group_name == mesh_group_name))
            return scalar;
    }
    return NULL;
}

session_scalar *session_find_recentred_scalar(const session_mesh *mesh, const char *field, int component,
                                              uint64_t mesh_group_name)
{
    const int index = session_find_field(mesh, field);
    return index < 0 ? NULL : find_scalar(mesh, index, component, true, mesh_group_name);
}

/* Returns the field's index on the mesh; -1 if the layer is not drawn on the mesh or the mesh lacks the field. */
static int find_field(const session_mesh *mesh, const scene_field *field)
{
    return scene_field_selects_mesh(field, mesh->name) ? session_find_field(mesh, field->name) : -1;
}

bool session_is_recentred(const scene_field *field, insitu_centring centring, bool is_refined)
{
    switch (centring) {
    case INSITU_CELL: return field->at_vertices;
    case INSITU_CORNER: return field->joins_corners;
    default: return is_refined && !field->is_as_given;
    }
}

bool session_is_copied(const session_mesh *mesh, const session_field *field)
{
    if (field->has_index || field->is_derived) return true;
    if (mesh->finer.parts) return true;
    if (field->given.centring == INSITU_VERTEX) return mesh->discontinuous.is_active;
    if (field->given.centring == INSITU_CELL) return mesh->topology.is_split;
    return field->given.corner_row && field->given.corner_row != session_count_cell_nodes(&mesh->given);
}

bool session_is_interpolated(const session_mesh *mesh, const session_field *field)
{
    return mesh->finer.parts && field->given.centring != INSITU_CELL && !field->is_derived;
}

bool session_does_copy_keep_type(const session_mesh *mesh, const session_field *field)
{
    return !field->component_arrays && !field->values.unusual_type && !session_is_interpolated(mesh, field);
}

session_scalar *session_find_scalar(const session_mesh *mesh, const scene_field *field)
{
    const int index = find_field(mesh, field);
    if (index < 0) return NULL;
    const insitu_field *given = &mesh->fields[index].given;
    return find_scalar(mesh, index, session_resolve_component(field, given->component_count),
                       session_is_recentred(field, given->centring, mesh->is_refined),
                       find_mesh_group_name(mesh, field));
}

grid_field session_get_caller_values(const session_mesh *mesh, int index, int component)
{
    const session_field *field = &mesh->fields[index];
    grid_field out = {.values = field->values,
                      .component_stride = field->component_stride,
                      .component_count = field->given.component_count,
                      .component = component,
                      .is_cell_centred = field->given.centring == INSITU_CELL};
    if (!session_is_copied(mesh, field)) {
        if (!field->component_arrays) return out;
        /* Each component has an array of its own. With a stride of 0, a component is read from the start of the array
         * that is chosen here. */
        out.component_stride = 0;
        if (component >= 0)
            out.values = field->component_arrays[component];
        else
            out.component_arrays = field->component_arrays;
        return out;
    }
    if (!session_does_copy_keep_type(mesh, field)) out.values = (grid_array){.is_wide = true};
    out.component_stride = out.values.is_wide ? 8 : 4;
    out.values.data = field->copy;
    out.values.stride = out.component_stride * out.component_count;
    return out;
}

bool session_find_values(const session_mesh *mesh, const scene_field *field, grid_field *out)
{
    const int index = find_field(mesh, field);
    if (index < 0) return false;
    *out = session_get_caller_values(mesh, index,
                                     session_resolve_component(field, mesh->fields[index].given.component_count));
    return true;
}

grid_field session_get_scalar_values(const session_mesh *mesh, const session_scalar *scalar)
{
    if (session_is_distance(scalar))
        return (grid_field){.values = {.data = (const char *)scalar->distances, .stride = (int64_t)sizeof(float)},
                            .component_stride = (int64_t)sizeof(float),
                            .component_count = 1};
    if (!scalar->is_recentred) return session_get_caller_values(mesh, scalar->field, scalar->component);
    return (grid_field){
        .values = {.data = (const char *)scalar->vertex_values, .stride = (int64_t)sizeof(double), .is_wide = true},
        .component_stride = (int64_t)sizeof(double),
        .component_count = 1,
        .source_cells = scalar->original_values.is_cell_centred ? &scalar->original_values : NULL};
}

session_scalar *session_add_scalar(session_mesh *mesh)
{
    session_scalar *scalars = base_realloc(mesh->scalars, (size_t)(mesh->scalar_count + 1) * sizeof *scalars);
    if (!scalars) return NULL;
    mesh->scalars = scalars;
    scalars[mesh->scalar_count] =
        (session_scalar){.are_values_stale = true, .may_have_changed = true, .are_ranges_stale = true};
    return &scalars[mesh->scalar_count++];
}

bool session_mark_scalar(session_mesh *mesh, const scene_field *field, bool needs_ranges, session_scalar **marked)
{
    const int index = find_field(mesh, field);
    *marked = NULL;
    if (index < 0) return true;
    const insitu_field *given = &mesh->fields[index].given;
    session_scalar *scalar = session_find_scalar(mesh, field);
    if (!scalar) {
        scalar = session_add_scalar(mesh);
        if (!scalar) return false;
        scalar->field = index;
        scalar->component = session_resolve_component(field, given->component_count);
        scalar->is_recentred = session_is_recentred(field, given->centring, mesh->is_refined);
        scalar->mesh_group_name = find_mesh_group_name(mesh, field);
    }
    scalar->is_used = true;
    scalar->original_values = session_get_caller_values(mesh, index, scalar->component);
    scalar->needs_ranges = scalar->needs_ranges || needs_ranges;
    mesh->is_needed = mesh->is_needed || needs_ranges;
    *marked = scalar;
    return true;
}

static bool is_included(const grid *g, int64_t cell, bool with_shells)
{
    return with_shells ? grid_can_be_shown(g, cell) : grid_is_drawn(g, cell);
}

/* Returns the number of the caller's cells that have a piece with a value that is not finite. piece_count: number of
 * these pieces. */
static int64_t count_cells_of_unusable_pieces(const session_mesh *mesh, const session_scalar *scalar, bool with_shells,
                                              int64_t piece_count)
{
    const grid *g = &mesh->cells;
    int64_t count = 0;
    if (!mesh->topology.is_split || !piece_count) return piece_count;
    const grid_field field = session_get_scalar_values(mesh, scalar);
    for (int64_t cell = 0; cell < mesh->given.cell_count; cell++) {
        bool is_any = false;
        for (int64_t piece = session_first_piece(mesh, cell); piece < session_first_piece(mesh, cell + 1); piece++)
            is_any =
                is_any || (is_included(g, piece, with_shells) && !fetch_any_cell_range(g, &field, piece).is_finite);
        count += is_any;
    }
    return count;
}

int64_t session_count_unusable_cells(const session_mesh *mesh, const session_scalar *scalar)
{
    return count_cells_of_unusable_pieces(mesh, scalar, false, scalar->unusable_count);
}

/* ---- minima and maxima of scalars ---------------------------------------------------------------------------- */

mmbvh_ranges session_get_scalar_ranges(const session_mesh *mesh, const session_scalar *scalar)
{
    return scalar->has_own_ranges ? mmbvh_own_ranges(&mesh->tree) : mmbvh_pair_ranges(scalar->node_ranges);
}

/* Returns whether the extent includes shells. Extents of distances from planes do not, because planes do not cut
 * shells. */
static bool includes_shells(const session_scalar *scalar, session_extent_kind kind)
{
    return kind != SESSION_SOLID && !scalar->distances;
}

static session_extremes find_range_of_scalar_values(const grid *g, const grid_field *field, int threads, bool of_shells,
                                                    bool is_positive)
{
    double least = INFINITY, most = -INFINITY;
    int64_t unusable = 0;
#pragma omp parallel num_threads(session_choose_loop_threads(threads, g->cell_count))
    {
        region_enter();
#pragma omp for schedule(static) reduction(min : least) reduction(max : most) reduction(+ : unusable) nowait
        for (int64_t cell = 0; cell < g->cell_count; cell++) {
            if (!is_included(g, cell, of_shells)) continue;
            const fetch_range of_cell = fetch_any_cell_range(g, field, cell);
            unusable += !of_cell.is_finite;
            if (!of_cell.is_finite) continue;
            if (!is_positive || of_cell.low > 0) least = fmin(least, of_cell.low);
            most = fmax(most, of_cell.high);
        }
        region_leave();
    }
    return (session_extremes){true, least, most, unusable};
}

void session_find_scalar_extent(const session_mesh *mesh, session_scalar *scalar, int threads, session_extent_kind kind,
                                double *low, double *high)
{
    const bool is_same = kind == SESSION_SOLID && mesh->shell_count == 0;
    session_extremes *known = &scalar->extremes[is_same ? SESSION_SEEN : kind];
    if (!known->is_known) {
        const grid_field field = session_get_scalar_values(mesh, scalar);
        *known = find_range_of_scalar_values(&mesh->cells, &field, threads, includes_shells(scalar, kind),
                                             kind == SESSION_POSITIVE);
    }
    *low = known->low;
    *high = known->high;
}

int64_t session_count_uncoloured_cells(const session_mesh *mesh, session_scalar *scalar, int threads)
{
    double low, high;
    session_find_scalar_extent(mesh, scalar, threads, SESSION_SEEN, &low, &high);
    return count_cells_of_unusable_pieces(mesh, scalar, includes_shells(scalar, SESSION_SEEN),
                                          scalar->extremes[SESSION_SEEN].unusable_count);
}

void session_clear_extents(session_scalar *scalar)
{
    for (int kind = 0; kind < SESSION_EXTENTS; kind++) scalar->extremes[kind].is_known = false;
}
