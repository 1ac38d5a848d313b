/* Estimates how much of a field the outer surface shows. The faces that point to the viewer are considered, weighted by
 * their projected area. The measure is the interval between the 5th and 95th percentile of their values, relative to
 * the field's whole range. It is 0.07 to 0.32 for grids whose interior is of interest (a heated disk, a wind tunnel, a
 * blood vessel), and at least 0.44 for grids whose surface shows the result. */
#include "default_look.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <vector>

#include <vtkBoundingBox.h>
#include <vtkCell.h>
#include <vtkCellData.h>
#include <vtkCellTypes.h>
#include <vtkCompositeDataIterator.h>
#include <vtkCompositeDataSet.h>
#include <vtkDataArray.h>
#include <vtkDataSetSurfaceFilter.h>
#include <vtkGenericCell.h>
#include <vtkMath.h>
#include <vtkMultiBlockDataSet.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPolyData.h>
#include <vtkUnstructuredGrid.h>
#include <vtk_utf8.h>

#include "data_file.h"
#include "drawn_cells.h"
#include "grids_of.h"

namespace render_tool
{

namespace
{

using vector = std::array<double, 3>;

constexpr vector default_direction = {1, 0.8, 1.2};
constexpr double interior_threshold = 0.35; // the interior is shown if the outer surface shows less than this fraction
                                            // of the field's range

using grid_list = std::vector<vtkSmartPointer<vtkUnstructuredGrid>>;

/* Returns the grids in data, with only those cells and points that are drawn. */
grid_list list_grids(vtkDataObject *data)
{
    grid_list grids;
    const auto add = [&](vtkDataObject *leaf) {
        auto *const grid = vtkUnstructuredGrid::SafeDownCast(leaf);
        if (!grid) return;
        const auto drawn = extract_drawn_cells(grid);
        if (drawn->GetNumberOfCells() > 0) grids.push_back(drawn);
    };
    auto *composite = vtkCompositeDataSet::SafeDownCast(data);
    if (!composite) {
        add(data);
        return grids;
    }
    const auto leaves = vtkSmartPointer<vtkCompositeDataIterator>::Take(composite->NewIterator());
    for (leaves->InitTraversal(); !leaves->IsDoneWithTraversal(); leaves->GoToNextItem())
        add(leaves->GetCurrentDataObject());
    return grids;
}

/* Checks whether an array is a field to display. Arrays of ids and VTK's own flags are not displayed, nor are arrays
 * whose names are not UTF-8, because a scene is UTF-8 and cannot name them. */
bool is_field(vtkDataArray *array)
{
    const std::string name = array && array->GetName() ? array->GetName() : "";
    return !name.empty() && utf8::is_valid(name.begin(), name.end()) && name.rfind("vtk", 0) != 0 &&
           name != "GlobalNodeId" && name != "GlobalElementId" && name != "ObjectId" && name != "PedigreeNodeId" &&
           name != "PedigreeElementId";
}

void add_names(vtkFieldData *fields, std::vector<std::string> &names)
{
    for (int i = 0; fields && i < fields->GetNumberOfArrays(); i++)
        if (is_field(fields->GetArray(i))) names.emplace_back(fields->GetArray(i)->GetName());
}

/* Returns the names of all fields: those of points first. */
std::vector<std::string> list_field_names(const grid_list &grids)
{
    std::vector<std::string> names;
    for (vtkUnstructuredGrid *grid : grids) add_names(grid->GetPointData(), names);
    for (vtkUnstructuredGrid *grid : grids) add_names(grid->GetCellData(), names);
    return names;
}

/* Returns the first field that both steps have, or otherwise the first field of the last step, or "" if there are no
 * fields. The last step is preferred because the first step of a run often lacks fields that are computed later. */
std::string choose_field(const std::vector<std::string> &first, const std::vector<std::string> &last)
{
    for (const std::string &name : first)
        if (std::find(last.begin(), last.end(), name) != last.end()) return name;
    if (!last.empty()) return last.front();
    return first.empty() ? "" : first.front();
}

/* Returns a tuple's value, or its magnitude if there are several components. */
double find_tuple_value(vtkDataArray *array, vtkIdType i)
{
    const int components = array->GetNumberOfComponents();
    if (components == 1) return array->GetComponent(i, 0);
    double square = 0;
    for (int c = 0; c < components; c++) square += array->GetComponent(i, c) * array->GetComponent(i, c);
    return std::sqrt(square);
}

vtkDataArray *find_array(vtkDataSet *data, const std::string &field, bool &is_at_points)
{
    vtkDataArray *array = data->GetPointData()->GetArray(field.c_str());
    is_at_points = array != nullptr;
    return array ? array : data->GetCellData()->GetArray(field.c_str());
}

/* Returns the highest dimension of the grid's cells. */
int find_dimension(vtkUnstructuredGrid *grid)
{
    vtkNew<vtkCellTypes> types;
    grid->GetCellTypes(types);
    int most = 0;
    for (vtkIdType i = 0; i < types->GetNumberOfTypes(); i++) {
        const auto cell = vtkSmartPointer<vtkCell>::Take(vtkGenericCell::InstantiateCell(types->GetCellType(i)));
        if (cell) most = std::max(most, cell->GetCellDimension());
    }
    return most;
}

struct visible_value {
    double value, area;
};

/* Returns twice the projected area of a face in the viewing direction; negative if it points away from the viewer. */
double compute_twice_projected_area(vtkPolyData *faces, vtkIdType count, const vtkIdType *points,
                                    const vector &to_viewer)
{
    vector first{}, last{};
    faces->GetPoint(points[0], first.data());
    faces->GetPoint(points[1], last.data());
    double area = 0;
    for (vtkIdType k = 2; k < count; k++) {
        vector next{}, to_last{}, to_next{}, normal{};
        faces->GetPoint(points[k], next.data());
        vtkMath::Subtract(last, first, to_last);
        vtkMath::Subtract(next, first, to_next);
        vtkMath::Cross(to_last.data(), to_next.data(), normal.data());
        area += vtkMath::Dot(normal, to_viewer);
        last = next;
    }
    return area;
}

/* Adds to `visible` the value and twice the projected area of each face of the grid's outer surface that points to the
 * viewer. */
void add_visible_faces(vtkUnstructuredGrid *grid, const std::string &field, const vector &to_viewer,
                       std::vector<visible_value> &visible)
{
    vtkNew<vtkDataSetSurfaceFilter> filter;
    filter->SetInputData(grid);
    filter->SetNonlinearSubdivisionLevel(0);
    filter->Update();
    vtkPolyData *faces = filter->GetOutput();
    bool is_at_points = false;
    vtkDataArray *values = find_array(faces, field, is_at_points);
    for (vtkIdType f = 0; values && f < faces->GetNumberOfCells(); f++) {
        vtkIdType count = 0;
        const vtkIdType *points = nullptr;
        faces->GetCellPoints(f, count, points);
        const double area = count < 3 ? 0 : compute_twice_projected_area(faces, count, points, to_viewer);
        double value = is_at_points ? 0 : find_tuple_value(values, f);
        for (vtkIdType k = 0; is_at_points && k < count; k++)
            value += find_tuple_value(values, points[k]) / static_cast<double>(count);
        if (area > 0 && std::isfinite(value)) visible.push_back({value, area});
    }
}

/* Returns how much of the field the outer surface shows: the length of the interval between the 5th and the 95th
 * percentile of its values, as a fraction of the field's range. Returns 1 if it cannot be computed. */
double compute_visible_range_fraction(const grid_list &grids, const std::string &field, const vector &to_viewer)
{
    double low = std::numeric_limits<double>::infinity(), high = -low, area = 0, below = 0;
    std::vector<visible_value> visible;
    for (vtkUnstructuredGrid *grid : grids) {
        bool is_at_points = false;
        vtkDataArray *values = find_array(grid, field, is_at_points);
        for (vtkIdType i = 0; values && i < values->GetNumberOfTuples(); i++) {
            const double value = find_tuple_value(values, i);
            if (!std::isfinite(value)) continue;
            low = std::min(low, value);
            high = std::max(high, value);
        }
        if (values) add_visible_faces(grid, field, to_viewer, visible);
    }
    if (visible.empty() || !(high > low)) return 1;
    std::sort(visible.begin(), visible.end(), [](auto &a, auto &b) { return a.value < b.value; });
    for (const visible_value &s : visible) area += s.area;
    double first = visible.front().value, last = first;
    for (const visible_value &s : visible) {
        if (below < 0.05 * area) first = s.value;
        if (below < 0.95 * area) last = s.value;
        below += s.area;
    }
    return (last - first) / (high - low);
}

/* Returns the normal of the best cut. Of the three planes through the centre that are perpendicular to an axis, the
 * best one has the largest projected area within the bounds, as seen by the viewer. The normal points towards the
 * viewer. */
std::array<int, 3> choose_cut_normal(const vtkBoundingBox &bounds, const vector &to_viewer)
{
    std::array<int, 3> cut = {0, 0, 0};
    double most = 0;
    for (int axis = 0; axis < 3; axis++) {
        const auto a = static_cast<size_t>(axis);
        const double face = bounds.GetLength((axis + 1) % 3) * bounds.GetLength((axis + 2) % 3);
        const double shown = face * std::fabs(to_viewer[a]);
        if (shown <= most) continue;
        most = shown;
        cut = {0, 0, 0};
        cut[a] = to_viewer[a] > 0 ? 1 : -1;
    }
    return cut;
}

/* Reads all parts of a step, on whichever rank calls. The files given with --pieces are one step. */
vtkSmartPointer<vtkDataObject> read_whole_step(const options &o, const step_source &source, size_t step)
{
    const auto read = [](const std::string &path, size_t index) {
        return grids_of(open_data_file(path)->read(index, 0, 1), path);
    };
    if (!o.pieces) return read(source.path(step), source.index_in_file(step));
    auto all = vtkSmartPointer<vtkMultiBlockDataSet>::New();
    all->SetNumberOfBlocks(static_cast<unsigned>(o.files.size()));
    for (size_t f = 0; f < o.files.size(); f++) all->SetBlock(static_cast<unsigned>(f), read(o.files[f], 0));
    return all;
}

} // namespace

std::array<double, 3> eye_direction(const options &o)
{
    vector to_viewer = default_direction;
    if (!o.direction.empty())
        (void)std::sscanf(o.direction.c_str(), "%lf, %lf, %lf", &to_viewer[0], &to_viewer[1], &to_viewer[2]);
    return to_viewer;
}

std::array<double, 3> up_direction(const options &o)
{
    const vector to_viewer = eye_direction(o);
    const bool is_upright =
        std::hypot(to_viewer[0], to_viewer[2]) < 1e-6 * std::hypot(to_viewer[0], to_viewer[1], to_viewer[2]);
    if (is_upright) return {0, 0, 1};
    return {0, 1, 0};
}

default_look choose_look(const options &o, const step_source &source)
{
    const auto data = read_whole_step(o, source, 0);
    const grid_list grids = list_grids(data);
    default_look look;
    look.field = o.field;
    if (o.field.empty()) {
        const std::vector<std::string> names = list_field_names(grids);
        const size_t last = source.count() - 1;
        look.field = choose_field(names, last ? list_field_names(list_grids(read_whole_step(o, source, last))) : names);
    }
    vtkBoundingBox bounds;
    int dimension = 0;
    for (vtkUnstructuredGrid *grid : grids) {
        bounds.AddBounds(grid->GetBounds());
        dimension = std::max(dimension, find_dimension(grid));
    }
    for (int axis = 0; dimension == 2 && axis < 3; axis++)
        if (bounds.GetLength(axis) <= 1e-6 * bounds.GetMaxLength()) look.flat_axis = axis;
    const vector to_viewer = eye_direction(o);
    if (dimension == 3 && !o.whole && compute_visible_range_fraction(grids, look.field, to_viewer) < interior_threshold)
        look.cut = choose_cut_normal(bounds, to_viewer);
    return look;
}

} // namespace render_tool
