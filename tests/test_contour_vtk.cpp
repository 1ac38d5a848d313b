#include "test_contour_vtk.h"

#include <cstdlib>

#include <vtkCell.h>
#include <vtkContourFilter.h>
#include <vtkCutter.h>
#include <vtkDoubleArray.h>
#include <vtkNew.h>
#include <vtkPlane.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>
#include <vtkUnstructuredGrid.h>

#include "test_vtk_grid.h"

int64_t test_vtk_compute_contours(int64_t vertex_count, const double *coordinates, int64_t cell_count, int type,
                                  const int64_t *connectivity, const double *field, const double origin[3],
                                  const double normal[3], int value_count, const double *values, double **points)
{
    const int parts = 4;
    const auto grid = test_vtk_grid(vertex_count, coordinates, cell_count, type, connectivity);
    vtkNew<vtkDoubleArray> scalars;
    scalars->SetName("f");
    for (vtkIdType v = 0; v < vertex_count; v++) scalars->InsertNextValue(field[v]);
    grid->GetPointData()->SetScalars(scalars);
    vtkNew<vtkPlane> plane;
    plane->SetOrigin(origin[0], origin[1], origin[2]);
    plane->SetNormal(normal[0], normal[1], normal[2]);
    vtkNew<vtkCutter> cutter;
    cutter->SetInputData(grid);
    cutter->SetCutFunction(plane);
    cutter->SetOutputPointsPrecision(vtkAlgorithm::DOUBLE_PRECISION);
    vtkNew<vtkContourFilter> contour;
    contour->SetInputConnection(cutter->GetOutputPort());
    contour->SetOutputPointsPrecision(vtkAlgorithm::DOUBLE_PRECISION);
    for (int i = 0; i < value_count; i++) contour->SetValue(i, values[i]);
    contour->Update();
    vtkPolyData *lines = contour->GetOutput();
    const vtkIdType count = lines->GetNumberOfCells();
    *points =
        static_cast<double *>(std::malloc(static_cast<std::size_t>(count + 1) * (parts + 1) * 3 * sizeof(double)));
    if (!*points) return -1;
    double *out = *points;
    for (vtkIdType cell = 0; cell < count; cell++) {
        vtkCell *line = lines->GetCell(cell);
        if (line->GetNumberOfPoints() != 2) continue;
        double ends[2][3];
        for (int end = 0; end < 2; end++) line->GetPoints()->GetPoint(end, ends[end]);
        for (int i = 0; i <= parts; i++)
            for (int a = 0; a < 3; a++) *out++ = ends[0][a] + (ends[1][a] - ends[0][a]) * i / parts;
    }
    return (out - *points) / 3;
}
