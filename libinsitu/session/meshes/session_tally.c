#include "session_tally.h"

#include <string.h>

#include "mmbvh_fetch.h"
#include "session_corners.h"
#include "session_lanes.h"
#include "session_polyhedron.h"

mesh_tally tally_empty(void)
{
    return (mesh_tally){.lower = {INFINITY, INFINITY, INFINITY}, .upper = {-INFINITY, -INFINITY, -INFINITY}};
}

void tally_merge(mesh_tally *sum, const mesh_tally *part)
{
    for (int axis = 0; axis < 3; axis++) {
        sum->lower[axis] = fmin(sum->lower[axis], part->lower[axis]);
        sum->upper[axis] = fmax(sum->upper[axis], part->upper[axis]);
    }
    sum->drawn_count += part->drawn_count;
    sum->ghost_count += part->ghost_count;
    sum->shell_count += part->shell_count;
    sum->inverted_count += part->inverted_count;
    sum->flat_count += part->flat_count;
    sum->size_sum += part->size_sum;
}

/* ---- volumes and sizes --------------------------------------------------------------------------------------- */

MMBVH_INLINE double determinant3(const double u[3], const double v[3], const double w[3])
{
    return u[0] * (v[1] * w[2] - v[2] * w[1]) + u[1] * (v[2] * w[0] - v[0] * w[2]) + u[2] * (v[0] * w[1] - v[1] * w[0]);
}

MMBVH_INLINE double corner_volume(double points[][3], const signed char corner[4])
{
    double edge[3][3];
    for (int k = 0; k < 3; k++)
        for (int axis = 0; axis < 3; axis++) edge[k][axis] = points[corner[k + 1]][axis] - points[corner[0]][axis];
    return determinant3(edge[0], edge[1], edge[2]);
}

MMBVH_INLINE double signed_volume(int type, double points[][3])
{
    const cell_corners of = get_corners_of_cell_type(type);
    double sum = 0;
    for (int i = 0; i < of.count; i++) sum += corner_volume(points, of.corners[i]);
    return sum / of.volume_factor;
}

double tally_signed_volume(int type, double points[][3])
{
    return signed_volume(type, points);
}

/* Upper bound of the rounding error of the volume of a cell whose exact volume is 0, as a fraction of the volume b of
 * its bounding box. The volume is a sum of n determinants, divided by d (session_corners.h). A determinant is a sum of
 * six products of three edge components, one along each axis; each product is at most b. Let u be 2^-53. A product has
 * at most 8 roundings: 3 of its components, 2 in multiplications, 3 in additions. The error of a determinant is
 * therefore at most 48 u b. The sum of n determinants is at most 6 n b, and its n - 1 additions have an error of u
 * times this each. The error of the volume is thus at most (8 + n - 1) 6 n u b / d: 8 u b for a tet (n = 1, d = 6), 90
 * u b for a hex (n = 8, d = 8), 39 u b for a wedge (n = 6, d = 12), 22 u b for a pyramid (n = 4, d = 12). The bound of
 * 128 u leaves a margin for the rounding of the division and of the box's volume, and for squares of u. */
static const double flat_share = 0x1p-46;

MMBVH_INLINE bool is_flat_volume(double volume, double box)
{
    return fabs(volume) <= flat_share * box;
}

MMBVH_INLINE double box_volume(double points[][3], int count)
{
    double box = 1;
    for (int axis = 0; axis < 3; axis++) {
        double low = points[0][axis], high = low;
        for (int i = 1; i < count; i++) {
            low = points[i][axis] < low ? points[i][axis] : low;
            high = points[i][axis] > high ? points[i][axis] : high;
        }
        box *= high - low;
    }
    return box;
}

/* Returns whether the determinant of the edges is 0, up to rounding, at each of the cell's corners. The determinants of
 * a cell that intersects itself may sum to 0 although the cell is not flat. */
static bool is_flat_everywhere(int type, double points[][3])
{
    const cell_corners of = get_corners_of_cell_type(type);
    double sum = 0;
    for (int i = 0; i < of.count; i++) sum += fabs(corner_volume(points, of.corners[i]));
    return is_flat_volume(sum / of.volume_factor, box_volume(points, grid_type_vertex_count(type)));
}

/* Computes the cube root of the volume by the same formula as the vectorized code (session_lane_loops.c), which takes
 * less time than the math library's function. */
MMBVH_INLINE double cell_size(double volume)
{
    if (!(volume > 1e-280 && volume < 1e280)) return cbrt(volume);
    uint64_t bits;
    double y;
    memcpy(&bits, &volume, sizeof bits);
    bits = (((bits >> 32) * CUBE_ROOT_THIRD >> 32) + CUBE_ROOT_OFFSET) << 32;
    memcpy(&y, &bits, sizeof y);
    for (int step = 0; step < CUBE_ROOT_STEPS; step++) {
        const double cube = y * y * y;
        y *= (cube + 2 * volume) / (2 * cube + volume);
    }
    return y;
}

/* Adds a drawn cell with this volume to *tally. For a flat cell, whose computed volume is only a rounding error, 0 must
 * be passed. */
MMBVH_INLINE void tally_drawn_cell_of_volume(mesh_tally *tally, double volume)
{
    tally->drawn_count++;
    tally->inverted_count += volume < 0;
    tally->size_sum += cell_size(fabs(volume));
}

MMBVH_INLINE void tally_shell(mesh_tally *tally)
{
    tally->drawn_count++;
    tally->flat_count++;
    tally->shell_count++;
}

MMBVH_INLINE void tally_extend_bounds(mesh_tally *tally, const double point[3])
{
    for (int axis = 0; axis < 3; axis++) {
        tally->lower[axis] = point[axis] < tally->lower[axis] ? point[axis] : tally->lower[axis];
        tally->upper[axis] = point[axis] > tally->upper[axis] ? point[axis] : tally->upper[axis];
    }
}

void tally_cell(const grid *g, int64_t cell, mesh_tally *tally)
{
    if (grid_is_ghost(g, cell)) {
        tally->ghost_count++;
        return;
    }
    const int type = grid_cell_type(g, cell);
    double points[GRID_MAX_CELL_VERTICES][3];
    grid_walk walk = grid_walk_cell(g, cell);
    int64_t vertex;
    for (int i = 0; grid_walk_next(&walk, &vertex); i++) {
        double *point = points[grid_type_vertex_count(type) ? i : 0];
        grid_read_vertex_position(g, vertex, point);
        tally_extend_bounds(tally, point);
    }
    if (grid_is_shell_type(type)) {
        tally_shell(tally);
        return;
    }
    bool is_flat_cell = false;
    double volume;
    if (type == GRID_POLYHEDRON) {
        volume = session_polyhedron_volume(g, cell, &is_flat_cell);
    } else {
        volume = signed_volume(type, points);
        is_flat_cell = is_flat_everywhere(type, points);
    }
    tally_drawn_cell_of_volume(tally, is_flat_cell ? 0 : volume);
    tally->flat_count += is_flat_cell;
}

/* ---- cells whose corners have different signs -------------------------------------------------------------------- */

/* The sign of a corner is ignored if the determinant of the three edges at the corner (at the corner of a quad: the
 * area of the parallelogram of its two edges) is less than this fraction of the largest one in the cell. Hexes with two
 * coincident vertices, and cells with a vertex on a nearly straight edge, have such corners. */
static const double least_share = 1e-6;

/* Computes the signed areas at a quad's corners, with respect to the normal at the first corner. */
static void compute_quad_corner_areas(double points[][3], double out[4])
{
    double normals[4][3];
    for (int i = 0; i < 4; i++) {
        double u[3], v[3];
        for (int axis = 0; axis < 3; axis++) {
            u[axis] = points[(i + 1) % 4][axis] - points[i][axis];
            v[axis] = points[(i + 3) % 4][axis] - points[i][axis];
        }
        for (int axis = 0; axis < 3; axis++) {
            const int b = (axis + 1) % 3, c = (axis + 2) % 3;
            normals[i][axis] = u[b] * v[c] - u[c] * v[b];
        }
        out[i] = 0;
        for (int axis = 0; axis < 3; axis++) out[i] += normals[0][axis] * normals[i][axis];
    }
}

bool tally_has_corners_of_both_signs(int type, double points[][3])
{
    const bool is_quad = type == GRID_QUAD;
    const cell_corners of = get_corners_of_cell_type(is_quad ? GRID_TET : type);
    double volumes[8], largest = 0;
    const int count = is_quad ? 4 : of.count;
    if (is_quad) compute_quad_corner_areas(points, volumes);
    for (int i = 0; i < count && !is_quad; i++) volumes[i] = corner_volume(points, of.corners[i]);
    for (int i = 0; i < count; i++) largest = fmax(largest, fabs(volumes[i]));
    bool has[2] = {false, false};
    for (int i = 0; i < count; i++)
        if (fabs(volumes[i]) > least_share * largest) has[volumes[i] < 0] = true;
    return has[0] && has[1];
}

bool tally_is_flat(const grid *g, int64_t cell)
{
    mesh_tally one = tally_empty();
    tally_cell(g, cell, &one);
    return one.flat_count > 0;
}

/* ---- tallies of consecutive cells -------------------------------------------------------------------------------- */

MMBVH_INLINE bool offsets_are_good(const session_mesh *mesh, int64_t cell, int count)
{
    const grid_array *offsets = &mesh->cells.offsets;
    if (!offsets->data) return true;
    const int64_t first = grid_read_index(offsets, cell), next = grid_offset_end(offsets, cell);
    return first >= 0 && next >= first && next <= mesh->topology.connectivity_count && next - first == count;
}

/* Reads the vertices' positions; returns false if an index is out of range or, for a drawn cell, a coordinate is not
 * finite. */
MMBVH_INLINE bool read_points(const grid *g, int64_t first, int count, bool is_ghost, double points[][3],
                              const fetch_shape shape, const bool wide_index, const bool wide_number)
{
    double poison = 0;
    for (int i = 0; i < count; i++) {
        const int64_t vertex = fetch_vertex(g, first, i, shape, wide_index);
        if (vertex < 0 || vertex >= g->vertex_count) return false;
        for (int axis = 0; axis < 3; axis++) {
            points[i][axis] = fetch_number(&g->coordinates[axis], vertex, wide_number);
            /* poison remains 0 if all coordinates are finite, and becomes NaN otherwise */
            poison += points[i][axis] - points[i][axis];
        }
    }
    return is_ghost || poison == 0;
}

/* Adds one cell to *t, and lowers *least to the cell's absolute volume if that is smaller. Returns false, without
 * adding anything, if the cell is invalid. */
MMBVH_INLINE bool tally_one_cell(const session_mesh *mesh, int64_t cell, mesh_tally *t, double *least,
                                 const fetch_shape shape, const bool wide_index, const bool wide_number)
{
    const grid *g = &mesh->cells;
    const int type = shape == FETCH_TETS ? GRID_TET : grid_cell_type(g, cell);
    const int count = fetch_vertex_count(g, cell, shape);
    if (count == 0 || (shape == FETCH_BY_CELL && !offsets_are_good(mesh, cell, count))) return false;
    const bool is_ghost = grid_is_ghost(g, cell);
    double points[GRID_MAX_CELL_VERTICES][3];
    if (!read_points(g, fetch_first_entry(g, cell, count, shape), count, is_ghost, points, shape, wide_index,
                     wide_number))
        return false;
    t->ghost_count += is_ghost;
    if (is_ghost) return true;
    for (int i = 0; i < count; i++) tally_extend_bounds(t, points[i]);
    if (shape == FETCH_BY_CELL && grid_is_shell_type(type)) {
        tally_shell(t);
        return true;
    }
    const double volume = signed_volume(type, points);
    *least = fabs(volume) < *least ? fabs(volume) : *least;
    tally_drawn_cell_of_volume(t, volume);
    return true;
}

/* Returns the longest sequence of consecutive cells, starting with `cell`, that have the same type and whose vertices
 * are contiguous in the connectivity. Vectorized code can process such a sequence. */
MMBVH_INLINE lane_cells find_uniform_run(const session_mesh *mesh, int64_t cell, int64_t end, const fetch_shape shape)
{
    const grid *g = &mesh->cells;
    const int type = shape == FETCH_TETS ? GRID_TET : grid_cell_type(g, cell);
    const int count = grid_type_vertex_count(type);
    lane_cells alike = {.g = g, .type = type, .first = cell, .count = end - cell, .first_entry = cell * count};
    if (shape != FETCH_BY_CELL) return alike;
    int64_t next = cell;
    while (next < end && grid_cell_type(g, next) == type && offsets_are_good(mesh, next, count)) next++;
    if (next > cell) alike.first_entry = fetch_first_entry(g, cell, count, shape);
    alike.count = next > cell ? next - cell : 1; /* a cell with invalid offsets is a sequence by itself */
    return alike;
}

/* Buffer for the connectivity of consecutive cells in a row of a lattice. A row contains the cells along the axis on
 * which cell indices are consecutive. */
enum { ROW_CELLS = 512 };
typedef struct lattice_row {
    grid cells;
    int32_t vertices[ROW_CELLS * GRID_MAX_CELL_VERTICES];
} lattice_row;

/* Returns a sequence of consecutive cells of a lattice that begins with `cell` and stays in one row, and writes the
 * connectivity of these cells into the buffer. If `cell` is not drawn, or if cell indices are not consecutive along any
 * axis, the sequence is this cell only, without connectivity in the buffer. */
static lane_cells find_row_run(const session_mesh *mesh, int64_t cell, int64_t end, lattice_row *row)
{
    const grid *g = &mesh->cells;
    const grid_lattice *l = g->lattice;
    lane_cells alike = {.g = g, .type = g->cell_type, .first = cell, .count = 1};
    const int along = grid_lattice_row_axis(l);
    if (along < 0 || g->vertex_count > INT32_MAX || !grid_lattice_is_drawn(l, cell)) return alike;
    const int64_t left = l->drawn_end[along] - grid_index_along(&l->cell_numbering, along, cell);
    const int64_t count = left < end - cell ? left : end - cell, step = l->vertex_numbering.stride[along];
    int64_t first = grid_lattice_first_vertex(l, cell);
    alike.count = count < ROW_CELLS ? count : ROW_CELLS;
    for (int64_t n = 0; n < alike.count; n++, first += step)
        for (int i = 0; i < GRID_MAX_CELL_VERTICES; i++)
            row->vertices[n * GRID_MAX_CELL_VERTICES + i] = (int32_t)(first + l->corner_offsets[i]);
    row->cells = *g;
    row->cells.lattice = NULL;
    row->cells.connectivity =
        (grid_array){.data = (const char *)row->vertices, .stride = sizeof *row->vertices, .is_integer = true};
    if (g->ghosts) row->cells.ghosts = g->ghosts + cell * g->ghosts_stride;
    alike.g = &row->cells;
    alike.first = 0;
    return alike;
}

/* Adds the first cells of the sequence to *t by vectorized code, and lowers *least to the smallest absolute volume of
 * these cells if that is smaller. Returns the number of cells that were added. *alone receives the number of cells
 * after them that must be added one by one. */
static int64_t tally_cells_in_lanes(const lane_cells *alike, mesh_tally *t, double *least, int64_t *alone)
{
    *alone = alike->count;
    /* a sequence whose grid has a lattice consists of a single cell (find_row_run()) */
    if (alike->count < LANES || alike->g->lattice) return 0;
    lane_run *const run = session_get_cell_loop_for_type(cpu_best_isa(), alike->g, alike->type);
    if (!run) return 0;
    lane_sums sums;
    const int64_t taken = run(alike, &sums, alone);
    mesh_tally part = {.drawn_count = taken, .inverted_count = sums.inverted_count, .size_sum = sums.size_sum};
    memcpy(part.lower, sums.lower, sizeof part.lower);
    memcpy(part.upper, sums.upper, sizeof part.upper);
    tally_merge(t, &part);
    *least = sums.least < *least ? sums.least : *least;
    return taken;
}

/* Computes the tally of the cells begin .. end - 1 a second time, and compares each cell's volume with that of the
 * cell's own bounding box to find out whether the cell is flat. This is needed only if the smallest volume is so small,
 * compared to the common bounding box of these cells, that a cell may be flat. Computing each cell's box in the first
 * pass would take a thirtieth of its time for a mesh of tets. */
static mesh_tally tally_cells_with_own_boxes(const grid *g, int64_t begin, int64_t end)
{
    mesh_tally again = tally_empty();
    for (int64_t cell = begin; cell < end; cell++) tally_cell(g, cell, &again);
    return again;
}

MMBVH_INLINE bool may_contain_flat_cell(const mesh_tally *t, double least)
{
    double box = 1;
    for (int axis = 0; axis < 3; axis++) box *= t->upper[axis] - t->lower[axis];
    return is_flat_volume(least, box);
}

/* The lengths of the drawn cells along one axis. */
typedef struct axis_lengths {
    /* number of cells whose length along the axis is positive, and number of cells whose length is negative; the length
     * of all other cells is 0 */
    int64_t positive_count, negative_count;
    double size_sum; /* sum of the cube roots of the cells' absolute lengths along the axis */
    double lower, upper;
} axis_lengths;

static axis_lengths measure_cell_lengths_along_axis(const grid_lattice *l, int axis)
{
    const double *at = l->axes[axis].axis_coordinates + l->drawn_first[axis];
    const int64_t count = l->drawn_end[axis] - l->drawn_first[axis];
    axis_lengths out = {.lower = at[0], .upper = at[0]};
    for (int64_t n = 0; n < count && l->cells[axis]; n++) {
        const double length = at[n + 1] - at[n];
        out.positive_count += length > 0;
        out.negative_count += length < 0;
        out.size_sum += cbrt(fabs(length));
        out.lower = fmin(out.lower, at[n + 1]);
        out.upper = fmax(out.upper, at[n + 1]);
    }
    return out;
}

bool tally_lattice_by_axes(const session_mesh *mesh, mesh_tally *tally)
{
    const grid *g = &mesh->cells;
    if (!g->coordinates[0].axis || g->ghosts) return false;
    mesh_tally t = tally_empty();
    /* sized: product over the axes of (positive_count + negative_count), which is the number of cells with a volume;
     * difference: product over the axes of (positive_count - negative_count), which is the number of right-handed cells
     * minus the number of left-handed ones */
    int64_t sized = 1, difference = 1;
    t.drawn_count = 1;
    t.size_sum = 1;
    for (int axis = 0; axis < 3; axis++) {
        const axis_lengths along = measure_cell_lengths_along_axis(g->lattice, axis);
        t.drawn_count *= g->lattice->drawn_end[axis] - g->lattice->drawn_first[axis];
        sized *= along.positive_count + along.negative_count;
        difference *= along.positive_count - along.negative_count;
        t.size_sum *= along.size_sum;
        t.lower[axis] = along.lower;
        t.upper[axis] = along.upper;
    }
    if (!t.drawn_count) t = tally_empty();
    t.ghost_count = g->cell_count - t.drawn_count;
    t.flat_count = t.drawn_count - (t.drawn_count ? sized : 0);
    t.inverted_count = t.drawn_count ? (sized - difference) / 2 : 0;
    if (g->cell_type == GRID_QUAD) t.shell_count = t.drawn_count;
    tally_merge(tally, &t);
    return true;
}

/* Adds the cells begin .. end - 1 of a uniform or rectilinear lattice, which are axis-aligned boxes or rectangles or
 * have no volume, to *tally. Returns `end`. */
static int64_t tally_lattice_cells(const session_mesh *mesh, int64_t begin, int64_t end, mesh_tally *tally)
{
    const grid *g = &mesh->cells;
    mesh_tally t = tally_empty();
    for (int64_t cell = begin; cell < end; cell++) {
        if (grid_is_ghost(g, cell)) {
            t.ghost_count++;
            continue;
        }
        fetch_box box;
        double volume = 1;
        fetch_box_empty(&box);
        extend_box_by_lattice_cell(&box, g->lattice, cell);
        tally_extend_bounds(&t, box.lower);
        tally_extend_bounds(&t, box.upper);
        for (int axis = 0; axis < 3; axis++) {
            const double *at =
                g->lattice->axes[axis].axis_coordinates + grid_index_along(&g->lattice->cell_numbering, axis, cell);
            volume *= g->lattice->cells[axis] ? at[1] - at[0] : 0;
        }
        t.flat_count += volume == 0;
        if (g->cell_type == GRID_QUAD)
            t.shell_count++, t.drawn_count++;
        else
            tally_drawn_cell_of_volume(&t, volume);
    }
    tally_merge(tally, &t);
    return end;
}

MMBVH_INLINE int64_t tally_cells(const session_mesh *mesh, int64_t begin, int64_t end, mesh_tally *tally,
                                 const fetch_shape shape, const bool wide_index, const bool wide_number)
{
    mesh_tally t = tally_empty();
    lane_cells alike = {.count = 0};
    lattice_row row;
    double least = (double)INFINITY;
    bool is_good = true;
    int64_t cell = begin;
    while (cell < end && is_good) {
        int64_t alone;
        if (!alike.count)
            alike =
                shape == FETCH_LATTICE ? find_row_run(mesh, cell, end, &row) : find_uniform_run(mesh, cell, end, shape);
        const int64_t taken = tally_cells_in_lanes(&alike, &t, &least, &alone), first = cell + taken;
        cell = first;
        while (cell < first + alone && is_good)
            if ((is_good = tally_one_cell(mesh, cell, &t, &least, shape, wide_index, wide_number))) cell++;
        alike.first += taken + alone;
        alike.first_entry += (taken + alone) * grid_type_vertex_count(alike.type);
        alike.count -= taken + alone;
    }
    if (may_contain_flat_cell(&t, least)) t = tally_cells_with_own_boxes(&mesh->cells, begin, cell);
    tally_merge(tally, &t);
    return cell;
}

#define DEFINE_RUN(name, shape, wide_index, wide_number)                                                               \
    static int64_t name(const session_mesh *mesh, int64_t begin, int64_t end, mesh_tally *tally)                       \
    {                                                                                                                  \
        return tally_cells(mesh, begin, end, tally, shape, wide_index, wide_number);                                   \
    }
FETCH_INSTANCES(DEFINE_RUN, tally_cells)

tally_run tally_choose_check_function(const session_mesh *mesh)
{
    static const tally_run table[FETCH_SHAPES][2][2] = FETCH_TABLE(tally_cells);
    const grid *g = &mesh->cells;
    if (g->coordinates[0].axis) return tally_lattice_cells;
    if (!fetch_can_read_boxes(g) || (!g->cell_types && grid_is_shell_type(g->cell_type))) return NULL;
    return table[fetch_grid_shape(g)][g->connectivity.is_wide][g->coordinates[0].is_wide];
}
