/* The points of curvilinear grids and all arrays are VTK's own, by reference. A list of hexahedra and, for images and
 * rectilinear grids, of points is what the way through unstructured grids costs: 32 bytes a cell and 24 a point. */
#include "insitu/vtk_grids.h"

#include <array>
#include <cstdint>
#include <limits>

#include <vtkCellArray.h>
#include <vtkCellData.h>
#include <vtkCellType.h>
#include <vtkDataSet.h>
#include <vtkFieldData.h>
#include <vtkIdList.h>
#include <vtkImageData.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkRectilinearGrid.h>
#include <vtkSmartPointer.h>
#include <vtkStructuredGrid.h>
#include <vtkTypeInt32Array.h>
#include <vtkTypeInt64Array.h>
#include <vtkUnsignedCharArray.h>
#include <vtkUnstructuredGrid.h>

namespace
{

using dimensions = std::array<int, 3>; // points along i, j and k

/* Gets the dimensions of a grid of three dimensions; false for any other data. */
bool get_dimensions(vtkDataSet *data, dimensions &d)
{
    if (auto *image = vtkImageData::SafeDownCast(data))
        image->GetDimensions(d.data());
    else if (auto *rectilinear = vtkRectilinearGrid::SafeDownCast(data))
        rectilinear->GetDimensions(d.data());
    else if (auto *curvilinear = vtkStructuredGrid::SafeDownCast(data))
        curvilinear->GetDimensions(d.data());
    else
        return false;
    return d[0] > 1 && d[1] > 1 && d[2] > 1;
}

template <typename Array> vtkSmartPointer<vtkCellArray> list_hexes(const dimensions &d)
{
    using id = typename Array::ValueType;
    const int64_t line = d[0], plane = line * d[1];
    const int64_t count = (line - 1) * (d[1] - 1) * (d[2] - 1);
    vtkNew<Array> offsets, connectivity;
    offsets->SetNumberOfValues(count + 1);
    connectivity->SetNumberOfValues(count * 8);
    for (int64_t i = 0; i <= count; i++) offsets->SetValue(i, static_cast<id>(i * 8));
    id *to = connectivity->GetPointer(0);
    for (int64_t k = 0; k + 1 < d[2]; k++)
        for (int64_t j = 0; j + 1 < d[1]; j++)
            for (int64_t i = 0; i + 1 < line; i++) {
                const int64_t low = i + j * line + k * plane, high = low + plane;
                for (const int64_t first : {low, high})
                    for (const int64_t corner : {first, first + 1, first + 1 + line, first + line})
                        *to++ = static_cast<id>(corner);
            }
    auto hexes = vtkSmartPointer<vtkCellArray>::New();
    hexes->SetData(offsets, connectivity);
    return hexes;
}

void set_hexes(const dimensions &d, vtkUnstructuredGrid *grid)
{
    /* The offsets go up to eight times the cells, of which there are fewer than points. */
    const int64_t points = static_cast<int64_t>(d[0]) * d[1] * d[2];
    const bool is_small = points < std::numeric_limits<int32_t>::max() / 8;
    grid->SetCells(VTK_HEXAHEDRON, is_small ? list_hexes<vtkTypeInt32Array>(d) : list_hexes<vtkTypeInt64Array>(d));
}

/* Cells of any other data set, one by one. */
void set_cells(vtkDataSet *data, vtkUnstructuredGrid *grid)
{
    vtkNew<vtkIdList> points;
    grid->Allocate(data->GetNumberOfCells());
    for (vtkIdType i = 0; i < data->GetNumberOfCells(); i++) {
        data->GetCellPoints(i, points);
        grid->InsertNextCell(data->GetCellType(i), points);
    }
}

bool has_float_axes(vtkRectilinearGrid *grid)
{
    return grid && grid->GetXCoordinates()->GetDataType() == VTK_FLOAT &&
           grid->GetYCoordinates()->GetDataType() == VTK_FLOAT && grid->GetZCoordinates()->GetDataType() == VTK_FLOAT;
}

void set_points(vtkDataSet *data, vtkUnstructuredGrid *grid)
{
    auto *set = vtkPointSet::SafeDownCast(data);
    if (set && set->GetPoints()) {
        grid->SetPoints(set->GetPoints());
        return;
    }
    vtkNew<vtkPoints> points;
    points->SetDataType(has_float_axes(vtkRectilinearGrid::SafeDownCast(data)) ? VTK_FLOAT : VTK_DOUBLE);
    points->SetNumberOfPoints(data->GetNumberOfPoints());
    for (vtkIdType i = 0; i < data->GetNumberOfPoints(); i++) {
        double at[3];
        data->GetPoint(i, at);
        points->SetPoint(i, at);
    }
    grid->SetPoints(points);
}

/* A structured grid may hide cells by their points; a flag of the cell then says the same. */
void hide_cells_of_hidden_points(vtkUnstructuredGrid *grid)
{
    vtkUnsignedCharArray *points = grid->GetPointGhostArray(), *cells = grid->GetCellGhostArray();
    if (!points || points->GetNumberOfValues() != grid->GetNumberOfPoints()) return;
    vtkNew<vtkUnsignedCharArray> flags;
    flags->SetName(vtkDataSetAttributes::GhostArrayName());
    flags->SetNumberOfValues(grid->GetNumberOfCells());
    bool is_any_hidden = false;
    for (vtkIdType i = 0; i < grid->GetNumberOfCells(); i++) {
        unsigned flag = cells && i < cells->GetNumberOfValues() ? cells->GetValue(i) : 0;
        vtkIdType count = 0;
        const vtkIdType *ids = nullptr;
        grid->GetCellPoints(i, count, ids);
        for (vtkIdType k = 0; k < count; k++)
            if (points->GetValue(ids[k]) & vtkDataSetAttributes::HIDDENPOINT) flag |= vtkDataSetAttributes::HIDDENCELL;
        is_any_hidden = is_any_hidden || flag;
        flags->SetValue(i, static_cast<unsigned char>(flag));
    }
    if (is_any_hidden) grid->GetCellData()->AddArray(flags);
}

} // namespace

vtkUnstructuredGrid *insitu_vtk_make_grid(vtkDataSet *data)
{
    vtkNew<vtkUnstructuredGrid> grid;
    grid->GetPointData()->ShallowCopy(data->GetPointData());
    grid->GetCellData()->ShallowCopy(data->GetCellData());
    grid->GetFieldData()->ShallowCopy(data->GetFieldData());
    set_points(data, grid);
    dimensions d{};
    if (get_dimensions(data, d)) {
        set_hexes(d, grid);
        hide_cells_of_hidden_points(grid);
    } else {
        set_cells(data, grid);
    }
    grid->Register(nullptr);
    return grid;
}
