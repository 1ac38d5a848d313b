/* Checks that insitu-render's readers return the cells and values that files of every format contain. For a truncated
 * file they must return an error, or the same cells and values.
 *
 *     test_vtk_files [number of random truncations of each file] */
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <vtkAMRBox.h>
#include <vtkBitArray.h>
#include <vtkCell.h>
#include <vtkCellData.h>
#include <vtkCompositeDataIterator.h>
#include <vtkCompositeDataSet.h>
#include <vtkDataArray.h>
#include <vtkIdList.h>
#include <vtkMultiBlockDataSet.h>
#include <vtkNew.h>
#include <vtkOverlappingAMR.h>
#include <vtkPointData.h>
#include <vtkStringArray.h>
#include <vtkStructuredGrid.h>
#include <vtkUniformGrid.h>
#include <vtkUnsignedCharArray.h>
#include <vtkUnstructuredGrid.h>
#include <vtkXMLUniformGridAMRWriter.h>
#include <vtkXMLUnstructuredGridWriter.h>

#include "data_file.h"
#include "grids_of.h"
#include "test_vtk_run.h"
#include "test_vtk_samples.h"
#include "vtk_messages.h"

// cmocka.h is included after all C++ headers, as it defines fail as a macro.
extern "C" {
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
}

using namespace render_tool;

namespace
{

std::string folder;
std::vector<sample> samples;
int random_cuts = 40; // number of random truncations of each file, in addition to chosen ones

int write_all(void **)
{
    folder = make_empty_folder("vtk_files");
    samples = write_samples(folder);
    catch_vtk_messages();
    return 0;
}

/* Returns the only grid in data that has cells. */
vtkSmartPointer<vtkUnstructuredGrid> find_only_grid(vtkDataObject *data)
{
    if (auto *grid = vtkUnstructuredGrid::SafeDownCast(data)) return grid;
    auto *composite = vtkCompositeDataSet::SafeDownCast(data);
    if (!composite) throw std::runtime_error("no grid");
    vtkSmartPointer<vtkUnstructuredGrid> found;
    const auto it = vtkSmartPointer<vtkCompositeDataIterator>::Take(composite->NewIterator());
    for (it->InitTraversal(); !it->IsDoneWithTraversal(); it->GoToNextItem()) {
        auto *grid = vtkUnstructuredGrid::SafeDownCast(it->GetCurrentDataObject());
        if (!grid || grid->GetNumberOfCells() == 0) continue;
        if (found) throw std::runtime_error("several grids");
        found = grid;
    }
    return found;
}

vtkSmartPointer<vtkUnstructuredGrid> read_grid(const std::string &name)
{
    const std::string path = folder + "/" + name;
    return find_only_grid(grids_of(open_data_file(path)->read(0, 0, 1), path));
}

/* Returns a description of the first difference between the points and cells of two grids; "" if there is none. */
std::string describe_cell_difference(vtkUnstructuredGrid *a, vtkUnstructuredGrid *b)
{
    if (a->GetNumberOfPoints() != b->GetNumberOfPoints()) return "number of points";
    if (a->GetNumberOfCells() != b->GetNumberOfCells()) return "number of cells";
    for (vtkIdType i = 0; i < a->GetNumberOfPoints(); i++) {
        double p[3], q[3];
        a->GetPoint(i, p);
        b->GetPoint(i, q);
        if (std::memcmp(p, q, sizeof p) != 0) return "point " + std::to_string(i);
    }
    for (vtkIdType i = 0; i < a->GetNumberOfCells(); i++) {
        vtkIdType m = 0, n = 0;
        const vtkIdType *p = nullptr, *q = nullptr;
        a->GetCellPoints(i, m, p);
        b->GetCellPoints(i, n, q);
        if (a->GetCellType(i) != b->GetCellType(i) || m != n || !std::equal(p, p + m, q))
            return "cell " + std::to_string(i);
        vtkNew<vtkIdList> f, g;
        if (a->GetCellType(i) != VTK_POLYHEDRON) continue;
        a->GetFaceStream(i, f);
        b->GetFaceStream(i, g);
        if (!std::equal(f->begin(), f->end(), g->begin(), g->end())) return "faces of cell " + std::to_string(i);
    }
    return "";
}

/* Returns a description of the first difference between two arrays of the same name; "" if there is none. An array that
 * b lacks is not compared. An array that only a lacks is a difference only if must_exist is set, because no picture can
 * draw wrong values of a missing array. */
std::string describe_value_difference(vtkDataSetAttributes *a, vtkDataSetAttributes *b, const std::string &name,
                                      bool must_exist)
{
    vtkDataArray *x = a->GetArray(name.c_str()), *y = b->GetArray(name.c_str());
    if (!y) return "";
    if (!x) return must_exist ? "no field " + name : "";
    if (x->GetNumberOfTuples() != y->GetNumberOfTuples()) return "length of " + name;
    for (vtkIdType i = 0; i < x->GetNumberOfTuples(); i++)
        if (!(x->GetComponent(i, 0) == y->GetComponent(i, 0))) return name + " " + std::to_string(i);
    return "";
}

std::string describe_difference(vtkUnstructuredGrid *a, vtkUnstructuredGrid *b, bool must_exist)
{
    std::string where = describe_cell_difference(a, b);
    if (where.empty()) where = describe_value_difference(a->GetPointData(), b->GetPointData(), "x", must_exist);
    if (where.empty()) where = describe_value_difference(a->GetCellData(), b->GetCellData(), "c", must_exist);
    if (where.empty()) where = describe_value_difference(a->GetCellData(), b->GetCellData(), "p", must_exist);
    return where;
}

void every_format_gives_its_cells_and_values(void **)
{
    for (const sample &s : samples) {
        std::string where;
        try {
            where = describe_difference(read_grid(s.name), s.expected, true);
        } catch (const std::exception &e) {
            where = e.what();
        }
        if (!where.empty()) print_error("%s: %s\n", s.name.c_str(), where.c_str());
        assert_true(where.empty());
    }
}

/* Returns a description of what is wrong in the contents that were read from a truncated file; "" if the contents are
 * right or the file was refused. */
std::string describe_wrong_contents(const sample &s)
{
    try {
        const auto grid = read_grid(s.name);
        return grid ? describe_difference(grid, s.expected, false) : "";
    } catch (const std::runtime_error &) {
        return "";
    }
}

std::vector<size_t> choose_cut_sizes(size_t size, int random_count)
{
    std::vector<size_t> cuts = {0, size / 2, size * 9 / 10, size * 95 / 100, size * 99 / 100, size - 2, size - 1};
    uint64_t state = size;
    for (int i = 0; i < random_count; i++) {
        state = state * 6364136223846793005u + 1442695040888963407u;
        cuts.push_back((state >> 33) % size);
    }
    return cuts;
}

/* Counts the truncations of one file of the sample that are read with wrong contents. */
int count_wrong_cuts(const sample &s, const std::string &file)
{
    int wrong = 0;
    const std::string whole = read_file(folder + "/" + file);
    for (const size_t cut : choose_cut_sizes(whole.size(), random_cuts)) {
        std::filesystem::remove(folder + "/" + file); /* else HDF5 would use the old contents that it has cached */
        write_file(folder + "/" + file, whole.substr(0, cut));
        const std::string where = describe_wrong_contents(s);
        if (where.empty()) continue;
        print_error("%s with %s cut at %zu of %zu: %s\n", s.name.c_str(), file.c_str(), cut, whole.size(),
                    where.c_str());
        wrong++;
    }
    write_file(folder + "/" + file, whole);
    return wrong;
}

void truncated_files_give_errors_or_the_same_grid(void **)
{
    int wrong = 0;
    for (const sample &s : samples)
        for (const std::string &file : s.files) wrong += count_wrong_cuts(s, file);
    assert_int_equal(wrong, 0);
}

vtkUnsignedCharArray *get_ghost_array(vtkDataObject *grid)
{
    return vtkUnstructuredGrid::SafeDownCast(grid)->GetCellGhostArray();
}

void hidden_points_hide_their_cells(void **)
{
    const auto data = make_structured_grid(lattice::curved);
    vtkStructuredGrid::SafeDownCast(data)->BlankPoint(0);
    vtkStructuredGrid::SafeDownCast(data)->BlankCell(59);
    const auto grid = grids_of(data, "");
    for (int i = 0; i < 60; i++) assert_int_equal(get_ghost_array(grid)->GetValue(i) != 0, i == 0 || i == 59);
}

/* Checks a coarse lattice of 4 × 4 × 4 cells, of which finer cells cover 2 × 2 × 2: the covered cells must be
 * hidden. */
void finer_levels_hide_coarser_cells(void **)
{
    const double origin[3] = {0, 0, 0}, steps[2][3] = {{1, 1, 1}, {0.5, 0.5, 0.5}}, inner[3] = {1, 1, 1};
    const int blocks[2] = {1, 1}, dimensions[3] = {5, 5, 5};
    vtkNew<vtkOverlappingAMR> amr;
    amr->Initialize(2, blocks);
    amr->SetOrigin(origin);
    amr->SetGridDescription(VTK_XYZ_GRID);
    for (unsigned level = 0; level < 2; level++) {
        vtkNew<vtkUniformGrid> grid;
        grid->SetDimensions(dimensions);
        grid->SetOrigin(level == 0 ? origin : inner);
        grid->SetSpacing(steps[level]);
        amr->SetSpacing(level, steps[level]);
        amr->SetAMRBox(level, 0, vtkAMRBox(level == 0 ? origin : inner, dimensions, steps[level], origin));
        amr->SetDataSet(level, 0, grid);
        amr->SetRefinementRatio(level, 2);
    }
    const std::string path = folder + "/levels.vthb";
    vtkNew<vtkXMLUniformGridAMRWriter> writer;
    writer->SetFileName(path.c_str());
    writer->SetInputData(amr);
    assert_int_equal(writer->Write(), 1);

    const auto data = grids_of(open_data_file(path)->read(0, 0, 1), path);
    auto *levels = vtkMultiBlockDataSet::SafeDownCast(data);
    assert_int_equal(levels->GetNumberOfBlocks(), 2);
    for (int i = 0; i < 64; i++) {
        auto is_inner = [](int index) { return index == 1 || index == 2; };
        const bool is_hidden = is_inner(i % 4) && is_inner(i / 4 % 4) && is_inner(i / 16);
        assert_int_equal(get_ghost_array(levels->GetBlock(0))->GetValue(i) != 0, is_hidden);
        assert_int_equal(get_ghost_array(levels->GetBlock(1)) ? get_ghost_array(levels->GetBlock(1))->GetValue(i) : 0,
                         0);
    }
}

void expect_foam_step(data_file &file, size_t step, double factor)
{
    const auto grid = find_only_grid(grids_of(file.read(step, 0, 1), "case"));
    assert_int_equal(grid->GetNumberOfCells(), 3);
    assert_int_equal(grid->GetNumberOfPoints(), 12);
    const int types[3] = {VTK_POLYHEDRON, VTK_WEDGE, VTK_WEDGE};
    for (int i = 0; i < 3; i++) {
        assert_int_equal(grid->GetCellType(i), types[i]);
        assert_true(grid->GetCellData()->GetArray("p")->GetComponent(i, 0) == (i + 1) * factor);
    }
    assert_int_equal(grid->GetCell(0)->GetNumberOfFaces(), 7);
}

void foam_case_is_read_with_its_steps(void **)
{
    write_foam(folder + "/foam");
    const auto file = open_data_file(folder + "/foam/case.foam");
    assert_int_equal(file->times().size(), 2);
    assert_true(file->times()[0] == 0 && file->times()[1] == 0.5);
    expect_foam_step(*file, 0, 1);
    expect_foam_step(*file, 1, 2);
}

void truncated_foam_files_give_errors_or_the_same_grid(void **)
{
    write_foam(folder + "/foam");
    const auto whole = read_grid("foam/case.foam");
    const std::string mesh = "foam/constant/polyMesh/";
    int wrong = 0;
    for (const std::string &file : {mesh + "points", mesh + "faces", mesh + "owner", mesh + "neighbour",
                                    mesh + "boundary", std::string("foam/0/p"), std::string("foam/system/controlDict")})
        wrong += count_wrong_cuts({"foam/case.foam", {}, whole}, file);
    assert_int_equal(wrong, 0);
}

/* Returns the error message that opening or reading the file gives; "" if there is none. */
std::string get_refusal(const std::string &name)
{
    try {
        (void)open_data_file(folder + "/" + name)->read(0, 0, 1);
    } catch (const std::exception &e) {
        return e.what();
    }
    return "";
}

void expect_reported(const std::string &reported, const std::string &what)
{
    if (reported.find(what) != std::string::npos) return;
    print_error("expected '%s' in:\n%s\n", what.c_str(), reported.c_str());
    assert_true(false);
}

vtkIdType count_cells(vtkDataObject *data)
{
    vtkIdType count = 0;
    auto *composite = vtkCompositeDataSet::SafeDownCast(data);
    const auto it = vtkSmartPointer<vtkCompositeDataIterator>::Take(composite->NewIterator());
    for (it->InitTraversal(); !it->IsDoneWithTraversal(); it->GoToNextItem())
        count += vtkUnstructuredGrid::SafeDownCast(it->GetCurrentDataObject())->GetNumberOfCells();
    return count;
}

/* Checks a parallel run, of which the second processor does not have step 0.5 at first. */
void foam_cases_of_parallel_runs_are_read_by_processors(void **)
{
    namespace fs = std::filesystem;
    const std::string parallel = folder + "/parallel", second = parallel + "/processor1";
    for (const int p : {0, 1}) write_foam(parallel + "/processor" + std::to_string(p), 2 * p);
    write_file(parallel + "/dec.foam", "");
    fs::rename(second + "/0.5", folder + "/kept");
    auto file = open_data_file(parallel + "/dec.foam");
    assert_int_equal(file->times().size(), 1);
    expect_reported(file->take_warnings(), "dec.foam: processor1/ has no step 0.5: left out");
    fs::rename(folder + "/kept", second + "/0.5");
    file = open_data_file(parallel + "/dec.foam");
    assert_int_equal(file->times().size(), 2);
    assert_int_equal(file->pieces(0), 2);
    const auto all = grids_of(file->read(1, 0, 1), "dec");
    assert_int_equal(count_cells(all), 6);
    double bounds[6];
    vtkMultiBlockDataSet::SafeDownCast(all)->GetBounds(bounds);
    assert_true(bounds[0] == 0 && bounds[1] == 4);
    const auto piece = find_only_grid(grids_of(file->read(1, 1, 2), "dec"));
    assert_true(piece->GetBounds()[0] == 2);
    assert_true(piece->GetCellData()->GetArray("p")->GetComponent(2, 0) == 6);

    write_foam(parallel); /* also makes a case of a serial run, with the same last time */
    assert_int_equal(open_data_file(parallel + "/dec.foam")->pieces(0), 1);
    fs::remove_all(parallel + "/0.5");
    file = open_data_file(parallel + "/dec.foam");
    assert_int_equal(file->pieces(0), 2);
    expect_reported(file->take_warnings(), "the folders of its processors are read, which go on to 0.5");
}

void foam_cases_that_lack_folders_are_refused_by_their_names(void **)
{
    namespace fs = std::filesystem;
    const std::string parallel = folder + "/lacking";
    for (const int p : {0, 2}) write_foam(parallel + "/processor" + std::to_string(p), 2 * p);
    write_file(parallel + "/dec.foam", "");
    expect_reported(get_refusal("lacking/dec.foam"), "dec.foam: processor1/ is missing, as there is processor2/");
    fs::create_directories(parallel + "/processor1");
    expect_reported(get_refusal("lacking/dec.foam"), "dec.foam: processor1/constant/polyMesh/ is missing");
    for (const char *name : {"/processor0", "/processor1", "/processor2"}) fs::remove_all(parallel + name);
    fs::create_directories(parallel + "/processors4");
    expect_reported(get_refusal("lacking/dec.foam"), "processors4/ is of OpenFOAM's collated format");
}

/* Checks that the value of a cell is that of the hex at its position, for any numbering of the boundary's quads. */
void cgns_cells_are_read_wherever_the_boundary_is_numbered(void **)
{
    const auto expected = make_hex_grid(lattice::curved);
    for (const cgns_order order :
         {cgns_order::wall_first, cgns_order::wall_between, cgns_order::wall_long, cgns_order::wall_stored}) {
        const std::string name = "order" + std::to_string(static_cast<int>(order)) + ".cgns";
        write_cgns_elements(folder + "/" + name, expected, order);
        assert_string_equal(get_refusal(name).c_str(), "");
        assert_string_equal(describe_difference(read_grid(name), expected, true).c_str(), "");
    }
    write_cgns_elements(folder + "/zones.cgns", expected, cgns_order::wall_first, 60, {"Zone", "Zone 2"});
    const auto both = grids_of(open_data_file(folder + "/zones.cgns")->read(0, 0, 1), "");
    auto *zones = vtkMultiBlockDataSet::SafeDownCast(both);
    assert_int_equal(zones->GetNumberOfBlocks(), 2);
    for (unsigned i = 0; i < 2; i++)
        assert_string_equal(describe_difference(find_only_grid(zones->GetBlock(i)), expected, true).c_str(), "");
    write_cgns_elements(folder + "/curved.cgns", expected, cgns_order::curved);
    const auto curved = read_grid("curved.cgns");
    assert_int_equal(curved->GetNumberOfCells(), 60);
    for (vtkIdType i = 0; i < 60; i++) {
        assert_int_equal(curved->GetCellType(i), VTK_TRIQUADRATIC_HEXAHEDRON);
        for (int k = 0; k < 8; k++)
            assert_int_equal(curved->GetCell(i)->GetPointId(k), expected->GetCell(i)->GetPointId(k));
    }
}

void cgns_zones_with_wrong_numbers_are_refused(void **)
{
    write_cgns_elements(folder + "/wrong.cgns", make_hex_grid(lattice::curved), cgns_order::gap);
    expect_reported(get_refusal("wrong.cgns"),
                    "wrong.cgns: cannot be read: zone Base/Zone: its section \"Fluid\" has the "
                    "elements 22 to 81, expected them to begin with 21");
    write_cgns_elements(folder + "/wrong.cgns", make_hex_grid(lattice::curved), cgns_order::wall_first, 50);
    const std::string many = "zone Base/Zone: its sections of dimension 3 have 60 elements, expected its 50 cells";
    expect_reported(get_refusal("wrong.cgns"), many);
    write_cgns_elements(folder + "/wrong.cgns", make_hex_grid(lattice::curved), cgns_order::mixed);
    expect_reported(get_refusal("wrong.cgns"), "sections that mix cells and boundary are not read");
}

/* Reads a .vtm file that lists a table of residuals beside the grid. */
void tables_among_grids_are_skipped(void **)
{
    write_file(folder + "/residuals.vtt",
               "<VTKFile type=\"Table\" version=\"1.0\"><Table><Piece NumberOfRows=\"1\"><RowData><DataArray "
               "type=\"Float64\" Name=\"r\" format=\"ascii\">3</DataArray></RowData></Piece></Table></VTKFile>\n");
    write_file(folder + "/table.vtm", "<VTKFile type=\"vtkMultiBlockDataSet\" version=\"1.0\"><vtkMultiBlockDataSet>"
                                      "<DataSet index=\"0\" file=\"residuals.vtt\"/><DataSet index=\"1\" "
                                      "file=\"raw.vtu\"/></vtkMultiBlockDataSet></VTKFile>\n");
    assert_int_equal(read_grid("table.vtm")->GetNumberOfCells(), 60);
}

/* Checks that entries with the same time become pieces of one step, and that steps are sorted by time. */
void series_have_the_times_of_their_entries(void **)
{
    auto entry = [](const char *time, const char *file) {
        return std::string("<DataSet timestep=\"") + time + "\" file=\"" + file + "\"/>";
    };
    write_file(folder + "/s.pvd", "<VTKFile type=\"Collection\"><Collection>" + entry("2", "raw.vtu") +
                                      entry("0.25", "g.vts") + entry("2", "g.vti") + "</Collection></VTKFile>\n");
    const auto file = open_data_file(folder + "/s.pvd");
    assert_int_equal(file->times().size(), 2);
    assert_true(file->times()[0] == 0.25 && file->times()[1] == 2);
    assert_int_equal(file->pieces(0), 60); // as many pieces as the structured grid has cells
    assert_int_equal(file->pieces(1), 2);
    assert_string_equal(file->step_path(0).c_str(), (folder + "/g.vts").c_str());
    const auto both = grids_of(file->read(1, 0, 1), "");
    assert_int_equal(vtkMultiBlockDataSet::SafeDownCast(both)->GetNumberOfBlocks(), 2);
    const auto second = find_only_grid(grids_of(file->read(1, 1, 2), ""));
    assert_string_equal(describe_difference(second, make_hex_grid(lattice::image), true).c_str(), "");
}

void expect_refusal(const std::string &name, const std::string &text, const std::string &why)
{
    write_file(folder + "/" + name, text);
    try {
        (void)open_data_file(folder + "/" + name)->read(0, 0, 1);
    } catch (const std::runtime_error &e) {
        if (std::string(e.what()).find(why) != std::string::npos) return;
        print_error("%s\n", e.what());
    }
    print_error("%s: expected an error with '%s'\n", name.c_str(), why.c_str());
    assert_true(false);
}

void wrong_series_are_refused_with_the_reason(void **)
{
    const std::string head = "<VTKFile type=\"Collection\"><Collection>", tail = "</Collection></VTKFile>\n";
    expect_refusal("a.pvd", head + tail, "names no file");
    expect_refusal("a.pvd", head + "<DataSet timestep=\"soon\" file=\"raw.vtu\"/>" + tail, "timestep \"soon\"");
    expect_refusal("a.pvd", head + "<DataSet timestep=\"1\"/>" + tail, "a DataSet names no file");
    expect_refusal("a.pvd", head + "<DataSet timestep=\"1\" file=\"none.vtu\"/>" + tail, "none.vtu: No such file");
    expect_refusal("a.pvd", head + "<DataSet timestep=\"1\" file=\"g.pvd\"/>" + tail, "a series within a series");
    expect_refusal("a.pvd", head + "<DataSet timestep=\"1\" file=\"raw.vtu\"/><DataSet file=\"g.vts\"/>" + tail,
                   "a.pvd: DataSet 2 (g.vts) has no timestep, which other DataSets have");
    expect_refusal("a.vtu.series", "{}", "no list \"files\"");
    expect_refusal("a.vtu.series", "{\"files\": [{\"name\": \"raw.vtu\"}]}", "\"time\" is no number");
    expect_refusal("a.vtu.series", "{\"files\": [3]}", "has no \"name\"");
    expect_refusal("a.vtu.series", "{\"files\": [", "cannot be read");
    expect_refusal("a.case", "FORMAT\ntype: ensight\nGEOMETRY\nmodel: t.geo\n", "no case of EnSight Gold");
    expect_refusal("a.vtm",
                   "<VTKFile type=\"vtkMultiBlockDataSet\" version=\"1.0\"><vtkMultiBlockDataSet><DataSet "
                   "index=\"0\" file=\"none.vtu\"/></vtkMultiBlockDataSet></VTKFile>\n",
                   "none.vtu: No such file");
}

/* Returns a .vtu file whose pieces are one tet each, with these elements of point and cell data. */
std::string make_file_of_pieces(const std::vector<std::string> &pieces)
{
    std::string text = "<VTKFile type=\"UnstructuredGrid\" version=\"0.1\"><UnstructuredGrid>\n";
    for (const std::string &fields : pieces)
        text += "<Piece NumberOfPoints=\"4\" NumberOfCells=\"1\">" + fields +
                "<Points><DataArray type=\"Float32\" NumberOfComponents=\"3\" format=\"ascii\">0 0 0 1 0 0 0 1 0 0 0 1"
                "</DataArray></Points><Cells>"
                "<DataArray type=\"Int32\" Name=\"connectivity\" format=\"ascii\">0 1 2 3</DataArray>"
                "<DataArray type=\"Int32\" Name=\"offsets\" format=\"ascii\">4</DataArray>"
                "<DataArray type=\"UInt8\" Name=\"types\" format=\"ascii\">10</DataArray></Cells></Piece>\n";
    return text + "</UnstructuredGrid></VTKFile>\n";
}

/* Checks files with several pieces, whose arrays VTK's reader matches by their positions in the first piece. */
void pieces_of_one_file_with_different_fields_are_refused(void **)
{
    const auto array = [](const std::string &name, const std::string &type, const std::string &values,
                          const std::string &more = "") {
        return "<DataArray type=\"" + type + "\" Name=\"" + name + "\" " + more + "format=\"ascii\">" + values +
               "</DataArray>";
    };
    const auto points = [](const std::string &arrays) { return "<PointData>" + arrays + "</PointData>"; };
    const auto cells = [](const std::string &arrays) { return "<CellData>" + arrays + "</CellData>"; };
    const std::string f = array("f", "Float64", "1 2 3 4"), g = array("g", "Float64", "5 6 7 8"),
                      c = array("c", "Float64", "9"), both = "two.vtu: the point data of piece 2 of 2 are ",
                      first = ", expected those of piece 1: f (Float64), g (Float64)",
                      of_cells = "two.vtu: the cell data of piece 2 of 2 are ";
    expect_refusal("two.vtu", make_file_of_pieces({points(f + g), points(f)}), both + "f (Float64)" + first);
    expect_refusal("two.vtu", make_file_of_pieces({points(f + g), ""}), both + "none" + first);
    expect_refusal("two.vtu", make_file_of_pieces({points(f + g), points(g + f)}),
                   both + "g (Float64), f (Float64)" + first);
    expect_refusal("two.vtu", make_file_of_pieces({points(f), points(f + g)}),
                   both + "f (Float64), g (Float64), expected those of piece 1: f (Float64)");
    expect_refusal("two.vtu", make_file_of_pieces({points(f), points(array("f", "Int32", "1 2 3 4"))}),
                   both + "f (Int32), expected those of piece 1: f (Float64)");
    expect_refusal("two.vtu",
                   make_file_of_pieces({cells(c), cells(array("c", "Float64", "1 2", "NumberOfComponents=\"2\" "))}),
                   of_cells + "c (Float64, 2 components), expected those of piece 1: c (Float64)");
    write_file(folder + "/two.vtm", "<VTKFile type=\"vtkMultiBlockDataSet\" version=\"1.0\"><vtkMultiBlockDataSet>"
                                    "<DataSet index=\"0\" file=\"two.vtu\"/></vtkMultiBlockDataSet></VTKFile>\n");
    expect_reported(get_refusal("two.vtm"), of_cells);

    std::string with_empty = make_file_of_pieces({points(f + g) + cells(c), points(f + g) + cells(c)});
    with_empty.insert(with_empty.find("</Piece>") + 8,
                      "<Piece NumberOfPoints=\"0\" NumberOfCells=\"0\"><Points/><Cells>"
                      "<DataArray type=\"Int32\" Name=\"connectivity\"/><DataArray type=\"Int32\" Name=\"offsets\"/>"
                      "<DataArray type=\"UInt8\" Name=\"types\"/></Cells></Piece>");
    write_file(folder + "/two.vtu", with_empty);
    const auto grid = read_grid("two.vtu");
    assert_int_equal(grid->GetNumberOfCells(), 2);
    for (int i = 0; i < 8; i++) assert_true(grid->GetPointData()->GetArray("g")->GetComponent(i, 0) == 5 + i % 4);
}

/* Checks that arrays of colours are read beside other arrays. VTK stores their values as bytes. */
void colours_of_legacy_files_are_fields(void **)
{
    const std::string head = "# vtk DataFile Version 3.0\ntitle\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 4 float\n"
                             "0 0 0 1 0 0\n0 1 0 0 0 1\nCELLS 1 5\n4 0 1 2 3\nCELL_TYPES 1\n10\nPOINT_DATA 4\n",
                      scalars = "SCALARS f double\nLOOKUP_TABLE default\n1 2 3 4\n",
                      colours = "COLOR_SCALARS rgb 3\n0 0 0 1 0 0\n0 1 0 0 0 1\nCOLOR_SCALARS grey 1\n0 0.2 0.4 1\n";
    for (const std::string &fields : {scalars + colours, colours + scalars}) {
        write_file(folder + "/colours.vtk", head + fields);
        const auto grid = read_grid("colours.vtk");
        vtkDataArray *f = grid->GetPointData()->GetArray("f"), *rgb = grid->GetPointData()->GetArray("rgb"),
                     *grey = grid->GetPointData()->GetArray("grey");
        assert_true(f && rgb && grey);
        assert_true(f->GetComponent(3, 0) == 4);
        assert_int_equal(rgb->GetNumberOfComponents(), 3);
        assert_true(rgb->GetComponent(3, 2) == 255 && rgb->GetComponent(3, 0) == 0);
        assert_true(grey->GetComponent(1, 0) == 51);
    }
}

/* Checks files of grids without cells, as written by VTK and by other programs. */
void grids_without_cells_are_accepted(void **)
{
    const std::string head = "<VTKFile type=\"UnstructuredGrid\" version=\"0.1\"><UnstructuredGrid>",
                      tail = "</UnstructuredGrid></VTKFile>\n";
    write_vtu(folder + "/none.vtu", vtkNew<vtkUnstructuredGrid>());
    write_file(folder + "/bare.vtu", head + "<Piece NumberOfPoints=\"0\" NumberOfCells=\"0\"/>" + tail);
    write_file(folder + "/no_piece.vtu", head + tail);
    for (const char *name : {"none.vtu", "bare.vtu", "no_piece.vtu"})
        assert_int_equal(read_grid(name)->GetNumberOfCells(), 0);
    write_file(folder + "/with_none.pvtu",
               "<VTKFile type=\"PUnstructuredGrid\"><PUnstructuredGrid><Piece "
               "Source=\"none.vtu\"/><Piece Source=\"raw.vtu\"/></PUnstructuredGrid></VTKFile>\n");
    assert_string_equal(describe_difference(read_grid("with_none.pvtu"), make_hex_grid(lattice::curved), true).c_str(),
                        "");
}

/* Checks that a piece with texts and bits, which its .pvtu file declares as VTK's writer does, causes no warning. */
void texts_and_bits_of_pieces_cause_no_warning(void **)
{
    const auto grid = make_hex_grid(lattice::curved);
    vtkNew<vtkStringArray> label;
    vtkNew<vtkBitArray> bits;
    label->SetName("label");
    bits->SetName("bits");
    for (vtkIdType i = 0; i < grid->GetNumberOfPoints(); i++) {
        label->InsertNextValue("text");
        bits->InsertNextValue(static_cast<int>(i % 2));
    }
    grid->GetPointData()->AddArray(label);
    grid->GetPointData()->AddArray(bits);
    write_vtu(folder + "/texts.vtu", grid);
    write_file(folder + "/texts.pvtu",
               "<VTKFile type=\"PUnstructuredGrid\" version=\"0.1\"><PUnstructuredGrid GhostLevel=\"0\"><PPointData>"
               "<PDataArray type=\"Float64\" Name=\"x\"/><PArray type=\"String\" Name=\"label\"/>"
               "<PDataArray type=\"Bit\" Name=\"bits\"/></PPointData><PCellData>"
               "<PDataArray type=\"Float64\" Name=\"c\"/><PDataArray type=\"Float64\" Name=\"p\"/></PCellData>"
               "<Piece Source=\"texts.vtu\"/></PUnstructuredGrid></VTKFile>\n");
    const auto file = open_data_file(folder + "/texts.pvtu");
    const auto read = find_only_grid(grids_of(file->read(0, 0, 1), ""));
    assert_int_equal(read->GetNumberOfCells(), 60);
    const std::string warnings = file->take_warnings();
    for (const char *name : {"label", "bits"}) assert_true(warnings.find(name) == std::string::npos);
}

std::string replace_text(std::string text, const std::string &old, const std::string &by)
{
    const size_t at = text.find(old);
    assert_true(at != std::string::npos);
    return text.replace(at, old.size(), by);
}

/* A file in which VALUE is replaced, and the line that contains it. */
struct text_file {
    std::string name, text, line;
    std::vector<std::pair<std::string, std::string>> values; // words, with what the message says about them, or ""
};

/* Returns files whose field has integers, with numbers at and beyond both ends of the range of their type. */
std::vector<text_file> list_files_of_integers(const std::string &vtu, const std::string &vtk)
{
    const std::string no_number = "is no number";
    std::vector<text_file> files;
    struct integer_type {
        std::string in_vtu, in_vtk, smallest, largest, too_small, too_large;
    };
    for (const integer_type &type :
         {integer_type{"Int8", "signed_char", "-128", "127", "-129", "128"},
          integer_type{"UInt8", "unsigned_char", "0", "255", "-1", "300"},
          integer_type{"Int16", "short", "-32768", "+32767", "-32769", "32768"},
          integer_type{"UInt16", "unsigned_short", "-0", "65535", "-1", "65536"},
          integer_type{"Int32", "int", "-2147483648", "2147483647", "-2147483649", "3000000000"},
          integer_type{"UInt32", "unsigned_int", "0", "4294967295", "-1", "4294967296"},
          integer_type{"Int64", "vtktypeint64", "-9223372036854775808", "9223372036854775807", "-9223372036854775809",
                       "9223372036854775808"},
          integer_type{"UInt64", "vtktypeuint64", "0", "18446744073709551615", "-1", "18446744073709551616"}})
        for (const bool is_vtu : {true, false}) {
            const std::string name = is_vtu ? type.in_vtu : type.in_vtk,
                              wrong = "is a number that VTK does not read as " + name;
            const std::string text = is_vtu ? replace_text(replace_text(vtu, "Float64", name), "NAN", "3")
                                            : replace_text(vtk, "f double", "f " + name);
            files.push_back({is_vtu ? "integer.vtu" : "integer.vtk",
                             text,
                             is_vtu ? "line 5: " : "line 16: ",
                             {{type.smallest, ""},
                              {type.largest, ""},
                              {"007", ""},
                              {type.too_small, wrong},
                              {type.too_large, wrong},
                              {"4e2", wrong},
                              {"4.7", wrong},
                              {"nan", wrong},
                              {"0x1", no_number},
                              {"-", no_number}}});
        }
    return files;
}

/* Checks text files in which the last value is replaced by a word that VTK does not read as a number, such as a number
 * in Fortran's notation without the letter of the exponent. */
void numbers_that_vtk_does_not_read_are_refused_with_their_line(void **)
{
    const std::string no_number = "is no number", not_read = "is a number that VTK does not read here";
    const std::string vtu = "<VTKFile type=\"UnstructuredGrid\" version=\"0.1\"><UnstructuredGrid>\n"
                            "<Piece NumberOfPoints=\"4\" NumberOfCells=\"1\"><PointData>\n"
                            "<DataArray type=\"Float64\" Name=\"f\" format=\"ascii\">\n1 2 NAN\nVALUE</DataArray>\n"
                            "</PointData><Points><DataArray type=\"Float32\" NumberOfComponents=\"3\" format=\"ascii\">"
                            "0 0 0 1.e0 0 0 0 +1 0 0 0 .1E+1</DataArray></Points><Cells>"
                            "<DataArray type=\"Int32\" Name=\"connectivity\" format=\"ascii\">0 1 2 3</DataArray>"
                            "<DataArray type=\"Int32\" Name=\"offsets\" format=\"ascii\">4</DataArray>"
                            "<DataArray type=\"UInt8\" Name=\"types\" format=\"ascii\">10</DataArray>"
                            "</Cells></Piece></UnstructuredGrid></VTKFile>\n";
    const std::string vtk = "# vtk DataFile Version 3.0\ntitle\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 4 float\n"
                            "0 0 0 1 0 0\n0 1 0 0 0 1\nCELLS 1 5\n4 0 1 2 3\nCELL_TYPES 1\n10\nPOINT_DATA 4\n"
                            "SCALARS f double\nLOOKUP_TABLE default\n1 2 3\nVALUE\n";
    const std::vector<std::pair<std::string, std::string>> any = {{"0.123456-101", no_number}, {"0.5+120", no_number},
                                                                  {"1.5D+00", no_number},      {"1e-101", ""},
                                                                  {"********", no_number},     {"4", ""},
                                                                  {"1e400", not_read},         {"-1e39", ""},
                                                                  {"infinity", not_read},      {"1e-400", ""}};
    std::vector<text_file> files = {{"fortran.vtu", vtu, "line 5: ", any}, {"fortran.vtk", vtk, "line 16: ", any}};
    files[0].values.insert(files[0].values.end(), {{"nan\n", ""}, {"-inf ", ""}, {"nan", not_read}});
    files[1].values.insert(files[1].values.end(), {{"nan", not_read}, {"-inf", not_read}});
    files.push_back({"single.vtu", replace_text(vtu, "Float64", "Float32"), "line 5: ", {{"1e39", not_read}}});
    files.push_back({"single.vtk", replace_text(vtk, "f double", "f float"), "line 16: ", {{"1e39", not_read}}});
    for (const text_file &file : list_files_of_integers(vtu, vtk)) files.push_back(file);
    for (const text_file &file : files)
        for (const auto &[value, what] : file.values) {
            write_file(folder + "/" + file.name, replace_text(file.text, "VALUE", value));
            std::string message;
            try {
                assert_int_equal(read_grid(file.name)->GetPointData()->GetArray("f")->GetNumberOfTuples(), 4);
            } catch (const std::exception &e) {
                message = e.what();
            }
            const std::string expected =
                what.empty() ? "" : folder + "/" + file.name + ": " + file.line + "\"" + value + "\" " + what;
            if (message != expected) fail_msg("%s with %s: %s", file.name.c_str(), value.c_str(), message.c_str());
        }
}

/* Checks colours in text files of VTK's legacy format: they are numbers from 0 to 1, while binary files have bytes. */
void colours_in_text_are_read(void **)
{
    write_file(
        folder + "/colours.vtk",
        "# vtk DataFile Version 3.0\ntitle\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 3 float\n0 0 0 1 0 0\n0 1 0\n"
        "CELLS 1 4\n3 0 1 2\nCELL_TYPES 1\n5\nPOINT_DATA 3\nCOLOR_SCALARS c 2\n0 0.5 1 0.25 1e-1 0\n"
        "LOOKUP_TABLE t 1\n0.5 0.5 0.5 1\n");
    const auto grid = read_grid("colours.vtk");
    assert_int_equal(grid->GetPointData()->GetArray("c")->GetComponent(1, 0), 255);
}

/* Checks files in which a '>' does not end a tag, or blanks surround '=': their values are not text. */
void tags_end_at_their_own_bracket(void **)
{
    const auto grid = make_hex_grid(lattice::curved);
    vtkDataArray *const x = grid->GetPointData()->GetArray("x");
    x->SetName("a>b format='ascii'");
    write_vtu(folder + "/bracket.vtu", grid);
    assert_string_equal(get_refusal("bracket.vtu").c_str(), "");
    assert_non_null(read_grid("bracket.vtu")->GetPointData()->GetArray("a>b format='ascii'"));
    x->SetName("x");

    vtkNew<vtkXMLUnstructuredGridWriter> writer;
    writer->SetFileName((folder + "/blanks.vtu").c_str());
    writer->SetInputData(grid);
    writer->SetDataModeToBinary();
    assert_int_equal(writer->Write(), 1);
    std::string text = read_file(folder + "/blanks.vtu");
    for (size_t at = 0; (at = text.find("format=\"binary\"", at)) != std::string::npos; at += 17)
        text.replace(at, 15, "format = 'binary'");
    const std::string comment = "<!-- a -> b <DataArray format=\"ascii\"> not a number -->\n<PointData";
    write_file(folder + "/blanks.vtu", replace_text(text, "<PointData", comment));
    assert_string_equal(get_refusal("blanks.vtu").c_str(), "");
    assert_string_equal(describe_difference(read_grid("blanks.vtu"), grid, true).c_str(), "");
}

void ensight_numbers_without_exponent_letter_are_refused(void **)
{
    const std::string path = folder + "/t.x", whole = read_file(path);
    const size_t last = whole.find_last_of('\n', whole.size() - 2) + 1;
    write_file(path, whole.substr(0, last) + "0.123456-101\n");
    std::string message;
    try {
        (void)read_grid("t.case");
    } catch (const std::exception &e) {
        message = e.what();
    }
    write_file(path, whole);
    const auto line = std::count(whole.begin(), whole.end(), '\n');
    if (message == path + ": line " + std::to_string(line) + ": \"0.123456-101\" is no number") return;
    print_error("%s\n", message.c_str());
    assert_true(false);
}

std::string pad_ensight_line(const std::string &text)
{
    return text + std::string(80 - text.size(), ' ');
}

template <typename Number> std::string concatenate_bytes(const std::vector<Number> &values)
{
    return {reinterpret_cast<const char *>(values.data()), values.size() * sizeof(Number)};
}

/* Writes all steps into one file for the geometry and one file for the variable, each of which begins with "C Binary".
 * The second step has `more` additional tets. */
void write_ensight_set(int more)
{
    using floats = std::vector<float>;
    using ints = std::vector<int32_t>;
    std::string geometry = pad_ensight_line("C Binary"), values = geometry;
    for (int step = 0; step < 2; step++) {
        const int points = 4 + step * more;
        const std::string part = pad_ensight_line("part") + concatenate_bytes(ints{1});
        geometry += pad_ensight_line("BEGIN TIME STEP") + pad_ensight_line("a tet") + pad_ensight_line("or two") +
                    pad_ensight_line("node id assign") + pad_ensight_line("element id assign") + part +
                    pad_ensight_line("solid") + pad_ensight_line("coordinates") + concatenate_bytes(ints{points});
        const float x = static_cast<float>(step);
        for (const floats &axis : {floats{x, x + 1, x, x, x + 1}, floats{0, 0, 1, 0, 1}, floats{0, 0, 0, 1, 1}})
            geometry += concatenate_bytes(floats(axis.begin(), axis.begin() + points));
        geometry += pad_ensight_line("tetra4") + concatenate_bytes(ints{1 + step * more}) +
                    concatenate_bytes(ints{1, 2, 3, 4}) + (step * more > 0 ? concatenate_bytes(ints{2, 3, 4, 5}) : "") +
                    pad_ensight_line("END TIME STEP");
        values += pad_ensight_line("BEGIN TIME STEP") + pad_ensight_line("values") + part +
                  pad_ensight_line("coordinates") +
                  concatenate_bytes(floats(static_cast<size_t>(points), static_cast<float>(step))) +
                  pad_ensight_line("END TIME STEP");
    }
    write_file(folder + "/set.geo", geometry);
    write_file(folder + "/set.f", values);
    write_file(folder + "/set.case", "FORMAT\ntype: ensight gold\nGEOMETRY\nmodel: 1 1 set.geo\nVARIABLE\n"
                                     "scalar per node: 1 1 f set.f\nTIME\ntime set: 1\nnumber of steps: 2\n"
                                     "time values: 0 0.5\nFILE\nfile set: 1\nnumber of steps: 2\n");
}

std::string get_set_refusal()
{
    try {
        (void)open_data_file(folder + "/set.case");
    } catch (const std::exception &e) {
        return e.what();
    }
    return "";
}

void ensight_file_sets_are_read_step_by_step(void **)
{
    write_ensight_set(0);
    const auto file = open_data_file(folder + "/set.case");
    assert_int_equal(file->times().size(), 2);
    for (size_t step = 0; step < 2; step++) {
        const auto grid = find_only_grid(grids_of(file->read(step, 0, 1), "set.case"));
        assert_int_equal(grid->GetNumberOfCells(), 1);
        assert_true(grid->GetBounds()[0] == static_cast<double>(step));
        assert_true(grid->GetPointData()->GetArray("f")->GetComponent(0, 0) == static_cast<double>(step));
    }
    const std::string values = read_file(folder + "/set.f");
    write_file(folder + "/set.f", values.substr(0, values.size() - 100));
    assert_true(get_set_refusal().find("set.f: is cut short") != std::string::npos);
    write_ensight_set(1);
    assert_true(get_set_refusal().find("set.f: has steps of different sizes") != std::string::npos);
}

/* Writes a cube as a binary file. `section` is the text that precedes the values. */
void write_ensight_cube(const std::string &section, const std::string &values)
{
    using floats = std::vector<float>;
    using ints = std::vector<int32_t>;
    const std::string part = pad_ensight_line("part") + concatenate_bytes(ints{1});
    write_file(folder + "/cube.geo", pad_ensight_line("C Binary") + pad_ensight_line("a") + pad_ensight_line("b") +
                                         pad_ensight_line("node id assign") + pad_ensight_line("element id assign") +
                                         part + pad_ensight_line("c") + pad_ensight_line("coordinates") +
                                         concatenate_bytes(ints{8}) +
                                         concatenate_bytes(floats{0, 1, 1, 0, 0, 1, 1, 0}) +
                                         concatenate_bytes(floats{0, 0, 1, 1, 0, 0, 1, 1}) +
                                         concatenate_bytes(floats{0, 0, 0, 0, 1, 1, 1, 1}) + pad_ensight_line("hexa8") +
                                         concatenate_bytes(ints{1, 1, 2, 3, 4, 5, 6, 7, 8}));
    write_file(folder + "/cube.f", pad_ensight_line("f") + part + pad_ensight_line(section) + values);
    write_file(folder + "/cube.case", "FORMAT\ntype: ensight gold\nGEOMETRY\nmodel: cube.geo\nVARIABLE\n"
                                      "scalar per node: f cube.f\n");
}

void ensight_values_that_are_undefined_are_nan(void **)
{
    const std::vector<float> all = {0, 1, 2, -9, 4, -9, 6, 7};
    write_ensight_cube("coordinates undef", concatenate_bytes(std::vector<float>{-9}) + concatenate_bytes(all));
    const auto undefined = read_grid("cube.case");
    write_ensight_cube("coordinates partial", concatenate_bytes(std::vector<int32_t>{6, 1, 2, 3, 5, 7, 8}) +
                                                  concatenate_bytes(std::vector<float>{0, 1, 2, 4, 6, 7}));
    const auto partial = read_grid("cube.case");
    for (const auto &grid : {undefined, partial})
        for (vtkIdType i = 0; i < 8; i++) {
            const double value = grid->GetPointData()->GetArray("f")->GetComponent(i, 0);
            assert_true(i == 3 || i == 5 ? std::isnan(value) : value == static_cast<double>(i));
        }
    write_ensight_cube("coordinates partial", concatenate_bytes(std::vector<int32_t>{9}));
    expect_reported(get_refusal("cube.case"), "cube.f: has 9 values for 8 nodes or elements");
    write_ensight_cube("coordinates partial", concatenate_bytes(std::vector<int32_t>{2, 1}));
    expect_reported(get_refusal("cube.case"), "cube.f: is cut short");
    write_ensight_cube("coordinates some", concatenate_bytes(all));
    expect_reported(get_refusal("cube.case"), "cube.f: \"coordinates some\" is not understood");
}

void ensight_names_in_quotes_are_refused_with_their_line(void **)
{
    write_ensight_cube("coordinates", concatenate_bytes(std::vector<float>(8)));
    write_file(folder + "/cube.case", "FORMAT\ntype: ensight gold\nGEOMETRY\nmodel: \"my cube.geo\"\n");
    expect_reported(get_refusal("cube.case"), "cube.case: line 4: names in quotes are not read, found \"my cube.geo\"");
}

} // namespace

int main(int argc, char **argv)
{
    if (argc > 1) random_cuts = std::atoi(argv[1]);
    const CMUnitTest tests[] = {
        cmocka_unit_test(every_format_gives_its_cells_and_values),
        cmocka_unit_test(truncated_files_give_errors_or_the_same_grid),
        cmocka_unit_test(hidden_points_hide_their_cells),
        cmocka_unit_test(finer_levels_hide_coarser_cells),
        cmocka_unit_test(foam_case_is_read_with_its_steps),
        cmocka_unit_test(truncated_foam_files_give_errors_or_the_same_grid),
        cmocka_unit_test(series_have_the_times_of_their_entries),
        cmocka_unit_test(wrong_series_are_refused_with_the_reason),
        cmocka_unit_test(pieces_of_one_file_with_different_fields_are_refused),
        cmocka_unit_test(colours_of_legacy_files_are_fields),
        cmocka_unit_test(grids_without_cells_are_accepted),
        cmocka_unit_test(texts_and_bits_of_pieces_cause_no_warning),
        cmocka_unit_test(numbers_that_vtk_does_not_read_are_refused_with_their_line),
        cmocka_unit_test(colours_in_text_are_read),
        cmocka_unit_test(tags_end_at_their_own_bracket),
        cmocka_unit_test(ensight_numbers_without_exponent_letter_are_refused),
        cmocka_unit_test(ensight_file_sets_are_read_step_by_step),
        cmocka_unit_test(ensight_values_that_are_undefined_are_nan),
        cmocka_unit_test(ensight_names_in_quotes_are_refused_with_their_line),
        cmocka_unit_test(foam_cases_of_parallel_runs_are_read_by_processors),
        cmocka_unit_test(foam_cases_that_lack_folders_are_refused_by_their_names),
        cmocka_unit_test(cgns_cells_are_read_wherever_the_boundary_is_numbered),
        cmocka_unit_test(cgns_zones_with_wrong_numbers_are_refused),
        cmocka_unit_test(tables_among_grids_are_skipped),
    };
    return cmocka_run_group_tests(tests, write_all, nullptr);
}
