/* Checks pixels of the pictures that insitu-render draws without a scene.
 *
 *     test_vtk_default <insitu-render> <mpiexec> */
#include <array>
#include <cmath>
#include <cstdlib>
#include <string>
#include <vector>

#include <OpenImageIO/imageio.h>

#include <vtkDoubleArray.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkUnstructuredGrid.h>
#include <vtkXMLUnstructuredGridWriter.h>

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

constexpr int width = 240, height = 160, bar = 180; // bar: number of columns to the left of the colour bar

std::string tool, mpiexec, folder;

using colour = std::array<int, 3>;

const colour viridis_high = {253, 231, 37}, viridis_middle = {33, 145, 140};

struct picture {
    std::vector<uint8_t> rgb;

    colour at(int x, int y) const
    {
        const size_t i = 3 * (static_cast<size_t>(y) * width + static_cast<size_t>(x));
        return {rgb[i], rgb[i + 1], rgb[i + 2]};
    }
};

picture read_picture(const std::string &name)
{
    const auto in = OIIO::ImageInput::open(folder + "/" + name);
    assert_true(in != nullptr);
    assert_true(in->spec().width == width && in->spec().height == height && in->spec().nchannels == 3);
    picture p;
    p.rgb.resize(static_cast<size_t>(3) * width * height);
    assert_true(in->read_image(0, 0, 0, 3, OIIO::TypeDesc::UINT8, p.rgb.data()));
    return p;
}

picture draw_default(const std::string &arguments, const std::string &name, int ranks = 1)
{
    const std::string start = ranks > 1 ? quote_for_shell(mpiexec) + " -n " + std::to_string(ranks) + " " : "";
    const run_result r = run_in_folder(folder, start + quote_for_shell(tool) + " --size 240x160 " + arguments);
    if (r.status != 0) print_error("%s\n%s%s", arguments.c_str(), r.out.c_str(), r.err.c_str());
    assert_int_equal(r.status, 0);
    return read_picture(name);
}

/* Returns whether two 8-bit colours are equal up to 2 in each channel: 1 because of the colour map's table, and 1
 * because of rounding. */
bool is_near(const colour &a, const colour &b)
{
    bool is = true;
    for (size_t i = 0; i < 3; i++) is = is && std::abs(a[i] - b[i]) <= 2;
    return is;
}

int count_near(const picture &p, const colour &c)
{
    int count = 0;
    for (int y = 0; y < height; y++)
        for (int x = 0; x < bar; x++) count += is_near(p.at(x, y), c);
    return count;
}

using field = double (*)(const std::array<double, 3> &at);

/* Adds a point that no cell uses and a line, far away and with other values. */
void add_stray_points(vtkUnstructuredGrid *grid, vtkPoints *points, vtkDoubleArray *values)
{
    for (const double at : {30.0, 40.0, 50.0}) {
        points->InsertNextPoint(at, -at, 2 * at);
        values->InsertNextValue(10 * at);
    }
    const vtkIdType ends[2] = {points->GetNumberOfPoints() - 2, points->GetNumberOfPoints() - 1};
    grid->InsertNextCell(VTK_LINE, 2, ends);
}

/* Writes the cells of a lattice over [-1, 1] along all axes except `without`. If `without` is not an axis, the cells
 * are hexahedra. */
void write_lattice(const std::string &name, int without, field f, bool with_stray_points = false)
{
    constexpr int cells = 12, side = cells + 1;
    const std::array<int, 3> sides = {without == 0 ? 1 : side, without == 1 ? 1 : side, without == 2 ? 1 : side};
    vtkNew<vtkUnstructuredGrid> grid;
    vtkNew<vtkPoints> points;
    vtkNew<vtkDoubleArray> values;
    values->SetName("f");
    for (int k = 0; k < sides[2]; k++)
        for (int j = 0; j < sides[1]; j++)
            for (int i = 0; i < sides[0]; i++) {
                const std::array<double, 3> at = {without == 0 ? 0 : 2.0 * i / cells - 1,
                                                  without == 1 ? 0 : 2.0 * j / cells - 1,
                                                  without == 2 ? 0 : 2.0 * k / cells - 1};
                points->InsertNextPoint(at.data());
                values->InsertNextValue(f(at));
            }
    const vtkIdType x = 1, y = sides[0], z = static_cast<vtkIdType>(sides[0]) * sides[1];
    const vtkIdType a = without == 0 ? y : x, b = without == 0 || without == 1 ? z : y;
    for (int k = 0; k < (without < 0 ? cells : 1); k++)
        for (int j = 0; j < cells; j++)
            for (int i = 0; i < cells; i++) {
                const vtkIdType o = i * a + j * b + k * z;
                const vtkIdType ids[8] = {o, o + a, o + a + b, o + b, o + z, o + a + z, o + a + b + z, o + b + z};
                if (without < 0)
                    grid->InsertNextCell(VTK_HEXAHEDRON, 8, ids);
                else
                    grid->InsertNextCell(VTK_QUAD, 4, ids);
            }
    if (with_stray_points) add_stray_points(grid, points, values);
    grid->SetPoints(points);
    grid->GetPointData()->AddArray(values);
    vtkNew<vtkXMLUnstructuredGridWriter> writer;
    writer->SetFileName((folder + "/" + name).c_str());
    writer->SetInputData(grid);
    assert_int_equal(writer->Write(), 1);
}

/* Checks that a solid whose outside does not show the field is cut open. The field is 0 on the whole surface and up to
 * 1 at the centre, so that only a cut shows the colour of the centre. */
void a_solid_with_a_dark_outside_is_cut_open(void **)
{
    write_lattice("hot.vtu", -1, [](auto &at) {
        return std::fmin(1, std::fmax(0, 2 - 2 * (at[0] * at[0] + at[1] * at[1] + at[2] * at[2])));
    });
    assert_true(count_near(draw_default("hot.vtu", "hot_0000.png", 3), viridis_high) > 10);
    assert_int_equal(count_near(draw_default("--whole hot.vtu", "hot_0000.png"), viridis_high), 0);
}

/* Checks a solid whose outside shows the field: it must not be cut. The cube's edge that is nearest to the eye extends
 * downwards from the picture's centre, and a cut would remove it. */
void a_solid_whose_outside_shows_the_field_is_drawn_whole(void **)
{
    write_lattice("shown.vtu", -1, [](auto &at) { return at[0] + 2 * at[2]; });
    const picture p = draw_default("shown.vtu", "shown_0000.png");
    const colour background = p.at(0, height - 1);
    for (int y = 80; y < 140; y++) assert_false(is_near(p.at(112, y), background));
}

/* Checks flat meshes, whose field rises along their first axis. Each column of the picture must have one colour, and
 * colours must rise to the right. Lighting or perspective would make colours vary within a column. */
void flat_meshes_are_seen_from_the_front_in_the_colours_of_the_map(void **)
{
    write_lattice("x.vtu", 0, [](auto &at) { return at[1]; });
    write_lattice("y.vtu", 1, [](auto &at) { return at[0]; });
    for (const std::string name : {"x", "y"}) {
        const picture p = draw_default(name + ".vtu", name + "_0000.png");
        std::vector<int> middles;
        for (int x = 0; x < bar; x++)
            if (is_near(p.at(x, height / 2), viridis_middle)) middles.push_back(x);
        assert_true(!middles.empty());
        const int at = middles[middles.size() / 2];
        for (int y = height / 2 - 30; y <= height / 2 + 30; y++)
            for (const int x : {at - 20, at, at + 20}) assert_true(p.at(x, y) == p.at(x, height / 2));
        assert_true(p.at(at + 20, height / 2)[0] > p.at(at, height / 2)[0]); /* the map's high end has more red */
    }
}

/* Checks solids and flat meshes with points and lines that are not drawn: camera, colours and cut must be those of the
 * mesh without them, for a single file and for a series. */
void points_and_lines_that_are_not_drawn_change_no_picture(void **)
{
    const auto draw_both = [](int without, bool with_stray_points) {
        for (const std::string name : {"stray_0.vtu", "stray_1.vtu"})
            write_lattice(
                name, without, [](auto &at) { return at[0] + 2 * at[2]; }, with_stray_points);
        return std::array<picture, 3>{draw_default("stray_0.vtu", "stray_0_0000.png"),
                                      draw_default("stray_0.vtu stray_1.vtu", "stray_0_0000.png"),
                                      draw_default("stray_0.vtu stray_1.vtu", "stray_0_0000.png", 2)};
    };
    for (const int without : {-1, 1}) {
        const auto expected = draw_both(without, false), found = draw_both(without, true);
        for (size_t i = 0; i < expected.size(); i++)
            if (expected[i].rgb != found[i].rgb) fail_msg("lattice without axis %d: picture %zu differs", without, i);
    }
}

void write_grid_without_cells(const std::string &name)
{
    vtkNew<vtkXMLUnstructuredGridWriter> writer;
    writer->SetFileName((folder + "/" + name).c_str());
    writer->SetInputData(vtkNew<vtkUnstructuredGrid>());
    assert_int_equal(writer->Write(), 1);
}

/* Checks that the default picture of pieces does not depend on their order. In the first pair one piece has neither
 * cells nor fields, and the pictures must be equal. The second pair are flat meshes that are perpendicular to each
 * other; pixels where they meet may differ. */
void pieces_are_drawn_the_same_in_any_order(void **)
{
    const auto write_empty = [](const std::string &name) { write_grid_without_cells(name); };
    const auto write_x = [](const std::string &name) {
        write_lattice(name, 0, [](auto &at) { return at[1] + at[2]; });
    };
    const auto write_y = [](const std::string &name) {
        write_lattice(name, 1, [](auto &at) { return at[0] + at[2]; });
    };
    using write_function = void (*)(const std::string &);
    const std::array<std::array<write_function, 2>, 2> pairs = {{{write_empty, write_x}, {write_x, write_y}}};
    for (const auto &pair : pairs) {
        std::vector<picture> pictures;
        for (const size_t first : {size_t{0}, size_t{1}}) {
            pair[first]("a.vtu");
            pair[1 - first]("b.vtu");
            pictures.push_back(draw_default("--pieces a.vtu b.vtu", "a_0000.png", 2));
        }
        int different = 0, drawn = 0;
        const colour background = pictures[0].at(0, height - 1);
        for (int y = 0; y < height; y++)
            for (int x = 0; x < width; x++) {
                different += !is_near(pictures[0].at(x, y), pictures[1].at(x, y));
                drawn += x < bar && !is_near(pictures[0].at(x, y), background);
            }
        const int allowed = pair[0] == pairs[0][0] ? 0 : 100;
        if (different > allowed || drawn < 2000) fail_msg("%d pixels differ, %d are drawn", different, drawn);
    }
}

/* Checks that the only step of a run reports faults of the picture's texts, and that the warning about a missing glyph
 * does not hide the one about missing space. */
void faults_of_words_are_reported_in_a_run_of_one_step(void **)
{
    write_lattice("words.vtu", 2, [](auto &at) { return at[0]; });
    write_file(folder + "/words.yaml", "images:\n  - {name: w, size: [120, 80], layers: [{surface: {}}], decorations: "
                                       "{size: 0.2, title: \"\u6e29\", axes: true}, outputs: [{path: w.png}]}\n");
    for (const std::string &start : {std::string(), quote_for_shell(mpiexec) + " -n 3 "}) {
        const run_result r = run_in_folder(folder, start + quote_for_shell(tool) + " words.yaml words.vtu");
        if (r.status != 0) fail_msg("%s", r.err.c_str());
        for (const char *words : {"warning: image \"w\": the font", "no glyphs for U+6E29",
                                  "warning: image \"w\": no room in 120 x 80 pixels for the axes, which is left out"})
            if (!r.contains_text(words)) fail_msg("no \"%s\" in %s", words, r.err.c_str());
    }
}

int set_up_test_group(void **)
{
    folder = make_empty_folder("vtk_default");
    return 0;
}

} // namespace

int main(int argc, char **argv)
{
    if (argc != 3) return 2;
    tool = argv[1];
    mpiexec = argv[2];
    const CMUnitTest tests[] = {
        cmocka_unit_test(a_solid_with_a_dark_outside_is_cut_open),
        cmocka_unit_test(a_solid_whose_outside_shows_the_field_is_drawn_whole),
        cmocka_unit_test(flat_meshes_are_seen_from_the_front_in_the_colours_of_the_map),
        cmocka_unit_test(points_and_lines_that_are_not_drawn_change_no_picture),
        cmocka_unit_test(pieces_are_drawn_the_same_in_any_order),
        cmocka_unit_test(faults_of_words_are_reported_in_a_run_of_one_step),
    };
    return cmocka_run_group_tests(tests, set_up_test_group, nullptr);
}
