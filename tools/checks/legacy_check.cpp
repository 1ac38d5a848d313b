/* A file begins with four lines ("# vtk DataFile Version 5.1", a title, ASCII or BINARY, DATASET and its kind).
 * Sections follow: each section has a keyword and counts, and most sections have values, either as text or as
 * big-endian numbers followed by a newline. */
#include "legacy_check.h"

#include "number_check.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdint>
#include <fstream>
#include <map>
#include <set>
#include <sstream>
#include <stdexcept>
#include <vector>

namespace render_tool
{

namespace
{

std::string lower(std::string text)
{
    for (char &c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    return text;
}

class legacy_parser
{
  public:
    explicit legacy_parser(const std::string &path) : path_(path), in_(path, std::ios::binary | std::ios::ate)
    {
        size_ = in_ ? static_cast<int64_t>(in_.tellg()) : 0;
        in_.seekg(0);
    }

    void parse()
    {
        std::string line;
        for (int i = 0; i < 3; i++)
            if (!std::getline(in_, line)) fail("it has no heading");
        is_text_ = lower(line).compare(0, 5, "ascii") == 0;
        if (is_text_) check_last_byte();
        while (next_section()) {
            const std::string name = word(0), kind = word(1);
            if (!skip_section()) return;
            sections_seen_.insert(name == "aspect_ratio" ? "spacing" : name);
            if (name == "dataset") kind_ = kind;
            if (name == "points") is_empty_ = std::stoll(kind) == 0;
        }
        check_sections();
    }

  private:
    [[noreturn]] void fail(const std::string &why) const { throw std::runtime_error(path_ + ": is cut short: " + why); }

    void check_last_byte()
    {
        const auto here = in_.tellg();
        in_.seekg(-1, std::ios::end);
        if (in_.get() != '\n') fail("its last line has no end");
        in_.seekg(here);
    }

    /* Checks that all required sections are present, because a file may also be truncated between two sections. */
    void check_sections() const
    {
        static const std::map<std::string, std::vector<std::string>> needed = {
            {"structured_points", {"dimensions", "spacing", "origin"}},
            {"structured_grid", {"dimensions", "points"}},
            {"rectilinear_grid", {"dimensions", "x_coordinates", "y_coordinates", "z_coordinates"}},
            {"unstructured_grid", {"points", "cells", "cell_types"}},
            {"polydata", {"points"}}};
        const auto found = needed.find(kind_);
        if (kind_.empty()) fail("it has no data set");
        if (found == needed.end() || is_empty_) return;
        for (const std::string &name : found->second)
            if (sections_seen_.count(name) == 0) fail("it has no " + name);
    }

    /* Reads the words of the next nonblank line; returns false at the end of the file. */
    bool next_section()
    {
        words_.clear();
        for (std::string line; words_.empty() && std::getline(in_, line);) {
            std::istringstream in(line);
            for (std::string w; in >> w;) words_.push_back(words_.empty() ? lower(w) : w);
        }
        return !words_.empty();
    }

    std::string word(size_t i) const { return i < words_.size() ? lower(words_[i]) : ""; }

    int64_t count(size_t i) const
    {
        const std::string text = word(i);
        const bool is_number = !text.empty() && text.size() < 18 &&
                               std::all_of(text.begin(), text.end(), [](unsigned char c) { return std::isdigit(c); });
        if (!is_number || in_.eof()) fail("\"" + words_[0] + "\" has no count");
        return std::stoll(text);
    }

    /* Returns the type of this name, or null if the type is unknown or its values differ in size. */
    static const number_type *find_type(const std::string &name)
    {
        static const std::array<number_type, 17> types = {{{"bit", 1, true, false},
                                                           {"char", 8, true, true},
                                                           {"signed_char", 8, true, true},
                                                           {"unsigned_char", 8, true, false},
                                                           {"short", 16, true, true},
                                                           {"unsigned_short", 16, true, false},
                                                           {"int", 32, true, true},
                                                           {"unsigned_int", 32, true, false},
                                                           {"vtkidtype", 32, true, true},
                                                           {"long", 64, true, true},
                                                           {"unsigned_long", 64, true, false},
                                                           {"long_long", 64, true, true},
                                                           {"unsigned_long_long", 64, true, false},
                                                           {"vtktypeint64", 64, true, true},
                                                           {"vtktypeuint64", 64, true, false},
                                                           {"float", 32, false, true},
                                                           {"double", 64, false, true}}};
        const auto found =
            std::find_if(types.begin(), types.end(), [&](const auto &type) { return type.name == name; });
        return found == types.end() ? nullptr : &*found;
    }

    /* Skips values; returns false if their size is not known. */
    bool skip_values(int64_t values, const std::string &type_name)
    {
        if (values / 8 > size_) fail("it says it has " + std::to_string(values) + " values");
        const number_type *type = find_type(type_name);
        if (!type) return false;
        if (is_text_) {
            skip_words(values, *type);
            return true;
        }
        const int64_t bytes = type->bits < 8 ? (values + 7) / 8 : values * (type->bits / 8);
        if (bytes > size_ - static_cast<int64_t>(in_.tellg())) fail("values of \"" + words_[0] + "\" are missing");
        in_.seekg(bytes, std::ios::cur);
        return true;
    }

    /* Skips colours, which are bytes in binary files, and numbers from 0 to 1 in text. */
    bool skip_colours(int64_t values) { return skip_values(values, is_text_ ? "float" : "unsigned_char"); }

    void skip_words(int64_t count, const number_type &type)
    {
        std::streambuf *bytes = in_.rdbuf();
        const int end = std::char_traits<char>::eof();
        for (int64_t i = 0; i < count; i++) {
            int c = bytes->sgetc();
            while (c != end && std::isspace(c)) c = bytes->snextc();
            if (c == end) fail("values of \"" + words_[0] + "\" are missing");
            std::string value;
            for (; c != end && !std::isspace(c); c = bytes->snextc()) value += static_cast<char>(c);
            if (!is_readable_number(value, false, type))
                refuse_number(path_, value, static_cast<int64_t>(in_.tellg()) - static_cast<int64_t>(value.size()),
                              type);
        }
    }

    /* Skips the data of the current section. Returns false if the rest of the file cannot be parsed. */
    bool skip_section()
    {
        const std::string name = word(0);
        if (name == "dataset") return is_simple(word(1));
        if (name == "dimensions" || name == "spacing" || name == "origin" || name == "aspect_ratio")
            return has_words(4);
        if (name == "extent") return has_words(7);
        if (name == "points") return skip_values(3 * count(1), word(2));
        if (name == "x_coordinates" || name == "y_coordinates" || name == "z_coordinates" || name == "blanking")
            return skip_values(count(1), word(2));
        if (name == "cells" || name == "vertices" || name == "lines" || name == "polygons" || name == "triangle_strips")
            return skip_cells();
        if (name == "cell_types") return skip_values(count(1), "int");
        if (name == "point_data" || name == "cell_data") {
            tuples_ = count(1);
            return true;
        }
        if (name == "field") return skip_fields(count(2));
        if (name == "metadata") return skip_metadata();
        return skip_attribute(name);
    }

    bool is_simple(const std::string &kind) const
    {
        for (const char *simple :
             {"structured_points", "structured_grid", "rectilinear_grid", "unstructured_grid", "polydata", "field"})
            if (kind == simple) return true;
        if (in_.eof() || kind.empty()) fail("it has no data set");
        return false;
    }

    bool has_words(size_t count) const
    {
        if (words_.size() < count || in_.eof()) fail("\"" + words_[0] + "\" is not whole");
        return true;
    }

    /* Skips the cells: a single list of counts and points up to version 5.0, and two lists in later versions. */
    bool skip_cells()
    {
        const int64_t cells = count(1), size = count(2);
        const auto here = in_.tellg();
        const std::vector<std::string> section = words_;
        if (!next_section()) fail("values of \"" + section[0] + "\" are missing");
        if (word(0) != "offsets") {
            in_.clear();
            in_.seekg(here);
            words_ = section;
            return skip_values(size, "int");
        }
        if (!skip_values(cells, word(1))) return false;
        if (!next_section()) fail("values of \"" + section[0] + "\" are missing");
        return skip_values(size, word(1));
    }

    bool skip_fields(int64_t arrays)
    {
        for (int64_t i = 0; i < arrays;) {
            if (!next_section()) fail("a field is missing");
            if (word(0) == "metadata") {
                skip_metadata();
                continue;
            }
            i++;
            if (word(0) != "null_array" && !skip_values(count(1) * count(2), word(3))) return false;
        }
        return true;
    }

    /* Skips the lines up to an empty one. Missing lines are accepted, because metadata does not affect pictures. */
    bool skip_metadata()
    {
        for (std::string line; std::getline(in_, line) && !line.empty();) {
        }
        return true;
    }

    bool skip_attribute(const std::string &name)
    {
        static const std::map<std::string, int64_t> components = {
            {"vectors", 3},    {"normals", 3},      {"tensors", 9},   {"tensors6", 6},
            {"global_ids", 1}, {"pedigree_ids", 1}, {"edge_flags", 1}};
        const auto found = components.find(name);
        if (found != components.end()) return skip_values(tuples_ * found->second, word(2));
        if (name == "texture_coordinates") return skip_values(tuples_ * count(2), word(3));
        if (name == "color_scalars") return skip_colours(tuples_ * count(2));
        if (name == "lookup_table") return skip_colours(4 * count(2));
        if (name == "scalars") return skip_scalars();
        if (in_.eof() || in_.peek() == std::char_traits<char>::eof()) fail("\"" + words_[0] + "\" is not whole");
        return false;
    }

    bool skip_scalars()
    {
        const std::string type = word(2);
        const int64_t values = tuples_ * (words_.size() > 3 ? count(3) : 1);
        if (!next_section() || word(0) != "lookup_table") fail("values of \"scalars\" are missing");
        return skip_values(values, type);
    }

    std::string path_;
    std::ifstream in_;
    int64_t size_ = 0;
    bool is_text_ = false;
    std::string kind_;                    // kind of the data set
    bool is_empty_ = false;               // true if there are no points; VTK's writer then omits the cells
    std::set<std::string> sections_seen_; // keywords of the sections read so far
    int64_t tuples_ = 0;
    std::vector<std::string> words_; // words of the current section's first line
};

} // namespace

void check_legacy(const std::string &path)
{
    legacy_parser(path).parse();
}

} // namespace render_tool
