/* Checks insitu-render on real files: one rank and several ranks must draw the same pictures. The pixels of isosurfaces
 * (depth and colour) must be bit-identical for any partition. The pixels of volumes differ by rounding, because the
 * over operator is applied in another order. The library guarantees a difference of at most 1e-6 in linear light: the
 * few tens of merges of a pixel, each with a float rounding (6e-8) of values up to 1, leave no room for other errors.
 *
 * By default the cells of each file are distributed to ranks at random, and those of one file also in blocks; one of
 * two files of the same data is drawn. The long run does both for all files.
 *
 *     test_vtk_images <insitu-render that writes plain numbers (plain_image.c)> <mpiexec>
 *
 * The data's directory is given by INSITU_TEST_DATA; the exit status is 77 if that is not set. */
#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <string>
#include <vector>

#include "test_effort.h"
#include "test_vtk_run.h"

// cmocka.h is included after all C++ headers, as it defines fail as a macro.
extern "C" {
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
}

namespace
{

constexpr int width = 96, height = 72;
constexpr double volume_tolerance = 1e-6;

std::string tool, mpiexec, data_folder;
run_result last_run; // result of the most recent draw_subject()

struct subject {
    std::string name;
    std::vector<std::string> files;
    std::string field;
    double value, low, high;
    int shown_in;                                  // a step whose pictures are not empty
    std::vector<std::string> volumes = {"volume"}; // names of the pictures of the volume to draw, as in volume_pictures
};

/* Pictures of the volume with each integration method; the last one has a second volume. */
const struct volume_picture {
    std::string name, sampling, second;
} volume_pictures[] = {{"volume", "{}", ""},
                       {"segments", "{method: segments}", ""},
                       {"bounded", "{max_error: 1e-3}", ""},
                       {"both", "{max_error: 1e-2}", "f_cell"}};

struct picture {
    std::vector<float> rgba, depth; // depth is empty if the picture has none
};

picture read_picture(const std::string &path)
{
    const std::string all = read_file(path);
    const size_t pixels = static_cast<size_t>(width) * height, colours = pixels * 4 * sizeof(float);
    const bool has_depth = all.size() == colours + pixels * sizeof(float);
    picture p;
    if (!has_depth && all.size() != colours) print_error("%s has %zu bytes\n", path.c_str(), all.size());
    assert_true(has_depth || all.size() == colours);
    p.rgba.resize(pixels * 4);
    p.depth.resize(has_depth ? pixels : 0);
    std::memcpy(p.rgba.data(), all.data(), colours);
    if (has_depth) std::memcpy(p.depth.data(), all.data() + colours, p.depth.size() * sizeof(float));
    return p;
}

bool are_bitwise_equal(const std::vector<float> &a, const std::vector<float> &b)
{
    return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(float)) == 0;
}

int count_covered_pixels(const picture &p)
{
    int count = 0;
    for (size_t i = 3; i < p.rgba.size(); i += 4) count += p.rgba[i] > 0;
    return count;
}

std::string make_scene(const subject &s)
{
    auto image = [](const std::string &name, const std::string &layer, const std::string &sampling) {
        return "  - name: " + name + "\n    size: [" + std::to_string(width) + ", " + std::to_string(height) +
               "]\n    background: [0, 0, 0, 0]\n    layers:\n      - " + layer + "\n    sampling: " + sampling +
               "\n    outputs:\n      - path: \"" + name + "_{cycle}.exr\"\n";
    };
    const std::string field = "{field: \"" + s.field + "\", ";
    std::string text =
        "images:\n" + image("iso", "isosurface: " + field + "values: [" + std::to_string(s.value) + "]}", "{}");
    const std::string layer = "volume: " + field + "range: [" + std::to_string(s.low) + ", " + std::to_string(s.high) +
                              "], opacity: [[0, 0], [1, 0.9]]}";
    for (const volume_picture &p : volume_pictures) {
        if (std::find(s.volumes.begin(), s.volumes.end(), p.name) == s.volumes.end()) continue;
        const std::string second =
            p.second.empty() ? "" : "\n      - volume: {field: " + p.second + ", opacity: [[0, 0.3], [0.4, 0]]}";
        text += image(p.name, layer + second, p.sampling);
    }
    return text;
}

/* Draws the subject in a directory of its own, and returns this directory. If ranks is 0, the program is run without
 * mpiexec. */
std::string draw_subject(const subject &s, int ranks, const std::string &partition)
{
    const std::string folder =
        make_empty_folder("vtk_images/" + s.name + "_" + std::to_string(ranks) + "_" + partition);
    write_file(folder + "/scene.yaml", make_scene(s));
    std::string command = ranks > 0 ? quote_for_shell(mpiexec) + " -n " + std::to_string(ranks) + " " : "";
    command += quote_for_shell(tool) + " --partition " + partition + " scene.yaml";
    for (const std::string &file : s.files) command += " " + quote_for_shell(data_folder + "/" + file);
    last_run = run_in_folder(folder, command);
    if (last_run.status != 0) print_error("%s\n%s%s", command.c_str(), last_run.out.c_str(), last_run.err.c_str());
    assert_int_equal(last_run.status, 0);
    return folder;
}

std::string make_picture_path(const std::string &folder, const std::string &image, size_t step)
{
    return folder + "/" + image + "_" + std::to_string(step) + ".exr";
}

/* Counts the pixels that differ by more than the tolerance in any channel. */
int count_differing_pixels(const picture &a, const picture &b)
{
    int count = 0;
    for (size_t i = 0; i < a.rgba.size(); i += 4) {
        double most = 0;
        for (size_t c = i; c < i + 4; c++) {
            assert_true(std::isfinite(a.rgba[c]) && std::isfinite(b.rgba[c]));
            most = std::fmax(most, std::fabs(static_cast<double>(a.rgba[c]) - static_cast<double>(b.rgba[c])));
        }
        count += most > volume_tolerance;
    }
    return count;
}

void expect_same_pictures(const subject &s, const std::string &alone, const std::string &others)
{
    for (size_t step = 0; step < s.files.size(); step++) {
        const picture iso = read_picture(make_picture_path(alone, "iso", step)),
                      iso2 = read_picture(make_picture_path(others, "iso", step));
        assert_true(are_bitwise_equal(iso.depth, iso2.depth));
        assert_true(are_bitwise_equal(iso.rgba, iso2.rgba));
        for (const std::string &name : s.volumes) {
            const picture volume = read_picture(make_picture_path(alone, name, step));
            const int count = count_differing_pixels(volume, read_picture(make_picture_path(others, name, step)));
            if (count > 0)
                print_error("%s: %s of step %zu: %d pixels differ\n", others.c_str(), name.c_str(), step, count);
            assert_int_equal(count, 0);
        }
    }
}

/* Checks that the pictures are not empty. The smallest surface here, that of the notch's stress, covers some 20
 * pixels. */
void expect_visible_pixels(const subject &s, const std::string &folder)
{
    const auto step = static_cast<size_t>(s.shown_in);
    assert_in_range(count_covered_pixels(read_picture(make_picture_path(folder, "iso", step))), 10, width * height);
    assert_in_range(count_covered_pixels(read_picture(make_picture_path(folder, "volume", step))), 10, width * height);
}

void check_draws_same_on_ranks(const subject &s)
{
    const std::string alone = draw_subject(s, 0, "block");
    expect_visible_pixels(s, alone);
    expect_same_pictures(s, alone, draw_subject(s, 3, "random"));
    if (test_is_long_run() || s.name == "mixed") expect_same_pictures(s, alone, draw_subject(s, 3, "block"));
}

void check_draws_without_mpi(const subject &s)
{
    expect_visible_pixels(s, draw_subject(s, 0, "block"));
}

/* Checks that quadratic cells are drawn with all of their nodes. */
void check_draws_whole_cells(const subject &s)
{
    check_draws_without_mpi(s);
    assert_false(last_run.contains_text("drawn by their corners"));
}

void bluntfin_is_the_same_on_ranks(void **)
{
    if (test_is_long_run())
        check_draws_same_on_ranks({"bluntfin_hex", {"bluntfin_hex.vtu"}, "Density", 1.2, 0.4, 3.5, 0});
    check_draws_same_on_ranks({"bluntfin_tet", {"bluntfin_tet.vtu"}, "Density", 1.2, 0.4, 3.5, 0});
}

void post_is_the_same_on_ranks(void **)
{
    check_draws_same_on_ranks({"post_hex", {"post_hex.vtu"}, "VelocityMagnitude", 0.8, 0, 1.4, 0});
    if (test_is_long_run())
        check_draws_same_on_ranks({"post_tet", {"post_tet.vtu"}, "VelocityMagnitude", 0.8, 0, 1.4, 0});
}

/* Checks 8,000 polyhedra that are distributed at random to seven ranks. */
void polyhedra_are_the_same_on_seven_ranks(void **)
{
    const subject s = {
        "voronoi", {"poly_voronoi.vtu"}, "f", 0.2, -1.5, 1.5, 0, {"volume", "segments", "bounded", "both"}};
    const std::string alone = draw_subject(s, 0, "block");
    expect_visible_pixels(s, alone);
    expect_same_pictures(s, alone, draw_subject(s, 7, "random"));
}

void disk_is_the_same_on_ranks(void **)
{
    check_draws_same_on_ranks({"disk_vtu", {"disk_out_ref.vtu"}, "Temp", 340, 293, 913, 0});
    check_draws_same_on_ranks({"disk_ex2", {"disk_out_ref.ex2"}, "Temp", 340, 293, 913, 0});
}

void can_series_is_the_same_on_ranks(void **)
{
    check_draws_same_on_ranks({"can", {"can_0.vtu", "can_1.vtu", "can_2.vtu"}, "EQPS_pt", 0.7, 0, 2.7, 2});
}

void series_are_coloured_by_a_cell_field(void **)
{
    check_draws_same_on_ranks({"can_cell", {"can_1.vtu"}, "EQPS", 0.35, 0, 1.9, 0});
}

void mixed_lattice_is_the_same_on_ranks(void **)
{
    check_draws_same_on_ranks({"mixed", {"mixed_lattice.vtu"}, "f", 0.2, -1.5, 1.5, 0});
}

void every_kind_of_cell_is_drawn(void **)
{
    check_draws_whole_cells({"quadratic", {"cylinder_quadratic.vtu"}, "velocity_norm", 0.5, 0, 1, 0});
    check_draws_whole_cells({"tiny_tet", {"tiny_QuadraticTetra.vtu"}, "DistanceToCenter", 0.9, 0.3, 1.74, 0});
    check_draws_whole_cells({"tiny_wedge", {"tiny_QuadraticWedge.vtu"}, "DistanceToCenter", 0.9, 0.3, 1.74, 0});
    check_draws_without_mpi({"wedges", {"mesh_fs8_wedge.vtu"}, "synthetic", 0.2, -2, 1.8, 0});
    check_draws_without_mpi({"notch", {"notch_stress.vtu"}, "Nodal Stress-normed", 1500000, 0, 8000000, 0});
    check_draws_same_on_ranks({"prisms", {"pentahexa.vtu"}, "synthetic", 0.3, -1, 1.6, 0});
}

void info_counts_the_mixed_lattice(void **)
{
    const run_result r =
        run_in_folder(".", quote_for_shell(tool) + " --info " + quote_for_shell(data_folder + "/mixed_lattice.vtu") +
                               " " + quote_for_shell(data_folder + "/disk_out_ref.ex2"));
    assert_int_equal(r.status, 0);
    for (const char *text : {"66586 cells", "Tetra                    type 10  50024", "type 12  4394", "type 13  8788",
                             "type 14  3380", "bounds -1 .. 1, -1 .. 1, -1 .. 1", "-1.49928 .. 1.4983",
                             "1 blocks, 7472 cells", "293.15 .. 913.15", "times  1"})
        assert_true(r.contains_text(text));
}

/* Checks that a truncated file is refused. Without this check, NetCDF would read zeros beyond the end of the file. */
void exodus_cut_short_is_refused(void **)
{
    const std::string folder = make_empty_folder("vtk_cut");
    const std::string whole = read_file(data_folder + "/disk_out_ref.ex2");
    for (const size_t bytes : {size_t{500}, whole.size() / 2, whole.size() - 100}) {
        write_file(folder + "/cut.ex2", whole.substr(0, bytes));
        const run_result r = run_in_folder(folder, quote_for_shell(tool) + " --info cut.ex2");
        assert_int_equal(r.status, 1);
        assert_true(r.contains_text("insitu-render: cut.ex2: "));
    }
}

} // namespace

int main(int argc, char **argv)
{
    const char *folder = std::getenv("INSITU_TEST_DATA");
    if (argc != 3) return 2;
    if (!folder || !folder[0]) {
        print_message("skipped: INSITU_TEST_DATA is not set\n");
        return 77;
    }
    tool = argv[1];
    mpiexec = argv[2];
    char absolute[4096];
    if (!realpath(folder, absolute)) {
        print_error("INSITU_TEST_DATA: %s: %s\n", folder, std::strerror(errno));
        return 1;
    }
    data_folder = absolute;
    const CMUnitTest tests[] = {
        cmocka_unit_test(info_counts_the_mixed_lattice),
        cmocka_unit_test(exodus_cut_short_is_refused),
        cmocka_unit_test(mixed_lattice_is_the_same_on_ranks),
        cmocka_unit_test(every_kind_of_cell_is_drawn),
        cmocka_unit_test(polyhedra_are_the_same_on_seven_ranks),
        cmocka_unit_test(bluntfin_is_the_same_on_ranks),
        cmocka_unit_test(post_is_the_same_on_ranks),
        cmocka_unit_test(disk_is_the_same_on_ranks),
        cmocka_unit_test(can_series_is_the_same_on_ranks),
        cmocka_unit_test(series_are_coloured_by_a_cell_field),
    };
    return cmocka_run_group_tests(tests, nullptr, nullptr);
}
