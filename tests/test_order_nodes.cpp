/* Compares the positions of nodes in cells of higher order with those that VTK's own cell classes report, for Lagrange
 * cells of orders 1 to 6 and for all quadratic cells. Hexes in the order of VTK before version 9.1 differ: their two
 * vertical edges at corners 2 and 3 are exchanged. VTK 9.1 exchanges them when it reads files of the old version. */
#include <cmath>
#include <cstdio>
#include <vector>

#include <vtkCell.h>
#include <vtkGenericCell.h>
#include <vtkHigherOrderHexahedron.h>
#include <vtkHigherOrderQuadrilateral.h>
#include <vtkHigherOrderWedge.h>
#include <vtkNew.h>
#include <vtkPoints.h>
#include <vtkSmartPointer.h>

extern "C" {
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

/* A header in C whose initializers name only some members. */
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wmissing-field-initializers"
#pragma GCC diagnostic ignored "-Wold-style-cast"
#include "session_nodes.h"
#pragma GCC diagnostic pop
}

namespace
{

/* Calls `use` with the lattice position i, j, k of every node. */
template <typename Use> void for_each_node(const session_nodes &of, Use use)
{
    const int p = of.order;
    const bool is_flat = of.type == GRID_TRIANGLE || of.type == GRID_QUAD;
    for (int k = 0; k <= (is_flat ? 0 : p); k++)
        for (int j = 0; j <= p; j++)
            for (int i = 0; i <= p; i++) {
                if (of.type == GRID_TET && i + j + k > p) continue;
                if ((of.type == GRID_TRIANGLE || of.type == GRID_WEDGE) && i + j > p) continue;
                if (of.type == GRID_PYRAMID && (i > p - k || j > p - k)) continue;
                use(i, j, k);
            }
}

void expect_node_position(int type, const session_nodes &of, const double *theirs, int i, int j, int k)
{
    const int place = session_find_node_in_connectivity(&of, INSITU_ORDER_VTK, i, j, k), p = of.order;
    double at[3] = {static_cast<double>(i) / p, static_cast<double>(j) / p, static_cast<double>(k) / p};
    if (of.type == GRID_PYRAMID) {
        /* VTK's reference pyramid has its apex above the middle of the base. */
        const double middle = 0.5 * k / p;
        at[0] = p == k ? 0.5 : at[0] + middle;
        at[1] = p == k ? 0.5 : at[1] + middle;
    }
    assert_in_range(place, 0, of.count - 1);
    for (int axis = 0; axis < 3; axis++) {
        if (std::fabs(theirs[3 * place + axis] - at[axis]) < 1e-6) continue;
        std::fprintf(stderr, "type %d, order %d: node %d %d %d is %d\n", type, p, i, j, k, place);
        fail();
    }
}

vtkSmartPointer<vtkCell> make_cell(int type, int64_t count)
{
    auto cell = vtkSmartPointer<vtkCell>::Take(vtkGenericCell::InstantiateCell(type));
    cell->GetPoints()->SetNumberOfPoints(count);
    cell->GetPointIds()->SetNumberOfIds(count);
    if (auto *quad = vtkHigherOrderQuadrilateral::SafeDownCast(cell)) quad->SetUniformOrderFromNumPoints(count);
    if (auto *hex = vtkHigherOrderHexahedron::SafeDownCast(cell)) hex->SetUniformOrderFromNumPoints(count);
    if (auto *wedge = vtkHigherOrderWedge::SafeDownCast(cell)) wedge->SetUniformOrderFromNumPoints(count);
    cell->Initialize();
    return cell;
}

void lagrange_nodes_match_vtk(void **)
{
    for (int type = INSITU_LAGRANGE_TRIANGLE; type <= INSITU_LAGRANGE_WEDGE; type++)
        for (int p = 1; p <= 6; p++) {
            session_nodes of;
            const int64_t count = session_node_count(type, p);
            assert_true(session_describe_nodes(type, count, &of));
            assert_true(of.order == p && of.count == count && of.is_complete);
            const auto cell = make_cell(type, count);
            const double *theirs = cell->GetParametricCoords();
            assert_non_null(theirs);
            std::vector<int> seen(static_cast<size_t>(count));
            for_each_node(of, [&](int i, int j, int k) {
                expect_node_position(type, of, theirs, i, j, k);
                seen[static_cast<size_t>(session_find_node_in_connectivity(&of, INSITU_ORDER_VTK, i, j, k))]++;
            });
            for (const int times : seen) assert_int_equal(times, 1);
        }
}

void quadratic_nodes_match_vtk(void **)
{
    for (const int type : {22, 24, 28, 29, 32}) {
        session_nodes of;
        assert_true(session_describe_nodes(type, session_node_count(type, 0), &of));
        vtkNew<vtkGenericCell> cell;
        cell->SetCellType(type);
        assert_int_equal(cell->GetNumberOfPoints(), of.count);
        for_each_node(
            of, [&](int i, int j, int k) { expect_node_position(type, of, cell->GetParametricCoords(), i, j, k); });
    }
}

/* Checks that the old order of hexes differs from the new one only by the exchange of the nodes on edges 10 and 11, as
 * in VTK's conversion of old files. */
void old_hexes_have_two_edges_swapped(void **)
{
    for (int p = 2; p <= 5; p++) {
        session_nodes of;
        assert_true(session_describe_nodes(INSITU_LAGRANGE_HEX, session_node_count(INSITU_LAGRANGE_HEX, p), &of));
        const int r = p - 1, first = 8 + 10 * r;
        for_each_node(of, [&](int i, int j, int k) {
            const int now = session_find_node_in_connectivity(&of, INSITU_ORDER_VTK, i, j, k);
            int old = now;
            if (now >= first && now < first + r) old += r;
            if (now >= first + r && now < first + 2 * r) old -= r;
            assert_int_equal(session_find_node_in_connectivity(&of, INSITU_ORDER_VTK_BEFORE_9_1, i, j, k), old);
        });
    }
}

/* Checks that every node has exactly one index in every order. */
void node_positions_are_permutations(void **)
{
    const insitu_vertex_order orders[] = {INSITU_ORDER_LEXICOGRAPHIC, INSITU_ORDER_GMSH, INSITU_ORDER_EXODUS};
    for (int type = INSITU_LAGRANGE_TRIANGLE; type <= INSITU_LAGRANGE_PYRAMID; type++)
        for (const insitu_vertex_order order : orders)
            for (int p = 1; p <= 4; p++) {
                session_nodes of;
                assert_true(session_describe_nodes(type, session_node_count(type, p), &of));
                if (session_describe_unsupported_node_order(&of, order)) continue;
                std::vector<int> seen(static_cast<size_t>(of.count));
                for_each_node(of, [&](int i, int j, int k) {
                    const int place = session_find_node_in_connectivity(&of, order, i, j, k);
                    assert_in_range(place, 0, of.count - 1);
                    seen[static_cast<size_t>(place)]++;
                });
                for (const int times : seen) assert_int_equal(times, 1);
            }
}

} // namespace

int main()
{
    const CMUnitTest tests[] = {
        cmocka_unit_test(lagrange_nodes_match_vtk),
        cmocka_unit_test(quadratic_nodes_match_vtk),
        cmocka_unit_test(old_hexes_have_two_edges_swapped),
        cmocka_unit_test(node_positions_are_permutations),
    };
    return cmocka_run_group_tests(tests, nullptr, nullptr);
}
