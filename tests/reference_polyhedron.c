/* The field of a polyhedron in double, computed literally by its definition. Every face is cut into triangles
 * (reference_polygon.h), and every triangle makes a tet with the centre. The field at a point is the sum of sign times
 * linear field over the tets that contain the point.
 *
 * The signs follow from the orientations of faces. One face is taken as it is; every face that shares a directed edge
 * with it in the same direction is flipped, and so on until no face changes. Then each connected component of faces is
 * oriented to have a positive volume, or a negative volume if its first vertex is inside the other components. */
#include "reference_polyhedron.h"

#include "reference_polygon.h"
#include <stdlib.h>

#include <stdio.h>

#include <math.h>
#include <string.h>

#include "grid.h"

static double determinant3(const double *a, const double *b, const double *c)
{
    return a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0]);
}

/* Returns 1 if the two faces run along a common edge in opposite directions, -1 if in the same direction, and 0 if they
 * have no common edge. An edge from a vertex to itself has no direction and does not count: collapsed faces share such
 * edges with their neighbours. */
static int compare_orientations(const reference_polyhedron *p, int one, int other)
{
    for (int i = 0; i < p->face_size[one]; i++)
        for (int k = 0; k < p->face_size[other]; k++) {
            const int a = p->faces[one][i], b = p->faces[one][(i + 1) % p->face_size[one]];
            const int c = p->faces[other][k], d = p->faces[other][(k + 1) % p->face_size[other]];
            if (a == b) continue;
            if (a == d && b == c) return 1;
            if (a == c && b == d) return -1;
        }
    return 0;
}

/* Orients faces. turn: 1, or -1 if the face is flipped; piece: first face of the face's connected component. */
static void orient_faces(const reference_polyhedron *p, int *turn, int *piece)
{
    for (int face = 0; face < p->face_count; face++) turn[face] = 0;
    for (int first = 0; first < p->face_count; first++) {
        if (turn[first]) continue;
        turn[first] = 1;
        piece[first] = first;
        for (bool changed = true; changed;) {
            changed = false;
            for (int i = 0; i < p->face_count; i++)
                for (int k = 0; k < p->face_count && turn[i] && piece[i] == first; k++) {
                    const int agree = turn[k] ? 0 : compare_orientations(p, i, k);
                    if (!agree) continue;
                    turn[k] = agree * turn[i];
                    piece[k] = first;
                    changed = true;
                }
        }
    }
}

static void add_triangles(reference_cell *cell)
{
    reference_polyhedron *p = &cell->poly;
    p->triangle_count = 0;
    for (int face = 0; face < p->face_count; face++) {
        double corners[REFERENCE_MAX_SIDES][3];
        int cut[REFERENCE_MAX_SIDES][3], size = 0, loop[REFERENCE_MAX_SIDES];
        for (int i = 0; i < p->face_size[face]; i++) { /* consecutive copies of a vertex count as one vertex */
            const int vertex = p->faces[face][i],
                      before = p->faces[face][(i + p->face_size[face] - 1) % p->face_size[face]];
            if (vertex == before) continue;
            loop[size] = vertex;
            memcpy(corners[size++], cell->world[vertex], sizeof corners[0]);
        }
        p->is_patch[face] =
            p->face_size[face] == 4 && !(size == 4 && reference_is_concave_quad((const double(*)[3])corners));
        const int count = size < 3 ? 0 : reference_polygon_triangulate((const double(*)[3])corners, size, cut);
        for (int i = 0; i < count; i++) {
            for (int k = 0; k < 3; k++) p->triangles[p->triangle_count][k] = loop[cut[i][k]];
            p->face_of[p->triangle_count++] = face;
        }
    }
}

/* Returns whether the point is inside the surface of the connected components other than `mine`. Counts the crossings
 * of a ray in an arbitrary direction. */
static bool is_inside_other_pieces(const reference_cell *cell, const int *piece, int mine, const double *point)
{
    static const double direction[3] = {0.5377, 0.1834, -0.7621};
    const reference_polyhedron *p = &cell->poly;
    bool inside = false;
    for (int i = 0; i < p->triangle_count; i++) {
        double d[3][3], along[3];
        if (piece[p->face_of[i]] == mine) continue;
        for (int k = 0; k < 3; k++)
            for (int axis = 0; axis < 3; axis++) d[k][axis] = cell->position[p->triangles[i][k]][axis] - point[axis];
        for (int k = 0; k < 3; k++) along[k] = determinant3(d[(k + 1) % 3], d[(k + 2) % 3], direction);
        const bool same = (along[0] > 0) == (along[1] > 0) && (along[1] > 0) == (along[2] > 0);
        if (same && determinant3(d[0], d[1], d[2]) / (along[0] + along[1] + along[2]) > 0) inside = !inside;
    }
    return inside;
}

static double signed_volume(const reference_cell *cell, int triangle, const double *apex)
{
    double d[3][3];
    for (int k = 0; k < 3; k++)
        for (int axis = 0; axis < 3; axis++)
            d[k][axis] = cell->position[cell->poly.triangles[triangle][k]][axis] - apex[axis];
    return determinant3(d[0], d[1], d[2]);
}

static int find_or_add_vertex(reference_cell *cell, int64_t *vertices, int64_t vertex)
{
    int at = 0;
    while (at < cell->count && vertices[at] != vertex) at++;
    if (at == REFERENCE_MAX_VERTICES) {
        fprintf(stderr, "reference: a polyhedron of more than %d vertices\n", at);
        exit(1);
    }
    if (at == cell->count) vertices[cell->count++] = vertex;
    return at;
}

void reference_polyhedron_read(const grid *g, int64_t index, reference_cell *cell,
                               int64_t vertices[REFERENCE_MAX_VERTICES])
{
    reference_polyhedron *p = &cell->poly;
    int64_t first, end;
    cell->count = p->face_count = 0;
    grid_cell_faces(g, index, &first, &end);
    for (int64_t i = first; i < end; i++) {
        int64_t from, to;
        grid_face_vertices(g, grid_read_index(&g->connectivity, i), &from, &to);
        if (p->face_count == REFERENCE_MAX_FACES || to - from > REFERENCE_MAX_SIDES) {
            fprintf(stderr, "reference: a polyhedron of too many faces or sides\n");
            exit(1);
        }
        int *loop = p->faces[p->face_count];
        p->face_size[p->face_count++] = (int)(to - from);
        for (int64_t k = from; k < to; k++)
            *loop++ = find_or_add_vertex(cell, vertices, grid_read_index(&g->face_connectivity, k));
    }
}

void reference_polyhedron_setup(reference_cell *cell)
{
    reference_polyhedron *p = &cell->poly;
    int turn[REFERENCE_MAX_FACES], piece[REFERENCE_MAX_FACES];
    double volume[REFERENCE_MAX_FACES] = {0};
    double *centre = cell->position[cell->count];
    for (int axis = 0; axis < 3; axis++) {
        centre[axis] = 0;
        for (int i = 0; i < cell->count; i++) centre[axis] += cell->position[i][axis] / cell->count;
    }
    add_triangles(cell);
    orient_faces(p, turn, piece);
    for (int i = 0; i < p->triangle_count; i++)
        volume[piece[p->face_of[i]]] += turn[p->face_of[i]] * signed_volume(cell, i, centre);
    for (int i = 0; i < p->triangle_count; i++) {
        const int face = p->face_of[i], mine = piece[face];
        const double own = turn[face] * signed_volume(cell, i, centre);
        const bool is_hole = is_inside_other_pieces(cell, piece, mine, cell->position[p->faces[mine][0]]);
        p->sign[i] = own == 0 ? 0 : ((own > 0) == (volume[mine] > 0)) != is_hole ? 1 : -1;
    }
}

/* Computes the barycentric coordinates of a point in tet i, for the triangle's vertices and then for the centre. slopes
 * receives their gradients. Returns false if the tet has no volume. */
static bool compute_tet_coordinates(const reference_cell *cell, int i, const double point[3], double lambda[4],
                                    double slopes[4][3])
{
    const reference_polyhedron *p = &cell->poly;
    const double *centre = cell->position[cell->count];
    double d[3][3], from[3];
    for (int axis = 0; axis < 3; axis++) {
        from[axis] = point[axis] - centre[axis];
        for (int k = 0; k < 3; k++) d[k][axis] = cell->position[p->triangles[i][k]][axis] - centre[axis];
    }
    const double volume = determinant3(d[0], d[1], d[2]);
    if (volume == 0) return false;
    lambda[3] = 1;
    slopes[3][0] = slopes[3][1] = slopes[3][2] = 0;
    for (int k = 0; k < 3; k++) {
        const double *u = d[(k + 1) % 3], *v = d[(k + 2) % 3];
        lambda[k] = 0;
        for (int axis = 0; axis < 3; axis++) {
            const int b = (axis + 1) % 3, c = (axis + 2) % 3;
            slopes[k][axis] = (u[b] * v[c] - u[c] * v[b]) / volume;
            lambda[k] += slopes[k][axis] * from[axis];
            slopes[3][axis] -= slopes[k][axis];
        }
        lambda[3] -= lambda[k];
    }
    return true;
}

/* Computes the sum over the tets that contain the point. Returns the sum of these tets' signs. */
static int sum_over_tets(const reference_cell *cell, const double point[3], const double *values, double *value,
                         double gradient[3])
{
    const reference_polyhedron *p = &cell->poly;
    double mean = 0;
    int cover = 0;
    for (int i = 0; i < cell->count; i++) mean += values[i] / cell->count;
    *value = gradient[0] = gradient[1] = gradient[2] = 0;
    for (int i = 0; i < p->triangle_count; i++) {
        double lambda[4], slopes[4][3];
        if (!p->sign[i] || !compute_tet_coordinates(cell, i, point, lambda, slopes)) continue;
        if (lambda[0] < 0 || lambda[1] < 0 || lambda[2] < 0 || lambda[3] < 0) continue;
        cover += p->sign[i];
        for (int k = 0; k < 4; k++) {
            const double f = p->sign[i] * (k < 3 ? values[p->triangles[i][k]] : mean);
            *value += f * lambda[k];
            for (int axis = 0; axis < 3; axis++) gradient[axis] += f * slopes[k][axis];
        }
    }
    return cover;
}

/* Computes the sum at the point. On a sheet between two tets, rounding may put the point into none or both of them;
 * then the sum at a point slightly beside it is used. */
bool reference_polyhedron_interpolate(const reference_cell *cell, const double point[3], const double *values,
                                      double *value, double gradient[3])
{
    static const double aside[3] = {0.6123, -0.3217, 0.4871};
    double slope[3];
    for (int step = 0; step < 24; step++) {
        const double by = step == 0 ? 0 : (step % 2 ? 1 : -1) * ldexp(1e-14, step / 2);
        double moved[3];
        for (int axis = 0; axis < 3; axis++) moved[axis] = point[axis] + by * aside[axis];
        const bool good = sum_over_tets(cell, moved, values, value, slope) == 1;
        if (gradient) memcpy(gradient, slope, sizeof slope);
        if (good) return true;
    }
    return false;
}

double reference_compute_sheet_distance(const reference_cell *cell, const double point[3])
{
    double least = (double)INFINITY;
    for (int i = 0; i < cell->poly.triangle_count; i++) {
        double lambda[4], slopes[4][3], nearest = (double)INFINITY, outside = 0;
        if (!compute_tet_coordinates(cell, i, point, lambda, slopes)) continue;
        for (int k = 0; k < 4; k++) {
            const double height = lambda[k] / sqrt(slopes[k][0] * slopes[k][0] + slopes[k][1] * slopes[k][1] +
                                                   slopes[k][2] * slopes[k][2]);
            outside = fmin(outside, height);
            if (k < 3) nearest = fmin(nearest, fabs(height));
        }
        least = fmin(least, fmax(nearest, -outside));
    }
    return least;
}
