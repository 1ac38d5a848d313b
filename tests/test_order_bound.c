/* Compares the bounds of the difference between a cell of higher order and its linear pieces (the linear cells into
 * which it is split) with brute force. The polynomials of the cell are sums of powers, so that values, positions and
 * gradients are computed in closed form. The pieces are those of the pattern by which the library splits cells. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "session_bound.h"
#include "session_derivatives.h"
#include "session_shape.h"
#include "test_effort.h"
#include "test_mesh_order.h"

enum { MOST_POWER = 8, POWERS = MOST_POWER + 1, MOST_NODES = 729, MOST_PARTS = 3 };

/* A kind of cell: its nodes define the polynomials that it represents. */
typedef struct bound_kind {
    const char *name;
    session_nodes nodes;
    insitu_vertex_order order;
    bool is_lobatto;
} bound_kind;

static double draw_random_number(void)
{
    return 2 * (rand() / (RAND_MAX + 1.0)) - 1;
}

/* ---- polynomials ------------------------------------------------------------------------------------------------- */

/* Four functions as sums of powers of the reference coordinates: the three coordinates of the position, and a field. */
typedef struct cell_functions {
    int order;
    double weights[4][POWERS][POWERS][POWERS];
} cell_functions;

static bool is_in_polynomial_space(const session_nodes *of, const int q[3])
{
    const int p = of->order, plane = q[0] + q[1];
    switch (of->type) {
    case GRID_TET: return plane + q[2] <= p;
    case GRID_TRIANGLE: return plane <= p && q[2] == 0;
    case GRID_WEDGE:
        return of->is_complete ? plane <= p && q[2] <= p : (plane <= 2 && q[2] <= 1) || (plane <= 1 && q[2] <= 2);
    case GRID_QUAD:
        if (of->is_complete) return q[0] <= p && q[1] <= p && q[2] == 0;
        return q[0] <= 2 && q[1] <= 2 && q[2] == 0 && plane < 4;
    default:
        if (of->is_complete) return q[0] <= p && q[1] <= p && q[2] <= p;
        return q[0] <= 2 && q[1] <= 2 && q[2] <= 2 && (q[0] == 2) + (q[1] == 2) + (q[2] == 2) <= 1;
    }
}

/* Computes the value of a function at a point, or its derivative along an axis if axis is not negative. */
static double evaluate_function(const cell_functions *of, int function, const double at[3], int axis)
{
    double powers[3][POWERS], sum = 0;
    for (int a = 0; a < 3; a++) {
        double power = 1;
        for (int q = 0; q <= of->order; q++, power *= at[a]) powers[a][q] = power;
        for (int q = of->order; q >= 0 && a == axis; q--) powers[a][q] = q ? q * powers[a][q - 1] : 0;
    }
    for (int k = 0; k <= of->order; k++)
        for (int j = 0; j <= of->order; j++)
            for (int i = 0; i <= of->order; i++)
                sum += of->weights[function][k][j][i] * powers[0][i] * powers[1][j] * powers[2][k];
    return sum;
}

/* Adds random terms of order 2 and more to a function. fall: factor by which terms decrease with each order. */
static void add_terms(const session_nodes *of, int function, double size, double fall, cell_functions *out)
{
    for (int i = 0; i < POWERS * POWERS * POWERS; i++) {
        const int q[3] = {i % POWERS, i / POWERS % POWERS, i / POWERS / POWERS}, sum = q[0] + q[1] + q[2];
        if (sum > 1 && is_in_polynomial_space(of, q))
            out->weights[function][q[2]][q[1]][q[0]] += size * draw_random_number() * pow(fall, sum - 2);
    }
}

static void add_linear_terms(int function, const double slopes[3], cell_functions *out)
{
    out->weights[function][0][0][1] += slopes[0];
    out->weights[function][0][1][0] += slopes[1];
    out->weights[function][1][0][0] += slopes[2];
}

/* ---- cells ------------------------------------------------------------------------------------------------------- */

static void place_node(const bound_kind *kind, int i, int j, int k, double out[3])
{
    double line[NODES_MOST_ORDER + 1];
    session_compute_node_positions(kind->nodes.order, kind->is_lobatto, line);
    out[0] = line[i];
    out[1] = line[j];
    out[2] = line[k];
}

static void make_tuples(const bound_kind *kind, const cell_functions *of, double (*tuples)[4])
{
    const int p = kind->nodes.order;
    for (int i = 0; i < (p + 1) * (p + 1) * (p + 1); i++) {
        const int n[3] = {i % (p + 1), i / (p + 1) % (p + 1), i / (p + 1) / (p + 1)};
        if (!session_has_node(&kind->nodes, n[0], n[1], n[2])) continue;
        const int at = session_find_node_in_connectivity(&kind->nodes, kind->order, n[0], n[1], n[2]);
        double place[3];
        place_node(kind, n[0], n[1], n[2], place);
        for (int f = 0; f < 4 && at < kind->nodes.count; f++) tuples[at][f] = evaluate_function(of, f, place, -1);
    }
}

/* A cell that is cut into linear pieces, with `parts` pieces between two neighbouring nodes. */
typedef struct cut_cell {
    int order; /* order of the finer lattice of nodes */
    session_pattern pattern;
    /* reference coordinates of the finer lattice's nodes; tuples: position and field at the nodes */
    double (*places)[3];
    double (*tuples)[4];
} cut_cell;

static void cut_cell_into_pieces(const bound_kind *kind, const cell_functions *of, int parts, cut_cell *out)
{
    const int type = kind->nodes.type, r = parts * kind->nodes.order;
    const session_nodes fine = session_describe_complete_nodes(type, r);
    out->order = r;
    out->places = malloc((size_t)fine.count * sizeof *out->places);
    out->tuples = malloc((size_t)fine.count * sizeof *out->tuples);
    assert_true(
        session_make_split_pattern(session_lagrange_type(type), &fine, INSITU_ORDER_LEXICOGRAPHIC, &out->pattern));
    for (int i = 0; i < (r + 1) * (r + 1) * (r + 1); i++) {
        const int n[3] = {i % (r + 1), i / (r + 1) % (r + 1), i / (r + 1) / (r + 1)};
        if (!session_has_node(&fine, n[0], n[1], n[2])) continue;
        const int at = session_find_node_in_connectivity(&fine, INSITU_ORDER_LEXICOGRAPHIC, n[0], n[1], n[2]);
        for (int a = 0; a < 3; a++) out->places[at][a] = (double)n[a] / r;
        for (int f = 0; f < 4; f++) out->tuples[at][f] = evaluate_function(of, f, out->places[at], -1);
    }
}

static void free_cut(cut_cell *of)
{
    session_drop_split_pattern(&of->pattern);
    free(of->places);
    free(of->tuples);
}

/* Chooses a random point of a piece. Its coordinates are measured along the piece's edges from the first corner. */
static void choose_point_in_piece(int type, double out[3])
{
    const bool is_flat = type == GRID_TRIANGLE || type == GRID_QUAD;
    double sum;
    do {
        for (int a = 0; a < 3; a++) out[a] = is_flat && a == 2 ? 0 : 0.5 + 0.5 * draw_random_number();
        sum = type == GRID_HEX || type == GRID_QUAD ? 0 : out[0] + out[1] + (type == GRID_TET ? out[2] : 0);
    } while (sum > 1);
}

/* Computes the weights with which a piece interpolates between its corners. */
static void compute_corner_weights(int type, const double at[3], double weights[8])
{
    const session_shape *shape = session_get_cell_shape(type);
    for (int c = 0; c < 8; c++) {
        const signed char *corner = shape->corners[c];
        weights[c] = 1;
        if (type == GRID_HEX || type == GRID_QUAD)
            for (int a = 0; a < 3; a++) weights[c] *= corner[a] ? at[a] : 1 - at[a];
        else {
            const double last = 1 - at[0] - at[1] - (type == GRID_TET ? at[2] : 0);
            weights[c] = corner[0] ? at[0] : corner[1] ? at[1] : type == GRID_TET && corner[2] ? at[2] : last;
            if (type == GRID_WEDGE) weights[c] *= corner[2] ? at[2] : 1 - at[2];
        }
        if (c >= shape->corner_count) weights[c] = 0;
    }
}

/* A point of a piece: its reference coordinates, and the interpolated position and field. */
typedef struct piece_point {
    double at[3], tuple[4];
} piece_point;

static piece_point interpolate_in_piece(const cut_cell *of, int type, const int *corners, const double local[3])
{
    piece_point out = {{0}, {0}};
    const int count = grid_type_vertex_count(type);
    double weights[8];
    compute_corner_weights(type, local, weights);
    for (int c = 0; c < count; c++) {
        for (int a = 0; a < 3; a++) out.at[a] += weights[c] * of->places[corners[c]][a];
        for (int f = 0; f < 4; f++) out.tuple[f] += weights[c] * of->tuples[corners[c]][f];
    }
    return out;
}

/* ---- bounds of positions ----------------------------------------------------------------------------------------- */

/* Returns the bound of a cell; the error of the surface is the smallest one that any level of subdivision of the bound
 * gives. */
static session_cell_bound compute_smallest_bound(const bound_kind *kind, const cell_functions *of,
                                                 const session_isovalues *isovalues)
{
    static double tuples[MOST_NODES][4];
    session_bound bound;
    assert_true(session_make_bound(&kind->nodes, kind->order, kind->is_lobatto, &bound));
    double *room = malloc(session_bound_work_size(&bound) * sizeof *room);
    make_tuples(kind, of, tuples);
    session_cell_bound out = session_bound_cell_errors(&bound, tuples[0], isovalues, 0, room);
    for (int level = 1; level < bound.level_count && isovalues; level++)
        out.surface_error =
            fmin(out.surface_error, session_bound_cell_errors(&bound, tuples[0], isovalues, level, room).surface_error);
    double values[MOST_NODES];
    for (int n = 0; n < kind->nodes.count && isovalues; n++) values[n] = tuples[n][3];
    out.is_crossed =
        out.is_crossed && (!isovalues || session_may_isosurface_cross_cell(&bound, values, isovalues, room));
    free(room);
    session_drop_bound(&bound);
    return out;
}

/* Returns the largest distance between the positions that pieces and the polynomial assign to random points. */
static double find_largest_position_error(const cell_functions *functions, const cut_cell *of, int points)
{
    double worst = 0;
    const int *corners = of->pattern.piece_positions;
    for (int piece = 0; piece < of->pattern.piece_count; piece++) {
        const int count = grid_type_vertex_count(of->pattern.types[piece]);
        for (int n = 0; n < points; n++) {
            double local[3], square = 0;
            choose_point_in_piece(of->pattern.types[piece], local);
            const piece_point point = interpolate_in_piece(of, of->pattern.types[piece], corners, local);
            for (int a = 0; a < 3; a++)
                square += pow(point.tuple[a] - evaluate_function(functions, a, point.at, -1), 2);
            worst = fmax(worst, sqrt(square));
        }
        corners += count;
    }
    return worst;
}

static void check_positions(const bound_kind *kind, double fall, double ratios[2])
{
    cell_functions *of = calloc(1, sizeof *of);
    of->order = kind->nodes.order;
    for (int f = 0; f < 3; f++) add_terms(&kind->nodes, f, 1, fall, of);
    const session_cell_bound bound = compute_smallest_bound(kind, of, NULL);
    for (int parts = 1; parts <= MOST_PARTS && parts * of->order <= 16; parts++) {
        cut_cell pieces;
        cut_cell_into_pieces(kind, of, parts, &pieces);
        const double shift = find_largest_position_error(of, &pieces, 8) * parts * parts;
        if (!(shift <= bound.position_error * (1 + 1e-9)))
            fprintf(stderr, "%s, %d parts: positions are off by %g, and the bound is %g\n", kind->name, parts, shift,
                    bound.position_error);
        assert_true(shift <= bound.position_error * (1 + 1e-9));
        if (parts == 1) ratios[0] = fmin(ratios[0], bound.position_error / shift);
        if (parts == 1) ratios[1] = fmax(ratios[1], bound.position_error / shift);
        free_cut(&pieces);
    }
    free(of);
}

static const struct named_shape {
    const char *name;
    int type, most_order;
} shapes[] = {{"triangle", GRID_TRIANGLE, 6},
              {"quad", GRID_QUAD, 6},
              {"tet", GRID_TET, 5},
              {"wedge", GRID_WEDGE, 4},
              {"hex", GRID_HEX, 4}};

/* Lists the kinds that are tested: all cell types with all of their nodes, serendipity cells, and hexes with
 * Gauss-Lobatto nodes. Returns their number. */
static int list_kinds(bound_kind *out)
{
    int count = 0;
    for (size_t s = 0; s < sizeof shapes / sizeof shapes[0]; s++)
        for (int order = 2; order <= shapes[s].most_order; order++)
            out[count++] = (bound_kind){shapes[s].name, session_describe_complete_nodes(shapes[s].type, order),
                                        INSITU_ORDER_LEXICOGRAPHIC, false};
    out[count++] = (bound_kind){"hex, Gauss-Lobatto", session_describe_complete_nodes(GRID_HEX, 4),
                                INSITU_ORDER_LEXICOGRAPHIC, true};
    out[count++] = (bound_kind){"hex, Gauss-Lobatto", session_describe_complete_nodes(GRID_HEX, 7),
                                INSITU_ORDER_LEXICOGRAPHIC, true};
    static const int serendipity[][2] = {
        {INSITU_QUADRATIC_QUAD, 8}, {INSITU_QUADRATIC_HEX, 20}, {INSITU_QUADRATIC_WEDGE, 15}};
    for (int i = 0; i < 3; i++, count++) {
        out[count] = (bound_kind){.name = "serendipity", .order = INSITU_ORDER_VTK};
        assert_true(session_describe_nodes(serendipity[i][0], serendipity[i][1], &out[count].nodes));
    }
    return count;
}

static void positions_are_within_the_bound(void **state)
{
    (void)state;
    bound_kind kinds[40];
    const int count = list_kinds(kinds), cells = test_case_count(2, 60);
    for (int k = 0; k < count; k++)
        for (int smooth = 0; smooth < 2; smooth++) {
            double ratios[2] = {INFINITY, 0};
            for (int n = 0; n < cells; n++) check_positions(&kinds[k], smooth ? 0.3 : 1, ratios);
            printf("%s of order %d, %s: bound / largest difference found %.1f to %.1f\n", kinds[k].name,
                   kinds[k].nodes.order, smooth ? "smooth" : "rough", ratios[0], ratios[1]);
        }
}

/* ---- bounds of isosurfaces --------------------------------------------------------------------------------------- */

/* Computes the inverse of the matrix whose columns are the derivatives of the position along the axes, and the field's
 * gradient. Returns the matrix's determinant. */
static double find_gradient(const cell_functions *of, const double at[3], double inverse[3][3], double gradient[3])
{
    double m[3][3], slopes[3];
    for (int a = 0; a < 3; a++) {
        for (int f = 0; f < 3; f++) m[f][a] = evaluate_function(of, f, at, a);
        slopes[a] = evaluate_function(of, 3, at, a);
    }
    double determinant = 0;
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++) {
            const int r1 = (r + 1) % 3, r2 = (r + 2) % 3, c1 = (c + 1) % 3, c2 = (c + 2) % 3;
            inverse[c][r] = m[r1][c1] * m[r2][c2] - m[r1][c2] * m[r2][c1];
        }
    for (int a = 0; a < 3; a++) determinant += m[0][a] * inverse[a][0];
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++) inverse[r][c] /= determinant;
    for (int x = 0; x < 3; x++)
        gradient[x] = slopes[0] * inverse[0][x] + slopes[1] * inverse[1][x] + slopes[2] * inverse[2][x];
    return determinant;
}

/* Moves a point of the cell along the field's gradient to the position at which the polynomial has the value. Returns
 * the distance of this position from `from`, or infinity if the iteration does not converge. */
static double compute_distance_to_surface(const cell_functions *of, const double start[3], double value,
                                          const double from[3])
{
    double at[3] = {start[0], start[1], start[2]}, rest = INFINITY, square = 0;
    for (int step = 0; step < 60 && fabs(rest) > 1e-13; step++) {
        double inverse[3][3], gradient[3], length = 0;
        find_gradient(of, at, inverse, gradient);
        rest = evaluate_function(of, 3, at, -1) - value;
        for (int x = 0; x < 3; x++) length += gradient[x] * gradient[x];
        for (int a = 0; a < 3; a++)
            for (int x = 0; x < 3; x++) at[a] -= inverse[a][x] * gradient[x] * rest / length;
    }
    for (int x = 0; x < 3; x++) square += pow(evaluate_function(of, x, at, -1) - from[x], 2);
    return fabs(rest) < 1e-12 ? sqrt(square) : INFINITY;
}

/* Finds a point of a piece at which the interpolated field has the value, by bisection between two random points.
 * Returns false if the field does not cross the value between them. */
static bool find_crossing(const cut_cell *of, int type, const int *corners, double value, piece_point *out)
{
    double ends[2][3], middle[3];
    choose_point_in_piece(type, ends[0]);
    choose_point_in_piece(type, ends[1]);
    const bool is_above = interpolate_in_piece(of, type, corners, ends[0]).tuple[3] > value;
    if (is_above == (interpolate_in_piece(of, type, corners, ends[1]).tuple[3] > value)) return false;
    for (int turn = 0; turn < 60; turn++) {
        for (int a = 0; a < 3; a++) middle[a] = 0.5 * (ends[0][a] + ends[1][a]);
        *out = interpolate_in_piece(of, type, corners, middle);
        memcpy(ends[(out->tuple[3] > value) != is_above], middle, sizeof middle);
    }
    return true;
}

/* Returns the largest distance between the isosurface of the pieces and that of the polynomial, over random points.
 * Returns -1 if there are no points. */
static double find_largest_surface_distance(const cell_functions *functions, const cut_cell *of, double value)
{
    double worst = -1;
    const int *corners = of->pattern.piece_positions;
    for (int piece = 0; piece < of->pattern.piece_count; piece++) {
        const int type = of->pattern.types[piece];
        for (int n = 0; n < 12; n++) {
            piece_point point;
            if (find_crossing(of, type, corners, value, &point))
                worst = fmax(worst, compute_distance_to_surface(functions, point.at, value, point.tuple));
        }
        corners += grid_type_vertex_count(type);
    }
    return worst;
}

/* Results over the cells of a kind. unbounded: cells whose bound is not smaller than the cell. */
typedef struct surface_tally {
    int crossed, unbounded;
    double least, most; /* least and most: smallest and largest ratio of the bound to the largest distance */
} surface_tally;

static void check_surface(const bound_kind *kind, const cell_functions *of, surface_tally *tally)
{
    const double inside[3] = {0.2 + 0.1 * draw_random_number(), 0.3 + 0.2 * draw_random_number(),
                              0.25 + 0.2 * draw_random_number()};
    const double value = evaluate_function(of, 3, inside, -1);
    const session_cell_bound bound = compute_smallest_bound(kind, of, &(session_isovalues){1, &value, 0});
    assert_true(bound.is_crossed);
    tally->crossed++;
    const bool is_bounded = bound.surface_error < 2 * bound.radius / of->order;
    tally->unbounded += !is_bounded;
    for (int parts = 1; parts <= MOST_PARTS && is_bounded && parts * of->order <= 12; parts++) {
        cut_cell pieces;
        cut_cell_into_pieces(kind, of, parts, &pieces);
        const double distance = find_largest_surface_distance(of, &pieces, value) * parts * parts;
        if (!(distance <= bound.surface_error))
            fprintf(stderr, "%s of order %d, %d parts: the surface is off by %g, and the bound is %g\n", kind->name,
                    of->order, parts, distance, bound.surface_error);
        assert_true(distance <= bound.surface_error);
        if (distance > 0) tally->least = fmin(tally->least, bound.surface_error / distance);
        if (distance > 0 && parts == 1) tally->most = fmax(tally->most, bound.surface_error / distance);
        free_cut(&pieces);
    }
}

/* Makes a cell that is bent and stretched along an axis, with a field that is mostly linear. */
static void make_surface(const bound_kind *kind, double curved, double fall, cell_functions *out)
{
    *out = (cell_functions){.order = kind->nodes.order};
    for (int f = 0; f < 3; f++) {
        double slopes[3];
        for (int a = 0; a < 3; a++) slopes[a] = (f == a) + 0.2 * draw_random_number();
        if (f == 0) slopes[0] *= 10;
        add_linear_terms(f, slopes, out);
        add_terms(&kind->nodes, f, 0.05, fall, out);
    }
    const double slopes[3] = {draw_random_number(), draw_random_number(), draw_random_number()};
    add_linear_terms(3, slopes, out);
    add_terms(&kind->nodes, 3, curved, fall, out);
}

static void isosurfaces_are_within_the_bound(void **state)
{
    (void)state;
    static const double curves[] = {0.05, 0.2, 0.6};
    bound_kind kinds[40];
    const int count = list_kinds(kinds), cells = test_case_count(3, 200);
    cell_functions *of = malloc(sizeof *of);
    for (int k = 0; k < count; k++) {
        if (kinds[k].nodes.type == GRID_TRIANGLE || kinds[k].nodes.type == GRID_QUAD) continue;
        for (int c = 0; c < 3; c++) {
            surface_tally tally = {0, 0, INFINITY, 0};
            for (int n = 0; n < cells; n++) {
                make_surface(&kinds[k], curves[c], 0.3, of);
                check_surface(&kinds[k], of, &tally);
            }
            printf("%s of order %d, terms of %g: bound / distance %.2f to %.1f; %d of %d cells have no bound\n",
                   kinds[k].name, kinds[k].nodes.order, curves[c], tally.least, tally.most, tally.unbounded,
                   tally.crossed);
        }
    }
    free(of);
}

/* ---- other cases ------------------------------------------------------------------------------------------------- */

/* Checks an isovalue between the values at nodes. The field (x - 0.3)^2 has an extremum between its nodes, so that its
 * values at the nodes do not show that it crosses 0.01. */
static void crossings_between_nodes_are_found(void **state)
{
    (void)state;
    const bound_kind kind = {"hex", session_describe_complete_nodes(GRID_HEX, 2), INSITU_ORDER_LEXICOGRAPHIC, false};
    cell_functions *of = calloc(1, sizeof *of);
    of->order = 2;
    for (int f = 0; f < 3; f++) add_linear_terms(f, (const double[]){f == 0, f == 1, f == 2}, of);
    of->weights[3][0][0][2] = 1; /* (x - 0.3)^2 */
    of->weights[3][0][0][1] = -0.6;
    of->weights[3][0][0][0] = 0.09;
    const double values[] = {0.01, -0.02, 0.5};
    assert_true(compute_smallest_bound(&kind, of, &(session_isovalues){1, &values[0], 0}).is_crossed);
    assert_false(compute_smallest_bound(&kind, of, &(session_isovalues){1, &values[1], 0}).is_crossed);
    assert_false(compute_smallest_bound(&kind, of, &(session_isovalues){1, &values[2], 0}).is_crossed);
    assert_false(compute_smallest_bound(&kind, of, &(session_isovalues){0, NULL, 0}).is_crossed);
    free(of);
}

/* Checks that the bound is 0 if positions and field are linear. */
static void linear_cells_have_no_error(void **state)
{
    (void)state;
    bound_kind kinds[40];
    const int count = list_kinds(kinds);
    cell_functions *of = malloc(sizeof *of);
    for (int k = 0; k < count; k++) {
        *of = (cell_functions){.order = kinds[k].nodes.order};
        for (int f = 0; f < 4; f++) add_linear_terms(f, (const double[]){f == 0, f == 1 || f == 3, f == 2}, of);
        const double value = 0.25;
        const session_cell_bound bound = compute_smallest_bound(&kinds[k], of, &(session_isovalues){1, &value, 0});
        assert_true(bound.is_crossed && bound.surface_error < 1e-11);
    }
    free(of);
}

static void cells_with_infinite_values_have_no_bound(void **state)
{
    (void)state;
    const bound_kind kind = {"hex", session_describe_complete_nodes(GRID_HEX, 2), INSITU_ORDER_LEXICOGRAPHIC, false};
    cell_functions *of = calloc(1, sizeof *of);
    const double value = 0.25;
    of->order = 2;
    for (int f = 0; f < 4; f++) add_linear_terms(f, (const double[]){f == 0 || f == 3, f == 1, f == 2}, of);
    assert_true(compute_smallest_bound(&kind, of, &(session_isovalues){1, &value, 0}).is_crossed);
    of->weights[3][0][0][0] = NAN;
    assert_false(compute_smallest_bound(&kind, of, &(session_isovalues){1, &value, 0}).is_crossed);
    free(of);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(positions_are_within_the_bound),           cmocka_unit_test(isosurfaces_are_within_the_bound),
        cmocka_unit_test(crossings_between_nodes_are_found),        cmocka_unit_test(linear_cells_have_no_error),
        cmocka_unit_test(cells_with_infinite_values_have_no_bound),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
