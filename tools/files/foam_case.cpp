/* The folder of each processor has the layout of a complete case. VTK's reader for complete cases can therefore read a
 * single processor's folder; it is given the name of a file in this folder, which need not exist. VTK's reader for
 * decomposed cases reads all folders on every rank.
 *
 *     case/dec.foam
 *     case/processor0/constant/polyMesh/points ...
 *     case/processor0/0.5/p ...
 *     case/processor1/... */
#include "part_files.h"

#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <stdexcept>
#include <system_error>
#include <vector>

namespace render_tool
{

namespace
{

namespace fs = std::filesystem;

std::vector<std::string> list_folders(const fs::path &folder)
{
    std::vector<std::string> names;
    std::error_code code;
    for (fs::directory_iterator at(folder, code), end; !code && at != end; at.increment(code))
        if (at->is_directory(code)) names.push_back(at->path().filename().string());
    return names;
}

bool are_digits(const std::string &text)
{
    return !text.empty() && std::all_of(text.begin(), text.end(), [](unsigned char c) { return std::isdigit(c); });
}

/* Returns the folders of steps by their times. */
std::map<double, std::string> list_steps(const fs::path &folder)
{
    std::map<double, std::string> steps;
    for (const std::string &name : list_folders(folder)) {
        char *end = nullptr;
        const double time = std::strtod(name.c_str(), &end);
        if (std::isdigit(static_cast<unsigned char>(name[0])) && !*end) steps[time] = name;
    }
    return steps;
}

/* Checks whether a case has a mesh, or meshes of regions. */
bool has_mesh(const fs::path &folder)
{
    std::error_code code;
    const fs::path constant = folder / "constant";
    if (fs::is_directory(constant / "polyMesh", code)) return true;
    const auto regions = list_folders(constant);
    return std::any_of(regions.begin(), regions.end(),
                       [&](const std::string &name) { return fs::is_directory(constant / name / "polyMesh", code); });
}

std::string name_processor_folder(size_t processor)
{
    return "processor" + std::to_string(processor);
}

/* Returns the numbers of the processors that have a folder, in ascending order. */
std::vector<int> list_processors(const fs::path &folder)
{
    std::vector<int> numbers;
    for (const std::string &name : list_folders(folder))
        if (name.compare(0, 9, "processor") == 0 && are_digits(name.substr(9)) && name.size() < 18)
            numbers.push_back(std::atoi(name.c_str() + 9));
    std::sort(numbers.begin(), numbers.end());
    return numbers;
}

void check_processors(const std::string &path, const fs::path &folder, const std::vector<int> &numbers)
{
    for (size_t i = 0; i < numbers.size(); i++) {
        const std::string name = name_processor_folder(i);
        if (numbers[i] != static_cast<int>(i))
            throw std::runtime_error(std::string(path)
                                         .append(": ")
                                         .append(name)
                                         .append("/ is missing, as there is processor")
                                         .append(std::to_string(numbers.back()))
                                         .append("/"));
        if (!has_mesh(folder / name))
            throw std::runtime_error(
                std::string(path).append(": ").append(name).append("/constant/polyMesh/ is missing"));
    }
}

/* Throws if there are no folders of single processors, but one folder for several in OpenFOAM's collated format. */
void check_collated(const std::string &path, const fs::path &folder)
{
    for (const std::string &name : list_folders(folder))
        if (name.compare(0, 10, "processors") == 0 && std::isdigit(static_cast<unsigned char>(name[10])))
            throw std::runtime_error(std::string(path).append(": ").append(name).append(
                "/ is of OpenFOAM's collated format, which is not read: run reconstructPar first"));
}

/* Opens the case with the steps that all processors have. */
std::unique_ptr<parts_file> open_processors(const fs::path &path, size_t count)
{
    const fs::path folder = path.parent_path();
    std::vector<std::string> parts, warnings;
    std::map<double, std::string> common = list_steps(folder / name_processor_folder(0));
    for (size_t p = 0; p < count; p++) {
        parts.push_back((folder / name_processor_folder(p) / path.filename()).string());
        const auto steps = list_steps(folder / name_processor_folder(p));
        for (auto at = common.begin(); at != common.end();) {
            const bool is_there = steps.count(at->first) > 0;
            if (!is_there) warnings.push_back(name_processor_folder(p) + "/ has no step " + at->second + ": left out");
            at = is_there ? std::next(at) : common.erase(at);
        }
    }
    std::vector<double> times;
    times.reserve(common.size());
    for (const auto &step : common) times.push_back(step.first);
    auto file = std::make_unique<parts_file>(path.string(), parts, times);
    for (const std::string &warning : warnings) file->warn(warning);
    return file;
}

} // namespace

std::unique_ptr<data_file> open_decomposed_foam(const std::string &path)
{
    const fs::path folder = fs::absolute(path).parent_path();
    const std::vector<int> numbers = list_processors(folder);
    const bool is_whole = has_mesh(folder);
    if (numbers.empty()) {
        if (!is_whole) check_collated(path, folder);
        return nullptr;
    }
    const auto own = list_steps(folder), of_first = list_steps(folder / "processor0");
    const auto last = [](const std::map<double, std::string> &steps) {
        return steps.empty() ? -1 : steps.rbegin()->first;
    };
    if (is_whole && last(own) >= last(of_first)) return nullptr;
    check_processors(path, folder, numbers);
    auto file = open_processors(path, numbers.size());
    if (is_whole)
        file->warn("the folders of its processors are read, which go on to " + time_text(last(of_first)) +
                   ": the case itself has no step after " + (own.empty() ? "its mesh" : time_text(last(own))));
    return file;
}

} // namespace render_tool
