#include "default_scene.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <sstream>
#include <system_error>

#include <vtk_utf8.h>

#include "file_kinds.h"

namespace render_tool
{

namespace
{

/* Returns the text as a double-quoted scalar of YAML. Characters that YAML does not allow or would change, such as
 * control characters and line separators, are escaped, as are all others beyond ASCII. Names of files need not be
 * UTF-8: other bytes are taken for characters of Latin-1. */
std::string quoted(const std::string &text)
{
    std::string out = "\"";
    for (auto at = text.begin(); at != text.end();) {
        const bool is_character = utf8::find_invalid(at, text.end()) != at;
        const uint32_t code = is_character ? utf8::next(at, text.end()) : static_cast<unsigned char>(*at++);
        if (code >= 0x20 && code < 0x7f) {
            if (code == '"' || code == '\\') out += '\\';
            out += static_cast<char>(code);
        } else {
            char escape[16];
            std::snprintf(escape, sizeof escape, "\\U%08x", static_cast<unsigned>(code));
            out += escape;
        }
    }
    return out + '"';
}

/* Returns the beginning of a text in UTF-8: as many whole characters as fit into this number of bytes. */
std::string get_beginning(const std::string &text, size_t size)
{
    const auto continues_character = [](char c) { return (static_cast<unsigned char>(c) & 0xc0) == 0x80; };
    while (size > 0 && size < text.size() && continues_character(text[size])) size--;
    return text.substr(0, size);
}

/* Returns the title of a file's pictures. A title cannot contain braces, because they enclose placeholders, so they are
 * replaced by parentheses. */
std::string make_title(const std::filesystem::path &file)
{
    std::string title = get_beginning(file.stem().string(), 60);
    std::replace(title.begin(), title.end(), '{', '(');
    std::replace(title.begin(), title.end(), '}', ')');
    return title;
}

std::string format_list(const std::array<double, 3> &v)
{
    std::ostringstream text;
    text.precision(17);
    text << '[' << v[0] << ", " << v[1] << ", " << v[2] << ']';
    return text.str();
}

/* Returns the camera. If the extent of all steps is known, it determines the position, so that the camera does not move
 * between steps. A flat mesh is viewed from the front unless the options specify a direction. */
std::string format_camera(const options &o, const default_look &look, const data_extent *e)
{
    std::string automatic = "fit: box", up;
    if (look.flat_axis < 0 || !o.direction.empty()) {
        automatic += ", direction: " + format_list(eye_direction(o));
        up = ", up: " + format_list(up_direction(o));
    }
    if (e && e->has_bounds())
        automatic += ", bounds: [" + format_list({e->low[0], e->low[1], e->low[2]}) + ", " +
                     format_list({e->high[0], e->high[1], e->high[2]}) + "]";
    return "{automatic: {" + automatic + "}" + up + "}";
}

/* Returns a hash of the text as eight hexadecimal digits (FNV-1a). */
std::string hash_digits(const std::string &text)
{
    uint32_t hash = 0x811c9dc5U;
    for (const char c : text) hash = (hash ^ static_cast<unsigned char>(c)) * 0x01000193U;
    char digits[9];
    std::snprintf(digits, sizeof digits, "%08x", static_cast<unsigned>(hash));
    return digits;
}

/* Checks whether pictures of another data file in the folder would get the same name. */
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

/* Returns the name with which pictures of a file begin, at most 60 bytes long: the file's name without its extension if
 * that is unique. Otherwise a hash of the extension, of a folder other than the working directory, or of a long name is
 * appended. */
std::string picture_name(const std::filesystem::path &file)
{
    std::error_code code;
    const std::string stem = file.stem().string();
    const auto folder = std::filesystem::weakly_canonical(std::filesystem::absolute(file, code).parent_path(), code);
    const auto here = std::filesystem::weakly_canonical(std::filesystem::current_path(code), code);
    std::string apart;
    if (folder != here) apart = folder.string();
    if (stem.size() > 60 || is_shared_name(file, stem)) apart += '/' + file.filename().string();
    return apart.empty() ? stem : get_beginning(stem, 51) + '_' + hash_digits(apart);
}

} // namespace

std::string default_scene(const options &o, const default_look &look, const data_extent *extent)
{
    const std::filesystem::path file(o.files.front());
    std::ostringstream colour, scene;
    colour.precision(17);
    if (!look.field.empty()) colour << "field: " << quoted(look.field);
    if (!look.field.empty() && extent && extent->has_range())
        colour << ", range: [" << extent->low[3] << ", " << extent->high[3] << "]";
    const std::string plane = "planes: [{normal: [" + std::to_string(look.cut[0]) + ", " + std::to_string(look.cut[1]) +
                              ", " + std::to_string(look.cut[2]) + "]}]";
    scene << "images:\n  - name: " << quoted(picture_name(file)) << "\n    size: [" << o.width << ", " << o.height
          << "]\n    camera: " << format_camera(o, look, extent) << "\n";
    if (look.is_cut()) scene << "    clip: {" << plane << "}\n";
    scene << "    layers:\n      - surface: {" << (look.field.empty() ? "" : "colour_by: {" + colour.str() + "}");
    scene << "}\n";
    if (look.is_cut()) scene << "      - slice: {" << colour.str() << ", " << plane << "}\n";
    scene << "    decorations: {title: " << quoted(make_title(file)) << ", text: [{text: \"t = {time}\"}], "
          << (look.flat_axis >= 0 ? "rulers: true" : "outline: true, axes: true")
          << (look.field.empty() ? "" : ", colour_bar: {}") << "}\n    outputs: [{path: \"{name}_{cycle:04}.png\"}]\n";
    return scene.str();
}

} // namespace render_tool
