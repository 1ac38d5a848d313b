/* Reads a file of unstructured grids by VTK's description of the format, version 2. A part is a separate grid, and a
 * step has one or several parts. The arrays of all parts and steps are concatenated:
 *
 *     /VTKHDF                     attribute Type
 *       NumberOfPoints, NumberOfCells, NumberOfConnectivityIds    one entry per part
 *       Points, Types, Connectivity, Offsets (number of cells + 1 per part)
 *       PointData/NAME, CellData/NAME
 *       FieldData/TimeValue       time of a file without steps
 *       Steps                     attribute NSteps; each of the following has one entry per step
 *         Values                  times
 *         PartOffsets, NumberOfParts
 *         PointOffsets, CellOffsets, ConnectivityIdOffsets        first index of the step's first part
 *         PointDataOffsets/NAME, CellDataOffsets/NAME             the same for fields; by default as for points
 *                                                                 or cells */
#include "hdf_file.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <vector>

#include <vtkCellArray.h>
#include <vtkCellData.h>
#include <vtkCellType.h>
#include <vtkDataArray.h>
#include <vtkFieldData.h>
#include <vtkIdTypeArray.h>
#include <vtkMultiBlockDataSet.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkUnsignedCharArray.h>
#include <vtkUnstructuredGrid.h>
#include <vtk_hdf5.h>

#include "vtk_messages.h"

namespace render_tool
{

namespace
{

using array_pointer = vtkSmartPointer<vtkDataArray>;

/* Owns a handle of the HDF5 library and closes it in the destructor. */
class handle
{
  public:
    handle(hid_t id, herr_t (*close)(hid_t)) : id_(id), close_(close) {}
    ~handle()
    {
        if (id_ >= 0) close_(id_);
    }
    handle(const handle &) = delete;
    handle &operator=(const handle &) = delete;

    operator hid_t() const { return id_; }
    bool is_open() const { return id_ >= 0; }

  private:
    hid_t id_;
    herr_t (*close_)(hid_t);
};

/* Returns VTK's type for numeric types in a file, and VTK_VOID for all others. */
int vtk_type(hid_t type)
{
    const size_t size = H5Tget_size(type);
    if (H5Tget_class(type) == H5T_FLOAT) return size == 4 ? VTK_FLOAT : size == 8 ? VTK_DOUBLE : VTK_VOID;
    if (H5Tget_class(type) != H5T_INTEGER) return VTK_VOID;
    const bool has_sign = H5Tget_sign(type) == H5T_SGN_2;
    switch (size) {
    case 1: return has_sign ? VTK_SIGNED_CHAR : VTK_UNSIGNED_CHAR;
    case 2: return has_sign ? VTK_SHORT : VTK_UNSIGNED_SHORT;
    case 4: return has_sign ? VTK_INT : VTK_UNSIGNED_INT;
    case 8: return has_sign ? VTK_LONG_LONG : VTK_UNSIGNED_LONG_LONG;
    default: return VTK_VOID;
    }
}

hid_t find_memory_type(int type)
{
    switch (type) {
    case VTK_FLOAT: return H5T_NATIVE_FLOAT;
    case VTK_DOUBLE: return H5T_NATIVE_DOUBLE;
    case VTK_SIGNED_CHAR: return H5T_NATIVE_SCHAR;
    case VTK_UNSIGNED_CHAR: return H5T_NATIVE_UCHAR;
    case VTK_SHORT: return H5T_NATIVE_SHORT;
    case VTK_UNSIGNED_SHORT: return H5T_NATIVE_USHORT;
    case VTK_INT: return H5T_NATIVE_INT;
    case VTK_UNSIGNED_INT: return H5T_NATIVE_UINT;
    case VTK_LONG_LONG: return H5T_NATIVE_LLONG;
    case VTK_UNSIGNED_LONG_LONG: return H5T_NATIVE_ULLONG;
    default: return H5T_NATIVE_INT64; /* vtkIdType is a 64-bit integer */
    }
}

class hdf_reader
{
  public:
    explicit hdf_reader(const std::string &path)
        : path_(path), file_(H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose)
    {
        if (!file_.is_open()) fail("is no HDF file, or is cut short");
        if (!has("/VTKHDF")) fail("has no group VTKHDF");
    }

    [[noreturn]] void fail(const std::string &why) const
    {
        throw std::runtime_error(path_ + ": cannot be read: " + why);
    }

    /* Checks whether an object exists. H5Lexists() requires that each group of the path exists, so they are checked one
     * by one. */
    bool has(const std::string &name) const
    {
        for (size_t at = name.find('/', 1); at != std::string::npos; at = name.find('/', at + 1))
            if (H5Lexists(file_, name.substr(0, at).c_str(), H5P_DEFAULT) <= 0) return false;
        return H5Lexists(file_, name.c_str(), H5P_DEFAULT) > 0;
    }

    /* Returns the file's attribute Type. */
    std::string type() const
    {
        if (H5Aexists_by_name(file_, "/VTKHDF", "Type", H5P_DEFAULT) <= 0) fail("its group VTKHDF has no Type");
        const handle attribute(H5Aopen_by_name(file_, "/VTKHDF", "Type", H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
        const handle kind(H5Aget_type(attribute), H5Tclose);
        if (H5Tget_class(kind) != H5T_STRING) fail("its Type is no text");
        if (H5Tis_variable_str(kind) > 0) {
            char *text = nullptr;
            if (H5Aread(attribute, kind, static_cast<void *>(&text)) < 0 || !text) fail("its Type is unreadable");
            std::string copy = text;
            H5free_memory(text);
            return copy;
        }
        std::string text(H5Tget_size(kind), '\0');
        if (H5Aread(attribute, kind, text.data()) < 0) fail("its Type is unreadable");
        return text.substr(0, text.find('\0'));
    }

    /* Returns the names of the data sets in a group; empty if there is no such group. */
    std::vector<std::string> names(const std::string &group) const
    {
        std::vector<std::string> all;
        if (!has(group)) return all;
        const auto add = [](hid_t, const char *name, const H5L_info_t *, void *list) -> herr_t {
            static_cast<std::vector<std::string> *>(list)->emplace_back(name);
            return 0;
        };
        if (H5Literate_by_name(file_, group.c_str(), H5_INDEX_NAME, H5_ITER_INC, nullptr, add, &all, H5P_DEFAULT) < 0)
            fail(group + " is unreadable");
        return all;
    }

    /* Returns `count` rows of a data set from `first` on, or all if count is negative. Rows are converted to VTK's type
     * `as`, or keep the file's type if `as` is VTK_VOID. Returns null if the data set is not numeric. */
    array_pointer rows(const std::string &name, int64_t first, int64_t count, int as = VTK_VOID) const
    {
        if (!has(name)) fail(name + " is missing");
        const handle set(H5Dopen2(file_, name.c_str(), H5P_DEFAULT), H5Dclose);
        if (!set.is_open()) fail(name + " is no data set");
        const handle kind(H5Dget_type(set), H5Tclose), space(H5Dget_space(set), H5Sclose);
        const int type = vtk_type(kind) == VTK_VOID ? VTK_VOID : as != VTK_VOID ? as : vtk_type(kind);
        std::array<hsize_t, H5S_MAX_RANK> sizes{}, start{};
        const int rank = H5Sget_simple_extent_dims(space, sizes.data(), nullptr);
        if (type == VTK_VOID || rank < 1) return nullptr;
        const auto length = static_cast<int64_t>(sizes[0]);
        if (count < 0) count = length;
        if (first < 0 || first > length || count > length - first)
            fail(name + " has " + std::to_string(length) + " entries, expected " + std::to_string(count) + " from " +
                 std::to_string(first) + " on");
        const auto components =
            std::accumulate(sizes.begin() + 1, sizes.begin() + rank, hsize_t{1}, std::multiplies<>());
        if (components < 1 || components > std::numeric_limits<int>::max()) return nullptr;
        auto array = array_pointer::Take(vtkDataArray::CreateDataArray(type));
        array->SetNumberOfComponents(static_cast<int>(components));
        array->SetNumberOfTuples(count);
        if (count == 0) return array;
        start[0] = static_cast<hsize_t>(first);
        sizes[0] = static_cast<hsize_t>(count);
        H5Sselect_hyperslab(space, H5S_SELECT_SET, start.data(), nullptr, sizes.data(), nullptr);
        const handle memory(H5Screate_simple(rank, sizes.data(), nullptr), H5Sclose);
        if (H5Dread(set, find_memory_type(type), memory, space, H5P_DEFAULT, array->GetVoidPointer(0)) < 0)
            fail(name + " is unreadable");
        return array;
    }

    /* Returns the number of rows of a data set; 0 if it does not exist. */
    int64_t length(const std::string &name) const
    {
        const handle set(H5Dopen2(file_, name.c_str(), H5P_DEFAULT), H5Dclose);
        if (!set.is_open()) return 0;
        const handle space(H5Dget_space(set), H5Sclose);
        std::array<hsize_t, H5S_MAX_RANK> sizes{};
        return H5Sget_simple_extent_dims(space, sizes.data(), nullptr) > 0 ? static_cast<int64_t>(sizes[0]) : 0;
    }

    /* Returns the first number of a row. */
    int64_t number(const std::string &name, int64_t row) const
    {
        const array_pointer one = rows(name, row, 1, VTK_ID_TYPE);
        if (!one) fail(name + " has no numbers");
        return static_cast<int64_t>(one->GetComponent(0, 0));
    }

  private:
    std::string path_;
    handle file_;
};

/* The position of a part in the file: the index of the part; its first index in the arrays of points, cells,
 * connectivity ids and offsets; and its numbers of points, cells and ids. */
struct part_position {
    int64_t part = 0;
    int64_t point = 0, cell = 0, id = 0, offset = 0;
    int64_t points = 0, cells = 0, ids = 0;
};

class hdf_grids : public data_file
{
  public:
    explicit hdf_grids(const std::string &path) : path_(path), in_(path), has_steps_(in_.has("/VTKHDF/Steps"))
    {
        if (!has_steps_) return;
        const array_pointer values = in_.rows("/VTKHDF/Steps/Values", 0, -1, VTK_DOUBLE);
        for (vtkIdType i = 0; values && i < values->GetNumberOfTuples(); i++)
            times_.push_back(values->GetComponent(i, 0));
        if (times_.empty()) in_.fail("it has no steps");
    }

    const std::vector<double> &times() const override { return times_; }
    std::string step_path(size_t) const override { return path_; }
    int pieces(size_t step) override { return static_cast<int>(part_count(step)); }
    vtkSmartPointer<vtkDataObject> read(size_t step, int piece, int pieces) override
    {
        const quiet_stderr quiet;
        const int64_t count = part_count(step);
        auto all = vtkSmartPointer<vtkMultiBlockDataSet>::New();
        all->SetNumberOfBlocks(static_cast<unsigned>(count));
        if (count == 0) return all;
        part_position at = find_first_part(step);
        const part_position first = at;
        for (int64_t i = 0; i < count; i++) {
            set_counts(at);
            const bool belongs_to_piece = i * pieces / count == piece;
            if (belongs_to_piece) {
                auto grid = read_part(at, first, step);
                if (count == 1) {
                    add_time(grid);
                    return grid;
                }
                all->SetBlock(static_cast<unsigned>(i), grid);
            }
            at = {at.part + 1,
                  at.point + at.points,
                  at.cell + at.cells,
                  at.id + at.ids,
                  at.offset + at.cells + 1,
                  0,
                  0,
                  0};
        }
        add_time(all);
        return all;
    }

  private:
    std::string path_;
    hdf_reader in_;
    bool has_steps_;
    std::vector<double> times_;

    /* Returns an entry of Steps, or `missing` if there are no steps or there is no such list. */
    int64_t read_step_entry(const std::string &name, size_t step, int64_t missing) const
    {
        const std::string list = "/VTKHDF/Steps/" + name;
        return has_steps_ && in_.has(list) ? in_.number(list, static_cast<int64_t>(step)) : missing;
    }

    int64_t part_count(size_t step) const
    {
        const array_pointer parts = in_.rows("/VTKHDF/NumberOfPoints", 0, -1, VTK_ID_TYPE);
        const int64_t all = parts ? parts->GetNumberOfTuples() : 0;
        const int64_t count = read_step_entry("NumberOfParts", step, in_.has("/VTKHDF/Steps/PartOffsets") ? 1 : all);
        if (count < 0 || count > all)
            in_.fail("step " + std::to_string(step) + " has " + std::to_string(count) + " parts, of " +
                     std::to_string(all));
        return count;
    }

    /* Adds the file's field data TimeValue to data. In a file with steps, times() has their times instead. */
    void add_time(vtkDataObject *data) const
    {
        const std::string name = "/VTKHDF/FieldData/TimeValue";
        if (has_steps_ || !in_.has(name) || in_.length(name) == 0) return;
        const array_pointer time = in_.rows(name, 0, 1, VTK_DOUBLE);
        if (!time) return;
        time->SetName("TimeValue");
        data->GetFieldData()->AddArray(time);
    }

    part_position find_first_part(size_t step) const
    {
        part_position at;
        at.part = read_step_entry("PartOffsets", step, 0);
        at.point = read_step_entry("PointOffsets", step, 0);
        at.cell = read_step_entry("CellOffsets", step, 0);
        at.id = read_step_entry("ConnectivityIdOffsets", step, 0);
        set_counts(at);
        at.offset = at.cell + at.part;
        if (!offsets_fit(at)) at.offset = find_offset(at);
        return at;
    }

    bool offsets_fit(const part_position &at) const
    {
        const std::string offsets = "/VTKHDF/Offsets";
        return at.offset >= 0 && in_.has(offsets) && at.offset + at.cells < in_.length(offsets) &&
               in_.number(offsets, at.offset) == 0 && in_.number(offsets, at.offset + at.cells) == at.ids;
    }

    /* Returns a part's first index in the file's list of offsets, which differs from its first index in the list of
     * cells by the number of parts before it: each of them has one more offset than cells, and its first offset is 0.
     * Parts that reuse the cells of an earlier step have no entries in either list. If no index fits, returns that of
     * a file without such parts. */
    int64_t find_offset(part_position at) const
    {
        const std::string name = "/VTKHDF/Offsets";
        const int64_t most = in_.has(name) ? in_.length(name) : 0, end = std::min(most, at.cell + at.part + 1);
        const array_pointer offsets = end > 0 ? in_.rows(name, 0, end, VTK_ID_TYPE) : nullptr;
        int64_t parts = 0;
        for (at.offset = 0; offsets && at.offset < end; at.offset++) {
            if (offsets->GetComponent(at.offset, 0) != 0) continue;
            if (at.offset - parts == at.cell && offsets_fit(at)) return at.offset;
            parts++;
        }
        return at.cell + at.part;
    }

    void set_counts(part_position &at) const
    {
        at.points = in_.number("/VTKHDF/NumberOfPoints", at.part);
        at.cells = in_.number("/VTKHDF/NumberOfCells", at.part);
        at.ids = in_.number("/VTKHDF/NumberOfConnectivityIds", at.part);
        if (at.points < 0 || at.cells < 0 || at.ids < 0) in_.fail("a part has a negative number of points or cells");
    }

    vtkSmartPointer<vtkDataObject> read_part(const part_position &at, const part_position &first, size_t step) const
    {
        auto grid = vtkSmartPointer<vtkUnstructuredGrid>::New();
        const array_pointer coordinates = in_.rows("/VTKHDF/Points", at.point, at.points);
        if (!coordinates || coordinates->GetNumberOfComponents() != 3) in_.fail("Points are no three numbers each");
        vtkNew<vtkPoints> points;
        points->SetData(coordinates);
        grid->SetPoints(points);
        set_cells(at, grid);
        add_fields("PointData", {at.point - first.point, at.points, first.point, step}, grid->GetPointData());
        add_fields("CellData", {at.cell - first.cell, at.cells, first.cell, step}, grid->GetCellData());
        return grid;
    }

    void set_cells(const part_position &at, vtkUnstructuredGrid *grid) const
    {
        const auto list = [&](const char *name, int64_t first, int64_t count, int type) {
            array_pointer array = in_.rows(std::string("/VTKHDF/") + name, first, count, type);
            if (!array || array->GetNumberOfComponents() != 1) in_.fail(std::string(name) + " is no list of numbers");
            return array;
        };
        const array_pointer types = list("Types", at.cell, at.cells, VTK_UNSIGNED_CHAR);
        const array_pointer offsets = list("Offsets", at.offset, at.cells + 1, VTK_ID_TYPE);
        const array_pointer ids = list("Connectivity", at.id, at.ids, VTK_ID_TYPE);
        if (offsets->GetComponent(0, 0) != 0 || offsets->GetComponent(at.cells, 0) != static_cast<double>(at.ids))
            in_.fail("the Offsets of part " + std::to_string(at.part) + " do not fit its Connectivity");
        for (int64_t i = 0; i < at.cells; i++)
            if (types->GetComponent(i, 0) == static_cast<double>(VTK_POLYHEDRON))
                in_.fail("polyhedra of this format are not read");
        vtkNew<vtkCellArray> cells;
        cells->SetData(vtkIdTypeArray::SafeDownCast(offsets), vtkIdTypeArray::SafeDownCast(ids));
        grid->SetCells(vtkUnsignedCharArray::SafeDownCast(types), cells);
    }

    struct field_place {
        int64_t in_step, count; // range of points or cells, counted from the step's first part
        int64_t first;          // first index of the first part, for fields without an entry of their own
        size_t step;
    };

    void add_fields(const std::string &group, const field_place &at, vtkDataSetAttributes *to) const
    {
        for (const std::string &name : in_.names("/VTKHDF/" + group)) {
            std::string path = "/VTKHDF/";
            path.append(group).append("/").append(name);
            std::string place = group;
            place.append("Offsets/").append(name);
            const array_pointer values =
                in_.rows(path, read_step_entry(place, at.step, at.first) + at.in_step, at.count);
            if (!values) continue;
            values->SetName(name.c_str());
            to->AddArray(values);
        }
    }
};

} // namespace

std::unique_ptr<data_file> open_hdf(const std::string &path)
{
    const quiet_stderr quiet;
    const hdf_reader in(path);
    const std::string type = in.type();
    if (type == "UnstructuredGrid") return std::make_unique<hdf_grids>(path);
    if (type != "ImageData") in.fail("a VTKHDF file of Type " + type + ", expected UnstructuredGrid or ImageData");
    if (in.has("/VTKHDF/Steps")) in.fail("images with steps are not read in a VTKHDF file, expected UnstructuredGrid");
    return nullptr;
}

} // namespace render_tool
