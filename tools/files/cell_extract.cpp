/* VTK's filter vtkExtractCells is not used, because it reads beyond the end of an array of face locations that has
 * fewer entries than the grid has cells. VTK's own readers may produce such arrays. */
#include "cell_extract.h"

#include <algorithm>

#include <vtkCellArray.h>
#include <vtkCellData.h>
#include <vtkCellType.h>
#include <vtkDataArray.h>
#include <vtkFieldData.h>
#include <vtkIdList.h>
#include <vtkIdTypeArray.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkUnsignedCharArray.h>
#include <vtkUnstructuredGrid.h>

namespace render_tool
{

namespace
{

/* Assigns new numbers to points in the order of their first use. */
class renumbering
{
  public:
    explicit renumbering(vtkIdType count) : numbers_(static_cast<size_t>(count), -1) {}

    bool has(vtkIdType point) const { return point >= 0 && point < static_cast<vtkIdType>(numbers_.size()); }
    vtkIdType of(vtkIdType point)
    {
        vtkIdType &number = numbers_[static_cast<size_t>(point)];
        if (number < 0) number = used_->InsertNextId(point);
        return number;
    }

    /* Returns the old numbers of the points in use. */
    vtkIdList *used() { return used_.Get(); }

  private:
    std::vector<vtkIdType> numbers_;
    vtkNew<vtkIdList> used_;
};

/* The face streams of polyhedra. A cell's stream consists of the number of its faces and, for each face, its number of
 * points and its points. The location of a cell is the index at which its stream begins, or -1 if it has none. */
class face_streams
{
  public:
    void add(vtkUnstructuredGrid *grid, vtkIdType cell, renumbering &points)
    {
        const vtkIdType length = find_stream_length(grid, cell, points);
        places_->InsertNextValue(length > 0 ? stream_->GetNumberOfValues() : -1);
        if (length == 0) return;
        const vtkIdType *from = grid->GetFaces()->GetPointer(grid->GetFaceLocations()->GetValue(cell));
        const vtkIdType *const end = from + length;
        stream_->InsertNextValue(*from++);
        while (from < end) {
            const vtkIdType count = *from++;
            stream_->InsertNextValue(count);
            for (vtkIdType k = 0; k < count; k++) stream_->InsertNextValue(points.of(*from++));
        }
    }
    void add_none() { places_->InsertNextValue(-1); }
    bool is_empty() const { return stream_->GetNumberOfValues() == 0; }

    vtkIdTypeArray *stream() { return stream_.Get(); }
    vtkIdTypeArray *places() { return places_.Get(); }

  private:
    vtkNew<vtkIdTypeArray> stream_, places_;

    /* Returns the length of a cell's stream, or 0 if it exceeds the array or names a point that does not exist. */
    static vtkIdType find_stream_length(vtkUnstructuredGrid *grid, vtkIdType cell, const renumbering &points)
    {
        vtkIdTypeArray *const all = grid->GetFaces(), *const starts = grid->GetFaceLocations();
        if (!all || !starts || cell >= starts->GetNumberOfValues()) return 0;
        const vtkIdType begin = starts->GetValue(cell), end = all->GetNumberOfValues();
        if (begin < 0 || begin >= end) return 0;
        vtkIdType at = begin;
        const vtkIdType faces = all->GetValue(at++);
        for (vtkIdType f = 0; f < faces; f++) {
            const vtkIdType count = at < end ? all->GetValue(at++) : -1;
            if (count < 0 || count > end - at) return 0;
            for (vtkIdType k = 0; k < count; k++)
                if (!points.has(all->GetValue(at++))) return 0;
        }
        return at - begin;
    }
};

/* Copies the picked tuples of arrays with one tuple per element; other arrays are left out. A copy has the roles of
 * its array among the attributes (scalars, degrees of cells of higher order, ...). */
void extract_arrays(vtkDataSetAttributes *from, vtkIdType count, vtkIdList *picked, vtkDataSetAttributes *to)
{
    for (int i = 0; i < from->GetNumberOfArrays(); i++) {
        vtkAbstractArray *array = from->GetAbstractArray(i);
        if (array->GetNumberOfTuples() != count) continue;
        const auto part = vtkSmartPointer<vtkAbstractArray>::Take(array->NewInstance());
        part->SetName(array->GetName());
        part->SetNumberOfComponents(array->GetNumberOfComponents());
        part->SetNumberOfTuples(picked->GetNumberOfIds());
        array->GetTuples(picked, part);
        const int index = to->AddArray(part);
        for (int type = 0; type < vtkDataSetAttributes::NUM_ATTRIBUTES; type++)
            if (from->GetAbstractAttribute(type) == array) to->SetActiveAttribute(index, type);
    }
}

void extract_points(vtkUnstructuredGrid *grid, vtkIdList *picked, vtkUnstructuredGrid *part)
{
    vtkNew<vtkPoints> places;
    if (grid->GetPoints()) {
        places->SetDataType(grid->GetPoints()->GetDataType());
        places->SetNumberOfPoints(picked->GetNumberOfIds());
        grid->GetPoints()->GetPoints(picked, places);
    }
    part->SetPoints(places);
}

/* Copies the cells to `part`; returns the old numbers of the points they use. */
vtkSmartPointer<vtkIdList> extract_grid_cells(vtkUnstructuredGrid *grid, const std::vector<vtkIdType> &cells,
                                              vtkUnstructuredGrid *part)
{
    renumbering points(grid->GetNumberOfPoints());
    face_streams faces;
    vtkNew<vtkUnsignedCharArray> types;
    vtkNew<vtkCellArray> list;
    for (const vtkIdType cell : cells) {
        vtkIdType count = 0;
        const vtkIdType *ids = nullptr;
        grid->GetCellPoints(cell, count, ids);
        list->InsertNextCell(static_cast<int>(count));
        for (vtkIdType k = 0; k < count; k++) list->InsertCellPoint(points.of(ids[k]));
        types->InsertNextValue(static_cast<unsigned char>(grid->GetCellType(cell)));
        if (grid->GetCellType(cell) == VTK_POLYHEDRON)
            faces.add(grid, cell, points);
        else
            faces.add_none();
    }
    if (faces.is_empty())
        part->SetCells(types, list);
    else
        part->SetCells(types, list, faces.places(), faces.stream());
    return points.used();
}

} // namespace

vtkSmartPointer<vtkUnstructuredGrid> extract_cells(vtkUnstructuredGrid *grid, const std::vector<vtkIdType> &cells)
{
    auto part = vtkSmartPointer<vtkUnstructuredGrid>::New();
    const auto points = extract_grid_cells(grid, cells, part);
    extract_points(grid, points, part);
    extract_arrays(grid->GetPointData(), grid->GetNumberOfPoints(), points, part->GetPointData());
    vtkNew<vtkIdList> picked;
    picked->SetNumberOfIds(static_cast<vtkIdType>(cells.size()));
    std::copy(cells.begin(), cells.end(), picked->begin());
    extract_arrays(grid->GetCellData(), grid->GetNumberOfCells(), picked, part->GetCellData());
    part->GetFieldData()->ShallowCopy(grid->GetFieldData());
    return part;
}

} // namespace render_tool
