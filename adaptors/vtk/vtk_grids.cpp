/* The points of curvilinear grids, the polygons of polygonal data and all arrays are shared with VTK's data set. The
 * conversion to an unstructured grid allocates a list of hexahedra with 37 bytes per cell including offset and type,
 * and for images and rectilinear grids a list of points with 24 bytes each. */
#include "insitu/vtk_grids.h"

#include <cstdint>
#include <limits>

#include <vtkCellArray.h>
#include <vtkCellData.h>
#include <vtkCellType.h>
#include <vtkDataSet.h>
#include <vtkFieldData.h>
#include <vtkIdList.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>
#include <vtkRectilinearGrid.h>
#include <vtkSmartPointer.h>
#include <vtkTypeInt32Array.h>
#include <vtkTypeInt64Array.h>
#include <vtkUnsignedCharArray.h>
#include <vtkUnstructuredGrid.h>

#include "vtk_lattices.h"

namespace
{

/* The size of a structured grid in points, counted only along the axes that have more than one point. row_points:
 * number of points along the first of these axes. row_count: number of points along the second one. layer_count: number
 * of points along the third one; 1 if the grid is flat. */
struct lattice {
    int64_t row_points = 1, row_count = 1, layer_count = 1;

    int64_t points() const { return row_points * row_count * layer_count; }
    bool is_flat() const { return layer_count == 1; }
    int corners() const { return is_flat() ? 4 : 8; }
    int64_t cells() const { return (row_points - 1) * (row_count - 1) * (is_flat() ? 1 : layer_count - 1); }
};

/* Returns false if data is not a structured data set with cells along at least two axes. */
bool find_lattice(vtkDataSet *data, lattice &l)
{
    int64_t cells[3], axes[3] = {1, 1, 1};
    if (!insitu_vtk::count_cells_of_lattice(data, cells)) return false;
    size_t count = 0;
    for (const int64_t along : cells)
        if (along > 0) axes[count++] = along + 1;
    l = {axes[0], axes[1], axes[2]};
    return true;
}

/* Lists the cells in VTK's order, including hidden ones. */
template <typename Array> vtkSmartPointer<vtkCellArray> list_cells(const lattice &l)
{
    using id = typename Array::ValueType;
    const int64_t row_points = l.row_points, plane = l.row_points * l.row_count, count = l.cells();
    vtkNew<Array> offsets, connectivity;
    offsets->SetNumberOfValues(count + 1);
    connectivity->SetNumberOfValues(count * l.corners());
    for (int64_t i = 0; i <= count; i++) offsets->SetValue(i, static_cast<id>(i) * l.corners());
    id *to = connectivity->GetPointer(0);
    for (int64_t k = 0; k < (l.is_flat() ? 1 : l.layer_count - 1); k++)
        for (int64_t j = 0; j + 1 < l.row_count; j++)
            for (int64_t i = 0; i + 1 < row_points; i++) {
                const int64_t low = i + j * row_points + k * plane, last = l.is_flat() ? low : low + plane;
                for (int64_t first = low; first <= last; first += plane)
                    for (const int64_t corner : {first, first + 1, first + 1 + row_points, first + row_points})
                        *to++ = static_cast<id>(corner);
            }
    auto cells = vtkSmartPointer<vtkCellArray>::New();
    cells->SetData(offsets, connectivity);
    return cells;
}

void set_lattice(const lattice &l, vtkUnstructuredGrid *grid)
{
    /* The largest offset is eight times the number of cells. There are fewer cells than points. */
    const bool is_small = l.points() < std::numeric_limits<int32_t>::max() / 8;
    grid->SetCells(l.is_flat() ? VTK_QUAD : VTK_HEXAHEDRON,
                   is_small ? list_cells<vtkTypeInt32Array>(l) : list_cells<vtkTypeInt64Array>(l));
}

/* Makes grid use data's list of polygons without a copy. Returns false if data contains other cells too. */
bool borrow_polygons(vtkPolyData *data, vtkUnstructuredGrid *grid)
{
    if (!data || data->GetNumberOfVerts() > 0 || data->GetNumberOfLines() > 0 || data->GetNumberOfStrips() > 0)
        return false;
    vtkCellArray *polygons = data->GetPolys();
    vtkNew<vtkUnsignedCharArray> types;
    types->SetNumberOfValues(polygons->GetNumberOfCells());
    for (vtkIdType i = 0; i < polygons->GetNumberOfCells(); i++) {
        const vtkIdType size = polygons->GetCellSize(i);
        types->SetValue(i, size == 3 ? VTK_TRIANGLE : size == 4 ? VTK_QUAD : VTK_POLYGON);
    }
    grid->SetCells(types, polygons);
    return true;
}

/* Copies the cells of any other data set to grid, one by one. */
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

/* Flags cells with a hidden point as hidden. VTK hides such cells of structured grids although the cells themselves
 * have no flag. */
void hide_cells_of_hidden_points(vtkDataSet *data, vtkUnstructuredGrid *grid)
{
    insitu_lattice lattice = {};
    insitu_vtk::count_cells_of_lattice(data, lattice.cells);
    const auto flags = insitu_vtk::make_lattice_ghost_flags(data, lattice);
    if (!flags || flags->GetName()) return;
    bool is_any_hidden = false;
    for (vtkIdType i = 0; i < flags->GetNumberOfValues(); i++) is_any_hidden = is_any_hidden || flags->GetValue(i);
    flags->SetName(vtkDataSetAttributes::GhostArrayName());
    if (is_any_hidden) grid->GetCellData()->AddArray(flags);
}

} // namespace

vtkUnsignedCharArray *insitu_vtk_ghost_flags(vtkDataSetAttributes *data, int64_t count)
{
    const auto array_of = [&](const char *name) -> vtkDataArray * {
        vtkDataArray *array = data->GetArray(name);
        const bool fits = array && array->GetNumberOfTuples() == count && array->GetNumberOfComponents() == 1;
        return fits ? array : nullptr;
    };
    vtkDataArray *own = array_of(vtkDataSetAttributes::GhostArrayName()), *zones = array_of("avtGhostZones");
    auto *bytes = vtkUnsignedCharArray::SafeDownCast(own);
    if ((!own && !zones) || (bytes && !zones)) {
        if (bytes) bytes->Register(nullptr);
        return bytes;
    }
    vtkNew<vtkUnsignedCharArray> flags;
    flags->SetName(vtkDataSetAttributes::GhostArrayName());
    flags->SetNumberOfValues(count);
    for (vtkIdType i = 0; i < count; i++) {
        unsigned flag = own ? static_cast<unsigned>(own->GetComponent(i, 0)) : 0;
        if (zones && zones->GetComponent(i, 0) != 0) flag |= vtkDataSetAttributes::DUPLICATECELL;
        flags->SetValue(i, static_cast<unsigned char>(flag));
    }
    flags->Register(nullptr);
    return flags;
}

vtkUnstructuredGrid *insitu_vtk_make_grid(vtkDataSet *data)
{
    vtkNew<vtkUnstructuredGrid> grid;
    grid->GetPointData()->ShallowCopy(data->GetPointData());
    grid->GetCellData()->ShallowCopy(data->GetCellData());
    grid->GetFieldData()->ShallowCopy(data->GetFieldData());
    set_points(data, grid);
    lattice l;
    if (find_lattice(data, l)) {
        set_lattice(l, grid);
        hide_cells_of_hidden_points(data, grid);
    } else if (!borrow_polygons(vtkPolyData::SafeDownCast(data), grid)) {
        set_cells(data, grid);
    }
    grid->Register(nullptr);
    return grid;
}
