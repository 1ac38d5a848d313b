/* Compares the values of cells' polynomials between their nodes with closed forms: straight cells must reproduce every
 * polynomial that they represent. If the same cell is described from another corner and along other axes, the values on
 * its faces must be bit-identical. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "session_interpolation.h"
#include "test_mesh_order.h"

enum { MOST_POWER = 4, MOST_NODES = 17 * 17 * 17 };

static double zero_field(const double p[3])
{
    return p[0];
}

static bool is_pyramid(const order_kind *kind)
{
    return strstr(kind->name, "pyramid") != NULL;
}

/* ---- closed forms ------------------------------------------------------------------------------------------------ */

static double evaluate_monomial(const double at[3], const int powers[3])
{
    double value = 1;
    for (int a = 0; a < 3; a++) value *= pow(at[a] + 0.3 + 0.1 * a, powers[a]);
    return value;
}

/* Returns whether the cell's polynomials contain the monomial with the powers q. */
static bool is_in_polynomial_space(const session_nodes *of, const int q[3])
{
    const int p = of->order, plane = q[0] + q[1];
    switch (of->type) {
    case GRID_TET:
    case GRID_PYRAMID: return plane + q[2] <= p;
    case GRID_WEDGE:
        return of->is_complete ? plane <= p && q[2] <= p : (plane <= 2 && q[2] <= 1) || (plane <= 1 && q[2] <= 2);
    default:
        if (of->is_complete) return q[0] <= p && q[1] <= p && q[2] <= p;
        return q[0] <= 2 && q[1] <= 2 && q[2] <= 2 && (q[0] == 2) + (q[1] == 2) + (q[2] == 2) <= 1;
    }
}

/* Tolerance: at most 125 terms are summed, in three passes, each rounded by 1e-16 of a weight of up to 2 times powers
 * of up to 1.8^12. */
#define ROUNDING 1e-11

/* Interpolates the positions of nodes and a monomial. Checks that the positions lie on the finer lattice of the
 * straight cell and that the values equal the monomial. */
static void check_monomial(const session_interpolation *of, const double (*places)[3], const int powers[3],
                           const char *name)
{
    static double tuples[MOST_NODES][4], fine[MOST_NODES][4], room[3 * 4 * MOST_NODES];
    /* indices for tets and wedges; for hexes and pyramids */
    static const int corner_of_axis[2][3] = {{1, 2, 3}, {1, 3, 4}};
    double corners[8][3], worst = 0;
    const int p = of->fine.order, is_box = of->of.type == GRID_HEX || of->of.type == GRID_PYRAMID;
    for (int c = 0; c < grid_type_vertex_count(of->of.type); c++)
        memcpy(corners[c], places[of->corners[c]], sizeof corners[c]);
    for (int n = 0; n < of->of.count; n++) {
        memcpy(tuples[n], places[n], sizeof places[n]);
        tuples[n][3] = evaluate_monomial(places[n], powers);
    }
    assert_true(session_interpolation_work_size(of, 4) <= sizeof room / sizeof room[0]);
    session_interpolate(of, (const double(*)[3])corners, 4, tuples[0], room, fine[0]);
    for (int k = 0; k <= p; k++)
        for (int j = 0; j <= p; j++)
            for (int i = 0; i <= p; i++) {
                if (!session_has_node(&of->fine, i, j, k)) continue;
                const double *at =
                    fine[session_find_node_in_connectivity(&of->fine, INSITU_ORDER_LEXICOGRAPHIC, i, j, k)];
                const int steps[3] = {i, j, k};
                for (int a = 0; a < 3; a++) {
                    double place = corners[0][a];
                    for (int axis = 0; axis < 3; axis++)
                        place += (corners[corner_of_axis[is_box][axis]][a] - corners[0][a]) * steps[axis] / p;
                    worst = fmax(worst, fabs(at[a] - place));
                }
                worst = fmax(worst, fabs(at[3] - evaluate_monomial(at, powers)));
            }
    if (!(worst < ROUNDING)) fprintf(stderr, "%s, to order %d: a value is off by %g\n", name, p, worst);
    assert_true(worst < ROUNDING);
}

/* Moves nodes that are equidistant in the cube [-1, 1]^3 to Gauss-Lobatto points of order 4. */
static void move_nodes_to_lobatto_points(order_mesh *mesh)
{
    const double of4[5] = {-1, -sqrt(3. / 7), 0, sqrt(3. / 7), 1};
    for (int64_t i = 0; i < 3 * mesh->vertex_count; i++)
        mesh->coordinates[i] = of4[lround((mesh->coordinates[i] + 1) * 2)];
}

/* Checks all monomials in all cells of one cube. */
static void check_kind(const order_kind *kind, int parts, bool is_lobatto)
{
    order_mesh mesh;
    session_nodes nodes;
    session_interpolation of;
    double(*places)[3] = malloc(200 * sizeof *places);
    order_mesh_create(kind, 1, 0, zero_field, 0, 1, &mesh);
    if (is_lobatto) move_nodes_to_lobatto_points(&mesh);
    assert_true(session_describe_nodes((int)kind->type, mesh.nodes, &nodes));
    if (kind->order == 1) nodes.order = 1;
    assert_true(session_make_interpolation(&nodes, kind->layout, parts, is_lobatto, &of));
    for (int64_t cell = 0; cell < mesh.cell_count; cell++) {
        for (int n = 0; n < mesh.nodes; n++)
            memcpy(places[n], mesh.coordinates + 3 * mesh.connectivity[cell * mesh.nodes + n], sizeof places[n]);
        for (int i = 0; i < (MOST_POWER + 1) * (MOST_POWER + 1) * (MOST_POWER + 1); i++) {
            const int powers[3] = {i % (MOST_POWER + 1), i / (MOST_POWER + 1) % (MOST_POWER + 1),
                                   i / (MOST_POWER + 1) / (MOST_POWER + 1)};
            if (is_in_polynomial_space(&nodes, powers))
                check_monomial(&of, (const double(*)[3])places, powers, kind->name);
        }
    }
    session_drop_interpolation(&of);
    order_mesh_free(&mesh);
    free(places);
}

static void polynomials_are_reproduced(void **state)
{
    (void)state;
    for (int k = 0; k < order_kind_count; k++)
        for (int parts = 2; parts <= 4; parts++) check_kind(&order_kinds[k], parts, false);
    check_kind(&(order_kind){"hex 4, Gauss-Lobatto", INSITU_LAGRANGE_HEX, INSITU_ORDER_LEXICOGRAPHIC, 4}, 3, true);
}

/* ---- rotated cells ----------------------------------------------------------------------------------------------- */

/* Stores the permutation with the index `number` of 0 to count - 1. */
static void make_permutation(int number, int count, int out[4])
{
    for (int n = 0; n < count; n++) out[n] = n;
    for (int n = 0; n < count; n++) {
        const int from = n + number % (count - n), taken = out[from];
        for (int m = from; m > n; m--) out[m] = out[m - 1];
        out[n] = taken;
        number /= count - n;
    }
}

static int count_rotations(int type)
{
    return type == GRID_HEX ? 48 : type == GRID_TET ? 24 : 12;
}

/* Computes the lattice position that a node has if the cell is described in another way: from another corner and along
 * other axes. number: index of the description, below count_rotations(); p: order of the lattice. */
static void rotate_node(int type, int number, int p, const int at[3], int out[3])
{
    int order[4];
    if (type == GRID_HEX) {
        make_permutation(number / 8, 3, order);
        for (int a = 0; a < 3; a++) out[a] = number >> a & 1 ? p - at[order[a]] : at[order[a]];
        return;
    }
    const bool is_tet = type == GRID_TET;
    const int rest = p - at[0] - at[1], b[4] = {at[0], at[1], is_tet ? at[2] : rest, rest - at[2]};
    make_permutation(is_tet ? number : number / 2, is_tet ? 4 : 3, order);
    for (int a = 0; a < 3; a++) out[a] = b[order[a]];
    if (!is_tet) out[2] = number % 2 ? p - at[2] : at[2];
}

static bool is_on_face(int type, int p, const int at[3])
{
    const bool at_first = at[0] == 0 || at[1] == 0 || at[2] == 0;
    if (type == GRID_HEX) return at_first || at[0] == p || at[1] == p || at[2] == p;
    if (type == GRID_TET) return at_first || at[0] + at[1] + at[2] == p;
    return at_first || at[2] == p || at[0] + at[1] == p;
}

static double draw_random_number(void)
{
    return rand() / (RAND_MAX + 1.0);
}

/* Compares the fine nodes of a cell with random nodes with those of the same cell in another description. On faces they
 * must be bit-identical, inside equal to 1e-12. */
static void check_rotated_cell(const session_interpolation *of, insitu_vertex_order order, int number, const char *name)
{
    static double tuples[2][200][4], fine[2][MOST_NODES][4], room[3 * 4 * MOST_NODES];
    const int type = of->of.type, p = of->of.order, r = of->fine.order;
    int wrong = 0, turned[3];
    for (int i = 0; i < (p + 1) * (p + 1) * (p + 1); i++) {
        const int at[3] = {i % (p + 1), i / (p + 1) % (p + 1), i / (p + 1) / (p + 1)};
        if (!session_has_node(&of->of, at[0], at[1], at[2])) continue;
        rotate_node(type, number, p, at, turned);
        const int from = session_find_node_in_connectivity(&of->of, order, at[0], at[1], at[2]);
        const int to = session_find_node_in_connectivity(&of->of, order, turned[0], turned[1], turned[2]);
        if (from >= of->of.count) continue;
        for (int c = 0; c < 4; c++) tuples[0][from][c] = tuples[1][to][c] = draw_random_number();
    }
    for (int side = 0; side < 2; side++) {
        double corners[8][3];
        for (int c = 0; c < grid_type_vertex_count(type); c++)
            memcpy(corners[c], tuples[side][of->corners[c]], sizeof corners[c]);
        session_interpolate(of, (const double(*)[3])corners, 4, tuples[side][0], room, fine[side][0]);
    }
    for (int i = 0; i < (r + 1) * (r + 1) * (r + 1); i++) {
        const int at[3] = {i % (r + 1), i / (r + 1) % (r + 1), i / (r + 1) / (r + 1)};
        if (!session_has_node(&of->fine, at[0], at[1], at[2])) continue;
        rotate_node(type, number, r, at, turned);
        const double *a =
            fine[0][session_find_node_in_connectivity(&of->fine, INSITU_ORDER_LEXICOGRAPHIC, at[0], at[1], at[2])];
        const double *b = fine[1][session_find_node_in_connectivity(&of->fine, INSITU_ORDER_LEXICOGRAPHIC, turned[0],
                                                                    turned[1], turned[2])];
        if (is_on_face(type, r, at)) wrong += memcmp(a, b, sizeof fine[0][0]) != 0;
        for (int c = 0; c < 4; c++) wrong += !(fabs(a[c] - b[c]) < 1e-12);
    }
    if (wrong) fprintf(stderr, "%s, turned in way %d: %d values differ\n", name, number, wrong);
    assert_int_equal(wrong, 0);
}

static void rotated_cells_have_the_same_bits_on_faces(void **state)
{
    (void)state;
    for (int k = 0; k < order_kind_count; k++) {
        const order_kind *kind = &order_kinds[k];
        session_nodes nodes;
        session_interpolation of;
        if (is_pyramid(kind) || kind->order == 1) continue;
        assert_true(session_describe_nodes((int)kind->type, session_node_count((int)kind->type, kind->order), &nodes));
        for (int way = 0; way < 4; way++) {
            const bool is_lobatto = way % 2;
            assert_true(session_make_interpolation(&nodes, kind->layout, 2 + way / 2, is_lobatto, &of));
            for (int n = 0; n < count_rotations(nodes.type); n++) check_rotated_cell(&of, kind->layout, n, kind->name);
            session_drop_interpolation(&of);
        }
    }
}

/* Checks that a constant has bitwise equal values at all nodes, so that flat outer faces stay flat. */
static void constants_are_exact(void **state)
{
    (void)state;
    static double values[200], fine[MOST_NODES], room[3 * MOST_NODES], corners[8][3];
    for (int k = 0; k < order_kind_count; k++) {
        const order_kind *kind = &order_kinds[k];
        session_nodes nodes;
        session_interpolation of;
        if (kind->order == 1) continue;
        assert_true(session_describe_nodes((int)kind->type, session_node_count((int)kind->type, kind->order), &nodes));
        assert_true(session_make_interpolation(&nodes, kind->layout, 3, false, &of));
        for (int n = 0; n < nodes.count; n++) values[n] = 0.1;
        session_interpolate(&of, (const double(*)[3])corners, 1, values, room, fine);
        for (int n = 0; n < of.fine.count && nodes.is_complete; n++) assert_true(fine[n] == 0.1);
        session_drop_interpolation(&of);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(polynomials_are_reproduced),
        cmocka_unit_test(rotated_cells_have_the_same_bits_on_faces),
        cmocka_unit_test(constants_are_exact),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
