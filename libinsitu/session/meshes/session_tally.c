#include "session_tally.h"

#include <string.h>

#include "mmbvh_fetch.h"
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
    sum->drawn += part->drawn;
    sum->ghosts += part->ghosts;
    sum->shells += part->shells;
    sum->inverted += part->inverted;
    sum->flat += part->flat;
    sum->sizes += part->sizes;
}

/* ---- volumes and sizes --------------------------------------------------------------------------------------- */

/* A type's corners, each with its three neighbours in right-handed order: the cell's volume is what their tets'
 * volumes, six times, sum to, over shares. Exact for cells with parallel edges, else a mean. */
typedef struct cell_corners {
    const signed char (*corners)[4];
    int count;
    double shares; /* what a cell of volume 1 sums to */
} cell_corners;

MMBVH_INLINE cell_corners corners_of(int type)
{
    static const signed char tet[][4] = {{0, 1, 2, 3}};
    static const signed char hex[][4] = {{0, 1, 3, 4}, {1, 2, 0, 5}, {2, 3, 1, 6}, {3, 0, 2, 7},
                                         {4, 7, 5, 0}, {5, 4, 6, 1}, {6, 5, 7, 2}, {7, 6, 4, 3}};
    static const signed char wedge[][4] = {{0, 1, 2, 3}, {1, 2, 0, 4}, {2, 0, 1, 5},
                                           {3, 5, 4, 0}, {4, 3, 5, 1}, {5, 4, 3, 2}};
    static const signed char pyramid[][4] = {{0, 1, 3, 4}, {1, 2, 0, 4}, {2, 3, 1, 4}, {3, 0, 2, 4}};
    if (type == GRID_TET) return (cell_corners){tet, 1, 6};
    if (type == GRID_HEX) return (cell_corners){hex, 8, 8};
    return type == GRID_WEDGE ? (cell_corners){wedge, 6, 12} : (cell_corners){pyramid, 4, 12};
}

MMBVH_INLINE double determinant(const double u[3], const double v[3], const double w[3])
{
    return u[0] * (v[1] * w[2] - v[2] * w[1]) + u[1] * (v[2] * w[0] - v[0] * w[2]) + u[2] * (v[0] * w[1] - v[1] * w[0]);
}

MMBVH_INLINE double corner_volume(double points[][3], const signed char corner[4])
{
    double edge[3][3];
    for (int k = 0; k < 3; k++)
        for (int axis = 0; axis < 3; axis++) edge[k][axis] = points[corner[k + 1]][axis] - points[corner[0]][axis];
    return determinant(edge[0], edge[1], edge[2]);
}

MMBVH_INLINE double signed_volume(int type, double points[][3])
{
    const cell_corners of = corners_of(type);
    double sum = 0;
    for (int i = 0; i < of.count; i++) sum += corner_volume(points, of.corners[i]);
    return sum / of.shares;
}

double tally_signed_volume(int type, double points[][3])
{
    return signed_volume(type, points);
}

/* The share of its box's volume ex ey ez that rounding may leave of a cell without volume. With u = 2^-53: a
 * determinant is six products of one component along each axis, none longer than the box, and each passes at most 8
 * roundings (3 of edges, 2 of products, 3 of sums), so it is off by 48 u of the box at most. n of them sum with n - 1
 * roundings more of 6 of the box each, and count over shares: (8 + n - 1) 6 n / shares, 8 u of a tet, 90 u of a hex, 39
 * u of a wedge, 22 u of a pyramid. 128 u leaves room for the division's rounding, the box's own and squares of u. */
static const double flat_share = 0x1p-46;

MMBVH_INLINE bool is_flat(double volume, double box)
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

/* Tells whether the cell has no volume at any of its corners. A cell that is turned through itself may have none in
 * sum, and still be there. */
static bool is_flat_everywhere(int type, double points[][3])
{
    const cell_corners of = corners_of(type);
    double sum = 0;
    for (int i = 0; i < of.count; i++) sum += fabs(corner_volume(points, of.corners[i]));
    return is_flat(sum / of.shares, box_volume(points, grid_type_vertices(type)));
}

MMBVH_INLINE bool has_usual_root(double x)
{
    return x > 1e-280 && x < 1e280;
}

/* Approximates the cube root to 0.033 by a third of the bits, since a double's bits are its logarithm to within 0.09.
 */
MMBVH_INLINE double cube_root_begin(double x)
{
    uint64_t bits;
    double y;
    memcpy(&bits, &x, sizeof bits);
    bits = bits / 3 + 0x2a9f7893782da1ceu; /* two thirds of 1.0's bits, less the part that the mantissa leaves */
    memcpy(&y, &bits, sizeof y);
    return y;
}

/* A step of Halley's method cubes the error: two from the begin on leave 2.1e-5, then rounding. */
MMBVH_INLINE double cube_root_step(double x, double y)
{
    const double cube = y * y * y;
    return y * ((cube + 2 * x) / (2 * cube + x));
}

/* The cube root, without a call where volumes are of any usual size. */
MMBVH_INLINE double cube_root(double x)
{
    if (!has_usual_root(x)) return cbrt(x);
    return cube_root_step(x, cube_root_step(x, cube_root_begin(x)));
}

/* 0 of a flat cell, whatever sign and size rounding left it. */
MMBVH_INLINE void tally_volume(mesh_tally *tally, double volume)
{
    tally->drawn++;
    tally->inverted += volume < 0;
    tally->sizes += cube_root(fabs(volume));
}

MMBVH_INLINE void tally_shell(mesh_tally *tally)
{
    tally->drawn++;
    tally->flat++;
    tally->shells++;
}

MMBVH_INLINE void tally_point(mesh_tally *tally, const double point[3])
{
    for (int axis = 0; axis < 3; axis++) {
        tally->lower[axis] = point[axis] < tally->lower[axis] ? point[axis] : tally->lower[axis];
        tally->upper[axis] = point[axis] > tally->upper[axis] ? point[axis] : tally->upper[axis];
    }
}

void tally_cell(const grid *g, int64_t cell, mesh_tally *tally)
{
    if (grid_is_ghost(g, cell)) {
        tally->ghosts++;
        return;
    }
    const int type = grid_cell_type(g, cell);
    double points[GRID_MAX_CELL_VERTICES][3];
    grid_walk walk = grid_walk_cell(g, cell);
    int64_t vertex;
    for (int i = 0; grid_walk_next(&walk, &vertex); i++) {
        double *point = points[grid_type_vertices(type) ? i : 0];
        grid_vertex(g, vertex, point);
        tally_point(tally, point);
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
    tally_volume(tally, is_flat_cell ? 0 : volume);
    tally->flat += is_flat_cell;
}

/* ---- quads that cross themselves ----------------------------------------------------------------------------- */

enum { CROSSED_SAMPLES = 256 };

static bool is_crossed(const grid *g, int64_t cell, int type)
{
    static const signed char exchanged[8] = {0, 1, 3, 2, 4, 5, 7, 6};
    double points[GRID_MAX_CELL_VERTICES][3], turned[GRID_MAX_CELL_VERTICES][3];
    int64_t vertices[GRID_MAX_CELL_VERTICES];
    const int count = grid_cell_vertices(g, cell, vertices);
    for (int i = 0; i < count; i++) grid_vertex(g, vertices[i], points[i]);
    for (int i = 0; i < count; i++) memcpy(turned[i], points[exchanged[i]], sizeof turned[i]);
    return fabs(signed_volume(type, turned)) > 2 * fabs(signed_volume(type, points));
}

void tally_crossed(const session_mesh *mesh, int64_t *looked_at, int64_t *crossed)
{
    const grid *g = &mesh->cells;
    const int64_t step = g->cell_count / CROSSED_SAMPLES + 1;
    *looked_at = *crossed = 0;
    for (int64_t cell = 0; cell < g->cell_count; cell += step) {
        const int type = grid_cell_type(g, cell);
        if (grid_is_ghost(g, cell) || (type != GRID_HEX && type != GRID_PYRAMID)) continue;
        ++*looked_at;
        *crossed += is_crossed(g, cell, type);
    }
}

bool tally_is_flat(const grid *g, int64_t cell)
{
    mesh_tally one = tally_empty();
    tally_cell(g, cell, &one);
    return one.flat > 0;
}

double tally_cell_volume(const grid *g, int64_t cell)
{
    bool is_flat_cell;
    double points[GRID_MAX_CELL_VERTICES][3];
    const int type = grid_cell_type(g, cell);
    if (grid_is_shell_type(type)) return 0;
    if (type == GRID_POLYHEDRON) return fabs(session_polyhedron_volume(g, cell, &is_flat_cell));
    grid_walk walk = grid_walk_cell(g, cell);
    int64_t vertex;
    for (int i = 0; grid_walk_next(&walk, &vertex); i++) grid_vertex(g, vertex, points[i]);
    return fabs(signed_volume(type, points));
}

/* ---- runs ---------------------------------------------------------------------------------------------------- */

MMBVH_INLINE bool offsets_are_good(const session_mesh *mesh, int64_t cell, int count)
{
    const grid_array *offsets = &mesh->cells.offsets;
    if (!offsets->data) return true;
    const int64_t first = grid_array_index(offsets, cell), next = grid_array_index(offsets, cell + 1);
    return first >= 0 && next <= mesh->topology.connectivity_count && next - first == count;
}

/* The vertices' positions; false where an index is out of range or, of a drawn cell, a coordinate is not finite. */
MMBVH_INLINE bool take_points(const grid *g, int64_t first, int count, bool is_ghost, double points[][3],
                              const bool wide_index, const bool wide_number)
{
    double poison = 0;
    for (int i = 0; i < count; i++) {
        const int64_t vertex = fetch_index(&g->connectivity, first + i, wide_index);
        if (vertex < 0 || vertex >= g->vertex_count) return false;
        for (int axis = 0; axis < 3; axis++) {
            points[i][axis] = fetch_number(&g->coordinates[axis], vertex, wide_number);
            poison += points[i][axis] - points[i][axis]; /* 0 while all are finite, then not a number */
        }
    }
    return is_ghost || poison == 0;
}

/* False where the cell is bad. */
MMBVH_INLINE bool run_cell(const session_mesh *mesh, int64_t cell, mesh_tally *t, double *least,
                           const fetch_shape shape, const bool wide_index, const bool wide_number)
{
    const grid *g = &mesh->cells;
    const int type = shape == FETCH_TETS ? GRID_TET : grid_cell_type(g, cell);
    const int count = fetch_vertex_count(g, cell, shape);
    if (count == 0 || (shape == FETCH_BY_CELL && !offsets_are_good(mesh, cell, count))) return false;
    const bool is_ghost = grid_is_ghost(g, cell);
    double points[GRID_MAX_CELL_VERTICES][3];
    if (!take_points(g, fetch_first(g, cell, count, shape), count, is_ghost, points, wide_index, wide_number))
        return false;
    t->ghosts += is_ghost;
    if (is_ghost) return true;
    for (int i = 0; i < count; i++) tally_point(t, points[i]);
    if (shape == FETCH_BY_CELL && grid_is_shell_type(type)) {
        tally_shell(t);
        return true;
    }
    const double volume = signed_volume(type, points);
    *least = fabs(volume) < *least ? fabs(volume) : *least;
    tally_volume(t, volume);
    return true;
}

/* ---- cells of one type, LANES at once ----
 *
 * The same operations on each cell, in an order that the compiler makes vectors of. Where anything is unusual about one
 * of them (a bad index, a ghost, a volume that is not finite or has no usual root) they are taken one by one instead. A
 * volume is finite only where all coordinates are: each is in a product of it, and what is not finite stays so. */

enum { LANES = 8 };

typedef double lanes[LANES];

typedef struct lane_bounds {
    lanes lower[3], upper[3];
    lanes least; /* volume without its sign */
} lane_bounds;

MMBVH_INLINE lane_bounds lane_bounds_empty(void)
{
    lane_bounds b;
    for (int lane = 0; lane < LANES; lane++) b.least[lane] = (double)INFINITY;
    for (int axis = 0; axis < 3; axis++)
        for (int lane = 0; lane < LANES; lane++) {
            b.lower[axis][lane] = (double)INFINITY;
            b.upper[axis][lane] = -(double)INFINITY;
        }
    return b;
}

MMBVH_INLINE void tally_bounds(mesh_tally *t, const lane_bounds *b)
{
    for (int axis = 0; axis < 3; axis++)
        for (int lane = 0; lane < LANES; lane++) {
            const double lower = b->lower[axis][lane], upper = b->upper[axis][lane];
            t->lower[axis] = lower < t->lower[axis] ? lower : t->lower[axis];
            t->upper[axis] = upper > t->upper[axis] ? upper : t->upper[axis];
        }
}

/* Tells whether that many entries from the first on are indices of vertices, by the signs of index and last - index. */
MMBVH_INLINE bool are_vertices(const grid *g, int64_t first, const int count, const bool wide_index)
{
    const int64_t last = g->vertex_count - 1;
    if (!wide_index && g->connectivity.stride == sizeof(int32_t)) {
        const uint32_t *indices = (const uint32_t *)(const void *)g->connectivity.data + first;
        const uint32_t narrow_last = last < INT32_MAX ? (uint32_t)last : INT32_MAX;
        uint32_t signs = 0;
        for (int i = 0; i < count; i++) signs |= indices[i] | (narrow_last - indices[i]);
        return last >= 0 && !(signs >> 31);
    }
    int64_t signs = 0;
    for (int i = 0; i < count; i++) {
        const int64_t vertex = fetch_index(&g->connectivity, first + i, wide_index);
        signs |= vertex | (last - (vertex & INT64_MAX));
    }
    return signs >= 0;
}

MMBVH_INLINE void take_lanes(const grid *g, int64_t first, const int count, lanes at[][3], const bool wide_index,
                             const bool wide_number)
{
    const int64_t y = g->coordinates[1].data - g->coordinates[0].data;
    const int64_t z = g->coordinates[2].data - g->coordinates[0].data;
    for (int lane = 0; lane < LANES; lane++)
        for (int i = 0; i < count; i++) {
            const char *const vertex = fetch_vertex(g, first + lane * count + i, wide_index);
            const char *const place[3] = {vertex, vertex + y, vertex + z};
            for (int axis = 0; axis < 3; axis++)
                at[i][axis][lane] = wide_number ? *(const double *)(const void *)place[axis]
                                                : (double)*(const float *)(const void *)place[axis];
        }
}

MMBVH_INLINE void lane_volumes(const int type, lanes (*const at)[3], lanes volume)
{
    const cell_corners of = corners_of(type);
    for (int lane = 0; lane < LANES; lane++) volume[lane] = 0;
    for (int i = 0; i < of.count; i++) {
        const signed char *corner = of.corners[i];
        lanes *const o = at[corner[0]], *const a = at[corner[1]], *const b = at[corner[2]], *const c = at[corner[3]];
        for (int lane = 0; lane < LANES; lane++) {
            const double u[3] = {a[0][lane] - o[0][lane], a[1][lane] - o[1][lane], a[2][lane] - o[2][lane]};
            const double v[3] = {b[0][lane] - o[0][lane], b[1][lane] - o[1][lane], b[2][lane] - o[2][lane]};
            const double w[3] = {c[0][lane] - o[0][lane], c[1][lane] - o[1][lane], c[2][lane] - o[2][lane]};
            volume[lane] += determinant(u, v, w);
        }
    }
    for (int lane = 0; lane < LANES; lane++) volume[lane] /= of.shares;
}

MMBVH_INLINE void grow_lanes(lane_bounds *b, lanes (*const at)[3], const int count)
{
    for (int i = 0; i < count; i++)
        for (int axis = 0; axis < 3; axis++)
            for (int lane = 0; lane < LANES; lane++) {
                const double x = at[i][axis][lane];
                b->lower[axis][lane] = x < b->lower[axis][lane] ? x : b->lower[axis][lane];
                b->upper[axis][lane] = x > b->upper[axis][lane] ? x : b->upper[axis][lane];
            }
}

/* Takes volumes with usual roots only. */
MMBVH_INLINE void tally_volumes(mesh_tally *t, lanes least, const lanes volume)
{
    lanes size, root;
    for (int lane = 0; lane < LANES; lane++) size[lane] = fabs(volume[lane]);
    for (int lane = 0; lane < LANES; lane++) least[lane] = size[lane] < least[lane] ? size[lane] : least[lane];
    for (int lane = 0; lane < LANES; lane++) root[lane] = cube_root_begin(size[lane]);
    for (int step = 0; step < 2; step++)
        for (int lane = 0; lane < LANES; lane++) root[lane] = cube_root_step(size[lane], root[lane]);
    for (int lane = 0; lane < LANES; lane++) {
        t->inverted += volume[lane] < 0;
        t->sizes += root[lane];
    }
    t->drawn += LANES;
}

/* Returns false, with nothing done, where cells are to be taken one by one. */
MMBVH_INLINE bool run_lanes(const grid *g, int64_t cell, mesh_tally *t, lane_bounds *bounds, const fetch_shape shape,
                            const bool wide_index, const bool wide_number)
{
    const int type = shape == FETCH_TETS ? GRID_TET : shape == FETCH_HEXES ? GRID_HEX : g->cell_type;
    const int count = grid_type_vertices(type);
    lanes at[GRID_MAX_CELL_VERTICES][3], volume;
    for (int lane = 0; lane < LANES; lane++) fetch_ahead(g, cell + lane, shape);
    bool is_usual = are_vertices(g, cell * count, LANES * count, wide_index);
    if (g->ghosts)
        for (int lane = 0; lane < LANES; lane++) is_usual &= !grid_is_ghost(g, cell + lane);
    if (!is_usual) return false;
    take_lanes(g, cell * count, count, at, wide_index, wide_number);
    lane_volumes(type, at, volume);
    for (int lane = 0; lane < LANES; lane++) is_usual &= has_usual_root(fabs(volume[lane]));
    if (!is_usual) return false;
    grow_lanes(bounds, at, count);
    tally_volumes(t, bounds->least, volume);
    return true;
}

/* Cells of a run are tallied again, each with its own box, only if the least volume may be flat beside the box of all
 * of them. Computing all boxes would take a thirtieth of the time of a mesh of tets. */
static mesh_tally tally_again(const grid *g, int64_t begin, int64_t end)
{
    mesh_tally again = tally_empty();
    for (int64_t cell = begin; cell < end; cell++) tally_cell(g, cell, &again);
    return again;
}

MMBVH_INLINE bool may_be_flat(const mesh_tally *t, const lane_bounds *b, double least)
{
    double box = 1;
    for (int lane = 0; lane < LANES; lane++) least = b->least[lane] < least ? b->least[lane] : least;
    for (int axis = 0; axis < 3; axis++) box *= t->upper[axis] - t->lower[axis];
    return is_flat(least, box);
}

MMBVH_INLINE int64_t run(const session_mesh *mesh, int64_t begin, int64_t end, mesh_tally *tally,
                         const fetch_shape shape, const bool wide_index, const bool wide_number)
{
    mesh_tally t = tally_empty();
    lane_bounds bounds = lane_bounds_empty();
    double least = (double)INFINITY;
    bool is_good = true;
    int64_t cell = begin;
    while (cell < end && is_good) {
        const int64_t next = cell + LANES < end ? cell + LANES : end;
        if (shape != FETCH_BY_CELL && next - cell == LANES &&
            run_lanes(&mesh->cells, cell, &t, &bounds, shape, wide_index, wide_number)) {
            cell = next;
            continue;
        }
        while (cell < next && (is_good = run_cell(mesh, cell, &t, &least, shape, wide_index, wide_number))) cell++;
    }
    tally_bounds(&t, &bounds);
    if (may_be_flat(&t, &bounds, least)) t = tally_again(&mesh->cells, begin, cell);
    tally_merge(tally, &t);
    return cell;
}

#define DEFINE_RUN(name, shape, wide_index, wide_number)                                                               \
    static int64_t name(const session_mesh *mesh, int64_t begin, int64_t end, mesh_tally *tally)                       \
    {                                                                                                                  \
        return run(mesh, begin, end, tally, shape, wide_index, wide_number);                                           \
    }
FETCH_INSTANCES(DEFINE_RUN, run)

tally_run tally_choose(const session_mesh *mesh)
{
    static const tally_run table[FETCH_SHAPES][2][2] = FETCH_TABLE(run);
    const grid *g = &mesh->cells;
    if (!fetch_is_plain(g) || (!g->cell_types && grid_is_shell_type(g->cell_type))) return NULL;
    return table[fetch_grid_shape(g)][g->connectivity.is_wide][g->coordinates[0].is_wide];
}
