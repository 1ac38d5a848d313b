/* Options are parsed with CLI11, because it throws exceptions instead of printing. Every rank parses the same command
 * line, but only one rank prints an error. */
#include "render_options.h"

#include <CLI/CLI.hpp>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <numeric>
#include <set>
#include <stdexcept>
#include <utility>
#include <vector>

#include <vtk_utf8.h>

#include "data_file.h"
#include "part_files.h"

namespace render_tool
{

namespace
{

int64_t parse_step(const std::string &text, const std::string &all)
{
    const bool is_number = !text.empty() && text.size() < 18 &&
                           std::all_of(text.begin(), text.end(), [](unsigned char c) { return std::isdigit(c); });
    if (!is_number) throw std::runtime_error("--steps " + all + ": expected A:B, A:, :B or A, counting from 0");
    return std::strtoll(text.c_str(), nullptr, 10);
}

void parse_steps(const std::string &text, options &o)
{
    const size_t colon = text.find(':');
    if (colon == std::string::npos) {
        o.first_step = o.last_step = parse_step(text, text);
        return;
    }
    const std::string first = text.substr(0, colon), last = text.substr(colon + 1);
    if (!first.empty()) o.first_step = parse_step(first, text);
    if (!last.empty()) o.last_step = parse_step(last, text);
    if (o.first_step > o.last_step) throw std::runtime_error("--steps " + text + ": the first step is after the last");
}

void parse_size(const std::string &text, options &o)
{
    char rest = 0;
    const bool are_two = std::sscanf(text.c_str(), "%dx%d%c", &o.width, &o.height, &rest) == 2;
    if (!are_two || o.width < 1 || o.height < 1 || o.width > 32768 || o.height > 32768)
        throw std::runtime_error("--size " + text + ": expected WIDTHxHEIGHT, from 1x1 to 32768x32768");
}

void parse_camera(const std::string &text, options &o)
{
    double d[3];
    char rest = 0;
    const bool are_three = std::sscanf(text.c_str(), "%lf,%lf,%lf%c", &d[0], &d[1], &d[2], &rest) == 3;
    const double size = are_three ? std::hypot(d[0], d[1], d[2]) : 0;
    if (!(size > 0) || !std::isfinite(size))
        throw std::runtime_error("--camera " + text + ": expected X,Y,Z, the direction from the data to the eye");
    char direction[100];
    std::snprintf(direction, sizeof direction, "%.9g, %.9g, %.9g", d[0] / size, d[1] / size, d[2] / size);
    o.direction = direction;
}

void parse_field(const std::string &text, options &o)
{
    if (!utf8::is_valid(text.begin(), text.end()))
        throw std::runtime_error("--field " + text + ": is not UTF-8, and a scene cannot name such a field");
    o.field = text;
}

/* A path, by whose numbers files are sorted. Only paths with the same gaps and as many numbers are compared. */
struct numbered_name {
    std::string path;
    std::vector<std::string> numbers; // the sequences of digits in the path
    std::vector<std::string> gaps;    // the text before each number, and the text after the last one if there is any

    explicit numbered_name(const std::string &of) : path(of), gaps(1)
    {
        bool was_digit = false;
        for (const char c : of) {
            const bool is_digit = std::isdigit(static_cast<unsigned char>(c));
            if (is_digit && !was_digit) numbers.emplace_back();
            if (!is_digit && was_digit) gaps.emplace_back();
            (is_digit ? numbers : gaps).back() += c;
            was_digit = is_digit;
        }
    }
};

/* Finds the numbers that are the decimals of the number before them, as in t0.25: only a point separates the two. In
 * two cases these are numbers of their own: if there are more than two such numbers in a row, as in v1.2.3, and if one
 * of the names has several digits there that end in 0, because v1.10 then follows v1.9. */
std::vector<bool> find_decimals(const std::vector<numbered_name> &names)
{
    const std::vector<std::string> &gaps = names[0].gaps;
    const auto follows_point = [&](size_t i) { return i > 0 && i < gaps.size() && gaps[i] == "."; };
    const auto ends_in_zero = [](const std::string &digits) { return digits.size() > 1 && digits.back() == '0'; };
    std::vector<bool> decimals(names[0].numbers.size());
    for (size_t i = 1; i < decimals.size(); i++)
        decimals[i] =
            follows_point(i) && !follows_point(i - 1) && !(i + 1 < decimals.size() && follows_point(i + 1)) &&
            std::none_of(names.begin(), names.end(), [&](auto &name) { return ends_in_zero(name.numbers[i]); });
    return decimals;
}

/* Checks whether a name's numbers are before those of another. The first numbers that differ decide. */
bool has_lower_numbers(const numbered_name &a, const numbered_name &b, const std::vector<bool> &decimals)
{
    const auto without_zeros = [](const std::string &digits) {
        return digits.substr(std::min(digits.find_first_not_of('0'), digits.size() - 1));
    };
    for (size_t i = 0; i < decimals.size(); i++) {
        std::string m = a.numbers[i], n = b.numbers[i];
        if (!decimals[i]) {
            m = without_zeros(m);
            n = without_zeros(n);
            if (m.size() != n.size()) return m.size() < n.size();
        }
        if (m != n) return m < n;
    }
    return false;
}

void sort_files_by_number(std::vector<std::string> &files)
{
    std::vector<numbered_name> names(files.begin(), files.end());
    auto like_first = [&](const numbered_name &n) {
        return n.gaps == names[0].gaps && n.numbers.size() == names[0].numbers.size();
    };
    if (names.empty() || !std::all_of(names.begin(), names.end(), like_first)) return;
    const std::vector<bool> decimals = find_decimals(names);
    std::stable_sort(names.begin(), names.end(), [&](auto &a, auto &b) { return has_lower_numbers(a, b, decimals); });
    for (size_t i = 0; i < files.size(); i++) files[i] = names[i].path;
}

/* Keeps one file of each parallel run's Exodus output, because any of its files represents all of them. */
void keep_one_file_per_run(options &o)
{
    std::set<std::string> runs;
    std::vector<std::string> left;
    nemesis_name name;
    for (const std::string &file : o.files)
        if (!parse_nemesis(file, name) || runs.insert(name.start).second) left.push_back(file);
    if (left.size() == 1 && !runs.empty()) o.pieces = false;
    o.files = left;
}

void parse_partition_name(const std::string &text, options &o)
{
    if (!parse_partition(text, o.how))
        throw std::runtime_error("--partition " + text + ": expected block, random or checkerboard");
}

const char *const about = "Draw the pictures that a scene file describes, from files of unstructured cells. Several\n"
                          "files are time steps, in order; a file with time steps inside is stepped through. Pictures\n"
                          "go where the scene's outputs say, relative to the working directory. Without a scene the\n"
                          "outer surface is drawn, coloured by a field, to NAME_CYCLE.png.";

struct help_formatter : CLI::Formatter {
    help_formatter() { column_width(23); }
    std::string make_usage(const CLI::App *, std::string) const override
    {
        return "usage: insitu-render [options] [scene.yaml] file...\n"
               "       mpirun -n ranks insitu-render [options] [scene.yaml] file...\n"
               "       insitu-render --info file...\n\n" +
               std::string(about) + "\n";
    }
    std::string make_option_opts(const CLI::Option *option) const override
    {
        return option->get_type_size() ? " " + option->get_type_name() : "";
    }
    std::string make_positionals(const CLI::App *) const override
    {
        return "";
    } // positional arguments are listed in the usage line already
};

/* Returns the edit distance of two words (insertions, deletions and replacements of letters). */
size_t count_edits(const std::string &a, const std::string &b)
{
    std::vector<size_t> row(b.size() + 1);
    std::iota(row.begin(), row.end(), size_t{0});
    for (size_t i = 0; i < a.size(); i++) {
        size_t diagonal = std::exchange(row[0], i + 1);
        for (size_t j = 0; j < b.size(); j++) {
            const size_t replaced = diagonal + (a[i] == b[j] ? 0 : 1);
            diagonal = row[j + 1];
            row[j + 1] = std::min({replaced, row[j] + 1, diagonal + 1});
        }
    }
    return row.back();
}

/* Returns a hint for options of other programs that this program lacks; "" for other names. */
std::string option_hint(const std::string &name)
{
    static const std::vector<std::pair<std::set<std::string>, const char *>> known = {
        {{"-o", "--out", "--output", "--outdir"},
         "pictures go where the scene's outputs say, without a scene into the working folder"},
        {{"-s", "--scene"}, "the scene is given without an option: insitu-render scene.yaml file..."},
        {{"-n", "-np", "--np", "--ranks"}, "ranks are mpirun's: mpirun -n 4 insitu-render file..."},
        {{"--range", "--map", "--cmap", "--colormap", "--color", "--colour", "--slice", "--isosurface", "--volume"},
         "what is drawn is said by a scene file: insitu-render scene.yaml file..."}};
    for (const auto &[names, text] : known)
        if (names.count(name)) return std::string(" (") + text + ")";
    return "";
}

[[noreturn]] void refuse_unknown(const CLI::App &app, const std::string &given)
{
    const std::string name = given.substr(0, given.find('='));
    std::string nearest = option_hint(name);
    size_t least = nearest.empty() ? name.size() / 3 + 1 : 0;
    for (const CLI::Option *option : app.get_options()) {
        const std::string known = option->get_positional() ? "" : option->get_name();
        const size_t edits = count_edits(name, known);
        if (known.size() < 3 || edits >= least) continue;
        least = edits;
        nearest = " (did you mean " + known + "?)";
    }
    throw std::runtime_error(name + ": unknown option" + nearest + "; see insitu-render --help");
}

using value_reader = void (*)(const std::string &text, options &o);

/* Adds an option with a value. If it is given several times, the last value is used. */
void add_value(CLI::App &app, options &o, const char *name, const char *type, value_reader read, const char *meaning)
{
    app.add_option_function<std::string>(
           name, [&o, read](const std::string &text) { read(text, o); }, meaning)
        ->type_name(type)
        ->take_last();
}

void declare(CLI::App &app, options &o, std::vector<std::string> &names)
{
    app.formatter(std::make_shared<help_formatter>());
    app.footer("Files read: " + known_endings() + "\nExit status: 0, or 1 after a message on stderr.");
    app.set_help_flag();
    app.allow_extras();
    app.add_flag("--info", o.info, "list cells by type, bounds, fields with their ranges, and times");
    add_value(app, o, "--steps", "A:B", parse_steps, "only steps A to B, counting from 0; A:, :B and A do too");
    app.add_flag("--pieces", o.pieces, "the files are pieces of one step, not steps");
    add_value(app, o, "--partition", "HOW", parse_partition_name,
              "how cells are dealt out to ranks: block (default), random or\n"
              "checkerboard; pictures do not depend on it");
    add_value(app, o, "--field", "NAME", parse_field, "without a scene: the field; the first is the default");
    add_value(app, o, "--size", "WxH", parse_size, "without a scene: the picture's size; 1280x720 is the default");
    add_value(app, o, "--camera", "X,Y,Z", parse_camera, "without a scene: the direction from the data to the eye");
    app.add_flag("--whole", o.whole, "without a scene: solids whose outside shows little are not cut open");
    app.add_flag("--version", o.version, "print the version");
    app.add_flag("--help", o.help, "print this");
    app.add_flag("-h", o.help)->group(""); // the short form -h is not listed in the help
    app.add_option("file", names);
}

/* Moves the name of the scene file, if there is one, from `names` to the options. It is the name with a scene's
 * extension, or otherwise the first name if that cannot be read as data. */
void extract_scene(std::vector<std::string> &names, options &o)
{
    if (names.empty()) throw std::runtime_error("a scene file and data files are missing; see insitu-render --help");
    auto scene = std::find_if(names.begin(), names.end(), is_scene);
    if (scene == names.end()) {
        const std::string why_not = find_reason_not_data(names.front());
        if (why_not.empty()) return;
        if (names.size() == 1 || has_known_ending(names.front())) throw std::runtime_error(why_not);
        scene = names.begin();
    }
    o.scene = *scene;
    scene = names.erase(scene);
    scene = std::find_if(scene, names.end(), is_scene);
    if (scene != names.end()) throw std::runtime_error(*scene + ": a second scene file beside " + o.scene);
}

} // namespace

options parse_options(int argc, char **argv)
{
    options o;
    std::vector<std::string> names;
    CLI::App app;
    declare(app, o, names);
    try {
        app.parse(argc, argv);
    } catch (const CLI::ParseError &error) {
        throw std::runtime_error(std::string(error.what()) + "; see insitu-render --help");
    }
    if (!app.remaining().empty()) refuse_unknown(app, app.remaining().front());
    if (o.help || o.version) return o;
    if (!o.info) extract_scene(names, o);
    for (const char *option : {"--field", "--size", "--camera", "--whole"})
        if (!o.scene.empty() && app.get_option(option)->count() > 0)
            throw std::runtime_error(std::string(option) + ": given with the scene file " + o.scene +
                                     ", which says that itself, expected one of the two");
    if (names.empty()) throw std::runtime_error("data files are missing; see insitu-render --help");
    o.files = names;
    keep_one_file_per_run(o);
    if (!o.pieces) sort_files_by_number(o.files);
    return o;
}

std::string help_text()
{
    options o;
    std::vector<std::string> names;
    CLI::App app;
    declare(app, o, names);
    return app.help();
}

} // namespace render_tool
