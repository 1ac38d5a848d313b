#include "default_scene.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <sstream>
#include <system_error>

#include <vtkCellData.h>
#include <vtkCompositeDataIterator.h>
#include <vtkCompositeDataSet.h>
#include <vtkDataArray.h>
#include <vtkDataSet.h>
#include <vtkPointData.h>

#include "data_file.h"
#include "file_kinds.h"
#include "grids_of.h"

namespace render_tool
{

namespace
{

/* A double-quoted scalar of YAML. */
std::string quoted(const std::string &text)
{
    std::string out = "\"";
    for (const char c : text) {
        char code[8];
        if (c == '"' || c == '\\') out += '\\';
        if (static_cast<unsigned char>(c) < 0x20) {
            std::snprintf(code, sizeof code, "\\x%02x", static_cast<unsigned>(c));
            out += code;
        } else {
            out += c;
        }
    }
    return out + '"';
}

/* Arrays of ids, and VTK's own flags, are no fields to look at. */
bool is_field(vtkDataArray *array)
{
    const std::string name = array && array->GetName() ? array->GetName() : "";
    return !name.empty() && name.rfind("vtk", 0) != 0 && name != "GlobalNodeId" && name != "GlobalElementId" &&
           name != "ObjectId" && name != "PedigreeNodeId" && name != "PedigreeElementId";
}

std::string first_field(vtkFieldData *fields)
{
    for (int i = 0; fields && i < fields->GetNumberOfArrays(); i++)
        if (is_field(fields->GetArray(i))) return fields->GetArray(i)->GetName();
    return "";
}

std::string first_field_of(vtkDataObject *data)
{
    std::string at_points, in_cells;
    const auto look = [&](vtkDataSet *grid) {
        if (!grid) return;
        if (at_points.empty()) at_points = first_field(grid->GetPointData());
        if (in_cells.empty()) in_cells = first_field(grid->GetCellData());
    };
    if (auto *composite = vtkCompositeDataSet::SafeDownCast(data)) {
        const auto leaves = vtkSmartPointer<vtkCompositeDataIterator>::Take(composite->NewIterator());
        for (leaves->InitTraversal(); !leaves->IsDoneWithTraversal(); leaves->GoToNextItem())
            look(vtkDataSet::SafeDownCast(leaves->GetCurrentDataObject()));
    } else {
        look(vtkDataSet::SafeDownCast(data));
    }
    return at_points.empty() ? in_cells : at_points;
}

double dot(const std::array<double, 3> &a, const std::array<double, 3> &b)
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

std::array<double, 3> cross(const std::array<double, 3> &a, const std::array<double, 3> &b)
{
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

std::array<double, 3> unit(const std::array<double, 3> &a)
{
    const double length = std::hypot(a[0], a[1], a[2]);
    return {a[0] / length, a[1] / length, a[2] / length};
}

/* The camera from which the box of the extent fills about 0.8 of the picture: a title, numbers beside the colour bar
 * and the text at the bottom have the rest. */
std::string fixed_camera(const options &o, const data_extent &e)
{
    constexpr double angle = 40, filled = 0.8, pi = 3.14159265358979323846; // the scene's default angle, in degrees
    std::array<double, 3> towards{};
    if (std::sscanf(o.direction.c_str(), "%lf, %lf, %lf", &towards[0], &towards[1], &towards[2]) != 3) return "";
    towards = unit(towards);
    std::array<double, 3> up = {0, 1, 0};
    if (std::hypot(towards[0], towards[2]) < 1e-6) up = {0, 0, 1};
    const auto right = unit(cross(up, towards)), above = cross(towards, right);
    const double high = filled * std::tan(angle * pi / 360), wide = high * o.width / o.height;
    std::array<double, 3> middle{}, half{};
    double distance = 0;
    for (size_t i = 0; i < 3; i++) {
        middle[i] = (e.low[i] + e.high[i]) / 2;
        half[i] = (e.high[i] - e.low[i]) / 2;
    }
    for (int corner = 0; corner < 8; corner++) {
        std::array<double, 3> at{};
        for (size_t i = 0; i < 3; i++) at[i] = (corner >> i) & 1 ? half[i] : -half[i];
        const double needed = std::max(std::fabs(dot(at, right)) / wide, std::fabs(dot(at, above)) / high);
        distance = std::max(distance, dot(at, towards) + needed);
    }
    std::ostringstream text;
    text.precision(17);
    for (const char *key : {"position", "focal"}) {
        const double out = key[0] == 'p' ? distance : 0;
        text << (out > 0 ? "{" : ", ") << key << ": [" << middle[0] + out * towards[0] << ", "
             << middle[1] + out * towards[1] << ", " << middle[2] + out * towards[2] << "]";
    }
    text << ", up: [" << up[0] << ", " << up[1] << ", " << up[2] << "]}";
    return distance > 0 ? text.str() : "";
}

/* Eight hexadecimal digits of a text (FNV-1a). */
std::string digits_of(const std::string &text)
{
    uint32_t hash = 0x811c9dc5U;
    for (const char c : text) hash = (hash ^ static_cast<unsigned char>(c)) * 0x01000193U;
    char digits[9];
    std::snprintf(digits, sizeof digits, "%08x", static_cast<unsigned>(hash));
    return digits;
}

/* Tells whether another file of data in the folder would give its pictures this name. */
bool is_shared_name(const std::filesystem::path &file, const std::string &name)
{
    std::error_code code;
    const auto folder = file.has_parent_path() ? file.parent_path() : std::filesystem::path(".");
    for (std::filesystem::directory_iterator at(folder, code), end; !code && at != end; at.increment(code)) {
        const auto other = at->path().filename();
        if (other != file.filename() && kind_of(other.string()) && (other.stem() == name || other == name)) return true;
    }
    return false;
}

/* The name that pictures of a file begin with, of at most 60 bytes. It is the file's without its ending, where that is
 * no other file's. Digits of the ending, of a folder other than the working one, or of a long name tell files apart. */
std::string picture_name(const std::filesystem::path &file)
{
    std::error_code code;
    const std::string stem = file.stem().string();
    const auto folder = std::filesystem::weakly_canonical(std::filesystem::absolute(file, code).parent_path(), code);
    const auto here = std::filesystem::weakly_canonical(std::filesystem::current_path(code), code);
    std::string apart;
    if (folder != here) apart = folder.string();
    if (stem.size() > 60 || is_shared_name(file, stem)) apart += '/' + file.filename().string();
    return apart.empty() ? stem : stem.substr(0, 51) + '_' + digits_of(apart);
}

} // namespace

std::string default_field(const options &o)
{
    if (!o.field.empty()) return o.field;
    const auto file = open_data_file(o.files.front());
    const size_t steps = file->times().size();
    const size_t step = steps ? std::min(static_cast<size_t>(o.first_step), steps - 1) : 0;
    return first_field_of(grids_of(file->read(steps ? step : 0, 0, 1), o.files.front()));
}

std::string default_scene(const options &o, const std::string &field, const data_extent *extent)
{
    const std::filesystem::path file(o.files.front());
    std::string camera = extent && extent->has_bounds() ? fixed_camera(o, *extent) : "";
    if (camera.empty()) camera = "{automatic: {fit: box, direction: [" + o.direction + "]}}";
    std::ostringstream scene;
    scene.precision(17);
    scene << "images:\n  - name: " << quoted(picture_name(file)) << "\n    size: [" << o.width << ", " << o.height
          << "]\n"
          << "    camera: " << camera << "\n    layers: [{surface: {";
    if (!field.empty()) scene << "colour_by: {field: " << quoted(field);
    if (!field.empty() && extent && extent->has_range())
        scene << ", range: [" << extent->low[3] << ", " << extent->high[3] << "]";
    scene << (field.empty() ? "" : "}")
          << "}}]\n    decorations: {title: " << quoted(file.stem().string().substr(0, 60))
          << ", text: [{text: \"t = {time}\"}], outline: true, axes: true" << (field.empty() ? "" : ", colour_bar: {}")
          << "}\n    outputs: [{path: \"{name}_{cycle:04}.png\"}]\n";
    return scene.str();
}

} // namespace render_tool
