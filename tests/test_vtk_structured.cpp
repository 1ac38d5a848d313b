/* Checks insitu-render on structured files. Each rank reads a part of the extent, and the picture must be bit-identical
 * on any number of ranks. Blocks of a .vtm file must have no seam. An AMR file that VTK wrote must show a sphere,
 * compared with the closed form, without gaps between levels. Pictures are written as plain numbers (plain_image.c).
 *
 *     test_vtk_structured <insitu-render> <mpiexec> */
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <set>
#include <string>
#include <vector>

#include <vtkAMRBox.h>
#include <vtkCell.h>
#include <vtkCellData.h>
#include <vtkDoubleArray.h>
#include <vtkImageData.h>
#include <vtkMultiBlockDataSet.h>
#include <vtkNew.h>
#include <vtkOverlappingAMR.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkRectilinearGrid.h>
#include <vtkStructuredData.h>
#include <vtkStructuredGrid.h>
#include <vtkUniformGrid.h>
#include <vtkXMLImageDataWriter.h>
#include <vtkXMLMultiBlockDataWriter.h>
#include <vtkXMLRectilinearGridWriter.h>
#include <vtkXMLStructuredGridWriter.h>
#include <vtkXMLUniformGridAMRWriter.h>

#include "data_file.h"
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

constexpr int size = 200, pixels = size * size;
constexpr double radius = 0.72;

std::string tool, mpiexec, folder;

run_result run_tool(int ranks, const std::string &arguments)
{
    const std::string start = ranks > 1 ? quote_for_shell(mpiexec) + " -n " + std::to_string(ranks) + " " : "";
    return run_in_folder(folder, start + quote_for_shell(tool) + " " + arguments);
}

/* Draws a file and returns the picture; checks that there is no warning. */
std::string draw_file(int ranks, const std::string &arguments)
{
    const run_result r = run_tool(ranks, arguments);
    if (r.status != 0 || r.contains_text("warning"))
        print_error("%s on %d ranks: status %d\n%s%s", arguments.c_str(), ranks, r.status, r.out.c_str(),
                    r.err.c_str());
    assert_true(r.status == 0 && !r.contains_text("warning"));
    return read_file(folder + "/a.exr");
}

void expect_same(const std::string &a, const std::string &b, const std::string &what)
{
    if (a != b) print_error("%s: another picture\n", what.c_str());
    assert_true(a == b && a.size() > size_t{pixels} * 16);
}

/* Returns a scene with a camera that looks along z from z = 5. Its pictures are bit-identical on any number of
 * ranks. */
std::string make_scene(const std::string &field)
{
    return "images:\n  - name: a\n    size: [200, 200]\n    background: [0, 0, 0, 0]\n    camera: {position: [0, 0, "
           "5], "
           "focal: [0, 0, 0], up: [0, 1, 0], projection: orthographic, height: 2}\n    layers:\n"
           "      - isosurface: {field: " +
           field + ", values: [0]}\n    outputs: [{path: a.exr}]\n";
}

int write_scenes(void **)
{
    folder = make_empty_folder("vtk_structured");
    write_file(folder + "/points.yaml", make_scene("p"));
    write_file(folder + "/cells.yaml", make_scene("c"));
    write_file(folder + "/walls.yaml",
               "images:\n  - name: a\n    size: [200, 200]\n    camera: {automatic: {direction: [1, 0.7, 0.9]}}\n"
               "    layers:\n      - surface: {colour_by: {field: c, interpolate: vertex}, opacity: 0.3}\n"
               "    outputs: [{path: a.exr}]\n");
    return 0;
}

/* Adds the signed distance from a sphere as point data and as cell data. */
void add_distances(vtkDataSet *data)
{
    vtkNew<vtkDoubleArray> at_points, in_cells;
    at_points->SetName("p");
    in_cells->SetName("c");
    for (vtkIdType i = 0; i < data->GetNumberOfPoints(); i++) {
        const double *x = data->GetPoint(i);
        at_points->InsertNextValue(std::sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]) - radius);
    }
    for (vtkIdType i = 0; i < data->GetNumberOfCells(); i++) {
        const double *b = data->GetCell(i)->GetBounds();
        const double x = (b[0] + b[1]) / 2, y = (b[2] + b[3]) / 2, z = (b[4] + b[5]) / 2;
        in_cells->InsertNextValue(std::sqrt(x * x + y * y + z * z) - radius);
    }
    data->GetPointData()->AddArray(at_points);
    data->GetCellData()->AddArray(in_cells);
}

/* ---- one grid ---------------------------------------------------------------------------------------------------- */

using sizes = std::array<int, 3>;

/* Returns a grid of [-1, 1]^3 whose indices do not begin at 0. */
vtkSmartPointer<vtkDataSet> make_image_grid(const sizes &cells)
{
    auto image = vtkSmartPointer<vtkImageData>::New();
    image->SetExtent(-2, cells[0] - 2, 3, cells[1] + 3, 0, cells[2]);
    const double h[3] = {2.0 / cells[0], 2.0 / cells[1], 2.0 / cells[2]};
    image->SetSpacing(h);
    image->SetOrigin(-1 + 2 * h[0], -1 - 3 * h[1], -1);
    add_distances(image);
    return image;
}

vtkSmartPointer<vtkDataSet> make_rectilinear_grid(const sizes &cells)
{
    auto grid = vtkSmartPointer<vtkRectilinearGrid>::New();
    vtkNew<vtkDoubleArray> axes[3];
    grid->SetDimensions(cells[0] + 1, cells[1] + 1, cells[2] + 1);
    for (size_t a = 0; a < 3; a++)
        for (int i = 0; i <= cells[a]; i++) axes[a]->InsertNextValue(std::sin(1.5707963 * (2.0 * i / cells[a] - 1)));
    grid->SetXCoordinates(axes[0]);
    grid->SetYCoordinates(axes[1]);
    grid->SetZCoordinates(axes[2]);
    add_distances(grid);
    return grid;
}

vtkSmartPointer<vtkDataSet> make_curvilinear_grid(const sizes &cells)
{
    auto grid = vtkSmartPointer<vtkStructuredGrid>::New();
    vtkNew<vtkPoints> points;
    points->SetDataTypeToDouble();
    grid->SetDimensions(cells[0] + 1, cells[1] + 1, cells[2] + 1);
    for (int k = 0; k <= cells[2]; k++)
        for (int j = 0; j <= cells[1]; j++)
            for (int i = 0; i <= cells[0]; i++) {
                const double x = 2.0 * i / cells[0] - 1, y = 2.0 * j / cells[1] - 1, z = 2.0 * k / cells[2] - 1;
                points->InsertNextPoint(x + 0.05 * std::sin(3 * y), y + 0.05 * std::sin(3 * z),
                                        z + 0.05 * std::sin(3 * x));
            }
    grid->SetPoints(points);
    add_distances(grid);
    return grid;
}

template <typename Writer> void write_data_object(const std::string &name, vtkDataObject *data)
{
    vtkNew<Writer> writer;
    writer->SetFileName((folder + "/" + name).c_str());
    writer->SetInputData(data);
    assert_int_equal(writer->Write(), 1);
}

void write_grids(const sizes &cells)
{
    write_data_object<vtkXMLImageDataWriter>("g.vti", make_image_grid(cells));
    write_data_object<vtkXMLRectilinearGridWriter>("g.vtr", make_rectilinear_grid(cells));
    write_data_object<vtkXMLStructuredGridWriter>("g.vts", make_curvilinear_grid(cells));
}

void grids_are_the_same_on_any_ranks(void **)
{
    write_grids({13, 10, 17});
    for (const std::string file : {"g.vti", "g.vtr", "g.vts"})
        for (const std::string yaml : {"points.yaml ", "cells.yaml "}) {
            if (!test_is_long_run() && (file == "g.vtr") != (yaml == "points.yaml ")) continue;
            const std::string alone = draw_file(1, yaml + file);
            for (const int ranks : {2, 3}) expect_same(draw_file(ranks, yaml + file), alone, file);
        }
    for (const char *how : {"random", "checkerboard"})
        expect_same(draw_file(3, std::string("--partition ") + how + " cells.yaml g.vti"),
                    draw_file(1, "cells.yaml g.vti"), how);
}

/* Checks that the ranks together read each cell exactly once, and that each rank's number of cells is near the mean. */
void ranks_read_parts_of_the_extent(void **)
{
    for (const sizes &cells : {sizes{13, 10, 17}, sizes{2, 2, 2}, sizes{40, 1, 1}}) {
        write_grids(cells);
        for (const char *name : {"g.vti", "g.vtr", "g.vts"})
            for (const int ranks : {2, 3, 7}) {
                const auto file = render_tool::open_data_file(folder + "/" + name);
                const vtkIdType count = vtkIdType{cells[0]} * cells[1] * cells[2];
                std::multiset<double> found, all;
                vtkIdType most = 0;
                assert_int_equal(file->pieces(0), count);
                for (int rank = 0; rank <= ranks; rank++) {
                    const auto data = rank == ranks ? file->read(0, 0, 1) : file->read(0, rank, ranks);
                    auto *part = vtkDataSet::SafeDownCast(data);
                    if (!part) continue;
                    auto *values = vtkDoubleArray::SafeDownCast(part->GetCellData()->GetArray("c"));
                    assert_int_equal(values->GetNumberOfTuples(), part->GetNumberOfCells());
                    for (vtkIdType i = 0; i < part->GetNumberOfCells(); i++)
                        (rank == ranks ? all : found).insert(values->GetValue(i));
                    if (rank < ranks) most = std::max(most, part->GetNumberOfCells());
                }
                assert_int_equal(all.size(), count);
                assert_true(found == all);
                assert_true(most * ranks < 2 * count || count < 20);
            }
    }
}

/* ---- blocks ------------------------------------------------------------------------------------------------------ */

/* Writes the grid of an image as four blocks, of which two are adjacent to the others at different indices. */
void write_blocks(const sizes &cells)
{
    const auto whole = make_image_grid(cells);
    auto *image = vtkImageData::SafeDownCast(whole);
    int e[6];
    image->GetExtent(e);
    const int x = (e[0] + e[1]) / 2, low = e[2] + 4, high = e[2] + 6;
    const int parts[4][6] = {{e[0], x, e[2], low, e[4], e[5]},
                             {e[0], x, low, e[3], e[4], e[5]},
                             {x, e[1], e[2], high, e[4], e[5]},
                             {x, e[1], high, e[3], e[4], e[5]}};
    vtkNew<vtkMultiBlockDataSet> blocks;
    for (unsigned i = 0; i < 4; i++) {
        vtkNew<vtkImageData> block;
        block->ShallowCopy(image);
        block->Crop(parts[i]);
        blocks->SetBlock(i, block);
    }
    write_data_object<vtkXMLMultiBlockDataWriter>("b.vtm", blocks);
}

double compute_largest_difference(const std::string &a, const std::string &b)
{
    double most = a.size() == b.size() ? 0 : 1;
    for (size_t i = 0; i < size_t{pixels} * 4 && most < 1; i++) {
        float u, v;
        std::memcpy(&u, a.data() + 4 * i, 4);
        std::memcpy(&v, b.data() + 4 * i, 4);
        most = std::max(most, static_cast<double>(std::abs(u - v)));
    }
    return most;
}

void blocks_have_no_seam(void **)
{
    write_grids({13, 10, 17});
    write_blocks({13, 10, 17});
    for (const std::string yaml : {"cells.yaml ", "points.yaml "}) {
        if (!test_is_long_run() && yaml == "points.yaml ") continue;
        const std::string whole = draw_file(1, yaml + "g.vti");
        for (const int ranks : {1, 3, 5})
            if (test_is_long_run() || ranks < 5) expect_same(draw_file(ranks, yaml + "b.vtm"), whole, "b.vtm");
        expect_same(draw_file(3, "--partition random " + yaml + "b.vtm"), whole, "random");
    }
    const std::string walls = draw_file(1, "walls.yaml g.vti");
    for (const int ranks : {1, 3})
        assert_true(compute_largest_difference(draw_file(ranks, "walls.yaml b.vtm"), walls) < 1e-5);
}

/* ---- AMR --------------------------------------------------------------------------------------------------------- */

/* A grid of a level of refinement. Its position and size are counted in cells of level 0, of which [-1, 1]^3 has
 * 8^3. */
struct box {
    unsigned level;
    sizes low, cells;
};

/* The grid of level 2 overlaps both grids of level 1, which are adjacent to level 0 and to the border of the domain. */
const std::vector<box> boxes = {{0, {0, 0, 0}, {4, 8, 8}},
                                {0, {4, 0, 0}, {4, 8, 8}},
                                {1, {0, 2, 4}, {3, 5, 4}},
                                {1, {3, 2, 4}, {2, 5, 4}},
                                {2, {1, 3, 5}, {3, 3, 3}}};

/* Writes the AMR file. `ratios` are the refinement ratios of level 1 to level 0 and of level 2 to level 1. */
void write_amr(const std::array<int, 2> &ratios)
{
    const double origin[3] = {-1, -1, -1};
    const int counts[3] = {2, 2, 1}, refinements[3] = {1, ratios[0], ratios[0] * ratios[1]};
    unsigned number[3] = {0, 0, 0};
    vtkNew<vtkOverlappingAMR> amr;
    amr->Initialize(3, counts);
    amr->SetOrigin(origin);
    amr->SetGridDescription(VTK_XYZ_GRID);
    for (const box &b : boxes) {
        const int r = refinements[b.level];
        const double h[3] = {0.25 / r, 0.25 / r, 0.25 / r};
        int low[3], high[3];
        vtkNew<vtkUniformGrid> grid;
        double at[3];
        for (size_t a = 0; a < 3; a++) {
            low[a] = b.low[a] * r;
            high[a] = (b.low[a] + b.cells[a]) * r - 1;
            at[a] = origin[a] + h[a] * low[a];
        }
        grid->SetOrigin(at);
        grid->SetSpacing(h);
        grid->SetDimensions(b.cells[0] * r + 1, b.cells[1] * r + 1, b.cells[2] * r + 1);
        add_distances(grid);
        amr->SetSpacing(b.level, h);
        amr->SetAMRBox(b.level, number[b.level], vtkAMRBox(low, high));
        amr->SetDataSet(b.level, number[b.level]++, grid);
        amr->SetRefinementRatio(b.level, b.level < 2 ? ratios[b.level] : 2);
    }
    write_data_object<vtkXMLUniformGridAMRWriter>("levels.vthb", amr);
}

/* Counts the pixels in which the front of the sphere is not visible. Inside a cell the surface is at most half the
 * diagonal of the largest cell, 0.217, away from the sphere. Within a radius of 0.6 in the picture the front and the
 * back are at least 0.8 apart. */
int count_gap_pixels(const std::string &picture)
{
    int slits = 0;
    for (int pixel = 0; pixel < pixels; pixel++) {
        const double x = (pixel % size + 0.5) / 100 - 1, y = 1 - (pixel / size + 0.5) / 100, square = x * x + y * y;
        float alpha, depth;
        std::memcpy(&alpha, picture.data() + (size_t{4} * static_cast<size_t>(pixel) + 3) * 4, 4);
        std::memcpy(&depth, picture.data() + (size_t{4} * pixels + static_cast<size_t>(pixel)) * 4, 4);
        if (square > 0.6 * 0.6) continue;
        slits +=
            !(alpha > 0 && std::abs(static_cast<double>(depth) - (5 - std::sqrt(radius * radius - square))) < 0.22);
    }
    return slits;
}

void a_sphere_has_no_slits_between_levels(void **)
{
    for (const std::array<int, 2> &ratios : {std::array<int, 2>{2, 4}, std::array<int, 2>{4, 2}}) {
        write_amr(ratios);
        for (const std::string yaml : {"points.yaml ", "cells.yaml "}) {
            if (!test_is_long_run() && (ratios[0] == 2) != (yaml == "cells.yaml ")) continue;
            const std::string alone = draw_file(1, yaml + "levels.vthb");
            assert_true(alone.size() == size_t{pixels} * 20);
            assert_int_equal(count_gap_pixels(alone), 0);
            for (const int ranks : {2, 5}) expect_same(draw_file(ranks, yaml + "levels.vthb"), alone, yaml);
            expect_same(draw_file(3, "--partition random " + yaml + "levels.vthb"), alone, "random");
        }
    }
}

} // namespace

int main(int argc, char **argv)
{
    if (argc < 3) return 2;
    tool = argv[1];
    mpiexec = argv[2];
    const CMUnitTest tests[] = {
        cmocka_unit_test(ranks_read_parts_of_the_extent),
        cmocka_unit_test(grids_are_the_same_on_any_ranks),
        cmocka_unit_test(blocks_have_no_seam),
        cmocka_unit_test(a_sphere_has_no_slits_between_levels),
    };
    return cmocka_run_group_tests(tests, write_scenes, nullptr);
}
