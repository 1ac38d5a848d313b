#include "test_derived_vtk.h"

#include <algorithm>
#include <chrono>

#include <vtkDataArray.h>
#include <vtkDoubleArray.h>
#include <vtkFloatArray.h>
#include <vtkGradientFilter.h>
#include <vtkIdList.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkSMPTools.h>
#include <vtkUnstructuredGrid.h>

#include "test_vtk_grid.h"

double test_vtk_compute_q_criterion(int64_t vertex_count, const double *coordinates, int64_t cell_count, int type,
                                    const int64_t *connectivity, const float *velocity, int runs, double *q)
{
    const auto grid = test_vtk_grid(vertex_count, coordinates, cell_count, type, connectivity);
    vtkNew<vtkFloatArray> values;
    values->SetName("u");
    values->SetNumberOfComponents(3);
    values->SetNumberOfTuples(vertex_count);
    for (vtkIdType v = 0; v < vertex_count; v++) values->SetTypedTuple(v, velocity + 3 * v);
    grid->GetPointData()->AddArray(values);
    vtkSMPTools::Initialize(1);
    double least = 1e30;
    for (int run = 0; run < runs; run++) {
        vtkNew<vtkGradientFilter> filter;
        filter->SetInputData(grid);
        filter->SetInputScalars(vtkDataObject::FIELD_ASSOCIATION_POINTS, "u");
        filter->ComputeGradientOff();
        filter->ComputeQCriterionOn();
        const auto start = std::chrono::steady_clock::now();
        filter->Update();
        least = std::min(least, std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
        vtkDataArray *found =
            vtkDataSet::SafeDownCast(filter->GetOutputDataObject(0))->GetPointData()->GetArray("Q-criterion");
        for (vtkIdType v = 0; v < vertex_count; v++) q[v] = found->GetComponent(v, 0);
    }
    return least;
}
