#include "session_tally.h"

#include <string.h>

#include "mmbvh_fetch.h"
#include "session_faces.h"

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
    sum->inverted += part->inverted;
    sum->sizes += part->sizes;
}

/* ---- volumes and sizes --------------------------------------------------------------------------------------- */

/* Six times the signed volume of the tet of a corner and its three neighbours, these in right-handed order. */
MMBVH_INLINE double corner_volume(double points[][3], const signed char *corner)
{
    double edge[3][3];
    for (int i = 0; i < 3; i++)
        for (int axis = 0; axis < 3; axis++) edge[i][axis] = points[corner[i + 1]][axis] - points[corner[0]][axis];
    return edge[0][0] * (edge[1][1] * edge[2][2] - edge[1][2] * edge[2][1]) +
           edge[0][1] * (edge[1][2] * edge[2][0] - edge[1][0] * edge[2][2]) +
           edge[0][2] * (edge[1][0] * edge[2][1] - edge[1][1] * edge[2][0]);
}

/* Signed volume, from the corners' tets: exact for cells with parallel edges, else their mean. */
MMBVH_INLINE double signed_volume(int type, double points[][3])
{
    static const signed char tet[][4] = {{0, 1, 2, 3}};
    static const signed char hex[][4] = {{0, 1, 3, 4}, {1, 2, 0, 5}, {2, 3, 1, 6}, {3, 0, 2, 7},
                                         {4, 7, 5, 0}, {5, 4, 6, 1}, {6, 5, 7, 2}, {7, 6, 4, 3}};
    static const signed char wedge[][4] = {{0, 1, 2, 3}, {1, 2, 0, 4}, {2, 0, 1, 5},
                                           {3, 5, 4, 0}, {4, 3, 5, 1}, {5, 4, 3, 2}};
    static const signed char pyramid[][4] = {{0, 1, 3, 4}, {1, 2, 0, 4}, {2, 3, 1, 4}, {3, 0, 2, 4}};
    const signed char(*corners)[4] = type == GRID_TET     ? tet
                                     : type == GRID_HEX   ? hex
                                     : type == GRID_WEDGE ? wedge
                                                          : pyramid;
    const int count = type == GRID_TET ? 1 : type == GRID_HEX ? 8 : type == GRID_WEDGE ? 6 : 4;
    double sum = 0;
    for (int i = 0; i < count; i++) sum += corner_volume(points, corners[i]);
    const double shares = type == GRID_TET ? 6 : type == GRID_HEX ? 8 : 12; /* what a cell of volume 1 sums to */
    return sum / shares;
}

/* The cube root, without a call where volumes are of any usual size: a third of the exponent (bits of a double are its
 * logarithm, but for a part of 0.09), off by at most 0.033, and two steps of Halley's method, which cubes the error
 * each time: 2.1e-5, then rounding. */
MMBVH_INLINE double cube_root(double x)
{
    if (!(x > 1e-280 && x < 1e280)) return cbrt(x);
    uint64_t bits;
    double y;
    memcpy(&bits, &x, sizeof bits);
    bits = bits / 3 + 0x2a9f7893782da1ceu; /* two thirds of 1.0's bits, less the part that the mantissa leaves */
    memcpy(&y, &bits, sizeof y);
    for (int step = 0; step < 2; step++) {
        const double cube = y * y * y;
        y *= (cube + 2 * x) / (2 * cube + x);
    }
    return y;
}

MMBVH_INLINE void tally_volume(mesh_tally *tally, double volume)
{
    tally->drawn++;
    tally->inverted += volume < 0;
    tally->sizes += cube_root(fabs(volume));
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
        double *point = points[type == GRID_POLYHEDRON ? 0 : i];
        grid_vertex(g, vertex, point);
        tally_point(tally, point);
    }
    tally_volume(tally, type == GRID_POLYHEDRON ? session_polyhedron_volume(g, cell) : signed_volume(type, points));
}

/* ---- runs ---------------------------------------------------------------------------------------------------- */

MMBVH_INLINE bool offsets_are_good(const session_mesh *mesh, int64_t cell, int count)
{
    const grid_array *offsets = &mesh->cells.offsets;
    if (!offsets->data) return true;
    const int64_t first = grid_array_index(offsets, cell), next = grid_array_index(offsets, cell + 1);
    return first >= 0 && next <= mesh->given.connectivity_count && next - first == count;
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

MMBVH_INLINE int64_t run(const session_mesh *mesh, int64_t begin, int64_t end, mesh_tally *tally,
                         const fetch_shape shape, const bool wide_index, const bool wide_number)
{
    const grid *g = &mesh->cells;
    mesh_tally t = *tally;
    int64_t cell = begin;
    for (; cell < end; cell++) {
        const int type = shape == FETCH_TETS ? GRID_TET : grid_cell_type(g, cell);
        const int count = fetch_vertex_count(g, cell, shape);
        if (count == 0 || (shape == FETCH_BY_CELL && !offsets_are_good(mesh, cell, count))) break;
        const bool is_ghost = grid_is_ghost(g, cell);
        double points[GRID_MAX_CELL_VERTICES][3];
        if (!take_points(g, fetch_first(g, cell, count, shape), count, is_ghost, points, wide_index, wide_number))
            break;
        t.ghosts += is_ghost;
        if (is_ghost) continue;
        for (int i = 0; i < count; i++) tally_point(&t, points[i]);
        tally_volume(&t, signed_volume(type, points));
    }
    *tally = t;
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
    if (!fetch_is_plain(g)) return NULL;
    return table[fetch_grid_shape(g)][g->connectivity.is_wide][g->coordinates[0].is_wide];
}
