/* Checks insitu-render on files of each type of cell of higher order that VTK 9.1 has. The files are written by VTK's
 * own writers, and the positions of nodes are the parametric coordinates of VTK's cells.
 *
 * The polynomials of straight cells represent the squared distance from the origin exactly, so that its isosurface is a
 * sphere. If every node is interpreted correctly, pictures show the sphere with an error of at most a quarter of a
 * pixel. Shells are paraboloids. Cells whose polynomials the library does not know have a linear field, or are flat.
 *
 *     test_vtk_order <insitu-render that writes plain numbers (plain_image.c)> */
#include <array>
#include <cmath>
#include <cstring>
#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include <vtkCell.h>
#include <vtkDoubleArray.h>
#include <vtkGenericCell.h>
#include <vtkHigherOrderHexahedron.h>
#include <vtkHigherOrderQuadrilateral.h>
#include <vtkHigherOrderWedge.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkSmartPointer.h>
#include <vtkUnstructuredGrid.h>
#include <vtkUnstructuredGridWriter.h>
#include <vtkXMLUnstructuredGridWriter.h>

#include "test_vtk_run.h"

// cmocka defines fail as a macro, so it comes after all C++ headers.
extern "C" {
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
}

namespace
{

std::string tool, folder;

using point = std::array<double, 3>;

constexpr int width = 160, height = 120;
constexpr double pixel = 2.6 / height, eye = 5;

/* ---- cells ------------------------------------------------------------------------------------------------------- */

enum class shape { triangle, quad, tet, hex, wedge, pyramid };

struct cell_kind {
    int type;
    shape of;
    int order; // order of Lagrange and Bezier cells; 0 for types that have only one order
};

/* Returns the number of points of a cell with all nodes of its order. */
int count_nodes(const cell_kind &kind)
{
    const int n = kind.order + 1;
    switch (kind.of) {
    case shape::triangle: return n * (n + 1) / 2;
    case shape::quad: return n * n;
    case shape::tet: return n * (n + 1) * (n + 2) / 6;
    case shape::hex: return n * n * n;
    case shape::wedge: return n * n * (n + 1) / 2;
    default: return 14;
    }
}

vtkSmartPointer<vtkCell> make_cell(const cell_kind &kind)
{
    auto cell = vtkSmartPointer<vtkCell>::Take(vtkGenericCell::InstantiateCell(kind.type));
    assert_non_null(cell.Get());
    if (kind.order == 0) return cell;
    const int count = count_nodes(kind);
    cell->GetPoints()->SetNumberOfPoints(count);
    cell->GetPointIds()->SetNumberOfIds(count);
    if (auto *quad = vtkHigherOrderQuadrilateral::SafeDownCast(cell)) quad->SetUniformOrderFromNumPoints(count);
    if (auto *hex = vtkHigherOrderHexahedron::SafeDownCast(cell)) hex->SetUniformOrderFromNumPoints(count);
    if (auto *wedge = vtkHigherOrderWedge::SafeDownCast(cell)) wedge->SetUniformOrderFromNumPoints(count);
    cell->Initialize();
    return cell;
}

/* Maps VTK's parametric coordinates to the reference pyramid of this test, which has a unit square as base and the apex
 * (0.5, 0.5, 1). VTK's quadratic pyramid is a collapsed cube; its triquadratic pyramid is half as high and begins at
 * height 0.5. */
point map_to_pyramid(int type, const point &p)
{
    const double height = p[2];
    if (type == VTK_TRIQUADRATIC_PYRAMID) return {p[0], p[1], 2 * height - 1};
    return {p[0] + height * (0.5 - p[0]), p[1] + height * (0.5 - p[1]), height};
}

/* Returns the positions of the nodes in the reference cell. VTK 9.1 has no class for Lagrange and Bezier pyramids:
 * those of order 2 have the nodes of the quadratic pyramid, and one in the middle of the base. */
std::vector<point> list_reference_nodes(const cell_kind &kind)
{
    const bool is_unknown = kind.of == shape::pyramid && kind.order == 2;
    const auto cell = make_cell(is_unknown ? cell_kind{VTK_QUADRATIC_PYRAMID, kind.of, 0} : kind);
    const double *all = cell->GetParametricCoords();
    std::vector<point> nodes;
    for (vtkIdType i = 0; i < cell->GetNumberOfPoints(); i++) {
        const point node = {all[3 * i], all[3 * i + 1], all[3 * i + 2]};
        nodes.push_back(kind.of == shape::pyramid ? map_to_pyramid(kind.type, node) : node);
    }
    if (is_unknown) nodes.push_back({0.5, 0.5, 0});
    return nodes;
}

/* A linear map from the reference cell to a cube, by the corners to which the origin and the ends of the three axes are
 * mapped. Corners 0 to 7 of a cube are numbered by bits along x, y and z; 8 is the middle. */
struct placing {
    int origin, first, second, third;
};

std::vector<placing> list_cells_of_cube(shape of)
{
    switch (of) {
    case shape::triangle: return {{0, 1, 3, 0}, {0, 3, 2, 0}};
    case shape::quad: return {{0, 1, 2, 0}};
    case shape::tet: return {{0, 1, 3, 7}, {0, 3, 2, 7}, {0, 2, 6, 7}, {0, 6, 4, 7}, {0, 4, 5, 7}, {0, 5, 1, 7}};
    case shape::hex: return {{0, 1, 2, 4}};
    case shape::wedge: return {{0, 1, 3, 4}, {0, 3, 2, 4}};
    default: return {{0, 1, 2, 8}, {4, 6, 5, 8}, {0, 4, 1, 8}, {2, 3, 6, 8}, {0, 2, 4, 8}, {1, 5, 3, 8}};
    }
}

point get_cube_corner(const std::array<int, 3> &cube, int corner)
{
    point p;
    for (size_t a = 0; a < 3; a++) p[a] = cube[a] - 1 + (corner == 8 ? 0.5 : (corner >> a) & 1);
    return p;
}

point map_node_to_cell(const cell_kind &kind, const std::array<int, 3> &cube, const placing &at, const point &node)
{
    const point o = get_cube_corner(cube, at.origin), u = get_cube_corner(cube, at.first),
                v = get_cube_corner(cube, at.second), w = get_cube_corner(cube, at.third);
    point p;
    for (size_t a = 0; a < 3; a++) {
        double third = w[a] - o[a];
        if (kind.of == shape::pyramid) third -= 0.5 * (u[a] - o[a]) + 0.5 * (v[a] - o[a]);
        p[a] = o[a] + node[0] * (u[a] - o[a]) + node[1] * (v[a] - o[a]) + node[2] * third;
    }
    return p;
}

bool is_flat(shape of)
{
    return of == shape::triangle || of == shape::quad;
}

using field = std::function<double(const point &)>;

double compute_squared_height(const point &p)
{
    return p[0] * p[0] + p[1] * p[1] + p[2] * p[2];
}

double compute_plane_height(const point &p)
{
    return p[2] + 0.3 * p[0] + 0.2 * p[1];
}

/* Height functions of shells. */
double compute_bowl_height(const point &p)
{
    return 0.4 * (p[0] * p[0] + p[1] * p[1]) - 0.3;
}

double compute_sloped_height(const point &p)
{
    return 0.1 - 0.3 * p[0] - 0.2 * p[1];
}

/* Makes two cubes along each axis of [-1, 1]^3, whose cells share points, or the cubes' lower faces moved to the height
 * of the field. order: permutation of the points in each cell. */
vtkSmartPointer<vtkUnstructuredGrid> make_grid(const cell_kind &kind, const field &f,
                                               const std::vector<size_t> &order = {})
{
    auto grid = vtkSmartPointer<vtkUnstructuredGrid>::New();
    vtkNew<vtkPoints> points;
    vtkNew<vtkDoubleArray> values;
    std::map<std::array<long, 3>, vtkIdType> numbers;
    const std::vector<point> nodes = list_reference_nodes(kind);
    values->SetName("f");
    points->SetDataTypeToDouble();
    grid->SetPoints(points);
    for (int i = 0; i < (is_flat(kind.of) ? 4 : 8); i++)
        for (const placing &at : list_cells_of_cube(kind.of)) {
            std::vector<vtkIdType> ids;
            for (size_t n = 0; n < nodes.size(); n++) {
                point p = map_node_to_cell(kind, {i % 2, i / 2 % 2, i / 4}, at, nodes[order.empty() ? n : order[n]]);
                if (is_flat(kind.of)) p[2] = f(p);
                const std::array<long, 3> key = {std::lround(p[0] * 1e5), std::lround(p[1] * 1e5),
                                                 std::lround(p[2] * 1e5)};
                const auto known = numbers.emplace(key, points->GetNumberOfPoints());
                if (known.second) points->InsertNextPoint(p.data());
                if (known.second) values->InsertNextValue(f(p));
                ids.push_back(known.first->second);
            }
            grid->InsertNextCell(kind.type, static_cast<vtkIdType>(ids.size()), ids.data());
        }
    grid->GetPointData()->AddArray(values);
    return grid;
}

/* ---- files ------------------------------------------------------------------------------------------------------- */

enum class format { appended, binary, ascii, legacy, legacy_ascii, legacy_4_2 };
constexpr format formats[] = {format::appended, format::binary, format::ascii, format::legacy, format::legacy_ascii};

std::string write_grid(const std::string &name, vtkUnstructuredGrid *grid, format as)
{
    const bool is_xml = as == format::appended || as == format::binary || as == format::ascii;
    const std::string file = name + "_" + std::to_string(static_cast<int>(as)) + (is_xml ? ".vtu" : ".vtk");
    if (is_xml) {
        vtkNew<vtkXMLUnstructuredGridWriter> writer;
        writer->SetFileName((folder + "/" + file).c_str());
        writer->SetInputData(grid);
        writer->SetDataMode(as == format::appended ? vtkXMLWriter::Appended
                            : as == format::binary ? vtkXMLWriter::Binary
                                                   : vtkXMLWriter::Ascii);
        assert_int_equal(writer->Write(), 1);
        return file;
    }
    vtkNew<vtkUnstructuredGridWriter> writer;
    writer->SetFileName((folder + "/" + file).c_str());
    writer->SetInputData(grid);
    if (as != format::legacy_ascii) writer->SetFileTypeToBinary();
    if (as == format::legacy_4_2) writer->SetFileVersion(vtkDataWriter::VTK_LEGACY_READER_VERSION_4_2);
    assert_int_equal(writer->Write(), 1);
    return file;
}

/* ---- pictures ---------------------------------------------------------------------------------------------------- */

/* Draws each file as a step, in one run of the program. */
run_result draw_files(const std::string &layer, const std::vector<std::string> &files)
{
    write_file(folder + "/scene.yaml",
               "surface_error: 0.25\nimages:\n  - name: a\n    size: [" + std::to_string(width) + ", " +
                   std::to_string(height) +
                   "]\n    camera: {position: [0, 0, 5], focal: [0, 0, 0], up: [0, 1, 0], projection: orthographic, "
                   "height: 2.6}\n    layers: [" +
                   layer + "]\n    outputs: [{path: \"a_{cycle}.exr\"}]\n");
    std::string command = quote_for_shell(tool) + " scene.yaml";
    for (const std::string &file : files) command += " " + quote_for_shell(file);
    const run_result r = run_in_folder(folder, command);
    if (r.status != 0) print_error("%s\n%s%s", command.c_str(), r.out.c_str(), r.err.c_str());
    assert_int_equal(r.status, 0);
    return r;
}

std::vector<float> read_depths(size_t step)
{
    constexpr size_t pixels = static_cast<size_t>(width) * height;
    const std::string all = read_file(folder + "/a_" + std::to_string(step) + ".exr");
    std::vector<float> depths(pixels);
    assert_int_equal(all.size(), 5 * pixels * sizeof(float));
    std::memcpy(depths.data(), all.data() + 4 * pixels * sizeof(float), pixels * sizeof(float));
    return depths;
}

/* Allowed error of depths, which are floats up to 5; positions have the same precision. */
constexpr double rounding = 1e-5;

/* A function that returns whether a ray's depth is right: that of its hit, or infinite if it has none. */
using truth = std::function<bool(double x, double y, double depth)>;

bool is_on_sphere(double x, double y, double depth)
{
    const double radius = std::sqrt(0.5), allowed = 0.25 * pixel + rounding, off = std::hypot(x, y);
    if (!std::isfinite(depth)) return off > radius - allowed;
    return std::fabs(std::sqrt(compute_squared_height({x, y, eye - depth})) - radius) <= allowed;
}

bool is_on_plane(double x, double y, double depth)
{
    if (std::fabs(x) > 1 || std::fabs(y) > 1) return !std::isfinite(depth);
    return std::fabs(eye - depth - compute_sloped_height({x, y, 0})) <= rounding;
}

/* Returns whether a ray has its hit on the bowl. An error of a quarter of a pixel perpendicular to the surface is
 * larger along the ray. */
bool is_in_bowl(double x, double y, double depth)
{
    if (std::fabs(x) > 1 || std::fabs(y) > 1) return !std::isfinite(depth);
    const double allowed = 0.25 * pixel * std::sqrt(1 + 0.64 * (x * x + y * y)) + rounding;
    return std::fabs(eye - depth - compute_bowl_height({x, y, 0})) <= allowed;
}

/* Returns whether all rays of the step's picture are right, and enough of them have hits. */
bool is_right_picture(const std::string &name, size_t step, const truth &is_right)
{
    const std::vector<float> depths = read_depths(step);
    int wrong = 0, hits = 0;
    for (int i = 0; i < width * height; i++) {
        const double x = (i % width + 0.5 - width / 2.0) * pixel, y = (height / 2.0 - i / width - 0.5) * pixel;
        const double depth = static_cast<double>(depths[static_cast<size_t>(i)]);
        if (!is_right(x, y, depth) && wrong++ == 0) print_error("%s: %g %g has depth %g\n", name.c_str(), x, y, depth);
        hits += std::isfinite(depth);
    }
    if (wrong > 0) print_error("%s: %d rays are wrong, %d have hits\n", name.c_str(), wrong, hits);
    return wrong == 0 && hits > 2000;
}

void expect_pictures(const std::vector<std::string> &files, const truth &is_right)
{
    bool are_right = true;
    for (size_t step = 0; step < files.size(); step++)
        are_right = is_right_picture(files[step], step, is_right) && are_right;
    assert_true(are_right);
}

/* Draws two files of each kind of cells, in alternating formats, and returns the program's result with its messages. */
run_result expect_all(const std::vector<cell_kind> &kinds, const field &f, const std::string &layer,
                      const truth &is_right)
{
    std::vector<std::string> files;
    size_t next = 0;
    for (const cell_kind &kind : kinds) {
        const auto grid = make_grid(kind, f);
        const std::string name = "type_" + std::to_string(kind.type) + "_" + std::to_string(kind.order);
        files.push_back(write_grid(name, grid, formats[next++ % 3]));
        files.push_back(write_grid(name, grid, formats[3 + next % 2]));
    }
    const run_result r = draw_files(layer, files);
    expect_pictures(files, is_right);
    return r;
}

const std::string isosurface = "isosurface: {field: f, values: [0.5]}";
const std::string flat_isosurface = "isosurface: {field: f, values: [0.1]}";
const std::string shell = "surface: {colour: [1, 1, 1]}";
const std::string by_corners = "drawn by their corners";

void solids_match_their_polynomials(void **)
{
    std::vector<cell_kind> kinds = {
        {VTK_QUADRATIC_TETRA, shape::tet, 0},         {VTK_QUADRATIC_HEXAHEDRON, shape::hex, 0},
        {VTK_TRIQUADRATIC_HEXAHEDRON, shape::hex, 0}, {VTK_BIQUADRATIC_QUADRATIC_HEXAHEDRON, shape::hex, 0},
        {VTK_QUADRATIC_WEDGE, shape::wedge, 0},       {VTK_BIQUADRATIC_QUADRATIC_WEDGE, shape::wedge, 0}};
    for (int order = 2; order <= 4; order++) {
        kinds.push_back({VTK_LAGRANGE_TETRAHEDRON, shape::tet, order});
        kinds.push_back({VTK_LAGRANGE_HEXAHEDRON, shape::hex, order});
        kinds.push_back({VTK_LAGRANGE_WEDGE, shape::wedge, order});
    }
    assert_false(expect_all(kinds, compute_squared_height, isosurface, is_on_sphere).contains_text(by_corners));
}

/* Checks pyramids, whose polynomials are not compared: a linear field shows that they fill the cube without gaps. */
void pyramids_have_no_gaps(void **)
{
    const std::vector<cell_kind> kinds = {{VTK_QUADRATIC_PYRAMID, shape::pyramid, 0},
                                          {VTK_TRIQUADRATIC_PYRAMID, shape::pyramid, 0},
                                          {VTK_LAGRANGE_PYRAMID, shape::pyramid, 2}};
    assert_false(expect_all(kinds, compute_plane_height, flat_isosurface, is_on_plane).contains_text(by_corners));
}

void shells_match_their_polynomials(void **)
{
    std::vector<cell_kind> kinds = {{VTK_QUADRATIC_TRIANGLE, shape::triangle, 0},
                                    {VTK_BIQUADRATIC_TRIANGLE, shape::triangle, 0},
                                    {VTK_QUADRATIC_QUAD, shape::quad, 0},
                                    {VTK_BIQUADRATIC_QUAD, shape::quad, 0}};
    for (int order = 2; order <= 4; order++) {
        kinds.push_back({VTK_LAGRANGE_TRIANGLE, shape::triangle, order});
        kinds.push_back({VTK_LAGRANGE_QUADRILATERAL, shape::quad, order});
    }
    assert_false(expect_all(kinds, compute_bowl_height, shell, is_in_bowl).contains_text(by_corners));
}

void expect_corners(const std::vector<cell_kind> &kinds, const field &f, const std::string &layer)
{
    for (const cell_kind &kind : kinds) {
        const size_t count = (is_flat(kind.of) ? 4 : 8) * list_cells_of_cube(kind.of).size();
        const std::string words = ": " + std::to_string(count) + " higher-order cells " + by_corners;
        const run_result r = expect_all({kind}, f, layer, is_on_plane);
        if (!r.contains_text(words)) print_error("expected \"%s\":\n%s%s", words.c_str(), r.out.c_str(), r.err.c_str());
        assert_true(r.contains_text(words));
    }
}

void other_cells_are_drawn_as_linear_cells_with_warnings(void **)
{
    std::vector<cell_kind> solids = {{VTK_QUADRATIC_LINEAR_WEDGE, shape::wedge, 0}},
                           shells = {{VTK_QUADRATIC_LINEAR_QUAD, shape::quad, 0}};
    for (int order = 2; order <= 3; order++) {
        solids.push_back({VTK_BEZIER_TETRAHEDRON, shape::tet, order});
        solids.push_back({VTK_BEZIER_HEXAHEDRON, shape::hex, order});
        solids.push_back({VTK_BEZIER_WEDGE, shape::wedge, order});
        shells.push_back({VTK_BEZIER_TRIANGLE, shape::triangle, order});
        shells.push_back({VTK_BEZIER_QUADRILATERAL, shape::quad, order});
    }
    solids.push_back({VTK_BEZIER_PYRAMID, shape::pyramid, 2});
    expect_corners(solids, compute_plane_height, flat_isosurface);
    expect_corners(shells, compute_sloped_height, shell);
}

/* Checks cells that the library cannot draw, in a grid with hexes, which are drawn. */
void cells_without_a_replacement_are_reported(void **)
{
    const auto grid = make_grid({VTK_QUADRATIC_HEXAHEDRON, shape::hex, 0}, compute_squared_height);
    const vtkIdType ids[] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9};
    grid->InsertNextCell(VTK_QUADRATIC_POLYGON, 10, ids);
    grid->InsertNextCell(VTK_CONVEX_POINT_SET, 8, ids);
    const std::vector<std::string> files = {write_grid("others", grid, format::appended),
                                            write_grid("others", grid, format::legacy)};
    const run_result r = draw_files(isosurface, files);
    expect_pictures(files, is_on_sphere);
    assert_true(r.contains_text("2 cells left out, of types that cannot be drawn (see --info)"));
    const run_result info = run_in_folder(folder, quote_for_shell(tool) + " --info " + files[0]);
    assert_true(info.contains_text("type 36  1\n") && info.contains_text("type 41  1\n"));
}

/* ---- files from before VTK 9.1 ----------------------------------------------------------------------------------- */

/* Returns the order of nodes before VTK 9.1: the nodes inside the vertical edges at corners 2 and 3 were exchanged. */
std::vector<size_t> make_old_node_order(int p)
{
    std::vector<size_t> order(static_cast<size_t>((p + 1) * (p + 1) * (p + 1)));
    const size_t r = static_cast<size_t>(p - 1), first = 8 + 10 * r;
    for (size_t n = 0; n < order.size(); n++)
        order[n] = n < first || n >= first + 2 * r ? n : n < first + r ? n + r : n - r;
    return order;
}

/* Replaces the version in the header of a file, which is 2.2. */
void set_version(const std::string &file, const std::string &version)
{
    const std::string now = "\"UnstructuredGrid\" version=\"2.2";
    std::string text = read_file(folder + "/" + file);
    const size_t at = text.find(now);
    assert_true(at != std::string::npos);
    text.replace(at + now.size() - 3, 3, version);
    write_file(folder + "/" + file, text);
}

void old_files_have_the_old_order(void **)
{
    std::vector<std::string> files;
    for (int p = 2; p <= 4; p++) {
        const auto grid =
            make_grid({VTK_LAGRANGE_HEXAHEDRON, shape::hex, p}, compute_squared_height, make_old_node_order(p));
        const std::string name = "old_" + std::to_string(p);
        for (const format as : {format::appended, format::binary}) {
            files.push_back(write_grid(name, grid, as));
            set_version(files.back(), as == format::appended ? "1.0" : "2.0");
        }
        files.push_back(write_grid(name, grid, format::legacy_4_2));
    }
    draw_files(isosurface, files);
    expect_pictures(files, is_on_sphere);
}

int make_folder(void **)
{
    folder = make_empty_folder("vtk_order");
    return 0;
}

} // namespace

int main(int argc, char **argv)
{
    if (argc != 2) return 2;
    tool = argv[1];
    const CMUnitTest tests[] = {
        cmocka_unit_test(solids_match_their_polynomials),
        cmocka_unit_test(pyramids_have_no_gaps),
        cmocka_unit_test(shells_match_their_polynomials),
        cmocka_unit_test(other_cells_are_drawn_as_linear_cells_with_warnings),
        cmocka_unit_test(cells_without_a_replacement_are_reported),
        cmocka_unit_test(old_files_have_the_old_order),
    };
    return cmocka_run_group_tests(tests, make_folder, nullptr);
}
