/* Derivatives of the polynomials of cells of higher order at nodes. The nodes of a cell form its lattice, a grid with
 * indices i, j, k along the axes of the reference cell.
 *
 * Along a line of nodes in a hex's lattice, the polynomial interpolates the values at these nodes. In a tet or triangle
 * with equispaced nodes, the function that is 1 at node (i, j, k, l) of order p = i + j + k + l and 0 at the others is
 *
 *     B_i(p a) B_j(p b) B_k(p c) B_l(p d),   B_n(t) = t (t - 1) ... (t - n + 1) / n!
 *
 * at the barycentric coordinates a, b, c, d (Silvester 1969). A wedge's polynomial is the product of a triangle's and a
 * line's.
 *
 * In finer lattices (session_finer.h) the polynomials have a lower order than the lattice, and are determined by fewer
 * nodes: only those whose lattice indices are multiples of `parts`, the number of segments of the finer lattice between
 * two of the cell's own nodes. Therefore the sums have few terms.
 *
 * Serendipity cells lack the nodes in the middle of faces and cells. Their polynomials are those of complete cells of
 * order 2 if the value at a missing node is computed from other nodes. The value at the middle of a face is half the
 * sum of the values at the midpoints of the face's edges, minus a quarter of the sum of the values at its corners. The
 * value at the middle of a hex is a quarter of the sum of the values at the midpoints of all edges, minus a quarter of
 * the sum of the values at all corners. */
#include "session_derivatives.h"

#include <math.h>
#include <string.h>

#include "memory.h"

enum { MOST_NODES_OF_LINE = NODES_MOST_ORDER + 1 };

/* State of finding the terms of derivatives: products of a weight and the value at a node. There are two passes: in the
 * first one out->nodes is NULL, and the terms are only counted; in the second one they are stored. */
typedef struct term_list {
    session_derivatives *out;
    const session_nodes *of;
    insitu_vertex_order order;
    int parts, order_of_polynomial;
    int count;
    /* [i][j]: derivative at node i of the Lagrange polynomial that is 1 at node j * parts of a line */
    double lines[MOST_NODES_OF_LINE][MOST_NODES_OF_LINE];
    /* [n][i]: value and derivative, at t = i / parts, of the polynomial B_n(t) that is defined at the top of this
     * file */
    double values[MOST_NODES_OF_LINE][MOST_NODES_OF_LINE], slopes[MOST_NODES_OF_LINE][MOST_NODES_OF_LINE];
} term_list;

/* ---- derivatives of polynomials of one variable ------------------------------------------------------------------ */

/* Computes the first derivative (result) and the second derivative (*curvature) of the Legendre polynomial of degree p
 * at x. */
static double compute_legendre_slope(int p, double x, double *curvature)
{
    double last = 1, value = x;
    for (int n = 2; n <= p; n++) {
        const double next = ((2 * n - 1) * x * value - (n - 1) * last) / n;
        last = value;
        value = next;
    }
    const double slope = p * (last - x * value) / (1 - x * x);
    *curvature = (2 * x * slope - p * (p + 1) * value) / (1 - x * x);
    return slope;
}

/* Gauss-Lobatto points are the ends of the line and the roots of the derivative of Legendre's polynomial. The roots are
 * found by Newton's method, starting at Chebyshev's points. */
void session_compute_node_positions(int p, bool is_lobatto, double out[MOST_NODES_OF_LINE])
{
    for (int i = 0; i <= p; i++) {
        double x = -cos(acos(-1) * i / p), curvature;
        for (int turn = 0; turn < 20 && i > 0 && i < p; turn++) {
            const double slope = compute_legendre_slope(p, x, &curvature);
            x -= slope / curvature;
        }
        out[i] = is_lobatto ? 0.5 + 0.5 * x : (double)i / p;
    }
}

/* Computes list->lines, the derivatives of the Lagrange polynomials of one variable at the nodes of an edge. */
static void compute_line_derivatives(term_list *list, bool is_lobatto)
{
    const int p = list->order_of_polynomial, parts = list->parts;
    double x[MOST_NODES_OF_LINE] = {0};
    session_compute_node_positions(list->of->order, is_lobatto, x);
    list->out->first_segment = x[1];
    for (int i = 0; i <= list->of->order; i++)
        for (int m = 0; m <= p; m++) {
            double sum = 0, scale = 1;
            for (int skipped = 0; skipped <= p; skipped++) {
                double product = skipped == m ? 0 : 1;
                for (int k = 0; k <= p; k++) product *= k == m || k == skipped ? 1 : x[i] - x[k * parts];
                sum += product;
                scale *= skipped == m ? 1 : x[m * parts] - x[skipped * parts];
            }
            list->lines[i][m] = sum / scale;
        }
}

/* Computes list->values and list->slopes, the values and derivatives of the polynomials B_n (top of this file) at t = i
 * / parts, for all indices i of nodes on an edge. */
static void compute_simplex_derivatives(term_list *list)
{
    for (int n = 0; n <= list->order_of_polynomial; n++)
        for (int i = 0; i <= list->of->order; i++) {
            const double t = (double)i / list->parts;
            double value = 1, slope = 0;
            for (int m = 0; m < n; m++) {
                slope = (slope * (t - m) + value) / (m + 1);
                value *= (t - m) / (m + 1);
            }
            list->values[n][i] = value;
            list->slopes[n][i] = slope;
        }
}

/* ---- terms of derivatives -------------------------------------------------------------------------------------- */

int session_find_missing_node_directions(int type, const int at[3], int directions[3][3])
{
    int count = 0;
    memset(directions, 0, 9 * sizeof directions[0][0]);
    if (type == GRID_WEDGE) {
        directions[0][0] = at[0];
        directions[0][1] = at[0] && at[1] ? -1 : at[1];
        directions[1][2] = 1;
        return 2;
    }
    for (int axis = 0; axis < 3; axis++)
        if (at[axis] == 1) directions[count++][axis] = 1;
    return count;
}

static void store_term(term_list *list, int position, double weight)
{
    if (list->out->nodes) {
        list->out->nodes[list->count] = position;
        list->out->weights[list->count] = weight;
    }
    list->count++;
}

/* Adds the terms of a node that a serendipity cell lacks. The value there is a weighted sum of values at other nodes
 * (see the top of this file), so that one term is added for each of these nodes. at: lattice indices of the missing
 * node. weight: the weight of its value in the derivative. */
static void add_terms_of_missing_node(term_list *list, const int at[3], double weight)
{
    int directions[3][3], step[3];
    const int count = session_find_missing_node_directions(list->of->type, at, directions);
    for (int n = 0; n < (count == 3 ? 27 : 9); n++) {
        int zeros = 0, node[3] = {at[0], at[1], at[2]};
        for (int d = 0, rest = n; d < count; d++, rest /= 3) {
            step[d] = rest % 3 - 1;
            zeros += step[d] == 0;
            for (int axis = 0; axis < 3; axis++) node[axis] += step[d] * directions[d][axis];
        }
        const double share = zeros == 0 ? -0.25 : count == 3 ? 0.25 : 0.5;
        if (zeros < 2)
            store_term(list, session_find_node_in_connectivity(list->of, list->order, node[0], node[1], node[2]),
                       share * weight);
    }
}

static void add_term(term_list *list, int i, int j, int k, double weight)
{
    const int position = session_find_node_in_connectivity(list->of, list->order, i, j, k);
    if (weight == 0) return;
    if (position < list->of->count)
        store_term(list, position, weight);
    else
        add_terms_of_missing_node(list, (const int[]){i, j, k}, weight);
}

/* Adds the terms of the derivative along an axis of the lattice at the node with the lattice indices `at`. There is one
 * term for each node that determines the polynomial on the line through this node along the axis. */
static void add_derivative_along_line(term_list *list, const int at[3], int axis)
{
    int node[3] = {at[0], at[1], at[2]};
    for (int m = 0; m <= list->order_of_polynomial; m++) {
        node[axis] = m * list->parts;
        add_term(list, node[0], node[1], node[2], list->lines[at[axis]][m]);
    }
}

/* Adds the terms of the derivative with respect to a barycentric coordinate of a tet or, in layer k of a wedge, of a
 * triangle; the weights are multiplied by `sign`. b: the barycentric coordinates of the node times the order; b[2] is 0
 * in triangles. */
static void add_barycentric_derivative(term_list *list, const int b[4], int coordinate, int k, double sign)
{
    const int p = list->order_of_polynomial, parts = list->parts;
    int n[4], most[4]; /* most[m] is the largest n[m] for which B_n is not 0 */
    for (int m = 0; m < 4; m++) most[m] = m != coordinate && b[m] % parts == 0 ? b[m] / parts : p;
    if (list->of->type != GRID_TET) most[2] = 0;
    for (n[2] = 0; n[2] <= most[2]; n[2]++)
        for (n[1] = 0; n[1] <= most[1] && n[1] <= p - n[2]; n[1]++)
            for (n[0] = 0; n[0] <= most[0] && n[0] <= p - n[2] - n[1]; n[0]++) {
                double weight = sign * p;
                n[3] = p - n[0] - n[1] - n[2];
                for (int m = 0; m < 4; m++)
                    weight *= m == coordinate ? list->slopes[n[m]][b[m]] : list->values[n[m]][b[m]];
                if (n[3] <= most[3])
                    add_term(list, n[0] * parts, n[1] * parts, list->of->type == GRID_TET ? n[2] * parts : k, weight);
            }
}

/* Adds the terms of the derivative along an axis of the reference cell at the node with the lattice indices `at`. */
static void add_derivative(term_list *list, const int at[3], int axis)
{
    const int p = list->of->order, type = list->of->type;
    const bool is_box = type == GRID_HEX || type == GRID_QUAD;
    if (is_box || (type == GRID_WEDGE && axis == 2)) {
        add_derivative_along_line(list, at, axis);
        return;
    }
    const int depth = type == GRID_TET ? at[2] : 0, b[4] = {at[0], at[1], depth, p - at[0] - at[1] - depth};
    add_barycentric_derivative(list, b, axis, at[2], 1);
    add_barycentric_derivative(list, b, 3, at[2], -1);
}

/* ---- derivatives of cells of one type and number of nodes -------------------------------------------------------- */

/* Lists the terms of the derivatives at all nodes. nodes_at: lattice indices of each node, in the order in which the
 * cell's nodes are listed in the connectivity. */
static void list_terms(term_list *list, const int (*nodes_at)[3])
{
    session_derivatives *out = list->out;
    list->count = 0;
    for (int n = 0; n < list->of->count; n++)
        for (int axis = 0; axis < out->axis_count; axis++) {
            out->starts[out->axis_count * n + axis] = list->count;
            add_derivative(list, nodes_at[n], axis);
        }
    out->starts[out->axis_count * list->of->count] = list->count;
}

static void list_lattice_indices_of_nodes(const session_nodes *of, insitu_vertex_order order, int (*nodes_at)[3])
{
    for (int k = 0; k <= of->order; k++)
        for (int j = 0; j <= of->order; j++)
            for (int i = 0; i <= of->order; i++) {
                const int n =
                    session_has_node(of, i, j, k) ? session_find_node_in_connectivity(of, order, i, j, k) : of->count;
                if (n < of->count) memcpy(nodes_at[n], (const int[]){i, j, k}, sizeof nodes_at[n]);
            }
}

bool session_make_derivatives(const session_nodes *of, insitu_vertex_order order, bool is_lobatto, int parts,
                              session_derivatives *out)
{
    *out = (session_derivatives){0};
    if (of->type == GRID_PYRAMID) return true;
    out->axis_count = of->type == GRID_TRIANGLE || of->type == GRID_QUAD ? 2 : 3;
    out->starts = base_alloc(((size_t)of->count * 3 + 1) * sizeof *out->starts);
    int(*nodes_at)[3] = base_alloc((size_t)of->count * sizeof *nodes_at);
    term_list *list = base_calloc(1, sizeof *list);
    bool is_made = out->starts && nodes_at && list;
    if (is_made) {
        *list =
            (term_list){.out = out, .of = of, .order = order, .parts = parts, .order_of_polynomial = of->order / parts};
        list_lattice_indices_of_nodes(of, order, nodes_at);
        compute_line_derivatives(list, is_lobatto);
        compute_simplex_derivatives(list);
        list_terms(list, (const int(*)[3])nodes_at);
        out->weights = base_alloc((size_t)list->count * sizeof *out->weights);
        out->nodes = base_alloc((size_t)list->count * sizeof *out->nodes);
        is_made = out->weights && out->nodes;
        if (is_made) list_terms(list, (const int(*)[3])nodes_at);
    }
    base_free(nodes_at);
    base_free(list);
    return is_made;
}

void session_drop_derivatives(session_derivatives *derivatives)
{
    base_free(derivatives->starts);
    base_free(derivatives->nodes);
    base_free(derivatives->weights);
    *derivatives = (session_derivatives){0};
}

/* ---- derivatives of all cells of a mesh -------------------------------------------------------------------------- */

bool session_may_have_lobatto_nodes(const session_nodes *of)
{
    return of->order > 2 && (of->type == GRID_HEX || of->type == GRID_QUAD);
}

/* Finds the derivatives of the cells' polynomials at the nodes of finer lattices. */
static bool derive_finer_polynomials(const session_mesh *mesh, session_polynomials *out)
{
    bool is_made = true;
    for (int i = 0; i < out->nodal.kind_count && is_made; i++) {
        const session_nodes *of = &out->nodal.kinds[i].nodes;
        for (int n = 0; n < 2 && is_made; n++) {
            const int parts = n ? 1 : mesh->finer.parts;
            const session_nodes fine = session_describe_complete_nodes(of->type, parts * of->order);
            if (n == 0) out->refined_counts[i] = fine.count;
            is_made = session_make_derivatives(&fine, out->order, false, parts, &out->kinds[2 * i + n]);
        }
    }
    return is_made;
}

bool session_polynomials_create(const session_mesh *mesh, session_polynomials *out)
{
    *out = (session_polynomials){.rows = session_describe_rows(mesh),
                                 .first_pieces = mesh->topology.first_pieces,
                                 .cell_count = mesh->given.cell_count,
                                 .order = mesh->given.vertex_order};
    session_list_cell_kinds(&out->rows);
    if (mesh->finer.parts) {
        out->nodal = session_describe_caller_rows(&mesh->finer.nodal);
        session_list_cell_kinds(&out->nodal);
    }
    out->kinds = base_calloc((size_t)ROWS_MOST_KINDS * 2, sizeof *out->kinds);
    bool is_made = out->kinds != NULL;
    if (mesh->finer.parts) return is_made && derive_finer_polynomials(mesh, out);
    for (int i = 0; i < out->rows.kind_count && is_made; i++) {
        const session_nodes *of = &out->rows.kinds[i].nodes;
        is_made = session_make_derivatives(of, out->order, false, 1, &out->kinds[2 * i]);
        if (is_made && session_may_have_lobatto_nodes(of))
            is_made = session_make_derivatives(of, out->order, true, 1, &out->kinds[2 * i + 1]);
    }
    return is_made;
}

void session_polynomials_free(session_polynomials *polynomials)
{
    for (int i = 0; i < 2 * ROWS_MOST_KINDS && polynomials->kinds; i++)
        session_drop_derivatives(&polynomials->kinds[i]);
    base_free(polynomials->kinds);
    *polynomials = (session_polynomials){0};
}

static double distance_between(const double *a, const double *b)
{
    return sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) + (a[2] - b[2]) * (a[2] - b[2]));
}

/* Returns the mean length of the first and the last of the segments into which the nodes divide each edge of the cell,
 * as a fraction of the mean length of the edges. */
static double compute_mean_end_segment_length(const session_nodes *of, insitu_vertex_order order,
                                              const double *positions, int stride)
{
    const int p = of->order, axes = of->type == GRID_HEX ? 3 : 2;
    double ends = 0, total = 0;
    for (int axis = 0; axis < axes; axis++)
        for (int edge = 0; edge < (axes == 3 ? 4 : 2); edge++) {
            int node[3] = {0, 0, 0}, last = 0;
            node[(axis + 1) % axes] = edge % 2 ? p : 0;
            if (axes == 3) node[(axis + 2) % 3] = edge / 2 ? p : 0;
            for (int m = 0; m <= p; m++) {
                node[axis] = m;
                const int next = session_find_node_in_connectivity(of, order, node[0], node[1], node[2]);
                const double length = distance_between(positions + stride * next, positions + stride * last);
                if (m > 0) total += length;
                if (m == 1 || m == p) ends += 0.5 * length;
                last = next;
            }
        }
    return ends / total;
}

const session_derivatives *session_find_derivatives_of_cell(const session_polynomials *polynomials, int64_t cell,
                                                            const double *positions, int stride)
{
    if (polynomials->nodal.kind_count) {
        const int nodal = session_find_kind_of_cell(&polynomials->nodal, cell);
        const bool is_refined =
            session_count_nodes_of_cell(&polynomials->rows, cell) == polynomials->refined_counts[nodal];
        return &polynomials->kinds[2 * nodal + !is_refined];
    }
    const int kind = session_find_kind_of_cell(&polynomials->rows, cell);
    const session_nodes *of = &polynomials->rows.kinds[kind].nodes;
    const session_derivatives *equispaced = &polynomials->kinds[2 * kind], *lobatto = equispaced + 1;
    if (!session_may_have_lobatto_nodes(of)) return equispaced;
    const double between = 0.5 * (equispaced->first_segment + lobatto->first_segment);
    return compute_mean_end_segment_length(of, polynomials->order, positions, stride) < between ? lobatto : equispaced;
}
