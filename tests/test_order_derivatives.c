/* Compares the derivatives of cells' polynomials at nodes with closed forms. A derivative is a weighted sum of values
 * at nodes. On straight cells, this sum of any polynomial of the cell must equal the polynomial's gradient times the
 * same sum of positions. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "session_derivatives.h"
#include "test_mesh_order.h"

enum { MOST_POWER = 4 };

static double zero_field(const double p[3])
{
    return p[0];
}

/* ---- polynomials ------------------------------------------------------------------------------------------------- */

/* Returns the product of powers of x + 0.3, y + 0.4 and z + 0.5, and computes its gradient. */
static double evaluate_monomial(const double at[3], const int powers[3], double gradient[3])
{
    double value = 1;
    for (int a = 0; a < 3; a++) {
        value *= pow(at[a] + 0.3 + 0.1 * a, powers[a]);
        gradient[a] = powers[a];
        for (int b = 0; b < 3; b++) gradient[a] *= pow(at[b] + 0.3 + 0.1 * b, powers[b] - (a == b && powers[b] > 0));
    }
    return value;
}

/* Returns whether the cell's polynomials contain the monomial with the powers q. */
static bool is_in_polynomial_space(const session_nodes *of, const int q[3])
{
    const int p = of->order, plane = q[0] + q[1];
    switch (of->type) {
    case GRID_TRIANGLE: return plane <= p && q[2] == 0;
    case GRID_TET: return plane + q[2] <= p;
    case GRID_WEDGE:
        return of->is_complete ? plane <= p && q[2] <= p : (plane <= 2 && q[2] <= 1) || (plane <= 1 && q[2] <= 2);
    default:
        if (of->type == GRID_QUAD && q[2]) return false;
        if (of->is_complete) return q[0] <= p && q[1] <= p && q[2] <= p;
        return q[0] <= 2 && q[1] <= 2 && q[2] <= 2 && (q[0] == 2) + (q[1] == 2) + (q[2] == 2) <= 1;
    }
}

/* Tolerance: at most 125 terms are summed, each rounded by 1e-16 of a weight of up to 10 times powers of up to
 * 1.8^12. */
#define ROUNDING 1e-9

/* Returns the largest error, at any node, of the derivatives of the monomial with the given powers. The nodes of the
 * cell are at `places`. */
static double find_error(const session_nodes *of, const session_derivatives *d, const double (*places)[3],
                         const int powers[3])
{
    double worst = 0, gradient[3], unused[3];
    for (int n = 0; n < of->count; n++)
        for (int axis = 0; axis < d->axis_count; axis++) {
            double edge[3] = {0}, rise = 0;
            for (int t = d->starts[d->axis_count * n + axis]; t < d->starts[d->axis_count * n + axis + 1]; t++) {
                for (int a = 0; a < 3; a++) edge[a] += d->weights[t] * places[d->nodes[t]][a];
                rise += d->weights[t] * evaluate_monomial(places[d->nodes[t]], powers, unused);
            }
            evaluate_monomial(places[n], powers, gradient);
            worst = fmax(worst, fabs(rise - (edge[0] * gradient[0] + edge[1] * gradient[1] + edge[2] * gradient[2])));
        }
    return worst;
}

static double find_largest_error(const session_nodes *of, const session_derivatives *d, const double (*places)[3])
{
    double worst = 0;
    for (int i = 0; i < (MOST_POWER + 1) * (MOST_POWER + 1) * (MOST_POWER + 1); i++) {
        const int powers[3] = {i % (MOST_POWER + 1), i / (MOST_POWER + 1) % (MOST_POWER + 1),
                               i / (MOST_POWER + 1) / (MOST_POWER + 1)};
        if (is_in_polynomial_space(of, powers)) worst = fmax(worst, find_error(of, d, places, powers));
    }
    return worst;
}

/* Returns the volume of the parallelepiped (or the area of the parallelogram) spanned by the derivatives of the
 * position at a node. */
static double compute_box_volume(const session_derivatives *d, int node, const double (*places)[3])
{
    double e[3][3] = {{0}};
    for (int axis = 0; axis < d->axis_count; axis++)
        for (int t = d->starts[d->axis_count * node + axis]; t < d->starts[d->axis_count * node + axis + 1]; t++)
            for (int a = 0; a < 3; a++) e[axis][a] += d->weights[t] * places[d->nodes[t]][a];
    if (d->axis_count == 2) e[2][2] = 1;
    return fabs(e[0][0] * (e[1][1] * e[2][2] - e[1][2] * e[2][1]) + e[0][1] * (e[1][2] * e[2][0] - e[1][0] * e[2][2]) +
                e[0][2] * (e[1][0] * e[2][1] - e[1][1] * e[2][0]));
}

/* Checks the derivatives at all nodes. volume: expected result of compute_box_volume(). */
static void check_derivatives(const char *name, const session_nodes *of, const session_derivatives *d,
                              const double (*places)[3], double volume)
{
    const double error = find_largest_error(of, d, places);
    if (!(error < ROUNDING)) fprintf(stderr, "%s, order %d: a derivative is off by %g\n", name, of->order, error);
    assert_true(error < ROUNDING);
    for (int n = 0; n < of->count; n++) assert_true(fabs(compute_box_volume(d, n, places) - volume) < ROUNDING);
}

/* ---- cells ------------------------------------------------------------------------------------------------------- */

/* Moves nodes that are equidistant in the cube [-1, 1]^3 to Gauss-Lobatto points. */
static void move_nodes_to_lobatto_points(int p, double *coordinates, int64_t count)
{
    const double of3[4] = {-1, -1 / sqrt(5), 1 / sqrt(5), 1}, of4[5] = {-1, -sqrt(3. / 7), 0, sqrt(3. / 7), 1};
    for (int64_t i = 0; i < 3 * count; i++) {
        const int at = (int)lround((coordinates[i] + 1) / 2 * p);
        coordinates[i] = p == 3 ? of3[at] : of4[at];
    }
}

/* Checks the derivatives of all cells in one cube. The parallelepiped of derivatives has the volume of the cube.
 * is_lobatto: cells are hexes with Gauss-Lobatto nodes. */
static void check_kind(const order_kind *kind, bool is_lobatto)
{
    order_mesh mesh;
    session_polynomials polynomials;
    session_mesh of = {0};
    double(*places)[3] = malloc(200 * sizeof *places);
    order_mesh_create(kind, 1, 0, zero_field, 0, 1, &mesh);
    if (is_lobatto) move_nodes_to_lobatto_points(kind->order, mesh.coordinates, mesh.vertex_count);
    of.given = mesh.mesh;
    of.cells.vertex_count = mesh.vertex_count;
    assert_true(session_polynomials_create(&of, &polynomials));
    for (int64_t cell = 0; cell < mesh.cell_count; cell++) {
        for (int n = 0; n < mesh.nodes; n++)
            memcpy(places[n], mesh.coordinates + 3 * mesh.connectivity[cell * mesh.nodes + n], sizeof places[n]);
        const session_derivatives *d = session_find_derivatives_of_cell(&polynomials, cell, places[0], 3);
        assert_int_equal(d->axis_count, strstr(kind->name, "pyramid") ? 0 : 3);
        if (d->axis_count)
            check_derivatives(kind->name, &polynomials.rows.kinds[0].nodes, d, (const double(*)[3])places, 8);
    }
    session_polynomials_free(&polynomials);
    order_mesh_free(&mesh);
    free(places);
}

static void solid_cells_have_their_derivatives(void **state)
{
    (void)state;
    for (int k = 0; k < order_kind_count; k++) check_kind(&order_kinds[k], false);
}

static void lobatto_points_are_recognised(void **state)
{
    (void)state;
    for (int p = 3; p <= 4; p++) {
        const order_kind kind = {"hex of Lobatto points", INSITU_LAGRANGE_HEX, INSITU_ORDER_LEXICOGRAPHIC, p};
        check_kind(&kind, true);
        check_kind(&kind, false);
    }
}

/* Checks quads and triangles in the plane z = 0 whose nodes are in rows, and the quad of eight nodes. */
static void shells_have_their_derivatives(void **state)
{
    (void)state;
    static const double of8[8][3] = {{0, 0, 0},   {1, 0, 0},   {1, 1, 0},   {0, 1, 0},
                                     {0.5, 0, 0}, {1, 0.5, 0}, {0.5, 1, 0}, {0, 0.5, 0}};
    session_nodes of;
    session_derivatives d;
    for (int p = 1; p <= MOST_POWER; p++)
        for (int is_quad = 0; is_quad < 2; is_quad++) {
            double places[25][3] = {{0}};
            int count = 0;
            for (int j = 0; j <= p; j++)
                for (int i = 0; i <= p - (is_quad ? 0 : j); i++, count++) {
                    places[count][0] = (double)i / p;
                    places[count][1] = (double)j / p;
                }
            assert_true(session_describe_nodes(is_quad ? INSITU_LAGRANGE_QUAD : INSITU_LAGRANGE_TRIANGLE, count, &of));
            assert_true(session_make_derivatives(&of, INSITU_ORDER_LEXICOGRAPHIC, false, 1, &d));
            assert_int_equal(d.axis_count, 2);
            check_derivatives("shell", &of, &d, (const double(*)[3])places, 1);
            session_drop_derivatives(&d);
        }
    assert_true(session_describe_nodes(INSITU_QUADRATIC_QUAD, 8, &of));
    assert_true(session_make_derivatives(&of, INSITU_ORDER_VTK, false, 1, &d));
    check_derivatives("quad of 8 nodes", &of, &d, of8, 1);
    session_drop_derivatives(&d);
}

/* Checks derivatives on a finer lattice, with `parts` times as many nodes along an edge as polynomials of the lower
 * order need. The derivatives of these polynomials must be exact, and each must use only as many nodes as determine
 * it. */
static void finer_lattices_have_derivatives(void **state)
{
    (void)state;
    static const int types[] = {GRID_TRIANGLE, GRID_QUAD, GRID_TET, GRID_WEDGE, GRID_HEX};
    for (int i = 0; i < 5 * 3 * 2; i++) {
        const int type = types[i % 5], p = 1 + i / 5 % 3, parts = 2 + i / 15, fine = parts * p;
        const session_nodes of = session_describe_complete_nodes(type, fine);
        double(*places)[3] = malloc((size_t)of.count * sizeof *places);
        session_derivatives d;
        for (int n = 0; n < (fine + 1) * (fine + 1) * (fine + 1); n++) {
            const int at[3] = {n % (fine + 1), n / (fine + 1) % (fine + 1), n / (fine + 1) / (fine + 1)};
            if (!session_has_node(&of, at[0], at[1], at[2])) continue;
            double *place =
                places[session_find_node_in_connectivity(&of, INSITU_ORDER_LEXICOGRAPHIC, at[0], at[1], at[2])];
            for (int a = 0; a < 3; a++) place[a] = (double)at[a] / fine;
        }
        assert_true(session_make_derivatives(&of, INSITU_ORDER_LEXICOGRAPHIC, false, parts, &d));
        session_nodes coarse = session_describe_complete_nodes(type, p);
        const int most = 2 * coarse.count * d.axis_count * of.count;
        coarse.count = of.count; /* checks derivatives at all nodes, of polynomials of the lower order */
        check_derivatives("finer lattice", &coarse, &d, (const double(*)[3])places, 1);
        assert_true(d.starts[d.axis_count * of.count] <= most);
        session_drop_derivatives(&d);
        free(places);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(solid_cells_have_their_derivatives),
        cmocka_unit_test(lobatto_points_are_recognised),
        cmocka_unit_test(shells_have_their_derivatives),
        cmocka_unit_test(finer_lattices_have_derivatives),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
