/* The public functions of the VTK adaptor. They determine which meshes a data object contains, which arrays these use,
 * and how long the arrays must live. A session reads borrowed arrays during a step. Therefore a mesh_part keeps
 * everything that one mesh uses: references to VTK's arrays, and converted arrays. A mesh_part is kept until a new mesh
 * of the same name has been set on the session, or the mesh has been removed. */
#include "insitu/vtk.h"

#include <exception>
#include <functional>
#include <map>
#include <memory>
#include <new>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <vtkCellArray.h>
#include <vtkCellData.h>
#include <vtkCompositeDataIterator.h>
#include <vtkCompositeDataSet.h>
#include <vtkDataSet.h>
#include <vtkOverlappingAMR.h>
#include <vtkPointData.h>
#include <vtkPointSet.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>
#include <vtkUniformGridAMRDataIterator.h>
#include <vtkUnsignedCharArray.h>
#include <vtkUnstructuredGrid.h>

#include "insitu/vtk_grids.h"
#include "vtk_amr.h"
#include "vtk_arrays.h"
#include "vtk_cells.h"
#include "vtk_lattices.h"

using namespace insitu_vtk;

namespace
{

/* One mesh as it is set on the session, with the memory that it uses. The names of the fields belong to VTK's arrays;
 * the session copies them. */
struct mesh_part {
    held_arrays held;
    insitu_mesh mesh;
    std::unique_ptr<insitu_lattice> lattice; // the lattice to which mesh.lattice points, if the data set is structured
    std::vector<insitu_field> fields;
};

/* The key of a mesh_part: the name of the mesh, and the number of the block or whole_mesh. */
using part_key = std::pair<std::string, int64_t>;
using part_map = std::map<part_key, mesh_part>;
constexpr int64_t whole_mesh = -1;

/* An error as an exception within the adaptor. The C functions convert it to a status and a message. */
struct failure {
    insitu_status status;
    std::string message;
};

/* The results of one insitu_vtk_set(), summed over all leaves of the data set. */
struct set_result {
    conversion_log log;
    cell_counts cells;
    int64_t cells_set = 0;
    int meshes = 0;
    int fields = 0;
    std::set<part_key> keys; // keys of the parts that were set
};

} // namespace

struct insitu_vtk_adaptor {
    insitu_session *session = nullptr;
    std::map<std::string, part_map> parts; // mesh parts, by the name given to insitu_vtk_set()
    std::set<std::string> by_corners;      // meshes whose cells of higher order are drawn by their corners
    std::string error, copied_why, cells_why, warnings;
};

namespace
{

constexpr size_t longest_list =
    160; /* largest length in bytes of the list of field names in a mesh's name, which may have at most 255 bytes */

constexpr unsigned char hiding_bits =
    vtkDataSetAttributes::DUPLICATECELL | vtkDataSetAttributes::HIDDENCELL | vtkDataSetAttributes::REFINEDCELL;

/* Sets the mesh's ghost flags. VTK's flags have bits that hide a cell and bits that only describe it. If VTK's array
 * contains only hiding bits, the mesh borrows it. If no cell is hidden, the mesh gets no ghost flags. */
void set_ghosts(vtkDataSet *grid, const vtkSmartPointer<vtkUnsignedCharArray> &ghosts, const cell_list &cells,
                const std::string &what, conversion_log &log, mesh_part &p)
{
    if (!ghosts) return;
    const unsigned char *flags = ghosts->GetPointer(0);
    const vtkIdType flag_count = ghosts->GetNumberOfValues();
    unsigned all = 0;
    for (vtkIdType i = 0; i < flag_count; i++) all |= flags[i];
    if ((all & hiding_bits) == 0) return;
    if (cells.is_one_to_one && (all & ~static_cast<unsigned>(hiding_bits)) == 0) {
        p.held.objects.emplace_back(ghosts);
        p.mesh.ghosts = {flags, INSITU_UINT8, 0};
        if (ghosts == grid->GetCellGhostArray())
            log.bytes_borrowed += cells.count;
        else
            log.copied(what + " ghosts", "flags that are no bytes of VTK's", cells.count);
        return;
    }
    auto *copy = reinterpret_cast<unsigned char *>(p.held.allocate(static_cast<size_t>(cells.count)));
    for (int64_t i = 0; i < cells.count; i++) {
        const int64_t from = cells.is_one_to_one ? i : cells.source[static_cast<size_t>(i)];
        copy[i] = (flags[from] & hiding_bits) != 0;
    }
    p.mesh.ghosts = {copy, INSITU_UINT8, 0};
    log.copied(what + " ghosts", "flags that hide a cell picked out", cells.count);
}

void add_field(const char *name, insitu_centring centring, const array_view &view, mesh_part &p)
{
    insitu_field field;
    insitu_field_defaults(&field);
    field.name = name;
    field.centring = centring;
    field.count = view.tuple_count;
    field.component_count = view.component_count;
    field.component_stride_bytes = view.component_stride_bytes;
    field.values = {view.data, view.type, view.tuple_stride_bytes};
    p.fields.push_back(field);
}

bool has_field(const mesh_part &p, const std::string &name)
{
    for (const insitu_field &field : p.fields)
        if (name == field.name) return true;
    return false;
}

/* Checks whether an array becomes a field: it must be numeric, have a name and the right length, and not be VTK's ghost
 * flags. */
bool is_field(vtkDataArray *array, vtkIdType expected, const std::string &what, conversion_log &log)
{
    const std::string name = array && array->GetName() ? array->GetName() : "";
    if (name.empty() || name == vtkDataSetAttributes::GhostArrayName() || name == "avtGhostZones") return false;
    if (array->GetNumberOfTuples() == expected && array->GetNumberOfComponents() > 0) return true;
    log.warn(what + ": array '" + name + "' has " + std::to_string(array->GetNumberOfTuples()) + " tuples, expected " +
             std::to_string(expected) + ": left out");
    return false;
}

void add_point_fields(vtkDataSet *grid, const std::string &what, conversion_log &log, mesh_part &p)
{
    vtkPointData *data = grid->GetPointData();
    for (int i = 0; i < data->GetNumberOfArrays(); i++) {
        vtkDataArray *array = data->GetArray(i);
        if (!is_field(array, grid->GetNumberOfPoints(), what, log)) continue;
        const std::string field = what + " field '" + array->GetName() + "'";
        p.held.objects.emplace_back(array);
        add_field(array->GetName(), INSITU_VERTEX, borrow_or_copy_array(array, field, p.held, log), p);
    }
}

void add_cell_fields(vtkDataSet *grid, const cell_list &cells, const std::string &what, conversion_log &log,
                     mesh_part &p)
{
    vtkCellData *data = grid->GetCellData();
    for (int i = 0; i < data->GetNumberOfArrays(); i++) {
        vtkDataArray *array = data->GetArray(i);
        if (!is_field(array, grid->GetNumberOfCells(), what, log)) continue;
        const std::string field = what + " field '" + array->GetName() + "'";
        if (has_field(p, array->GetName())) {
            log.warn(field + " of the cells left out: the points have one of that name");
            continue;
        }
        p.held.objects.emplace_back(array);
        if (cells.is_one_to_one) {
            add_field(array->GetName(), INSITU_CELL, borrow_or_copy_array(array, field, p.held, log), p);
            continue;
        }
        held_arrays temporary;
        conversion_log discarded_log;
        const array_view picked =
            gather(borrow_or_copy_array(array, field, temporary, discarded_log), cells.source, p.held);
        log.copied(field, "cells split or left out", picked.tuple_count * picked.tuple_stride_bytes);
        add_field(array->GetName(), INSITU_CELL, picked, p);
    }
}

/* Stores the mesh and the fields of grid in p. If there is nothing to draw, p.mesh.cell_count is 0. */
void make_mesh_part(const insitu_vtk_adaptor *adaptor, vtkUnstructuredGrid *grid, const std::string &name,
                    set_result &out, mesh_part &p)
{
    const std::string what = "mesh '" + name + "'";
    insitu_mesh_defaults(&p.mesh);
    cell_list cells;
    cell_counts counts;
    conversion_log log;
    std::string error;
    const cells_view view = {what, p.held, log, p.mesh, cells, counts, adaptor->by_corners.count(name) > 0};
    if (!view_cells(grid, view, error)) throw failure{INSITU_ERROR_MESH, error};
    log_cells(counts, what, out.log);
    out.cells.split += counts.split;
    out.cells.linear += counts.linear;
    out.cells.flat += counts.flat;
    out.cells.not_drawn += counts.not_drawn;
    if (cells.count == 0) return;

    vtkPoints *points = grid->GetPoints();
    if (!points || points->GetNumberOfPoints() == 0) throw failure{INSITU_ERROR_MESH, what + ": cells without points"};
    p.mesh.vertex_count = points->GetNumberOfPoints();
    view_points(points->GetData(), what + " points", p.held, log, p.mesh.coordinates);
    set_ghosts(grid,
               vtkSmartPointer<vtkUnsignedCharArray>::Take(
                   insitu_vtk_ghost_flags(grid->GetCellData(), grid->GetNumberOfCells())),
               cells, what, log, p);
    add_point_fields(grid, what, log, p);
    add_cell_fields(grid, cells, what, log, p);

    out.log.add(log);
    out.cells_set += cells.count;
}

/* Stores the lattice and the fields of a structured data set in p. Returns false if data is not structured. */
bool make_lattice_part(vtkDataSet *data, const std::string &name, set_result &out, mesh_part &p)
{
    const std::string what = "mesh '" + name + "'";
    conversion_log log;
    cell_list cells;
    insitu_mesh_defaults(&p.mesh);
    p.lattice = std::make_unique<insitu_lattice>();
    if (!view_lattice(data, what, p.held, log, p.mesh, *p.lattice)) return false;
    cells.count = p.mesh.cell_count;
    set_ghosts(data, make_lattice_ghost_flags(data, *p.lattice), cells, what, log, p);
    add_point_fields(data, what, log, p);
    add_cell_fields(data, cells, what, log, p);
    out.log.add(log);
    out.cells_set += cells.count;
    return true;
}

void check(insitu_vtk_adaptor *adaptor, insitu_status status)
{
    if (status != INSITU_OK) throw failure{status, insitu_error(adaptor->session)};
}

insitu_status set_mesh(insitu_vtk_adaptor *adaptor, const part_key &key, const insitu_mesh *mesh)
{
    if (key.second == whole_mesh) return insitu_set_mesh(adaptor->session, key.first.c_str(), mesh);
    return insitu_set_block(adaptor->session, key.first.c_str(), key.second, mesh);
}

insitu_status set_field(insitu_vtk_adaptor *adaptor, const part_key &key, const insitu_field *field)
{
    if (key.second == whole_mesh) return insitu_set_field(adaptor->session, key.first.c_str(), field);
    return insitu_set_block_field(adaptor->session, key.first.c_str(), key.second, field);
}

void set_part(insitu_vtk_adaptor *adaptor, part_map &parts, const part_key &key, mesh_part &&new_part, set_result &out)
{
    if (new_part.mesh.cell_count == 0) return;
    out.keys.insert(key);
    mesh_part &kept = parts[key];
    check(adaptor, set_mesh(adaptor, key, &new_part.mesh));
    kept = std::move(new_part);
    out.meshes++;
    for (const insitu_field &field : kept.fields) {
        check(adaptor, set_field(adaptor, key, &field));
        out.fields++;
    }
}

void set_leaf(insitu_vtk_adaptor *adaptor, part_map &parts, const std::string &name, vtkUnstructuredGrid *grid,
              set_result &out)
{
    mesh_part new_part;
    make_mesh_part(adaptor, grid, name, out, new_part);
    set_part(adaptor, parts, {name, whole_mesh}, std::move(new_part), out);
}

/* Reports the bytes of the lists that insitu_vtk_make_grid() allocated for data. */
void log_bytes_of_made_lists(vtkUnstructuredGrid *grid, vtkDataSet *data, const std::string &what, conversion_log &log)
{
    if (grid->GetNumberOfCells() == 0) return;
    const std::string of = std::string(" of a ") + data->GetClassName();
    vtkCellArray *cells = grid->GetCells();
    auto *polygons = vtkPolyData::SafeDownCast(data);
    const int64_t id = cells->IsStorage64Bit() ? 8 : 4;
    const int64_t lists = cells->GetNumberOfConnectivityIds() + cells->GetNumberOfCells() + 1;
    if (polygons && polygons->GetPolys() == cells)
        log.copied(what, "the types" + of + "'s cells listed", grid->GetNumberOfCells());
    else
        log.copied(what, "the cells" + of + " listed", lists * id + grid->GetNumberOfCells());
    if (!vtkPointSet::SafeDownCast(data)) {
        const int64_t point = 3 * grid->GetPoints()->GetData()->GetDataTypeSize();
        log.copied(what + " points", "those" + of + " listed", point * grid->GetNumberOfPoints());
    }
    if (grid->GetCellGhostArray() != data->GetCellGhostArray())
        log.copied(what + " ghosts", "cells with hidden points, or refined, flagged", grid->GetNumberOfCells());
}

/* Converts a data set that is neither structured nor an unstructured grid to an unstructured grid, and sets this on the
 * session. */
void set_converted_grid(insitu_vtk_adaptor *adaptor, part_map &parts, const std::string &name, vtkDataSet *data,
                        set_result &out)
{
    const auto grid = vtkSmartPointer<vtkUnstructuredGrid>::Take(insitu_vtk_make_grid(data));
    log_bytes_of_made_lists(grid, data, "mesh '" + name + "'", out.log);
    set_leaf(adaptor, parts, name, grid, out);
}

/* Returns the name of a field, with its centring and number of components unless it has one component at points. */
std::string describe_field(const insitu_field &field)
{
    const bool is_of_cells = field.centring == INSITU_CELL;
    const std::string count = std::to_string(field.component_count) + " components";
    if (field.component_count == 1) return field.name + std::string(is_of_cells ? " (cells)" : "");
    return field.name + (is_of_cells ? " (cells, " + count + ")" : " (" + count + ")");
}

/* Returns the name of the mesh of which this structured leaf becomes a block. Leaves with the same fields and the same
 * number of dimensions get the same name, because all blocks of a mesh must have the same fields, with the same
 * centring and number of components. The name depends only on this leaf, because the other leaves may be on other
 * ranks. */
std::string make_name_of_blocks(const std::string &name, const mesh_part &p)
{
    std::set<std::string> fields;
    for (const insitu_field &field : p.fields) fields.insert(describe_field(field));
    std::string list;
    for (const std::string &field : fields) list += (list.empty() ? " of " : ", ") + field;
    if (list.size() > longest_list)
        list = list.substr(0, longest_list) + "... " + std::to_string(std::hash<std::string>()(list));
    return name + (p.mesh.cell_type == INSITU_QUAD ? "/flat blocks" : "/blocks") + list;
}

/* A composite data set whose leaves are being set on the session, and the iterator at the current leaf. */
struct composite_state {
    vtkCompositeDataSet *data;
    vtkCompositeDataIterator *it;
    amr_refinements refinements; /* refinement of each level of overlapping AMR */
};

/* Sets the position and refinement of a grid's lattice within overlapping AMR. Lattices of other composites stay
 * unchanged. */
void place_amr_grid(const composite_state &composite, const std::string &what, conversion_log &log,
                    insitu_lattice &lattice)
{
    auto *amr = vtkOverlappingAMR::SafeDownCast(composite.data);
    auto *at = vtkUniformGridAMRDataIterator::SafeDownCast(composite.it);
    if (!amr || !at) return;
    if (!place_on_level(amr, composite.refinements, at->GetCurrentLevel(), at->GetCurrentIndex(), lattice))
        log.warn(what + ": the AMR's boxes, spacings or ratios are not set, do not fit each other, or are not those of "
                        "its grids: only ghost flags tell which of its cells are refined");
}

/* Sets a structured leaf as a block. Returns false if the leaf is not structured. */
bool set_block(insitu_vtk_adaptor *adaptor, part_map &parts, const std::string &name, int64_t number,
               const composite_state &composite, vtkDataSet *leaf, set_result &out)
{
    mesh_part new_part;
    if (!make_lattice_part(leaf, name + "/" + std::to_string(number), out, new_part)) return false;
    place_amr_grid(composite, "mesh '" + name + "[" + std::to_string(number) + "]'", out.log, *new_part.lattice);
    const bool is_amr = vtkOverlappingAMR::SafeDownCast(composite.data);
    const std::string mesh = is_amr ? name : make_name_of_blocks(name, new_part);
    set_part(adaptor, parts, {mesh, number}, std::move(new_part), out);
    return true;
}

/* Sets every leaf of a composite data set as a mesh or a block. Empty leaves are counted, so that a leaf has the same
 * number on all ranks. */
void set_leaves(insitu_vtk_adaptor *adaptor, part_map &parts, const std::string &name, vtkCompositeDataSet *data,
                set_result &out)
{
    const auto it = vtkSmartPointer<vtkCompositeDataIterator>::Take(data->NewIterator());
    auto *amr = vtkOverlappingAMR::SafeDownCast(data);
    const composite_state composite = {data, it, amr ? find_refinements(amr) : amr_refinements()};
    it->SkipEmptyNodesOff();
    int64_t number = 0;
    for (it->InitTraversal(); !it->IsDoneWithTraversal(); it->GoToNextItem(), number++) {
        vtkDataObject *leaf = it->GetCurrentDataObject();
        if (!leaf) continue;
        const std::string leaf_name = name + "/" + std::to_string(number);
        auto *leaf_data = vtkDataSet::SafeDownCast(leaf);
        if (auto *grid = vtkUnstructuredGrid::SafeDownCast(leaf))
            set_leaf(adaptor, parts, leaf_name, grid, out);
        else if (!leaf_data)
            out.log.warn("mesh '" + leaf_name + "': a " + leaf->GetClassName() + " is not drawn");
        else if (!set_block(adaptor, parts, name, number, composite, leaf_data, out))
            set_converted_grid(adaptor, parts, leaf_name, leaf_data, out);
    }
}

/* Sets a data set that is not an unstructured grid on the session: as a lattice if it is structured, and otherwise as
 * an unstructured grid. */
void set_structured_or_converted(insitu_vtk_adaptor *adaptor, part_map &parts, const std::string &name,
                                 vtkDataSet *data, set_result &out)
{
    mesh_part new_part;
    if (make_lattice_part(data, name, out, new_part))
        set_part(adaptor, parts, {name, whole_mesh}, std::move(new_part), out);
    else
        set_converted_grid(adaptor, parts, name, data, out);
}

void set_data(insitu_vtk_adaptor *adaptor, part_map &parts, const std::string &name, vtkDataObject *data,
              set_result &out)
{
    if (!data) return;
    if (auto *grid = vtkUnstructuredGrid::SafeDownCast(data))
        set_leaf(adaptor, parts, name, grid, out);
    else if (auto *composite = vtkCompositeDataSet::SafeDownCast(data))
        set_leaves(adaptor, parts, name, composite, out);
    else if (auto *other = vtkDataSet::SafeDownCast(data))
        set_structured_or_converted(adaptor, parts, name, other, out);
    else
        throw failure{INSITU_ERROR_ARGUMENT, "mesh '" + name + "': a " + data->GetClassName() +
                                                 " is not taken, expected a vtkDataSet or a composite of them"};
}

/* Removes the parts that an earlier call set and the current call did not set. A whole mesh that blocks of the same
 * name have replaced must not be removed from the session, because this would remove the blocks. */
void remove_parts_not_set(insitu_vtk_adaptor *adaptor, part_map &parts, const std::set<part_key> &keys)
{
    for (auto it = parts.begin(); it != parts.end();) {
        const part_key &key = it->first;
        const auto blocks = keys.upper_bound({key.first, whole_mesh});
        const bool is_replaced = key.second == whole_mesh && blocks != keys.end() && blocks->first == key.first;
        if (keys.count(key) > 0) {
            ++it;
            continue;
        }
        if (!is_replaced) check(adaptor, set_mesh(adaptor, key, nullptr));
        it = parts.erase(it);
    }
}

void set_all(insitu_vtk_adaptor *adaptor, const char *name, vtkDataObject *data, set_result &out)
{
    if (!name || !name[0]) throw failure{INSITU_ERROR_ARGUMENT, "insitu_vtk_set: a mesh needs a name"};
    part_map &parts = adaptor->parts[name];
    set_data(adaptor, parts, name, data, out);
    remove_parts_not_set(adaptor, parts, out.keys);
    if (out.cells_set == 0 && out.cells.not_drawn > 0)
        throw failure{INSITU_ERROR_MESH, "mesh '" + std::string(name) + "': none of its " +
                                             std::to_string(out.cells.not_drawn) +
                                             " cells can be drawn: " + out.log.cells_why};
}

void fill_report(insitu_vtk_adaptor *adaptor, set_result &out, insitu_vtk_report *report)
{
    adaptor->copied_why = std::move(out.log.copied_why);
    adaptor->cells_why = std::move(out.log.cells_why);
    adaptor->warnings = std::move(out.log.warnings);
    if (!report) return;
    *report = {out.meshes,
               out.fields,
               out.cells_set,
               out.cells.split,
               out.cells.linear,
               out.cells.flat,
               out.cells.not_drawn,
               out.log.bytes_borrowed,
               out.log.bytes_copied,
               adaptor->copied_why.c_str(),
               adaptor->cells_why.c_str(),
               adaptor->warnings.c_str()};
}

/* Calls body and converts any exception to a status and a message. */
template <typename Body> insitu_status catch_exceptions(insitu_vtk_adaptor *adaptor, Body body) noexcept
{
    try {
        adaptor->error.clear();
        try {
            body();
            return INSITU_OK;
        } catch (const failure &f) {
            adaptor->error = f.message;
            return f.status;
        } catch (const std::bad_alloc &) {
            adaptor->error = "out of memory";
            return INSITU_ERROR_MEMORY;
        } catch (const std::exception &e) {
            adaptor->error = e.what();
            return INSITU_ERROR_INTERNAL;
        }
    } catch (...) {
        return INSITU_ERROR_MEMORY;
    }
}

} // namespace

insitu_status insitu_vtk_create(insitu_session *session, insitu_vtk_adaptor **out)
{
    if (!out) return INSITU_ERROR_ARGUMENT;
    *out = nullptr;
    if (!session) return INSITU_ERROR_ARGUMENT;
    auto *adaptor = new (std::nothrow) insitu_vtk_adaptor;
    if (!adaptor) return INSITU_ERROR_MEMORY;
    adaptor->session = session;
    *out = adaptor;
    return INSITU_OK;
}

insitu_status insitu_vtk_set(insitu_vtk_adaptor *adaptor, const char *name, vtkDataObject *data,
                             insitu_vtk_report *report)
{
    if (report) *report = {0, 0, 0, 0, 0, 0, 0, 0, 0, "", "", ""};
    if (!adaptor) return INSITU_ERROR_ARGUMENT;
    set_result out;
    const insitu_status status = catch_exceptions(adaptor, [&] { set_all(adaptor, name, data, out); });
    fill_report(adaptor, out, report);
    return status;
}

insitu_status insitu_vtk_draw_by_corners(insitu_vtk_adaptor *adaptor, const char *mesh, bool is_by_corners)
{
    if (!adaptor || !mesh) return INSITU_ERROR_ARGUMENT;
    return catch_exceptions(adaptor, [&] {
        if (is_by_corners)
            adaptor->by_corners.insert(mesh);
        else
            adaptor->by_corners.erase(mesh);
    });
}

const char *insitu_vtk_error(const insitu_vtk_adaptor *adaptor)
{
    return adaptor ? adaptor->error.c_str() : "no adaptor given";
}

void insitu_vtk_destroy(insitu_vtk_adaptor **adaptor)
{
    if (!adaptor || !*adaptor) return;
    for (const auto &[name, parts] : (*adaptor)->parts)
        for (const auto &[key, held] : parts) (void)set_mesh(*adaptor, key, nullptr);
    delete *adaptor;
    *adaptor = nullptr;
}
