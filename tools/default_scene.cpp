#include "default_scene.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <sstream>
#include <system_error>

#include <vtkMath.h>

#include "file_kinds.h"

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

std::array<double, 3> cross(const std::array<double, 3> &a, const std::array<double, 3> &b)
{
    std::array<double, 3> out{};
    vtkMath::Cross(a.data(), b.data(), out.data());
    return out;
}

std::array<double, 3> unit(const std::array<double, 3> &a)
{
    const double length = std::hypot(a[0], a[1], a[2]);
    return {a[0] / length, a[1] / length, a[2] / length};
}

std::string list_of(const std::array<double, 3> &v)
{
    std::ostringstream text;
    text.precision(17);
    text << '[' << v[0] << ", " << v[1] << ", " << v[2] << ']';
    return text.str();
}

/* What the box's corners need, so that the box fills about 0.8 of the picture: a title, numbers beside the colour bar
 * and the text at the bottom have the rest. */
struct framing {
    double distance = 0; // of the eye, in a perspective picture
    double height = 0;   // of an orthographic one
};

framing frame(const options &o, const std::array<double, 3> &half, const std::array<double, 3> &towards,
              const std::array<double, 3> &up)
{
    constexpr double angle = 40, filled = 0.8, pi = 3.14159265358979323846; // the scene's default angle, in degrees
    const auto right = unit(cross(up, towards)), above = cross(towards, right);
    const double high = filled * std::tan(angle * pi / 360), wide = high * o.width / o.height;
    framing needed;
    for (int corner = 0; corner < 8; corner++) {
        std::array<double, 3> at{};
        for (size_t i = 0; i < 3; i++) at[i] = (corner >> i) & 1 ? half[i] : -half[i];
        const double x = std::fabs(vtkMath::Dot(at, right)), y = std::fabs(vtkMath::Dot(at, above));
        needed.distance = std::max(needed.distance, vtkMath::Dot(at, towards) + std::max(x / wide, y / high));
        needed.height = std::max(needed.height, 2 * std::max(x * o.height / o.width, y) / filled);
    }
    return needed;
}

/* The camera for all steps, "" if they span nothing. */
std::string fixed_camera(const options &o, const default_look &look, const data_extent &e)
{
    const auto towards = unit(eye_direction(o, look));
    const auto up = up_direction(o, look);
    std::array<double, 3> middle{}, half{}, eye{};
    for (size_t i = 0; i < 3; i++) {
        middle[i] = (e.low[i] + e.high[i]) / 2;
        half[i] = (e.high[i] - e.low[i]) / 2;
    }
    const framing needed = frame(o, half, towards, up);
    for (size_t i = 0; i < 3; i++) eye[i] = middle[i] + needed.distance * towards[i];
    if (needed.distance <= 0) return "";
    std::ostringstream text;
    text.precision(17);
    text << "{position: " << list_of(eye) << ", focal: " << list_of(middle) << ", up: " << list_of(up);
    if (look.flat_axis >= 0) text << ", projection: orthographic, height: " << needed.height;
    return text.str() + "}";
}

std::string automatic_camera(const options &o, const default_look &look)
{
    return "{automatic: {fit: box, direction: " + list_of(eye_direction(o, look)) +
           "}, up: " + list_of(up_direction(o, look)) + (look.flat_axis >= 0 ? ", projection: orthographic}" : "}");
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

std::string default_scene(const options &o, const default_look &look, const data_extent *extent)
{
    const std::filesystem::path file(o.files.front());
    std::string camera = extent && extent->has_bounds() ? fixed_camera(o, look, *extent) : "";
    if (camera.empty()) camera = automatic_camera(o, look);
    std::ostringstream colour, scene;
    colour.precision(17);
    if (!look.field.empty()) colour << "field: " << quoted(look.field);
    if (!look.field.empty() && extent && extent->has_range())
        colour << ", range: [" << extent->low[3] << ", " << extent->high[3] << "]";
    const std::string plane = "planes: [{normal: [" + std::to_string(look.cut[0]) + ", " + std::to_string(look.cut[1]) +
                              ", " + std::to_string(look.cut[2]) + "]}]";
    scene << "images:\n  - name: " << quoted(picture_name(file)) << "\n    size: [" << o.width << ", " << o.height
          << "]\n    camera: " << camera << "\n";
    if (look.is_cut()) scene << "    clip: {" << plane << "}\n";
    scene << "    layers:\n      - surface: {" << (look.field.empty() ? "" : "colour_by: {" + colour.str() + "}");
    if (look.flat_axis >= 0)
        scene << (look.field.empty() ? "" : ", ") << "material: {ambient: 1, diffuse: 0, specular: 0}";
    scene << "}\n";
    if (look.is_cut()) scene << "      - slice: {" << colour.str() << ", " << plane << "}\n";
    scene << "    decorations: {title: " << quoted(file.stem().string().substr(0, 60))
          << ", text: [{text: \"t = {time}\"}], "
          << (look.flat_axis >= 0 ? "rulers: true" : "outline: true, axes: true")
          << (look.field.empty() ? "" : ", colour_bar: {}") << "}\n    outputs: [{path: \"{name}_{cycle:04}.png\"}]\n";
    return scene.str();
}

} // namespace render_tool
