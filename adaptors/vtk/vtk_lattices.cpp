#include "vtk_lattices.h"

#include <array>

#include <vtkCellData.h>
#include <vtkDataSetAttributes.h>
#include <vtkImageData.h>
#include <vtkMatrix3x3.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkRectilinearGrid.h>
#include <vtkStructuredGrid.h>
#include <vtkUnsignedCharArray.h>

#include "insitu/vtk_grids.h"

namespace insitu_vtk
{

namespace
{

/* Sets origin, spacing and first index of an image. The coordinate along an axis is spacing * i + origin, with i
 * counted in the whole extent. Returns false if the axes are rotated or a spacing is 0. */
bool set_uniform_coordinates(vtkImageData *image, insitu_lattice &lattice)
{
    if (!image || !image->GetDirectionMatrix()->IsIdentity()) return false;
    const double *origin = image->GetOrigin(), *spacing = image->GetSpacing();
    const int *extent = image->GetExtent();
    for (int a = 0; a < 3; a++)
        if (spacing[a] == 0 && lattice.cells[a]) return false;
    for (int a = 0; a < 3; a++) {
        lattice.origin[a] = origin[a];
        lattice.spacing[a] = spacing[a];
        lattice.first[a] = extent[2 * a];
    }
    return true;
}

bool set_rectilinear_axes(vtkRectilinearGrid *grid, const std::string &what, held_arrays &held, conversion_log &log,
                          insitu_lattice &lattice)
{
    if (!grid) return false;
    vtkDataArray *axes[3] = {grid->GetXCoordinates(), grid->GetYCoordinates(), grid->GetZCoordinates()};
    for (int a = 0; a < 3; a++) {
        array_view view = borrow_or_copy_array(axes[a], what + " axis", held, log);
        held.objects.emplace_back(axes[a]);
        if (view.type != INSITU_FLOAT32 && view.type != INSITU_FLOAT64) {
            auto *copy = reinterpret_cast<double *>(held.allocate(static_cast<size_t>(view.tuple_count) * 8));
            for (vtkIdType i = 0; i < axes[a]->GetNumberOfTuples(); i++) copy[i] = axes[a]->GetComponent(i, 0);
            log.copied(what + " axis", "numbers that are no floats", view.tuple_count * 8);
            view = {copy, INSITU_FLOAT64, view.tuple_count, 1, 8, 8};
        }
        lattice.axes[a] = {view.data, view.type, view.tuple_stride_bytes};
    }
    return true;
}

/* Lists the points of an image whose axes are rotated or have no spacing. */
void list_points(vtkDataSet *data, const std::string &what, held_arrays &held, conversion_log &log, insitu_mesh &mesh)
{
    const vtkIdType points = data->GetNumberOfPoints();
    auto *xyz = reinterpret_cast<double *>(held.allocate(static_cast<size_t>(points) * 24));
    for (vtkIdType i = 0; i < points; i++) data->GetPoint(i, xyz + 3 * i);
    for (int a = 0; a < 3; a++) mesh.coordinates[a] = {xyz + a, INSITU_FLOAT64, 24};
    log.copied(what + " points", std::string("those of a ") + data->GetClassName() + " listed", points * 24);
}

} // namespace

bool count_cells_of_lattice(vtkDataSet *data, int64_t cells[3])
{
    std::array<int, 3> d{};
    if (auto *image = vtkImageData::SafeDownCast(data))
        image->GetDimensions(d.data());
    else if (auto *rectilinear = vtkRectilinearGrid::SafeDownCast(data))
        rectilinear->GetDimensions(d.data());
    else if (auto *curvilinear = vtkStructuredGrid::SafeDownCast(data))
        curvilinear->GetDimensions(d.data());
    int count = 0;
    for (size_t a = 0; a < 3; a++) {
        if (d[a] < 1) return false;
        cells[a] = d[a] - 1;
        count += d[a] > 1;
    }
    return count > 1;
}

bool view_lattice(vtkDataSet *data, const std::string &what, held_arrays &held, conversion_log &log, insitu_mesh &mesh,
                  insitu_lattice &lattice)
{
    lattice = {};
    if (!count_cells_of_lattice(data, lattice.cells)) return false;
    mesh.vertex_count = data->GetNumberOfPoints();
    mesh.cell_count = data->GetNumberOfCells();
    mesh.lattice = &lattice;
    mesh.cell_type = lattice.cells[0] && lattice.cells[1] && lattice.cells[2] ? INSITU_HEX : INSITU_QUAD;
    auto *set = vtkPointSet::SafeDownCast(data);
    if (set && set->GetPoints())
        view_points(set->GetPoints()->GetData(), what + " points", held, log, mesh.coordinates);
    else if (!set && !set_uniform_coordinates(vtkImageData::SafeDownCast(data), lattice) &&
             !set_rectilinear_axes(vtkRectilinearGrid::SafeDownCast(data), what, held, log, lattice))
        list_points(data, what, held, log, mesh);
    return true;
}

vtkSmartPointer<vtkUnsignedCharArray> make_lattice_ghost_flags(vtkDataSet *data, const insitu_lattice &lattice)
{
    using flag_list = vtkSmartPointer<vtkUnsignedCharArray>;
    auto cells = flag_list::Take(insitu_vtk_ghost_flags(data->GetCellData(), data->GetNumberOfCells()));
    const auto points = flag_list::Take(insitu_vtk_ghost_flags(data->GetPointData(), data->GetNumberOfPoints()));
    if (!points) return cells;
    const int64_t *n = lattice.cells, step[3] = {1, n[0] + 1, (n[0] + 1) * (n[1] + 1)};
    if (data->GetNumberOfPoints() != step[2] * (n[2] + 1)) return cells;
    auto flags = flag_list::New();
    flags->SetNumberOfValues(data->GetNumberOfCells());
    for (vtkIdType cell = 0; cell < data->GetNumberOfCells(); cell++) {
        int64_t rest = cell, first = 0;
        for (int a = 0; a < 3; a++) {
            const int64_t along = n[a] ? n[a] : 1;
            first += rest % along * step[a];
            rest /= along;
        }
        unsigned flag = cells ? cells->GetValue(cell) : 0;
        for (int corner = 0; corner < 8; corner++) {
            int64_t point = first;
            for (int a = 0; a < 3; a++) point += n[a] ? (corner >> a & 1) * step[a] : 0;
            if (points->GetValue(point) & vtkDataSetAttributes::HIDDENPOINT) flag |= vtkDataSetAttributes::HIDDENCELL;
        }
        flags->SetValue(cell, static_cast<unsigned char>(flag));
    }
    return flags;
}

} // namespace insitu_vtk
