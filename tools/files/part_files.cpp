#include "part_files.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <regex>
#include <stdexcept>
#include <system_error>

#include <vtkMultiBlockDataSet.h>

namespace render_tool
{

parts_file::parts_file(std::string path, std::vector<std::string> parts, std::vector<double> times)
    : path_(std::move(path)), parts_(std::move(parts)), files_(parts_.size()), times_(std::move(times))
{
}

vtkSmartPointer<vtkDataObject> parts_file::read_part(size_t part, size_t step)
{
    std::unique_ptr<data_file> &file = files_[part];
    if (!file) file = open_by_vtk(parts_[part]);
    if (times_.empty()) return file->read(0, 0, 1);
    const std::vector<double> &times = file->times();
    const auto at = std::find(times.begin(), times.end(), times_[step]);
    if (at != times.end()) return file->read(static_cast<size_t>(at - times.begin()), 0, 1);
    throw std::runtime_error(parts_[part] + ": has no step at the time " + time_text(times_[step]) +
                             ", which other parts have");
}

vtkSmartPointer<vtkDataObject> parts_file::read(size_t step, int piece, int pieces)
{
    const size_t count = parts_.size();
    auto all = vtkSmartPointer<vtkMultiBlockDataSet>::New();
    all->SetNumberOfBlocks(static_cast<unsigned>(count));
    vtkMultiBlockDataSet *first = nullptr;
    for (size_t p = 0; p < count; p++) {
        if (static_cast<int>(p * static_cast<size_t>(pieces) / count) != piece) continue;
        const auto part = read_part(p, step);
        warnings() += files_[p]->take_warnings();
        all->SetBlock(static_cast<unsigned>(p), part);
        if (!first) first = vtkMultiBlockDataSet::SafeDownCast(part);
    }
    /* Creates empty leaves for the parts of other ranks, so that the leaves have the same numbers on all ranks. */
    for (unsigned p = 0; first && p < count; p++) {
        if (all->GetBlock(p)) continue;
        auto empty = vtkSmartPointer<vtkMultiBlockDataSet>::New();
        empty->CopyStructure(first);
        all->SetBlock(p, empty);
    }
    return all;
}

bool parse_nemesis(const std::string &path, nemesis_name &name)
{
    static const std::regex form("(.*\\.(?:e|exo|ex2|exii|g|nem|par)(?:-s\\d+)?\\.(\\d{1,7})\\.)(\\d{1,7})");
    std::smatch parts;
    if (!std::regex_match(path, parts, form)) return false;
    name = {parts[1], std::atoi(parts[2].str().c_str()), parts[3].str().size()};
    return std::atoi(parts[3].str().c_str()) < name.count;
}

std::string time_text(double time)
{
    char text[32];
    std::snprintf(text, sizeof text, "%.9g", time);
    return text;
}

std::string logical_name(const std::string &path)
{
    static const std::regex series("(.*\\.(?:e|exo|ex2|exii|g))-s\\d+"), pieces("(.*)\\.(?:nem|par)");
    nemesis_name name;
    std::string plain = path;
    std::smatch parts;
    if (parse_nemesis(path, name)) {
        plain = name.start.substr(0, name.start.find_last_of('.', name.start.size() - 2));
        if (std::regex_match(plain, parts, pieces)) return parts[1].str() + ".e";
    }
    const std::string whole = plain;
    return std::regex_match(whole, parts, series) ? parts[1].str() : plain;
}

std::unique_ptr<data_file> open_nemesis(const std::string &path, const nemesis_name &name)
{
    std::vector<std::string> parts;
    for (int i = 0; i < name.count; i++) {
        const std::string number = std::to_string(i);
        const size_t zeros = number.size() < name.digits ? name.digits - number.size() : 0;
        parts.push_back(name.start + std::string(zeros, '0') + number);
        const std::string why_not = find_reason_not_data(parts.back());
        if (!why_not.empty())
            throw std::runtime_error(std::string(why_not)
                                         .append(", one of the ")
                                         .append(std::to_string(name.count))
                                         .append(" pieces of ")
                                         .append(path));
    }
    const std::vector<double> times = open_by_vtk(parts[0])->times();
    return std::make_unique<parts_file>(path, parts, times);
}

} // namespace render_tool
