/* Computes bounds of the difference between the polynomials in cells of higher order and their linear interpolation in
 * the smaller cells (pieces) into which these cells are cut.
 *
 * A reference cell is a product of simplices: a hex of three lines, a wedge of a triangle and a line; a tet is a single
 * simplex. In each simplex, polynomials of order p are written in Bernstein form. The second derivative along an edge
 * of the simplex is then a weighted mean of p (p - 1) times the second differences of the coefficients along that edge.
 * Therefore its absolute value is at most M, the largest absolute value of p (p - 1) times a second difference.
 *
 * A piece is a simplex whose edges are 1 / m of those of the cell. Let u be the difference between the polynomial and
 * its linear interpolation in a piece, l_i the barycentric coordinates in the piece, and e_ij the edge of the cell that
 * is parallel to the piece's edge from corner i to corner j. Let B_ij be a number that is at least minus the second
 * derivative of u along e_ij. Let q be half the sum of B_ij l_i l_j / m^2 over all pairs of corners. Then q - u has
 * second derivatives of at most 0 along all edges, and is 0 at the corners. So it is not negative on the edges. It is
 * then not negative on the faces either, because a line that is parallel to an edge crosses a face from one of its
 * edges to another one. For the same reason it is not negative inside. So u is at most the largest value of q. The same
 * holds for -u with B_ij of the opposite sign. If all B_ij are M, the largest value of q is K M / m^2, with K = 1/8 on
 * a line, 1/6 in a triangle and 3/16 in a tet. For polynomials of order 2 the bounds are exact.
 *
 * A tet is cut into smaller tets and octahedra, and each octahedron into tets along a diagonal. So the pieces of a tet
 * have five shapes, whose edges have seven directions.
 *
 * In a product of simplices, linear interpolation along one factor does not increase the differences along the others.
 * Therefore the bounds of all factors are added up.
 *
 * The isosurface of the pieces is at x_m(a) with f_m(a) = v. Here a is a point of the reference cell, v the isovalue,
 * x_m and f_m the interpolated position and field, and x and f their polynomials. x(a) differs from x_m(a) by at most
 * the positions' bound. f(a) differs from v by at most the field's bound. So the distance from x(a) to the isosurface
 * of f is at most the field's bound divided by the length of the gradient. A lower bound of this length is computed for
 * each piece that may be crossed, from the gradients at its corners: it is the least component of these gradients along
 * their mean, because no weighted mean of these gradients is shorter. The difference between the gradient in a piece
 * and such a mean depends on third derivatives and the square of the size of pieces, and is neglected. */
#include "session_bound.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "memory.h"
#include "session_derivatives.h"
#include "session_matrix.h"
#include "session_shape.h"
#include "vector3.h"

enum {
    SIZE = 4,            /* number of doubles of a tuple: x, y, z and the field's value */
    COARSE = 4,          /* minimum order of the first, coarsest lattice */
    FINE = 16,           /* maximum order of all further lattices */
    MOST_DIRECTIONS = 7, /* number of directions of the edges of pieces in one simplex */
    TET_SHAPES = 5       /* number of different shapes of the small tets into which a tet is cut */
};

/* For each number of dimensions of a simplex, the number of directions that edges of its pieces have. */
static const int direction_counts[] = {0, 1, 3, MOST_DIRECTIONS};

/* ---- polynomials on one simplex ---------------------------------------------------------------------------------- */

/* Lists the nodes of the regular lattice of this order on a simplex, and returns the number of nodes. out: the
 * barycentric coordinates of each node times the order; NULL: nodes are only counted. */
static int list_simplex_nodes(int dimensions, int order, int (*out)[4])
{
    int count = 0;
    for (int k = 0; k <= (dimensions > 2 ? order : 0); k++)
        for (int j = 0; j <= (dimensions > 1 ? order - k : 0); j++)
            for (int i = 0; i <= order - j - k; i++, count++)
                if (out) memcpy(out[count], (const int[]){order - i - j - k, i, j, k}, sizeof out[count]);
    return count;
}

/* Lists of nodes of a simplex, in the form of list_simplex_nodes(). */
typedef struct node_lists {
    int dimensions, order, count;
    int fine_order, fine_count; /* order of the finer lattice, and number of nodes that it has */
    bool is_lobatto;            /* set if the nodes of a line are Gauss-Lobatto points */
    /* nodes of the cell, of the finer lattice, and of the lattice whose order is lower by 2 */
    int (*nodes)[4], (*fine)[4], (*lower)[4];
} node_lists;

/* Returns the index of a node in the list that list_simplex_nodes() makes. node: barycentric coordinates of the node
 * times the order. */
static int find_simplex_node_index(int dimensions, int order, const int node[4])
{
    int at = node[1];
    for (int j = 0; j < node[2]; j++) at += order - node[3] - j + 1;
    for (int k = 0; k < node[3]; k++) at += list_simplex_nodes(dimensions - 1, order - k, NULL);
    return at;
}

/* Returns the value, at the barycentric coordinates `at`, of the Bernstein polynomial with these exponents; 0 if an
 * exponent is negative. */
static double evaluate_bernstein_polynomial(const int exponents[4], const double at[4])
{
    double value = 1;
    int factor = 0;
    for (int c = 0; c < 4; c++) {
        if (exponents[c] < 0) return 0;
        for (int m = 1; m <= exponents[c]; m++) value *= at[c] * ++factor / m;
    }
    return value;
}

/* Returns the derivative of the Bernstein polynomial with these exponents along the edge from corner 0 to corner axis +
 * 1, at the barycentric coordinates `at`. */
static double differentiate_bernstein_polynomial(int order, const int exponents[4], int axis, const double at[4])
{
    int raised[4], lowered[4];
    memcpy(raised, exponents, sizeof raised);
    memcpy(lowered, exponents, sizeof lowered);
    raised[axis + 1]--;
    lowered[0]--;
    return order * (evaluate_bernstein_polynomial(raised, at) - evaluate_bernstein_polynomial(lowered, at));
}

/* Computes the values of all Bernstein polynomials (if axis is negative) or their derivatives along an axis, at the
 * nodes of the cell's lattice or, if is_fine is set, of the finer lattice. `out` has one row per node and one column
 * per polynomial. */
static void evaluate_bernstein_basis(const node_lists *lists, int axis, bool is_fine, double *out)
{
    const int rows = is_fine ? lists->fine_count : lists->count, order = is_fine ? lists->fine_order : lists->order;
    double line[NODES_MOST_ORDER + 1];
    session_compute_node_positions(lists->order, lists->is_lobatto, line);
    for (int r = 0; r < rows; r++) {
        const int *node = is_fine ? lists->fine[r] : lists->nodes[r];
        double at[4];
        for (int c = 0; c < 4; c++) at[c] = (double)node[c] / order;
        if (lists->dimensions == 1 && !is_fine) at[1] = line[node[1]];
        if (lists->dimensions == 1 && !is_fine) at[0] = 1 - at[1];
        for (int n = 0; n < lists->count; n++)
            *out++ = axis < 0 ? evaluate_bernstein_polynomial(lists->nodes[n], at)
                              : differentiate_bernstein_polynomial(lists->order, lists->nodes[n], axis, at);
    }
}

/* Adds a second difference of Bernstein coefficients to out->differences. direction: direction of the difference, in
 * barycentric coordinates; number: its index in list_second_differences(). lower: index in lists->lower of the node at
 * which the difference is taken. */
static void add_second_difference(const node_lists *lists, int lower, int number, const int direction[4],
                                  session_bound_factor *out)
{
    session_second_difference *difference = &out->differences[out->difference_count++];
    *difference = (session_second_difference){.direction = number};
    for (int a = 0; a < 4; a++)
        for (int b = a; b < 4; b++) {
            int node[4];
            memcpy(node, lists->lower[lower], sizeof node);
            node[a]++;
            node[b]++;
            if (direction[a] * direction[b] == 0) continue;
            difference->nodes[difference->count] = find_simplex_node_index(lists->dimensions, lists->order, node);
            difference->weights[difference->count++] = (a == b ? 1 : 2) * direction[a] * direction[b];
        }
}

/* Lists the second differences of Bernstein coefficients along the directions of all edges of pieces. In a tet the last
 * direction is that of the diagonals along which octahedra are cut (session_pattern.c). */
static void list_second_differences(const node_lists *lists, session_bound_factor *out)
{
    static const int directions[MOST_DIRECTIONS][4] = {{-1, 1, 0, 0}, {-1, 0, 1, 0}, {0, -1, 1, 0}, {-1, 0, 0, 1},
                                                       {0, -1, 0, 1}, {0, 0, -1, 1}, {-1, -1, 1, 1}};
    const int count = list_simplex_nodes(lists->dimensions, lists->order - 2, lists->lower);
    for (int n = 0; n < count; n++)
        for (int d = 0; d < direction_counts[lists->dimensions]; d++)
            add_second_difference(lists, n, d, directions[d], out);
}

static double *make_matrix(int rows, int columns)
{
    return base_calloc((size_t)rows * (size_t)columns, sizeof(double));
}

/* Multiplies a matrix whose columns belong to Bernstein coefficients by of->bernstein, so that its columns belong to
 * values at the cell's nodes. spare: working memory of the matrix's size. */
static void convert_bernstein_columns_to_nodal(const session_bound_factor *of, int level, double *matrix, double *spare)
{
    const int rows = of->fine_counts[level], columns = of->node_count;
    for (int r = 0; r < rows; r++)
        for (int c = 0; c < columns; c++) {
            double sum = 0;
            for (int m = 0; m < columns; m++) sum += matrix[r * columns + m] * of->bernstein[m * columns + c];
            spare[r * columns + c] = sum;
        }
    memcpy(matrix, spare, (size_t)rows * (size_t)columns * sizeof *matrix);
}

/* Computes the matrices from values at the cell's nodes to values and derivatives at the nodes of one level's
 * lattice. */
static bool make_finer_lattice_matrices(node_lists *lists, int level, int order, session_bound_factor *out)
{
    const int dimensions = lists->dimensions, count = lists->count;
    lists->fine_order = order;
    lists->fine_count = out->fine_counts[level] = list_simplex_nodes(dimensions, order, NULL);
    lists->fine = base_alloc((size_t)lists->fine_count * sizeof *lists->fine);
    double *spare = make_matrix(lists->fine_count, count);
    bool is_made = lists->fine && spare;
    if (is_made) list_simplex_nodes(dimensions, order, lists->fine);
    for (int a = -1; a < dimensions && is_made; a++) {
        double *matrix = make_matrix(lists->fine_count, count);
        if (a < 0)
            out->values[level] = matrix;
        else
            out->slopes[level][a] = matrix;
        is_made = matrix;
        if (is_made) evaluate_bernstein_basis(lists, a, true, matrix);
        if (is_made) convert_bernstein_columns_to_nodal(out, level, matrix, spare);
    }
    base_free(spare);
    base_free(lists->fine);
    return is_made;
}

/* Computes out->bernstein, the matrix from values at the cell's nodes to Bernstein coefficients, and lists the second
 * differences of these coefficients. */
static bool make_bernstein_matrix(const node_lists *lists, session_bound_factor *out)
{
    const int count = lists->count;
    double *spare = make_matrix(count, count);
    out->bernstein = make_matrix(count, count);
    out->differences = base_alloc((size_t)count * MOST_DIRECTIONS * sizeof *out->differences);
    const bool is_made = spare && out->bernstein && out->differences;
    if (is_made) {
        evaluate_bernstein_basis(lists, -1, false, spare);
        for (int n = 0; n < count; n++) out->bernstein[n * count + n] = 1;
        session_invert_matrix(count, spare, out->bernstein);
        list_second_differences(lists, out);
    }
    base_free(spare);
    return is_made;
}

static bool make_simplex_matrices(const session_bound *of, int dimensions, bool is_lobatto, session_bound_factor *out)
{
    const int order = of->nodes.of.order;
    node_lists lists = {.dimensions = dimensions,
                        .order = order,
                        .is_lobatto = is_lobatto,
                        .count = list_simplex_nodes(dimensions, order, NULL)};
    out->dimensions = dimensions;
    out->node_count = lists.count;
    lists.nodes = base_alloc((size_t)lists.count * sizeof *lists.nodes);
    lists.lower = base_alloc((size_t)lists.count * sizeof *lists.lower);
    bool is_made = lists.nodes && lists.lower;
    if (is_made) list_simplex_nodes(dimensions, order, lists.nodes);
    is_made = is_made && make_bernstein_matrix(&lists, out);
    for (int level = 0; level < of->level_count && is_made; level++)
        is_made = make_finer_lattice_matrices(&lists, level, of->levels[level].order, out);
    base_free(lists.nodes);
    base_free(lists.lower);
    return is_made;
}

static void drop_factor(session_bound_factor *factor)
{
    base_free(factor->bernstein);
    base_free(factor->differences);
    for (int level = 0; level < BOUND_MOST_LEVELS; level++) {
        base_free(factor->values[level]);
        for (int a = 0; a < 3; a++) base_free(factor->slopes[level][a]);
    }
    *factor = (session_bound_factor){0};
}

/* ---- reference cells as products of simplices -------------------------------------------------------------------- */

static int count_factors(int type)
{
    return type == GRID_HEX ? 3 : type == GRID_QUAD || type == GRID_WEDGE ? 2 : 1;
}

/* Returns a factor of the reference cell: the simplex with this index in the Cartesian product of simplices that the
 * reference cell is. A triangle or tet has the index 0; all other factors are lines. */
static const session_bound_factor *get_simplex_factor(const session_bound *of, int factor)
{
    return factor == 0 && of->simplex.dimensions ? &of->simplex : &of->line;
}

/* Lists the finer lattices and the linear pieces between their nodes. The orders of these lattices are multiples of the
 * cell's order. */
static bool list_finer_lattices(session_bound *out)
{
    const int type = out->lattice.type, p = out->lattice.order;
    bool is_made = true;
    for (int order = p < COARSE ? (COARSE + p - 1) / p * p : p; is_made; order *= 2) {
        if (out->level_count == BOUND_MOST_LEVELS || (out->level_count > 0 && order > FINE)) break;
        const session_nodes fine = session_describe_complete_nodes(type, order);
        session_bound_level *level = &out->levels[out->level_count++];
        level->order = order;
        level->count = fine.count;
        is_made =
            session_make_split_pattern(session_lagrange_type(type), &fine, INSITU_ORDER_LEXICOGRAPHIC, &level->pieces);
    }
    return is_made;
}

bool session_make_bound(const session_nodes *of, insitu_vertex_order order, bool is_lobatto, session_bound *out)
{
    const bool is_pyramid = of->type == GRID_PYRAMID;
    const int type = is_pyramid ? GRID_HEX : of->type, is_box = type == GRID_HEX || type == GRID_QUAD;
    *out = (session_bound){.axis_count = type == GRID_QUAD || type == GRID_TRIANGLE ? 2 : 3,
                           .lattice = session_describe_complete_nodes(type, of->order)};
    bool is_made = session_map_nodes_to_connectivity(of, order, &out->nodes) && list_finer_lattices(out);
    if (is_pyramid && is_made) out->collapse = session_compute_collapse_matrix(of->order);
    is_made = is_made && (out->collapse || !is_pyramid);
    is_lobatto = is_lobatto && !is_pyramid;
    if (is_box || type == GRID_WEDGE)
        is_made = is_made && make_simplex_matrices(out, 1, is_lobatto && is_box, &out->line);
    if (!is_box) is_made = is_made && make_simplex_matrices(out, type == GRID_TET ? 3 : 2, false, &out->simplex);
    return is_made;
}

void session_drop_bound(session_bound *bound)
{
    session_drop_interpolation(&bound->nodes);
    base_free(bound->collapse);
    bound->collapse = NULL;
    for (int level = 0; level < bound->level_count; level++) session_drop_split_pattern(&bound->levels[level].pieces);
    drop_factor(&bound->line);
    drop_factor(&bound->simplex);
}

/* ---- error bounds of one cell ------------------------------------------------------------------------------------ */

/* The input and intermediate results of computing the bounds of one cell. */
typedef struct bound_job {
    const session_bound *of;
    const session_isovalues *isovalues;
    int level;
    /* nodes: tuples (x, y, z and value) at all nodes of a complete cell of the cell's order; coefficients: Bernstein
     * coefficients of these tuples */
    double *nodes, *coefficients;
    /* fine: tuples at the nodes of the finer lattice that is used; slopes: derivatives of these tuples along each axis
     * of the reference cell */
    double *fine, *slopes[3];
    /* gradient of the field at each node of the finer lattice; not finite at nodes where the cell is flat */
    double (*gradients)[3];
    double *work; /* working memory of apply_matrix_along_each_factor() */
    /* bounds of the difference between the polynomials and their linear interpolation if the whole cell is one piece:
     * of the difference's length for positions, and of its absolute value for the field */
    double position_bound, value_bound;
} bound_job;

size_t session_bound_work_size(const session_bound *of)
{
    const size_t nodes = (size_t)of->lattice.count, fine = (size_t)of->levels[of->level_count - 1].count;
    return SIZE * (2 * nodes + 6 * fine) + 3 * fine;
}

/* Assigns sections of the working memory `work` to the arrays of the job. */
static void assign_work_arrays(bound_job *job, double *work)
{
    const size_t nodes = SIZE * (size_t)job->of->lattice.count, fine = SIZE * (size_t)job->of->levels[job->level].count;
    job->nodes = work;
    job->coefficients = work += nodes;
    job->fine = work += nodes;
    for (int a = 0; a < 3; a++) job->slopes[a] = work += fine;
    work += fine;
    job->gradients = (double(*)[3])work;
    job->work = work + 3 * job->of->levels[job->level].count;
}

/* Applies matrices[f] along each factor f to an array of tuples of `size` doubles. The factors are the simplices whose
 * Cartesian product the reference cell is. in: one tuple for each node of the cell. out: one tuple for each node of the
 * finer lattice if is_fine is set; otherwise as many tuples as the cell has nodes. */
static void apply_matrix_along_each_factor(const bound_job *job, int size, const double *const matrices[3],
                                           bool is_fine, const double *in, double *out)
{
    const int count = count_factors(job->of->lattice.type);
    int inner = size, outer = 1;
    for (int f = 0; f < count; f++) outer *= get_simplex_factor(job->of, f)->node_count;
    for (int f = 0; f < count; f++) {
        const session_bound_factor *factor = get_simplex_factor(job->of, f);
        const int rows = is_fine ? factor->fine_counts[job->level] : factor->node_count;
        double *to = f == count - 1 ? out : job->work + f % 2 * SIZE * job->of->levels[job->level].count;
        outer /= factor->node_count;
        session_multiply_matrix(matrices[f], rows, factor->node_count, outer, inner, in, to);
        inner *= rows;
        in = to;
    }
}

/* Returns the maximum over a triangle of q, half the sum of B_ij l_i l_j over the pairs of corners, where l_i are
 * barycentric coordinates and a, b and c are the three B_ij. Returns 0 if the maximum is not inside the triangle. */
static double maximize_quadratic_in_triangle(double a, double b, double c)
{
    const double x = a * (b + c - a), y = b * (c + a - b), z = c * (a + b - c);
    return a > 0 && b > 0 && c > 0 && x >= 0 && y >= 0 && z >= 0 ? 0.5 * a * b * c / (x + y + z) : 0;
}

/* Returns the maximum over a tet of q, half the sum of B_ij l_i l_j over the pairs of corners, where l_i are
 * barycentric coordinates. Returns 0 if the maximum is not inside the tet. b: B_ij for the pairs of corners 01, 02, 03,
 * 12, 13 and 23. */
static double maximize_quadratic_in_tet(const double b[6])
{
    double matrix[16] = {0, b[0], b[1], b[2], b[0], 0, b[3], b[4], b[1], b[3], 0, b[5], b[2], b[4], b[5], 0};
    double inverse[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}, sum = 0;
    bool is_inside = true;
    session_invert_matrix(4, matrix, inverse);
    for (int c = 0; c < 4; c++) {
        const double at = inverse[4 * c] + inverse[4 * c + 1] + inverse[4 * c + 2] + inverse[4 * c + 3];
        is_inside = is_inside && at >= 0;
        sum += at;
    }
    return is_inside && sum > 0 ? 0.25 / sum : 0;
}

/* Returns the maximum over a tet, including its faces and edges, of q, half the sum of B_ij l_i l_j over the pairs of
 * corners, where l_i are barycentric coordinates. b: B_ij in the order of maximize_quadratic_in_tet(). */
static double maximize_quadratic_in_closed_tet(const double b[6])
{
    static const int faces[4][3] = {{0, 1, 3}, {0, 2, 4}, {1, 2, 5}, {3, 4, 5}};
    double most = 0, least = INFINITY, out = 0;
    for (int i = 0; i < 6; i++) {
        most = fmax(most, b[i]);
        least = fmin(least, b[i]);
    }
    out = most / 8;
    for (int f = 0; f < 4; f++)
        out = fmax(out, maximize_quadratic_in_triangle(b[faces[f][0]], b[faces[f][1]], b[faces[f][2]]));
    return least > 0 ? fmax(out, maximize_quadratic_in_tet(b)) : out;
}

/* Returns a bound of u, a polynomial on a simplex minus its linear interpolation, for all shapes that pieces of the
 * simplex have. The edges of pieces are as long as those of the simplex (m = 1 at the top of the file). b: for each
 * direction of edges, in the order of list_second_differences(), an upper bound of minus the second derivative of u. */
static double bound_error_on_simplex(int dimensions, const double b[MOST_DIRECTIONS])
{
    static const signed char tets[TET_SHAPES][6] = {
        {0, 1, 3, 2, 4, 5}, {1, 2, 6, 0, 4, 3}, {3, 1, 6, 5, 2, 4}, {4, 3, 6, 0, 1, 2}, {2, 4, 6, 5, 3, 1}};
    double out = 0;
    if (dimensions == 1) return fmax(0, b[0] / 8);
    if (dimensions == 2)
        return fmax(fmax(fmax(0, b[0]), fmax(b[1], b[2])) / 8, maximize_quadratic_in_triangle(b[0], b[1], b[2]));
    for (int shape = 0; shape < TET_SHAPES; shape++) {
        double of[6];
        for (int i = 0; i < 6; i++) of[i] = b[(int)tets[shape][i]];
        out = fmax(out, maximize_quadratic_in_closed_tet(of));
    }
    return out;
}

/* Upper bounds of u (`above`) and of -u (`below`) for each element of a tuple (x, y, z, value). u is the polynomial
 * minus its linear interpolation if the whole cell is one piece. */
typedef struct bound_sums {
    double above[SIZE], below[SIZE];
} bound_sums;

/* Adds the bounds of u and of -u for one factor of the reference cell to *sums, where u is the polynomial minus its
 * linear interpolation along this factor only. inner: number of doubles from one coefficient of the factor to the
 * next. */
static void add_error_bounds_of_factor(const bound_job *job, const session_bound_factor *factor, int inner,
                                       bound_sums *sums)
{
    const int p = job->of->nodes.of.order, all = SIZE * job->of->lattice.count;
    double above[SIZE][MOST_DIRECTIONS], below[SIZE][MOST_DIRECTIONS];
    for (int c = 0; c < SIZE; c++)
        for (int d = 0; d < MOST_DIRECTIONS; d++) above[c][d] = below[c][d] = -INFINITY;
    for (int outer = 0; outer < all; outer += inner * factor->node_count)
        for (int d = 0; d < factor->difference_count; d++) {
            const session_second_difference *difference = &factor->differences[d];
            const int direction = difference->direction;
            for (int s = 0; s < inner; s++) {
                double sum = 0;
                for (int t = 0; t < difference->count; t++)
                    sum += difference->weights[t] * job->coefficients[outer + difference->nodes[t] * inner + s];
                above[s % SIZE][direction] = fmax(above[s % SIZE][direction], -sum);
                below[s % SIZE][direction] = fmax(below[s % SIZE][direction], sum);
            }
        }
    for (int c = 0; c < SIZE; c++) {
        sums->above[c] += p * (p - 1) * bound_error_on_simplex(factor->dimensions, above[c]);
        sums->below[c] += p * (p - 1) * bound_error_on_simplex(factor->dimensions, below[c]);
    }
}

/* Computes the Bernstein coefficients of tuples of `size` doubles from the tuples at the cell's nodes. Tuples at nodes
 * that a serendipity cell lacks are computed first. */
static void compute_bernstein_coefficients(const bound_job *job, int size, const double *tuples)
{
    const double *matrices[3];
    for (int f = 0; f < count_factors(job->of->lattice.type); f++)
        matrices[f] = get_simplex_factor(job->of, f)->bernstein;
    session_fill_complete_cell_tuples(&job->of->nodes, size, tuples, job->nodes);
    if (job->of->collapse) {
        session_multiply_matrix(job->of->collapse, job->of->lattice.count, job->of->nodes.complete.count, 1, size,
                                job->nodes, job->work);
        memcpy(job->nodes, job->work, (size_t)(job->of->lattice.count * size) * sizeof *job->nodes);
    }
    apply_matrix_along_each_factor(job, size, matrices, false, job->nodes, job->coefficients);
}

/* Computes job->position_bound and job->value_bound, the bounds of the difference between the polynomials and their
 * linear interpolation, from the Bernstein coefficients. */
static void bound_interpolation_errors(bound_job *job)
{
    bound_sums sums = {{0}, {0}};
    double largest[SIZE];
    int inner = SIZE;
    for (int f = 0; f < count_factors(job->of->lattice.type); f++) {
        add_error_bounds_of_factor(job, get_simplex_factor(job->of, f), inner, &sums);
        inner *= get_simplex_factor(job->of, f)->node_count;
    }
    for (int c = 0; c < SIZE; c++) largest[c] = fmax(sums.above[c], sums.below[c]);
    job->position_bound = vector3_length(largest);
    job->value_bound = largest[3];
}

/* Finds a sphere around the bounding box of the positions' Bernstein coefficients. The sphere contains the cell,
 * because each position in the cell is a weighted mean of these coefficients. Its radius is NaN if a coefficient is not
 * finite. */
static void find_bounding_sphere(const bound_job *job, session_cell_bound *out)
{
    double low[SIZE], high[SIZE], half[3], zero = 0;
    for (int c = 0; c < SIZE; c++) low[c] = high[c] = job->coefficients[c];
    for (int i = 0; i < SIZE * job->of->lattice.count; i++) {
        zero += 0 * job->coefficients[i];
        low[i % SIZE] = fmin(low[i % SIZE], job->coefficients[i]);
        high[i % SIZE] = fmax(high[i % SIZE], job->coefficients[i]);
    }
    for (int a = 0; a < 3; a++) {
        out->centre[a] = 0.5 * (low[a] + high[a]);
        half[a] = 0.5 * (high[a] - low[a]);
    }
    out->radius = zero == 0 ? vector3_length(half) : NAN;
}

bool session_is_any_isovalue_between(const session_isovalues *isovalues, double low, double high)
{
    for (int i = 0; i < isovalues->count; i++)
        if (isovalues->values[i] >= low && isovalues->values[i] <= high) return true;
    return false;
}

/* Computes the gradient of the field at a node of the finer lattice from the derivatives along the axes of the
 * reference cell. For a cell with two axes it is the gradient along the cell's surface. */
static void find_gradient(const bound_job *job, int node, double out[3])
{
    const double *a = job->slopes[0] + SIZE * node, *b = job->slopes[1] + SIZE * node;
    const double *c = job->slopes[2] + SIZE * node;
    double normal[3], bc[3], ca[3], ab[3];
    vector3_cross(a, b, ab);
    memcpy(normal, ab, sizeof normal);
    if (job->of->axis_count == 3) memcpy(normal, c, sizeof normal);
    vector3_cross(b, normal, bc);
    vector3_cross(normal, a, ca);
    const double volume = vector3_dot(ab, normal), last = job->of->axis_count == 3 ? c[3] : 0;
    for (int x = 0; x < 3; x++) out[x] = (a[3] * bc[x] + b[3] * ca[x] + last * ab[x]) / volume;
}

/* Computes the positions and values, their derivatives along the axes of the reference cell, and the field's gradient
 * in space, at all nodes of the finer lattice that is used. */
static void find_gradients(bound_job *job)
{
    const session_bound *of = job->of;
    const int count = count_factors(of->lattice.type);
    const double *values[3] = {NULL}, *matrices[3];
    int axis = 0;
    for (int f = 0; f < count; f++) values[f] = get_simplex_factor(of, f)->values[job->level];
    apply_matrix_along_each_factor(job, SIZE, values, true, job->nodes, job->fine);
    for (int f = 0; f < count; f++)
        for (int a = 0; a < get_simplex_factor(of, f)->dimensions; a++, axis++) {
            memcpy(matrices, values, sizeof matrices);
            matrices[f] = get_simplex_factor(of, f)->slopes[job->level][a];
            apply_matrix_along_each_factor(job, SIZE, matrices, true, job->nodes, job->slopes[axis]);
        }
    for (int n = 0; n < of->levels[job->level].count; n++) find_gradient(job, n, job->gradients[n]);
}

/* Returns the number of nodes of the finer lattice at which the gradient is defined. Pyramids are read as hexes whose
 * upper face is collapsed to the apex; the gradient is not defined at the nodes of this face, which are the last ones.
 * In all other cells it is defined at all nodes. */
static int count_gradients(const bound_job *job)
{
    const session_bound_level *level = &job->of->levels[job->level];
    return job->of->collapse ? level->order * (level->order + 1) * (level->order + 1) : level->count;
}

/* Returns a lower bound of the length of any weighted mean of the gradients at a piece's corners; 0 if the bound is not
 * positive or not finite. Corners without a gradient are left out. */
static double compute_least_gradient_length(const bound_job *job, const int *corners, int count)
{
    const int known = count_gradients(job);
    double mean[3] = {0}, least = INFINITY;
    for (int c = 0; c < count; c++)
        for (int x = 0; x < 3 && corners[c] < known; x++) mean[x] += job->gradients[corners[c]][x];
    const double length = vector3_length(mean);
    for (int c = 0; c < count; c++)
        if (corners[c] < known) least = fmin(least, vector3_dot(mean, job->gradients[corners[c]]) / length);
    return isfinite(length) && least > 0 ? least : 0;
}

/* Computes whether an isosurface may cross the cell (out->is_crossed), and the bound of the isosurfaces' error
 * (out->surface_error), as described at the top of the file. */
static void bound_isosurface_error(bound_job *job, session_cell_bound *out)
{
    const session_bound_level *level = &job->of->levels[job->level];
    const int p = job->of->nodes.of.order, *corners = level->pieces.piece_positions;
    const double between = job->value_bound / (level->order * level->order);
    double least = INFINITY;
    find_gradients(job);
    for (int piece = 0; piece < level->pieces.piece_count; piece++) {
        const int count = grid_type_vertex_count(level->pieces.types[piece]);
        double low = INFINITY, high = -INFINITY;
        for (int c = 0; c < count; c++) {
            low = fmin(low, job->fine[SIZE * corners[c] + 3]);
            high = fmax(high, job->fine[SIZE * corners[c] + 3]);
        }
        if (session_is_any_isovalue_between(job->isovalues, low - between, high + between))
            least = fmin(least, compute_least_gradient_length(job, corners, count));
        corners += count;
    }
    out->is_crossed = least < INFINITY;
    out->surface_error = out->position_error;
    if (job->value_bound > 0) out->surface_error += job->value_bound / (p * p) / least;
}

/* Returns the root mean square of the lengths of the edges between the cell's corners, divided by the order. */
static double find_node_distance(const session_bound *of, const double *tuples)
{
    const session_shape *shape = session_get_cell_shape(of->nodes.of.type);
    double sum = 0;
    for (int e = 0; e < shape->edge_count; e++)
        for (int x = 0; x < 3; x++) {
            const double *a = tuples + SIZE * of->nodes.corners[(int)shape->edges[e][0]];
            const double *b = tuples + SIZE * of->nodes.corners[(int)shape->edges[e][1]];
            sum += (b[x] - a[x]) * (b[x] - a[x]);
        }
    return sqrt(sum / shape->edge_count) / of->nodes.of.order;
}

/* Estimates the cell's volume as that of a straight cell. Its edge vector along each axis of the reference cell is the
 * mean of the cell's edges along this axis. */
static double find_volume(const session_bound *of, const double *tuples)
{
    const session_shape *shape = session_get_cell_shape(of->nodes.of.type);
    const int type = of->nodes.of.type;
    const double share = type == GRID_TET ? 1.0 / 6 : type == GRID_PYRAMID ? 1.0 / 3 : type == GRID_WEDGE ? 1.0 / 2 : 1;
    double axes[3][3] = {{0}}, cross[3];
    int counts[3] = {0};
    for (int e = 0; e < shape->edge_count; e++) {
        const int from = shape->edges[e][0], to = shape->edges[e][1];
        int steps[3], axis = 0, sum = 0;
        for (int a = 0; a < 3; a++) {
            steps[a] = shape->corners[to][a] - shape->corners[from][a];
            sum += abs(steps[a]);
            axis = steps[a] ? a : axis;
        }
        if (sum > 1) continue; /* an edge that is not parallel to an axis */
        counts[axis]++;
        for (int x = 0; x < 3; x++)
            axes[axis][x] +=
                steps[axis] * (tuples[SIZE * of->nodes.corners[to] + x] - tuples[SIZE * of->nodes.corners[from] + x]);
    }
    vector3_cross(axes[0], axes[1], cross);
    return of->axis_count < 3 ? 0 : share * fabs(vector3_dot(cross, axes[2])) / (counts[0] * counts[1] * counts[2]);
}

/* Finds the mean gradient of the field over the nodes of the finer lattice. The gradient is not needed in straight
 * cells, in which the positions given by the polynomial and by the pieces differ only by rounding; it is then set to 0.
 * In other cells it may be not finite. */
static void find_mean_gradient(bound_job *job, const session_cell_bound *bound, double out[3])
{
    static const double straight = 1e-6;
    const int count = count_gradients(job);
    for (int x = 0; x < 3; x++) out[x] = 0;
    if (bound->position_error <= straight * bound->radius) return;
    find_gradients(job);
    for (int n = 0; n < count; n++)
        for (int x = 0; x < 3; x++) out[x] += job->gradients[n][x] / count;
}

/* Mean of u and mean of the square of u over a cell that is one piece. u is the polynomial minus its linear
 * interpolation. */
typedef struct difference_means {
    double mean, square;
} difference_means;

/* Returns the means of u and its square over a simplex, where u is a polynomial of order 2 minus its linear
 * interpolation. second: the second derivative s_ij of u along each edge, from corner i to corner j, in the order of
 * list_second_differences(). Let l_i be the barycentric coordinates. Then u is half the sum of -s_ij l_i l_j over all
 * edges, and the means of products of the l_i are known. */
static difference_means compute_error_means_on_simplex(int dimensions, const double *second)
{
    static const int edge_counts[] = {0, 1, 3, 6};
    /* mean over a simplex of the product l_i l_j of two barycentric coordinates, by the number of dimensions */
    static const double singles[] = {0, 1.0 / 6, 1.0 / 12, 1.0 / 20};
    /* means of products of barycentric coordinates over a simplex, by its number of dimensions: l_i^2 l_j^2, l_i^2 l_j
     * l_k and l_i l_j l_k l_l, where different indices stand for different corners */
    static const double products[][3] = {{0}, {1.0 / 30}, {1.0 / 90, 1.0 / 180}, {1.0 / 210, 1.0 / 420, 1.0 / 840}};
    difference_means out = {0, 0};
    for (int d = 0; d < edge_counts[dimensions]; d++) {
        out.mean -= 0.5 * singles[dimensions] * second[d];
        for (int e = 0; e < edge_counts[dimensions]; e++) {
            const bool is_opposite = dimensions == 3 && d + e == 5;
            out.square += 0.25 * second[d] * second[e] * products[dimensions][d == e ? 0 : is_opposite ? 2 : 1];
        }
    }
    return out;
}

/* Returns the means of u and its square over a cell, where u is the difference between the polynomial and its linear
 * interpolation along one factor: one of the simplices whose product the reference cell is (top of the file).
 * coefficients: Bernstein coefficients of a scalar. inner: distance in the array between neighbouring coefficients of
 * the factor. */
static difference_means compute_error_means_along_factor(const bound_job *job, const session_bound_factor *factor,
                                                         int inner, const double *coefficients)
{
    const int p = job->of->nodes.of.order, all = job->of->lattice.count;
    const int directions = direction_counts[factor->dimensions];
    difference_means out = {0, 0};
    int count = 0;
    for (int outer = 0; outer < all; outer += inner * factor->node_count)
        for (int s = 0; s < inner; s++)
            for (int d = 0; d < factor->difference_count; d += directions, count++) {
                double second[MOST_DIRECTIONS];
                for (int n = 0; n < directions; n++) {
                    const session_second_difference *of = &factor->differences[d + n];
                    second[n] = 0;
                    for (int t = 0; t < of->count; t++)
                        second[n] += p * (p - 1) * of->weights[t] * coefficients[outer + of->nodes[t] * inner + s];
                }
                const difference_means own = compute_error_means_on_simplex(factor->dimensions, second);
                out.mean += own.mean;
                out.square += own.square;
            }
    return (difference_means){out.mean / fmax(1, count), out.square / fmax(1, count)};
}

/* Returns an estimate of the root mean square of the error of the field in a cell, if the whole cell is one piece. Let
 * u be a polynomial minus its linear interpolation. At a point of space, the error is, to first order, u of the field
 * minus the product of the gradient and u of the positions. The second derivatives of u are approximated by second
 * differences of the Bernstein coefficients. It is assumed that the tets into which octahedra are cut have the same
 * shape as the other tets, and that the values of u of the different factors of the reference cell are independent.
 * coefficients: working memory with one number per node. */
static double estimate_rms_field_error(const bound_job *job, const double gradient[3], double *coefficients)
{
    double mean = 0, variance = 0;
    int inner = 1;
    for (int i = 0; i < job->of->lattice.count; i++) {
        const double *tuple = job->coefficients + SIZE * i;
        coefficients[i] = tuple[3] - vector3_dot(gradient, tuple);
    }
    for (int f = 0; f < count_factors(job->of->lattice.type); f++) {
        const session_bound_factor *factor = get_simplex_factor(job->of, f);
        const difference_means own = compute_error_means_along_factor(job, factor, inner, coefficients);
        mean += own.mean;
        variance += own.square - own.mean * own.mean;
        inner *= factor->node_count;
    }
    return sqrt(fmax(0, mean * mean + variance));
}

bool session_may_isosurface_cross_cell(const session_bound *of, const double *values,
                                       const session_isovalues *isovalues, double *work)
{
    bound_job job = {.of = of};
    double low = INFINITY, high = -INFINITY, zero = 0;
    assign_work_arrays(&job, work);
    compute_bernstein_coefficients(&job, 1, values);
    for (int i = 0; i < of->lattice.count; i++) {
        zero += 0 * job.coefficients[i]; /* NaN if a coefficient is not finite */
        low = fmin(low, job.coefficients[i]);
        high = fmax(high, job.coefficients[i]);
    }
    const double rounding = 1e-6 * fmax(fabs(low), fabs(high)), tolerance = isovalues->tolerance + rounding;
    return zero == 0 && session_is_any_isovalue_between(isovalues, low - tolerance, high + tolerance);
}

session_cell_bound session_bound_cell_errors(const session_bound *of, const double *tuples,
                                             const session_isovalues *isovalues, int level, double *work)
{
    bound_job job = {.of = of, .isovalues = isovalues, .level = level};
    session_cell_bound out = {.node_distance = find_node_distance(of, tuples)};
    const int p = of->nodes.of.order;
    assign_work_arrays(&job, work);
    compute_bernstein_coefficients(&job, SIZE, tuples);
    find_bounding_sphere(&job, &out);
    out.is_crossed = isfinite(out.radius);
    if (!out.is_crossed) return out;
    bound_interpolation_errors(&job);
    out.position_error = job.position_bound / (p * p);
    if (isovalues) {
        bound_isosurface_error(&job, &out);
        return out;
    }
    double gradient[3];
    find_mean_gradient(&job, &out, gradient);
    out.value_error = estimate_rms_field_error(&job, gradient, job.work) / (p * p);
    out.volume = find_volume(of, tuples);
    return out;
}
