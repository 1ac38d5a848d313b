/* Computes integrals over cells of higher order by Gauss quadrature. The reference cell is a product of factors: a hex
 * is the product of three lines, and a wedge that of a triangle and a line; a tet is a single factor. A cell is called
 * straight if the map from the reference cell to the cell is linear in each factor; other cells are called bent. Let p
 * be the order of a cell, J the Jacobian of its map, and f the polynomial of its values. The volume is the integral of
 * det J, and the standard deviation needs the integral of f^2 det J. The map of a bent cell has the order p. Then
 * f^2 det J is a polynomial of the following degrees, for which the rules are exact:
 *
 *     factor                  straight   bent
 *     each line of a hex      2 p + 2    5 p - 1
 *     triangle of a wedge     2 p + 1    5 p - 2
 *     line of a wedge         2 p + 2    5 p - 1
 *     tet                     2 p        5 p - 3, at most 33
 *
 * Polynomials on a product of lines are evaluated along one line after the other (sum factorization), so that all of
 * these degrees are affordable in hexes: with p = 4 a bent hex has 1000 points and takes some 50 multiplications for
 * each of them. The functions of a tet are not products. With p = 7, the highest order at which bent tets are
 * integrated exactly, there are 4913 points, at each of which 120 nodes are summed. For higher orders, straight tets
 * are still integrated exactly. In bent tets a rule of degree 33 is used; for analytic functions, the error of such
 * rules decreases fast with their degree.
 *
 * The area element of a shell is a square root, which no rule integrates exactly unless the shell is flat. Flat shells
 * need the degree 4 p - 1, or 4 p - 2 in a triangle. Rules with 4 p points along each axis have twice that degree, and
 * are affordable in two dimensions. */
#include "session_cell_rules.h"

#include <math.h>
#include <string.h>

#include "memory.h"
#include "session_derivatives.h"
#include "session_matrix.h"
#include "session_shape.h"

enum {
    LANES = 4,  /* number of points whose sums are computed together */
    BLOCK = 32, /* maximum number of points in a block */
    /* maximum number of doubles of session_rule_factor.functions; if the nodal functions at all points take more, they
     * are computed again for each cell */
    MOST_FUNCTIONS = 1 << 20,
    MOST_TET_POINTS = 17, /* maximum number of points along an axis of bent tets, or the number that straight tets
                             need, if it is larger */
    SIZE = 4,             /* number of doubles of a tuple: x, y, z and a value */
    MOST_SIZE = SIZE + 6, /* number of doubles of a tuple together with the position's derivatives along two axes */
    AXES = 3
};

/* ---- numbers of quadrature points ------------------------------------------------------------------------------ */

static int count_points_of_degree(int degree)
{
    return degree / 2 + 1;
}

static int count_points_of_first_rule_factor(const session_nodes *of, bool is_bent)
{
    const int p = of->order;
    if (grid_is_shell_type(of->type)) return 4 * p;
    if (of->type == GRID_WEDGE) return count_points_of_degree(is_bent ? 5 * p - 2 : 2 * p + 1);
    if (of->type == GRID_HEX) return count_points_of_degree(is_bent ? 5 * p - 1 : 2 * p + 2);
    const int straight = count_points_of_degree(2 * p), bent = count_points_of_degree(5 * p - 3);
    const int most = straight > MOST_TET_POINTS ? straight : MOST_TET_POINTS;
    return !is_bent ? straight : bent < most ? bent : most;
}

static int count_line_points(const session_nodes *of, bool is_bent)
{
    const int p = of->order;
    return grid_is_shell_type(of->type) ? 4 * p : count_points_of_degree(is_bent ? 5 * p - 1 : 2 * p + 2);
}

/* ---- nodal functions ------------------------------------------------------------------------------------------- */

/* Computes the Lagrange polynomials of the nodes on a line, and their derivatives, at a point. out[n * stride] receives
 * the value for node n, and out[n * stride + slopes] the derivative. */
static void evaluate_line_nodal_functions(const session_rule_factor *factor, const double *nodes, double at,
                                          double *out, int stride, int slopes)
{
    const int p = factor->order;
    for (int n = 0; n <= p; n++) {
        double value = 1, slope = 0;
        for (int m = 0; m <= p; m++) {
            if (m == n) continue;
            slope = (slope * (at - nodes[m]) + value) / (nodes[n] - nodes[m]);
            value *= (at - nodes[m]) / (nodes[n] - nodes[m]);
        }
        out[n * stride] = value;
        out[n * stride + slopes] = slope;
    }
}

/* Computes Silvester's functions (the Lagrange polynomials of equispaced nodes, session_derivatives.c) of a triangle or
 * tet at a point, and their derivatives along each axis. out[n * stride] receives the value for node n, and out[n *
 * stride + k * slopes] the derivative along axis k = 1, 2 or 3. */
static void evaluate_simplex_nodal_functions(const session_rule_factor *factor, const double at[3], double *out,
                                             int stride, int slopes)
{
    double values[4][NODES_MOST_ORDER + 1], derivatives[4][NODES_MOST_ORDER + 1];
    const int p = factor->order, dimensions = factor->rule.dimensions;
    const double coordinates[4] = {at[0], at[1], at[2], 1 - at[0] - at[1] - at[2]};
    for (int a = 0; a < 4; a++) {
        values[a][0] = 1;
        derivatives[a][0] = 0;
        for (int n = 1; n <= p; n++) {
            const double t = (p * coordinates[a] - (n - 1)) / n;
            values[a][n] = values[a][n - 1] * t;
            derivatives[a][n] = derivatives[a][n - 1] * t + values[a][n - 1] * p / n;
        }
    }
    for (int k = 0; k <= (dimensions > 2 ? p : 0); k++)
        for (int j = 0; j <= p - k; j++)
            for (int i = 0; i <= p - k - j; i++, out += stride) {
                const int n[4] = {i, j, k, p - i - j - k};
                double f[4];
                for (int a = 0; a < 4; a++) f[a] = values[a][n[a]];
                const double last = f[0] * f[1] * f[2] * derivatives[3][n[3]];
                out[0] = f[0] * f[1] * f[2] * f[3];
                out[slopes] = derivatives[0][i] * f[1] * f[2] * f[3] - last;
                out[2 * slopes] = f[0] * derivatives[1][j] * f[2] * f[3] - last;
                if (dimensions > 2) out[3 * slopes] = f[0] * f[1] * derivatives[2][k] * f[3] - last;
            }
}

/* Returns the number of doubles that the nodal functions of a factor (a line, triangle or tet) and their derivatives
 * take at one block of quadrature points. */
static size_t count_numbers_of_point_block(const session_rule_factor *factor)
{
    return (size_t)(1 + factor->rule.dimensions) * (size_t)factor->node_count * (size_t)factor->width;
}

static void evaluate_nodal_functions_at_block(const session_rule_factor *factor, int first, double *out)
{
    const int slopes = factor->node_count * factor->width;
    double nodes[NODES_MOST_ORDER + 1];
    if (factor->rule.dimensions == 1) session_compute_node_positions(factor->order, factor->is_lobatto, nodes);
    for (int n = 0; n < factor->width && first + n < factor->rule.count; n++) {
        const double *at = factor->rule.points[first + n];
        if (factor->rule.dimensions == 1)
            evaluate_line_nodal_functions(factor, nodes, at[0], out + n, factor->width, slopes);
        else
            evaluate_simplex_nodal_functions(factor, at, out + n, factor->width, slopes);
    }
}

static bool make_factor(int dimensions, int order, bool is_lobatto, int points, session_rule_factor *out)
{
    const int simplex = dimensions == 2 ? GRID_TRIANGLE : GRID_TET;
    out->order = order;
    out->node_count = dimensions > 1 ? session_describe_complete_nodes(simplex, order).count : order + 1;
    out->is_lobatto = is_lobatto;
    if (!session_make_quadrature(dimensions, points, &out->rule)) return false;
    const int whole = (out->rule.count + LANES - 1) / LANES * LANES;
    out->width = whole < BLOCK ? whole : BLOCK;
    const size_t blocks = (size_t)(out->rule.count - 1) / (size_t)out->width + 1;
    if (dimensions > 1 && blocks * count_numbers_of_point_block(out) > MOST_FUNCTIONS) return true;
    out->functions = base_calloc(blocks * count_numbers_of_point_block(out), sizeof *out->functions);
    for (size_t b = 0; b < blocks && out->functions; b++)
        evaluate_nodal_functions_at_block(out, (int)b * out->width,
                                          out->functions + b * count_numbers_of_point_block(out));
    return out->functions;
}

/* ---- quadrature rules for one type and order of cells ------------------------------------------------------------ */

static bool is_product_of_lines(int type)
{
    return type == GRID_HEX || type == GRID_QUAD;
}

static bool make_rule(const session_nodes *of, int line_count, bool is_lobatto, bool is_bent, session_product_rule *out)
{
    const int axes = grid_is_shell_type(of->type) ? 2 : AXES;
    return make_factor(axes - line_count, of->order, is_lobatto, count_points_of_first_rule_factor(of, is_bent),
                       &out->first) &&
           (line_count == 0 || make_factor(1, of->order, is_lobatto, count_line_points(of, is_bent), &out->line));
}

/* Computes corner_weights: the values, at all nodes, of the linear functions that are 1 at one corner and 0 at all
 * other corners. */
static bool compute_corner_function_values(bool is_lobatto, session_cell_rules *out)
{
    const session_nodes *of = &out->nodes.complete;
    const session_shape *shape = session_get_cell_shape(of->type);
    const int p = of->order, simplex = (grid_is_shell_type(of->type) ? 2 : AXES) - out->line_count;
    double line[NODES_MOST_ORDER + 1];
    session_compute_node_positions(p, is_lobatto, line);
    out->corner_count = shape->corner_count;
    double *weights = base_alloc((size_t)(of->count * shape->corner_count) * sizeof *weights);
    out->corner_weights = weights;
    if (!weights) return false;
    for (int n = 0; n < (p + 1) * (p + 1) * (p + 1); n++) {
        const int at[3] = {n % (p + 1), n / (p + 1) % (p + 1), n / (p + 1) / (p + 1)};
        if (!session_has_node(of, at[0], at[1], at[2])) continue;
        const int node = session_find_node_in_connectivity(of, INSITU_ORDER_LEXICOGRAPHIC, at[0], at[1], at[2]);
        for (int c = 0; c < shape->corner_count; c++) {
            double first = 1, product = 1;
            for (int a = 0; a < simplex; a++) first -= line[at[a]];
            for (int a = 0; a < simplex; a++)
                if (shape->corners[c][a]) first = line[at[a]];
            for (int a = simplex; a < AXES; a++) product *= shape->corners[c][a] ? line[at[a]] : 1 - line[at[a]];
            weights[node * shape->corner_count + c] = first * product;
        }
    }
    return true;
}

bool session_make_cell_rules(const session_nodes *of, insitu_vertex_order order, bool is_lobatto,
                             session_cell_rules *out)
{
    const bool is_pyramid = of->type == GRID_PYRAMID, has_straight = !is_pyramid && !grid_is_shell_type(of->type);
    const bool has_spacing = is_lobatto && is_product_of_lines(of->type);
    const int type = is_pyramid ? GRID_HEX : of->type;
    const session_nodes nodes = is_pyramid ? session_describe_complete_nodes(GRID_HEX, of->order) : *of;
    *out = (session_cell_rules){.lattice = session_describe_complete_nodes(type, of->order),
                                .line_count = type == GRID_HEX                          ? 2
                                              : type == GRID_QUAD || type == GRID_WEDGE ? 1
                                                                                        : 0};
    if (is_pyramid) out->collapse = session_compute_collapse_matrix(of->order);
    return session_map_nodes_to_connectivity(of, order, &out->nodes) && (!is_pyramid || out->collapse) &&
           (!has_straight || compute_corner_function_values(has_spacing, out)) &&
           make_rule(&nodes, out->line_count, has_spacing, true, &out->bent) &&
           (!has_straight || make_rule(&nodes, out->line_count, has_spacing, false, &out->straight));
}

static void drop_factor(session_rule_factor *factor)
{
    session_drop_quadrature(&factor->rule);
    base_free(factor->functions);
}

void session_drop_cell_rules(session_cell_rules *rules)
{
    session_drop_interpolation(&rules->nodes);
    base_free(rules->collapse);
    base_free(rules->corner_weights);
    drop_factor(&rules->straight.first);
    drop_factor(&rules->straight.line);
    drop_factor(&rules->bent.first);
    drop_factor(&rules->bent.line);
    *rules = (session_cell_rules){.line_count = 0};
}

/* ---- quadrature points of one cell ----------------------------------------------------------------------------- */

/* The state while the quadrature points of one cell are visited. The reference cell is the product of a first factor (a
 * line, triangle or tet) and of up to two further lines, and the polynomials are evaluated along one line after the
 * other. lattices[n] contains one array for each component (x, y, z and the value), with its values at the nodes of the
 * first factor times n lines. Evaluating lattices[n] at a quadrature point of its last line gives lattices[n - 1],
 * which has three more components: the derivatives of the position along that line. */
typedef struct cell_visit {
    const session_cell_rules *rules;
    const session_product_rule *rule;
    double *lattices[AXES]; /* for each n, the components at the nodes of the first factor times the first n lines */
    double *functions;      /* memory for the nodal functions at one block of points, if
                               session_rule_factor.functions is NULL */
    session_visit_points *visit;
    void *of;
} cell_visit;

static size_t count_lattice_nodes(const session_cell_rules *rules, int lines)
{
    size_t count = (size_t)rules->bent.first.node_count;
    for (int n = 0; n < lines; n++) count *= (size_t)rules->nodes.of.order + 1;
    return count;
}

size_t session_cell_rules_work_size(const session_cell_rules *rules)
{
    const size_t nodes = (size_t)rules->nodes.complete.count + (size_t)rules->lattice.count;
    size_t size = SIZE * nodes + (AXES + 1) * (size_t)rules->bent.first.node_count * BLOCK;
    for (int lines = 0; lines <= rules->line_count; lines++) size += MOST_SIZE * count_lattice_nodes(rules, lines);
    return size;
}

/* Multiplies a matrix of node_count x width by the values at the nodes of one component, or of three consecutive
 * components. The sums of LANES points stay in registers. */
static inline __attribute__((always_inline)) void multiply_by_matrix(const double *restrict matrix, int node_count,
                                                                     int width, const double *restrict values,
                                                                     const int components,
                                                                     double (*restrict out)[BLOCK])
{
    for (int first = 0; first < width; first += LANES) {
        double sums[3][LANES] = {{0}};
        for (int n = 0; n < node_count; n++)
            for (int c = 0; c < components; c++)
                for (int i = 0; i < LANES; i++)
                    sums[c][i] += matrix[n * width + first + i] * values[c * node_count + n];
        for (int c = 0; c < components; c++) memcpy(out[c] + first, sums[c], sizeof sums[c]);
    }
}

static void multiply_one_component(const double *matrix, int node_count, int width, const double *values,
                                   double (*out)[BLOCK])
{
    multiply_by_matrix(matrix, node_count, width, values, 1, out);
}

static void multiply_three_components(const double *matrix, int node_count, int width, const double *values,
                                      double (*out)[BLOCK])
{
    multiply_by_matrix(matrix, node_count, width, values, 3, out);
}

static double compute_volume_element(double (*slopes)[AXES][BLOCK], int axes, int point)
{
    double s[AXES][AXES], cross[AXES];
    for (int axis = 0; axis < axes; axis++)
        for (int x = 0; x < 3; x++) s[axis][x] = slopes[axis][x][point];
    for (int x = 0; x < 3; x++)
        cross[x] = s[0][(x + 1) % 3] * s[1][(x + 2) % 3] - s[0][(x + 2) % 3] * s[1][(x + 1) % 3];
    return axes < AXES ? sqrt(cross[0] * cross[0] + cross[1] * cross[1] + cross[2] * cross[2])
                       : cross[0] * s[2][0] + cross[1] * s[2][1] + cross[2] * s[2][2];
}

/* Passes one block of quadrature points of the first factor (a line, triangle or tet) to the visitor function. weight:
 * product of the quadrature weights of the current points on the further lines. */
static void visit_block_of_quadrature_points(const cell_visit *v, int first, const double *functions, double weight)
{
    const session_rule_factor *factor = &v->rule->first;
    const int nodes = factor->node_count, width = factor->width, dimensions = factor->rule.dimensions;
    const int lines = v->rules->line_count, rest = factor->rule.count - first;
    const double *in = v->lattices[0];
    double slopes[AXES][AXES][BLOCK], values[1][BLOCK], measures[BLOCK];
    for (int axis = 0; axis < dimensions; axis++)
        multiply_three_components(functions + (1 + axis) * nodes * width, nodes, width, in, slopes[axis]);
    multiply_one_component(functions, nodes, width, in + 3 * nodes, values);
    /* derivatives were added to the components line by line, beginning with the last line, so that they are read in
     * reverse order */
    for (int line = 0; line < lines; line++)
        multiply_three_components(functions, nodes, width, in + (SIZE + 3 * line) * nodes,
                                  slopes[dimensions + lines - 1 - line]);
    const int count = rest < width ? rest : width;
    for (int i = 0; i < count; i++)
        measures[i] = weight * factor->rule.weights[first + i] * compute_volume_element(slopes, dimensions + lines, i);
    v->visit(v->of, count, measures, values[0]);
}

static void visit_points_of_first_rule_factor(const cell_visit *v, double weight)
{
    const session_rule_factor *factor = &v->rule->first;
    const double *functions = factor->functions ? factor->functions : v->functions;
    for (int first = 0; first < factor->rule.count; first += factor->width) {
        if (!factor->functions) evaluate_nodal_functions_at_block(factor, first, v->functions);
        visit_block_of_quadrature_points(v, first, functions, weight);
        if (factor->functions) functions += count_numbers_of_point_block(factor);
    }
}

/* Interpolates one component at a point of a line. The component is given at the line's nodes, as an array of `size`
 * numbers for each node; `out` receives `size` numbers. functions: the values of the line's nodal functions at the
 * point, line->width doubles apart. */
static void interpolate_along_line(const session_rule_factor *line, const double *functions, size_t size,
                                   const double *restrict in, double *restrict out)
{
    memset(out, 0, size * sizeof *out);
    for (int n = 0; n < line->node_count; n++)
        for (size_t i = 0; i < size; i++) out[i] += functions[n * line->width] * in[(size_t)n * size + i];
}

/* Evaluates a lattice of nodes at one quadrature point of its last axis, so that the result has one axis less. The
 * lattice lattices[lines] has `lines` such axes; the result is stored in lattices[lines - 1]. */
static void evaluate_lattice_on_line(const cell_visit *v, int lines, int point)
{
    const session_rule_factor *line = &v->rule->line;
    const double *values =
        line->functions + (size_t)(point / line->width) * count_numbers_of_point_block(line) + point % line->width;
    const double *slopes = values + line->node_count * line->width;
    const size_t size = count_lattice_nodes(v->rules, lines - 1), stride = size * (size_t)line->node_count;
    const int components = SIZE + 3 * (v->rules->line_count - lines);
    for (int c = 0; c < components; c++)
        interpolate_along_line(line, values, size, v->lattices[lines] + (size_t)c * stride,
                               v->lattices[lines - 1] + (size_t)c * size);
    for (int c = 0; c < 3; c++)
        interpolate_along_line(line, slopes, size, v->lattices[lines] + (size_t)c * stride,
                               v->lattices[lines - 1] + (size_t)(components + c) * size);
}

static void visit_points(const cell_visit *v)
{
    const session_quadrature *line = &v->rule->line.rule;
    const int lines = v->rules->line_count, along = lines > 0 ? line->count : 1, across = lines > 1 ? line->count : 1;
    for (int k = 0; k < across; k++) {
        if (lines > 1) evaluate_lattice_on_line(v, 2, k);
        for (int j = 0; j < along; j++) {
            if (lines > 0) evaluate_lattice_on_line(v, 1, j);
            visit_points_of_first_rule_factor(v,
                                              (lines > 1 ? line->weights[k] : 1) * (lines > 0 ? line->weights[j] : 1));
        }
    }
}

/* Returns whether the positions of all of the cell's nodes are linear functions of the corners' positions, up to
 * rounding (the cell is straight). In any other cell the integrand has a higher degree, for which the rule of straight
 * cells is not exact, so that the tolerance must not exceed the rounding error by much. */
static bool is_straight(const session_cell_rules *rules, const double *tuples, const double *positions)
{
    static const double tolerance = 1e-12;
    const size_t nodes = (size_t)rules->nodes.complete.count;
    double size = 0, most = 0;
    for (size_t n = 0; n < nodes; n++)
        for (int x = 0; x < 3; x++) {
            double linear = 0;
            for (int c = 0; c < rules->corner_count; c++)
                linear += rules->corner_weights[n * (size_t)rules->corner_count + (size_t)c] *
                          (tuples[SIZE * rules->nodes.corners[c] + x] - tuples[SIZE * rules->nodes.corners[0] + x]);
            const double at = positions[(size_t)x * nodes + n];
            size = fmax(size, fabs(at));
            most = fmax(most, fabs(at - linear));
        }
    return most <= tolerance * size;
}

void session_visit_quadrature_points(const session_cell_rules *rules, const double *tuples, double *work,
                                     session_visit_points *visit, void *of)
{
    cell_visit v = {.rules = rules, .visit = visit, .of = of};
    const size_t nodes = (size_t)rules->lattice.count;
    double *complete = work, *expanded = work + SIZE * (size_t)rules->nodes.complete.count;
    v.functions = expanded + SIZE * nodes;
    double *next = v.functions + (AXES + 1) * (size_t)rules->bent.first.node_count * BLOCK;
    for (int lines = 0; lines <= rules->line_count; lines++) {
        v.lattices[lines] = next;
        next += MOST_SIZE * count_lattice_nodes(rules, lines);
    }
    session_fill_complete_cell_tuples(&rules->nodes, SIZE, tuples, complete);
    if (rules->collapse)
        session_multiply_matrix(rules->collapse, rules->lattice.count, rules->nodes.complete.count, 1, SIZE, complete,
                                expanded);
    else
        expanded = complete;
    double *lattice = v.lattices[rules->line_count];
    for (size_t n = 0; n < nodes; n++)
        for (size_t c = 0; c < SIZE; c++)
            lattice[c * nodes + n] =
                expanded[SIZE * n + c] - (c < 3 ? tuples[(size_t)(SIZE * rules->nodes.corners[0]) + c] : 0);
    const bool is_bent = !rules->straight.first.node_count || !is_straight(rules, tuples, lattice);
    v.rule = is_bent ? &rules->bent : &rules->straight;
    visit_points(&v);
}
