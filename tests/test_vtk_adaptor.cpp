/* Checks that the VTK adaptor passes VTK's own pointers to the session if it can, and correct conversions otherwise.
 * The session is a stub that records its input. Volumes of cells that are split or reordered are compared with volumes
 * computed here from the positions of corners; everything else is compared element by element with VTK's arrays. */
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <vtkCellArray.h>
#include <vtkCellData.h>
#include <vtkDoubleArray.h>
#include <vtkFloatArray.h>
#include <vtkIdTypeArray.h>
#include <vtkIntArray.h>
#include <vtkMultiBlockDataSet.h>
#include <vtkNew.h>
#include <vtkPartitionedDataSet.h>
#include <vtkPartitionedDataSetCollection.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkImageData.h>
#include <vtkPolyData.h>
#include <vtkTable.h>
#include <vtkStructuredGrid.h>
#include <vtkRectilinearGrid.h>
#include <vtkSOADataArrayTemplate.h>
#include <vtkShortArray.h>
#include <vtkTypeInt32Array.h>
#include <vtkTypeInt64Array.h>
#include <vtkUnsignedCharArray.h>
#include <vtkUnstructuredGrid.h>

// cmocka.h is included after all C++ headers, as it defines fail as a macro.
extern "C" {
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
}

#include "test_vtk_fixture.h"

namespace
{

using point = std::array<double, 3>;

/* Adds a cell with points of its own to the grid. */
void add_cell(vtkUnstructuredGrid *grid, int type, const std::vector<point> &points)
{
    if (!grid->GetPoints()) {
        vtkNew<vtkPoints> p;
        p->SetDataTypeToDouble();
        grid->SetPoints(p);
    }
    std::vector<vtkIdType> ids;
    for (const point &x : points) ids.push_back(grid->GetPoints()->InsertNextPoint(x.data()));
    grid->InsertNextCell(type, static_cast<vtkIdType>(ids.size()), ids.data());
}

std::vector<point> make_prism_points(int sides)
{
    std::vector<point> p;
    for (int layer = 0; layer < 2; layer++)
        for (int i = 0; i < sides; i++) {
            const double a = 2 * M_PI * i / sides;
            p.push_back({std::cos(a) + 0.1 * layer, std::sin(a), 0.7 * layer});
        }
    return p;
}

const std::vector<point> cube = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0},
                                 {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}};
const std::vector<point> corner = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
const std::vector<point> roof = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {0, 1, 1}};
const std::vector<point> pyramid = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0.5, 0.5, 1}};

int64_t read_integer(const insitu_array &a, int64_t i)
{
    switch (a.type) {
    case INSITU_UINT8: return static_cast<const uint8_t *>(a.data)[i];
    case INSITU_INT32: return static_cast<const int32_t *>(a.data)[i];
    default: return static_cast<const int64_t *>(a.data)[i];
    }
}

point get_vertex(const insitu_mesh &m, int64_t i)
{
    point p;
    for (size_t c = 0; c < 3; c++) {
        const auto *at = static_cast<const char *>(m.coordinates[c].data) + i * m.coordinates[c].stride_bytes;
        p[c] = m.coordinates[c].type == INSITU_FLOAT32 ? static_cast<double>(*reinterpret_cast<const float *>(at))
                                                       : *reinterpret_cast<const double *>(at);
    }
    return p;
}

double compute_tet_volume(const point &a, const point &b, const point &c, const point &d)
{
    auto minus = [](const point &p, const point &q) { return point{p[0] - q[0], p[1] - q[1], p[2] - q[2]}; };
    const point u = minus(b, a), v = minus(c, a), w = minus(d, a);
    return (u[0] * (v[1] * w[2] - v[2] * w[1]) + u[1] * (v[2] * w[0] - v[0] * w[2]) +
            u[2] * (v[0] * w[1] - v[1] * w[0])) /
           6;
}

/* Returns the signed volume of cell i, as a sum of tets, which is exact up to rounding if faces are flat. Vertices are
 * in VTK's order: a hex's lower quad is counterclockwise if seen from above. Wedges occur in both orientations, so that
 * the absolute value of their volume is used. */
double compute_cell_volume(const insitu_mesh &m, int64_t i)
{
    const int64_t begin = m.offsets.data ? read_integer(m.offsets, i) : 0;
    auto v = [&](int64_t k) { return get_vertex(m, read_integer(m.connectivity, begin + k)); };
    switch (read_integer(m.cell_types, i)) {
    case INSITU_TET: return compute_tet_volume(v(0), v(1), v(2), v(3));
    case INSITU_PYRAMID: return compute_tet_volume(v(0), v(1), v(2), v(4)) + compute_tet_volume(v(0), v(2), v(3), v(4));
    case INSITU_WEDGE:
        return std::fabs(compute_tet_volume(v(0), v(1), v(2), v(3)) + compute_tet_volume(v(1), v(2), v(3), v(4)) +
                         compute_tet_volume(v(2), v(3), v(4), v(5)));
    default:
        return compute_tet_volume(v(0), v(1), v(3), v(4)) + compute_tet_volume(v(1), v(2), v(3), v(6)) +
               compute_tet_volume(v(1), v(6), v(4), v(5)) + compute_tet_volume(v(3), v(4), v(6), v(7)) +
               compute_tet_volume(v(1), v(3), v(4), v(6));
    }
}

/* Allowed error of volumes, which are sums of a few products of numbers of size 1. */
constexpr double rounding = 1e-14;

void plain_grid_is_borrowed(void **)
{
    vtkNew<vtkUnstructuredGrid> grid;
    add_cell(grid, VTK_TETRA, corner);
    add_cell(grid, VTK_HEXAHEDRON, cube);
    add_cell(grid, VTK_WEDGE, roof);
    add_cell(grid, VTK_PYRAMID, pyramid);
    vtkNew<vtkFloatArray> velocity;
    velocity->SetName("v");
    velocity->SetNumberOfComponents(3);
    velocity->SetNumberOfTuples(grid->GetNumberOfPoints());
    velocity->Fill(1);
    grid->GetPointData()->AddArray(velocity);
    vtkNew<vtkIntArray> block;
    block->SetName("block");
    block->SetNumberOfTuples(4);
    block->Fill(7);
    grid->GetCellData()->AddArray(block);

    fixture f;
    assert_int_equal(f.set(grid), INSITU_OK);
    const insitu_mesh &m = f.mesh().mesh;
    auto *points = vtkDoubleArray::SafeDownCast(grid->GetPoints()->GetData());
    for (int c = 0; c < 3; c++) {
        assert_ptr_equal(m.coordinates[c].data, points->GetPointer(c));
        assert_int_equal(m.coordinates[c].stride_bytes, 24);
        assert_int_equal(m.coordinates[c].type, INSITU_FLOAT64);
    }
    assert_int_equal(m.vertex_count, grid->GetNumberOfPoints());
    assert_int_equal(m.cell_count, 4);
    assert_ptr_equal(m.cell_types.data, grid->GetCellTypesArray()->GetPointer(0));
    assert_ptr_equal(m.connectivity.data, grid->GetCells()->GetConnectivityArray64()->GetPointer(0));
    assert_ptr_equal(m.offsets.data, grid->GetCells()->GetOffsetsArray64()->GetPointer(0));
    assert_int_equal(m.offsets.type, INSITU_INT64);
    assert_int_equal(m.connectivity_count, 4 + 8 + 6 + 5);
    assert_null(m.ghosts.data);

    const insitu_field &v = f.mesh().fields.at("v");
    assert_ptr_equal(v.values.data, velocity->GetPointer(0));
    assert_int_equal(v.values.type, INSITU_FLOAT32);
    assert_int_equal(v.values.stride_bytes, 12);
    assert_int_equal(v.component_stride_bytes, 4);
    assert_int_equal(v.component_count, 3);
    assert_int_equal(v.centring, INSITU_VERTEX);
    assert_int_equal(v.count, grid->GetNumberOfPoints());
    const insitu_field &b = f.mesh().fields.at("block");
    assert_ptr_equal(b.values.data, block->GetPointer(0));
    assert_int_equal(b.values.type, INSITU_INT32);
    assert_int_equal(b.centring, INSITU_CELL);

    assert_int_equal(f.report.bytes_copied, 0);
    assert_string_equal(f.report.copied_why, "");
    assert_string_equal(f.report.warnings, "");
    const int64_t expected = 23 * 24 + 23 * 8 + 5 * 8 + 4 + 23 * 12 + 4 * 4;
    assert_int_equal(f.report.bytes_borrowed, expected);
}

void one_type_of_32_bits_is_borrowed_without_types(void **)
{
    vtkNew<vtkUnstructuredGrid> grid;
    add_cell(grid, VTK_TETRA, corner);
    add_cell(grid, VTK_TETRA, corner);
    assert_true(grid->GetCells()->ConvertTo32BitStorage());
    fixture f;
    assert_int_equal(f.set(grid), INSITU_OK);
    const insitu_mesh &m = f.mesh().mesh;
    assert_int_equal(m.cell_type, INSITU_TET);
    assert_null(m.cell_types.data);
    assert_null(m.offsets.data);
    assert_int_equal(m.connectivity.type, INSITU_INT32);
    assert_ptr_equal(m.connectivity.data, grid->GetCells()->GetConnectivityArray32()->GetPointer(0));
    assert_int_equal(f.report.bytes_copied, 0);
}

void separate_components_are_borrowed(void **)
{
    vtkNew<vtkUnstructuredGrid> grid;
    add_cell(grid, VTK_TETRA, corner);
    vtkNew<vtkSOADataArrayTemplate<float>> xyz;
    xyz->SetNumberOfComponents(3);
    xyz->SetNumberOfTuples(4);
    for (int i = 0; i < 4; i++)
        for (int c = 0; c < 3; c++)
            xyz->SetTypedComponent(i, c, static_cast<float>(corner[static_cast<size_t>(i)][static_cast<size_t>(c)]));
    grid->GetPoints()->SetData(xyz);

    float even[12] = {};
    vtkNew<vtkSOADataArrayTemplate<float>> velocity;
    velocity->SetName("even");
    velocity->SetNumberOfComponents(3);
    for (int c = 0; c < 3; c++) velocity->SetArray(c, even + 4 * c, 4, true, true);
    grid->GetPointData()->AddArray(velocity);

    double uneven[20];
    for (int i = 0; i < 20; i++) uneven[i] = i;
    vtkNew<vtkSOADataArrayTemplate<double>> other;
    other->SetName("uneven");
    other->SetNumberOfComponents(3);
    const int at[3] = {0, 4, 13};
    for (int c = 0; c < 3; c++) other->SetArray(c, uneven + at[c], 4, true, true);
    grid->GetPointData()->AddArray(other);

    fixture f;
    assert_int_equal(f.set(grid), INSITU_OK);
    for (int c = 0; c < 3; c++) {
        assert_ptr_equal(f.mesh().mesh.coordinates[c].data, xyz->GetComponentArrayPointer(c));
        assert_int_equal(f.mesh().mesh.coordinates[c].type, INSITU_FLOAT32);
    }
    const insitu_field &e = f.mesh().fields.at("even");
    assert_ptr_equal(e.values.data, even);
    assert_int_equal(e.values.stride_bytes, 4);
    assert_int_equal(e.component_stride_bytes, 16);
    const insitu_field &u = f.mesh().fields.at("uneven");
    const auto *copy = static_cast<const double *>(u.values.data);
    for (int i = 0; i < 4; i++)
        for (int c = 0; c < 3; c++) assert_true(copy[i * 3 + c] == at[c] + i);
    assert_int_equal(f.report.bytes_copied, 4 * 3 * 8);
    assert_non_null(strstr(f.report.copied_why, "'uneven'"));
    assert_non_null(strstr(f.report.copied_why, "evenly"));
}

void other_value_types_are_copied_and_declared(void **)
{
    vtkNew<vtkUnstructuredGrid> grid;
    add_cell(grid, VTK_TETRA, corner);
    vtkNew<vtkShortArray> shorts;
    shorts->SetName("s");
    vtkNew<vtkIdTypeArray> ids;
    ids->SetName("ids");
    vtkNew<vtkUnsignedCharArray> bytes;
    bytes->SetName("b");
    for (int i = 0; i < 4; i++) {
        shorts->InsertNextValue(static_cast<short>(-300 + i));
        ids->InsertNextValue((int64_t{1} << 60) + i);
        bytes->InsertNextValue(static_cast<unsigned char>(250 + i));
    }
    for (vtkDataArray *a :
         {static_cast<vtkDataArray *>(shorts), static_cast<vtkDataArray *>(ids), static_cast<vtkDataArray *>(bytes)})
        grid->GetPointData()->AddArray(a);
    fixture f;
    assert_int_equal(f.set(grid), INSITU_OK);
    for (int i = 0; i < 4; i++) {
        assert_int_equal(read_integer(f.mesh().fields.at("s").values, i), -300 + i);
        assert_int_equal(read_integer(f.mesh().fields.at("b").values, i), 250 + i);
    }
    assert_ptr_equal(f.mesh().fields.at("ids").values.data, ids->GetPointer(0));
    assert_int_equal(f.mesh().fields.at("ids").values.type, INSITU_INT64);
    assert_int_equal(f.report.bytes_copied, 2 * 4 * 4);
    assert_non_null(strstr(f.report.copied_why, "short values to int32"));
    assert_non_null(strstr(f.report.copied_why, "unsigned char values to int32"));
}

void integer_points_become_doubles(void **)
{
    vtkNew<vtkUnstructuredGrid> grid;
    add_cell(grid, VTK_HEXAHEDRON, cube);
    vtkNew<vtkIntArray> xyz;
    xyz->SetNumberOfComponents(3);
    for (const point &p : cube) xyz->InsertNextTuple(p.data());
    grid->GetPoints()->SetData(xyz);
    fixture f;
    assert_int_equal(f.set(grid), INSITU_OK);
    for (size_t i = 0; i < 8; i++) assert_true(get_vertex(f.mesh().mesh, static_cast<int64_t>(i)) == cube[i]);
    assert_int_equal(f.report.bytes_copied, 8 * 3 * 8);
}

void voxel_becomes_a_right_handed_hexahedron(void **)
{
    std::vector<point> p;
    for (int k = 0; k < 2; k++)
        for (int j = 0; j < 2; j++)
            for (int i = 0; i < 2; i++) p.push_back({2.0 * i, 3.0 * j, 1.0 * k});
    vtkNew<vtkUnstructuredGrid> grid;
    add_cell(grid, VTK_VOXEL, p);
    add_cell(grid, VTK_TETRA, corner);
    vtkNew<vtkIntArray> id;
    id->SetName("id");
    id->InsertNextValue(5);
    id->InsertNextValue(6);
    grid->GetCellData()->AddArray(id);
    fixture f;
    assert_int_equal(f.set(grid), INSITU_OK);
    assert_int_equal(f.report.cells, 2);
    assert_int_equal(read_integer(f.mesh().mesh.cell_types, 0), INSITU_HEX);
    assert_true(std::fabs(compute_cell_volume(f.mesh().mesh, 0) - 6) < rounding);
    assert_true(std::fabs(compute_cell_volume(f.mesh().mesh, 1) - 1.0 / 6) < rounding);
    assert_ptr_equal(f.mesh().fields.at("id").values.data, id->GetPointer(0));
    assert_int_equal(f.report.bytes_copied, 2 + 3 * 8 + 12 * 8);
    assert_non_null(strstr(f.report.copied_why, "voxels and pixels reordered"));
}

/* Returns the sorted points of a face. */
std::vector<int64_t> list_face_points(const insitu_mesh &m, int64_t face)
{
    std::vector<int64_t> points;
    for (int64_t i = read_integer(m.face_offsets, face); i < read_integer(m.face_offsets, face + 1); i++)
        points.push_back(read_integer(m.face_connectivity, i));
    std::sort(points.begin(), points.end());
    return points;
}

int64_t count_cell_vertices(const insitu_mesh &m, int64_t cell)
{
    return read_integer(m.offsets, cell + 1) - read_integer(m.offsets, cell);
}

void prisms_are_polyhedra_of_their_faces(void **)
{
    vtkNew<vtkUnstructuredGrid> grid;
    add_cell(grid, VTK_PENTAGONAL_PRISM, make_prism_points(5));
    add_cell(grid, VTK_HEXAGONAL_PRISM, make_prism_points(6));
    vtkNew<vtkFloatArray> value;
    value->SetName("c");
    value->SetNumberOfComponents(2);
    for (float v : {1.f, 2.f, 3.f, 4.f}) value->InsertNextValue(v);
    grid->GetCellData()->AddArray(value);
    fixture f;
    assert_int_equal(f.set(grid), INSITU_OK);
    const insitu_mesh &m = f.mesh().mesh;
    assert_int_equal(m.cell_count, 2);
    assert_int_equal(m.face_count, 7 + 8);
    assert_int_equal(f.report.cells_split, 0);
    for (int sides = 5, first = 0; sides <= 6; first += 2 * sides, sides++) {
        const int64_t cell = sides - 5;
        assert_int_equal(read_integer(m.cell_types, cell), INSITU_POLYHEDRON);
        assert_int_equal(count_cell_vertices(m, cell), sides + 2);
        std::map<std::pair<int64_t, int64_t>, int> edges;
        for (int64_t i = read_integer(m.offsets, cell); i < read_integer(m.offsets, cell + 1); i++) {
            const int64_t face = read_integer(m.connectivity, i), begin = read_integer(m.face_offsets, face);
            const int64_t size = read_integer(m.face_offsets, face + 1) - begin;
            for (int64_t k = 0; k < size; k++) {
                const int64_t a = read_integer(m.face_connectivity, begin + k);
                const int64_t b = read_integer(m.face_connectivity, begin + (k + 1) % size);
                assert_true(a >= first && a < first + 2 * sides);
                edges[std::minmax(a, b)]++;
            }
        }
        assert_int_equal(edges.size(), 3 * sides);
        for (const auto &[edge, count] : edges) assert_int_equal(count, 2);
    }
    assert_ptr_equal(f.mesh().fields.at("c").values.data, value->GetPointer(0));
    assert_non_null(strstr(f.report.copied_why, "faces of polyhedra and prisms shared"));
}

void bezier_cells_are_drawn_as_linear_cells_with_a_warning(void **)
{
    std::vector<point> p = corner;
    for (int i = 0; i < 6; i++) p.push_back({0.5, 0.5, 0.1 * i});
    vtkNew<vtkUnstructuredGrid> grid;
    add_cell(grid, VTK_BEZIER_TETRAHEDRON, p);
    fixture f;
    assert_int_equal(f.set(grid), INSITU_OK);
    assert_int_equal(f.report.cells_linear, 1);
    for (int i = 0; i < 4; i++) assert_int_equal(read_integer(f.mesh().mesh.connectivity, i), i);
    assert_int_equal(f.mesh().mesh.connectivity_count, 4);
    assert_non_null(strstr(f.report.cells_why, "1 higher-order cells"));
}

/* Checks cells of higher order. If all cells have the same type and the same order, neither types nor offsets are
 * passed. If libinsitu does not support the last points of a cell type, the cells are copied without these points. */
void cells_of_higher_order_are_submitted(void **)
{
    const struct {
        int type, points, known, nodes;
    } cases[] = {{22, 6, 22, 6},   {23, 8, 23, 8},   {24, 10, 24, 10}, {25, 20, 25, 20}, {26, 15, 26, 15},
                 {27, 13, 27, 13}, {28, 9, 28, 9},   {29, 27, 29, 27}, {32, 18, 32, 18}, {33, 24, 25, 20},
                 {34, 7, 22, 6},   {37, 19, 74, 14}, {69, 10, 69, 10}, {70, 16, 70, 16}, {71, 20, 71, 20},
                 {72, 64, 72, 64}, {73, 40, 73, 40}, {74, 14, 74, 14}};
    for (const auto &c : cases) {
        std::vector<point> points;
        for (int i = 0; i < c.points; i++) points.push_back({0.1 * i, std::sin(i), std::cos(2 * i)});
        vtkNew<vtkUnstructuredGrid> grid;
        for (int i = 0; i < 3; i++) add_cell(grid, c.type, points);
        fixture f;
        assert_int_equal(f.set(grid), INSITU_OK);
        const insitu_mesh &mesh = f.mesh().mesh;
        const bool is_borrowed = c.type == c.known;
        assert_int_equal(f.report.cells_linear, 0);
        assert_true((f.report.bytes_copied == 0) == is_borrowed);
        assert_int_equal(mesh.connectivity_count, 3 * c.nodes);
        assert_true(is_borrowed ? mesh.cell_type == c.known && !mesh.offsets.data
                                : read_integer(mesh.cell_types, 2) == c.known);
        for (int i = 0; i < 3 * c.nodes; i++)
            assert_int_equal(read_integer(mesh.connectivity, i), i / c.nodes * c.points + i % c.nodes);
    }
}

void other_high_order_cells_are_drawn_as_linear_cells(void **)
{
    const struct {
        int type, points, linear;
    } cases[] = {{31, 12, 13}, {71, 14, 10}, {72, 18, 12}, {73, 21, 13}, {74, 30, 14},
                 {78, 10, 10}, {79, 27, 12}, {80, 18, 13}, {81, 14, 14}};
    const std::map<int, std::pair<const std::vector<point> *, double>> shapes = {
        {10, {&corner, 1.0 / 6}}, {12, {&cube, 1}}, {13, {&roof, 0.5}}, {14, {&pyramid, 1.0 / 3}}};
    for (const auto &c : cases) {
        const auto &[corners, volume] = shapes.at(c.linear);
        std::vector<point> points = *corners;
        points.resize(static_cast<size_t>(c.points), point{9, 9, 9}); // a position at which no corner is
        vtkNew<vtkUnstructuredGrid> grid;
        add_cell(grid, c.type, points);
        fixture f;
        assert_int_equal(f.set(grid), INSITU_OK);
        assert_int_equal(read_integer(f.mesh().mesh.cell_types, 0), c.linear);
        assert_true(std::fabs(compute_cell_volume(f.mesh().mesh, 0) - volume) < rounding);
        assert_int_equal(f.report.cells_linear, 1);
    }
}

/* Checks Lagrange quads of which one has degrees that differ between its axes: only that one is drawn by its corners.
 */
void degrees_of_lagrange_cells_are_judged_cell_by_cell(void **)
{
    vtkNew<vtkUnstructuredGrid> grid;
    vtkNew<vtkDoubleArray> degrees;
    degrees->SetNumberOfComponents(3);
    for (const auto &[i, j] : {std::pair{3, 3}, {1, 7}, {3, 3}}) {
        std::vector<point> points(16);
        for (size_t k = 0; k < 16; k++) points[k] = {0.1 * static_cast<double>(k), std::sin(k), 0};
        add_cell(grid, VTK_LAGRANGE_QUADRILATERAL, points);
        degrees->InsertNextTuple3(i, j, 0);
    }
    grid->GetCellData()->SetHigherOrderDegrees(degrees);
    fixture f;
    assert_int_equal(f.set(grid), INSITU_OK);
    assert_int_equal(f.report.cells_linear, 1);
    const int types[] = {INSITU_LAGRANGE_QUAD, INSITU_QUAD, INSITU_LAGRANGE_QUAD};
    for (int i = 0; i < 3; i++) assert_int_equal(read_integer(f.mesh().mesh.cell_types, i), types[i]);
}

void line_cells_are_skipped_with_their_values(void **)
{
    vtkNew<vtkUnstructuredGrid> grid;
    add_cell(grid, VTK_VERTEX, {{0, 0, 0}});
    add_cell(grid, VTK_TETRA, corner);
    add_cell(grid, VTK_LINE, {{0, 0, 0}, {1, 0, 0}});
    add_cell(grid, VTK_PYRAMID, pyramid);
    vtkNew<vtkDoubleArray> value;
    value->SetName("c");
    for (int i = 0; i < 4; i++) value->InsertNextValue(i);
    grid->GetCellData()->AddArray(value);
    fixture f;
    assert_int_equal(f.set(grid), INSITU_OK);
    assert_int_equal(f.report.cells, 2);
    assert_int_equal(f.report.cells_flat, 2);
    const auto *c = static_cast<const double *>(f.mesh().fields.at("c").values.data);
    assert_true(c[0] == 1 && c[1] == 3);
    assert_true(std::fabs(compute_cell_volume(f.mesh().mesh, 0) - 1.0 / 6) < rounding);
    assert_true(std::fabs(compute_cell_volume(f.mesh().mesh, 1) - 1.0 / 3) < rounding);
    assert_non_null(strstr(f.report.cells_why, "2 points and lines"));
}

/* Checks that triangles, quads and polygons are passed in place, that the vertices of pixels are reordered, and that
 * quadratic shells in a grid with polygons are reduced to their corners. */
void shells_are_submitted(void **)
{
    const std::vector<std::array<double, 3>> square = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
    for (const bool has_pixel : {false, true}) {
        vtkNew<vtkUnstructuredGrid> grid;
        add_cell(grid, VTK_TETRA, corner);
        add_cell(grid, VTK_TRIANGLE, {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}});
        add_cell(grid, VTK_QUAD, square);
        add_cell(grid, VTK_POLYGON, {{0, 0, 0}, {1, 0, 0}, {2, 1, 0}, {1, 2, 0}, {0, 1, 0}});
        if (has_pixel) add_cell(grid, VTK_PIXEL, {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}});
        if (has_pixel)
            add_cell(grid, VTK_QUADRATIC_TRIANGLE, {{0, 0, 0}, {2, 0, 0}, {0, 2, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}});
        fixture f;
        assert_int_equal(f.set(grid), INSITU_OK);
        const insitu_mesh &mesh = f.mesh().mesh;
        const int types[] = {INSITU_TET, INSITU_TRIANGLE, INSITU_QUAD, INSITU_POLYGON, INSITU_QUAD, INSITU_TRIANGLE};
        const int ends[] = {4, 7, 11, 16, 20, 23};
        assert_int_equal(mesh.cell_count, has_pixel ? 6 : 4);
        assert_true((f.report.bytes_copied > 0) == has_pixel);
        for (int i = 0; i < mesh.cell_count; i++) {
            assert_int_equal(read_integer(mesh.cell_types, i), types[i]);
            assert_int_equal(read_integer(mesh.offsets, i + 1), ends[i]);
        }
        if (!has_pixel) continue;
        const int64_t first = read_integer(mesh.connectivity, 16), turned[] = {0, 1, 3, 2};
        for (int i = 0; i < 4; i++) assert_int_equal(read_integer(mesh.connectivity, 16 + i), first + turned[i]);
        assert_int_equal(f.report.cells_linear, 1);
    }
}

void add_polyhedron(vtkUnstructuredGrid *grid)
{
    if (!grid->GetPoints()) {
        vtkNew<vtkPoints> p;
        grid->SetPoints(p);
    }
    vtkIdType ids[4];
    for (size_t i = 0; i < 4; i++) ids[i] = grid->GetPoints()->InsertNextPoint(corner[i].data());
    const vtkIdType faces[16] = {3, ids[0], ids[1], ids[2], 3, ids[0], ids[1], ids[3],
                                 3, ids[1], ids[2], ids[3], 3, ids[0], ids[2], ids[3]};
    grid->InsertNextCell(VTK_POLYHEDRON, 4, ids, 4, faces);
}

/* Checks two tets with a common triangle, given as polyhedra: they have 7 faces, one of which belongs to both. */
void polyhedra_share_their_faces(void **)
{
    vtkNew<vtkUnstructuredGrid> grid;
    add_polyhedron(grid);
    const vtkIdType top = grid->GetPoints()->InsertNextPoint(2, 2, 2);
    vtkIdType ids[4] = {1, 2, 3, top};
    const vtkIdType faces[16] = {3, 3, 2, 1, 3, 1, 2, top, 3, 2, 3, top, 3, 3, 1, top};
    grid->InsertNextCell(VTK_POLYHEDRON, 4, ids, 4, faces);
    fixture f;
    assert_int_equal(f.set(grid), INSITU_OK);
    const insitu_mesh &m = f.mesh().mesh;
    assert_int_equal(m.cell_count, 2);
    assert_int_equal(m.face_count, 7);
    assert_int_equal(m.connectivity_count, 8);
    std::set<int64_t> first, shared;
    for (int64_t i = 0; i < 4; i++) first.insert(read_integer(m.connectivity, i));
    for (int64_t i = 4; i < 8; i++)
        if (first.count(read_integer(m.connectivity, i))) shared.insert(read_integer(m.connectivity, i));
    assert_int_equal(shared.size(), 1);
    assert_true(list_face_points(m, *shared.begin()) == (std::vector<int64_t>{1, 2, 3}));
    assert_int_equal(f.report.bytes_copied, 2 + 3 * 8 + 8 * 8 + 8 * 8 + 21 * 8);
}

void polyhedra_without_faces_are_warned_about(void **)
{
    vtkNew<vtkUnstructuredGrid> grid;
    add_polyhedron(grid);
    add_cell(grid, VTK_TETRA, corner);
    grid->GetFaces()->SetValue(0, 5); /* one face more than the cell has */
    fixture f;
    assert_int_equal(f.set(grid), INSITU_OK);
    assert_int_equal(f.report.cells, 1);
    assert_int_equal(read_integer(f.mesh().mesh.connectivity, 0), 4);
    assert_non_null(strstr(f.report.cells_why, "1 cells of type 42"));
}

void ghost_flags_that_hide_are_submitted(void **)
{
    vtkNew<vtkUnstructuredGrid> grid;
    for (int i = 0; i < 4; i++) add_cell(grid, VTK_TETRA, corner);
    vtkNew<vtkUnsignedCharArray> ghosts;
    ghosts->SetName(vtkDataSetAttributes::GhostArrayName());
    for (const unsigned char flag : std::initializer_list<unsigned char>{0, 1, 32, 0}) ghosts->InsertNextValue(flag);
    grid->GetCellData()->AddArray(ghosts);
    fixture f;
    assert_int_equal(f.set(grid), INSITU_OK);
    assert_ptr_equal(f.mesh().mesh.ghosts.data, ghosts->GetPointer(0));
    assert_true(f.mesh().fields.empty());

    ghosts->SetValue(3, vtkDataSetAttributes::EXTERIORCELL);
    assert_int_equal(f.set(grid), INSITU_OK);
    const int64_t expected[4] = {0, 1, 1, 0};
    for (int i = 0; i < 4; i++) assert_int_equal(read_integer(f.mesh().mesh.ghosts, i), expected[i]);
    assert_int_equal(f.report.bytes_copied, 4);

    ghosts->Fill(vtkDataSetAttributes::LOWCONNECTIVITYCELL);
    assert_int_equal(f.set(grid), INSITU_OK);
    assert_null(f.mesh().mesh.ghosts.data);
}

/* Checks hidden cells: by a vtkGhostType array of 32 bits, by VisIt's array of ghost zones, and by both together. */
void ghost_flags_of_other_types_and_names_hide_cells_too(void **)
{
    const int own[4] = {0, vtkDataSetAttributes::DUPLICATECELL, 0, vtkDataSetAttributes::HIDDENCELL};
    const int zones[4] = {0, 0, 2, 1};
    for (const auto &[has_own, has_zones] : {std::pair{true, false}, {false, true}, {true, true}}) {
        vtkNew<vtkUnstructuredGrid> grid;
        vtkNew<vtkIntArray> first, second;
        first->SetName(vtkDataSetAttributes::GhostArrayName());
        second->SetName("avtGhostZones");
        for (int i = 0; i < 4; i++) {
            add_cell(grid, VTK_TETRA, corner);
            first->InsertNextValue(own[i]);
            second->InsertNextValue(zones[i]);
        }
        if (has_own) grid->GetCellData()->AddArray(first);
        if (has_zones) grid->GetCellData()->AddArray(second);
        fixture f;
        assert_int_equal(f.set(grid), INSITU_OK);
        assert_non_null(f.mesh().mesh.ghosts.data);
        for (int i = 0; i < 4; i++) {
            const bool is_hidden = (has_own && own[i] != 0) || (has_zones && zones[i] != 0);
            assert_int_equal(read_integer(f.mesh().mesh.ghosts, i) != 0, is_hidden);
        }
        assert_true(f.mesh().fields.empty());
    }
}

void ghost_flags_follow_skipped_cells(void **)
{
    vtkNew<vtkUnstructuredGrid> grid;
    add_cell(grid, VTK_TETRA, corner);
    add_cell(grid, VTK_LINE, {corner.begin(), corner.begin() + 2});
    add_cell(grid, VTK_HEXAGONAL_PRISM, make_prism_points(6));
    vtkNew<vtkUnsignedCharArray> ghosts;
    ghosts->SetName(vtkDataSetAttributes::GhostArrayName());
    for (const unsigned char flag : std::initializer_list<unsigned char>{0, 0, 1}) ghosts->InsertNextValue(flag);
    grid->GetCellData()->AddArray(ghosts);
    fixture f;
    assert_int_equal(f.set(grid), INSITU_OK);
    const int64_t expected[2] = {0, 1};
    assert_int_equal(f.mesh().mesh.cell_count, 2);
    for (int i = 0; i < 2; i++) assert_int_equal(read_integer(f.mesh().mesh.ghosts, i), expected[i]);
}

/* Returns the coordinate along an axis of the n-th vertex along that axis, for a lattice whose coordinates are not
 * given for each vertex. */
double compute_axis_coordinate(const insitu_lattice &l, int axis, int64_t n)
{
    const insitu_array &a = l.axes[axis];
    if (!a.data) return l.origin[axis] + l.spacing[axis] * static_cast<double>(l.first[axis] + n);
    return a.type == INSITU_FLOAT32 ? static_cast<double>(static_cast<const float *>(a.data)[n])
                                    : static_cast<const double *>(a.data)[n];
}

/* Checks grids of 3 × 4 × 5 points. */
void structured_grids_are_hexahedra(void **)
{
    vtkNew<vtkImageData> image;
    image->SetExtent(2, 4, -1, 2, 3, 7); // an extent that is a part of a larger grid
    image->SetOrigin(1, 2, 3);
    image->SetSpacing(0.5, 1, 2);
    vtkNew<vtkRectilinearGrid> rectilinear;
    rectilinear->SetDimensions(3, 4, 5);
    vtkNew<vtkDoubleArray> axes[3];
    const std::vector<double> places[3] = {{1, 1.5, 2}, {2, 3, 3.5, 5}, {3, 5, 6, 7, 11}};
    for (int a = 0; a < 3; a++)
        for (const double place : places[a]) axes[a]->InsertNextValue(place);
    rectilinear->SetXCoordinates(axes[0]);
    rectilinear->SetYCoordinates(axes[1]);
    rectilinear->SetZCoordinates(axes[2]);
    vtkNew<vtkStructuredGrid> curvilinear;
    curvilinear->SetDimensions(3, 4, 5);
    vtkNew<vtkPoints> points;
    for (int i = 0; i < 60; i++) {
        double at[3];
        image->GetPoint(i, at);
        points->InsertNextPoint(at);
    }
    curvilinear->SetPoints(points);
    for (vtkDataSet *data : {static_cast<vtkDataSet *>(image), static_cast<vtkDataSet *>(rectilinear),
                             static_cast<vtkDataSet *>(curvilinear)}) {
        vtkNew<vtkDoubleArray> values;
        values->SetName("f");
        values->SetNumberOfTuples(60);
        values->Fill(1);
        data->GetPointData()->AddArray(values);
        fixture f;
        assert_int_equal(f.set(data), INSITU_OK);
        const insitu_mesh &mesh = f.mesh().mesh;
        const insitu_lattice *lattice = mesh.lattice;
        assert_non_null(lattice);
        assert_true(mesh.cell_count == 24 && mesh.vertex_count == 60);
        assert_true(lattice->cells[0] == 2 && lattice->cells[1] == 3 && lattice->cells[2] == 4);
        for (vtkIdType i = 0; i < 60; i++) {
            double at[3];
            const int64_t index[3] = {i % 3, i / 3 % 4, i / 12};
            data->GetPoint(i, at);
            for (int a = 0; a < 3 && data != curvilinear.Get(); a++)
                assert_true(compute_axis_coordinate(*lattice, a, index[a]) == at[a]); // bitwise equal
        }
        assert_ptr_equal(f.mesh().fields.at("f").values.data, values->GetPointer(0));
        assert_int_equal(f.report.bytes_copied, 0);
        if (data == curvilinear.Get()) assert_ptr_equal(mesh.coordinates[0].data, points->GetVoidPointer(0));
    }
}

/* Checks images that are flat along an axis, images with a hidden point, and rotated images. Coordinates of points are
 * listed only for a rotated image. */
void flat_hidden_and_turned_images_are_lattices(void **)
{
    for (int flat = 0; flat < 3; flat++) {
        int d[3] = {3, 3, 3};
        d[flat] = 1;
        vtkNew<vtkImageData> image;
        image->SetDimensions(d);
        fixture f;
        assert_int_equal(f.set(image), INSITU_OK);
        const insitu_lattice *lattice = f.mesh().mesh.lattice;
        for (int a = 0; a < 3; a++) assert_int_equal(lattice->cells[a], a == flat ? 0 : 2);
        assert_int_equal(f.report.bytes_copied, 0);
        assert_int_equal(f.mesh().mesh.cell_count, 4);
    }
    vtkNew<vtkImageData> image;
    image->SetDimensions(3, 3, 3);
    vtkNew<vtkUnsignedCharArray> flags;
    flags->SetName(vtkDataSetAttributes::GhostArrayName());
    flags->SetNumberOfValues(27);
    for (vtkIdType i = 0; i < 27; i++) flags->SetValue(i, i == 14 ? vtkDataSetAttributes::HIDDENPOINT : 0);
    image->GetPointData()->AddArray(flags); // point (2, 1, 1): hides the four cells around it with i = 1
    fixture f;
    assert_int_equal(f.set(image), INSITU_OK);
    for (int i = 0; i < 8; i++) assert_int_equal(read_integer(f.mesh().mesh.ghosts, i) != 0, i % 2);
    assert_int_equal(f.report.bytes_copied, 8);
    image->GetPointData()->Initialize();
    image->SetDirectionMatrix(0, 1, 0, -1, 0, 0, 0, 0, 1);
    assert_int_equal(f.set(image), INSITU_OK);
    assert_int_equal(f.report.bytes_copied, 27 * 24);
    for (vtkIdType i = 0; i < 27; i++) {
        double at[3];
        image->GetPoint(i, at);
        assert_true(get_vertex(f.mesh().mesh, i) == (point{at[0], at[1], at[2]}));
    }
}

void polygons_are_shells(void **)
{
    vtkNew<vtkPolyData> data;
    vtkNew<vtkPoints> points;
    for (const std::array<double, 3> &at : cube) points->InsertNextPoint(at.data());
    vtkNew<vtkCellArray> lines, polygons;
    lines->InsertNextCell({0, 6});
    polygons->InsertNextCell({0, 1, 2});
    polygons->InsertNextCell({0, 1, 2, 3});
    polygons->InsertNextCell({0, 1, 5, 4, 3});
    data->SetPoints(points);
    data->SetLines(lines);
    data->SetPolys(polygons);
    fixture f;
    assert_int_equal(f.set(data), INSITU_OK);
    const insitu_mesh &mesh = f.mesh().mesh;
    const int types[] = {INSITU_TRIANGLE, INSITU_QUAD, INSITU_POLYGON};
    assert_int_equal(mesh.cell_count, 3);
    for (int i = 0; i < 3; i++) assert_int_equal(read_integer(mesh.cell_types, i), types[i]);
    assert_int_equal(f.report.cells_flat, 1);

    data->SetLines(nullptr); // then connectivity is passed in place, and only cell types are copied
    assert_int_equal(f.set(data), INSITU_OK);
    assert_int_equal(f.mesh().mesh.cell_count, 3);
    for (int i = 0; i < 3; i++) assert_int_equal(read_integer(f.mesh().mesh.cell_types, i), types[i]);
    const vtkDataArray *listed = polygons->GetConnectivityArray();
    assert_ptr_equal(f.mesh().mesh.connectivity.data, const_cast<vtkDataArray *>(listed)->GetVoidPointer(0));
    assert_ptr_equal(f.mesh().mesh.coordinates[0].data, points->GetVoidPointer(0));
    assert_int_equal(f.report.bytes_copied, 3);
}

void leaves_of_composites_are_meshes_until_removed(void **)
{
    vtkNew<vtkUnstructuredGrid> a, b;
    add_cell(a, VTK_TETRA, corner);
    add_cell(b, VTK_HEXAHEDRON, cube);
    vtkNew<vtkTable> table;
    vtkNew<vtkMultiBlockDataSet> inner, outer;
    inner->SetBlock(0, nullptr);
    inner->SetBlock(1, b);
    outer->SetBlock(0, a);
    outer->SetBlock(1, inner);
    outer->SetBlock(2, table);
    fixture f;
    assert_int_equal(f.set(outer), INSITU_OK);
    assert_int_equal(f.report.meshes, 2);
    assert_int_equal(f.session.meshes.size(), 2);
    assert_int_equal(f.mesh("m/0").mesh.cell_type, INSITU_TET);
    assert_int_equal(f.mesh("m/2").mesh.cell_type, INSITU_HEX);
    assert_non_null(strstr(f.report.warnings, "vtkTable"));

    outer->SetBlock(0, nullptr);
    assert_int_equal(f.set(outer), INSITU_OK);
    assert_int_equal(f.session.meshes.size(), 1);
    assert_int_equal(f.mesh("m/2").mesh.cell_type, INSITU_HEX);

    vtkNew<vtkPartitionedDataSet> partitions;
    partitions->SetPartition(0, a);
    partitions->SetPartition(1, b);
    vtkNew<vtkPartitionedDataSetCollection> collection;
    collection->SetPartitionedDataSet(0, partitions);
    assert_int_equal(f.set(collection), INSITU_OK);
    assert_int_equal(f.session.meshes.size(), 2);
    // this rank has no part of this partition; the other partition keeps its number
    partitions->SetPartition(0, nullptr);
    vtkNew<vtkPartitionedDataSet> images;
    vtkNew<vtkImageData> image;
    image->SetDimensions(2, 2, 2);
    images->SetPartition(0, image);
    collection->SetPartitionedDataSet(1, images);
    assert_int_equal(f.set(collection), INSITU_OK);
    assert_int_equal(f.session.meshes.size(), 2);
    assert_int_equal(f.mesh("m/1").mesh.cell_type, INSITU_HEX);
    assert_ptr_equal(f.mesh("m/1").mesh.coordinates[0].data, b->GetPoints()->GetVoidPointer(0));
    assert_int_equal(f.mesh("m/blocks[2]").mesh.vertex_count, 8);
    assert_int_equal(f.set(nullptr), INSITU_OK);
    assert_true(f.session.meshes.empty());
}

vtkSmartPointer<vtkImageData> make_image(const std::vector<const char *> &fields, int layers = 1)
{
    auto image = vtkSmartPointer<vtkImageData>::New();
    image->SetDimensions(3, 3, layers + 1);
    for (const char *name : fields) {
        vtkNew<vtkDoubleArray> values;
        values->SetName(name);
        values->SetNumberOfTuples(image->GetNumberOfPoints());
        values->Fill(0);
        image->GetPointData()->AddArray(values);
    }
    return image;
}

void structured_leaves_with_the_same_fields_are_blocks_of_one_mesh(void **)
{
    std::vector<const char *> many(40, "a field with a long name");
    std::vector<std::string> names(40);
    for (size_t i = 0; i < 40; i++) many[i] = (names[i] = "a field with a long name " + std::to_string(i)).c_str();
    const std::vector<const char *> fewer(many.begin(), many.end() - 1);
    vtkNew<vtkMultiBlockDataSet> blocks;
    const std::vector<vtkSmartPointer<vtkImageData>> leaves = {make_image({"b", "a"}), make_image({"a"}),
                                                               make_image({"a", "b"}), make_image({"a", "b"}, 0),
                                                               make_image(many),       make_image(fewer)};
    for (size_t i = 0; i < leaves.size(); i++) blocks->SetBlock(static_cast<unsigned>(i), leaves[i]);
    fixture f;
    assert_int_equal(f.set(blocks), INSITU_OK);
    assert_int_equal(f.report.meshes, 6);
    assert_int_equal(f.report.fields, 2 + 1 + 2 + 2 + 40 + 39);
    assert_int_equal(f.session.meshes.size(), 6);
    for (const char *name :
         {"m/blocks of a, b[0]", "m/blocks of a[1]", "m/blocks of a, b[2]", "m/flat blocks of a, b[3]"})
        assert_int_equal(f.session.meshes.count(name), 1);
    std::set<std::string> others;
    for (const auto &[name, mesh] : f.session.meshes)
        if (name.find("long name") != std::string::npos) others.insert(name.substr(0, name.find('[')));
    assert_int_equal(others.size(), 2);
    for (const std::string &name : others) assert_true(name.size() <= 255);
    blocks->SetBlock(2, nullptr);
    assert_int_equal(f.set(blocks), INSITU_OK);
    assert_int_equal(f.session.meshes.size(), 5);
    assert_int_equal(f.set(leaves[0]), INSITU_OK);
    assert_int_equal(f.session.meshes.size(), 1);
    assert_int_equal(f.session.meshes.count("m"), 1);
}

/* Checks leaves whose fields have the same name but another centring or another number of components: they cannot be
 * blocks of one mesh. */
void structured_leaves_with_other_fields_of_a_name_are_other_meshes(void **)
{
    const auto of_cells = make_image({}), of_vectors = make_image({});
    vtkNew<vtkDoubleArray> cells, vectors;
    cells->SetName("a");
    cells->SetNumberOfTuples(of_cells->GetNumberOfCells());
    of_cells->GetCellData()->AddArray(cells);
    vectors->SetName("a");
    vectors->SetNumberOfComponents(3);
    vectors->SetNumberOfTuples(of_vectors->GetNumberOfPoints());
    of_vectors->GetPointData()->AddArray(vectors);
    vtkNew<vtkMultiBlockDataSet> blocks;
    blocks->SetBlock(0, make_image({"a"}));
    blocks->SetBlock(1, of_cells);
    blocks->SetBlock(2, of_vectors);
    fixture f;
    assert_int_equal(f.set(blocks), INSITU_OK);
    assert_int_equal(f.session.meshes.size(), 3);
    for (const char *name : {"m/blocks of a[0]", "m/blocks of a (cells)[1]", "m/blocks of a (3 components)[2]"})
        assert_int_equal(f.session.meshes.count(name), 1);
}

void arrays_outlive_the_data_set(void **)
{
    fixture f;
    {
        vtkNew<vtkUnstructuredGrid> grid;
        add_cell(grid, VTK_HEXAHEDRON, cube);
        vtkNew<vtkFloatArray> value;
        value->SetName("a name that is long enough to be on the heap of the array");
        for (int i = 0; i < 8; i++) value->InsertNextValue(static_cast<float>(i));
        grid->GetPointData()->AddArray(value);
        assert_int_equal(f.set(grid), INSITU_OK);
    }
    for (size_t i = 0; i < 8; i++) assert_true(get_vertex(f.mesh().mesh, static_cast<int64_t>(i)) == cube[i]);
    const insitu_field &v = f.mesh().fields.begin()->second;
    for (int i = 0; i < 8; i++) assert_true(static_cast<const float *>(v.values.data)[i] == static_cast<float>(i));
}

void one_name_at_points_and_cells_warns(void **)
{
    vtkNew<vtkUnstructuredGrid> grid;
    add_cell(grid, VTK_TETRA, corner);
    vtkNew<vtkFloatArray> at_points, at_cells, wrong;
    at_points->SetName("t");
    at_points->SetNumberOfTuples(4);
    at_points->Fill(0);
    at_cells->SetName("t");
    at_cells->SetNumberOfTuples(1);
    at_cells->Fill(0);
    wrong->SetName("wrong");
    wrong->SetNumberOfTuples(3);
    wrong->Fill(0);
    grid->GetPointData()->AddArray(at_points);
    grid->GetPointData()->AddArray(wrong);
    grid->GetCellData()->AddArray(at_cells);
    fixture f;
    assert_int_equal(f.set(grid), INSITU_OK);
    assert_int_equal(f.mesh().fields.size(), 1);
    assert_int_equal(f.mesh().fields.at("t").centring, INSITU_VERTEX);
    assert_non_null(strstr(f.report.warnings, "'t' of the cells left out"));
    assert_non_null(strstr(f.report.warnings, "'wrong' has 3 tuples, expected 4"));
}

void malformed_data_is_refused(void **)
{
    vtkNew<vtkUnstructuredGrid> grid;
    vtkNew<vtkPoints> points;
    grid->SetPoints(points);
    vtkNew<vtkTypeInt64Array> offsets, connectivity;
    for (int64_t v : {0, 4, 9}) offsets->InsertNextValue(v);
    for (int64_t v : {0, 1, 2, 3, 0, 1, 2, 3}) connectivity->InsertNextValue(v);
    vtkNew<vtkCellArray> cells;
    cells->SetData(offsets, connectivity);
    vtkNew<vtkUnsignedCharArray> types;
    types->InsertNextValue(VTK_TETRA);
    types->InsertNextValue(VTK_TETRA);
    grid->SetCells(types, cells);
    fixture f;
    assert_int_equal(f.set(grid), INSITU_ERROR_MESH);
    assert_non_null(strstr(insitu_vtk_error(f.adaptor), "cell 1"));

    offsets->SetValue(2, 7);
    add_cell(grid, VTK_TETRA, corner);
    assert_int_equal(insitu_vtk_set(f.adaptor, "", grid, nullptr), INSITU_ERROR_ARGUMENT);
    assert_int_equal(insitu_vtk_set(nullptr, "m", grid, nullptr), INSITU_ERROR_ARGUMENT);
    vtkNew<vtkTable> table;
    assert_int_equal(f.set(table), INSITU_ERROR_ARGUMENT);
    assert_non_null(strstr(insitu_vtk_error(f.adaptor), "vtkTable"));
}

void empty_grid_submits_no_mesh(void **)
{
    vtkNew<vtkUnstructuredGrid> grid;
    fixture f;
    assert_int_equal(f.set(grid), INSITU_OK);
    assert_int_equal(f.report.meshes, 0);
    assert_true(f.session.meshes.empty());
}

void errors_of_the_session_are_passed_on(void **)
{
    vtkNew<vtkUnstructuredGrid> grid;
    add_cell(grid, VTK_TETRA, corner);
    vtkNew<vtkFloatArray> value;
    value->SetName("t");
    value->SetNumberOfTuples(4);
    value->Fill(0);
    grid->GetPointData()->AddArray(value);
    fixture f;
    f.session.next_field_status = INSITU_ERROR_FIELD;
    assert_int_equal(f.set(grid), INSITU_ERROR_FIELD);
    assert_string_equal(insitu_vtk_error(f.adaptor), "stub");
    f.session.next_mesh_status = INSITU_ERROR_MEMORY;
    assert_int_equal(f.set(grid), INSITU_ERROR_MEMORY);
    f.session.next_mesh_status = f.session.next_field_status = INSITU_OK;
    assert_int_equal(f.set(grid), INSITU_OK);
    assert_string_equal(insitu_vtk_error(f.adaptor), "");
}

} // namespace

int main()
{
    const CMUnitTest tests[] = {
        cmocka_unit_test(plain_grid_is_borrowed),
        cmocka_unit_test(one_type_of_32_bits_is_borrowed_without_types),
        cmocka_unit_test(separate_components_are_borrowed),
        cmocka_unit_test(other_value_types_are_copied_and_declared),
        cmocka_unit_test(integer_points_become_doubles),
        cmocka_unit_test(voxel_becomes_a_right_handed_hexahedron),
        cmocka_unit_test(prisms_are_polyhedra_of_their_faces),
        cmocka_unit_test(bezier_cells_are_drawn_as_linear_cells_with_a_warning),
        cmocka_unit_test(cells_of_higher_order_are_submitted),
        cmocka_unit_test(degrees_of_lagrange_cells_are_judged_cell_by_cell),
        cmocka_unit_test(other_high_order_cells_are_drawn_as_linear_cells),
        cmocka_unit_test(line_cells_are_skipped_with_their_values),
        cmocka_unit_test(shells_are_submitted),
        cmocka_unit_test(polyhedra_share_their_faces),
        cmocka_unit_test(polyhedra_without_faces_are_warned_about),
        cmocka_unit_test(ghost_flags_that_hide_are_submitted),
        cmocka_unit_test(ghost_flags_of_other_types_and_names_hide_cells_too),
        cmocka_unit_test(ghost_flags_follow_skipped_cells),
        cmocka_unit_test(flat_hidden_and_turned_images_are_lattices),
        cmocka_unit_test(structured_grids_are_hexahedra),
        cmocka_unit_test(polygons_are_shells),
        cmocka_unit_test(leaves_of_composites_are_meshes_until_removed),
        cmocka_unit_test(structured_leaves_with_the_same_fields_are_blocks_of_one_mesh),
        cmocka_unit_test(structured_leaves_with_other_fields_of_a_name_are_other_meshes),
        cmocka_unit_test(arrays_outlive_the_data_set),
        cmocka_unit_test(one_name_at_points_and_cells_warns),
        cmocka_unit_test(malformed_data_is_refused),
        cmocka_unit_test(empty_grid_submits_no_mesh),
        cmocka_unit_test(errors_of_the_session_are_passed_on),
    };
    return cmocka_run_group_tests(tests, nullptr, nullptr);
}
