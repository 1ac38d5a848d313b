/* The weights of interpolation in each type of cell are products of the weights of a line, a triangle, a tet or a
 * pyramid, which are applied one after the other:
 *
 *     hex        line along i, then j, then k
 *     quad       line along i, then j
 *     wedge      triangle in each layer, then line along k
 *     tet        tet
 *     pyramid    pyramid
 *     triangle   triangle
 *
 * The bits of a sum depend on the order of its terms. So the values at nodes on a face are computed a second time, only
 * from the values at the face's nodes, in an order that follows from the positions of the face's corners. The origin is
 * the corner with the lexicographically smallest position, and the first axis leads to that neighbouring corner whose
 * position is smaller. Then the values at nodes on an edge are computed only from the values at the edge's nodes,
 * beginning at the end with the smaller position, and the values at the cell's own nodes are copied. All cells that
 * share a face or an edge compute the values at its nodes in the same way, on all ranks.
 *
 * The matrix is the same for all faces with the same number of corners, and for all edges. So the tuples at the nodes
 * of these faces or edges are gathered into one array, in which the tuples at the n-th nodes of all faces are
 * contiguous. One product of matrices then computes all faces.
 *
 * Each sum adds up differences from its first value, so that a constant is reproduced exactly. */
#include "session_interpolation.h"

#include <string.h>

#include "memory.h"
#include "session_derivatives.h"
#include "session_matrix.h"
#include "session_shape.h"
#include "vector3.h"

static int find_lexicographic_index(const session_nodes *of, const int at[3])
{
    return session_find_node_in_connectivity(of, INSITU_ORDER_LEXICOGRAPHIC, at[0], at[1], at[2]);
}

/* ---- weights of interpolation ---------------------------------------------------------------------------------- */

/* Computes the weights of a line: the values of the Lagrange polynomials of its p + 1 nodes at the parts * p + 1 nodes
 * of the finer lattice. out: one row per finer node, one column per polynomial. */
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

/* Computes B_n(t) = t (t - 1) ... (t - n + 1) / n!. The Lagrange polynomials of triangles and tets with equispaced
 * nodes are products of these polynomials (session_derivatives.c). */
static double evaluate_silvester_polynomial(int n, double t)
{
    double value = 1;
    for (int m = 0; m < n; m++) value = value * (t - m) / (m + 1);
    return value;
}

/* Computes the weights of a triangle or, if is_tet is set, of a tet: the values of the Lagrange polynomials of order p
 * at the nodes of the finer lattice, which has the order parts * p. out: one row per finer node, one column per
 * polynomial. */
static void fill_simplex_weights(int p, int parts, bool is_tet, double *out)
{
    const int fine = parts * p;
    for (int k = 0; k <= (is_tet ? fine : 0); k++)
        for (int j = 0; j <= fine - k; j++)
            for (int i = 0; i <= fine - k - j; i++)
                for (int c = 0; c <= (is_tet ? p : 0); c++)
                    for (int b = 0; b <= p - c; b++)
                        for (int a = 0; a <= p - c - b; a++)
                            *out++ = evaluate_silvester_polynomial(a, (double)i / parts) *
                                     evaluate_silvester_polynomial(b, (double)j / parts) *
                                     evaluate_silvester_polynomial(c, (double)k / parts) *
                                     evaluate_silvester_polynomial(p - a - b - c, (double)(fine - i - j - k) / parts);
}

/* ---- weights of pyramids ---- */

/* Returns the Legendre polynomial of order n, for t from 0 to 1. */
static double evaluate_shifted_legendre_polynomial(int n, double t)
{
    double before = 0, value = 1;
    for (int m = 0; m < n; m++) {
        const double next = ((2 * m + 1) * (2 * t - 1) * value - m * before) / (m + 1);
        before = value;
        value = next;
    }
    return value;
}

/* Computes the values of a pyramid's basis functions at a point with coordinates from 0 to 1. P_n are the Legendre
 * polynomials of the interval from 0 to 1. The functions are
 *
 *     P_i(x / (1 - z)) P_j(y / (1 - z)) (1 - z)^max(i, j) P_k(z),
 *
 * with i and j up to p, and k up to p - max(i, j). Together they contain all polynomials of order p; on the base, all
 * polynomials of order p along each of the two axes; on the triangles, only polynomials of order p (Bergot, Cohen,
 * Durufle: Higher-order finite elements for hybrid meshes using new nodal pyramidal elements, 2010). */
static void fill_pyramid_basis(int p, const double at[3], double *out)
{
    const double rest = 1 - at[2], x = rest > 0 ? at[0] / rest : 0, y = rest > 0 ? at[1] / rest : 0;
    for (int i = 0; i <= p; i++)
        for (int j = 0; j <= p; j++) {
            const int most = i > j ? i : j;
            double scale = 1;
            for (int m = 0; m < most; m++) scale *= rest;
            for (int k = 0; k <= p - most; k++)
                *out++ = evaluate_shifted_legendre_polynomial(i, x) * evaluate_shifted_legendre_polynomial(j, y) *
                         scale * evaluate_shifted_legendre_polynomial(k, at[2]);
        }
}

/* Fills a matrix with the pyramid's basis functions at all nodes of a hex of order p whose upper face is collapsed to
 * the apex: one row per node, one column per function. */
static void fill_collapsed_hex_basis(int p, double *out)
{
    const int columns = session_describe_complete_nodes(GRID_PYRAMID, p).count;
    for (int k = 0; k <= p; k++)
        for (int j = 0; j <= p; j++)
            for (int i = 0; i <= p; i++, out += columns) {
                const double rest = 1 - (double)k / p;
                fill_pyramid_basis(p, (const double[]){rest * i / p, rest * j / p, 1 - rest}, out);
            }
}

/* Fills a matrix with the pyramid's basis functions at all nodes of a pyramid of order n: one row per node, one column
 * per function. p: order of the basis. */
static void evaluate_pyramid_basis_at_nodes(int p, int n, double *out)
{
    const int columns = session_describe_complete_nodes(GRID_PYRAMID, p).count;
    for (int k = 0; k <= n; k++)
        for (int j = 0; j <= n - k; j++)
            for (int i = 0; i <= n - k; i++, out += columns)
                fill_pyramid_basis(p, (const double[]){(double)i / n, (double)j / n, (double)k / n}, out);
}

/* Converts values of a pyramid's basis functions into weights of the pyramid's nodes. Before the call, each row has the
 * values of the basis functions at a point. Afterwards it has the weights with which the values at the pyramid's nodes
 * are summed to give the value at this point. Returns false if memory runs out. */
static bool convert_basis_values_to_weights(int p, int count, double *rows)
{
    const int size = session_describe_complete_nodes(GRID_PYRAMID, p).count;
    const size_t squares = (size_t)size * (size_t)size, bytes = (size_t)count * (size_t)size * sizeof *rows;
    double *basis = base_alloc(squares * sizeof *basis), *inverse = base_calloc(squares, sizeof *inverse);
    double *copy = base_alloc(bytes);
    const bool is_made = basis && inverse && copy;
    if (is_made) {
        for (int n = 0; n < size; n++) inverse[n * size + n] = 1;
        evaluate_pyramid_basis_at_nodes(p, p, basis);
        session_invert_matrix(size, basis, inverse);
        memcpy(copy, rows, bytes);
        session_multiply_matrix(copy, count, size, 1, size, inverse, rows);
    }
    base_free(basis);
    base_free(inverse);
    base_free(copy);
    return is_made;
}

/* Computes the weights with which the values at a pyramid's nodes are summed at each node of the finer lattice. out:
 * one row per finer node, one column per node of the pyramid. Returns false if memory runs out. */
static bool fill_pyramid_weights(int p, int parts, double *out)
{
    evaluate_pyramid_basis_at_nodes(p, parts * p, out);
    return convert_basis_values_to_weights(p, session_describe_complete_nodes(GRID_PYRAMID, parts * p).count, out);
}

double *session_compute_collapse_matrix(int p)
{
    const int columns = session_describe_complete_nodes(GRID_PYRAMID, p).count,
              rows = session_describe_complete_nodes(GRID_HEX, p).count;
    double *out = base_alloc((size_t)rows * (size_t)columns * sizeof *out);
    if (!out) return NULL;
    fill_collapsed_hex_basis(p, out);
    if (convert_basis_values_to_weights(p, rows, out)) return out;
    base_free(out);
    return NULL;
}

/* ---- weights of all types of cells ---- */

static size_t count_weights(int type, int p, int parts)
{
    return (size_t)session_describe_complete_nodes(type, parts * p).count *
           (size_t)session_describe_complete_nodes(type, p).count;
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

/* Finds out->positions and out->corners, the positions of all nodes and of the corners in the cell's list of nodes in
 * the connectivity. */
static void find_nodes_in_connectivity(const session_nodes *of, insitu_vertex_order order, session_interpolation *out)
{
    const int p = of->order;
    for (int k = 0; k <= p; k++)
        for (int j = 0; j <= p; j++)
            for (int i = 0; i <= p; i++)
                if (session_has_node(of, i, j, k))
                    out->positions[find_lexicographic_index(&out->complete, (const int[]){i, j, k})] =
                        session_find_node_in_connectivity(of, order, i, j, k);
    session_find_corners(of, order, out->corners);
}

/* ---- nodes on faces and edges ---- */

/* Two axes along which the nodes of a face are listed; for an edge, the second axis has the length 0. origin: lattice
 * indices, in a lattice of order 1, of the corner from which both axes start; along, across: those of the corners at
 * which the first and the second axis end. */
typedef struct side_axes {
    const signed char *origin, *along, *across;
} side_axes;

/* Finds the axes along which the nodes of a face or edge are listed in one of the possible orders. side: the face's
 * corners, in order around it; turn: number of the order, 0 .. session_interpolation_sides.turn_count - 1. */
static side_axes find_side_axes(const session_shape *shape, const signed char *side, int corner_count, int turn)
{
    const int first = corner_count == 2 ? turn : turn / 2, step = corner_count > 2 && turn % 2 ? corner_count - 1 : 1;
    const int along = (first + step) % corner_count;
    const int across = corner_count == 2 ? first : (first + corner_count - step) % corner_count;
    const signed char(*at)[3] = shape->corners;
    return (side_axes){at[(int)side[first]], at[(int)side[along]], at[(int)side[across]]};
}

/* Lists the nodes of a face or an edge, row by row along its axes. out: receives the lexicographic index of each node
 * in the lattice `of`. */
static void list_nodes_of_side(const session_nodes *of, const side_axes *axes, int corner_count, int *out)
{
    const int p = of->order;
    for (int j = 0; j <= (corner_count > 2 ? p : 0); j++)
        for (int i = 0; i <= (corner_count == 3 ? p - j : p); i++) {
            int at[3];
            for (int a = 0; a < 3; a++)
                at[a] = axes->origin[a] * p + i * (axes->along[a] - axes->origin[a]) +
                        j * (axes->across[a] - axes->origin[a]);
            *out++ = find_lexicographic_index(of, at);
        }
}

static int count_side_nodes(int corner_count, int order)
{
    if (corner_count == 2) return order + 1;
    return corner_count == 3 ? (order + 1) * (order + 2) / 2 : (order + 1) * (order + 1);
}

static void add_side(session_interpolation_sides *sides, const signed char *corners)
{
    memcpy(sides->corners[sides->count++], corners, (size_t)sides->corner_count);
}

static bool list_nodes_of_equal_sides(session_interpolation *out, session_interpolation_sides *sides)
{
    const session_shape *shape = session_get_cell_shape(out->of.type);
    sides->turn_count = sides->corner_count == 2 ? 2 : 2 * sides->corner_count;
    sides->node_count = count_side_nodes(sides->corner_count, out->complete.order);
    sides->fine_count = count_side_nodes(sides->corner_count, out->fine.order);
    const int lists = sides->count * sides->turn_count;
    sides->nodes = base_alloc((size_t)(lists * sides->node_count + 1) * sizeof *sides->nodes);
    sides->fine_nodes = base_alloc((size_t)(lists * sides->fine_count + 1) * sizeof *sides->fine_nodes);
    if (!sides->nodes || !sides->fine_nodes) return false;
    for (int list = 0; list < lists; list++) {
        const side_axes axes = find_side_axes(shape, sides->corners[list / sides->turn_count], sides->corner_count,
                                              list % sides->turn_count);
        list_nodes_of_side(&out->complete, &axes, sides->corner_count, sides->nodes + list * sides->node_count);
        list_nodes_of_side(&out->fine, &axes, sides->corner_count, sides->fine_nodes + list * sides->fine_count);
    }
    return true;
}

static bool list_nodes_of_all_sides(session_interpolation *out)
{
    const session_shape *shape = session_get_cell_shape(out->of.type);
    session_interpolation_sides *quads = &out->sides[0], *triangles = &out->sides[1], *edges = &out->sides[2];
    quads->corner_count = 4;
    triangles->corner_count = 3;
    edges->corner_count = 2;
    for (int f = 0; f < shape->face_count; f++) add_side(shape->faces[f][3] < 0 ? triangles : quads, shape->faces[f]);
    for (int e = 0; e < shape->edge_count; e++) add_side(edges, shape->edges[e]);
    return list_nodes_of_equal_sides(out, quads) && list_nodes_of_equal_sides(out, triangles) &&
           list_nodes_of_equal_sides(out, edges);
}

/* Returns whether, along an axis, node `parts * i` of the finer lattice coincides with node i of the cell; it may not
 * if the cell's nodes are Gauss-Lobatto points. */
static bool is_finer_node_at_cell_node(const session_interpolation *of, int parts, int i)
{
    const double *row = of->line + parts * i * (of->of.order + 1);
    for (int m = 0; m <= of->of.order; m++)
        if (row[m] != (m == i)) return false;
    return true;
}

/* Lists the cell's nodes that coincide with a node of the finer lattice. If the cell's nodes are equispaced, these are
 * all of its nodes; otherwise at least its corners. */
static bool list_coinciding_nodes(session_interpolation *out, int parts)
{
    const int p = out->of.order;
    out->own = base_alloc((size_t)out->complete.count * sizeof *out->own);
    for (int k = 0; k <= p && out->own; k++)
        for (int j = 0; j <= p; j++)
            for (int i = 0; i <= p; i++)
                if (session_has_node(&out->of, i, j, k) && is_finer_node_at_cell_node(out, parts, i) &&
                    is_finer_node_at_cell_node(out, parts, j) && is_finer_node_at_cell_node(out, parts, k)) {
                    int *own = out->own[out->own_count++];
                    own[0] = find_lexicographic_index(&out->complete, (const int[]){i, j, k});
                    own[1] = find_lexicographic_index(&out->fine, (const int[]){parts * i, parts * j, parts * k});
                }
    return out->own;
}

bool session_map_nodes_to_connectivity(const session_nodes *of, insitu_vertex_order order, session_interpolation *out)
{
    *out = (session_interpolation){.of = *of, .complete = session_describe_complete_nodes(of->type, of->order)};
    out->positions = base_alloc((size_t)out->complete.count * sizeof *out->positions);
    if (out->positions) find_nodes_in_connectivity(of, order, out);
    return out->positions;
}

bool session_make_interpolation(const session_nodes *of, insitu_vertex_order order, int parts, bool is_lobatto,
                                session_interpolation *out)
{
    if (!session_map_nodes_to_connectivity(of, order, out)) return false;
    out->fine = session_describe_complete_nodes(of->type, parts * of->order);
    return make_weights(of, parts, is_lobatto, out) && list_nodes_of_all_sides(out) &&
           list_coinciding_nodes(out, parts);
}

void session_drop_interpolation(session_interpolation *interpolation)
{
    base_free(interpolation->positions);
    base_free(interpolation->line);
    base_free(interpolation->triangle);
    base_free(interpolation->whole);
    base_free(interpolation->own);
    for (int n = 0; n < INTERPOLATION_SIDES; n++) {
        base_free(interpolation->sides[n].nodes);
        base_free(interpolation->sides[n].fine_nodes);
    }
    *interpolation = (session_interpolation){0};
}

/* ---- interpolation in one cell ----------------------------------------------------------------------------------- */

/* The state of interpolating the values of one cell. */
typedef struct cell_job {
    const session_interpolation *of;
    int size;        /* number of components */
    double *lattice; /* tuples at the nodes of the complete lattice, in lexicographic order */
    /* two arrays for intermediate results, with space for count_spare_tuples() tuples each */
    double *spare[2];
    double *out;
} cell_job;

/* Returns the largest number of tuples that an intermediate result has: the number of nodes of the finer lattice or, if
 * it is larger, the sum of the numbers of finer nodes on all quads, on all triangles or on all edges. */
static int count_spare_tuples(const session_interpolation *of)
{
    int most = of->fine.count;
    for (int n = 0; n < INTERPOLATION_SIDES; n++) {
        const int count = of->sides[n].count * of->sides[n].fine_count;
        most = count > most ? count : most;
    }
    return most;
}

size_t session_interpolation_work_size(const session_interpolation *of, int components)
{
    return ((size_t)of->complete.count + 2 * (size_t)count_spare_tuples(of)) * (size_t)components;
}

/* Computes one row of the product of a matrix and an array: out[s] is the sum of row[c] * in[c * inner + s] over c, for
 * weights row[c] whose sum is 1. The elements are processed in chunks, whose loops the compiler vectorizes, and the
 * remaining ones one by one; the terms of each sum have the same order in both cases. */
static void apply_row(const double *row, int columns, int inner, const double *restrict in, double *restrict out)
{
    enum { CHUNK = 4 };
    int s = 0;
    for (; s + CHUNK <= inner; s += CHUNK) {
        double sums[CHUNK] = {0};
        for (int c = 1; c < columns; c++)
            for (int n = 0; n < CHUNK; n++) sums[n] += row[c] * (in[c * inner + s + n] - in[s + n]);
        for (int n = 0; n < CHUNK; n++) out[s + n] = sums[n] + in[s + n];
    }
    for (; s < inner; s++) {
        double sum = 0;
        for (int c = 1; c < columns; c++) sum += row[c] * (in[c * inner + s] - in[s]);
        out[s] = sum + in[s];
    }
}

/* Multiplies each of `outer` arrays of columns x inner numbers with a matrix of rows x columns. */
static void multiply_by_matrix(const double *matrix, int rows, int columns, int outer, int inner, const double *in,
                               double *out)
{
    for (int o = 0; o < outer; o++, in += columns * inner)
        for (int r = 0; r < rows; r++, out += inner) apply_row(matrix + r * columns, columns, inner, in, out);
}

static double neighbour_value(const cell_job *job, const int at[3], const int step[3], int component)
{
    const int node[3] = {at[0] + step[0], at[1] + step[1], at[2] + step[2]};
    return job->lattice[find_lexicographic_index(&job->of->complete, node) * job->size + component];
}

/* Returns the sum of a component's values at two nodes: those with the lattice indices `at` + `step` and `at` -
 * `step`. */
static double sum_opposite_neighbour_values(const cell_job *job, const int at[3], const int step[3], int component)
{
    const int back[3] = {-step[0], -step[1], -step[2]};
    return neighbour_value(job, at, step, component) + neighbour_value(job, at, back, component);
}

/* Returns the value of one component at the middle of a face of a serendipity cell. at: lattice indices of the middle.
 * a, b: steps in lattice indices from the middle to two midpoints of edges. The bits of the result do not change if a
 * and b are swapped. */
static double interpolate_face_centre(const cell_job *job, const int at[3], const int a[3], const int b[3],
                                      int component)
{
    const int sum[3] = {a[0] + b[0], a[1] + b[1], a[2] + b[2]}, difference[3] = {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
    return 0.5 * (sum_opposite_neighbour_values(job, at, a, component) +
                  sum_opposite_neighbour_values(job, at, b, component)) -
           0.25 * (sum_opposite_neighbour_values(job, at, sum, component) +
                   sum_opposite_neighbour_values(job, at, difference, component));
}

static double interpolate_hex_centre(const cell_job *job, const int at[3], int component)
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

static void fill_missing_node(const cell_job *job, const int at[3])
{
    int directions[3][3];
    const int count = session_find_missing_node_directions(job->of->of.type, at, directions);
    double *out = job->lattice + find_lexicographic_index(&job->of->complete, at) * job->size;
    for (int c = 0; c < job->size; c++)
        out[c] = count == 3 ? interpolate_hex_centre(job, at, c)
                            : interpolate_face_centre(job, at, directions[0], directions[1], c);
}

void session_fill_complete_cell_tuples(const session_interpolation *of, int components, const double *tuples,
                                       double *out)
{
    const cell_job job = {.of = of, .size = components, .lattice = out};
    for (int n = 0; n < of->complete.count; n++)
        for (int s = 0; s < components && of->positions[n] < of->of.count; s++)
            out[n * components + s] = tuples[of->positions[n] * components + s];
    for (int n = 0; n < 27 && !of->of.is_complete; n++) {
        const int at[3] = {n % 3, n / 3 % 3, n / 9};
        if (session_has_node(&of->of, at[0], at[1], at[2]) &&
            of->positions[find_lexicographic_index(&of->complete, at)] >= of->of.count)
            fill_missing_node(&job, at);
    }
}

/* Computes the tuples at all nodes of the finer lattice from the tuples at the nodes of the cell's complete lattice. */
static void fill_all_fine_nodes(const cell_job *job)
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

/* Computes for each corner the number of corners before it in the lexicographic order of positions. */
static void order_corners_by_position(int count, const double (*corners)[3], int ranks[8])
{
    for (int c = 0; c < count; c++) ranks[c] = 0;
    for (int c = 0; c < count; c++)
        for (int d = 0; d < c; d++) {
            const int order = vector3_compare(corners[c], corners[d]);
            ranks[c] += order > 0;
            ranks[d] += order < 0;
        }
}

/* Chooses one of the orders in which the nodes of a face or an edge can be listed, and returns its number. ranks: for
 * each corner of the cell, the number of corners before it in the lexicographic order of positions. All cells that
 * share the face or edge choose the same order of its nodes. */
static int choose_corner_numbering(const signed char *side, int corner_count, const int ranks[8])
{
    int first = 0;
    for (int n = 1; n < corner_count; n++)
        if (ranks[(int)side[n]] < ranks[(int)side[first]]) first = n;
    if (corner_count == 2) return first;
    const int next = ranks[(int)side[(first + 1) % corner_count]];
    return 2 * first + (ranks[(int)side[(first + corner_count - 1) % corner_count]] < next);
}

/* Computes the tuples at the nodes of the finer lattice on all faces with the same number of corners, or on all edges.
 * The tuples on a face or edge are computed only from those at the cell's nodes on this face or edge. */
static void fill_side_nodes(const cell_job *job, const session_interpolation_sides *sides, const int ranks[8])
{
    const session_interpolation *of = job->of;
    const int c = of->of.order + 1, r = of->fine.order + 1, size = job->size, all = sides->count * size;
    double *a = job->spare[0], *b = job->spare[1];
    int lists[INTERPOLATION_MOST_SIDES];
    for (int side = 0; side < sides->count; side++) {
        lists[side] =
            side * sides->turn_count + choose_corner_numbering(sides->corners[side], sides->corner_count, ranks);
        const int *nodes = sides->nodes + lists[side] * sides->node_count;
        for (int n = 0; n < sides->node_count; n++)
            for (int s = 0; s < size; s++) a[n * all + side * size + s] = job->lattice[nodes[n] * size + s];
    }
    if (sides->corner_count == 3)
        multiply_by_matrix(of->triangle, sides->fine_count, sides->node_count, 1, all, a, b);
    else
        multiply_by_matrix(of->line, r, c, sides->corner_count == 4 ? c : 1, all, a, b);
    if (sides->corner_count == 4) {
        multiply_by_matrix(of->line, r, c, 1, r * all, b, a);
        b = a;
    }
    for (int side = 0; side < sides->count; side++) {
        const int *nodes = sides->fine_nodes + lists[side] * sides->fine_count;
        for (int n = 0; n < sides->fine_count; n++)
            for (int s = 0; s < size; s++) job->out[nodes[n] * size + s] = b[n * all + side * size + s];
    }
}

void session_interpolate(const session_interpolation *of, const double (*corners)[3], int components,
                         const double *tuples, double *work, double *out)
{
    if (of->own_count == of->fine.count) {
        session_fill_complete_cell_tuples(of, components, tuples, out);
        return;
    }
    cell_job job = {.of = of, .size = components, .lattice = work, .out = out};
    int ranks[8];
    job.spare[0] = work + of->complete.count * components;
    job.spare[1] = job.spare[0] + count_spare_tuples(of) * components;
    session_fill_complete_cell_tuples(of, components, tuples, work);
    fill_all_fine_nodes(&job);
    order_corners_by_position(session_get_cell_shape(of->of.type)->corner_count, corners, ranks);
    for (int n = 0; n < INTERPOLATION_SIDES; n++)
        if (of->sides[n].count > 0) fill_side_nodes(&job, &of->sides[n], ranks);
    for (int n = 0; n < of->own_count; n++)
        for (int s = 0; s < components; s++) out[of->own[n][1] * components + s] = work[of->own[n][0] * components + s];
}
