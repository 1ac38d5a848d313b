/* Makes a VTK grid of hexes or tets, for tests that compare with VTK's filters. */
#ifndef TEST_VTK_GRID_H
#define TEST_VTK_GRID_H

#include <algorithm>
#include <cstdint>

#include <vtkCellType.h>
#include <vtkNew.h>
#include <vtkPoints.h>
#include <vtkSmartPointer.h>
#include <vtkUnstructuredGrid.h>

/* Returns a grid of cells of one type, VTK_TETRA or VTK_HEXAHEDRON. coordinates: vertex_count × 3; the grid stores them
 * in double precision. */
inline vtkSmartPointer<vtkUnstructuredGrid> test_vtk_grid(int64_t vertex_count, const double *coordinates,
                                                          int64_t cell_count, int type, const int64_t *connectivity)
{
    auto grid = vtkSmartPointer<vtkUnstructuredGrid>::New();
    vtkNew<vtkPoints> points;
    points->SetDataTypeToDouble();
    for (vtkIdType v = 0; v < vertex_count; v++) points->InsertNextPoint(coordinates + 3 * v);
    grid->SetPoints(points);
    const vtkIdType corners = type == VTK_TETRA ? 4 : 8;
    grid->Allocate(cell_count);
    for (vtkIdType cell = 0; cell < cell_count; cell++) {
        vtkIdType ids[8];
        std::copy_n(connectivity + cell * corners, corners, ids);
        grid->InsertNextCell(type, corners, ids);
    }
    return grid;
}

#endif
