/* All weights of interpolation are products of the weights of a line, a triangle and a tet, which are applied one after
 * the other:
 *
 *     hex        line along i, then j, then k
 *     quad       line along i, then j
 *     wedge      triangle in each layer, then line along k
 *     tet        tet
 *     pyramid    pyramid
 *     triangle   triangle
 *
 * The bits of a sum depend on the order of its terms. So nodes on a face are computed a second time, from the face's
 * nodes alone, in an order that follows from the positions of the face's corners. The origin is the corner with the
 * lexicographically smallest position, and the first axis leads to that neighbouring corner whose position is smaller.
 * Then nodes on an edge are computed from the edge's nodes alone, beginning at the end with the smaller position, and
 * corners are copied. All cells that share a face or an edge compute its nodes in the same way, on all ranks.
 *
 * Each sum adds up differences from its first value, so that a constant is reproduced exactly. */
#include "session_interpolation.h"

#include <string.h>

#include "memory.h"
#include "session_derivatives.h"
#include "session_matrix.h"
#include "session_shape.h"
#include "vector3.h"

static int find_index(const session_nodes *of, const int at[3])
{
    return session_node_index(of, INSITU_ORDER_LEXICOGRAPHIC, at[0], at[1], at[2]);
}

/* ---- weights --------------------------------------------------------------------------------------------------- */

static void fill_line_weights(int p, int parts, bool is_lobatto, double *out)
{
    double x[NODES_MOST_ORDER + 1];
    session_compute_node_positions(p, is_lobatto, x);
    for (int r = 0; r <= parts * p; r++)
        for (int i = 0; i <= p; i++) {
            const double at = (double)r / (parts * p);
            double weight = 1;
            for (int m = 0; m <= p; m++) weight *= m == i ? 1 : (at - x[m]) / (x[i] - x[m]);
            out[r * (p + 1) + i] = weight;
        }
}

/* Computes B_n(t), as defined in session_derivatives.c. */
static double find_product(int n, double t)
{
    double value = 1;
    for (int m = 0; m < n; m++) value = value * (t - m) / (m + 1);
    return value;
}

/* Computes the weights of a triangle or, if is_tet is set, of a tet. p: order of the cell; parts: the fine lattice has
 * the order parts * p. */
static void fill_simplex_weights(int p, int parts, bool is_tet, double *out)
{
    const int fine = parts * p;
    for (int k = 0; k <= (is_tet ? fine : 0); k++)
        for (int j = 0; j <= fine - k; j++)
            for (int i = 0; i <= fine - k - j; i++)
                for (int c = 0; c <= (is_tet ? p : 0); c++)
                    for (int b = 0; b <= p - c; b++)
                        for (int a = 0; a <= p - c - b; a++)
                            *out++ = find_product(a, (double)i / parts) * find_product(b, (double)j / parts) *
                                     find_product(c, (double)k / parts) *
                                     find_product(p - a - b - c, (double)(fine - i - j - k) / parts);
}

/* ---- pyramids ---- */

/* Returns the Legendre polynomial of order n, for t from 0 to 1. */
static double find_legendre(int n, double t)
{
    double before = 0, value = 1;
    for (int m = 0; m < n; m++) {
        const double next = ((2 * m + 1) * (2 * t - 1) * value - m * before) / (m + 1);
        before = value;
        value = next;
    }
    return value;
}

/* Computes a pyramid's basis at a point with coordinates from 0 to 1. Its functions are
 * P_i(x / (1 - z)) P_j(y / (1 - z)) (1 - z)^max(i, j) P_k(z), with i and j up to p, and k up to p - max(i, j). They
 * contain all polynomials of order p, those of both orders p on the base, and no others on the triangles (Bergot,
 * Cohen, Durufle: Higher-order finite elements for hybrid meshes using new nodal pyramidal elements, 2010). */
static void fill_pyramid_basis(int p, const double at[3], double *out)
{
    const double rest = 1 - at[2], x = rest > 0 ? at[0] / rest : 0, y = rest > 0 ? at[1] / rest : 0;
    for (int i = 0; i <= p; i++)
        for (int j = 0; j <= p; j++) {
            const int most = i > j ? i : j;
            double scale = 1;
            for (int m = 0; m < most; m++) scale *= rest;
            for (int k = 0; k <= p - most; k++)
                *out++ = find_legendre(i, x) * find_legendre(j, y) * scale * find_legendre(k, at[2]);
        }
}

/* Fills rows of the basis at all nodes of a collapsed hex of order p. */
static void fill_collapsed_rows(int p, double *out)
{
    const int columns = session_complete_nodes(GRID_PYRAMID, p).count;
    for (int k = 0; k <= p; k++)
        for (int j = 0; j <= p; j++)
            for (int i = 0; i <= p; i++, out += columns) {
                const double rest = 1 - (double)k / p;
                fill_pyramid_basis(p, (const double[]){rest * i / p, rest * j / p, 1 - rest}, out);
            }
}

/* Fills rows of the basis at all nodes of a pyramid's lattice of order n. */
static void fill_pyramid_rows(int p, int n, double *out)
{
    const int columns = session_complete_nodes(GRID_PYRAMID, p).count;
    for (int k = 0; k <= n; k++)
        for (int j = 0; j <= n - k; j++)
            for (int i = 0; i <= n - k; i++, out += columns)
                fill_pyramid_basis(p, (const double[]){(double)i / n, (double)j / n, (double)k / n}, out);
}

/* Replaces each row, the basis at a point, by the weights of the values at a pyramid's nodes for the value at the
 * point. Returns false if memory runs out. */
static bool convert_rows(int p, int count, double *rows)
{
    const int size = session_complete_nodes(GRID_PYRAMID, p).count;
    const size_t squares = (size_t)size * (size_t)size, bytes = (size_t)count * (size_t)size * sizeof *rows;
    double *basis = base_alloc(squares * sizeof *basis), *inverse = base_calloc(squares, sizeof *inverse);
    double *copy = base_alloc(bytes);
    const bool is_made = basis && inverse && copy;
    if (is_made) {
        for (int n = 0; n < size; n++) inverse[n * size + n] = 1;
        fill_pyramid_rows(p, p, basis);
        session_invert_matrix(size, basis, inverse);
        memcpy(copy, rows, bytes);
        session_multiply_matrix(copy, count, size, 1, size, inverse, rows);
    }
    base_free(basis);
    base_free(inverse);
    base_free(copy);
    return is_made;
}

/* Computes the weights of a pyramid. Returns false if memory runs out. */
static bool fill_pyramid_weights(int p, int parts, double *out)
{
    fill_pyramid_rows(p, parts * p, out);
    return convert_rows(p, session_complete_nodes(GRID_PYRAMID, parts * p).count, out);
}

double *session_make_collapse(int p)
{
    const int columns = session_complete_nodes(GRID_PYRAMID, p).count, rows = session_complete_nodes(GRID_HEX, p).count;
    double *out = base_alloc((size_t)rows * (size_t)columns * sizeof *out);
    if (!out) return NULL;
    fill_collapsed_rows(p, out);
    if (convert_rows(p, rows, out)) return out;
    base_free(out);
    return NULL;
}

/* ---- all types ---- */

static size_t count_weights(int type, int p, int parts)
{
    return (size_t)session_complete_nodes(type, parts * p).count * (size_t)session_complete_nodes(type, p).count;
}

static bool make_weights(const session_nodes *of, int parts, bool is_lobatto, session_interpolation *out)
{
    const int p = of->order;
    const bool is_box = of->type == GRID_HEX || of->type == GRID_QUAD;
    const bool is_whole = of->type == GRID_TET || of->type == GRID_PYRAMID;
    out->line = base_alloc((size_t)(parts * p + 1) * (size_t)(p + 1) * sizeof *out->line);
    if (!is_box) out->triangle = base_alloc(count_weights(GRID_TRIANGLE, p, parts) * sizeof *out->triangle);
    if (is_whole) out->whole = base_alloc(count_weights(of->type, p, parts) * sizeof *out->whole);
    if (!out->line || (!is_box && !out->triangle) || (is_whole && !out->whole)) return false;
    fill_line_weights(p, parts, is_lobatto && is_box, out->line);
    if (!is_box) fill_simplex_weights(p, parts, false, out->triangle);
    if (of->type == GRID_TET) fill_simplex_weights(p, parts, true, out->whole);
    return of->type != GRID_PYRAMID || fill_pyramid_weights(p, parts, out->whole);
}

static void find_positions(const session_nodes *of, insitu_vertex_order order, session_interpolation *out)
{
    const session_shape *shape = session_shape_of(of->type);
    const int p = of->order;
    for (int k = 0; k <= p; k++)
        for (int j = 0; j <= p; j++)
            for (int i = 0; i <= p; i++)
                if (session_has_node(of, i, j, k))
                    out->positions[find_index(&out->complete, (const int[]){i, j, k})] =
                        session_node_index(of, order, i, j, k);
    for (int c = 0; c < shape->corner_count; c++) {
        const signed char *at = shape->corners[c];
        out->corners[c] = session_node_index(of, order, p * at[0], p * at[1], p * at[2]);
    }
}

bool session_make_completion(const session_nodes *of, insitu_vertex_order order, session_interpolation *out)
{
    *out = (session_interpolation){.of = *of, .complete = session_complete_nodes(of->type, of->order)};
    out->positions = base_alloc((size_t)out->complete.count * sizeof *out->positions);
    if (out->positions) find_positions(of, order, out);
    return out->positions;
}

bool session_make_interpolation(const session_nodes *of, insitu_vertex_order order, int parts, bool is_lobatto,
                                session_interpolation *out)
{
    if (!session_make_completion(of, order, out)) return false;
    out->fine = session_complete_nodes(of->type, parts * of->order);
    return make_weights(of, parts, is_lobatto, out);
}

void session_drop_interpolation(session_interpolation *interpolation)
{
    base_free(interpolation->positions);
    base_free(interpolation->line);
    base_free(interpolation->triangle);
    base_free(interpolation->whole);
    *interpolation = (session_interpolation){0};
}

/* ---- one cell -------------------------------------------------------------------------------------------------- */

/* The state of interpolating the values of one cell. */
typedef struct cell_job {
    const session_interpolation *of;
    const session_shape *shape;
    const double (*corners)[3];
    int size;        /* number of components */
    double *lattice; /* tuples at the nodes of the complete lattice, in lexicographic order */
    double *spare[2];
    double *out;
} cell_job;

size_t session_interpolation_work_size(const session_interpolation *of, int components)
{
    return ((size_t)of->complete.count + 2 * (size_t)of->fine.count) * (size_t)components;
}

/* Computes one row of a product of matrices, number by number, so that sums of short tuples stay in registers. */
static void apply_row(const double *row, int columns, int inner, const double *in, double *out)
{
    for (int s = 0; s < inner; s++) {
        const double first = in[s];
        double sum = 0;
        for (int c = 0; c < columns; c++) sum += row[c] * (in[c * inner + s] - first);
        out[s] = sum + first;
    }
}

/* Does the same as apply_row() for long tuples, with loops that the compiler can vectorize. Each sum has the same terms
 * in the same order. */
static void apply_long_row(const double *row, int columns, int inner, const double *restrict in, double *restrict out)
{
    for (int s = 0; s < inner; s++) out[s] = 0;
    for (int c = 0; c < columns; c++)
        for (int s = 0; s < inner; s++) out[s] += row[c] * (in[c * inner + s] - in[s]);
    for (int s = 0; s < inner; s++) out[s] += in[s];
}

/* Multiplies each of `outer` arrays of columns x inner numbers with a matrix of rows x columns. */
static void multiply_by_matrix(const double *matrix, int rows, int columns, int outer, int inner, const double *in,
                               double *out)
{
    enum { SHORT = 6 };
    for (int o = 0; o < outer; o++, in += columns * inner)
        for (int r = 0; r < rows; r++, out += inner)
            if (inner <= SHORT)
                apply_row(matrix + r * columns, columns, inner, in, out);
            else
                apply_long_row(matrix + r * columns, columns, inner, in, out);
}

static double neighbour_value(const cell_job *job, const int at[3], const int step[3], int component)
{
    const int node[3] = {at[0] + step[0], at[1] + step[1], at[2] + step[2]};
    return job->lattice[find_index(&job->of->complete, node) * job->size + component];
}

/* Returns the sum of the values at the two nodes that are `step` away from a node. */
static double sum_pair(const cell_job *job, const int at[3], const int step[3], int component)
{
    const int back[3] = {-step[0], -step[1], -step[2]};
    return neighbour_value(job, at, step, component) + neighbour_value(job, at, back, component);
}

/* Returns the value at the middle of a face of a serendipity cell. The sums do not depend on the order of axes. */
static double middle_of_face(const cell_job *job, const int at[3], const int a[3], const int b[3], int component)
{
    const int sum[3] = {a[0] + b[0], a[1] + b[1], a[2] + b[2]}, difference[3] = {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
    return 0.5 * (sum_pair(job, at, a, component) + sum_pair(job, at, b, component)) -
           0.25 * (sum_pair(job, at, sum, component) + sum_pair(job, at, difference, component));
}

static double middle_of_hex(const cell_job *job, const int at[3], int component)
{
    double edges = 0, corners = 0;
    for (int n = 0; n < 27; n++) {
        const int step[3] = {n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1};
        const int zeros = (step[0] == 0) + (step[1] == 0) + (step[2] == 0);
        if (zeros == 1) edges += neighbour_value(job, at, step, component);
        if (zeros == 0) corners += neighbour_value(job, at, step, component);
    }
    return 0.25 * (edges - corners);
}

static void fill_missing(const cell_job *job, const int at[3])
{
    int directions[3][3];
    const int count = session_missing_directions(job->of->of.type, at, directions);
    double *out = job->lattice + find_index(&job->of->complete, at) * job->size;
    for (int c = 0; c < job->size; c++)
        out[c] = count == 3 ? middle_of_hex(job, at, c) : middle_of_face(job, at, directions[0], directions[1], c);
}

void session_complete_tuples(const session_interpolation *of, int components, const double *tuples, double *out)
{
    const cell_job job = {.of = of, .size = components, .lattice = out};
    const size_t bytes = (size_t)components * sizeof *tuples;
    for (int n = 0; n < of->complete.count; n++)
        if (of->positions[n] < of->of.count)
            memcpy(out + n * components, tuples + of->positions[n] * components, bytes);
    for (int n = 0; n < 27 && !of->of.is_complete; n++) {
        const int at[3] = {n % 3, n / 3 % 3, n / 9};
        if (session_has_node(&of->of, at[0], at[1], at[2]) &&
            of->positions[find_index(&of->complete, at)] >= of->of.count)
            fill_missing(&job, at);
    }
}

/* Computes all fine nodes from the lattice of the cell. */
static void fill_inside(const cell_job *job)
{
    const session_interpolation *of = job->of;
    const int c = of->of.order + 1, r = of->fine.order + 1, size = job->size;
    const int triangle = c * (c + 1) / 2, triangles = r * (r + 1) / 2;
    double *a = job->spare[0], *b = job->spare[1];
    switch (of->of.type) {
    case GRID_TRIANGLE: multiply_by_matrix(of->triangle, triangles, triangle, 1, size, job->lattice, job->out); break;
    case GRID_TET:
    case GRID_PYRAMID:
        multiply_by_matrix(of->whole, of->fine.count, of->complete.count, 1, size, job->lattice, job->out);
        break;
    case GRID_WEDGE:
        multiply_by_matrix(of->triangle, triangles, triangle, c, size, job->lattice, a);
        multiply_by_matrix(of->line, r, c, 1, triangles * size, a, job->out);
        break;
    case GRID_QUAD:
        multiply_by_matrix(of->line, r, c, c, size, job->lattice, a);
        multiply_by_matrix(of->line, r, c, 1, r * size, a, job->out);
        break;
    default:
        multiply_by_matrix(of->line, r, c, c * c, size, job->lattice, a);
        multiply_by_matrix(of->line, r, c, c, r * size, a, b);
        multiply_by_matrix(of->line, r, c, 1, r * r * size, b, job->out);
    }
}

/* The axes of a face or edge: positions of its origin and of the ends of both axes, in a lattice of order 1. An edge
 * has only the first axis. */
typedef struct face_axes {
    int count; /* number of the face's corners */
    const signed char *origin, *along, *across;
} face_axes;

/* Returns the index in the cell's lattice of the face's node i, j. */
static int find_face_node(const session_nodes *of, const face_axes *axes, int i, int j)
{
    int at[3];
    for (int a = 0; a < 3; a++)
        at[a] = axes->origin[a] * of->order + i * (axes->along[a] - axes->origin[a]) +
                j * (axes->across[a] - axes->origin[a]);
    return find_index(of, at);
}

/* Copies tuples from a lattice to an array of the face's nodes if is_read is set, and in the opposite direction
 * otherwise. */
static void copy_face(const session_nodes *of, const face_axes *axes, int size, bool is_read, double *lattice,
                      double *face)
{
    const int p = of->order;
    const size_t bytes = (size_t)size * sizeof *face;
    for (int j = 0; j <= (axes->count > 2 ? p : 0); j++)
        for (int i = 0; i <= (axes->count == 3 ? p - j : p); i++, face += size) {
            double *node = lattice + find_face_node(of, axes, i, j) * size;
            memcpy(is_read ? face : node, is_read ? node : face, bytes);
        }
}

static void fill_face(const cell_job *job, const face_axes *axes)
{
    const session_interpolation *of = job->of;
    const int c = of->of.order + 1, r = of->fine.order + 1, size = job->size;
    double *a = job->spare[0], *b = job->spare[1];
    copy_face(&of->complete, axes, size, true, job->lattice, a);
    if (axes->count == 3) {
        multiply_by_matrix(of->triangle, r * (r + 1) / 2, c * (c + 1) / 2, 1, size, a, b);
    } else {
        multiply_by_matrix(of->line, r, c, axes->count == 4 ? c : 1, size, a, b);
        if (axes->count == 4) multiply_by_matrix(of->line, r, c, 1, r * size, b, a);
    }
    copy_face(&of->fine, axes, size, false, job->out, axes->count == 4 ? a : b);
}

static bool is_before(const cell_job *job, int a, int b)
{
    return vector3_compare(job->corners[a], job->corners[b]) < 0;
}

/* Chooses the axes of a face by the positions of its corners. */
static face_axes choose_axes(const cell_job *job, const signed char *face)
{
    const int count = face[3] < 0 ? 3 : 4;
    int first = 0;
    for (int n = 1; n < count; n++)
        if (is_before(job, face[n], face[first])) first = n;
    int along = face[(first + 1) % count], across = face[(first + count - 1) % count];
    if (is_before(job, across, along)) {
        const int swapped = along;
        along = across;
        across = swapped;
    }
    const signed char(*at)[3] = job->shape->corners;
    return (face_axes){count, at[(int)face[first]], at[along], at[across]};
}

static void fill_edge(const cell_job *job, const signed char ends[2])
{
    const int first = is_before(job, ends[1], ends[0]);
    const signed char *origin = job->shape->corners[(int)ends[first]];
    fill_face(job, &(face_axes){2, origin, job->shape->corners[(int)ends[!first]], origin});
}

static void copy_corner(const cell_job *job, int corner)
{
    const session_interpolation *of = job->of;
    const signed char *at = job->shape->corners[corner];
    const face_axes axes = {1, at, at, at};
    memcpy(job->out + find_face_node(&of->fine, &axes, 0, 0) * job->size,
           job->lattice + find_face_node(&of->complete, &axes, 0, 0) * job->size, (size_t)job->size * sizeof *job->out);
}

void session_interpolate(const session_interpolation *of, const double (*corners)[3], int components,
                         const double *tuples, double *work, double *out)
{
    cell_job job = {.of = of,
                    .shape = session_shape_of(of->of.type),
                    .corners = corners,
                    .size = components,
                    .lattice = work,
                    .out = out};
    job.spare[0] = work + of->complete.count * components;
    job.spare[1] = job.spare[0] + of->fine.count * components;
    session_complete_tuples(of, components, tuples, work);
    fill_inside(&job);
    for (int f = 0; f < job.shape->face_count; f++) {
        const face_axes axes = choose_axes(&job, job.shape->faces[f]);
        fill_face(&job, &axes);
    }
    for (int e = 0; e < job.shape->edge_count; e++) fill_edge(&job, job.shape->edges[e]);
    for (int c = 0; c < job.shape->corner_count; c++) copy_corner(&job, c);
}
