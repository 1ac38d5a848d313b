/* Converts meshes of the tests to VTK's grids. */
#ifndef BENCH_VTK_MESH_H
#define BENCH_VTK_MESH_H

#include <vtkSmartPointer.h>
#include <vtkUnstructuredGrid.h>

#include "bench_vtk.h"

/* Returns a grid with float32 points, and float32 values as the point scalars "f". */
vtkSmartPointer<vtkUnstructuredGrid> bench_vtk_make_grid(const test_mesh &mesh);

#endif
