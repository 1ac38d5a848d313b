/* Checks integrals over cells of higher order. Quadrature rules must be exact for all monomials of their degree. Then
 * positions and values of cells are polynomials with random coefficients that the kind of cell represents. The sums
 * over the cells that fill a cube must equal the integrals that a tensor product of Gauss points gives over the whole
 * cube. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "session_cell_rules.h"
#include "test_mesh_order.h"

static double zero_field(const double p[3])
{
    return p[0];
}

/* ---- quadrature rules -------------------------------------------------------------------------------------------- */

/* Returns the integral of a monomial over the unit simplex: a! b! c! / (a + b + c + dimensions)! (Dirichlet). */
static double integrate_monomial(int dimensions, const int powers[3])
{
    const int all = powers[0] + powers[1] + powers[2] + dimensions;
    return exp(lgamma(powers[0] + 1) + lgamma(powers[1] + 1) + lgamma(powers[2] + 1) - lgamma(all + 1));
}

/* Checks a rule with per_axis points along each axis. The tolerance covers two errors of equal size: powers of up to 2
 * n - 1 multiply the rounding errors of points, about 1e-16, by the power, and lgamma() loses as many digits. */
static void check_rule(int dimensions, int per_axis)
{
    session_quadrature rule;
    const int degree = 2 * per_axis - 1, step = 1 + degree / 9;
    assert_true(session_make_quadrature(dimensions, per_axis, &rule));
    for (int c = 0; c <= (dimensions > 2 ? degree : 0); c += step)
        for (int b = 0; b <= (dimensions > 1 ? degree - c : 0); b += step) {
            const int powers[3] = {degree - b - c, b, c};
            double sum = 0;
            for (int n = 0; n < rule.count; n++)
                sum += rule.weights[n] * pow(rule.points[n][0], powers[0]) * pow(rule.points[n][1], b) *
                       pow(rule.points[n][2], c);
            const double expected = integrate_monomial(dimensions, powers);
            if (!(fabs(sum - expected) <= 4e-15 * (degree + 10) * expected))
                fail_msg("%d dimensions, %d points: %.17g, expected %.17g", dimensions, per_axis, sum, expected);
        }
    session_drop_quadrature(&rule);
}

static void rules_are_exact_for_their_degree(void **state)
{
    (void)state;
    for (int n = 1; n <= QUADRATURE_MOST_POINTS; n += n < 24 ? 1 : 13) {
        check_rule(1, n);
        check_rule(2, n);
        if (n <= 24) check_rule(3, n);
    }
}

/* ---- polynomials of a kind of cell ------------------------------------------------------------------------------- */

enum { MOST_TERMS = 8 * 8 * 8, FUNCTIONS = 4 };

/* The three coordinates of the position and a value, as sums of monomials. */
typedef struct polynomials {
    int count;
    int powers[MOST_TERMS][3];
    double factors[MOST_TERMS][FUNCTIONS];
} polynomials;

static bool is_in_polynomial_space(const session_nodes *of, const int q[3])
{
    const int p = of->order, plane = q[0] + q[1];
    if (of->type == GRID_TET) return plane + q[2] <= p;
    if (of->type == GRID_WEDGE)
        return of->is_complete ? plane <= p : (plane <= 2 && q[2] <= 1) || (plane <= 1 && q[2] <= 2);
    return of->is_complete || (q[0] == 2) + (q[1] == 2) + (q[2] == 2) <= 1;
}

static double draw_random_number(unsigned *seed)
{
    *seed = *seed * 1664525u + 1013904223u;
    return (*seed >> 8) * 0x1p-23 - 1;
}

/* Makes random polynomials. bend: size of the terms of positions. Terms of total power n are divided by (1 + n)^2, so
 * that the maps have an inverse. */
static void make_polynomials(const session_nodes *of, double bend, unsigned seed, polynomials *out)
{
    const int size = of->order + 1;
    out->count = 0;
    for (int n = 0; n < size * size * size; n++) {
        const int q[3] = {n % size, n / size % size, n / size / size}, all = q[0] + q[1] + q[2];
        if (!is_in_polynomial_space(of, q)) continue;
        for (int f = 0; f < FUNCTIONS; f++) {
            const double random = draw_random_number(&seed);
            out->factors[out->count][f] = f < 3 ? bend * random / ((1 + all) * (1 + all)) + (all == 1 && q[f]) : random;
        }
        memcpy(out->powers[out->count++], q, sizeof q);
    }
}

static double compute_integer_power(double x, int power)
{
    double out = 1;
    for (int n = 0; n < power; n++) out *= x;
    return out;
}

static double evaluate_term(const int powers[3], const double at[3], int derived)
{
    double value = 1;
    for (int a = 0; a < 3; a++)
        value *= a != derived ? compute_integer_power(at[a], powers[a])
                 : powers[a]  ? powers[a] * compute_integer_power(at[a], powers[a] - 1)
                              : 0;
    return value;
}

/* Evaluates a function, or its derivative along the axis `derived` if derived is not negative. */
static double evaluate_function(const polynomials *of, int function, const double at[3], int derived)
{
    double sum = 0;
    for (int t = 0; t < of->count; t++) sum += of->factors[t][function] * evaluate_term(of->powers[t], at, derived);
    return sum;
}

typedef struct integrals {
    double volume, first, second;
} integrals;

static void add_points(void *of, int count, const double *measures, const double *values)
{
    integrals *sums = of;
    for (int i = 0; i < count; i++) {
        sums->volume += measures[i];
        sums->first += measures[i] * values[i];
        sums->second += measures[i] * values[i] * values[i];
    }
}

/* Integrates over the cube [-1, 1]^3 with the given number of Gauss points along each axis and with derivatives in
 * closed form. */
static integrals integrate_cube(const polynomials *of, int points)
{
    integrals out = {0};
    session_quadrature line;
    assert_true(session_make_quadrature(1, points, &line));
    for (int n = 0; n < points * points * points; n++) {
        const int at[3] = {n % points, n / points % points, n / points / points};
        double x[3], d[3][3], weight = 8;
        for (int a = 0; a < 3; a++) {
            x[a] = 2 * line.points[at[a]][0] - 1;
            weight *= line.weights[at[a]];
        }
        for (int a = 0; a < 3; a++)
            for (int f = 0; f < 3; f++) d[a][f] = evaluate_function(of, f, x, a);
        for (int a = 0; a < 3; a++) {
            const int b = (a + 1) % 3, c = (a + 2) % 3;
            const double measure = weight * d[0][a] * (d[1][b] * d[2][c] - d[1][c] * d[2][b]);
            const double value = evaluate_function(of, 3, x, -1);
            add_points(&out, 1, &measure, &value);
        }
    }
    session_drop_quadrature(&line);
    return out;
}

/* Compares two integrals. The tolerance covers the rounding by 1e-16 in sums over up to 1e5 points and 512 nodes. The
 * rounding errors add up randomly, and the squares of values are up to about ten times their mean. */
static bool is_nearly_equal(double sum, double expected, double size)
{
    return fabs(sum - expected) <= 1e-12 * size;
}

static void check_integrals(const char *name, const integrals *sums, const integrals *expected)
{
    const double size = expected->volume + expected->second;
    if (is_nearly_equal(sums->volume, expected->volume, size) && is_nearly_equal(sums->first, expected->first, size) &&
        is_nearly_equal(sums->second, expected->second, size))
        return;
    fail_msg("%s: %.16g %.16g %.16g, expected %.16g %.16g %.16g", name, sums->volume, sums->first, sums->second,
             expected->volume, expected->first, expected->second);
}

/* Compares the sum of the integrals of `cells` cells with the integral over the cube. places: positions of the cells'
 * nodes in the cube before they are moved. */
static void check_cells(const char *name, const session_cell_rules *rules, const double *places, int cells,
                        const polynomials *of)
{
    const int nodes = rules->nodes.of.count;
    double *tuples = malloc((size_t)nodes * 4 * sizeof *tuples);
    double *work = malloc(session_cell_rules_work_size(rules) * sizeof *work);
    integrals sums = {0};
    for (int cell = 0; cell < cells; cell++) {
        for (int n = 0; n < nodes; n++)
            for (int f = 0; f < FUNCTIONS; f++)
                tuples[4 * n + f] = evaluate_function(of, f, places + 3 * (cell * nodes + n), -1);
        session_visit_quadrature_points(rules, tuples, work, add_points, &sums);
    }
    const integrals expected = integrate_cube(of, (5 * rules->nodes.of.order + 1) / 2 + 1);
    check_integrals(name, &sums, &expected);
    free(tuples);
    free(work);
}

static void check_kind(const char *name, const session_nodes *nodes, insitu_vertex_order order, bool is_lobatto,
                       const double *places, int cells)
{
    static polynomials of;
    session_cell_rules rules;
    assert_true(session_make_cell_rules(nodes, order, is_lobatto, &rules));
    for (unsigned seed = 0; seed < 3; seed++) {
        make_polynomials(nodes, seed == 0 ? 0 : 0.2, seed, &of);
        check_cells(name, &rules, places, cells, &of);
    }
    session_drop_cell_rules(&rules);
}

static void cell_integrals_match_their_polynomials(void **state)
{
    (void)state;
    for (int k = 0; k < order_kind_count; k++) {
        const order_kind *kind = &order_kinds[k];
        order_mesh mesh;
        session_nodes nodes;
        if (strstr(kind->name, "pyramid")) continue;
        order_mesh_create(kind, 1, 0, zero_field, 0, 1, &mesh);
        assert_true(session_describe_nodes((int)kind->type, mesh.nodes, &nodes));
        double *places = malloc((size_t)(mesh.cell_count * mesh.nodes) * 3 * sizeof *places);
        for (int64_t i = 0; i < mesh.cell_count * mesh.nodes; i++)
            memcpy(places + 3 * i, mesh.coordinates + 3 * mesh.connectivity[i], 3 * sizeof *places);
        check_kind(kind->name, &nodes, kind->layout, false, places, (int)mesh.cell_count);
        free(places);
        order_mesh_free(&mesh);
    }
}

/* ---- Gauss-Lobatto nodes and high orders ------------------------------------------------------------------------- */

static void cells_between_lobatto_points_are_exact(void **state)
{
    (void)state;
    static const double of4[5] = {-1, -0.654653670707977144, 0, 0.654653670707977144, 1};
    static const double of7[8] = {-1,
                                  -0.871740148509606615,
                                  -0.591700181433142302,
                                  -0.209299217902478869,
                                  0.209299217902478869,
                                  0.591700181433142302,
                                  0.871740148509606615,
                                  1};
    static double places[8 * 8 * 8 * 3];
    for (int way = 0; way < 2; way++) {
        const int p = way ? 7 : 4, size = p + 1;
        const double *line = way ? of7 : of4;
        const session_nodes nodes = session_describe_complete_nodes(GRID_HEX, p);
        for (int n = 0; n < nodes.count; n++) {
            const int at[3] = {n % size, n / size % size, n / size / size};
            for (int a = 0; a < 3; a++) places[3 * n + a] = line[at[a]];
        }
        check_kind(way ? "hex 7" : "hex 4", &nodes, INSITU_ORDER_LEXICOGRAPHIC, true, places, 1);
    }
}

/* Checks bent tets of order 7, the highest order for which the rule is exact. Six of them fill the cube. */
static void bent_tets_of_order_7_are_exact(void **state)
{
    (void)state;
    enum { ORDER = 7, NODES = 120 };
    static const signed char cells[6][4] = {{0, 1, 3, 7}, {0, 3, 2, 7}, {0, 2, 6, 7},
                                            {0, 6, 4, 7}, {0, 4, 5, 7}, {0, 5, 1, 7}};
    static double places[6 * NODES][3];
    const session_nodes nodes = session_describe_complete_nodes(GRID_TET, ORDER);
    int count = 0;
    for (int cell = 0; cell < 6; cell++)
        for (int k = 0; k <= ORDER; k++)
            for (int j = 0; j <= ORDER - k; j++)
                for (int i = 0; i <= ORDER - k - j; i++, count++) {
                    const int weights[4] = {ORDER - i - j - k, i, j, k};
                    for (int a = 0; a < 3; a++) {
                        places[count][a] = -1;
                        for (int c = 0; c < 4; c++)
                            places[count][a] += 2. / ORDER * weights[c] * (cells[cell][c] >> a & 1);
                    }
                }
    check_kind("tet 7", &nodes, INSITU_ORDER_LEXICOGRAPHIC, false, places[0], 6);
}

/* Checks the volumes of straight tets of orders up to 12. Functions of order 12 have too many values to be stored, and
 * are computed for each cell. Interpolation between equidistant nodes of order 12 multiplies the rounding errors of
 * values by about 100. */
static void volumes_of_high_order_cells_are_exact(void **state)
{
    (void)state;
    for (int p = 6; p <= 12; p += 3) {
        const session_nodes nodes = session_describe_complete_nodes(GRID_TET, p);
        session_cell_rules rules;
        integrals sums = {0};
        assert_true(session_make_cell_rules(&nodes, INSITU_ORDER_LEXICOGRAPHIC, false, &rules));
        double *tuples = malloc((size_t)nodes.count * 4 * sizeof *tuples);
        double *work = malloc(session_cell_rules_work_size(&rules) * sizeof *work);
        double *tuple = tuples;
        for (int k = 0; k <= p; k++)
            for (int j = 0; j <= p - k; j++)
                for (int i = 0; i <= p - k - j; i++, tuple += 4) {
                    const double at[3] = {(double)i / p, (double)j / p, (double)k / p};
                    memcpy(tuple, (const double[4]){at[0] + 0.3 * at[1], at[1] + 0.2 * at[2], 2 * at[2], pow(at[0], p)},
                           4 * sizeof *tuple);
                }
        session_visit_quadrature_points(&rules, tuples, work, add_points, &sums);
        const int once[3] = {p, 0, 0}, twice[3] = {2 * p, 0, 0};
        const integrals expected = {2 / 6., 2 * integrate_monomial(3, once), 2 * integrate_monomial(3, twice)};
        check_integrals("tet", &sums, &expected);
        free(tuples);
        free(work);
        session_drop_cell_rules(&rules);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(rules_are_exact_for_their_degree),
        cmocka_unit_test(cell_integrals_match_their_polynomials),
        cmocka_unit_test(cells_between_lobatto_points_are_exact),
        cmocka_unit_test(bent_tets_of_order_7_are_exact),
        cmocka_unit_test(volumes_of_high_order_cells_are_exact),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
