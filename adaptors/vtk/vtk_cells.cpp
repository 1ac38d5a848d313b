/* For each VTK cell type that libinsitu draws, a table (cell_conversion) contains the linear cell that represents it,
 * and which points of VTK's cell are the vertices of the linear cell. If all cells of a grid have types that libinsitu
 * reads directly (tets, hexes, wedges, pyramids), VTK's arrays are used unchanged. If a single cell has another type,
 * all cells are copied to a new list.
 *
 * A voxel differs from a hexahedron only in the order of its points. Polyhedra and prisms of five and six sides
 * become libinsitu's polyhedra, with a list of their faces (vtk_faces.h). Quadratic and Lagrange cells are cell
 * types of libinsitu too. In other cells of higher order, the first points are the corners, in the order of the
 * linear cell. */
#include "vtk_cells.h"

#include "insitu/vtk_grids.h"
#include "vtk_faces.h"

#include <array>

#include <vtkCellArray.h>
#include <vtkCellData.h>
#include <vtkCellTypes.h>
#include <vtkDataArray.h>
#include <vtkUnsignedCharArray.h>
#include <vtkUnstructuredGrid.h>

namespace insitu_vtk
{

namespace
{

enum class conversion_kind { not_drawn, flat, as_it_is, polygon, reordered, faces, linear, higher };

struct linear_cell {
    uint8_t type;
    uint8_t vertex_count;            /* number of vertices; 0: all points of the cell are vertices */
    std::array<uint8_t, 8> vertices; // indices into the cell's points
};

struct cell_conversion {
    conversion_kind kind = conversion_kind::not_drawn;
    int needed_points = 0;
    int linear_cell_count = 0;
    linear_cell replacement{};
};

constexpr linear_cell tet = {INSITU_TET, 4, {0, 1, 2, 3}};
constexpr linear_cell hex = {INSITU_HEX, 8, {0, 1, 2, 3, 4, 5, 6, 7}};
constexpr linear_cell wedge = {INSITU_WEDGE, 6, {0, 1, 2, 3, 4, 5}};
constexpr linear_cell pyramid = {INSITU_PYRAMID, 5, {0, 1, 2, 3, 4}};
constexpr linear_cell voxel = {INSITU_HEX, 8, {0, 1, 3, 2, 4, 5, 7, 6}};
constexpr linear_cell triangle = {INSITU_TRIANGLE, 3, {0, 1, 2}};
constexpr linear_cell quad = {INSITU_QUAD, 4, {0, 1, 2, 3}};
constexpr linear_cell pixel = {INSITU_QUAD, 4, {0, 1, 3, 2}};

using conversion_table = std::array<cell_conversion, 256>;

void add(conversion_table &table, conversion_kind kind, const linear_cell &of, std::initializer_list<int> types)
{
    for (const int type : types) table[static_cast<size_t>(type)] = {kind, of.vertex_count, 1, of};
}

conversion_table make_conversions()
{
    conversion_table table;
    add(table, conversion_kind::as_it_is, tet, {VTK_TETRA});
    add(table, conversion_kind::as_it_is, hex, {VTK_HEXAHEDRON});
    add(table, conversion_kind::as_it_is, wedge, {VTK_WEDGE});
    add(table, conversion_kind::as_it_is, pyramid, {VTK_PYRAMID});
    add(table, conversion_kind::as_it_is, triangle, {VTK_TRIANGLE});
    add(table, conversion_kind::as_it_is, quad, {VTK_QUAD});
    add(table, conversion_kind::reordered, voxel, {VTK_VOXEL});
    add(table, conversion_kind::reordered, pixel, {VTK_PIXEL});
    add(table, conversion_kind::linear, tet, {VTK_QUADRATIC_TETRA, VTK_LAGRANGE_TETRAHEDRON, VTK_BEZIER_TETRAHEDRON});
    add(table, conversion_kind::linear, hex,
        {VTK_QUADRATIC_HEXAHEDRON, VTK_TRIQUADRATIC_HEXAHEDRON, VTK_BIQUADRATIC_QUADRATIC_HEXAHEDRON,
         VTK_LAGRANGE_HEXAHEDRON, VTK_BEZIER_HEXAHEDRON});
    add(table, conversion_kind::linear, wedge,
        {VTK_QUADRATIC_WEDGE, VTK_QUADRATIC_LINEAR_WEDGE, VTK_BIQUADRATIC_QUADRATIC_WEDGE, VTK_LAGRANGE_WEDGE,
         VTK_BEZIER_WEDGE});
    add(table, conversion_kind::linear, pyramid,
        {VTK_QUADRATIC_PYRAMID, VTK_TRIQUADRATIC_PYRAMID, VTK_LAGRANGE_PYRAMID, VTK_BEZIER_PYRAMID});
    add(table, conversion_kind::linear, triangle,
        {VTK_QUADRATIC_TRIANGLE, VTK_BIQUADRATIC_TRIANGLE, VTK_LAGRANGE_TRIANGLE, VTK_BEZIER_TRIANGLE});
    add(table, conversion_kind::linear, quad,
        {VTK_QUADRATIC_QUAD, VTK_BIQUADRATIC_QUAD, VTK_QUADRATIC_LINEAR_QUAD, VTK_LAGRANGE_QUADRILATERAL,
         VTK_BEZIER_QUADRILATERAL});
    table[VTK_POLYGON] = {conversion_kind::polygon, 3, 1, {INSITU_POLYGON, 0, {}}};
    table[VTK_POLYHEDRON] = {conversion_kind::faces, 4, 0, linear_cell{}};
    table[VTK_PENTAGONAL_PRISM] = {conversion_kind::faces, 10, 0, linear_cell{}};
    table[VTK_HEXAGONAL_PRISM] = {conversion_kind::faces, 12, 0, linear_cell{}};
    for (const int type :
         {VTK_EMPTY_CELL, VTK_VERTEX, VTK_POLY_VERTEX, VTK_LINE, VTK_POLY_LINE, VTK_QUADRATIC_EDGE, VTK_CUBIC_LINE,
          VTK_PARAMETRIC_CURVE, VTK_HIGHER_ORDER_EDGE, VTK_LAGRANGE_CURVE, VTK_BEZIER_CURVE})
        table[static_cast<size_t>(type)].kind = conversion_kind::flat;
    return table;
}

const conversion_table &cell_conversions()
{
    static const conversion_table table = make_conversions();
    return table;
}

/* Makes the table of the cells of higher order: libinsitu's type, and the number of leading points that cells of this
 * type use. Further points, on faces and inside the cell, are left out. */
conversion_table make_higher_conversions()
{
    conversion_table table;
    const struct {
        int type, known;
        uint8_t count;
    } cells[] = {{VTK_QUADRATIC_TRIANGLE, INSITU_QUADRATIC_TRIANGLE, 6},
                 {VTK_QUADRATIC_QUAD, INSITU_QUADRATIC_QUAD, 8},
                 {VTK_QUADRATIC_TETRA, INSITU_QUADRATIC_TET, 10},
                 {VTK_QUADRATIC_HEXAHEDRON, INSITU_QUADRATIC_HEX, 20},
                 {VTK_QUADRATIC_WEDGE, INSITU_QUADRATIC_WEDGE, 15},
                 {VTK_QUADRATIC_PYRAMID, INSITU_QUADRATIC_PYRAMID, 13},
                 {VTK_BIQUADRATIC_QUAD, INSITU_BIQUADRATIC_QUAD, 9},
                 {VTK_TRIQUADRATIC_HEXAHEDRON, INSITU_TRIQUADRATIC_HEX, 27},
                 {VTK_BIQUADRATIC_QUADRATIC_WEDGE, INSITU_BIQUADRATIC_WEDGE, 18},
                 {VTK_BIQUADRATIC_QUADRATIC_HEXAHEDRON, INSITU_QUADRATIC_HEX, 20},
                 {VTK_BIQUADRATIC_TRIANGLE, INSITU_QUADRATIC_TRIANGLE, 6},
                 {VTK_TRIQUADRATIC_PYRAMID, INSITU_LAGRANGE_PYRAMID, 14}};
    for (const auto &c : cells)
        table[static_cast<size_t>(c.type)] = {
            conversion_kind::higher, c.count, 1, {static_cast<uint8_t>(c.known), c.count, {}}};
    for (int type = VTK_LAGRANGE_TRIANGLE; type <= VTK_LAGRANGE_PYRAMID; type++)
        table[static_cast<size_t>(type)] = {conversion_kind::higher, 3, 1, {static_cast<uint8_t>(type), 0, {}}};
    return table;
}

const cell_conversion &get_higher_order_conversion(uint8_t type)
{
    static const conversion_table table = make_higher_conversions();
    return table[type];
}

/* Returns whether libinsitu can draw a Lagrange cell with this number of points as it is: the number must be that of a
 * cell with the same order, 1 to 32, along all axes; for pyramids, the order must be 1 or 2. */
bool is_complete(int type, int64_t points)
{
    for (int64_t p = 1; p <= 32; p++) {
        const int64_t n = p + 1, square = n * n, half = n * (p + 2) / 2;
        const int64_t counts[] = {half,       square,   half * (p + 3) / 3,
                                  square * n, half * n, n * (p + 2) * (2 * p + 3) / 6};
        if (counts[type - VTK_LAGRANGE_TRIANGLE] == points) return type != VTK_LAGRANGE_PYRAMID || p <= 2;
    }
    return false;
}

/* The cell arrays of one VTK grid. offsets[i] is the index of the first point of cell i in `connectivity`. */
template <typename Id> struct raw_cells {
    const uint8_t *types;
    const Id *offsets;
    const Id *connectivity;
    int64_t count;
    bool are_higher_known;       /* true if cells of higher order are passed as they are. It is false if the grid also
                                    contains polyhedra or polygons, or if the caller chose to draw by corners. */
    std::vector<bool> is_uneven; /* whether the order of each cell differs between axes; empty if no cell's does */

    const cell_conversion &conversion_of(int64_t cell) const
    {
        const cell_conversion &higher = get_higher_order_conversion(types[cell]);
        const bool is_lagrange = types[cell] >= VTK_LAGRANGE_TRIANGLE && types[cell] <= VTK_LAGRANGE_PYRAMID;
        const bool has_one_order = is_uneven.empty() || !is_uneven[static_cast<size_t>(cell)];
        if (higher.kind != conversion_kind::higher || !are_higher_known || size(cell) < higher.needed_points ||
            (is_lagrange && !(has_one_order && is_complete(types[cell], size(cell)))))
            return cell_conversions()[types[cell]];
        return higher;
    }
    /* Returns whether the cell is read from VTK's own connectivity without conversion. */
    bool is_read_directly(int64_t cell, const cell_conversion &r) const
    {
        if (r.kind == conversion_kind::polygon) return size(cell) >= r.needed_points;
        if (r.kind == conversion_kind::higher && r.replacement.type != types[cell]) return false;
        return r.kind == conversion_kind::higher || r.kind == conversion_kind::as_it_is
                   ? size(cell) == passed_point_count(cell, r)
                   : false;
    }
    int64_t size(int64_t cell) const { return static_cast<int64_t>(offsets[cell + 1] - offsets[cell]); }
    /* Returns the number of the cell's points that are passed to libinsitu. */
    int64_t passed_point_count(int64_t cell, const cell_conversion &r) const
    {
        return r.kind == conversion_kind::polygon || !r.replacement.vertex_count ? size(cell)
                                                                                 : r.replacement.vertex_count;
    }
};

/* The sizes of the lists of cells to which VTK's list is converted. is_one_to_one: true if every cell of the new list
 * has the index that it has in VTK's list. */
struct new_size {
    int64_t cells = 0;
    int64_t vertices = 0;
    bool is_one_to_one = true;
};

/* The cells that are converted to polyhedra, in VTK's order. has_faces[i] is true if VTK's cell i is such a cell and
 * all its faces are valid. */
struct cells_with_faces {
    face_list faces;
    std::vector<bool> has_faces;
};

template <typename Id>
void read_faces(vtkUnstructuredGrid *grid, const raw_cells<Id> &raw, cells_with_faces &with_faces)
{
    for (int64_t i = 0; i < raw.count; i++) {
        const cell_conversion &r = cell_conversions()[raw.types[i]];
        if (r.kind != conversion_kind::faces || raw.size(i) < r.needed_points) continue;
        if (with_faces.has_faces.empty()) with_faces.has_faces.resize(static_cast<size_t>(raw.count));
        const std::vector<int64_t> points(raw.connectivity + raw.offsets[i], raw.connectivity + raw.offsets[i + 1]);
        with_faces.has_faces[static_cast<size_t>(i)] = with_faces.faces.add_cell(grid, i, raw.types[i], points.data());
    }
}

template <typename Id>
new_size count_converted_cells(const raw_cells<Id> &raw, const cells_with_faces &with_faces, cell_counts &counts)
{
    new_size size;
    size_t number = 0;
    for (int64_t i = 0; i < raw.count; i++) {
        const cell_conversion &r = raw.conversion_of(i);
        const bool is_faced = !with_faces.has_faces.empty() && with_faces.has_faces[static_cast<size_t>(i)];
        const bool is_drawn = is_faced || (r.linear_cell_count > 0 && raw.size(i) >= r.needed_points);
        if (r.kind == conversion_kind::flat)
            counts.flat++;
        else if (!is_drawn)
            counts.not_drawn++, counts.left_out[raw.types[i]]++;
        if (is_drawn && r.kind == conversion_kind::linear) counts.linear++;
        if (!is_drawn) size.is_one_to_one = false;
        if (!is_drawn) continue;
        size.cells++;
        size.vertices += is_faced ? with_faces.faces.cell_size(number++) : raw.passed_point_count(i, r);
    }
    return size;
}

template <typename Id>
void fill_converted_cells(const raw_cells<Id> &raw, const cells_with_faces &with_faces, uint8_t *types,
                          int64_t *offsets, Id *connectivity, std::vector<int64_t> *source)
{
    int64_t at = 0;
    size_t number = 0;
    for (int64_t i = 0; i < raw.count; i++) {
        const cell_conversion &r = raw.conversion_of(i);
        const bool is_faced = !with_faces.has_faces.empty() && with_faces.has_faces[static_cast<size_t>(i)];
        if (!is_faced && (r.linear_cell_count == 0 || raw.size(i) < r.needed_points)) continue;
        *types++ = is_faced ? static_cast<uint8_t>(INSITU_POLYHEDRON) : r.replacement.type;
        *offsets++ = at;
        if (source) source->push_back(i);
        if (is_faced) {
            const int64_t *faces = with_faces.faces.cell_faces(number), count = with_faces.faces.cell_size(number);
            for (int64_t k = 0; k < count; k++) connectivity[at++] = static_cast<Id>(faces[k]);
            number++;
            continue;
        }
        for (int64_t v = 0; v < raw.passed_point_count(i, r); v++) {
            const int64_t point = r.kind == conversion_kind::polygon || r.kind == conversion_kind::higher
                                      ? v
                                      : r.replacement.vertices[static_cast<size_t>(v)];
            connectivity[at++] = raw.connectivity[raw.offsets[i] + point];
        }
    }
    *offsets = at;
}

/* Returns a list of the conversions that the cells of these types need, for example "voxels reordered, faces of
 * polyhedra shared". */
std::string find_conversion_reason(const std::array<int64_t, 256> &by_type)
{
    const char *const reasons[] = {"some cells not drawn",
                                   "points and lines left out",
                                   "",
                                   "",
                                   "voxels and pixels reordered",
                                   "faces of polyhedra and prisms shared",
                                   "cells of higher order by the nodes that are known"};
    std::array<bool, 7> has{};
    for (size_t type = 0; type < 256; type++)
        if (by_type[type] > 0) has[static_cast<size_t>(cell_conversions()[type].kind)] = true;
    std::string why;
    for (size_t k = 0; k < has.size(); k++)
        if (has[k] && reasons[k][0]) why += (why.empty() ? "" : ", ") + std::string(reasons[k]);
    return why.empty() ? "cells with too few points left out" : why;
}

template <typename Id>
void convert_cells(vtkUnstructuredGrid *grid, const raw_cells<Id> &raw, const std::string &why, const cells_view &view)
{
    held_arrays &held = view.held;
    insitu_mesh &mesh = view.mesh;
    cell_list &cells = view.cells;
    cells_with_faces with_faces;
    read_faces(grid, raw, with_faces);
    const new_size size = count_converted_cells(raw, with_faces, view.counts);
    cells.count = size.cells;
    cells.is_one_to_one = size.is_one_to_one;
    if (!cells.is_one_to_one) cells.source.reserve(static_cast<size_t>(size.cells));
    if (size.cells == 0) return;

    auto *types = reinterpret_cast<uint8_t *>(held.allocate(static_cast<size_t>(size.cells)));
    auto *offsets = reinterpret_cast<int64_t *>(held.allocate(static_cast<size_t>(size.cells + 1) * 8));
    auto *connectivity = reinterpret_cast<Id *>(held.allocate(static_cast<size_t>(size.vertices) * sizeof(Id)));
    fill_converted_cells(raw, with_faces, types, offsets, connectivity, cells.is_one_to_one ? nullptr : &cells.source);

    mesh.cell_count = size.cells;
    mesh.cell_types = {types, INSITU_UINT8, 0};
    mesh.offsets = {offsets, INSITU_INT64, 0};
    mesh.connectivity = {connectivity, sizeof(Id) == 4 ? INSITU_INT32 : INSITU_INT64, 0};
    mesh.connectivity_count = size.vertices;
    const int64_t face_bytes = with_faces.has_faces.empty() ? 0 : with_faces.faces.copy_to_mesh(held, mesh);
    view.log.copied(view.grid_name + " cells", why,
                    size.cells + (size.cells + 1) * 8 + size.vertices * static_cast<int64_t>(sizeof(Id)) + face_bytes);
}

/* Borrows VTK's arrays; all cells must have types that libinsitu reads directly. If all have the same type and size,
 * types and offsets are not needed. */
template <typename Id>
void borrow_cells(vtkUnstructuredGrid *grid, const raw_cells<Id> &raw, const std::array<int64_t, 256> &by_type,
                  int64_t connectivity_count, const cells_view &view)
{
    held_arrays &held = view.held;
    conversion_log &log = view.log;
    insitu_mesh &mesh = view.mesh;
    const auto id_type = sizeof(Id) == 4 ? INSITU_INT32 : INSITU_INT64;
    held.objects.emplace_back(grid->GetCells());
    mesh.cell_count = raw.count;
    mesh.connectivity = {raw.connectivity, id_type, 0};
    mesh.connectivity_count = connectivity_count;
    log.bytes_borrowed += connectivity_count * static_cast<int64_t>(sizeof(Id));
    const cell_conversion &first = raw.conversion_of(0);
    if (first.kind != conversion_kind::polygon && by_type[raw.types[0]] == raw.count &&
        grid->GetCells()->IsHomogeneous() == raw.passed_point_count(0, first)) {
        mesh.cell_type = static_cast<insitu_cell_type>(raw.types[0]);
        return;
    }
    held.objects.emplace_back(grid->GetCellTypesArray());
    mesh.cell_types = {raw.types, INSITU_UINT8, 0};
    mesh.offsets = {raw.offsets, id_type, 0};
    log.bytes_borrowed += raw.count + (raw.count + 1) * static_cast<int64_t>(sizeof(Id));
}

/* Returns whether cells of the type (polygons and polyhedra) cannot be in one mesh with cells of higher order. */
bool excludes_higher_order(uint8_t type)
{
    const conversion_kind what = cell_conversions()[type].kind;
    return what == conversion_kind::polygon || what == conversion_kind::faces;
}

/* Returns for each cell whether its order differs between axes, or an empty list if no cell's does. */
std::vector<bool> find_uneven_cells(vtkUnstructuredGrid *grid)
{
    std::vector<bool> is_uneven;
    vtkDataArray *degrees = grid->GetCellData()->GetHigherOrderDegrees();
    const vtkIdType count = grid->GetNumberOfCells();
    if (!degrees || degrees->GetNumberOfComponents() != 3 || degrees->GetNumberOfTuples() != count) return is_uneven;
    for (vtkIdType i = 0; i < count; i++) {
        const double *of = degrees->GetTuple3(i);
        if (of[0] == of[1] && (of[2] == of[0] || of[2] == 0)) continue;
        is_uneven.resize(static_cast<size_t>(count));
        is_uneven[static_cast<size_t>(i)] = true;
    }
    return is_uneven;
}

template <typename Array>
bool borrow_or_convert_cells(vtkUnstructuredGrid *grid, Array *offsets, Array *connectivity, const cells_view &view,
                             std::string &error)
{
    using id = typename Array::ValueType;
    raw_cells<id> raw = {grid->GetCellTypesArray()->GetPointer(0),
                         offsets->GetPointer(0),
                         connectivity->GetPointer(0),
                         grid->GetNumberOfCells(),
                         !view.are_higher_by_corners,
                         find_uneven_cells(grid)};
    const int64_t connectivity_count = connectivity->GetNumberOfValues();
    std::array<int64_t, 256> by_type{};
    bool are_read_directly = true;
    for (int64_t i = 0; i < raw.count; i++) {
        by_type[raw.types[i]]++;
        if (raw.offsets[i] < 0 || raw.offsets[i] > raw.offsets[i + 1] || raw.offsets[i + 1] > connectivity_count) {
            error = view.grid_name + ": cell " + std::to_string(i) + ": offsets " + std::to_string(raw.offsets[i]) +
                    ", " + std::to_string(raw.offsets[i + 1]) + " are not within the connectivity's " +
                    std::to_string(connectivity_count) + " entries";
            return false;
        }
        raw.are_higher_known = raw.are_higher_known && !excludes_higher_order(raw.types[i]);
    }
    for (int64_t i = 0; i < raw.count; i++)
        are_read_directly = are_read_directly && raw.is_read_directly(i, raw.conversion_of(i));
    if (are_read_directly) {
        view.cells.count = raw.count;
        borrow_cells(grid, raw, by_type, connectivity_count, view);
    } else {
        convert_cells(grid, raw, find_conversion_reason(by_type), view);
    }
    return true;
}

} // namespace

bool view_cells(vtkUnstructuredGrid *grid, const cells_view &view, std::string &error)
{
    vtkCellArray *array = grid->GetCells();
    vtkUnsignedCharArray *types = grid->GetCellTypesArray();
    if (!array || array->GetNumberOfCells() == 0) return true;
    if (!types || types->GetNumberOfValues() != array->GetNumberOfCells()) {
        error = view.grid_name + ": " + std::to_string(array->GetNumberOfCells()) + " cells but " +
                std::to_string(types ? types->GetNumberOfValues() : 0) + " cell types";
        return false;
    }
    if (array->IsStorage64Bit())
        return borrow_or_convert_cells(grid, array->GetOffsetsArray64(), array->GetConnectivityArray64(), view, error);
    return borrow_or_convert_cells(grid, array->GetOffsetsArray32(), array->GetConnectivityArray32(), view, error);
}

void log_cells(const cell_counts &counts, const std::string &what, conversion_log &log)
{
    if (counts.linear > 0)
        log.note_cells(what + ": " + std::to_string(counts.linear) +
                       " higher-order cells drawn by their corners as linear ones");
    for (const auto &[type, number] : counts.left_out) {
        const char *why =
            cell_conversions()[static_cast<size_t>(type)].needed_points > 0 ? " with too few points or faces" : "";
        log.note_cells(what + ": " + std::to_string(number) + " cells of type " + std::to_string(type) + " (" +
                       vtkCellTypes::GetClassNameFromTypeId(type) + ")" + why + " are not drawn");
    }
    if (counts.flat > 0) log.note_cells(what + ": " + std::to_string(counts.flat) + " points and lines are not drawn");
}

} // namespace insitu_vtk

bool insitu_vtk_has_polygons_or_polyhedra(vtkUnstructuredGrid *grid)
{
    vtkUnsignedCharArray *types = grid->GetCellTypesArray();
    const vtkIdType count = types ? types->GetNumberOfValues() : 0;
    bool is_found = false;
    for (vtkIdType i = 0; i < count && !is_found; i++) is_found = insitu_vtk::excludes_higher_order(types->GetValue(i));
    return is_found;
}
