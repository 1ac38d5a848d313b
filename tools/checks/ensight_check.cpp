/* Checks EnSight Gold files by the description of the format. In a geometry file, items in [] are present only if the
 * header says so, n is the preceding count, and "nodes" is the number of nodes of an element:
 *
 *     [format] 2 descriptions, node id, element id, [extents: 6 floats]
 *     part     = "part" number description sections
 *     section  = "coordinates" n [n ids] 3n floats
 *              | "block" i j k 3ijk floats [ijk ints]     (rectilinear: i + j + k floats, uniform: 6)
 *              | type n [n ids] n × nodes ints            (nsided, nfaced: counts, then nodes)
 *
 * The file of a variable has a description. Then, for some of the parts, it has "part" and a number; for variables
 * at nodes "coordinates" or "block", for variables at elements each type or "block"; and one value per node or
 * element and component. If the word "undef" follows "coordinates", "block" or the type, the value that represents
 * undefined values comes first. If "partial" follows, a count and the indices of the nodes or elements with values
 * come first. */
#include "ensight_check.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>
#include <stdexcept>
#include <vector>

#include "ensight_stream.h"

namespace render_tool
{

namespace
{

using encoding = ensight_stream::encoding;

struct part_sizes {
    int64_t points = 0;
    int64_t block_cells = 0;
    std::map<std::string, int64_t> elements; // number of elements of each type

    bool operator==(const part_sizes &other) const
    {
        return points == other.points && block_cells == other.block_cells && elements == other.elements;
    }
};

using geometry = std::map<int64_t, part_sizes>; // sizes of the parts, by part number

bool starts_with(const std::string &text, const char *start)
{
    return text.compare(0, std::strlen(start), start) == 0;
}

/* Returns the number of nodes of an element type: -1 for an unknown type, 0 if elements of the type have different
 * numbers of nodes. */
int count_nodes_of_element_type(const std::string &type)
{
    static const std::map<std::string, int> nodes = {
        {"point", 1}, {"bar2", 2},       {"bar3", 3},     {"tria3", 3},  {"tria6", 6},    {"quad4", 4},
        {"quad8", 8}, {"tetra4", 4},     {"tetra10", 10}, {"penta6", 6}, {"penta15", 15}, {"pyramid5", 5},
        {"hexa8", 8}, {"pyramid13", 13}, {"hexa20", 20},  {"nsided", 0}, {"nfaced", 0}};
    const auto found = nodes.find(starts_with(type, "g_") ? type.substr(2) : type);
    return found == nodes.end() ? -1 : found->second;
}

bool has_ids(const std::string &line)
{
    return line.find("given") != std::string::npos || line.find("ignore") != std::string::npos;
}

/* Returns the first line of the file, or the second one if the file is binary and the first line names the encoding, as
 * it must in geometry files and may in files of variables. */
std::string first_line(ensight_stream &in, encoding how)
{
    const std::string line = in.line();
    const bool is_name =
        how != encoding::text && (line.find("Binary") != std::string::npos || line.find("BINARY") != std::string::npos);
    return is_name ? in.line() : line;
}

/* Begins a step and reads the first of its lines of description; returns false if the file has no further step. For the
 * first step, `line` must be the file's first line, because a file with a single step may lack the line "BEGIN TIME
 * STEP". For later steps, `line` must be "". */
bool begin_next_step(ensight_stream &in, std::string line, bool is_first)
{
    if (!is_first && !in.next_line(line)) return false;
    if (starts_with(line, "BEGIN TIME STEP"))
        in.line();
    else if (!is_first)
        in.fail("\"" + line + "\" is not understood");
    return true;
}

class geometry_parser
{
  public:
    geometry_parser(const std::string &path, encoding how) : in_(path, how), how_(how) {}

    /* Returns the geometry of each step in the file, or a single one if the file has no steps. */
    std::vector<geometry> steps()
    {
        std::vector<geometry> all;
        for (std::string line = first_line(in_, how_); begin_next_step(in_, line, all.empty()); line = "")
            all.push_back(parts());
        return all;
    }

  private:
    /* Reads the parts of a step. The first of its two description lines has been read already. */
    geometry parts()
    {
        std::string line;
        part_ = nullptr;
        in_.line();
        has_node_ids_ = has_ids(in_.line());
        has_element_ids_ = has_ids(in_.line());
        geometry all;
        while (in_.next_line(line)) {
            if (starts_with(line, "END TIME STEP")) break;
            if (starts_with(line, "extents"))
                in_.skip_numbers(6);
            else if (starts_with(line, "part"))
                part_ = &begin_part(all);
            else
                add_section(line);
        }
        return all;
    }

    part_sizes &begin_part(geometry &all)
    {
        part_sizes &part = all[in_.integer()];
        in_.line();
        return part;
    }

    void add_section(const std::string &line)
    {
        const int nodes = count_nodes_of_element_type(line);
        if (!part_ || (nodes < 0 && line != "coordinates" && !starts_with(line, "block")))
            in_.fail("\"" + line + "\" is not understood");
        if (line == "coordinates")
            add_points();
        else if (nodes < 0)
            add_block(line);
        else
            add_elements(line, nodes);
    }

    void add_points()
    {
        part_->points = in_.integer();
        if (has_node_ids_) in_.skip_numbers(part_->points);
        for (int axis = 0; axis < 3; axis++) in_.skip_numbers(part_->points);
    }

    void add_block(const std::string &line)
    {
        if (line.find("range") != std::string::npos || line.find("ghost") != std::string::npos)
            in_.fail("\"" + line + "\" is not understood");
        const auto [i, j, k] = dimensions();
        part_->points = i * j * k;
        part_->block_cells = std::max<int64_t>(i - 1, 1) * std::max<int64_t>(j - 1, 1) * std::max<int64_t>(k - 1, 1);
        if (line.find("uniform") != std::string::npos)
            in_.skip_numbers(6);
        else if (line.find("rectilinear") != std::string::npos)
            for (const int64_t count : {i, j, k}) in_.skip_numbers(count);
        else
            for (int axis = 0; axis < 3; axis++) in_.skip_numbers(part_->points);
        if (line.find("iblanked") != std::string::npos) in_.skip_numbers(part_->points);
    }

    std::array<int64_t, 3> dimensions()
    {
        std::array<int64_t, 3> d{};
        in_.integers(d.data(), 3);
        return d;
    }

    void add_elements(const std::string &type, int nodes)
    {
        const int64_t count = in_.integer();
        part_->elements[type] = count;
        if (has_element_ids_) in_.skip_numbers(count);
        if (nodes > 0) {
            in_.skip_numbers(count * nodes);
            return;
        }
        int64_t lists = in_.sum_of_integers(count);
        if (type.find("nfaced") != std::string::npos) lists = in_.sum_of_integers(lists);
        in_.skip_numbers(lists);
    }

    ensight_stream in_;
    encoding how_;
    bool has_node_ids_ = false, has_element_ids_ = false;
    part_sizes *part_ = nullptr;
};

/* A file that a line of the case file names. */
struct case_file {
    std::string pattern; // file name in which '*' represents the digits of the step number
    int components = 0;  // number of components of the variable; 0 for a geometry file
    bool is_per_node = false;
};

/* A section's word, for example "coordinates", and whether "undef" or "partial" follows it. */
struct values_section {
    std::string word;
    bool has_undefined = false, is_partial = false;
};

values_section parse_section(const std::string &line)
{
    std::istringstream in(line);
    values_section s;
    std::string more;
    in >> s.word >> more;
    s.has_undefined = more == "undef";
    s.is_partial = more == "partial";
    if (!more.empty() && !s.has_undefined && !s.is_partial) s.word = line;
    return s;
}

/* Skips the values of a section; `count` is the number of its nodes or elements in the part. */
void skip_values(ensight_stream &in, const values_section &section, int64_t count, int components)
{
    if (section.has_undefined) in.skip_numbers(1);
    if (section.is_partial) {
        const int64_t all = count;
        count = in.integer();
        if (count > all)
            in.fail("has " + std::to_string(count) + " values for " + std::to_string(all) + " nodes or elements");
        in.skip_numbers(count);
    }
    for (int c = 0; c < components; c++) in.skip_numbers(count);
}

/* Reads through the values of one step. Returns the last section that is partial, or "". */
std::string check_values(ensight_stream &in, const geometry &parts, int components, bool is_per_node)
{
    std::string line, partial;
    const part_sizes *part = nullptr;
    bool has_values = false;
    while (in.next_line(line)) {
        if (starts_with(line, "END TIME STEP")) break;
        if (starts_with(line, "part")) {
            if (part && !has_values) in.fail("a part has no values");
            has_values = false;
            const int64_t number = in.integer();
            const auto found = parts.find(number);
            if (found == parts.end()) in.fail("has a part " + std::to_string(number) + ", which the geometry lacks");
            part = &found->second;
            continue;
        }
        if (!part) in.fail("\"" + line + "\" is not understood");
        const values_section section = parse_section(line);
        const auto element = part->elements.find(section.word);
        const bool is_block = section.word == "block",
                   is_points = is_per_node && (is_block || section.word == "coordinates");
        if (!is_points && !(!is_per_node && (is_block || element != part->elements.end())))
            in.fail("\"" + line + "\" is not understood");
        skip_values(in, section, is_points ? part->points : is_block ? part->block_cells : element->second, components);
        if (section.is_partial) partial = line;
        has_values = true;
    }
    if (!has_values) in.fail("is cut short: a part has no values");
    return partial;
}

/* Checks all steps of a variable. Steps for which there is no geometry use the last step of the geometry. VTK's reader
 * skips earlier steps by the sizes of the step that it reads, so all steps must have the same sizes. */
void check_variable(const std::string &path, encoding how, const std::vector<geometry> &steps, const case_file &file)
{
    ensight_stream in(path, how);
    size_t step = 0;
    std::string partial;
    for (std::string line = first_line(in, how); begin_next_step(in, line, step == 0); line = "", step++) {
        const geometry &parts = steps[std::min(step, steps.size() - 1)];
        if (step > 0 && !(parts == steps[0]))
            in.fail("has steps of different sizes in one file, which are not read: a file for each step is");
        if (!partial.empty())
            in.fail("\"" + partial + "\" in a file of several steps is not read: a file for each step is");
        partial = check_values(in, parts, file.components, file.is_per_node);
    }
}

/* Splits "1 1 name file" into words, without the leading numbers of time and file sets. */
std::vector<std::string> split_words(const std::string &text)
{
    std::vector<std::string> words;
    std::istringstream in(text);
    for (std::string word; in >> word;)
        if (!words.empty() || word.find_first_not_of("0123456789") != std::string::npos) words.push_back(word);
    return words;
}

int count_variable_components(const std::string &key)
{
    if (starts_with(key, "scalar")) return 1;
    if (starts_with(key, "vector")) return 3;
    if (starts_with(key, "tensor symm")) return 6;
    return starts_with(key, "tensor asym") ? 9 : 0;
}

std::vector<case_file> list_files(const std::string &case_path)
{
    std::vector<case_file> files;
    std::ifstream in(case_path);
    bool is_gold = false;
    int number = 0;
    for (std::string line; std::getline(in, line);) {
        const size_t colon = line.find(':'), start = line.find_first_not_of(" \t");
        number++;
        if (colon == std::string::npos || line[start] == '#') continue;
        if (line.find('"', colon) != std::string::npos)
            throw std::runtime_error(case_path + ": line " + std::to_string(number) +
                                     ": names in quotes are not read, found " + line.substr(line.find('"', colon)) +
                                     ", expected names without blanks");
        const std::string key = line.substr(start, colon - start);
        const std::vector<std::string> words = split_words(line.substr(colon + 1));
        if (key == "type") is_gold = words.size() == 2 && words[0] == "ensight" && words[1] == "gold";
        if (key == "measured") throw std::runtime_error(case_path + ": measured particles are not read");
        if (key == "model" && !words.empty()) files.push_back({words[0]});
        const int components = count_variable_components(key);
        if (components == 0) continue;
        if (words.size() < 2) {
            std::string what = case_path;
            what.append(": \"").append(line).append("\" names no file");
            throw std::runtime_error(what);
        }
        files.push_back({words[1], components, key.find("per node") != std::string::npos});
    }
    if (!is_gold) throw std::runtime_error(case_path + ": is no case of EnSight Gold");
    return files;
}

/* Returns the paths of the files that match the pattern. Each path is stored under the part of the file's name that the
 * pattern's stars represent, which is the step number. A file without stars is stored under "". */
std::map<std::string, std::string> list_matching_files(const std::string &folder, const std::string &pattern)
{
    const size_t first = pattern.find('*'), last = pattern.find_last_of('*');
    if (first == std::string::npos) return {{"", folder + pattern}};
    const std::string path = folder + pattern, start = pattern.substr(0, first), end = pattern.substr(last + 1);
    const std::string inside = start.substr(0, start.find_last_of('/') + 1);
    std::map<std::string, std::string> found;
    std::error_code no_folder;
    for (const auto &entry :
         std::filesystem::directory_iterator(folder.empty() ? "./" + inside : folder + inside, no_folder)) {
        const std::string name = inside + entry.path().filename().string();
        if (name.size() != pattern.size() || name.compare(0, first, start) != 0) continue;
        if (name.compare(last + 1, std::string::npos, end) == 0)
            found[name.substr(first, last + 1 - first)] = folder + name;
    }
    if (found.empty()) throw std::runtime_error(path + ": no such files");
    return found;
}

} // namespace

void check_ensight(const std::string &case_path)
{
    const std::string folder = case_path.substr(0, case_path.find_last_of('/') + 1);
    const std::vector<case_file> files = list_files(case_path);
    std::map<std::string, std::vector<geometry>>
        geometries; // geometries of the steps in each geometry file, by the step number in the file's name
    encoding how = encoding::text;
    for (const case_file &file : files) {
        if (file.components > 0) continue;
        for (const auto &[number, path] : list_matching_files(folder, file.pattern)) {
            how = ensight_stream::detect_encoding(path);
            geometries[number] = geometry_parser(path, how).steps();
        }
    }
    if (geometries.empty()) throw std::runtime_error(case_path + ": names no geometry");
    for (const case_file &file : files) {
        if (file.components == 0) continue;
        for (const auto &[number, path] : list_matching_files(folder, file.pattern)) {
            const auto same = geometries.find(number);
            check_variable(path, how, same == geometries.end() ? geometries.begin()->second : same->second, file);
        }
    }
}

} // namespace render_tool
