/* Checks insitu-render as a program: its output for valid and invalid files, on one rank and on several. The test
 * writes the files, so that it knows their contents.
 *
 *     test_vtk_tool <insitu-render> <a copy that writes pictures as plain numbers (plain_image.c)> <mpiexec> */
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include <vtkCellArray.h>
#include <vtkCellData.h>
#include <vtkDoubleArray.h>
#include <vtkFieldData.h>
#include <vtkFloatArray.h>
#include <vtkMultiBlockDataSet.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>
#include <vtkUnstructuredGrid.h>
#include <vtkUnstructuredGridWriter.h>
#include <vtkXMLMultiBlockDataWriter.h>
#include <vtkXMLPolyDataWriter.h>
#include <vtkXMLUnstructuredGridWriter.h>

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

std::string real_tool, tool, mpiexec, folder;

const char *const scene = "images:\n"
                          "  - name: a\n"
                          "    size: [32, 24]\n"
                          "    layers:\n"
                          "      - isosurface:\n"
                          "          field: x\n"
                          "          values: [0.5]\n"
                          "    outputs:\n"
                          "      - path: a_{cycle:02}.exr\n";

/* Returns a row of tets along x, beginning at `first`, each with points of its own. The point field "x" is the point's
 * x; the cell field "number" is the tet's number. */
vtkSmartPointer<vtkUnstructuredGrid> make_row_of_tets(int count, int first = 0)
{
    auto grid = vtkSmartPointer<vtkUnstructuredGrid>::New();
    vtkNew<vtkPoints> points;
    vtkNew<vtkFloatArray> x, number;
    x->SetName("x");
    number->SetName("number");
    const double corner[4][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    for (int i = first; i < first + count; i++) {
        vtkIdType ids[4];
        for (int k = 0; k < 4; k++) {
            ids[k] = points->InsertNextPoint(corner[k][0] + i, corner[k][1], corner[k][2]);
            x->InsertNextValue(static_cast<float>(corner[k][0] + i));
        }
        grid->InsertNextCell(VTK_TETRA, 4, ids);
        number->InsertNextValue(static_cast<float>(i));
    }
    grid->SetPoints(points);
    grid->GetPointData()->AddArray(x);
    grid->GetCellData()->AddArray(number);
    return grid;
}

std::string make_path(const std::string &name)
{
    return folder + "/" + name;
}

void write_vtu(const std::string &name, vtkUnstructuredGrid *grid)
{
    vtkNew<vtkXMLUnstructuredGridWriter> writer;
    writer->SetFileName(make_path(name).c_str());
    writer->SetInputData(grid);
    assert_int_equal(writer->Write(), 1);
}

/* Writes 4 × 4 quads and a triangle in VTK's format of surface meshes (.vtp). */
void write_sheet()
{
    vtkNew<vtkPoints> points;
    vtkNew<vtkFloatArray> height;
    height->SetName("height");
    for (int i = 0; i < 25; i++) {
        points->InsertNextPoint(i % 5, i / 5, 0.1 * i);
        height->InsertNextValue(0.1F * static_cast<float>(i));
    }
    vtkNew<vtkCellArray> cells;
    for (int i = 0; i < 20; i++)
        if (i % 5 < 4) cells->InsertNextCell({i, i + 1, i + 6, i + 5});
    cells->InsertNextCell({0, 6, 12});
    vtkNew<vtkPolyData> sheet;
    sheet->SetPoints(points);
    sheet->SetPolys(cells);
    sheet->GetPointData()->AddArray(height);
    vtkNew<vtkXMLPolyDataWriter> writer;
    writer->SetFileName(make_path("sheet.vtp").c_str());
    writer->SetInputData(sheet);
    assert_int_equal(writer->Write(), 1);
}

int make_files(void **)
{
    folder = make_empty_folder("vtk_tool");
    write_file(make_path("scene.yaml"), scene);
    write_vtu("row.vtu", make_row_of_tets(40));
    write_vtu("row_2.vtu", make_row_of_tets(2));
    write_vtu("row_10.vtu", make_row_of_tets(10));
    write_vtu("empty.vtu", make_row_of_tets(0));
    const std::string whole = read_file(make_path("row.vtu"));
    write_file(make_path("cut.vtu"), whole.substr(0, whole.size() / 2));
    write_file(make_path("notes.txt"), "no data");
    write_file(make_path("pieces.pvtu"),
               "<VTKFile type=\"PUnstructuredGrid\" version=\"0.1\"><PUnstructuredGrid GhostLevel=\"0\">"
               "<PPointData><PDataArray type=\"Float32\" Name=\"x\"/></PPointData>"
               "<PCellData><PDataArray type=\"Float32\" Name=\"number\"/></PCellData>"
               "<PPoints><PDataArray type=\"Float32\" NumberOfComponents=\"3\"/></PPoints>\n"
               "<Piece Source=\"row.vtu\"/>\n<Piece Source=\"row_2.vtu\"/>\n<Piece Source=\"row_10.vtu\"/>\n"
               "</PUnstructuredGrid></VTKFile>\n");

    vtkNew<vtkUnstructuredGridWriter> legacy;
    legacy->SetFileName(make_path("row.vtk").c_str());
    legacy->SetInputData(make_row_of_tets(5));
    assert_int_equal(legacy->Write(), 1);

    vtkNew<vtkMultiBlockDataSet> blocks;
    blocks->SetBlock(0, make_row_of_tets(3));
    blocks->SetBlock(1, make_row_of_tets(4));
    vtkNew<vtkXMLMultiBlockDataWriter> writer;
    writer->SetFileName(make_path("blocks.vtm").c_str());
    writer->SetInputData(blocks);
    assert_int_equal(writer->Write(), 1);

    vtkNew<vtkUnstructuredGrid> flat;
    flat->SetPoints(make_row_of_tets(1)->GetPoints());
    const vtkIdType line[] = {0, 1};
    flat->InsertNextCell(VTK_LINE, 2, line);
    write_vtu("flat.vtu", flat);
    write_sheet();
    return 0;
}

run_result run_tool(const std::string &arguments)
{
    return run_in_folder(folder, quote_for_shell(tool) + " " + arguments);
}

run_result run_ranks(int ranks, const std::string &arguments)
{
    return run_in_folder(folder, quote_for_shell(mpiexec) + " -n " + std::to_string(ranks) + " " +
                                     quote_for_shell(tool) + " " + arguments);
}

void expect_result(const run_result &r, int status, const std::string &text)
{
    if (r.status == status && r.contains_text(text)) return;
    print_error("status %d, expected %d with '%s'\n%s%s", r.status, status, text.c_str(), r.out.c_str(), r.err.c_str());
    assert_true(false);
}

int count_occurrences(const std::string &text, const std::string &what)
{
    int count = 0;
    for (size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + 1)) count++;
    return count;
}

void help_lists_the_options(void **)
{
    const run_result r = run_tool("--help");
    expect_result(r, 0, "usage: insitu-render");
    for (const char *option : {"--info", "--steps", "--pieces", "--partition", "--help", ".vtu", ".vtm"})
        assert_true(r.contains_text(option));
    assert_string_equal(r.err.c_str(), "");
}

void info_lists_what_is_in_a_file(void **)
{
    const run_result r = run_tool("--info row.vtu");
    expect_result(r, 0, "40 cells, 160 points (float)");
    assert_true(r.contains_text("Tetra"));
    assert_true(r.contains_text("bounds 0 .. 40, 0 .. 1, 0 .. 1"));
    assert_true(r.contains_text("point  x "));
    assert_true(r.contains_text("0 .. 40\n"));
    assert_true(r.contains_text("cell   number"));
    assert_true(r.contains_text("0 .. 39\n"));
}

/* Checks the names of cell types for which VTK 9.1 has other names. */
void info_names_cells_of_higher_order(void **)
{
    vtkNew<vtkUnstructuredGrid> grid;
    grid->SetPoints(make_row_of_tets(1)->GetPoints());
    const vtkIdType ids[] = {0, 1, 2, 3};
    grid->InsertNextCell(VTK_LAGRANGE_TETRAHEDRON, 4, ids);
    grid->InsertNextCell(VTK_BEZIER_TETRAHEDRON, 4, ids);
    write_vtu("orders.vtu", grid);
    const run_result r = run_tool("--info orders.vtu");
    expect_result(r, 0, "cells  LagrangeTetrahedron      type 71  1\n");
    expect_result(r, 0, "cells  BezierTetrahedron        type 78  1\n");
}

void info_reads_every_kind(void **)
{
    expect_result(run_tool("--info pieces.pvtu"), 0, "52 cells");
    expect_result(run_tool("--info blocks.vtm"), 0, "2 blocks, 7 cells");
    expect_result(run_tool("--info row.vtk"), 0, "5 cells");
    expect_result(run_ranks(2, "--info row.vtk"), 0, "5 cells");
}

void wrong_files_are_named_with_the_reason(void **)
{
    expect_result(run_tool("scene.yaml missing.vtu"), 1, "insitu-render: missing.vtu: No such file");
    expect_result(run_tool("scene.yaml notes.txt"), 1, "insitu-render: notes.txt: unknown ending");
    expect_result(run_tool("scene.yaml ."), 1, "is a directory");
    expect_result(run_tool("--info cut.vtu"), 1, "insitu-render: cut.vtu: is cut short");
    expect_result(run_tool("missing.vtu"), 1, "insitu-render: missing.vtu: No such file");
    expect_result(run_tool("missing.vtu row.vtu"), 1, "insitu-render: missing.vtu: No such file");
    expect_result(run_tool("notes.txt"), 1, "insitu-render: notes.txt: unknown ending");
    expect_result(run_tool("."), 1, "insitu-render: .: is a directory");
    expect_result(run_tool("--info missing.vtu"), 1, "insitu-render: missing.vtu: No such file");
}

void errors_are_one_line(void **)
{
    const run_result r = run_tool("--info cut.vtu");
    assert_int_equal(r.status, 1);
    assert_int_equal(count_occurrences(r.err, "\n"), 1);
    assert_string_equal(r.out.c_str(), "");
}

void wrong_options_are_named(void **)
{
    expect_result(run_tool("--fast"), 1, "insitu-render: --fast: unknown option; see insitu-render --help");
    expect_result(run_tool("--filed x row.vtu"), 1, "--filed: unknown option (did you mean --field?)");
    expect_result(run_tool("--step=0 row.vtu"), 1, "--step: unknown option (did you mean --steps?)");
    expect_result(run_tool("--output x.png row.vtu"), 1,
                  "--output: unknown option (pictures go where the scene's outputs say");
    expect_result(run_tool("-o x.png row.vtu"), 1, "-o: unknown option (pictures go where the scene's outputs say");
    expect_result(run_tool("--scene scene.yaml row.vtu"), 1,
                  "--scene: unknown option (the scene is given without an option");
    expect_result(run_tool("--ranks 2 row.vtu"), 1, "--ranks: unknown option (ranks are mpirun's");
    expect_result(run_tool("--colormap viridis row.vtu"), 1, "unknown option (what is drawn is said by a scene file");
    expect_result(run_tool("--size 64x48 scene.yaml row.vtu"), 1, "--size: given with the scene file scene.yaml");
    expect_result(run_tool("scene.yaml row.vtu scene.yaml"), 1, "scene.yaml: a second scene file beside scene.yaml");
    expect_result(run_tool("--info scene.yaml"), 1, "scene.yaml: is a scene file, expected data");
    expect_result(run_tool("--pieces=some scene.yaml row.vtu"), 1, "--pieces = some");
    expect_result(run_tool("--steps 3:1 scene.yaml row.vtu"), 1, "the first step is after the last");
    expect_result(run_tool("--steps x scene.yaml row.vtu"), 1, "--steps x: expected");
    expect_result(run_tool("--steps 4: scene.yaml row.vtu"), 1, "none chosen of 1");
    expect_result(run_tool("--partition round scene.yaml row.vtu"), 1, "--partition round: expected");
    expect_result(run_tool("--steps"), 1, "--steps: 1 required A:B missing");
    expect_result(run_tool(""), 1, "missing");
    expect_result(run_tool("scene.yaml"), 1, "data files are missing");
    expect_result(run_tool("--size 3 row.vtu"), 1, "--size 3: expected WIDTHxHEIGHT");
    expect_result(run_tool("--size 0x9 row.vtu"), 1, "--size 0x9: expected WIDTHxHEIGHT");
    expect_result(run_tool("--camera 0,0,0 row.vtu"), 1, "--camera 0,0,0: expected X,Y,Z");
    expect_result(run_tool("--field none row.vtu"), 1,
                  "insitu-render: --field none: no mesh has the field \"none\"; there are");
    expect_result(run_tool("--size 64x48 --camera 1,2,3 row.vtu"), 0, "1 step, 1 picture");
    expect_result(run_tool("row.vtu scene.yaml"), 0, "1 step, 1 picture");
}

/* Checks that all ranks stop if only one rank fails: its file does not exist, while the other ranks continue to
 * collective calls. */
void failure_on_one_rank_stops_all_ranks(void **)
{
    const std::string start = quote_for_shell(mpiexec) + " -n 2 " + quote_for_shell(tool) +
                              " scene.yaml row.vtu : -n 1 " + quote_for_shell(tool);
    expect_result(run_in_folder(folder, start + " scene.yaml missing.vtu"), 1,
                  "insitu-render: missing.vtu: No such file");
}

void read_failure_on_one_rank_stops_all_ranks(void **)
{
    const std::string start = quote_for_shell(mpiexec) + " -n 2 " + quote_for_shell(tool) +
                              " scene.yaml row.vtu : -n 1 " + quote_for_shell(tool);
    expect_result(run_in_folder(folder, start + " scene.yaml cut.vtu"), 1, "insitu-render: cut.vtu: is cut short");
    expect_result(run_ranks(3, "scene.yaml cut.vtu"), 1, "insitu-render: cut.vtu: is cut short");
}

void surface_meshes_are_drawn(void **)
{
    expect_result(run_tool("--info sheet.vtp"), 0, "sheet.vtp: vtkPolyData, 17 cells");
    const std::string two = quote_for_shell(mpiexec) + " -n 2 ", options = " --field height --size 160x120 sheet.vtp";
    for (const std::string &start : {std::string(), two}) {
        expect_result(run_in_folder(folder, start + quote_for_shell(real_tool) + options), 0, "17 cells");
        assert_int_equal(read_file(make_path("sheet_0000.png")).compare(1, 3, "PNG"), 0);
        std::filesystem::remove(make_path("sheet_0000.png"));
    }
}

/* Checks the names of pictures drawn without a scene, for files of the same name in several directories or with several
 * extensions, and for long names with a common prefix. If a file is drawn again, its pictures must have the same
 * names. */
void default_pictures_of_two_files_have_two_names(void **)
{
    namespace fs = std::filesystem;
    const fs::path here = make_path("names");
    const std::string begin(70, 'n');
    const char *const ways[] = {"one/sheet.vtp", "two/sheet.vtp", "sheet.vtp"};
    fs::remove_all(here);
    for (const char *way : {"one", "two", "three"}) fs::create_directories(here / way);
    for (const char *way : ways) fs::copy_file(make_path("sheet.vtp"), here / way);
    for (const char *end : {"a.vtp", "b.vtp"}) fs::copy_file(make_path("sheet.vtp"), here / (begin + end));
    fs::copy_file(make_path("sheet.vtp"), here / "three/row.vtp");
    fs::copy_file(make_path("row.vtu"), here / "three/row.vtu");
    const auto count = [&] {
        return std::count_if(fs::directory_iterator(here), fs::directory_iterator(),
                             [](const fs::directory_entry &e) { return e.path().extension() == ".png"; });
    };
    int drawn = 0;
    for (const std::string &file : {std::string(ways[0]), std::string(ways[1]), std::string(ways[2]), begin + "a.vtp",
                                    begin + "b.vtp", std::string("three/row.vtp"), std::string("three/row.vtu")}) {
        for (int turn = 0; turn < 2; turn++)
            expect_result(run_in_folder(here, quote_for_shell(tool) + " --size 32x24 " + file), 0, "1 picture");
        assert_int_equal(count(), ++drawn);
    }
    assert_true(fs::exists(here / "sheet_0000.png"));
}

/* Checks names that are longer than a title and whose characters have several bytes, names that look like
 * placeholders, and names that are not UTF-8. */
void default_pictures_of_files_with_unusual_names_are_drawn(void **)
{
    namespace fs = std::filesystem;
    const fs::path here = make_path("unusual");
    std::string umlauts, shifted = "a", ideographs;
    for (int i = 0; i < 31; i++) {
        umlauts += "\u00e4";
        shifted += "\u00e4";
        ideographs += "\u540d";
    }
    for (const std::string &name : {umlauts, shifted, ideographs, std::string("a{b}c"), std::string("\xe4 in Latin-1"),
                                    std::string("delete\x7f"), std::string("{cycle}")}) {
        fs::remove_all(here);
        fs::create_directories(here);
        fs::copy_file(make_path("row_2.vtu"), here / (name + ".vtu"));
        const run_result r =
            run_in_folder(here, quote_for_shell(tool) + " --size 32x24 " + quote_for_shell(name + ".vtu"));
        expect_result(r, 0, "1 picture");
        assert_false(r.contains_text("YAML"));
    }
    assert_true(fs::exists(here / "{cycle}_0000.png"));
}

/* Checks that the default picture is that of the first field whose name is UTF-8. The other names are Latin-1, and
 * characters that a scene can only contain as escapes: a control character, a noncharacter and a line separator. */
void fields_with_unusual_names_are_drawn_if_the_names_are_utf8(void **)
{
    const std::string head = "# vtk DataFile Version 3.0\nfields\nASCII\nDATASET UNSTRUCTURED_GRID\n"
                             "POINTS 3 float\n0 0 0 1 0 0 0 1 0\nCELLS 1 4\n3 0 1 2\nCELL_TYPES 1\n5\nPOINT_DATA 3\n",
                      latin = "h\xf6he";
    const auto make_field = [](const std::string &name) {
        return "SCALARS " + name + " float\nLOOKUP_TABLE default\n0 1 2\n";
    };
    for (const std::string &name : {std::string("h\u00f6he"), std::string("\xc2\x85"), std::string("a\uffffb"),
                                    std::string("a\u2028b"), std::string("\U0001f600")}) {
        write_file(make_path("named.vtk"), head + make_field(latin) + make_field(name));
        expect_result(run_tool("--size 32x24 named.vtk"), 0, "1 picture");
        expect_result(run_tool("--size 32x24 --field " + quote_for_shell(name) + " named.vtk"), 0, "1 picture");
    }
    write_file(make_path("named.vtk"), head + make_field(latin));
    expect_result(run_tool("--size 32x24 named.vtk"), 0, "1 picture");
    expect_result(run_tool("--size 32x24 --field " + quote_for_shell(latin) + " named.vtk"), 1,
                  "--field " + latin + ": is not UTF-8");
}

void empty_input_is_an_error(void **)
{
    expect_result(run_tool("scene.yaml empty.vtu"), 1, "insitu-render: empty.vtu: no cells to draw");
    expect_result(run_tool("scene.yaml flat.vtu"), 1, "flat.vtu: no cells to draw; 1 points and lines");
    expect_result(run_ranks(2, "scene.yaml empty.vtu"), 1, "empty.vtu: no cells to draw");
}

void wrong_scenes_are_errors(void **)
{
    expect_result(run_tool("missing.yaml row.vtu"), 1, "missing.yaml");
    write_file(make_path("wrong.yaml"), "images:\n  - nmae: a\n");
    expect_result(run_tool("wrong.yaml row.vtu"), 1, "nmae");
}

void several_files_are_steps_in_the_order_of_their_numbers(void **)
{
    const run_result r = run_tool("scene.yaml row_10.vtu row_2.vtu");
    expect_result(r, 0, "2 steps, 2 pictures");
    assert_true(r.out.find("row_2.vtu  cycle 0") < r.out.find("row_10.vtu  cycle 1"));
    assert_int_equal(read_file(make_path("a_00.exr")).empty(), 0);
    assert_int_equal(read_file(make_path("a_01.exr")).empty(), 0);
}

/* Checks the order of steps whose names have a point between two numbers. The names are given in reverse. */
void decimals_and_numbers_after_a_point_are_sorted_by_value(void **)
{
    const std::vector<std::vector<std::string>> orders = {{"t0.25.vtu", "t0.5.vtu", "t0.75.vtu", "t1.0.vtu"},
                                                          {"v1.9.vtu", "v1.10.vtu", "v1.11.vtu"},
                                                          {"v1.2.9.vtu", "v1.2.11.vtu"},
                                                          {"run.2.vtu", "run.11.vtu"}};
    for (const std::vector<std::string> &names : orders) {
        std::string given;
        for (const std::string &name : names) {
            std::filesystem::copy_file(make_path("row_2.vtu"), make_path(name),
                                       std::filesystem::copy_options::overwrite_existing);
            given = " " + name + given;
        }
        const run_result r = run_tool("scene.yaml" + given);
        for (size_t i = 0; i < names.size(); i++) expect_result(r, 0, names[i] + "  cycle " + std::to_string(i));
    }
}

void chosen_steps_keep_their_cycles(void **)
{
    const run_result r = run_tool("--steps 1 scene.yaml row_2.vtu row_10.vtu");
    expect_result(r, 0, "row_10.vtu  cycle 1");
    assert_int_equal(count_occurrences(r.out, "cycle"), 1);
}

vtkSmartPointer<vtkUnstructuredGrid> make_row_without_x(int count, int first = 0)
{
    auto grid = make_row_of_tets(count, first);
    grid->GetPointData()->RemoveArray("x");
    return grid;
}

void steps_before_the_first_value_of_a_field_are_skipped(void **)
{
    write_vtu("late_0.vtu", make_row_without_x(3));
    write_vtu("late_1.vtu", make_row_of_tets(3));
    write_vtu("late_2.vtu", make_row_of_tets(3));
    const run_result r = run_tool("scene.yaml late_0.vtu late_1.vtu late_2.vtu");
    expect_result(r, 0, "3 steps, 2 pictures");
    expect_result(r, 0, "late_0.vtu: not drawn: scene.yaml:6: no mesh has the field \"x\"");
    expect_result(run_tool("scene.yaml late_0.vtu late_0.vtu"), 1,
                  "insitu-render: scene.yaml:6: no mesh has the field");
}

/* Checks that the default field is one that the first and the last step have or, if there is none, one of the last
 * step. */
void default_field_is_one_that_the_last_step_has(void **)
{
    auto with_y = make_row_without_x(3);
    with_y->GetCellData()->GetArray("number")->SetName("y");
    write_vtu("with_x.vtu", make_row_of_tets(3));
    write_vtu("without.vtu", make_row_without_x(3));
    write_vtu("with_y.vtu", with_y);
    expect_result(run_tool("with_x.vtu without.vtu"), 0, "2 steps, 2 pictures");
    const run_result later = run_tool("with_y.vtu with_x.vtu with_x.vtu");
    expect_result(later, 0, "3 steps, 2 pictures");
    expect_result(later, 0, "with_y.vtu: not drawn: no mesh has the field \"x\"; there are");
    expect_result(run_tool("with_x.vtu without.vtu with_x.vtu"), 0, "; other steps have it, and --field takes another");
}

/* Checks that, without a scene, all steps of a series share the range of values and the camera: a small step is drawn
 * differently if a larger step with larger values follows. Pictures are the same on any number of ranks. The pictures
 * show the time, so all steps have the same time. */
void a_series_has_one_scale_and_one_camera(void **)
{
    for (const auto &[name, count] : {std::pair{"grow_0.vtu", 2}, {"grow_1.vtu", 9}, {"grow_2.vtu", 2}}) {
        auto row = make_row_of_tets(count);
        vtkNew<vtkDoubleArray> time;
        time->SetName("TimeValue");
        time->InsertNextValue(1);
        row->GetFieldData()->AddArray(time);
        write_vtu(name, row);
    }
    const auto first_picture = [](const std::string &others, int ranks) {
        std::filesystem::remove(make_path("grow_0_0000.png"));
        expect_result(run_ranks(ranks, "--size 96x64 grow_0.vtu " + others), 0, " pictures");
        const std::string picture = read_file(make_path("grow_0_0000.png"));
        assert_false(picture.empty());
        return picture;
    };
    const std::string same = first_picture("grow_2.vtu", 1), grown = first_picture("grow_1.vtu", 1);
    assert_true(same != grown);
    assert_true(grown == first_picture("grow_1.vtu grow_2.vtu", 2));
}

/* Checks pieces that differ: one has doubles, one has no field, and one has a field that is not declared. The picture
 * and the warnings must be the same on any number of ranks. */
void pieces_that_differ_are_drawn_the_same_on_any_ranks(void **)
{
    auto wide = make_row_of_tets(4), more = make_row_of_tets(2, 10);
    vtkNew<vtkDoubleArray> x;
    x->DeepCopy(wide->GetPointData()->GetArray("x"));
    x->SetName("x");
    wide->GetPointData()->AddArray(x);
    vtkNew<vtkFloatArray> other;
    other->DeepCopy(more->GetPointData()->GetArray("x"));
    other->SetName("other");
    more->GetPointData()->AddArray(other);
    write_vtu("wide.vtu", wide);
    write_vtu("none.vtu", make_row_without_x(6, 4));
    write_vtu("more.vtu", more);
    write_file(make_path("differ.pvtu"),
               "<VTKFile type=\"PUnstructuredGrid\" version=\"0.1\"><PUnstructuredGrid GhostLevel=\"0\">"
               "<PPointData><PDataArray type=\"Float32\" Name=\"x\"/></PPointData>"
               "<PCellData><PDataArray type=\"Float32\" Name=\"number\"/></PCellData>\n"
               "<Piece Source=\"wide.vtu\"/>\n<Piece Source=\"none.vtu\"/>\n<Piece Source=\"more.vtu\"/>\n"
               "</PUnstructuredGrid></VTKFile>\n");
    std::string first;
    for (const int ranks : {1, 3}) {
        const run_result r = run_ranks(ranks, "scene.yaml differ.pvtu");
        expect_result(r, 0, "1 step, 1 picture");
        expect_result(r, 0, "wide.vtu: its field \"x\" is of type Float64, declared as Float32");
        expect_result(r, 0, "none.vtu: has no field \"x\"");
        expect_result(r, 0, "more.vtu: has a field \"other\"");
        const std::string picture = read_file(make_path("a_00.exr"));
        if (ranks == 1) first = picture;
        assert_true(picture == first && !picture.empty());
    }
}

/* Returns hexes of order 2 in a row along y, whose vertical edges are bent, and beside the last one a cell of the type
 * `last`: a polyhedron or a polygon, or another hex. The point field "x" is the square of y. */
vtkSmartPointer<vtkUnstructuredGrid> make_bent_hexes(int count, int last)
{
    constexpr int nodes[20][3] = {{0, 0, 0}, {2, 0, 0}, {2, 2, 0}, {0, 2, 0}, {0, 0, 2}, {2, 0, 2}, {2, 2, 2},
                                  {0, 2, 2}, {1, 0, 0}, {2, 1, 0}, {1, 2, 0}, {0, 1, 0}, {1, 0, 2}, {2, 1, 2},
                                  {1, 2, 2}, {0, 1, 2}, {0, 0, 1}, {2, 0, 1}, {2, 2, 1}, {0, 2, 1}};
    auto grid = vtkSmartPointer<vtkUnstructuredGrid>::New();
    vtkNew<vtkPoints> points;
    vtkNew<vtkFloatArray> x;
    x->SetName("x");
    const int rows = 2 * count + 3;
    for (int i = 0; i < 9 * rows; i++) {
        const int at[3] = {i % 3, i / 3 % rows, i / 3 / rows};
        points->InsertNextPoint(at[0] + (at[2] == 1 ? 0.4 : 0), at[1], at[2]);
        x->InsertNextValue(static_cast<float>(at[1] * at[1]));
    }
    for (int cell = 0; cell <= count; cell++) {
        vtkIdType ids[20];
        for (int k = 0; k < 20; k++) ids[k] = nodes[k][0] + 3 * (nodes[k][1] + 2 * cell + rows * nodes[k][2]);
        const vtkIdType faces[] = {4, ids[0], ids[3], ids[2], ids[1], 4, ids[4], ids[5], ids[6], ids[7],
                                   4, ids[0], ids[1], ids[5], ids[4], 4, ids[1], ids[2], ids[6], ids[5],
                                   4, ids[2], ids[3], ids[7], ids[6], 4, ids[3], ids[0], ids[4], ids[7]};
        if (cell < count || last == VTK_QUADRATIC_HEXAHEDRON)
            grid->InsertNextCell(VTK_QUADRATIC_HEXAHEDRON, 20, ids);
        else if (last == VTK_POLYHEDRON)
            grid->InsertNextCell(VTK_POLYHEDRON, 8, ids, 6, faces);
        else
            grid->InsertNextCell(last, 4, ids);
    }
    grid->SetPoints(points);
    grid->GetPointData()->AddArray(x);
    return grid;
}

void write_blocks(const std::string &name, const std::vector<vtkSmartPointer<vtkUnstructuredGrid>> &grids)
{
    vtkNew<vtkMultiBlockDataSet> blocks;
    for (size_t b = 0; b < grids.size(); b++) blocks->SetBlock(static_cast<unsigned>(b), grids[b]);
    vtkNew<vtkXMLMultiBlockDataWriter> writer;
    writer->SetFileName(make_path(name).c_str());
    writer->SetInputData(blocks);
    assert_int_equal(writer->Write(), 1);
}

/* Draws on 1, 2 and 3 ranks; expects the same picture, without a warning that cells are drawn by their corners. */
void expect_bent_hexes_on_any_ranks(const std::string &arguments)
{
    std::string first;
    for (const int ranks : {1, 2, 3}) {
        const run_result r = run_ranks(ranks, arguments);
        expect_result(r, 0, "1 step, 1 picture");
        if (r.contains_text("drawn by their corners")) fail_msg("%s on %d ranks: by corners", arguments.c_str(), ranks);
        const std::string picture = read_file(make_path("a_00.exr"));
        if (first.empty()) first = picture;
        if (picture != first || picture.empty()) fail_msg("%s on %d ranks: differs", arguments.c_str(), ranks);
    }
}

/* Checks that hexes of order 2 are drawn by their corners on all ranks if only one rank has the polyhedron or polygon
 * that is in one grid with them, and that they are not if that cell is in another block. */
void higher_order_cells_beside_polyhedra_are_drawn_the_same_on_any_ranks(void **)
{
    for (const int last : {VTK_POLYHEDRON, VTK_POLYGON}) {
        write_vtu("beside.vtu", make_bent_hexes(5, last));
        std::string first;
        for (const std::string options : {"1", "2", "3", "3 --partition random"}) {
            const run_result r = run_ranks(options[0] - '0', options.substr(1) + " scene.yaml beside.vtu");
            expect_result(r, 0, "warning: 5 higher-order cells drawn by their corners as linear ones");
            const std::string picture = read_file(make_path("a_00.exr"));
            if (first.empty()) first = picture;
            assert_true(picture == first && !picture.empty());
        }
    }
    write_blocks("beside.vtm", {make_bent_hexes(5, VTK_QUADRATIC_HEXAHEDRON), make_bent_hexes(0, VTK_POLYHEDRON)});
    expect_bent_hexes_on_any_ranks("scene.yaml beside.vtm");
}

/* Checks that leaves have the same numbers on all ranks if ranks read different files, each of which has several
 * leaves. On two ranks, the hexes of order 2 of the second file would otherwise have the number of the first file's
 * polyhedron, and be drawn by their corners, and the last leaf would have no number that a rank knows. */
void leaves_of_several_composite_files_are_drawn_the_same_on_any_ranks(void **)
{
    write_blocks("leaves_0.vtm", {make_row_of_tets(1), make_bent_hexes(0, VTK_POLYHEDRON)});
    write_blocks("leaves_1.vtm", {make_bent_hexes(5, VTK_QUADRATIC_HEXAHEDRON), make_row_of_tets(2, 8)});
    write_file(make_path("leaves.pvd"), "<VTKFile type=\"Collection\"><Collection><DataSet file=\"leaves_0.vtm\"/>"
                                        "<DataSet file=\"leaves_1.vtm\"/></Collection></VTKFile>\n");
    const std::string given = scene, layer = "field: x\n";
    write_file(make_path("last.yaml"),
               given.substr(0, given.find(layer)) + "mesh: data/3\n          " + given.substr(given.find(layer)));
    for (const std::string files : {"--pieces leaves_0.vtm leaves_1.vtm", "leaves.pvd"})
        for (const std::string scene_file : {"scene.yaml ", "last.yaml "})
            expect_bent_hexes_on_any_ranks(scene_file + files);
}

vtkSmartPointer<vtkUnstructuredGrid> make_row_at_time(double time, int count, int first = 0)
{
    auto row = make_row_of_tets(count, first);
    vtkNew<vtkDoubleArray> value;
    value->SetName("TimeValue");
    value->InsertNextValue(time);
    row->GetFieldData()->AddArray(value);
    return row;
}

/* Checks that the time is that of the first piece or block that has one, on any number of ranks. */
void time_is_read_from_any_piece(void **)
{
    write_vtu("time_0.vtu", make_row_at_time(2.5, 3));
    write_vtu("time_1.vtu", make_row_at_time(2.5, 2, 3));
    write_vtu("time_2.vtu", make_row_at_time(2.5, 0));
    const std::string head = "<VTKFile type=\"PUnstructuredGrid\" version=\"0.1\"><PUnstructuredGrid>",
                      tail = "</PUnstructuredGrid></VTKFile>\n";
    write_file(make_path("time_a.pvtu"), head + "<Piece Source=\"time_2.vtu\"/><Piece Source=\"time_0.vtu\"/>" +
                                             "<Piece Source=\"row_10.vtu\"/>" + tail);
    write_file(make_path("time_b.pvtu"), head + "<Piece Source=\"empty.vtu\"/><Piece Source=\"row_2.vtu\"/>" +
                                             "<Piece Source=\"time_1.vtu\"/>" + tail);
    write_file(make_path("time.pvd"), "<VTKFile type=\"Collection\"><Collection><DataSet file=\"row_2.vtu\"/>"
                                      "<DataSet file=\"time_1.vtu\"/></Collection></VTKFile>\n");
    write_blocks("time.vtm", {make_row_of_tets(3), make_row_at_time(2.5, 2, 3)});
    for (const int ranks : {1, 2, 3})
        for (const char *files :
             {"time_0.vtu", "time_a.pvtu", "time_b.pvtu", "time.pvd", "time.vtm", "--pieces row_2.vtu time_1.vtu"})
            expect_result(run_ranks(ranks, std::string("scene.yaml ") + files), 0, "cycle 0  time 2.5  ");
    expect_result(run_ranks(3, "--steps 1 scene.yaml row_2.vtu row_10.vtu"), 0, "cycle 1  time 1  ");
}

void pieces_with_several_steps_are_refused(void **)
{
    const std::string head = "<VTKFile type=\"Collection\"><Collection>", tail = "</Collection></VTKFile>\n",
                      first = "<DataSet timestep=\"0\" file=\"row_2.vtu\"/>";
    write_file(make_path("one.pvd"), head + first + tail);
    write_file(make_path("two.pvd"), head + first + "<DataSet timestep=\"1\" file=\"row_10.vtu\"/>" + tail);
    expect_result(run_tool("--pieces scene.yaml row.vtu one.pvd"), 0, "  42 cells");
    for (const int ranks : {1, 2})
        expect_result(run_ranks(ranks, "--pieces scene.yaml row.vtu two.pvd"), 1,
                      "insitu-render: two.pvd: has 2 steps, but files given with --pieces must have one");
}

/* Checks that no cell is missing for each method of reading and distributing cells. */
void every_distribution_mode_reads_all_cells(void **)
{
    for (const int ranks : test_is_long_run() ? std::vector<int>{2, 3, 4} : std::vector<int>{3}) {
        expect_result(run_ranks(ranks, "scene.yaml pieces.pvtu"), 0, "  52 cells");
        expect_result(run_ranks(ranks, "scene.yaml blocks.vtm"), 0, "  7 cells");
        expect_result(run_ranks(ranks, "--partition random scene.yaml row.vtu"), 0, "  40 cells");
        expect_result(run_ranks(ranks, "--pieces scene.yaml row.vtu row_2.vtu row_10.vtu"), 0, "  52 cells");
    }
}

} // namespace

int main(int argc, char **argv)
{
    if (argc != 4) return 2;
    real_tool = argv[1];
    tool = argv[2];
    mpiexec = argv[3];
    const CMUnitTest tests[] = {
        cmocka_unit_test(help_lists_the_options),
        cmocka_unit_test(info_lists_what_is_in_a_file),
        cmocka_unit_test(info_names_cells_of_higher_order),
        cmocka_unit_test(info_reads_every_kind),
        cmocka_unit_test(wrong_files_are_named_with_the_reason),
        cmocka_unit_test(errors_are_one_line),
        cmocka_unit_test(wrong_options_are_named),
        cmocka_unit_test(failure_on_one_rank_stops_all_ranks),
        cmocka_unit_test(read_failure_on_one_rank_stops_all_ranks),
        cmocka_unit_test(default_pictures_of_two_files_have_two_names),
        cmocka_unit_test(default_pictures_of_files_with_unusual_names_are_drawn),
        cmocka_unit_test(fields_with_unusual_names_are_drawn_if_the_names_are_utf8),
        cmocka_unit_test(empty_input_is_an_error),
        cmocka_unit_test(surface_meshes_are_drawn),
        cmocka_unit_test(wrong_scenes_are_errors),
        cmocka_unit_test(several_files_are_steps_in_the_order_of_their_numbers),
        cmocka_unit_test(decimals_and_numbers_after_a_point_are_sorted_by_value),
        cmocka_unit_test(chosen_steps_keep_their_cycles),
        cmocka_unit_test(steps_before_the_first_value_of_a_field_are_skipped),
        cmocka_unit_test(default_field_is_one_that_the_last_step_has),
        cmocka_unit_test(a_series_has_one_scale_and_one_camera),
        cmocka_unit_test(pieces_that_differ_are_drawn_the_same_on_any_ranks),
        cmocka_unit_test(higher_order_cells_beside_polyhedra_are_drawn_the_same_on_any_ranks),
        cmocka_unit_test(leaves_of_several_composite_files_are_drawn_the_same_on_any_ranks),
        cmocka_unit_test(time_is_read_from_any_piece),
        cmocka_unit_test(pieces_with_several_steps_are_refused),
        cmocka_unit_test(every_distribution_mode_reads_all_cells),
    };
    return cmocka_run_group_tests(tests, make_files, nullptr);
}
