/* The pieces of a .pvtu file are read one by one and appended. VTK 9.1's own reader of .pvtu files assigns the faces of
 * polyhedra to wrong cells if an earlier piece has none.
 *
 *     .pvtu     <VTKFile> <PUnstructuredGrid> <Piece Source="a.vtu"/>...
 *     .pvd      <VTKFile> <Collection> <DataSet timestep="0.5" part="0" file="a.vtu"/>...
 *     .series   {"file-series-version": "1.0", "files": [{"name": "a.vtu", "time": 0.5}, ...]}
 *
 * Names are relative to the file's folder. Entries of a .pvd file with the same time are parts of one step. */
#include "piece_files.h"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <stdexcept>

#include <vtkAppendFilter.h>
#include <vtkCellData.h>
#include <vtkFieldData.h>
#include <vtkMultiBlockDataSet.h>
#include <vtkNew.h>
#include <vtkUnsignedCharArray.h>
#include <vtkUnstructuredGrid.h>
#include <vtkXMLDataElement.h>
#include <vtkXMLUtilities.h>
#include <vtk_jsoncpp.h>

#include "file_length.h"
#include "grids_of.h"
#include "piece_fields.h"
#include "vtk_messages.h"

namespace render_tool
{

namespace
{

[[noreturn]] void refuse(const std::string &path, const std::string &why)
{
    throw std::runtime_error(path + ": " + why);
}

std::string make_sibling_path(const std::string &path, const std::string &name)
{
    return name[0] == '/' ? name : path.substr(0, path.find_last_of('/') + 1) + name;
}

vtkSmartPointer<vtkXMLDataElement> read_xml(const std::string &path)
{
    check_length(path);
    auto root = vtkSmartPointer<vtkXMLDataElement>::Take(vtkXMLUtilities::ReadElementFromFile(path.c_str()));
    throw_pending_message(path);
    if (!root) refuse(path, "cannot be read: is no XML");
    return root;
}

vtkSmartPointer<vtkXMLDataElement> read_list(const std::string &path, const char *list)
{
    vtkSmartPointer<vtkXMLDataElement> found = read_xml(path)->FindNestedElementWithName(list);
    if (!found) refuse(path, "cannot be read: has no element " + std::string(list));
    return found;
}

/* Returns the child elements with this name. */
std::vector<vtkSmartPointer<vtkXMLDataElement>> list_elements(vtkXMLDataElement *parent, const char *name)
{
    std::vector<vtkSmartPointer<vtkXMLDataElement>> found;
    for (int i = 0; i < parent->GetNumberOfNestedElements(); i++)
        if (std::string(parent->GetNestedElement(i)->GetName()) == name)
            found.emplace_back(parent->GetNestedElement(i));
    return found;
}

/* Returns the path of the file that an element's attribute names. Throws if the file does not exist. */
std::string file_named_by(vtkXMLDataElement *element, const char *attribute, const std::string &path)
{
    const char *name = element->GetAttribute(attribute);
    if (!name || !name[0]) refuse(path, "a " + std::string(element->GetName()) + " names no file");
    std::string file = make_sibling_path(path, name);
    const std::string why_not = find_reason_not_data(file);
    if (!why_not.empty()) refuse(path, why_not);
    return file;
}

/* Checks whether a file is a table (.vtt). Tables may be stored next to grids; they contain no cells and are
 * skipped. */
bool is_table(const char *name)
{
    const std::string text = name;
    return text.size() > 4 && text.compare(text.size() - 4, 4, ".vtt") == 0;
}

void check_named_file(vtkXMLDataElement *element, const std::string &path)
{
    for (const char *attribute : {"file", "Source"})
        if (const char *name = element->GetAttribute(attribute))
            if (!is_table(name)) check_length(file_named_by(element, attribute, path));
    for (int i = 0; i < element->GetNumberOfNestedElements(); i++) check_named_file(element->GetNestedElement(i), path);
}

/* Checks whether file `index` of `count` belongs to piece `piece` of `pieces`. */
bool is_file_of_piece(size_t index, size_t count, int piece, int pieces)
{
    return static_cast<int>(index * static_cast<size_t>(pieces) / count) == piece;
}

using grid_list = std::vector<vtkSmartPointer<vtkUnstructuredGrid>>;

/* Adds ghost flags to pieces without them, because appending keeps only arrays that all pieces have. */
void unify_ghost_flags(const grid_list &grids)
{
    const bool has_ghosts = std::any_of(grids.begin(), grids.end(), [](auto &g) { return g->GetCellGhostArray(); });
    for (const auto &grid : grids)
        if (has_ghosts && !grid->GetCellGhostArray()) grid->AllocateCellGhostArray();
}

vtkSmartPointer<vtkUnstructuredGrid> append(const grid_list &grids)
{
    if (grids.empty()) return vtkSmartPointer<vtkUnstructuredGrid>::New();
    if (grids.size() == 1) return grids[0];
    unify_ghost_flags(grids);
    unify_field_types({grids.begin(), grids.end()});
    vtkNew<vtkAppendFilter> filter;
    for (const auto &grid : grids) filter->AddInputData(grid);
    filter->Update();
    return filter->GetOutput();
}

class pvtu_file : public data_file
{
  public:
    explicit pvtu_file(const std::string &path) : path_(path)
    {
        const auto list = read_list(path, "PUnstructuredGrid");
        fields_ = declared_fields(list);
        for (const auto &piece : list_elements(list, "Piece")) pieces_.push_back(file_named_by(piece, "Source", path));
    }

    const std::vector<double> &times() const override { return times_; }
    std::string step_path(size_t) const override { return path_; }
    int pieces(size_t) override { return static_cast<int>(pieces_.size()); }
    vtkSmartPointer<vtkDataObject> read(size_t, int piece, int pieces) override
    {
        grid_list grids;
        vtkSmartPointer<vtkFieldData> with_time;
        for (size_t i = 0; i < pieces_.size(); i++) {
            if (!is_file_of_piece(i, pieces_.size(), piece, pieces)) continue;
            const auto data = grids_of(open_data_file(pieces_[i])->read(0, 0, 1), pieces_[i]);
            auto *grid = vtkUnstructuredGrid::SafeDownCast(data);
            if (!grid) refuse(path_, pieces_[i] + " is no unstructured grid");
            if (!with_time && find_time_of_data(grid)) with_time = grid->GetFieldData();
            if (grid->GetNumberOfCells() == 0) continue;
            make_fields_as_declared(grid, fields_, pieces_[i], warnings());
            grids.emplace_back(grid);
        }
        vtkSmartPointer<vtkDataObject> all = append(grids);
        throw_pending_message(path_);
        if (with_time) all->GetFieldData()->AddArray(with_time->GetArray("TimeValue"));
        return all;
    }

  private:
    std::string path_;
    std::vector<std::string> pieces_;
    std::vector<declared_field> fields_;
    std::vector<double> times_; /* times of the steps; always empty, because the file has no steps */
};

struct series_step {
    double time;
    std::vector<std::string> parts; // paths of the files of one step
};

class series_file : public data_file
{
  public:
    series_file(const std::string &path, std::vector<series_step> steps, bool has_times)
        : path_(path), steps_(std::move(steps))
    {
        if (steps_.empty()) refuse(path, "names no file");
        for (const series_step &step : steps_) {
            if (has_times) times_.push_back(step.time);
            for (const std::string &part : step.parts)
                if (is_series(part)) refuse(path, part + ": a series within a series");
        }
    }

    const std::vector<double> &times() const override { return times_; }
    std::string step_path(size_t step) const override { return steps_[step].parts[0]; }
    int pieces(size_t step) override
    {
        const std::vector<std::string> &parts = steps_[step].parts;
        return parts.size() > 1 ? static_cast<int>(parts.size()) : open(parts[0]).pieces(0);
    }
    vtkSmartPointer<vtkDataObject> read(size_t step, int piece, int pieces) override
    {
        const std::vector<std::string> &parts = steps_[step].parts;
        if (parts.size() == 1) return read_file(parts[0], piece, pieces);
        auto all = vtkSmartPointer<vtkMultiBlockDataSet>::New();
        all->SetNumberOfBlocks(static_cast<unsigned>(parts.size()));
        for (size_t i = 0; i < parts.size(); i++)
            if (is_file_of_piece(i, parts.size(), piece, pieces))
                all->SetBlock(static_cast<unsigned>(i), read_file(parts[i], 0, 1));
        return all;
    }

  private:
    static bool is_series(const std::string &path)
    {
        const std::string ending = path.substr(path.find_last_of('.'));
        return ending == ".pvd" || ending == ".series";
    }
    vtkSmartPointer<vtkDataObject> read_file(const std::string &path, int piece, int pieces)
    {
        data_file &file = open(path);
        auto data = file.read(0, piece, pieces);
        warnings() += file.take_warnings();
        return data;
    }
    data_file &open(const std::string &path)
    {
        if (open_ && open_path_ == path) return *open_;
        open_ = open_data_file(path);
        open_path_ = path;
        if (open_->times().size() > 1)
            refuse(path_, path + ": holds " + std::to_string(open_->times().size()) + " steps, expected one");
        return *open_;
    }

    std::string path_;
    std::vector<series_step> steps_;
    std::vector<double> times_;
    std::unique_ptr<data_file> open_; // the file that was read last, which stays open
    std::string open_path_;
};

double parse_time(const std::string &text, const std::string &path)
{
    char *end = nullptr;
    const double time = std::strtod(text.c_str(), &end);
    while (end && std::isspace(static_cast<unsigned char>(*end))) end++;
    if (text.empty() || *end || !std::isfinite(time)) refuse(path, "timestep \"" + text + "\": expected a number");
    return time;
}

void sort_by_time(std::vector<series_step> &steps)
{
    std::stable_sort(steps.begin(), steps.end(), [](auto &a, auto &b) { return a.time < b.time; });
}

/* Checks whether the DataSets of a .pvd file have times. Throws if only some of them do, because the place of the
 * others in the series is unknown. */
bool have_times(const std::vector<vtkSmartPointer<vtkXMLDataElement>> &elements, const std::string &path)
{
    const auto lacks_time = [](const auto &element) { return !element->GetAttribute("timestep"); };
    const auto first = std::find_if(elements.begin(), elements.end(), lacks_time);
    if (first == elements.end()) return true;
    if (std::all_of(elements.begin(), elements.end(), lacks_time)) return false;
    const char *file = (*first)->GetAttribute("file");
    refuse(path, "DataSet " + std::to_string(first - elements.begin() + 1) + " (" + (file ? file : "no file") +
                     ") has no timestep, which other DataSets have");
}

Json::Value parse_json(const std::string &path)
{
    std::ifstream in(path);
    Json::CharReaderBuilder builder;
    builder["failIfExtra"] = true;
    builder["rejectDupKeys"] = true;
    Json::Value root;
    std::string errors;
    if (!Json::parseFromStream(builder, in, &root, &errors)) {
        std::replace(errors.begin(), errors.end(), '\n', ' ');
        refuse(path, "cannot be read: " + errors.substr(0, errors.find_last_not_of(' ') + 1));
    }
    return root;
}

} // namespace

void check_named_files(const std::string &path)
{
    const auto root = read_xml(path);
    check_named_file(root, path);
}

std::unique_ptr<data_file> open_pvtu(const std::string &path)
{
    return std::make_unique<pvtu_file>(path);
}

std::unique_ptr<data_file> open_pvd(const std::string &path)
{
    std::vector<series_step> steps;
    const auto elements = list_elements(read_list(path, "Collection"), "DataSet");
    const bool has_times = have_times(elements, path);
    for (const auto &element : elements) {
        const double time = has_times ? parse_time(element->GetAttribute("timestep"), path) : 0;
        const std::string file = file_named_by(element, "file", path);
        const auto same = std::find_if(steps.begin(), steps.end(), [=](auto &step) { return step.time == time; });
        if (same != steps.end())
            same->parts.push_back(file);
        else
            steps.push_back({time, {file}});
    }
    sort_by_time(steps);
    return std::make_unique<series_file>(path, std::move(steps), has_times);
}

std::unique_ptr<data_file> open_series(const std::string &path)
{
    const Json::Value root = parse_json(path);
    const Json::Value &files = root.isObject() ? root["files"] : Json::Value::nullSingleton();
    if (!files.isArray()) refuse(path, "has no list \"files\"");
    std::vector<series_step> steps;
    for (const Json::Value &entry : files) {
        if (!entry.isObject() || !entry["name"].isString() || entry["name"].asString().empty())
            refuse(path, "an entry of \"files\" has no \"name\"");
        if (!entry["time"].isNumeric()) refuse(path, entry["name"].asString() + ": \"time\" is no number");
        const std::string file = make_sibling_path(path, entry["name"].asString()),
                          why_not = find_reason_not_data(file);
        if (!why_not.empty()) refuse(path, why_not);
        steps.push_back({entry["time"].asDouble(), {file}});
    }
    sort_by_time(steps);
    return std::make_unique<series_file>(path, std::move(steps), true);
}

} // namespace render_tool
