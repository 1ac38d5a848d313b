#include "default_scene.h"

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <sstream>
#include <stdexcept>

#include <unistd.h>

#include <vtkCellData.h>
#include <vtkCompositeDataIterator.h>
#include <vtkCompositeDataSet.h>
#include <vtkDataArray.h>
#include <vtkDataSet.h>
#include <vtkPointData.h>

#include "data_file.h"
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

std::string chosen_field(const options &o)
{
    if (!o.field.empty()) return o.field;
    const auto file = open_data_file(o.files.front());
    const size_t steps = file->times().size();
    const size_t step = steps ? std::min(static_cast<size_t>(o.first_step), steps - 1) : 0;
    return first_field_of(grids_of(file->read(steps ? step : 0, 0, 1), o.files.front()));
}

} // namespace

std::string default_scene(const options &o)
{
    const std::string name = std::filesystem::path(o.files.front()).stem().string().substr(0, 60);
    const std::string field = chosen_field(o);
    const std::string colour = field.empty() ? "" : "colour_by: {field: " + quoted(field) + "}";
    std::ostringstream scene;
    scene << "images:\n  - name: " << quoted(name) << "\n    size: [" << o.width << ", " << o.height << "]\n"
          << "    camera: {automatic: {fit: box, direction: [" << o.direction << "]}}\n"
          << "    layers: [{surface: {" << colour << "}}]\n    decorations: {title: " << quoted(name)
          << ", text: [{text: \"t = {time}\"}], outline: true, axes: true" << (field.empty() ? "" : ", colour_bar: {}")
          << "}\n    outputs: [{path: \"{name}_{cycle:04}.png\"}]\n";
    return scene.str();
}

temporary_file::temporary_file(const std::string &text)
{
    const char *folder = std::getenv("TMPDIR");
    std::string pattern = std::string(folder && *folder ? folder : "/tmp") + "/insitu-render-XXXXXX.yaml";
    const int file = mkstemps(pattern.data(), 5);
    if (file < 0) throw std::runtime_error(pattern + ": cannot be made: " + std::strerror(errno));
    path_ = pattern;
    const ssize_t written = write(file, text.data(), text.size());
    if (close(file) == 0 && written == static_cast<ssize_t>(text.size())) return;
    unlink(path_.c_str());
    throw std::runtime_error(path_ + ": cannot be written");
}

temporary_file::~temporary_file()
{
    unlink(path_.c_str());
}

} // namespace render_tool
