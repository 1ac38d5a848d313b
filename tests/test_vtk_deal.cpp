/* Checks the distribution of cells to ranks. For any partition each cell must be on exactly one rank, with bitwise
 * equal points and with its values. */
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include <vtkCellData.h>
#include <vtkCompositeDataIterator.h>
#include <vtkCompositeDataSet.h>
#include <vtkDoubleArray.h>
#include <vtkIntArray.h>
#include <vtkMultiBlockDataSet.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkUnstructuredGrid.h>

#include "cell_deal.h"

// cmocka.h is included after all C++ headers, as it defines fail as a macro.
extern "C" {
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
}

using render_tool::distribute_cells;
using render_tool::partition;

namespace
{

/* Returns n × n × n hexahedra, whose coordinates are multiples of 1/3, so that float cannot represent them. The cell
 * data "id" are numbers from `first` on; the point data are "x". */
vtkSmartPointer<vtkUnstructuredGrid> make_lattice(int n, int first, double shift)
{
    auto grid = vtkSmartPointer<vtkUnstructuredGrid>::New();
    vtkNew<vtkPoints> points;
    points->SetDataTypeToDouble();
    vtkNew<vtkDoubleArray> x;
    x->SetName("x");
    for (int i = 0; i < (n + 1) * (n + 1) * (n + 1); i++) {
        const double p[3] = {i % (n + 1) / 3.0 + shift, i / (n + 1) % (n + 1) / 3.0, i / ((n + 1) * (n + 1)) / 3.0};
        points->InsertNextPoint(p);
        x->InsertNextValue(p[0]);
    }
    grid->SetPoints(points);
    vtkNew<vtkIntArray> id;
    id->SetName("id");
    for (int i = 0; i < n * n * n; i++) {
        const vtkIdType o = i % n + (n + 1) * (i / n % n + (n + 1) * (i / (n * n)));
        const vtkIdType up = (n + 1) * (n + 1);
        const vtkIdType c[8] = {o, o + 1, o + n + 2, o + n + 1, o + up, o + up + 1, o + up + n + 2, o + up + n + 1};
        grid->InsertNextCell(VTK_HEXAHEDRON, 8, c);
        id->InsertNextValue(first + i);
    }
    grid->GetCellData()->AddArray(id);
    grid->GetPointData()->AddArray(x);
    return grid;
}

using corners = std::vector<double>; // coordinates x, y, z of each vertex of a cell

void collect_cells(vtkUnstructuredGrid *grid, std::map<int, corners> &found)
{
    auto *id = vtkIntArray::SafeDownCast(grid->GetCellData()->GetArray("id"));
    auto *x = vtkDoubleArray::SafeDownCast(grid->GetPointData()->GetArray("x"));
    assert_non_null(id);
    assert_non_null(x);
    assert_int_equal(grid->GetCellData()->GetNumberOfArrays() + grid->GetPointData()->GetNumberOfArrays(), 2);
    for (vtkIdType i = 0; i < grid->GetNumberOfCells(); i++) {
        vtkIdType count;
        const vtkIdType *points;
        grid->GetCellPoints(i, count, points);
        corners at;
        for (vtkIdType k = 0; k < count; k++) {
            double p[3];
            grid->GetPoint(points[k], p);
            assert_true(x->GetValue(points[k]) == p[0]);
            at.insert(at.end(), p, p + 3);
        }
        assert_true(found.emplace(id->GetValue(i), at).second);
    }
}

void collect_all(vtkDataObject *data, std::map<int, corners> &found)
{
    if (!data) return;
    if (auto *grid = vtkUnstructuredGrid::SafeDownCast(data)) {
        collect_cells(grid, found);
        return;
    }
    auto *composite = vtkCompositeDataSet::SafeDownCast(data);
    assert_non_null(composite);
    const auto it = vtkSmartPointer<vtkCompositeDataIterator>::Take(composite->NewIterator());
    for (it->InitTraversal(); !it->IsDoneWithTraversal(); it->GoToNextItem())
        collect_cells(vtkUnstructuredGrid::SafeDownCast(it->GetCurrentDataObject()), found);
}

void expect_each_cell_once(vtkDataObject *data)
{
    std::map<int, corners> expected;
    collect_all(data, expected);
    for (const partition how : {partition::block, partition::random, partition::checkerboard})
        for (const int ranks : {1, 2, 3, 7, 100}) {
            std::map<int, corners> found;
            for (int rank = 0; rank < ranks; rank++) collect_all(distribute_cells(data, how, rank, ranks), found);
            assert_true(found == expected);
        }
}

void grid_is_distributed_each_cell_once(void **)
{
    expect_each_cell_once(make_lattice(4, 0, 0));
}

void composite_is_distributed_each_cell_once(void **)
{
    vtkNew<vtkMultiBlockDataSet> blocks;
    blocks->SetBlock(0, make_lattice(3, 0, 0));
    blocks->SetBlock(1, nullptr);
    blocks->SetBlock(2, make_lattice(2, 1000, 5));
    expect_each_cell_once(blocks);
}

/* Checks that each rank's part has the attributes of the grid: VTK marks the array of the degrees of Lagrange cells as
 * an attribute, and the array may be another attribute too. */
void parts_keep_the_attributes_of_the_grid(void **)
{
    const auto grid = make_lattice(2, 0, 0);
    vtkNew<vtkDoubleArray> degrees;
    degrees->SetName("degrees");
    degrees->SetNumberOfComponents(3);
    for (int i = 0; i < 8; i++) degrees->InsertNextTuple3(1, 7, i);
    grid->GetCellData()->SetVectors(degrees);
    grid->GetCellData()->SetHigherOrderDegrees(degrees);
    grid->GetPointData()->SetActiveScalars("x");
    for (const int rank : {0, 1}) {
        const auto distributed = distribute_cells(grid, partition::block, rank, 2);
        auto *part = vtkUnstructuredGrid::SafeDownCast(distributed);
        vtkDataArray *kept = part->GetCellData()->GetHigherOrderDegrees();
        assert_non_null(kept);
        assert_ptr_equal(part->GetCellData()->GetVectors(), kept);
        for (int i = 0; i < 4; i++) assert_true(kept->GetComponent(i, 2) == 4 * rank + i);
        assert_ptr_equal(part->GetPointData()->GetScalars(), part->GetPointData()->GetArray("x"));
    }
}

void more_ranks_than_cells_leaves_some_without(void **)
{
    const auto grid = make_lattice(1, 0, 0);
    int with = 0;
    for (int rank = 0; rank < 5; rank++) with += distribute_cells(grid, partition::block, rank, 5) != nullptr;
    assert_int_equal(with, 1);
}

/* Checks the numbers of cells of each rank. Blocks differ from the mean by less than one cell. If 4096 cells are hashed
 * to 4 ranks, a rank's number differs from the mean by less than 5 standard deviations: 5 · sqrt(4096 · 1/4 · 3/4) =
 * 139. */
void parts_are_balanced(void **)
{
    const auto grid = make_lattice(16, 0, 0);
    for (int rank = 0; rank < 4; rank++) {
        auto cells = [&](partition how) {
            return vtkUnstructuredGrid::SafeDownCast(distribute_cells(grid, how, rank, 4))->GetNumberOfCells();
        };
        assert_int_equal(cells(partition::block), 1024);
        assert_in_range(cells(partition::random), 1024 - 139, 1024 + 139);
    }
}

void leaves_keep_their_numbers_on_all_ranks(void **)
{
    vtkNew<vtkMultiBlockDataSet> blocks;
    blocks->SetBlock(0, make_lattice(2, 0, 0));
    blocks->SetBlock(1, make_lattice(2, 100, 5));
    const auto distributed = distribute_cells(blocks, partition::block, 1, 2);
    auto *last = vtkMultiBlockDataSet::SafeDownCast(distributed);
    assert_int_equal(last->GetNumberOfBlocks(), 2);
    assert_null(last->GetBlock(0));
    assert_ptr_equal(last->GetBlock(1), blocks->GetBlock(1));
}

void names_of_partitions_are_known(void **)
{
    partition how = partition::block;
    assert_true(render_tool::parse_partition("checkerboard", how));
    assert_true(how == partition::checkerboard);
    assert_false(render_tool::parse_partition("Block", how));
}

} // namespace

int main()
{
    const CMUnitTest tests[] = {
        cmocka_unit_test(grid_is_distributed_each_cell_once),
        cmocka_unit_test(composite_is_distributed_each_cell_once),
        cmocka_unit_test(parts_keep_the_attributes_of_the_grid),
        cmocka_unit_test(more_ranks_than_cells_leaves_some_without),
        cmocka_unit_test(parts_are_balanced),
        cmocka_unit_test(leaves_keep_their_numbers_on_all_ranks),
        cmocka_unit_test(names_of_partitions_are_known),
    };
    return cmocka_run_group_tests(tests, nullptr, nullptr);
}
