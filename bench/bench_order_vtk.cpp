#include "bench_order_vtk.h"

#include <algorithm>
#include <vector>

#include <vtkDoubleArray.h>
#include <vtkMath.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkTessellatorFilter.h>
#include <vtkUnstructuredGrid.h>

struct bench_tessellator {
    vtkNew<vtkUnstructuredGrid> grid;
    vtkNew<vtkTessellatorFilter> filter;
};

namespace
{

/* The longest edge falls by half with each division, so that 6 suffice for all errors that are measured. */
constexpr int most_divisions = 6;

void set_grid(vtkUnstructuredGrid *grid, const data_cells &cells)
{
    vtkNew<vtkPoints> points;
    vtkNew<vtkDoubleArray> values;
    points->SetDataTypeToDouble();
    values->SetName("f");
    for (int64_t v = 0; v < cells.vertex_count; v++) {
        points->InsertNextPoint(cells.coordinates + 3 * v);
        values->InsertNextValue(cells.values[v]);
    }
    grid->SetPoints(points);
    grid->GetPointData()->SetScalars(values);
    grid->Allocate(cells.cell_count);
    for (int64_t cell = 0; cell < cells.cell_count; cell++) {
        const int64_t *nodes = cells.connectivity + cell * cells.nodes;
        const std::vector<vtkIdType> ids(nodes, nodes + cells.nodes);
        grid->InsertNextCell(cells.type, cells.nodes, ids.data());
    }
}

} // namespace

bench_tessellator *bench_tessellator_create(const data_cells *cells, double error)
{
    auto *t = new bench_tessellator();
    set_grid(t->grid, *cells);
    t->filter->SetInputData(t->grid);
    t->filter->SetOutputDimension(3);
    t->filter->SetMaximumNumberOfSubdivisions(most_divisions);
    t->filter->SetFieldCriterion(0, error);
    t->filter->MergePointsOff();
    return t;
}

void bench_tessellator_destroy(bench_tessellator *tessellator)
{
    delete tessellator;
}

void bench_tessellator_update(bench_tessellator *tessellator)
{
    tessellator->filter->Modified();
    tessellator->filter->Update();
}

int64_t bench_tessellator_cell_count(bench_tessellator *tessellator)
{
    return tessellator->filter->GetOutput()->GetNumberOfCells();
}

double bench_tessellator_longest_squared(bench_tessellator *tessellator)
{
    vtkUnstructuredGrid *out = tessellator->filter->GetOutput();
    double longest = 0;
    for (vtkIdType cell = 0; cell < out->GetNumberOfCells(); cell++) {
        vtkIdType count;
        const vtkIdType *ids;
        out->GetCellPoints(cell, count, ids);
        for (vtkIdType i = 0; i < count; i++)
            for (vtkIdType j = 0; j < i; j++) {
                double a[3], b[3];
                out->GetPoint(ids[i], a);
                out->GetPoint(ids[j], b);
                longest = std::max(longest, vtkMath::Distance2BetweenPoints(a, b));
            }
    }
    return longest;
}
