/* Counts and ranges cover all leaves of a composite, so that a field of several blocks is printed as one line. Values
 * in hidden cells are often meaningless and are ignored. */
#include "data_info.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <map>
#include <utility>

#include <vtkBoundingBox.h>
#include <vtkCellData.h>
#include <vtkCellType.h>
#include <vtkCellTypes.h>
#include <vtkCompositeDataIterator.h>
#include <vtkCompositeDataSet.h>
#include <vtkDataArray.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkSmartPointer.h>
#include <vtkUnsignedCharArray.h>
#include <vtkUnstructuredGrid.h>

#include "drawn_cells.h"

namespace render_tool
{

namespace
{

struct field_info {
    std::string type;
    int components = 1;
    int leaves = 0;
    bool is_finite = true;
    std::vector<std::pair<double, double>> ranges; // range of each component, followed by that of the magnitude
};

struct data_summary {
    std::map<int, int64_t> cells; // number of visible cells by type
    int64_t hidden_cells = 0;
    int64_t points = 0;
    int leaves = 0;
    std::string point_type;
    vtkBoundingBox bounds;
    std::map<std::string, field_info> fields[2]; // fields of the points and fields of the cells, by name
};

void add_value(std::pair<double, double> &range, double value, bool &is_finite)
{
    if (!std::isfinite(value)) {
        is_finite = false;
        return;
    }
    range.first = std::min(range.first, value);
    range.second = std::max(range.second, value);
}

bool has(const std::vector<bool> &selected, vtkIdType i)
{
    return selected.empty() || (i < static_cast<vtkIdType>(selected.size()) && selected[static_cast<size_t>(i)]);
}

void add_array(vtkDataArray *array, const std::vector<bool> &selected, field_info &info)
{
    const int components = array->GetNumberOfComponents();
    const double infinity = std::numeric_limits<double>::infinity();
    info.type = array->GetDataTypeAsString();
    info.components = components;
    info.leaves++;
    info.ranges.resize(static_cast<size_t>(components) + 1, {infinity, -infinity});
    for (vtkIdType i = 0; i < array->GetNumberOfTuples(); i++) {
        if (!has(selected, i)) continue;
        double square = 0;
        for (int c = 0; c < components; c++) {
            const double value = array->GetComponent(i, c);
            add_value(info.ranges[static_cast<size_t>(c)], value, info.is_finite);
            square += value * value;
        }
        add_value(info.ranges.back(), std::sqrt(square), info.is_finite);
    }
}

void add_arrays(vtkDataSetAttributes *data, const std::vector<bool> &selected,
                std::map<std::string, field_info> &fields)
{
    for (int i = 0; i < data->GetNumberOfArrays(); i++) {
        vtkDataArray *array = data->GetArray(i);
        if (!array || !array->GetName() || array->GetName() == std::string(vtkDataSetAttributes::GhostArrayName()))
            continue;
        add_array(array, selected, fields[array->GetName()]);
    }
}

void add_bounds(vtkPoints *points, const std::vector<bool> &selected, vtkBoundingBox &bounds)
{
    for (vtkIdType i = 0; points && i < points->GetNumberOfPoints(); i++)
        if (has(selected, i)) bounds.AddPoint(points->GetPoint(i));
}

void add_grid(vtkUnstructuredGrid *grid, bool only_drawn, data_summary &all)
{
    const selection shown = only_drawn ? select_drawn_cells(grid) : select_visible_cells(grid);
    all.leaves++;
    all.points += grid->GetNumberOfPoints();
    for (vtkIdType i = 0; i < grid->GetNumberOfCells(); i++)
        if (has(shown.cells, i))
            all.cells[grid->GetCellType(i)]++;
        else
            all.hidden_cells++;
    if (grid->GetPoints()) all.point_type = grid->GetPoints()->GetData()->GetDataTypeAsString();
    add_bounds(grid->GetPoints(), shown.points, all.bounds);
    add_arrays(grid->GetPointData(), shown.points, all.fields[0]);
    add_arrays(grid->GetCellData(), shown.cells, all.fields[1]);
}

/* Summarizes all leaves of the data. If only_drawn is set, points, lines, and points that no drawn cell uses are left
 * out, in addition to hidden cells. */
data_summary summarize(vtkDataObject *data, bool only_drawn)
{
    data_summary all;
    const auto add_leaf = [&](vtkDataObject *leaf) {
        auto *grid = vtkUnstructuredGrid::SafeDownCast(leaf);
        if (grid) add_grid(grid, only_drawn, all);
    };
    auto *composite = vtkCompositeDataSet::SafeDownCast(data);
    if (!composite) {
        add_leaf(data);
        return all;
    }
    const auto it = vtkSmartPointer<vtkCompositeDataIterator>::Take(composite->NewIterator());
    for (it->InitTraversal(); !it->IsDoneWithTraversal(); it->GoToNextItem()) add_leaf(it->GetCurrentDataObject());
    return all;
}

/* Converts "vtkQuadraticTetra" to "QuadraticTetra". VTK 9.1 has wrong class names for types from 60 on. */
std::string make_cell_type_name(int type)
{
    static const char *const orders[] = {"Lagrange", "Bezier"};
    static const char *const shapes[] = {"Curve",      "Triangle", "Quadrilateral", "Tetrahedron",
                                         "Hexahedron", "Wedge",    "Pyramid"};
    if (type >= VTK_LAGRANGE_CURVE && type <= VTK_BEZIER_PYRAMID) {
        const int number = type - VTK_LAGRANGE_CURVE;
        return std::string(orders[number / 7]) + shapes[number % 7];
    }
    const std::string name = vtkCellTypes::GetClassNameFromTypeId(type);
    return name.rfind("vtk", 0) == 0 ? name.substr(3) : name;
}

std::string range_text(const std::pair<double, double> &range)
{
    if (range.first > range.second) return "no finite value";
    char text[80];
    std::snprintf(text, sizeof text, "%.6g .. %.6g", range.first, range.second);
    return text;
}

void print_field(const std::string &name, const field_info &field, const char *centring, int leaves)
{
    std::string line = range_text(field.ranges[0]);
    if (field.components > 1) {
        line = "magnitude " + range_text(field.ranges.back());
        for (int c = 0; c < field.components; c++)
            line += "; [" + std::to_string(c) + "] " + range_text(field.ranges[static_cast<size_t>(c)]);
    }
    if (!field.is_finite) line += "  (with values that are not finite)";
    if (field.leaves < leaves) line += "  (in " + std::to_string(field.leaves) + " blocks)";
    std::printf("  %-6s %-24s %-8s x%d  %s\n", centring, name.c_str(), field.type.c_str(), field.components,
                line.c_str());
}

void print_times(const std::vector<double> &times)
{
    if (times.empty()) return;
    std::printf("  times  %zu: %.9g .. %.9g\n", times.size(), times.front(), times.back());
}

} // namespace

void print_info(const std::string &title, vtkDataObject *data, const std::vector<double> &times)
{
    const data_summary all = summarize(data, false);
    int64_t cells = 0;
    for (const auto &[type, count] : all.cells) cells += count;
    std::printf("%s", title.c_str());
    if (vtkCompositeDataSet::SafeDownCast(data)) std::printf(", %d blocks", all.leaves);
    std::printf(", %lld cells, %lld points (%s)\n", static_cast<long long>(cells), static_cast<long long>(all.points),
                all.point_type.empty() ? "none" : all.point_type.c_str());
    for (const auto &[type, count] : all.cells)
        std::printf("  cells  %-24s type %d  %lld\n", make_cell_type_name(type).c_str(), type,
                    static_cast<long long>(count));
    if (all.hidden_cells > 0)
        std::printf("  cells  %-24s %lld\n", "hidden or ghosts", static_cast<long long>(all.hidden_cells));
    if (all.bounds.IsValid()) {
        double b[6];
        all.bounds.GetBounds(b);
        std::printf("  bounds %.9g .. %.9g, %.9g .. %.9g, %.9g .. %.9g\n", b[0], b[1], b[2], b[3], b[4], b[5]);
    }
    for (const auto &[name, field] : all.fields[0]) print_field(name, field, "point", all.leaves);
    for (const auto &[name, field] : all.fields[1]) print_field(name, field, "cell", all.leaves);
    print_times(times);
}

data_extent::data_extent()
{
    std::fill(low, low + 4, std::numeric_limits<double>::infinity());
    std::fill(high, high + 4, -std::numeric_limits<double>::infinity());
}

void add_extent(vtkDataObject *data, const std::string &field, data_extent &extent)
{
    const data_summary all = summarize(data, true);
    for (int axis = 0; all.bounds.IsValid() && axis < 3; axis++) {
        extent.low[axis] = std::min(extent.low[axis], all.bounds.GetMinPoint()[axis]);
        extent.high[axis] = std::max(extent.high[axis], all.bounds.GetMaxPoint()[axis]);
    }
    for (const auto &fields : all.fields) {
        const auto found = fields.find(field);
        if (found == fields.end()) continue;
        const field_info &info = found->second;
        const auto &range = info.components > 1 ? info.ranges.back() : info.ranges[0];
        extent.low[3] = std::min(extent.low[3], range.first);
        extent.high[3] = std::max(extent.high[3], range.second);
        return;
    }
}

} // namespace render_tool
