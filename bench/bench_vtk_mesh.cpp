/* Converts between VTK's unstructured grids and the tests' meshes. */
#include "bench_vtk_mesh.h"

#include <cstdlib>

#include <vtkCellArray.h>
#include <vtkFloatArray.h>
#include <vtkIdList.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkXMLUnstructuredGridReader.h>

namespace
{

bool is_supported_cell_type(int type)
{
    return type == VTK_TETRA || type == VTK_HEXAHEDRON || type == VTK_WEDGE || type == VTK_PYRAMID;
}

template <typename T> T *allocate_array(int64_t count)
{
    void *block = std::calloc(static_cast<size_t>(count) + 1, sizeof(T));
    if (!block) std::abort();
    return static_cast<T *>(block);
}

/* Adds a polyhedron as a face stream of VTK. */
void add_polyhedron(const test_mesh &mesh, int64_t cell, vtkUnstructuredGrid &grid)
{
    vtkNew<vtkIdList> stream;
    stream->InsertNextId(mesh.offsets[cell + 1] - mesh.offsets[cell]);
    for (int64_t i = mesh.offsets[cell]; i < mesh.offsets[cell + 1]; i++) {
        const int64_t face = mesh.connectivity[i], first = mesh.face_offsets[face], end = mesh.face_offsets[face + 1];
        stream->InsertNextId(end - first);
        for (int64_t k = first; k < end; k++) stream->InsertNextId(mesh.face_connectivity[k]);
    }
    grid.InsertNextCell(VTK_POLYHEDRON, stream);
}

} // namespace

vtkSmartPointer<vtkUnstructuredGrid> bench_vtk_make_grid(const test_mesh &mesh)
{
    auto grid = vtkSmartPointer<vtkUnstructuredGrid>::New();
    vtkNew<vtkPoints> points;
    vtkNew<vtkFloatArray> values;
    points->SetDataTypeToFloat();
    points->SetNumberOfPoints(mesh.vertex_count);
    values->SetNumberOfValues(mesh.vertex_count);
    values->SetName("f");
    for (int64_t v = 0; v < mesh.vertex_count; v++) {
        points->SetPoint(v, mesh.coordinates + 3 * v);
        values->SetValue(v, static_cast<float>(mesh.values[v]));
    }
    grid->SetPoints(points);
    grid->GetPointData()->SetScalars(values);
    grid->Allocate(mesh.cell_count);
    for (int64_t cell = 0; cell < mesh.cell_count; cell++) {
        if (mesh.types[cell] == VTK_POLYHEDRON) {
            add_polyhedron(mesh, cell, *grid);
            continue;
        }
        vtkIdType ids[8];
        const int64_t first = mesh.offsets[cell], count = mesh.offsets[cell + 1] - first;
        for (int64_t i = 0; i < count; i++) ids[i] = mesh.connectivity[first + i];
        grid->InsertNextCell(mesh.types[cell], count, ids);
    }
    return grid;
}

bool bench_vtk_read(const char *path, const char *field, test_mesh *out)
{
    vtkNew<vtkXMLUnstructuredGridReader> reader;
    if (!reader->CanReadFile(path)) return false;
    reader->SetFileName(path);
    reader->Update();
    vtkUnstructuredGrid *grid = reader->GetOutput();
    vtkDataArray *values = grid->GetPointData()->GetArray(field);
    if (!values || values->GetNumberOfComponents() != 1 || !grid->GetNumberOfCells()) return false;
    *out = test_mesh{};
    out->vertex_count = grid->GetNumberOfPoints();
    out->cell_count = grid->GetNumberOfCells();
    for (int64_t cell = 0; cell < out->cell_count; cell++)
        if (!is_supported_cell_type(grid->GetCellType(cell))) return false;
    out->connectivity_count = grid->GetCells()->GetNumberOfConnectivityIds();
    out->coordinates = allocate_array<double>(3 * out->vertex_count);
    out->values = allocate_array<double>(out->vertex_count);
    out->offsets = allocate_array<int64_t>(out->cell_count + 1);
    out->connectivity = allocate_array<int64_t>(out->connectivity_count);
    out->types = allocate_array<unsigned char>(out->cell_count);
    out->ghosts = allocate_array<unsigned char>(out->cell_count);
    for (int64_t v = 0; v < out->vertex_count; v++) {
        grid->GetPoint(v, out->coordinates + 3 * v);
        out->values[v] = values->GetTuple1(v);
    }
    for (int64_t cell = 0; cell < out->cell_count; cell++) {
        vtkIdType count;
        const vtkIdType *ids;
        grid->GetCellPoints(cell, count, ids);
        out->types[cell] = static_cast<unsigned char>(grid->GetCellType(cell));
        out->offsets[cell + 1] = out->offsets[cell] + count;
        for (vtkIdType i = 0; i < count; i++) out->connectivity[out->offsets[cell] + i] = ids[i];
    }
    return true;
}
