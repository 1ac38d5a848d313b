/* Computes one cell in double (reference_cell.h).
 *
 * Crossings: all points are sheared by x - base - slope z, so that the line becomes the z axis. The line crosses a
 * triangle if the origin of the xy plane is inside the triangle's projection by the even-odd rule, which counts the
 * triangle's edges that the positive x axis crosses. Both triangles at an edge compute the same result for it, because
 * the end of the edge below the axis is always taken first. In a closed surface every edge belongs to two triangles, so
 * the number of crossings is even in spite of rounding.
 *
 * Interior: one Newton solver inverts the isoparametric map of every cell type, given the type's shape functions. The
 * map of a pyramid is singular at its apex but homogeneous about it: the point is moved along its line from the apex to
 * the height of the base's centre, the map is inverted there, and the weight of the base is scaled back. */
#include "reference_cell.h"

#include "grid.h"
#include "reference_polyhedron.h"

#include <string.h>

const reference_box reference_empty_box = {{(double)INFINITY, (double)INFINITY, (double)INFINITY},
                                           {-(double)INFINITY, -(double)INFINITY, -(double)INFINITY}};

void reference_box_add(reference_box *box, const double point[3])
{
    for (int axis = 0; axis < 3; axis++) {
        box->low[axis] = fmin(box->low[axis], point[axis]);
        box->high[axis] = fmax(box->high[axis], point[axis]);
    }
}

bool reference_box_is_near(const reference_box *box, const reference_line *line, double share, double slack)
{
    for (int axis = 0; axis < 2; axis++) {
        const double front = line->slope[axis] * box->low[2], back = line->slope[axis] * box->high[2];
        const double low = box->low[axis] - line->base[axis] - fmax(front, back);
        const double high = box->high[axis] - line->base[axis] - fmin(front, back);
        const double most = share * (high - low) + slack;
        if (low > most || high < -most) return false;
    }
    return true;
}

typedef struct cell_faces {
    int count;
    int vertices[6][4]; /* vertices of the cell; the fourth is -1 for a triangle */
} cell_faces;

static const cell_faces *get_cell_faces(int type)
{
    static const cell_faces tet = {4, {{0, 1, 2, -1}, {0, 1, 3, -1}, {1, 2, 3, -1}, {0, 2, 3, -1}}};
    static const cell_faces hex = {
        6, {{0, 1, 2, 3}, {4, 5, 6, 7}, {0, 1, 5, 4}, {1, 2, 6, 5}, {2, 3, 7, 6}, {3, 0, 4, 7}}};
    static const cell_faces wedge = {5, {{0, 1, 2, -1}, {3, 4, 5, -1}, {0, 1, 4, 3}, {1, 2, 5, 4}, {2, 0, 3, 5}}};
    static const cell_faces pyramid = {5, {{0, 1, 2, 3}, {0, 1, 4, -1}, {1, 2, 4, -1}, {2, 3, 4, -1}, {3, 0, 4, -1}}};
    return type == GRID_TET ? &tet : type == GRID_HEX ? &hex : type == GRID_WEDGE ? &wedge : &pyramid;
}

static bool precedes_point(const double *a, const double *b)
{
    for (int axis = 0; axis < 3; axis++)
        if (a[axis] != b[axis]) return a[axis] < b[axis];
    return false;
}

/* Splits the face into one triangle, or into two along the diagonal from its vertex with the lexicographically smallest
 * coordinates. */
static int split_face(const reference_cell *cell, const int *face, int triangles[2][3])
{
    if (face[3] < 0) {
        memcpy(triangles[0], face, sizeof triangles[0]);
        return 1;
    }
    int least = 0;
    for (int i = 1; i < 4; i++)
        if (precedes_point(cell->world[face[i]], cell->world[face[least]])) least = i;
    for (int half = 0; half < 2; half++) {
        triangles[half][0] = face[least];
        triangles[half][1] = face[(least + 1 + half) % 4];
        triangles[half][2] = face[(least + 2 + half) % 4];
    }
    return 2;
}

static void shear_point(const reference_line *line, const double *p, double out[2])
{
    for (int axis = 0; axis < 2; axis++) out[axis] = p[axis] - line->base[axis] - line->slope[axis] * p[2];
}

static long double cross_product(const double *a, const double *b)
{
    return (long double)a[0] * (long double)b[1] - (long double)a[1] * (long double)b[0];
}

/* Returns whether the positive x axis crosses the edge from a to b. */
static bool does_axis_cross_edge(const double *a, const double *b)
{
    if ((a[1] >= 0) == (b[1] >= 0)) return false;
    return a[1] < 0 ? cross_product(a, b) > 0 : cross_product(b, a) > 0;
}

static double compute_edge_length(const double *a, const double *b)
{
    return hypot(a[0] - b[0], a[1] - b[1]);
}

/* Computes the barycentric coordinates of the line's intersection with a triangle. They are 1/3 each if the triangle is
 * seen edge-on. */
static void compute_triangle_weights(const reference_cell *cell, const reference_line *line, const int *triangle,
                                     double weights[3])
{
    double p[3][2];
    for (int i = 0; i < 3; i++) shear_point(line, cell->position[triangle[i]], p[i]);
    const long double e[3] = {cross_product(p[1], p[2]), cross_product(p[2], p[0]), cross_product(p[0], p[1])};
    const long double area = e[0] + e[1] + e[2];
    for (int i = 0; i < 3; i++) weights[i] = area != 0 ? (double)(e[i] / area) : 1.0 / 3;
}

static bool intersect_triangle(const reference_cell *cell, const reference_line *line, const int *triangle,
                               reference_crossing *out)
{
    double p[3][2], weights[3];
    for (int i = 0; i < 3; i++) shear_point(line, cell->position[triangle[i]], p[i]);
    if ((does_axis_cross_edge(p[0], p[1]) + does_axis_cross_edge(p[1], p[2]) + does_axis_cross_edge(p[2], p[0])) % 2 ==
        0)
        return false;
    compute_triangle_weights(cell, line, triangle, weights);
    memset(out, 0, sizeof *out);
    for (int i = 0; i < 3; i++) out->z += weights[i] * cell->position[triangle[i]][2];
    out->z_triangle = out->z;
    return true;
}

static double compute_distance_outside_unit(double u)
{
    return u < 0 ? -u : u > 1 ? u - 1 : 0;
}

static double clamp_unit(double u)
{
    return u < 0 ? 0 : u > 1 ? 1 : u;
}

/* Solves a + u b + w c + u w d = 0 for u, given w, by the better conditioned of the two equations. */
static double solve_for_u(const double *a, const double *b, const double *c, const double *d, double w)
{
    const double x = b[0] + w * d[0], y = b[1] + w * d[1];
    const int axis = fabs(x) >= fabs(y) ? 0 : 1;
    const double below = axis ? y : x;
    return below != 0 ? -(a[axis] + w * c[axis]) / below : 0.5;
}

/* Returns the magnitude of a + u b + w c + u w d relative to the size of the quad. */
static double compute_bilinear_residual(const double *a, const double *b, const double *c, const double *d, double u,
                                        double w)
{
    double residual = 0, size = 0;
    for (int i = 0; i < 2; i++) {
        residual += fabs(a[i] + u * b[i] + w * c[i] + u * w * d[i]);
        size += fabs(b[i]) + fabs(c[i]) + fabs(d[i]);
    }
    return size > 0 ? residual / size : 0;
}

typedef struct patch_point {
    double u, w, beyond;
} patch_point;

/* Finds the two solutions (u, w) of a + u b + w c + u w d = 0 and their distances outside the unit square. Eliminating
 * u leaves a quadratic equation in w. If two corners of the quad have the same position, one of the roots is not a
 * solution. Returns the number of solutions inside the square. */
static int solve_bilinear(const double *a, const double *b, const double *c, const double *d, patch_point points[2])
{
    const double qa = (double)cross_product(d, c), qb = (double)(cross_product(b, c) + cross_product(d, a)),
                 qc = (double)cross_product(b, a);
    const double square = qb * qb - 4 * qa * qc;
    const double root = sqrt(fmax(square, 0)), h = -0.5 * (qb + (qb < 0 ? -root : root));
    const double candidates[2] = {h != 0 ? qc / h : 0.5, qa != 0 ? h / qa : (double)INFINITY};
    int inside = 0;
    for (int i = 0; i < 2; i++) {
        points[i] = (patch_point){0.5, 0.5, (double)INFINITY};
        if (!isfinite(candidates[i])) continue;
        const double w = candidates[i], u = solve_for_u(a, b, c, d, w);
        points[i] = (patch_point){u, w,
                                  compute_distance_outside_unit(w) + compute_distance_outside_unit(u) +
                                      compute_bilinear_residual(a, b, c, d, u, w)};
        inside += points[i].beyond < 1e-9;
    }
    return inside;
}

static double interpolate_bilinear(const double values[4], double u, double w)
{
    return (1 - w) * ((1 - u) * values[0] + u * values[1]) + w * ((1 - u) * values[3] + u * values[2]);
}

static int find_patch_points(const reference_cell *cell, const reference_line *line, const int *face,
                             patch_point points[2])
{
    double p[4][2], a[2], b[2], c[2], d[2];
    for (int i = 0; i < 4; i++) shear_point(line, cell->position[face[i]], p[i]);
    for (int i = 0; i < 2; i++) {
        a[i] = p[0][i];
        b[i] = p[1][i] - p[0][i];
        c[i] = p[3][i] - p[0][i];
        d[i] = p[0][i] - p[1][i] + p[2][i] - p[3][i];
    }
    return solve_bilinear(a, b, c, d, points);
}

/* Replaces the `count` crossings of a quad's two triangles by those of its bilinear patch. A ray that crosses one
 * triangle crosses the patch once. A ray that crosses both or none crosses the patch twice or not at all, because the
 * patch is smooth at the diagonal where the triangles have a fold. Returns the number of crossings. Sets is_folded if
 * the ray crosses both triangles but not the patch. */
static int replace_crossings_by_patch(const reference_cell *cell, const reference_line *line, const int *face,
                                      reference_crossing crossings[2], int count, bool *is_folded)
{
    patch_point points[2];
    const int inside = find_patch_points(cell, line, face, points);
    const int nearest = points[1].beyond < points[0].beyond, left = count == 1 ? 1 : inside == 2 ? 2 : 0;
    double z[4];
    *is_folded = *is_folded || count > left;
    for (int i = 0; i < 4; i++) z[i] = cell->position[face[i]][2];
    for (int i = 0; i < left; i++) {
        const patch_point *point = &points[left == 2 ? i : nearest];
        crossings[i].is_folded = count != 1 || inside != 1;
        crossings[i].u = clamp_unit(point->u);
        crossings[i].w = clamp_unit(point->w);
        if (left == 2 || inside == 1) crossings[i].z = interpolate_bilinear(z, crossings[i].u, crossings[i].w);
        if (!count) crossings[i].z_triangle = crossings[i].z;
    }
    if (left == 2 && (crossings[0].z < crossings[1].z) != (crossings[0].z_triangle < crossings[1].z_triangle)) {
        const double z_triangle = crossings[0].z_triangle;
        const int triangle = crossings[0].triangle;
        crossings[0].z_triangle = crossings[1].z_triangle, crossings[0].triangle = crossings[1].triangle;
        crossings[1].z_triangle = z_triangle, crossings[1].triangle = triangle;
    }
    return left;
}

static int insert_crossing(reference_crossing *crossings, int count, const reference_crossing *found)
{
    int at = count;
    for (; at > 0 && crossings[at - 1].z > found->z; at--) crossings[at] = crossings[at - 1];
    crossings[at] = *found;
    return count + 1;
}

static int find_polyhedron_crossings(const reference_cell *cell, const reference_line *line,
                                     reference_crossing *crossings)
{
    const reference_polyhedron *p = &cell->poly;
    bool is_folded = false;
    int count = 0;
    for (int i = 0, next; i < p->triangle_count; i = next) {
        const int face = p->face_of[i];
        reference_crossing found[REFERENCE_MAX_CROSSINGS];
        int of_face = 0;
        for (int k = 0; k < 2; k++) found[k] = (reference_crossing){.face = face, .triangle = -1};
        for (next = i; next < p->triangle_count && p->face_of[next] == face; next++) {
            if (!intersect_triangle(cell, line, p->triangles[next], &found[of_face])) continue;
            found[of_face].face = face;
            found[of_face++].triangle = next;
        }
        if (p->is_patch[face])
            of_face = replace_crossings_by_patch(cell, line, p->faces[face], found, of_face, &is_folded);
        for (int k = 0; k < of_face; k++) count = insert_crossing(crossings, count, &found[k]);
    }
    for (int i = 0; i < count && is_folded; i++) crossings[i].is_folded = true;
    return count;
}

int reference_find_crossings(const reference_cell *cell, const reference_line *line,
                             reference_crossing crossings[REFERENCE_MAX_CROSSINGS])
{
    if (cell->type == GRID_POLYHEDRON) return find_polyhedron_crossings(cell, line, crossings);
    const cell_faces *faces = get_cell_faces(cell->type);
    bool is_folded = false;
    int count = 0;
    for (int face = 0; face < faces->count; face++) {
        int triangles[2][3];
        const int halves = split_face(cell, faces->vertices[face], triangles);
        reference_crossing found[2] = {{.face = face}, {.face = face}};
        int of_face = 0;
        for (int half = 0; half < halves; half++) {
            if (!intersect_triangle(cell, line, triangles[half], &found[of_face])) continue;
            found[of_face++].face = face;
        }
        if (halves == 2)
            of_face = replace_crossings_by_patch(cell, line, faces->vertices[face], found, of_face, &is_folded);
        for (int k = 0; k < of_face; k++) count = insert_crossing(crossings, count, &found[k]);
    }
    for (int i = 0; i < count && is_folded; i++) crossings[i].is_folded = true;
    return count;
}

static double compute_triangle_value(const reference_cell *cell, const reference_line *line, const int *triangle,
                                     const double *values)
{
    double weights[3], value = 0;
    compute_triangle_weights(cell, line, triangle, weights);
    for (int i = 0; i < 3; i++) value += weights[i] * values[triangle[i]];
    return value;
}

double reference_compute_face_value(const reference_cell *cell, const reference_line *line,
                                    const reference_crossing *crossing, const double *values, bool *is_folded)
{
    const bool is_polyhedron = cell->type == GRID_POLYHEDRON;
    const int *face =
        is_polyhedron ? cell->poly.faces[crossing->face] : get_cell_faces(cell->type)->vertices[crossing->face];
    const bool is_quad = is_polyhedron ? cell->poly.is_patch[crossing->face] : face[3] >= 0;
    *is_folded = crossing->is_folded;
    if (!is_quad)
        return compute_triangle_value(cell, line, is_polyhedron ? cell->poly.triangles[crossing->triangle] : face,
                                      values);
    const double corners[4] = {values[face[0]], values[face[1]], values[face[2]], values[face[3]]};
    return interpolate_bilinear(corners, crossing->u, crossing->w);
}

static double compute_segment_distance(const double *a, const double *b)
{
    const double length = compute_edge_length(a, b);
    if (length == 0) return hypot(a[0], a[1]);
    const double along = clamp_unit(-(a[0] * (b[0] - a[0]) + a[1] * (b[1] - a[1])) / (length * length));
    return hypot(a[0] + along * (b[0] - a[0]), a[1] + along * (b[1] - a[1]));
}

double reference_compute_edge_distance(const reference_cell *cell, const reference_line *line)
{
    const bool is_polyhedron = cell->type == GRID_POLYHEDRON;
    const cell_faces *faces = get_cell_faces(cell->type);
    const int face_count = is_polyhedron ? cell->poly.face_count : faces->count;
    double least = (double)INFINITY;
    for (int face = 0; face < face_count; face++) {
        const int *loop = is_polyhedron ? cell->poly.faces[face] : faces->vertices[face];
        const int sides = is_polyhedron ? cell->poly.face_size[face] : loop[3] < 0 ? 3 : 4;
        for (int i = 0; i < sides; i++) {
            double a[2], b[2];
            shear_point(line, cell->position[loop[i]], a);
            shear_point(line, cell->position[loop[(i + 1) % sides]], b);
            least = fmin(least, compute_segment_distance(a, b));
        }
    }
    return least;
}

/* ---- the field of a polyhedron along a line ---- */

static bool interpolate_on_line(const reference_cell *cell, const reference_line *line, double z, const double *values,
                                double *value)
{
    const double point[3] = {line->base[0] + line->slope[0] * z, line->base[1] + line->slope[1] * z, z};
    return reference_polyhedron_interpolate(cell, point, values, value, NULL);
}

/* Returns the profile's value at a crossing. The profile is the field along the ray (reference_compute_profile_value);
 * inward is the sign of the direction towards the other crossing. */
static double compute_profile_end(const reference_cell *cell, const reference_line *line, const reference_crossing *end,
                                  const double *values, double inward)
{
    double sum;
    bool is_folded;
    const double face = reference_compute_face_value(cell, line, end, values, &is_folded);
    if (end->triangle < 0) return face;
    const double triangle = compute_triangle_value(cell, line, cell->poly.triangles[end->triangle], values);
    /* Evaluates the sum over tets slightly inside the cell. The error is 1e-10 of the field's change along z. */
    if (!interpolate_on_line(cell, line, end->z_triangle + 1e-10 * inward, values, &sum)) sum = triangle;
    return face + (sum - triangle);
}

static int insert_depth(double *z, int count, double depth)
{
    int at = count;
    for (; at > 0 && z[at - 1] > depth; at--) z[at] = z[at - 1];
    z[at] = depth;
    return count + 1;
}

int reference_find_profile_breaks(const reference_cell *cell, const reference_line *line,
                                  const reference_crossing ends[2], double z[REFERENCE_MAX_BREAKS])
{
    int count = insert_depth(z, insert_depth(z, 0, ends[0].z), ends[1].z);
    for (int i = 0; i < cell->poly.triangle_count; i++)
        for (int k = 0; k < 3; k++) {
            const int *t = cell->poly.triangles[i], sheet[3] = {t[k], t[(k + 1) % 3], cell->count};
            reference_crossing met;
            const double low = fmax(ends[0].z, ends[0].z_triangle), high = fmin(ends[1].z, ends[1].z_triangle);
            if (intersect_triangle(cell, line, sheet, &met) && met.z > low && met.z < high)
                count = insert_depth(z, count, met.z);
        }
    return count;
}

/* Computes the sum over tets next to a sheet, on the side where it exists. If the ray crosses both triangles of a quad
 * but not the quad's patch, the interval between the two triangles is in no tet, and the field is linear there between
 * its sheets. */
static bool interpolate_at_sheet(const reference_cell *cell, const reference_line *line, double z, double aside,
                                 const double *values, double *value)
{
    return interpolate_on_line(cell, line, z + aside, values, value) ||
           interpolate_on_line(cell, line, z - aside, values, value);
}

bool reference_compute_profile_value(const reference_cell *cell, const reference_line *line,
                                     const reference_crossing ends[2], const double *values, double z, double *value)
{
    const double length = ends[1].z - ends[0].z;
    double breaks[REFERENCE_MAX_BREAKS], v0, v1;
    const int count = reference_find_profile_breaks(cell, line, ends, breaks);
    int next = 1;
    while (next < count - 1 && breaks[next] <= z) next++;
    const double before = breaks[next - 1], behind = breaks[next];
    /* If the cell's face at this end is a triangle, the profile equals the sum over tets. */
    const bool is_first = next == 1 && cell->poly.is_patch[ends[0].face];
    const bool is_last = next == count - 1 && cell->poly.is_patch[ends[1].face];
    if (!is_first && !is_last) {
        const double inner = 1e-9 * length, held = fmin(fmax(z, ends[0].z + inner), ends[1].z - inner);
        if (interpolate_on_line(cell, line, held, values, value)) return true;
    }
    /* Evaluates the sums slightly inside the interval between two sheets, since a sheet may lie in the face at the
     * interval's other end. */
    const double aside = 1e-9 * (behind - before);
    bool is_good = true;
    if (next == 1)
        v0 = compute_profile_end(cell, line, &ends[0], values, length);
    else
        is_good = interpolate_at_sheet(cell, line, before, aside, values, &v0);
    if (next == count - 1)
        v1 = compute_profile_end(cell, line, &ends[1], values, -length);
    else
        is_good = interpolate_at_sheet(cell, line, behind, -aside, values, &v1) && is_good;
    *value = behind > before ? v0 + (z - before) / (behind - before) * (v1 - v0) : v0;
    return is_good;
}

/* A vertex's weight n and its derivatives d with respect to the parameters. */
typedef struct shape_function {
    double n, d[3];
} shape_function;

static void compute_tet_shape(const double *p, shape_function *s)
{
    s[0] = (shape_function){1 - p[0] - p[1] - p[2], {-1, -1, -1}};
    s[1] = (shape_function){p[0], {1, 0, 0}};
    s[2] = (shape_function){p[1], {0, 1, 0}};
    s[3] = (shape_function){p[2], {0, 0, 1}};
}

/* Returns the bilinear weight of corner i of the unit square at (r, s). Corners are numbered around the square. */
static shape_function compute_square_shape(int i, double r, double s)
{
    const bool right = i == 1 || i == 2, upper = i >= 2;
    const double a = right ? r : 1 - r, b = upper ? s : 1 - s;
    return (shape_function){a * b, {right ? b : -b, upper ? a : -a, 0}};
}

/* Multiplies a shape function of the base by a weight along the height, whose value is `height` and whose derivative is
 * `slope`. */
static shape_function multiply_by_height(shape_function base, double height, double slope)
{
    return (shape_function){base.n * height, {base.d[0] * height, base.d[1] * height, base.n * slope}};
}

static void compute_hex_shape(const double *p, shape_function *s)
{
    for (int i = 0; i < 4; i++) {
        const shape_function base = compute_square_shape(i, p[0], p[1]);
        s[i] = multiply_by_height(base, 1 - p[2], -1);
        s[i + 4] = multiply_by_height(base, p[2], 1);
    }
}

static void compute_wedge_shape(const double *p, shape_function *s)
{
    const shape_function base[3] = {{1 - p[0] - p[1], {-1, -1, 0}}, {p[0], {1, 0, 0}}, {p[1], {0, 1, 0}}};
    for (int i = 0; i < 3; i++) {
        s[i] = multiply_by_height(base[i], 1 - p[2], -1);
        s[i + 3] = multiply_by_height(base[i], p[2], 1);
    }
}

static void compute_pyramid_shape(const double *p, shape_function *s)
{
    for (int i = 0; i < 4; i++) s[i] = multiply_by_height(compute_square_shape(i, p[0], p[1]), 1 - p[2], -1);
    s[4] = (shape_function){p[2], {0, 0, 1}};
}

static void compute_cell_shape(int type, const double *p, shape_function *s)
{
    switch (type) {
    case GRID_TET: compute_tet_shape(p, s); break;
    case GRID_HEX: compute_hex_shape(p, s); break;
    case GRID_WEDGE: compute_wedge_shape(p, s); break;
    default: compute_pyramid_shape(p, s); break;
    }
}

/* Solves the 3 × 3 system a x[0] + b x[1] + c x[2] = right by Cramer's rule. Returns whether it has a solution. */
static bool solve_3x3_system(const double *a, const double *b, const double *c, const double *right, double x[3])
{
    const double *m[3] = {a, b, c};
    double cofactor[3][3];
    for (int i = 0; i < 3; i++) {
        const double *p = m[(i + 1) % 3], *q = m[(i + 2) % 3];
        for (int k = 0; k < 3; k++) cofactor[i][k] = p[(k + 1) % 3] * q[(k + 2) % 3] - p[(k + 2) % 3] * q[(k + 1) % 3];
    }
    const double determinant = a[0] * cofactor[0][0] + a[1] * cofactor[0][1] + a[2] * cofactor[0][2];
    if (determinant == 0 || !isfinite(determinant)) return false;
    for (int i = 0; i < 3; i++)
        x[i] = (right[0] * cofactor[i][0] + right[1] * cofactor[i][1] + right[2] * cofactor[i][2]) / determinant;
    return true;
}

/* Computes the columns dP/dparameter of the map's Jacobian and the remainder point - P(parameter). type and count are
 * those of the cell. They are passed as constants, and the function is inlined, so that the compiler unrolls the
 * loops. */
static inline __attribute__((always_inline)) void evaluate_map(const reference_cell *cell, int type, int count,
                                                               const double *parameter, const double *point,
                                                               double columns[3][3], double left[3])
{
    shape_function s[8];
    compute_cell_shape(type, parameter, s);
    for (int axis = 0; axis < 3; axis++) {
        left[axis] = point[axis];
        for (int k = 0; k < 3; k++) columns[k][axis] = 0;
        for (int i = 0; i < count; i++) {
            left[axis] -= s[i].n * cell->position[i][axis];
            for (int k = 0; k < 3; k++) columns[k][axis] += s[i].d[k] * cell->position[i][axis];
        }
    }
}

static double length3(const double *v)
{
    return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

static double compute_cell_extent(const reference_cell *cell)
{
    double extent = 0;
    for (int i = 1; i < cell->count; i++)
        for (int axis = 0; axis < 3; axis++)
            extent = fmax(extent, fabs(cell->position[i][axis] - cell->position[0][axis]));
    return extent;
}

static inline __attribute__((always_inline)) bool
solve_by_newton_in_cell_type(const reference_cell *cell, int type, int count, const double *point, double parameter[3])
{
    const double tolerance = 1e-13 * compute_cell_extent(cell);
    for (int step = 0; step < 60; step++) {
        double columns[3][3], left[3], move[3];
        evaluate_map(cell, type, count, parameter, point, columns, left);
        if (!solve_3x3_system(columns[0], columns[1], columns[2], left, move)) return false;
        const double length = length3(move), limit = length > 0.5 && type != GRID_TET ? 0.5 / length : 1;
        for (int k = 0; k < 3; k++) parameter[k] += limit * move[k];
        /* Newton's error decreases as the square of the step: the next step would be below 1e-16. */
        if (length3(left) <= tolerance || length < 1e-9) return isfinite(length);
    }
    return false;
}

static bool solve_by_newton(const reference_cell *cell, const double *point, double parameter[3])
{
    switch (cell->type) {
    case GRID_TET: return solve_by_newton_in_cell_type(cell, GRID_TET, 4, point, parameter);
    case GRID_HEX: return solve_by_newton_in_cell_type(cell, GRID_HEX, 8, point, parameter);
    case GRID_WEDGE: return solve_by_newton_in_cell_type(cell, GRID_WEDGE, 6, point, parameter);
    default: return solve_by_newton_in_cell_type(cell, GRID_PYRAMID, 5, point, parameter);
    }
}

/* Returns how far the parameters are outside the cell. The points of a pyramid lie beside its base, whose corners may
 * be half of the pyramid's height above or below them: their third parameter has as much more room. */
static double compute_distance_outside_cell(const reference_cell *cell, const double *parameter)
{
    const double room = cell->type == GRID_PYRAMID ? 0.5 : 0;
    return fmax(compute_distance_outside_unit(parameter[0]),
                fmax(compute_distance_outside_unit(parameter[1]), compute_distance_outside_unit(parameter[2]) - room));
}

/* Inverts the map by Newton's method. The starting points are tried in this order: the previous solution of this
 * thread, which is close if the point is the next one along a ray; the cell's centre; and the other starts, until a
 * solution is less than 0.1 outside the cell. Returns the solution that is nearest to the cell. */
static bool invert_map(const reference_cell *cell, const double *point, double parameter[3])
{
    static _Thread_local double starts[10][3] = {{0.5, 0.5, 0.5},  {0.4, 0.4, 0.5}, {0.1, 0.1, 0.1}, {0.9, 0.05, 0.1},
                                                 {0.05, 0.9, 0.1}, {0.9, 0.9, 0.1}, {0.1, 0.1, 0.9}, {0.9, 0.05, 0.9},
                                                 {0.05, 0.9, 0.9}, {0.9, 0.9, 0.9}};
    double best = (double)INFINITY;
    for (int i = 0; i < 10 && best > 0.1; i++) {
        double p[3];
        memcpy(p, starts[i], sizeof p);
        if (!solve_by_newton(cell, point, p) || compute_distance_outside_cell(cell, p) >= best) continue;
        best = compute_distance_outside_cell(cell, p);
        memcpy(parameter, p, sizeof p);
    }
    if (best <= 0.1) memcpy(starts[0], parameter, sizeof starts[0]);
    return isfinite(best);
}

/* Moves the point along its line from the apex to the height of the base's centre. scale receives the factor by which
 * the distance from the apex changes. */
static bool project_from_apex(const reference_cell *cell, const double *point, double moved[3], double *scale)
{
    const double *apex = cell->position[4];
    double axis[3], from[3], height = 0, here = 0;
    for (int k = 0; k < 3; k++) {
        axis[k] = -apex[k];
        for (int i = 0; i < 4; i++) axis[k] += cell->position[i][k] / 4;
        from[k] = point[k] - apex[k];
        height += axis[k] * axis[k];
        here += axis[k] * from[k];
    }
    if (here <= 1e-14 * height) return false;
    *scale = height / here;
    for (int k = 0; k < 3; k++) moved[k] = apex[k] + *scale * from[k];
    return true;
}

static void compute_gradient(const reference_cell *cell, const double *parameter, const double *values,
                             double gradient[3])
{
    shape_function s[8];
    double columns[3][3], rows[3][3], unused[3], slope[3] = {0, 0, 0};
    compute_cell_shape(cell->type, parameter, s);
    evaluate_map(cell, cell->type, cell->count, parameter, parameter, columns, unused);
    for (int k = 0; k < 3; k++)
        for (int i = 0; i < cell->count; i++) slope[k] += s[i].d[k] * values[i];
    for (int k = 0; k < 3; k++)
        for (int axis = 0; axis < 3; axis++) rows[axis][k] = columns[k][axis];
    if (!solve_3x3_system(rows[0], rows[1], rows[2], slope, gradient)) gradient[0] = gradient[1] = gradient[2] = 0;
}

static double interpolate_value(const reference_cell *cell, const double *parameter, const double *values)
{
    shape_function s[8];
    double value = 0;
    compute_cell_shape(cell->type, parameter, s);
    for (int i = 0; i < cell->count; i++) value += s[i].n * values[i];
    return value;
}

static bool interpolate_pyramid(const reference_cell *cell, const double *point, const double *values, double *value,
                                double *gradient)
{
    double moved[3], parameter[3], scale;
    *value = values[4];
    if (!project_from_apex(cell, point, moved, &scale)) return true;
    if (!invert_map(cell, moved, parameter)) return false;
    if (gradient) compute_gradient(cell, parameter, values, gradient);
    parameter[2] = 1 - (1 - parameter[2]) / scale;
    *value = interpolate_value(cell, parameter, values);
    return true;
}

bool reference_interpolate(const reference_cell *cell, const double point[3], const double *values, double *value,
                           double gradient[3])
{
    double parameter[3];
    *value = 0;
    if (gradient) gradient[0] = gradient[1] = gradient[2] = 0;
    if (cell->type == GRID_POLYHEDRON) return reference_polyhedron_interpolate(cell, point, values, value, gradient);
    if (cell->type == GRID_PYRAMID) return interpolate_pyramid(cell, point, values, value, gradient);
    if (!invert_map(cell, point, parameter)) return false;
    if (gradient) compute_gradient(cell, parameter, values, gradient);
    *value = interpolate_value(cell, parameter, values);
    return true;
}
