/* Meshes of the tests as VTK's. */
#ifndef BENCH_VTK_MESH_H
#define BENCH_VTK_MESH_H

#include <vtkSmartPointer.h>
#include <vtkUnstructuredGrid.h>

#include "bench_vtk.h"

/* float32 points and values, the point scalars "f". */
vtkSmartPointer<vtkUnstructuredGrid> bench_vtk_grid(const test_mesh &mesh);

#endif
