/* A lattice's cells need no connectivity: the index of a vertex is computed from its three indices along the axes.
 * Uniform and rectilinear coordinates are stored as a table along each axis. A uniform coordinate is origin + spacing *
 * index with the index counted in the whole lattice, so that blocks and ranks that share a vertex compute the same
 * bits. */
#include "session_lattice.h"

#include <math.h>
#include <string.h>

#include "memory.h"
#include "session_arrays.h"

static const char axis_name[3] = {'i', 'j', 'k'};

/* ---- checks of the description of a lattice ---------------------------------------------------------------------- */

static int64_t count_vertices_along(const insitu_lattice *l, int axis)
{
    return l->cells[axis] + 1;
}

static int64_t count_cells_along(const insitu_lattice *l, int axis)
{
    return l->cells[axis] ? l->cells[axis] : 1;
}

static bool are_all_zero(const int64_t values[3])
{
    return !values[0] && !values[1] && !values[2];
}

bool session_is_quad_lattice(const insitu_lattice *l)
{
    return !l->cells[0] || !l->cells[1] || !l->cells[2];
}

static bool is_uniform(const insitu_lattice *l)
{
    return l->spacing[0] != 0 || l->spacing[1] != 0 || l->spacing[2] != 0;
}

static bool is_rectilinear(const insitu_lattice *l)
{
    return l->axes[0].data || l->axes[1].data || l->axes[2].data;
}

bool session_has_axis_coordinates(const insitu_mesh *mesh)
{
    return mesh->lattice && (is_uniform(mesh->lattice) || is_rectilinear(mesh->lattice));
}

static insitu_status check_cells(const insitu_lattice *l, base_error *error)
{
    const int64_t most = 4294967294;
    int without = 0;
    for (int axis = 0; axis < 3; axis++) {
        without += l->cells[axis] == 0;
        if (l->cells[axis] < 0 || l->cells[axis] > most)
            return base_fail(error, INSITU_ERROR_MESH, "lattice: cells along %c are %lld, expected 0..%lld",
                             axis_name[axis], (long long)l->cells[axis], (long long)most);
    }
    if (without != 2) return INSITU_OK;
    return base_fail(error, INSITU_ERROR_MESH,
                     "lattice: cells are %lld, %lld and %lld along i, j and k, expected 0 along at most one of them",
                     (long long)l->cells[0], (long long)l->cells[1], (long long)l->cells[2]);
}

/* Sorts the three axes by stride, and stores their indices in `order`. counts: number of elements along each axis. An
 * axis with a single element comes first, because its stride is never used. */
static void sort_axes_by_stride(const int64_t strides[3], const int64_t counts[3], int order[3])
{
    for (int i = 0; i < 3; i++) {
        int at = i;
        const int64_t own = counts[i] > 1 ? strides[i] : 0;
        for (; at > 0 && (counts[order[at - 1]] > 1 ? strides[order[at - 1]] : 0) > own; at--)
            order[at] = order[at - 1];
        order[at] = i;
    }
}

/* Checks that no two of the counts[0] x counts[1] x counts[2] elements have the same index, and that all indices are
 * below `length`. Indices are different because each stride must exceed the largest index that the axes with smaller
 * strides can reach. */
static insitu_status check_strides(const char *what, const int64_t strides[3], const int64_t counts[3], int64_t length,
                                   base_error *error)
{
    int order[3];
    int64_t reach = 1; /* 1 plus the largest index that is reached along the axes processed so far */
    sort_axes_by_stride(strides, counts, order);
    for (int i = 0; i < 3; i++) {
        const int axis = order[i];
        if (counts[axis] == 1) continue;
        if (strides[axis] < reach)
            return base_fail(
                error, INSITU_ERROR_MESH,
                "lattice: the stride of %s along %c is %lld, at least %lld is needed so that no two have one "
                "number",
                what, axis_name[axis], (long long)strides[axis], (long long)reach);
        if (strides[axis] > (length - reach) / (counts[axis] - 1))
            return base_fail(error, INSITU_ERROR_MESH,
                             "lattice: %lld %s along %c with a stride of %lld do not fit into arrays of %lld",
                             (long long)counts[axis], what, axis_name[axis], (long long)strides[axis],
                             (long long)length);
        reach += strides[axis] * (counts[axis] - 1);
    }
    return INSITU_OK;
}

/* Computes packed strides for these counts; the first index varies fastest. The last stride cannot overflow if the
 * counts have been checked. */
static void compute_packed_strides(const int64_t counts[3], int64_t out[3])
{
    out[0] = 1;
    out[1] = counts[0];
    out[2] = counts[0] * counts[1];
}

static insitu_status check_vertex_and_cell_strides(const insitu_mesh *mesh, base_error *error)
{
    const insitu_lattice *l = mesh->lattice;
    int64_t vertices[3], cells[3], packed[3];
    for (int axis = 0; axis < 3; axis++) {
        vertices[axis] = count_vertices_along(l, axis);
        cells[axis] = count_cells_along(l, axis);
    }
    if (vertices[0] > INT64_MAX / 32 / vertices[1])
        return base_fail(error, INSITU_ERROR_MESH, "lattice: %lld x %lld cells along i and j are too many",
                         (long long)l->cells[0], (long long)l->cells[1]);
    compute_packed_strides(vertices, packed);
    insitu_status status = check_strides("vertices", are_all_zero(l->vertex_strides) ? packed : l->vertex_strides,
                                         vertices, mesh->vertex_count, error);
    compute_packed_strides(cells, packed);
    if (!status)
        status = check_strides("cells", are_all_zero(l->cell_strides) ? packed : l->cell_strides, cells,
                               mesh->cell_count, error);
    return status;
}

static insitu_status check_interior(const insitu_lattice *l, base_error *error)
{
    if (are_all_zero(l->interior_first) && are_all_zero(l->interior_end)) return INSITU_OK;
    for (int axis = 0; axis < 3; axis++) {
        const int64_t first = l->interior_first[axis], end = l->interior_end[axis], most = count_cells_along(l, axis);
        if (first < 0 || end < first || end > most)
            return base_fail(error, INSITU_ERROR_MESH,
                             "lattice: the interior along %c is %lld..%lld, expected a range within 0..%lld",
                             axis_name[axis], (long long)first, (long long)end, (long long)most);
    }
    return INSITU_OK;
}

/* Largest allowed magnitude of insitu_lattice.first, the index of a block's first vertex in the whole lattice. Doubles
 * do not represent all larger integers. */
static const int64_t largest_first = (int64_t)1 << 53;

/* Largest allowed magnitude of insitu_lattice.first and largest allowed refinement, in lattices with levels of
 * refinement. They keep products of indices and refinements within 2^62. */
static const int64_t largest_refined_first = (int64_t)1 << 40, largest_refinement = (int64_t)1 << 20;

static insitu_status check_refinement(const insitu_lattice *l, base_error *error)
{
    if (are_all_zero(l->refinement)) return INSITU_OK;
    for (int axis = 0; axis < 3; axis++) {
        if (!l->cells[axis]) continue;
        if (l->refinement[axis] < 1 || l->refinement[axis] > largest_refinement)
            return base_fail(error, INSITU_ERROR_MESH, "lattice: refinement along %c is %lld, expected 1..%lld",
                             axis_name[axis], (long long)l->refinement[axis], (long long)largest_refinement);
        if (l->first[axis] < -largest_refined_first || l->first[axis] > largest_refined_first)
            return base_fail(error, INSITU_ERROR_MESH,
                             "lattice: first along %c is %lld, expected at most %lld in size with a refinement",
                             axis_name[axis], (long long)l->first[axis], (long long)largest_refined_first);
    }
    return INSITU_OK;
}

static insitu_status check_uniform(const insitu_lattice *l, base_error *error)
{
    for (int axis = 0; axis < 3; axis++) {
        if (!isfinite(l->origin[axis]) || !isfinite(l->spacing[axis]))
            return base_fail(error, INSITU_ERROR_MESH, "lattice: origin %g and spacing %g along %c are not finite",
                             l->origin[axis], l->spacing[axis], axis_name[axis]);
        if (l->spacing[axis] == 0 && l->cells[axis])
            return base_fail(error, INSITU_ERROR_MESH, "lattice: the spacing along %c is 0", axis_name[axis]);
        if (l->first[axis] < -largest_first || l->first[axis] > largest_first)
            return base_fail(error, INSITU_ERROR_MESH, "lattice: first along %c is %lld, expected at most %lld in size",
                             axis_name[axis], (long long)l->first[axis], (long long)largest_first);
    }
    if (is_rectilinear(l))
        return base_fail(error, INSITU_ERROR_MESH,
                         "lattice: spacing and axes are given: give coordinates by one of them");
    return INSITU_OK;
}

static insitu_status check_axes(const insitu_lattice *l, base_error *error)
{
    static const char *const names[3] = {"coordinates along i", "coordinates along j", "coordinates along k"};
    for (int axis = 0; axis < 3; axis++) {
        const int optional = l->cells[axis] ? 0 : SESSION_IS_OPTIONAL;
        const session_array_rule rule = {names[axis], count_vertices_along(l, axis),
                                         SESSION_ALLOW_FLOATS | SESSION_ALLOW_ANY | optional, 1};
        const insitu_status status = session_check_array(&l->axes[axis], &rule, INSITU_ERROR_MESH, error);
        if (status) return status;
    }
    return INSITU_OK;
}

/* Checks that a mesh with a lattice does not also describe its cells by connectivity or faces. */
static insitu_status check_no_other_cell_arrays(const insitu_mesh *mesh, base_error *error)
{
    const struct {
        const char *name;
        bool is_given;
    } others[] = {{"connectivity indices", mesh->connectivity.data || mesh->connectivity_count},
                  {"offsets", mesh->offsets.data},
                  {"cell types", mesh->cell_types.data},
                  {"face vertex indices", mesh->face_connectivity.data || mesh->face_count},
                  {"owners of faces", mesh->owner.data || mesh->boundary_owner.data},
                  {"rows of connectivity", mesh->connectivity_row}};
    for (size_t i = 0; i < sizeof others / sizeof others[0]; i++)
        if (others[i].is_given)
            return base_fail(error, INSITU_ERROR_MESH, "a lattice and %s are given: give cells by one of them",
                             others[i].name);
    return INSITU_OK;
}

insitu_status session_check_lattice(const insitu_mesh *mesh, base_error *error)
{
    const insitu_lattice *l = mesh->lattice;
    insitu_status status = check_no_other_cell_arrays(mesh, error);
    if (!status) status = check_cells(l, error);
    if (status || (are_all_zero(l->cells) && !mesh->cell_count)) return status;
    if (are_all_zero(l->cells))
        return base_fail(error, INSITU_ERROR_MESH,
                         "lattice: there are no cells along i, j and k, and cell_count is %lld",
                         (long long)mesh->cell_count);
    status = check_vertex_and_cell_strides(mesh, error);
    if (!status) status = check_interior(l, error);
    if (!status) status = check_refinement(l, error);
    if (!status && session_has_axis_coordinates(mesh) &&
        (mesh->coordinates[0].data || mesh->coordinates[1].data || mesh->coordinates[2].data))
        return base_fail(error, INSITU_ERROR_MESH,
                         "lattice: %s and coordinates of vertices are given: give one of them",
                         is_uniform(l) ? "spacing" : "axes");
    if (!status && !session_has_axis_coordinates(mesh) && !mesh->coordinates[0].data && !mesh->coordinates[1].data &&
        !mesh->coordinates[2].data)
        return base_fail(error, INSITU_ERROR_MESH, "lattice: neither spacing nor axes nor coordinates are given");
    if (!status && is_uniform(l)) status = check_uniform(l, error);
    if (!status && !is_uniform(l) && is_rectilinear(l)) status = check_axes(l, error);
    return status;
}

unsigned session_lattice_changes(const insitu_lattice *a, const insitu_lattice *b)
{
    unsigned changes = 0;
    if (!a || !b) return a == b ? INSITU_CHANGED_NOTHING : INSITU_CHANGED_ALL;
    if (memcmp(a->cells, b->cells, sizeof a->cells) != 0 ||
        memcmp(a->vertex_strides, b->vertex_strides, sizeof a->vertex_strides) != 0 ||
        memcmp(a->cell_strides, b->cell_strides, sizeof a->cell_strides) != 0)
        return INSITU_CHANGED_ALL;
    if (memcmp(a->interior_first, b->interior_first, sizeof a->interior_first) != 0 ||
        memcmp(a->interior_end, b->interior_end, sizeof a->interior_end) != 0)
        changes |= INSITU_CHANGED_TOPOLOGY;
    const bool is_moved = memcmp(a->first, b->first, sizeof a->first) != 0;
    /* the set of cells that finer blocks cover may have changed, in this block and in coarser blocks */
    if (memcmp(a->refinement, b->refinement, sizeof a->refinement) != 0 || (is_moved && !are_all_zero(a->refinement)))
        changes |= INSITU_CHANGED_TOPOLOGY;
    for (int axis = 0; axis < 3; axis++)
        if (a->origin[axis] != b->origin[axis] || a->spacing[axis] != b->spacing[axis] ||
            a->first[axis] != b->first[axis] || !session_is_same_array(&a->axes[axis], &b->axes[axis]))
            changes |= INSITU_CHANGED_GEOMETRY;
    return changes;
}

/* ---- the grid that reads a lattice ------------------------------------------------------------------------------- */

static grid_numbering make_numbering(const int64_t strides[3], const int64_t counts[3])
{
    grid_numbering out = {{0}, {0}, {0}, {0}};
    int order[3], above = -1;
    sort_axes_by_stride(strides, counts, order);
    for (int i = 2; i >= 0; i--) {
        const int axis = order[i];
        if (counts[axis] == 1) continue;
        out.stride[axis] = strides[axis];
        out.inverse_stride[axis] = 1 / (double)strides[axis];
        if (above >= 0) {
            out.outer[axis] = (double)strides[above];
            out.inverse_outer[axis] = 1 / (double)strides[above];
        }
        above = axis;
    }
    return out;
}

void session_copy_lattice(session_mesh *mesh)
{
    session_lattice *own = &mesh->lattice;
    const bool is_given = mesh->given.lattice && !are_all_zero(mesh->given.lattice->cells);
    if (!mesh->given.lattice) return;
    own->given = *mesh->given.lattice;
    mesh->given.lattice = &own->given;
    if (!is_given) return;
    static const signed char hex[8][3] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0},
                                          {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}};
    const insitu_lattice *l = &own->given;
    grid_lattice *out = &own->cells;
    int64_t vertices[3], cells[3], packed[3];
    const bool has_all = are_all_zero(l->interior_first) && are_all_zero(l->interior_end);
    for (int axis = 0; axis < 3; axis++) {
        vertices[axis] = count_vertices_along(l, axis);
        cells[axis] = count_cells_along(l, axis);
        out->cells[axis] = l->cells[axis];
        out->drawn_first[axis] = has_all ? 0 : l->interior_first[axis];
        out->drawn_end[axis] = has_all ? cells[axis] : l->interior_end[axis];
        out->axes[axis] = (grid_axis){own->axis_coordinates[axis], vertices[axis], &out->vertex_numbering, axis};
    }
    compute_packed_strides(vertices, packed);
    out->vertex_numbering = make_numbering(are_all_zero(l->vertex_strides) ? packed : l->vertex_strides, vertices);
    /* in a lattice of quads, the axis without cells is moved to the end, so that the first four of a cell's eight
     * corners are those of the quad */
    const int last = l->cells[0] ? l->cells[1] ? 2 : 1 : 0, axes[3] = {last == 0, last == 2 ? 1 : 2, last};
    for (int i = 0; i < 8; i++) {
        out->corner_offsets[i] = 0;
        for (int n = 0; n < 3; n++) out->corner_offsets[i] += hex[i][n] * out->vertex_numbering.stride[axes[n]];
    }
    compute_packed_strides(cells, packed);
    out->cell_numbering = make_numbering(are_all_zero(l->cell_strides) ? packed : l->cell_strides, cells);
    out->cell_count = cells[0] * cells[1] * cells[2];
    out->has_ghosts = !has_all || out->cell_count != mesh->given.cell_count;
}

void session_set_lattice_of_grid(session_mesh *mesh, grid *g)
{
    const insitu_lattice *l = mesh->given.lattice;
    if (!l || are_all_zero(l->cells)) return;
    g->lattice = &mesh->lattice.cells;
    g->cell_type = session_is_quad_lattice(l) ? GRID_QUAD : GRID_HEX;
    for (int axis = 0; axis < 3 && session_has_axis_coordinates(&mesh->given); axis++)
        g->coordinates[axis] = (grid_array){.is_wide = true, .axis = &mesh->lattice.cells.axes[axis]};
}

void session_fill_axis_coordinates(const insitu_lattice *l, int axis, double *out)
{
    const grid_array given = session_grid_array(&l->axes[axis]);
    for (int64_t n = 0; n < count_vertices_along(l, axis); n++) {
        out[n] = 0;
        if (is_uniform(l)) out[n] = l->origin[axis] + l->spacing[axis] * (double)(l->first[axis] + n);
        if (given.data) out[n] = grid_read_number(&given, n);
    }
}

insitu_status session_compute_axis_coordinates(session_mesh *mesh, base_error *error)
{
    session_lattice *own = &mesh->lattice;
    session_drop_axes(own);
    if (!mesh->cells.lattice || !mesh->cells.coordinates[0].axis) return INSITU_OK;
    const insitu_lattice *l = &own->given;
    for (int axis = 0; axis < 3; axis++) {
        const int64_t count = count_vertices_along(l, axis);
        double *coordinates = base_alloc((size_t)count * sizeof *coordinates);
        if (!coordinates)
            return base_fail(error, INSITU_ERROR_MEMORY, "mesh \"%s\": no memory for %lld coordinates along %c",
                             mesh->label, (long long)count, axis_name[axis]);
        session_fill_axis_coordinates(l, axis, coordinates);
        own->axis_coordinates[axis] = coordinates;
        own->cells.axes[axis].axis_coordinates = coordinates;
        own->bytes += count * (int64_t)sizeof *coordinates;
        for (int64_t n = 0; n < count; n++)
            if (!isfinite(coordinates[n]))
                return base_fail(error, INSITU_ERROR_MESH,
                                 "mesh \"%s\": lattice: coordinate %lld along %c is not finite: %g", mesh->label,
                                 (long long)n, axis_name[axis], coordinates[n]);
    }
    return INSITU_OK;
}
