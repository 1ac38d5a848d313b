/* A reference cell is a product of simplices: a hex of three lines, a wedge of a triangle and a line, a tet of itself.
 * In each simplex, polynomials are written in Bernstein's form, whose coefficients bound them: a second derivative
 * along an edge e is p (p - 1) times a second difference of coefficients, and at most the largest of these, M.
 *
 * Let u be the difference between a polynomial and its linear interpolation in a simplex with edges of 1 / m, with
 * second derivatives of at most M / m^2 along each edge. With q = M / (2 m^2) times the sum of products l_i l_j of all
 * pairs of barycentric coordinates, q - u has second derivatives of at most 0 along edges, and is 0 at the corners. So
 * it is not negative on edges, then on faces, which lines parallel to an edge cross from edge to edge, and then inside.
 * The sum of products is largest at the centre, and so
 *
 *     |u| <= K M / m^2,   K = 1/8 on a line, 1/6 in a triangle, 3/16 in a tet.
 *
 * A tet is cut into smaller ones and octahedra, which are split along a diagonal. If the second derivative along this
 * is at most D = r M, the sum has D in place of M for one pair. It is largest where both corners of the diagonal have
 * the same coordinate, and so have the other two, and then K is (1 + 1 / (3 - r)) / 8 for r from 1 to 2, and r / 8
 * above.
 *
 * In a product, interpolation in one factor does not increase what is interpolated in the others, so that the bounds of
 * all factors add up.
 *
 * An isosurface of pieces is at x_m(a) with f_m(a) = v, where x_m and f_m are the interpolated position and field. At
 * x(a), which is at most the positions' bound away, the polynomial f differs from v by at most the field's bound. So
 * its isosurface is at most that, divided by the gradient's length, away from x(a). The gradient's length is taken from
 * the corners of the pieces that may be crossed: it is the least component along their mean, which is a bound for all
 * means of the gradients at the corners. How far the gradient differs from such a mean depends on third derivatives and
 * the square of the size of pieces, and is neglected. */
#include "session_bound.h"

#include <math.h>
#include <string.h>

#include "memory.h"
#include "session_derivatives.h"
#include "vector3.h"

enum {
    SIZE = 4,   /* numbers of a tuple: a position and a value */
    COARSE = 4, /* the finer lattice has at least this order */
    MOST_DIRECTIONS = 9
};

/* ---- one simplex ----------------------------------------------------------------------------------------------- */

/* Lists the nodes of the lattice of the order, by barycentric coordinates times the order. Returns their number. */
static int list_nodes(int dimensions, int order, int (*out)[4])
{
    int count = 0;
    for (int k = 0; k <= (dimensions > 2 ? order : 0); k++)
        for (int j = 0; j <= (dimensions > 1 ? order - k : 0); j++)
            for (int i = 0; i <= order - j - k; i++, count++)
                if (out) memcpy(out[count], (const int[]){order - i - j - k, i, j, k}, sizeof out[count]);
    return count;
}

/* The nodes of a simplex, as list_nodes() lists them. */
typedef struct node_lists {
    int dimensions, order, fine_order, count, fine_count;
    bool is_lobatto;                          /* set if the nodes of a line are Gauss-Lobatto points */
    int (*nodes)[4], (*fine)[4], (*lower)[4]; /* of the cell, of the finer lattice, and of the order lower by 2 */
} node_lists;

/* Returns the number of a node in the list. */
static int find_node(int dimensions, int order, const int node[4])
{
    int at = node[1];
    for (int j = 0; j < node[2]; j++) at += order - node[3] - j + 1;
    for (int k = 0; k < node[3]; k++) at += list_nodes(dimensions - 1, order - k, NULL);
    return at;
}

/* Computes Bernstein's polynomial of these exponents at barycentric coordinates; 0 if an exponent is negative. */
static double bernstein_value(const int exponents[4], const double at[4])
{
    double value = 1;
    int factor = 0;
    for (int c = 0; c < 4; c++) {
        if (exponents[c] < 0) return 0;
        for (int m = 1; m <= exponents[c]; m++) value *= at[c] * ++factor / m;
    }
    return value;
}

/* Computes the derivative of Bernstein's polynomial along an axis, from corner 0 to corner axis + 1. */
static double bernstein_slope(int order, const int exponents[4], int axis, const double at[4])
{
    int raised[4], lowered[4];
    memcpy(raised, exponents, sizeof raised);
    memcpy(lowered, exponents, sizeof lowered);
    raised[axis + 1]--;
    lowered[0]--;
    return order * (bernstein_value(raised, at) - bernstein_value(lowered, at));
}

/* Replaces a matrix of count x count by its inverse, by elimination with pivots. `inverse` holds the unit matrix. */
static void invert(int count, double *matrix, double *inverse)
{
    for (int c = 0; c < count; c++) {
        int pivot = c;
        for (int r = c + 1; r < count; r++)
            if (fabs(matrix[r * count + c]) > fabs(matrix[pivot * count + c])) pivot = r;
        for (int s = 0; s < count; s++) {
            const double a = matrix[c * count + s], b = inverse[c * count + s];
            matrix[c * count + s] = matrix[pivot * count + s];
            inverse[c * count + s] = inverse[pivot * count + s];
            matrix[pivot * count + s] = a;
            inverse[pivot * count + s] = b;
        }
        const double scale = 1 / matrix[c * count + c];
        for (int s = 0; s < count; s++) {
            matrix[c * count + s] *= scale;
            inverse[c * count + s] *= scale;
        }
        for (int r = 0; r < count; r++) {
            const double factor = matrix[r * count + c];
            for (int s = 0; s < count && r != c && factor != 0; s++) {
                matrix[r * count + s] -= factor * matrix[c * count + s];
                inverse[r * count + s] -= factor * inverse[c * count + s];
            }
        }
    }
}

/* Multiplies each of `outer` arrays of columns x inner numbers with a matrix of rows x columns. */
static void multiply(const double *matrix, int rows, int columns, int outer, int inner, const double *in, double *out)
{
    for (int o = 0; o < outer; o++, in += columns * inner)
        for (int r = 0; r < rows; r++, out += inner) {
            for (int s = 0; s < inner; s++) out[s] = 0;
            for (int c = 0; c < columns; c++)
                for (int s = 0; s < inner; s++) out[s] += matrix[r * columns + c] * in[c * inner + s];
        }
}

/* Computes Bernstein's polynomials, or their derivatives along an axis if it is not negative, at the nodes of the
 * cell's lattice or of the finer one. */
static void fill_basis(const node_lists *lists, int axis, bool is_fine, double *out)
{
    const int rows = is_fine ? lists->fine_count : lists->count, places = is_fine ? lists->fine_order : lists->order;
    double line[NODES_MOST_ORDER + 1];
    session_place_nodes(lists->order, lists->is_lobatto, line);
    for (int r = 0; r < rows; r++) {
        const int *node = is_fine ? lists->fine[r] : lists->nodes[r];
        double at[4];
        for (int c = 0; c < 4; c++) at[c] = (double)node[c] / places;
        if (lists->dimensions == 1 && !is_fine) at[1] = line[node[1]];
        if (lists->dimensions == 1 && !is_fine) at[0] = 1 - at[1];
        for (int n = 0; n < lists->count; n++)
            *out++ = axis < 0 ? bernstein_value(lists->nodes[n], at)
                              : bernstein_slope(lists->order, lists->nodes[n], axis, at);
    }
}

/* Adds the second difference of the coefficients at a node of the list `lower` along a direction. */
static void add_difference(const node_lists *lists, int lower, const int direction[4], session_bound_factor *out)
{
    session_second_difference *difference = &out->differences[out->difference_count++];
    *difference = (session_second_difference){.count = 0};
    for (int a = 0; a < 4; a++)
        for (int b = a; b < 4; b++) {
            int node[4];
            memcpy(node, lists->lower[lower], sizeof node);
            node[a]++;
            node[b]++;
            if (direction[a] * direction[b] == 0) continue;
            difference->nodes[difference->count] = find_node(lists->dimensions, lists->order, node);
            difference->weights[difference->count++] = (a == b ? 1 : 2) * direction[a] * direction[b];
        }
    difference->is_diagonal = difference->count == 10;
}

/* Lists the second differences along all edges of pieces. A tet of order m consists of tets and octahedra that have the
 * directions of its edges, and the octahedra are split along a diagonal. */
static void list_differences(const node_lists *lists, session_bound_factor *out)
{
    static const int directions[][4] = {{-1, 1, 0, 0}, {-1, 0, 1, 0},  {0, -1, 1, 0},  {-1, 0, 0, 1}, {0, -1, 0, 1},
                                        {0, 0, -1, 1}, {-1, -1, 1, 1}, {-1, 1, -1, 1}, {-1, 1, 1, -1}};
    static const int counts[] = {0, 1, 3, MOST_DIRECTIONS};
    const int count = list_nodes(lists->dimensions, lists->order - 2, lists->lower);
    for (int n = 0; n < count; n++)
        for (int d = 0; d < counts[lists->dimensions]; d++) add_difference(lists, n, directions[d], out);
}

static double *make_matrix(int rows, int columns)
{
    return base_calloc((size_t)rows * (size_t)columns, sizeof(double));
}

/* Replaces the columns for Bernstein coefficients by those for values at nodes. spare: as many doubles. */
static void convert_columns(const session_bound_factor *of, double *matrix, double *spare)
{
    const int rows = of->fine_count, columns = of->node_count;
    for (int r = 0; r < rows; r++)
        for (int c = 0; c < columns; c++) {
            double sum = 0;
            for (int m = 0; m < columns; m++) sum += matrix[r * columns + m] * of->bernstein[m * columns + c];
            spare[r * columns + c] = sum;
        }
    memcpy(matrix, spare, (size_t)rows * (size_t)columns * sizeof *matrix);
}

static bool fill_factor(const node_lists *lists, session_bound_factor *out)
{
    const int count = lists->count, fine = lists->fine_count;
    double *spare = make_matrix(fine, count);
    out->bernstein = make_matrix(count, count);
    out->values = make_matrix(fine, count);
    bool is_made = spare && out->bernstein && out->values;
    for (int a = 0; a < lists->dimensions; a++) {
        out->slopes[a] = make_matrix(fine, count);
        is_made = is_made && out->slopes[a];
    }
    out->differences = base_alloc((size_t)count * MOST_DIRECTIONS * sizeof *out->differences);
    is_made = is_made && out->differences;
    if (is_made) {
        fill_basis(lists, -1, false, spare);
        for (int n = 0; n < count; n++) out->bernstein[n * count + n] = 1;
        invert(count, spare, out->bernstein);
        for (int a = -1; a < lists->dimensions; a++) {
            double *matrix = a < 0 ? out->values : out->slopes[a];
            fill_basis(lists, a, true, matrix);
            convert_columns(out, matrix, spare);
        }
        list_differences(lists, out);
    }
    base_free(spare);
    return is_made;
}

static bool make_factor(int dimensions, int order, int fine_order, bool is_lobatto, session_bound_factor *out)
{
    node_lists lists = {.dimensions = dimensions,
                        .order = order,
                        .fine_order = fine_order,
                        .is_lobatto = is_lobatto,
                        .count = list_nodes(dimensions, order, NULL),
                        .fine_count = list_nodes(dimensions, fine_order, NULL)};
    out->dimensions = dimensions;
    out->node_count = lists.count;
    out->fine_count = lists.fine_count;
    lists.nodes = base_alloc((size_t)lists.count * sizeof *lists.nodes);
    lists.fine = base_alloc((size_t)lists.fine_count * sizeof *lists.fine);
    lists.lower = base_alloc((size_t)lists.count * sizeof *lists.lower);
    bool is_made = lists.nodes && lists.fine && lists.lower;
    if (is_made) {
        list_nodes(dimensions, order, lists.nodes);
        list_nodes(dimensions, fine_order, lists.fine);
        is_made = fill_factor(&lists, out);
    }
    base_free(lists.nodes);
    base_free(lists.fine);
    base_free(lists.lower);
    return is_made;
}

static void drop_factor(session_bound_factor *factor)
{
    base_free(factor->bernstein);
    base_free(factor->values);
    for (int a = 0; a < 3; a++) base_free(factor->slopes[a]);
    base_free(factor->differences);
    *factor = (session_bound_factor){0};
}

/* ---- products -------------------------------------------------------------------------------------------------- */

static int count_factors(int type)
{
    return type == GRID_HEX ? 3 : type == GRID_QUAD || type == GRID_WEDGE ? 2 : 1;
}

static const session_bound_factor *factor_of(const session_bound *of, int factor)
{
    return factor == 0 && of->simplex.dimensions ? &of->simplex : &of->line;
}

bool session_make_bound(const session_nodes *of, insitu_vertex_order order, bool is_lobatto, session_bound *out)
{
    const int type = of->type, is_box = type == GRID_HEX || type == GRID_QUAD;
    *out = (session_bound){.axis_count = type == GRID_QUAD || type == GRID_TRIANGLE ? 2 : 3, .fine_order = of->order};
    while (out->fine_order < COARSE) out->fine_order += of->order;
    const session_nodes fine = session_complete_nodes(type, out->fine_order);
    out->fine_count = fine.count;
    bool is_made = session_make_interpolation(of, order, 1, is_lobatto, &out->nodes) &&
                   session_make_pattern(session_lagrange_type(type), &fine, INSITU_ORDER_LEXICOGRAPHIC, &out->pieces);
    if (is_box || type == GRID_WEDGE)
        is_made = is_made && make_factor(1, of->order, out->fine_order, is_lobatto && is_box, &out->line);
    if (!is_box)
        is_made = is_made && make_factor(type == GRID_TET ? 3 : 2, of->order, out->fine_order, false, &out->simplex);
    return is_made;
}

void session_drop_bound(session_bound *bound)
{
    session_drop_interpolation(&bound->nodes);
    session_drop_pattern(&bound->pieces);
    drop_factor(&bound->line);
    drop_factor(&bound->simplex);
}

/* ---- one cell -------------------------------------------------------------------------------------------------- */

/* A cell in the making. */
typedef struct bound_job {
    const session_bound *of;
    const session_isovalues *isovalues;
    double *nodes, *coefficients;       /* tuples: at the equispaced nodes, and in Bernstein's form */
    double *fine, *slopes[3];           /* tuples at the fine nodes, and their derivatives along the axes */
    double (*gradients)[3];             /* of the field at the fine nodes; not finite where the cell is flat */
    double *room;                       /* for products */
    double position_bound, value_bound; /* of the differences from interpolation in the whole cell */
} bound_job;

size_t session_bound_room(const session_bound *of)
{
    const size_t nodes = (size_t)of->nodes.complete.count, fine = (size_t)of->fine_count;
    return SIZE * (2 * nodes + 6 * fine) + 3 * fine;
}

static void place_arrays(bound_job *job, double *room)
{
    const size_t nodes = SIZE * (size_t)job->of->nodes.complete.count, fine = SIZE * (size_t)job->of->fine_count;
    job->nodes = room;
    job->coefficients = room += nodes;
    job->fine = room += nodes;
    for (int a = 0; a < 3; a++) job->slopes[a] = room += fine;
    room += fine;
    job->gradients = (double(*)[3])room;
    job->room = room + 3 * job->of->fine_count;
}

/* Multiplies each factor of a product with its matrix. size: number of numbers of a tuple. */
static void apply(const bound_job *job, int size, const double *const matrices[3], bool is_fine, const double *in,
                  double *out)
{
    const int count = count_factors(job->of->nodes.of.type);
    int inner = size, outer = 1;
    for (int f = 0; f < count; f++) outer *= factor_of(job->of, f)->node_count;
    for (int f = 0; f < count; f++) {
        const session_bound_factor *factor = factor_of(job->of, f);
        const int rows = is_fine ? factor->fine_count : factor->node_count;
        double *to = f == count - 1 ? out : job->room + f % 2 * SIZE * job->of->fine_count;
        outer /= factor->node_count;
        multiply(matrices[f], rows, factor->node_count, outer, inner, in, to);
        inner *= rows;
        in = to;
    }
}

/* Returns the bound of the difference from interpolation in a factor, by those of the second derivatives along edges
 * and along diagonals of octahedra. */
static double bound_factor(int dimensions, double along_edges, double along_diagonals)
{
    if (dimensions == 1) return along_edges / 8;
    if (dimensions == 2) return along_edges / 6;
    if (along_diagonals >= 2 * along_edges) return along_diagonals / 8;
    const double ratio = along_diagonals > along_edges ? along_diagonals / along_edges : 1;
    return along_edges / 8 * (1 + 1 / (3 - ratio));
}

/* Adds the bounds of the differences from interpolation in one factor. inner: number of doubles from one coefficient of
 * the factor to the next. */
static void add_factor(const bound_job *job, const session_bound_factor *factor, int inner, double sums[SIZE])
{
    const int p = job->of->nodes.of.order, all = SIZE * job->of->nodes.complete.count;
    double most[2][SIZE] = {{0}, {0}};
    for (int outer = 0; outer < all; outer += inner * factor->node_count)
        for (int d = 0; d < factor->difference_count; d++) {
            const session_second_difference *difference = &factor->differences[d];
            double *largest = most[difference->is_diagonal];
            for (int s = 0; s < inner; s++) {
                double sum = 0;
                for (int t = 0; t < difference->count; t++)
                    sum += difference->weights[t] * job->coefficients[outer + difference->nodes[t] * inner + s];
                largest[s % SIZE] = fmax(largest[s % SIZE], fabs(sum));
            }
        }
    for (int c = 0; c < SIZE; c++) sums[c] += p * (p - 1) * bound_factor(factor->dimensions, most[0][c], most[1][c]);
}

/* Completes the tuples of `size` numbers at the cell's nodes, and computes their Bernstein coefficients. */
static void find_coefficients(const bound_job *job, int size, const double *tuples)
{
    const double *matrices[3];
    for (int f = 0; f < count_factors(job->of->nodes.of.type); f++) matrices[f] = factor_of(job->of, f)->bernstein;
    session_complete_tuples(&job->of->nodes, size, tuples, job->nodes);
    apply(job, size, matrices, false, job->nodes, job->coefficients);
}

/* Computes the bounds of the differences from interpolation. */
static void bound_differences(bound_job *job)
{
    double sums[SIZE] = {0};
    int inner = SIZE;
    for (int f = 0; f < count_factors(job->of->nodes.of.type); f++) {
        add_factor(job, factor_of(job->of, f), inner, sums);
        inner *= factor_of(job->of, f)->node_count;
    }
    job->position_bound = vector3_length(sums);
    job->value_bound = sums[3];
}

/* Finds a sphere around the cell, whose positions are means of their coefficients. The radius is NaN if a coefficient
 * is not finite. */
static void find_sphere(const bound_job *job, session_cell_bound *out)
{
    double low[SIZE], high[SIZE], half[3], zero = 0;
    for (int c = 0; c < SIZE; c++) low[c] = high[c] = job->coefficients[c];
    for (int i = 0; i < SIZE * job->of->nodes.complete.count; i++) {
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

static bool is_any_between(const session_isovalues *isovalues, double low, double high)
{
    for (int i = 0; i < isovalues->count; i++)
        if (isovalues->values[i] >= low && isovalues->values[i] <= high) return true;
    return false;
}

/* Computes the gradient by the derivatives along the axes: for a cell with two axes, the one in its surface. */
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

static void find_gradients(bound_job *job)
{
    const session_bound *of = job->of;
    const int count = count_factors(of->nodes.of.type);
    const double *values[3], *matrices[3];
    int axis = 0;
    for (int f = 0; f < count; f++) values[f] = factor_of(of, f)->values;
    apply(job, SIZE, values, true, job->nodes, job->fine);
    for (int f = 0; f < count; f++)
        for (int a = 0; a < factor_of(of, f)->dimensions; a++, axis++) {
            memcpy(matrices, values, sizeof matrices);
            matrices[f] = factor_of(of, f)->slopes[a];
            apply(job, SIZE, matrices, true, job->nodes, job->slopes[axis]);
        }
    for (int n = 0; n < of->fine_count; n++) find_gradient(job, n, job->gradients[n]);
}

/* Returns a lower bound of the lengths of means of the gradients at a piece's corners; 0 if there is none. */
static double least_gradient(const bound_job *job, const int *corners, int count)
{
    double mean[3] = {0}, least = INFINITY;
    for (int c = 0; c < count; c++)
        for (int x = 0; x < 3; x++) mean[x] += job->gradients[corners[c]][x];
    const double length = vector3_length(mean);
    for (int c = 0; c < count; c++) least = fmin(least, vector3_dot(mean, job->gradients[corners[c]]) / length);
    return isfinite(length) && least > 0 ? least : 0;
}

static void bound_isosurface(bound_job *job, session_cell_bound *out)
{
    const session_bound *of = job->of;
    const int p = of->nodes.of.order, *corners = of->pieces.piece_positions;
    const double between = job->value_bound / (of->fine_order * of->fine_order);
    double least = INFINITY;
    find_gradients(job);
    for (int piece = 0; piece < of->pieces.piece_count; piece++) {
        const int count = grid_type_vertices(of->pieces.types[piece]);
        double low = INFINITY, high = -INFINITY;
        for (int c = 0; c < count; c++) {
            low = fmin(low, job->fine[SIZE * corners[c] + 3]);
            high = fmax(high, job->fine[SIZE * corners[c] + 3]);
        }
        if (is_any_between(job->isovalues, low - between, high + between))
            least = fmin(least, least_gradient(job, corners, count));
        corners += count;
    }
    const double size = 2 * out->radius / p, distance = job->value_bound / (p * p) / least;
    out->is_crossed = least < INFINITY;
    out->is_bounded = distance < size || job->value_bound == 0;
    out->error = (job->value_bound == 0 ? 0 : fmin(distance, size)) + job->position_bound / (p * p);
}

bool session_may_cross(const session_bound *of, const double *values, const session_isovalues *isovalues, double *room)
{
    bound_job job = {.of = of};
    double low = INFINITY, high = -INFINITY, zero = 0;
    place_arrays(&job, room);
    find_coefficients(&job, 1, values);
    for (int i = 0; i < of->nodes.complete.count; i++) {
        zero += 0 * job.coefficients[i]; /* NaN if a coefficient is not finite */
        low = fmin(low, job.coefficients[i]);
        high = fmax(high, job.coefficients[i]);
    }
    return zero == 0 && is_any_between(isovalues, low, high);
}

session_cell_bound session_bound_cell(const session_bound *of, const double *tuples, const session_isovalues *isovalues,
                                      double *room)
{
    bound_job job = {.of = of, .isovalues = isovalues};
    session_cell_bound out = {.is_bounded = true};
    const int p = of->nodes.of.order;
    place_arrays(&job, room);
    find_coefficients(&job, SIZE, tuples);
    find_sphere(&job, &out);
    out.is_crossed = isfinite(out.radius);
    if (!out.is_crossed) return out;
    bound_differences(&job);
    out.error = job.position_bound / (p * p);
    if (isovalues) bound_isosurface(&job, &out);
    return out;
}
