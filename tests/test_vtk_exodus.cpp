/* Checks element blocks of Exodus files, of every type and with every number of nodes that simulation codes write. Each
 * element must be read as the cell between its corners, or must be refused by the name of its type. The test writes the
 * files with the Exodus library.
 *
 * The body is a cube of volume 1 with the field f = x + 2 z, whose mean is 1.5. Volume and integral are summed in
 * double over the tets of each cell. All faces are flat, so that the choice of their diagonals does not matter. */
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <stdexcept>
#include <string>
#include <vector>

#include <vtkCellData.h>
#include <vtkCompositeDataIterator.h>
#include <vtkCompositeDataSet.h>
#include <vtkDataArray.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkSmartPointer.h>
#include <vtkUnstructuredGrid.h>
#include <vtk_exodusII.h>

#include "data_file.h"
#include "grids_of.h"
#include "test_vtk_run.h"
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

using place = std::array<double, 3>;
using node_list = std::vector<int>;

struct body {
    std::vector<place> nodes;
    std::vector<node_list> cells; // indices of nodes, from 0
};

/* A division of a box into cells. Nodes 0 to 7 are the box's corners in VTK's order of a hexahedron; node 8 is the
 * box's centre. */
struct division {
    const char *type;
    std::vector<node_list> cells;
};

const division hexes = {"HEX", {{0, 1, 2, 3, 4, 5, 6, 7}}};
const division wedges = {"WEDGE", {{0, 1, 2, 4, 5, 6}, {0, 2, 3, 4, 6, 7}}};
const division pyramids = {
    "PYRAMID", {{0, 1, 2, 3, 8}, {4, 7, 6, 5, 8}, {0, 4, 5, 1, 8}, {1, 5, 6, 2, 8}, {2, 6, 7, 3, 8}, {3, 7, 4, 0, 8}}};
const division tets = {"TETRA", {{0, 1, 2, 6}, {0, 2, 3, 6}, {0, 3, 7, 6}, {0, 7, 4, 6}, {0, 4, 5, 6}, {0, 5, 1, 6}}};
const division quads = {"SHELL", {{0, 1, 2, 3}}};
const division triangles = {"TRI", {{0, 1, 2}, {0, 2, 3}}};

/* Returns the cube as two adjacent boxes. Nodes of a cell that are not corners are not shared with other cells, and are
 * all at the cell's centre. */
body divide_cube(const division &how, int nodes_per_cell, double first_x)
{
    body b;
    const int offsets[8][3] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}};
    for (int box = 0; box < 2; box++) {
        const int first = static_cast<int>(b.nodes.size());
        for (const auto &o : offsets) b.nodes.push_back({first_x + 0.5 * (box + o[0]), 1.0 * o[1], 1.0 * o[2]});
        b.nodes.push_back({first_x + 0.25 + 0.5 * box, 0.5, 0.5});
        for (const node_list &corners : how.cells) {
            node_list cell;
            place centre = {0, 0, 0};
            for (const int corner : corners) {
                cell.push_back(first + corner);
                for (size_t a = 0; a < 3; a++)
                    centre[a] += b.nodes[static_cast<size_t>(cell.back())][a] / static_cast<double>(corners.size());
            }
            while (static_cast<int>(cell.size()) < nodes_per_cell) {
                cell.push_back(static_cast<int>(b.nodes.size()));
                b.nodes.push_back(centre);
            }
            b.cells.push_back(cell);
        }
    }
    return b;
}

struct block {
    std::string type;
    body content;
};

void require_success(int status)
{
    if (status < 0) throw std::runtime_error("the Exodus library cannot write");
}

/* Writes two steps; f is twice as large in the second step. The cell field is the cell's number in its block. If
 * is_moved is set, three more point fields, of zeros, have the names of a displacement's components. */
void write_exodus(const std::string &path, const std::vector<block> &blocks, bool is_moved = false)
{
    int word = 8, io_word = 8;
    const int file = ex_create(path.c_str(), EX_CLOBBER, &word, &io_word);
    require_success(file);
    std::vector<double> x[3], f;
    int64_t cell_count = 0;
    for (const block &b : blocks) {
        cell_count += static_cast<int64_t>(b.content.cells.size());
        for (const place &at : b.content.nodes) {
            for (size_t a = 0; a < 3; a++) x[a].push_back(at[a]);
            f.push_back(at[0] + 2 * at[2]);
        }
    }
    const auto nodes = static_cast<int64_t>(f.size());
    require_success(ex_put_init(file, "cube", 3, nodes, cell_count, static_cast<int64_t>(blocks.size()), 0, 0));
    require_success(ex_put_coord(file, x[0].data(), x[1].data(), x[2].data()));
    int first = 1;
    for (size_t i = 0; i < blocks.size(); i++) {
        const body &b = blocks[i].content;
        std::vector<int> list;
        for (const node_list &cell : b.cells)
            for (const int node : cell) list.push_back(first + node);
        const auto id = static_cast<ex_entity_id>(90 - 10 * i);
        require_success(ex_put_block(file, EX_ELEM_BLOCK, id, blocks[i].type.c_str(),
                                     static_cast<int64_t>(b.cells.size()), static_cast<int64_t>(b.cells[0].size()), 0,
                                     0, 0));
        require_success(ex_put_conn(file, EX_ELEM_BLOCK, id, list.data(), nullptr, nullptr));
        first += static_cast<int>(b.nodes.size());
    }
    const char *const names[] = {"f", "disp_x", "disp_y", "disp_z"};
    const int fields = is_moved ? 4 : 1;
    require_success(ex_put_variable_param(file, EX_NODAL, fields));
    for (int i = 0; i < fields; i++) require_success(ex_put_variable_name(file, EX_NODAL, i + 1, names[i]));
    require_success(ex_put_variable_param(file, EX_ELEM_BLOCK, 1));
    require_success(ex_put_variable_name(file, EX_ELEM_BLOCK, 1, "number"));
    for (int step = 1; step <= 2; step++) {
        const double time = step;
        require_success(ex_put_time(file, step, &time));
        require_success(ex_put_var(file, step, EX_NODAL, 1, 1, nodes, f.data()));
        const std::vector<double> none(f.size());
        for (int i = 1; i < fields; i++)
            require_success(ex_put_var(file, step, EX_NODAL, i + 1, 1, nodes, none.data()));
        for (double &value : f) value *= 2;
        for (size_t i = 0; i < blocks.size(); i++) {
            std::vector<double> numbers;
            for (size_t c = 0; c < blocks[i].content.cells.size(); c++) numbers.push_back(static_cast<double>(c));
            require_success(ex_put_var(file, step, EX_ELEM_BLOCK, 1, static_cast<ex_entity_id>(90 - 10 * i),
                                       static_cast<int64_t>(numbers.size()), numbers.data()));
        }
    }
    require_success(ex_close(file));
}

/* size: total size of the cells (volume, or area of flat cells); integral: integral of f over them */
struct sums {
    double size = 0, integral = 0;
    vtkIdType cells = 0, points = 0;
};

place subtract_points(const place &a, const place &b)
{
    return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}

place cross_product(const place &a, const place &b)
{
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

double dot_product(const place &a, const place &b)
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Adds a tet or a triangle of a cell. */
void add_simplex(vtkUnstructuredGrid *grid, const std::vector<vtkIdType> &nodes, sums &all)
{
    vtkDataArray *f = grid->GetPointData()->GetArray("f");
    std::vector<place> at(nodes.size());
    double mean = 0;
    for (size_t i = 0; i < nodes.size(); i++) {
        grid->GetPoint(nodes[i], at[i].data());
        mean += f->GetComponent(nodes[i], 0) / static_cast<double>(nodes.size());
    }
    const place normal = cross_product(subtract_points(at[1], at[0]), subtract_points(at[2], at[0]));
    const double size = at.size() == 4 ? dot_product(normal, subtract_points(at[3], at[0])) / 6
                                       : std::sqrt(dot_product(normal, normal)) / 2;
    all.size += size;
    all.integral += size * mean;
}

/* Adds a cell by its corners, which are the first points in each of VTK's cell types. */
void add_cell(vtkUnstructuredGrid *grid, vtkIdType cell, sums &all)
{
    std::vector<node_list> simplices;
    switch (grid->GetCellType(cell)) {
    case VTK_TETRA:
    case VTK_QUADRATIC_TETRA:
    case VTK_LAGRANGE_TETRAHEDRON: simplices = {{0, 1, 2, 3}}; break;
    case VTK_PYRAMID:
    case VTK_QUADRATIC_PYRAMID:
    case VTK_TRIQUADRATIC_PYRAMID: simplices = {{0, 1, 2, 4}, {0, 2, 3, 4}}; break;
    case VTK_WEDGE:
    case VTK_QUADRATIC_WEDGE:
    case VTK_LAGRANGE_WEDGE:
    case VTK_BIQUADRATIC_QUADRATIC_WEDGE: simplices = {{0, 1, 2, 3}, {1, 2, 3, 4}, {2, 3, 4, 5}}; break;
    case VTK_HEXAHEDRON:
    case VTK_QUADRATIC_HEXAHEDRON:
    case VTK_TRIQUADRATIC_HEXAHEDRON: simplices = tets.cells; break;
    case VTK_TRIANGLE:
    case VTK_QUADRATIC_TRIANGLE:
    case VTK_BIQUADRATIC_TRIANGLE: simplices = {{0, 1, 2}}; break;
    case VTK_QUAD:
    case VTK_QUADRATIC_QUAD:
    case VTK_BIQUADRATIC_QUAD: simplices = {{0, 1, 2}, {0, 2, 3}}; break;
    default: throw std::runtime_error("a cell of type " + std::to_string(grid->GetCellType(cell)));
    }
    vtkIdType count = 0;
    const vtkIdType *points = nullptr;
    grid->GetCellPoints(cell, count, points);
    for (const node_list &simplex : simplices) {
        std::vector<vtkIdType> nodes;
        for (const int corner : simplex) {
            if (corner >= count) throw std::runtime_error("a cell of " + std::to_string(count) + " points");
            nodes.push_back(points[corner]);
        }
        add_simplex(grid, nodes, all);
    }
    if (grid->GetCellData()->GetArray("number")->GetComponent(cell, 0) != static_cast<double>(cell))
        throw std::runtime_error("cell " + std::to_string(cell) + " has another cell's value");
    all.cells++;
}

sums compute_file_sums(const std::string &path, size_t step, int piece = 0, int pieces = 1)
{
    const auto file = open_data_file(path);
    const auto data = grids_of(file->read(step, piece, pieces), path);
    auto *composite = vtkCompositeDataSet::SafeDownCast(data);
    if (!composite) throw std::runtime_error("no blocks");
    sums all;
    const auto it = vtkSmartPointer<vtkCompositeDataIterator>::Take(composite->NewIterator());
    for (it->InitTraversal(); !it->IsDoneWithTraversal(); it->GoToNextItem()) {
        auto *grid = vtkUnstructuredGrid::SafeDownCast(it->GetCurrentDataObject());
        if (!grid) continue;
        all.points += grid->GetNumberOfPoints();
        for (vtkIdType c = 0; c < grid->GetNumberOfCells(); c++) add_cell(grid, c, all);
    }
    return all;
}

/* Returns whether two sums are equal up to 1e-12: each is a sum in double of a few terms of size 1. */
bool is_near(double a, double b)
{
    return std::fabs(a - b) < 1e-12;
}

/* Writes and reads elements of one type with this number of nodes. Returns the number of wrong files. */
int check_kind(const division &how, const std::string &type, int nodes, double mean)
{
    const std::string name = type + " of " + std::to_string(nodes) + " nodes";
    const std::string path = folder + "/" + type + std::to_string(nodes) + ".e";
    const body b = divide_cube(how, nodes, 0);
    write_exodus(path, {{type, b}});
    try {
        for (size_t step = 0; step < 2; step++) {
            const sums got = compute_file_sums(path, step);
            const double factor = step == 0 ? 1 : 2;
            if (is_near(got.size, 1) && is_near(got.integral, factor * mean) &&
                got.cells == static_cast<vtkIdType>(b.cells.size()))
                continue;
            print_error("%s, step %zu: size %g, integral %g, %d cells\n", name.c_str(), step, got.size, got.integral,
                        static_cast<int>(got.cells));
            return 1;
        }
    } catch (const std::exception &e) {
        print_error("%s: %s\n", name.c_str(), e.what());
        return 1;
    }
    return 0;
}

void every_kind_of_element_has_its_corners(void **)
{
    int wrong = 0;
    for (const int n : {4, 8, 10, 11, 14, 15}) wrong += check_kind(tets, "TETRA", n, 1.5);
    for (const int n : {5, 13, 14, 18, 19}) wrong += check_kind(pyramids, "PYRAMID", n, 1.5);
    for (const int n : {6, 12, 15, 16, 18, 20, 21}) wrong += check_kind(wedges, "WEDGE", n, 1.5);
    for (const int n : {8, 9, 12, 16, 20, 21, 22, 27, 64}) wrong += check_kind(hexes, "HEX", n, 1.5);
    assert_int_equal(wrong, 0);
}

/* Checks elements of surfaces, which are at z = 0, where f = x has the mean 0.5. */
void elements_of_surfaces_have_their_corners(void **)
{
    int wrong = 0;
    for (const int n : {3, 4, 6, 7}) wrong += check_kind(triangles, "TRI", n, 0.5);
    for (const int n : {3, 6, 7}) wrong += check_kind(triangles, "TRISHELL", n, 0.5);
    for (const int n : {4, 5, 8, 9, 12, 16}) wrong += check_kind(quads, "QUAD", n, 0.5);
    for (const int n : {4, 8, 9}) wrong += check_kind(quads, "SHELL", n, 0.5);
    assert_int_equal(wrong, 0);
}

void element_type_names_of_common_codes_are_accepted(void **)
{
    int wrong = 0;
    for (const char *name : {"TET8", "tet", "tetra"}) wrong += check_kind(tets, name, 8, 1.5);
    for (const char *name : {"HEX9", "hex", "HEXAHEDRON"}) wrong += check_kind(hexes, name, 9, 1.5);
    for (const char *name : {"WEDGE20", "wedge"}) wrong += check_kind(wedges, name, 20, 1.5);
    for (const char *name : {"PYRAMID18", "pyramid"}) wrong += check_kind(pyramids, name, 18, 1.5);
    assert_int_equal(wrong, 0);
}

/* Checks that adjacent blocks of several types keep their own cells and values, even if VTK alone would read only some
 * of them correctly. */
void blocks_of_many_kinds_are_read_together(void **)
{
    const std::string path = folder + "/many.e";
    write_exodus(path, {{"HEX8", divide_cube(hexes, 8, 0)},
                        {"TETRA14", divide_cube(tets, 14, 1)},
                        {"WEDGE12", divide_cube(wedges, 12, 2)},
                        {"HEX27", divide_cube(hexes, 27, 3)},
                        {"PYRAMID14", divide_cube(pyramids, 14, 4)}});
    const sums got = compute_file_sums(path, 0);
    assert_true(is_near(got.size, 5));
    assert_true(is_near(got.integral, 1.5 + 2.5 + 3.5 + 4.5 + 5.5));
}

void expect_refusal(const std::string &type, int nodes)
{
    const std::string path = folder + "/refused.e", count = std::to_string(nodes) + " nodes";
    write_exodus(path, {{"HEX8", divide_cube(hexes, 8, 0)}, {type, divide_cube(tets, nodes, 1)}});
    try {
        compute_file_sums(path, 0);
    } catch (const std::exception &e) {
        const std::string what = e.what();
        if (what.find(path) == 0 && what.find("block 80") != std::string::npos &&
            what.find("\"" + type + "\"") != std::string::npos && what.find(count) != std::string::npos)
            return;
        print_error("%s\n", what.c_str());
    }
    print_error("%s of %s: not refused by its block, type and number of nodes\n", type.c_str(), count.c_str());
    assert_true(false);
}

void elements_that_cannot_be_read_are_refused_by_name(void **)
{
    expect_refusal("BRICK", 8);
    expect_refusal("HEX", 7);
    expect_refusal("PYRAMID", 4);
}

std::string get_refusal(const std::string &path)
{
    try {
        (void)compute_file_sums(path, 0);
    } catch (const std::exception &e) {
        return e.what();
    }
    return "";
}

/* Checks files of a parallel run: the name of any one of them stands for all of them, and each is a piece. In the
 * second step the field is 2 f. */
void files_of_a_parallel_run_are_pieces(void **)
{
    const std::string start = folder + "/run.e-s002.12.";
    for (int p = 0; p < 12; p++)
        write_exodus(start + (p < 10 ? "0" : "") + std::to_string(p), {{"HEX8", divide_cube(hexes, 8, p)}});
    const sums all = compute_file_sums(start + "07", 1);
    assert_true(is_near(all.size, 12));
    assert_true(std::fabs(all.integral - 2 * (12 * 1.5 + 66)) < 1e-10); /* error of a sum of some hundred terms */
    assert_int_equal(open_data_file(start + "00")->pieces(0), 12);
    for (int piece = 0; piece < 3; piece++) assert_true(is_near(compute_file_sums(start + "00", 0, piece, 3).size, 4));
    assert_int_equal(std::remove((start + "03").c_str()), 0);
    const std::string why = get_refusal(start + "07");
    if (why.find("run.e-s002.12.03: No such file") != std::string::npos && why.find("12 pieces") != std::string::npos)
        return;
    print_error("%s\n", why.c_str());
    assert_true(false);
}

void files_of_meshes_that_change_are_read(void **)
{
    const std::string path = folder + "/changing.e-s002";
    write_exodus(path, {{"HEX8", divide_cube(hexes, 8, 0)}});
    assert_true(is_near(compute_file_sums(path, 0).size, 1));
    assert_true(get_refusal(folder + "/changing.e-t002").find("No such file") != std::string::npos);
}

void a_displacement_that_is_applied_is_reported(void **)
{
    const std::string path = folder + "/moved.e";
    write_exodus(path, {{"HEX8", divide_cube(hexes, 8, 0)}}, true);
    const std::string reported = open_data_file(path)->take_warnings();
    if (reported.find("moved.e: points are moved by the displacement \"disp_\"") == std::string::npos) {
        print_error("%s\n", reported.c_str());
        assert_true(false);
    }
    write_exodus(path, {{"HEX8", divide_cube(hexes, 8, 0)}});
    assert_string_equal(open_data_file(path)->take_warnings().c_str(), "");
}

int set_up_test_group(void **)
{
    folder = make_empty_folder("vtk_exodus");
    catch_vtk_messages();
    return 0;
}

} // namespace

int main()
{
    const CMUnitTest tests[] = {
        cmocka_unit_test(every_kind_of_element_has_its_corners),
        cmocka_unit_test(elements_of_surfaces_have_their_corners),
        cmocka_unit_test(element_type_names_of_common_codes_are_accepted),
        cmocka_unit_test(blocks_of_many_kinds_are_read_together),
        cmocka_unit_test(elements_that_cannot_be_read_are_refused_by_name),
        cmocka_unit_test(files_of_a_parallel_run_are_pieces),
        cmocka_unit_test(files_of_meshes_that_change_are_read),
        cmocka_unit_test(a_displacement_that_is_applied_is_reported),
    };
    return cmocka_run_group_tests(tests, set_up_test_group, nullptr);
}
