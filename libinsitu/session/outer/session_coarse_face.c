#include "session_coarse_face.h"

#include <math.h>
#include <string.h>

#include "session_cell_faces.h"
#include "vector3.h"

/* The parametric coordinates of a position on a face, from 0 to 1, are rounded to the nearest multiple of 1 / PARTS if
 * they differ from this multiple by less than a hundredth of 1 / PARTS. Then hanging vertices at refinements of 2:1,
 * 3:1 and 4:1 have exact positions on the face, even if the vertices' coordinates are rounded. */
enum { PARTS = 96 };

/* ---- reading and measuring faces --------------------------------------------------------------------------------- */

double session_bound_position_rounding(const session_mesh *mesh)
{
    double rounding = 0;
    for (int axis = 0; axis < 3 && mesh && mesh->drawn_count; axis++) {
        const double largest = fmax(fabs(mesh->lower[axis]), fabs(mesh->upper[axis]));
        rounding = fmax(rounding, largest * (mesh->cells.coordinates[axis].is_wide ? 0x1p-50 : 0x1p-21));
    }
    return rounding;
}

double session_point_distance(const double a[3], const double b[3])
{
    const double off[3] = {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
    return sqrt(vector3_dot(off, off));
}

/* Returns the bounding box of the positions. There must be at least one. */
static session_box find_bounding_box(const double positions[][3], int count)
{
    session_box box;
    memcpy(box.lower, positions[0], sizeof box.lower);
    memcpy(box.upper, positions[0], sizeof box.upper);
    for (int i = 1; i < count; i++)
        for (int axis = 0; axis < 3; axis++) {
            box.lower[axis] = positions[i][axis] < box.lower[axis] ? positions[i][axis] : box.lower[axis];
            box.upper[axis] = positions[i][axis] > box.upper[axis] ? positions[i][axis] : box.upper[axis];
        }
    return box;
}

/* Computes the face's normal, box, area and width. side: 1 if the right-hand normal of the vertex loop points away from
 * the cell, -1 if it points to the cell, 0 if the face is a shell. */
static void measure_face(session_coarse_face *f, double side)
{
    double a[3], b[3];
    for (int axis = 0; axis < 3; axis++) {
        a[axis] = f->corner_positions[2][axis] - f->corner_positions[0][axis];
        b[axis] = f->corner_positions[f->count == 4 ? 3 : 2][axis] - f->corner_positions[1][axis];
    }
    f->box = find_bounding_box((const double(*)[3])f->corner_positions, f->count);
    vector3_cross(a, b, f->normal);
    f->area = sqrt(vector3_dot(f->normal, f->normal)) / 2;
    f->width = sqrt(fmax(vector3_dot(a, a), vector3_dot(b, b)));
    for (int axis = 0; axis < 3 && f->area > 0; axis++) f->normal[axis] *= side / (2 * f->area);
}

/* Returns the parameter `side` of measure_face(): 1 if f->normal points away from the cell, -1 if it points to the
 * cell, 0 if it is perpendicular to the line between the centres of cell and face. */
static double find_normal_sign(const grid *g, int64_t cell, const session_coarse_face *f)
{
    double sums[3] = {0, 0, 0}, off[3], position[3];
    int64_t vertex, count = 0;
    grid_walk walk = grid_walk_cell(g, cell);
    while (grid_walk_next(&walk, &vertex)) {
        grid_read_vertex_position(g, vertex, position);
        for (int axis = 0; axis < 3; axis++) sums[axis] += position[axis];
        count++;
    }
    for (int axis = 0; axis < 3; axis++) {
        off[axis] = -sums[axis] / (double)count;
        for (int i = 0; i < f->count; i++) off[axis] += f->corner_positions[i][axis] / f->count;
    }
    const double along = vector3_dot(f->normal, off);
    return (along > 0) - (along < 0);
}

bool session_read_outline(const grid *g, const session_face *face, session_face_outline *out)
{
    const session_cell_faces faces = session_faces_of_cell(g, face->cell);
    const session_face_loop loop = session_find_face_loop(&faces, face->face);
    if (loop.size < 3 || loop.size > 4) return false;
    out->count = (int)loop.size;
    out->is_shell = faces.size > 0;
    for (int i = 0; i < out->count; i++) {
        out->vertices[i] = session_face_vertex(&loop, i);
        grid_read_vertex_position(g, out->vertices[i], out->corner_positions[i]);
    }
    out->box = find_bounding_box((const double(*)[3])out->corner_positions, out->count);
    out->diameter = session_point_distance(out->box.lower, out->box.upper);
    return true;
}

/* Returns whether, along `direction`, the position lies above all corners or below all corners by more than `slack`. */
static bool is_beyond_corners(const session_face_outline *f, const double position[3], const double direction[3],
                              double slack)
{
    const double at = vector3_dot(direction, position), most = slack * sqrt(vector3_dot(direction, direction));
    double low = vector3_dot(direction, f->corner_positions[0]), high = low;
    for (int i = 1; i < f->count; i++) {
        const double corner = vector3_dot(direction, f->corner_positions[i]);
        low = fmin(low, corner);
        high = fmax(high, corner);
    }
    return at < low - most || at > high + most;
}

bool session_can_face_contain_position(const session_face_outline *f, const double position[3], double slack)
{
    double edges[4][3], normal[3], across[3];
    for (int i = 0; i < f->count; i++)
        for (int axis = 0; axis < 3; axis++)
            edges[i][axis] = f->corner_positions[(i + 1) % f->count][axis] - f->corner_positions[i][axis];
    vector3_cross(edges[0], edges[1], normal);
    if (is_beyond_corners(f, position, normal, slack)) return false;
    for (int i = 0; i < f->count; i++) {
        vector3_cross(normal, edges[i], across);
        if (is_beyond_corners(f, position, across, slack)) return false;
    }
    return true;
}

bool session_read_coarse_face(const grid *g, const session_face *face, session_coarse_face *out, int64_t vertices[4])
{
    session_face_outline outline;
    int least = 0;
    if (!session_read_outline(g, face, &outline)) return false;
    const int count = outline.count;
    const double(*positions)[3] = (const double(*)[3])outline.corner_positions;
    for (int i = 0; i < count; i++) {
        for (int k = 0; k < i; k++)
            if (vector3_compare(positions[k], positions[i]) == 0) return false;
        if (vector3_compare(positions[i], positions[least]) < 0) least = i;
    }
    const int step =
        vector3_compare(positions[(least + count - 1) % count], positions[(least + 1) % count]) < 0 ? count - 1 : 1;
    out->count = count;
    out->is_shell = outline.is_shell;
    for (int i = 0; i < 4; i++) {
        const int from = (least + step * (i < count ? i : count - 1)) % count;
        memcpy(out->corner_positions[i], positions[from], sizeof positions[from]);
        vertices[i] = outline.vertices[from];
    }
    measure_face(out, 1);
    if (!(out->area > 0)) return false;
    measure_face(out, out->is_shell ? 0 : find_normal_sign(g, face->cell, out));
    return true;
}

void session_pack_coarse_face(const session_coarse_face *face, uint64_t words[SESSION_FACE_WORDS])
{
    session_coarse_face other = *face;
    measure_face(&other, 1);
    const double along = vector3_dot(other.normal, face->normal);
    memcpy(words, face->corner_positions, sizeof face->corner_positions);
    words[SESSION_FACE_WORDS - 1] = (uint64_t)(8 * face->count + 4 * face->is_shell + (along > 0) - (along < 0));
}

void session_unpack_coarse_face(const uint64_t words[SESSION_FACE_WORDS], session_coarse_face *out)
{
    const int64_t last = (int64_t)words[SESSION_FACE_WORDS - 1];
    memcpy(out->corner_positions, words, sizeof out->corner_positions);
    const int64_t count_and_kind = (last + 1) / 4;
    out->count = (int)(count_and_kind / 2);
    out->is_shell = count_and_kind % 2;
    measure_face(out, (double)(last - 4 * count_and_kind));
}

bool session_is_larger_face(const session_coarse_face *a, const session_coarse_face *b)
{
    if (a->area != b->area) return a->area > b->area;
    for (int i = 0; i < 4; i++) {
        const int sign = vector3_compare(a->corner_positions[i], b->corner_positions[i]);
        if (sign) return sign < 0;
    }
    return false;
}

/* ---- parametric coordinates and weights of positions on faces ---------------------------------------------------- */

bool session_is_at_corner(const session_coarse_face *face, const double position[3], double slack)
{
    for (int i = 0; i < face->count; i++)
        if (session_point_distance(face->corner_positions[i], position) <= slack) return true;
    return false;
}

/* Rounds a coordinate to a multiple of 1 / PARTS if it differs from such a multiple only by rounding. */
static double round_coordinate(double at)
{
    const double parts = round(at * PARTS);
    return fabs(at * PARTS - parts) < 0.01 ? parts / PARTS : at;
}

/* Computes in `out` the position on the face at the parametric coordinates `at`, which go from 0 to 1 along each edge,
 * and in slopes[k] the derivative of the position with respect to at[k]. */
static void evaluate_face(const session_coarse_face *f, const double at[2], double out[3], double slopes[2][3])
{
    const double bent = f->count == 4;
    for (int axis = 0; axis < 3; axis++) {
        const double a = f->corner_positions[0][axis], b = f->corner_positions[1][axis],
                     d = f->corner_positions[f->count - 1][axis];
        const double c = bent > 0 ? f->corner_positions[2][axis] : b + d - a;
        slopes[0][axis] = (1 - at[1]) * (b - a) + at[1] * (c - d);
        slopes[1][axis] = (1 - at[0]) * (d - a) + at[0] * (c - b);
        out[axis] = (1 - at[1]) * (a + at[0] * (b - a)) + at[1] * (d + at[0] * (c - d));
    }
}

/* Computes, by the Gauss-Newton method from the face's centre, the parametric coordinates `at` of the point on the face
 * (extended beyond its edges) that is nearest to a position. They go from 0 to 1 along each edge. A triangle is treated
 * as half of a parallelogram. Returns false if the iteration fails. */
static bool solve_face_coordinates(const session_coarse_face *f, const double position[3], double at[2])
{
    double on[3], slopes[2][3], off[3];
    at[0] = at[1] = 0.5;
    for (int step = 0; step < (f->count == 4 ? 12 : 2); step++) {
        evaluate_face(f, at, on, slopes);
        for (int axis = 0; axis < 3; axis++) off[axis] = position[axis] - on[axis];
        const double aa = vector3_dot(slopes[0], slopes[0]), ab = vector3_dot(slopes[0], slopes[1]),
                     bb = vector3_dot(slopes[1], slopes[1]);
        const double a = vector3_dot(slopes[0], off), b = vector3_dot(slopes[1], off), det = aa * bb - ab * ab;
        if (!(det > 0)) return false;
        at[0] += (a * bb - b * ab) / det;
        at[1] += (b * aa - a * ab) / det;
        if (!(fabs(at[0]) < 4 && fabs(at[1]) < 4)) return false;
    }
    return true;
}

bool session_find_weights(const session_coarse_face *f, const double position[3], double slack, double weights[4])
{
    double at[2], on[3], slopes[2][3];
    for (int axis = 0; axis < 3; axis++)
        if (!(f->box.lower[axis] - slack <= position[axis] && position[axis] <= f->box.upper[axis] + slack))
            return false;
    if (!solve_face_coordinates(f, position, at)) return false;
    for (int k = 0; k < 2; k++) at[k] = round_coordinate(at[k]);
    const double u = at[0], w = at[1];
    evaluate_face(f, at, on, slopes);
    if (!(u >= 0 && u <= 1 && w >= 0 && w <= 1 && session_point_distance(on, position) <= slack)) return false;
    if (f->count == 4) {
        const double bilinear[4] = {(1 - u) * (1 - w), u * (1 - w), u * w, (1 - u) * w};
        memcpy(weights, bilinear, sizeof bilinear);
        return true;
    }
    const double rest = 1 - u - w;
    const bool is_on_edge = fabs(rest) * PARTS < 0.01;
    weights[0] = is_on_edge ? 0 : rest;
    weights[1] = u;
    weights[2] = is_on_edge ? 1 - u : w;
    weights[3] = 0;
    return weights[0] >= 0;
}
