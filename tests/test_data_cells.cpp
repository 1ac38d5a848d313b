#include "test_data_cells.h"

#include <cstdlib>
#include <filesystem>

#include <vtkDataArray.h>
#include <vtkIdList.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkUnstructuredGrid.h>
#include <vtkXMLUnstructuredGridReader.h>

namespace
{

template <typename T> T *allocate_array(vtkIdType count)
{
    void *block = std::calloc(static_cast<size_t>(count > 0 ? count : 1), sizeof(T));
    if (!block) std::abort();
    return static_cast<T *>(block);
}

} // namespace

bool data_cells_read_file(const char *path, const char *field, data_cells *out)
{
    if (!std::filesystem::exists(path)) return false;
    vtkNew<vtkXMLUnstructuredGridReader> reader;
    reader->SetFileName(path);
    reader->Update();
    vtkUnstructuredGrid *grid = reader->GetOutput();
    vtkDataArray *values = grid->GetPointData()->GetArray(field);
    if (!values || values->GetNumberOfComponents() != 1 || grid->GetNumberOfCells() == 0) return false;
    vtkNew<vtkIdList> ids;
    grid->GetCellPoints(0, ids);
    *out = data_cells{grid->GetCellType(0),
                      static_cast<int>(ids->GetNumberOfIds()),
                      grid->GetNumberOfPoints(),
                      grid->GetNumberOfCells(),
                      nullptr,
                      nullptr,
                      nullptr};
    out->coordinates = allocate_array<double>(3 * out->vertex_count);
    out->values = allocate_array<double>(out->vertex_count);
    out->connectivity = allocate_array<int64_t>(out->cell_count * out->nodes);
    for (vtkIdType v = 0; v < out->vertex_count; v++) {
        grid->GetPoint(v, out->coordinates + 3 * v);
        out->values[v] = values->GetComponent(v, 0);
    }
    for (vtkIdType cell = 0; cell < out->cell_count; cell++) {
        if (grid->GetCellType(cell) != out->type) std::abort();
        grid->GetCellPoints(cell, ids);
        for (int n = 0; n < out->nodes; n++) out->connectivity[cell * out->nodes + n] = ids->GetId(n);
    }
    return true;
}
