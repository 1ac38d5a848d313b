/* Counts and ranges are taken over all leaves of a composite, so that a field which every block has is one line. */
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
#include <vtkCellTypes.h>
#include <vtkCompositeDataIterator.h>
#include <vtkCompositeDataSet.h>
#include <vtkDataArray.h>
#include <vtkDataSet.h>
#include <vtkPointData.h>
#include <vtkSmartPointer.h>
#include <vtkUnstructuredGrid.h>

namespace render_tool
{

namespace
{

struct field_info {
    std::string type;
    int components = 1;
    int leaves = 0;
    bool is_finite = true;
    std::vector<std::pair<double, double>> ranges; // of each component, then of the magnitude
};

struct data_summary {
    std::map<int, int64_t> cells;
    int64_t points = 0;
    int leaves = 0;
    std::string point_type;
    vtkBoundingBox bounds;
    std::map<std::string, field_info> fields[2]; // of the points, of the cells
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

void add_array(vtkDataArray *array, field_info &info)
{
    const int components = array->GetNumberOfComponents();
    const double infinity = std::numeric_limits<double>::infinity();
    info.type = array->GetDataTypeAsString();
    info.components = components;
    info.leaves++;
    info.ranges.resize(static_cast<size_t>(components) + 1, {infinity, -infinity});
    for (vtkIdType i = 0; i < array->GetNumberOfTuples(); i++) {
        double square = 0;
        for (int c = 0; c < components; c++) {
            const double value = array->GetComponent(i, c);
            add_value(info.ranges[static_cast<size_t>(c)], value, info.is_finite);
            square += value * value;
        }
        add_value(info.ranges.back(), std::sqrt(square), info.is_finite);
    }
}

void add_arrays(vtkDataSetAttributes *data, std::map<std::string, field_info> &fields)
{
    for (int i = 0; i < data->GetNumberOfArrays(); i++) {
        vtkDataArray *array = data->GetArray(i);
        if (array && array->GetName()) add_array(array, fields[array->GetName()]);
    }
}

void add_leaf(vtkDataObject *object, data_summary &all)
{
    auto *data = vtkDataSet::SafeDownCast(object);
    if (!data) return;
    all.leaves++;
    all.points += data->GetNumberOfPoints();
    for (vtkIdType i = 0; i < data->GetNumberOfCells(); i++) all.cells[data->GetCellType(i)]++;
    if (data->GetNumberOfPoints() > 0) all.bounds.AddBounds(data->GetBounds());
    auto *points = vtkPointSet::SafeDownCast(data);
    if (points && points->GetPoints()) all.point_type = points->GetPoints()->GetData()->GetDataTypeAsString();
    add_arrays(data->GetPointData(), all.fields[0]);
    add_arrays(data->GetCellData(), all.fields[1]);
}

data_summary summarize(vtkDataObject *data)
{
    data_summary all;
    auto *composite = vtkCompositeDataSet::SafeDownCast(data);
    if (!composite) {
        add_leaf(data, all);
        return all;
    }
    const auto it = vtkSmartPointer<vtkCompositeDataIterator>::Take(composite->NewIterator());
    for (it->InitTraversal(); !it->IsDoneWithTraversal(); it->GoToNextItem()) add_leaf(it->GetCurrentDataObject(), all);
    return all;
}

/* "QuadraticTetra" of "vtkQuadraticTetra", with VTK's number. */
std::string cell_name(int type)
{
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

void print_info(const std::string &path, vtkDataObject *data, const std::vector<double> &times)
{
    const data_summary all = summarize(data);
    int64_t cells = 0;
    for (const auto &[type, count] : all.cells) cells += count;
    std::printf("%s: %s", path.c_str(), data->GetClassName());
    if (vtkCompositeDataSet::SafeDownCast(data)) std::printf(", %d blocks", all.leaves);
    std::printf(", %lld cells, %lld points (%s)\n", static_cast<long long>(cells), static_cast<long long>(all.points),
                all.point_type.empty() ? "implicit" : all.point_type.c_str());
    for (const auto &[type, count] : all.cells)
        std::printf("  cells  %-24s type %d  %lld\n", cell_name(type).c_str(), type, static_cast<long long>(count));
    if (all.bounds.IsValid()) {
        double b[6];
        all.bounds.GetBounds(b);
        std::printf("  bounds %.9g .. %.9g, %.9g .. %.9g, %.9g .. %.9g\n", b[0], b[1], b[2], b[3], b[4], b[5]);
    }
    for (const auto &[name, field] : all.fields[0]) print_field(name, field, "point", all.leaves);
    for (const auto &[name, field] : all.fields[1]) print_field(name, field, "cell", all.leaves);
    print_times(times);
}

} // namespace render_tool
