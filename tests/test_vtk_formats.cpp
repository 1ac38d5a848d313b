/* Checks insitu-render on files of every format. Pictures must be bit-identical to those of the same cells in a .vtu
 * file, on one rank and on two ranks. A truncated file must cause an error, or must not change the picture. Pictures
 * are written as plain numbers (plain_image.c).
 *
 *     test_vtk_formats <insitu-render> <mpiexec> [percent...]
 *
 * Each file is truncated to each of these percentages of its size, on one rank and on two ranks. By default files are
 * truncated to 95 percent, and only one of thirteen runs is made, because starting a program takes long. test_vtk_files
 * truncates every file, within one program. */
#include <algorithm>
#include <cstdlib>
#include <string>
#include <vector>

#include <vtkCellData.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkStructuredGrid.h>
#include <vtkUnsignedCharArray.h>
#include <vtkUnstructuredGrid.h>
#include <vtkXMLStructuredGridWriter.h>

#include "test_vtk_run.h"
#include "test_vtk_samples.h"

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

std::string tool, mpiexec, folder;
std::vector<size_t> percents = {95};
bool is_quick = true;
std::vector<sample> samples;

std::string make_scene(const std::string &field, const std::string &value)
{
    return "images:\n"
           "  - name: a\n"
           "    size: [64, 48]\n"
           "    layers:\n"
           "      - isosurface:\n"
           "          field: " +
           field +
           "\n"
           "          values: [" +
           value +
           "]\n"
           "    outputs:\n"
           "      - path: a_{cycle:02}.exr\n";
}

int write_all(void **)
{
    folder = make_empty_folder("vtk_formats");
    write_file(folder + "/scene.yaml", make_scene("x", "0.3"));
    write_file(folder + "/cells.yaml", make_scene("p", "1.5"));
    samples = write_samples(folder);
    write_foam(folder + "/foam");
    return 0;
}

run_result run_tool(int ranks, const std::string &arguments)
{
    const std::string start = ranks > 1 ? quote_for_shell(mpiexec) + " -n " + std::to_string(ranks) + " " : "";
    return run_in_folder(folder, start + quote_for_shell(tool) + " " + arguments);
}

void expect_result(const run_result &r, int status, const std::string &text)
{
    if (r.status == status && r.contains_text(text)) return;
    print_error("status %d, expected %d with '%s'\n%s%s", r.status, status, text.c_str(), r.out.c_str(), r.err.c_str());
    assert_true(false);
}

std::string read_picture_file(size_t step)
{
    const std::string number = std::to_string(step);
    return read_file(folder + "/a_" + (step < 10 ? "0" : "") + number + ".exr");
}

/* Draws the files as steps of one run. The first file is the .vtu; the pictures of all others must be bit-identical to
 * its picture. */
void expect_same_pictures(int ranks, const std::vector<std::string> &files)
{
    std::string names;
    for (const std::string &file : files) names += " " + file;
    const std::string count = std::to_string(files.size());
    expect_result(run_tool(ranks, "scene.yaml" + names), 0, count + " steps, " + count + " pictures");
    const std::string first = read_picture_file(0), pixels = first.substr(0, size_t{64} * 48 * 4 * sizeof(float));
    // the picture is not empty: not all pixels have the same colour
    assert_true(pixels.substr(4 * sizeof(float)) != pixels.substr(0, pixels.size() - 4 * sizeof(float)));
    for (size_t i = 1; i < files.size(); i++) {
        if (read_picture_file(i) == first) continue;
        print_error("%s on %d ranks: another picture than %s\n", files[i].c_str(), ranks, files[0].c_str());
        assert_true(false);
    }
}

void every_format_gives_the_picture_of_its_vtu(void **)
{
    const lattice kinds[] = {lattice::image, lattice::rectilinear, lattice::curved};
    for (const lattice kind : kinds) {
        const auto same = make_hex_grid(kind);
        write_vtu(folder + "/same.vtu", same);
        std::vector<std::string> files = {"same.vtu"};
        for (const sample &s : samples) {
            double a[6], b[6];
            s.expected->GetBounds(a);
            same->GetBounds(b);
            if (std::equal(a, a + 6, b)) files.push_back(s.name);
        }
        assert_true(files.size() > 4);
        for (const int ranks : {1, 2}) expect_same_pictures(ranks, files);
    }
}

void polyhedra_beside_other_cells_are_drawn_on_any_ranks(void **)
{
    const auto pieces = std::find_if(samples.begin(), samples.end(), [](auto &s) { return s.name == "p.pvtu"; });
    write_vtu(folder + "/same.vtu", pieces->expected);
    for (const int ranks : {1, 2, 3}) expect_same_pictures(ranks, {"same.vtu", "p.pvtu"});
    expect_result(run_tool(3, "--partition random scene.yaml p.pvtu"), 0, "  7 cells");
    const std::string random = read_picture_file(0);
    expect_result(run_tool(1, "scene.yaml same.vtu"), 0, "  7 cells");
    assert_true(read_picture_file(0) == random);
}

/* Checks pieces without cells. none.vtu is the file that VTK writes for such a grid. */
void pieces_without_cells_change_no_picture(void **)
{
    write_vtu(folder + "/none.vtu", vtkNew<vtkUnstructuredGrid>());
    expect_result(run_tool(1, "scene.yaml raw.vtu"), 0, "  60 cells");
    const std::string alone = read_picture_file(0);
    for (const int ranks : {1, 2}) {
        expect_result(run_tool(ranks, "--pieces scene.yaml none.vtu raw.vtu none.vtu"), 0, "  60 cells");
        assert_true(read_picture_file(0) == alone);
    }
    expect_result(run_tool(1, "scene.yaml none.vtu"), 1, "none.vtu: no cells to draw");
}

void foam_cases_are_drawn_step_by_step(void **)
{
    const run_result all = run_tool(2, "cells.yaml foam/case.foam");
    expect_result(all, 0, "2 steps, 2 pictures");
    expect_result(all, 0, "case.foam  cycle 1  time 0.5  3 cells");
    assert_true(read_picture_file(0) != read_picture_file(1));
}

/* Checks that the picture is the same whether a rank reads the directories of both processors, one of them, or shares
 * one with another rank. */
void foam_cases_of_parallel_runs_look_the_same_on_any_ranks(void **)
{
    for (const int p : {0, 1}) write_foam(folder + "/parallel/processor" + std::to_string(p), 2 * p);
    write_file(folder + "/parallel/dec.foam", "");
    std::string first;
    for (const int ranks : {1, 2, 3}) {
        expect_result(run_tool(ranks, "cells.yaml parallel/dec.foam"), 0, "dec.foam  cycle 1  time 0.5  6 cells");
        if (ranks == 1) first = read_picture_file(1);
        assert_true(read_picture_file(1) == first && first.size() > 300);
    }
}

void steps_of_series_are_chosen_by_number(void **)
{
    write_file(folder + "/run.pvd",
               "<VTKFile type=\"Collection\"><Collection><DataSet timestep=\"3\" file=\"g.vts\"/><DataSet "
               "timestep=\"7.5\" file=\"raw.vtu\"/><DataSet timestep=\"9\" file=\"g.vti\"/></Collection></VTKFile>\n");
    const run_result r = run_tool(1, "--steps 1 scene.yaml run.pvd");
    expect_result(r, 0, "raw.vtu  cycle 1  time 7.5  60 cells");
    expect_result(r, 0, "1 step, 1 picture");
    expect_result(run_tool(1, "--steps 3 scene.yaml run.pvd"), 1, "none chosen of 3");
    expect_result(run_tool(1, "--steps 2: scene.yaml g.pvd run.pvd"), 0, "raw.vtu  cycle 2  time 7.5");
    expect_result(run_tool(1, "--info run.pvd"), 0, "times  3: 3 .. 9");
}

/* Checks that --info ignores hidden cells, and points that belong to no other cells. */
void info_excludes_hidden_cells(void **)
{
    const auto data = make_structured_grid(lattice::curved);
    auto *grid = vtkStructuredGrid::SafeDownCast(data);
    grid->BlankCell(0);
    grid->GetCellData()->GetArray("c")->SetComponent(0, 0, -1e9);
    grid->GetPointData()->GetArray("x")->SetComponent(0, 0, 1e9);
    vtkNew<vtkXMLStructuredGridWriter> writer;
    writer->SetFileName((folder + "/blanked.vts").c_str());
    writer->SetInputData(grid);
    assert_int_equal(writer->Write(), 1);
    const run_result r = run_tool(1, "--info blanked.vts");
    expect_result(r, 0, "blanked.vts: vtkStructuredGrid, 59 cells");
    expect_result(r, 0, "1 .. 59\n");
    expect_result(r, 0, "hidden or ghosts         1\n");
    assert_false(r.contains_text("e+09"));
    assert_false(r.contains_text("vtkGhostType"));
    assert_false(r.contains_text("Empty"));
    expect_result(run_tool(2, "scene.yaml blanked.vts"), 0, "  59 cells");
}

/* Draws a truncated file. The picture of the whole file is drawn for comparison only if the tool does not refuse the
 * truncated file. */
void expect_error_or_same(const sample &s, const std::string &file, size_t percent, int ranks)
{
    const std::string whole = read_file(folder + "/" + file);
    write_file(folder + "/" + file, whole.substr(0, whole.size() * percent / 100));
    const run_result r = run_tool(ranks, "scene.yaml " + s.name);
    write_file(folder + "/" + file, whole);
    const bool is_error = r.status == 1 && r.err.compare(0, 15, "insitu-render: ") == 0;
    if (is_error) return;
    if (r.status == 0) {
        const std::string drawn = read_picture_file(0);
        write_vtu(folder + "/same.vtu", s.expected);
        expect_result(run_tool(1, "scene.yaml same.vtu"), 0, "1 picture");
        if (read_picture_file(0) == drawn) return;
    }
    print_error("%s with %s cut at %zu %% on %d ranks: status %d\n%s%s", s.name.c_str(), file.c_str(), percent, ranks,
                r.status, r.out.c_str(), r.err.c_str());
    assert_true(false);
}

void truncated_files_stop_all_ranks(void **)
{
    int turn = 0;
    for (const sample &s : samples) {
        for (const std::string &file : s.files)
            for (const size_t percent : percents)
                for (const int ranks : {1, 2})
                    if (!is_quick || turn++ % 13 == 0) expect_error_or_same(s, file, percent, ranks);
    }
}

} // namespace

int main(int argc, char **argv)
{
    if (argc < 3) return 2;
    tool = argv[1];
    mpiexec = argv[2];
    is_quick = argc == 3;
    if (!is_quick) percents.clear();
    for (int i = 3; i < argc; i++) percents.push_back(static_cast<size_t>(std::atoi(argv[i])));
    const CMUnitTest tests[] = {
        cmocka_unit_test(every_format_gives_the_picture_of_its_vtu),
        cmocka_unit_test(polyhedra_beside_other_cells_are_drawn_on_any_ranks),
        cmocka_unit_test(pieces_without_cells_change_no_picture),
        cmocka_unit_test(foam_cases_are_drawn_step_by_step),
        cmocka_unit_test(foam_cases_of_parallel_runs_look_the_same_on_any_ranks),
        cmocka_unit_test(steps_of_series_are_chosen_by_number),
        cmocka_unit_test(info_excludes_hidden_cells),
        cmocka_unit_test(truncated_files_stop_all_ranks),
    };
    return cmocka_run_group_tests(tests, write_all, nullptr);
}
