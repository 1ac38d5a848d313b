/* VTK 9.1 determines the cell type of a block from the first letters of its element type and a short list of numbers of
 * nodes. If the number of nodes is not in the list, VTK uses the linear type, and advances through the connectivity by
 * the number of nodes of the linear type. For example, the second cell of a block of HEX9 elements begins at the ninth
 * node of the first element.
 *
 * The corners are the first nodes of every element type. If a block's elements have a different number of nodes than
 * the cells that VTK has made of them, the cells are therefore created again, from the corners in the file's
 * connectivity. VTK's reader usually keeps only the points of the cells that it has made. If VTK's list lacks the
 * number of nodes of a block, the reader is configured to keep all points, and the points that each block uses are
 * extracted here. */
#include "exodus_reader.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdint>
#include <map>
#include <numeric>
#include <stdexcept>
#include <vector>

#include <vtkCellArray.h>
#include <vtkCellData.h>
#include <vtkCellType.h>
#include <vtkExodusIIReader.h>
#include <vtkIdTypeArray.h>
#include <vtkInformation.h>
#include <vtkInformationVector.h>
#include <vtkMultiBlockDataSet.h>
#include <vtkNew.h>
#include <vtkObjectFactory.h>
#include <vtkUnstructuredGrid.h>
#include <vtk_exodusII.h>

#include "cell_extract.h"
#include "grids_of.h"

namespace render_tool
{

namespace
{

struct element_block {
    std::string type;
    int64_t elements = 0;
    int64_t nodes = 0; // number of nodes per element; 0 if elements differ (nsided, nfaced)
};

struct shape {
    int cell_type = VTK_EMPTY_CELL; // type of the linear cell with the same corners; VTK_EMPTY_CELL if the cells are
                                    // not created again
    int64_t corners = 0;            // number of corners; 0 if the type is unknown
};

std::string upper(std::string text)
{
    for (char &c : text) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
    return text;
}

/* Returns the shape of a block's elements from the first three letters of their type, as VTK does. A triangular shell
 * is called SHELL3, SHELL6 or TRISHELL. */
shape find_shape(const element_block &b)
{
    static const std::map<std::string, shape> shapes = {
        {"TRI", {VTK_TRIANGLE, 3}},   {"QUA", {VTK_QUAD, 4}},       {"SHE", {VTK_QUAD, 4}},
        {"TET", {VTK_TETRA, 4}},      {"PYR", {VTK_PYRAMID, 5}},    {"WED", {VTK_WEDGE, 6}},
        {"HEX", {VTK_HEXAHEDRON, 8}}, {"BAR", {VTK_EMPTY_CELL, 2}}, {"BEA", {VTK_EMPTY_CELL, 2}},
        {"TRU", {VTK_EMPTY_CELL, 2}}, {"ROD", {VTK_EMPTY_CELL, 2}}, {"EDG", {VTK_EMPTY_CELL, 2}},
        {"STR", {VTK_EMPTY_CELL, 2}}, {"CIR", {VTK_EMPTY_CELL, 1}}, {"SPH", {VTK_EMPTY_CELL, 1}},
        {"SUP", {VTK_EMPTY_CELL, 1}}, {"POI", {VTK_EMPTY_CELL, 1}}, {"NOD", {VTK_EMPTY_CELL, 1}}};
    const std::string name = upper(b.type).substr(0, 3);
    if (name == "SHE" && (b.nodes == 3 || b.nodes == 6 || b.nodes == 7)) return shapes.at("TRI");
    const auto found = shapes.find(name);
    return found == shapes.end() ? shape{} : found->second;
}

/* Checks whether VTK has a cell type with this number of nodes. */
bool has_vtk_type(const element_block &b)
{
    static const std::map<int, std::vector<int64_t>> node_counts = {
        {VTK_TRIANGLE, {3, 6}}, {VTK_QUAD, {4, 8}},           {VTK_TETRA, {4, 10, 15}},
        {VTK_PYRAMID, {5, 13}}, {VTK_WEDGE, {6, 15, 18, 21}}, {VTK_HEXAHEDRON, {8, 20, 27}}};
    const auto found = node_counts.find(find_shape(b).cell_type);
    return found == node_counts.end() || std::count(found->second.begin(), found->second.end(), b.nodes) > 0;
}

std::string describe(int64_t id, const element_block &b)
{
    return "element block " + std::to_string(id) + ": elements of type \"" + b.type + "\" with " +
           std::to_string(b.nodes) + " nodes";
}

/* Throws std::runtime_error for elements that VTK's reader would read beyond the end of the connectivity, or whose type
 * is unknown. The message is more specific than VTK's. */
void check_elements(const std::string &path, int64_t id, const element_block &b)
{
    const int64_t corners = find_shape(b).corners;
    if (b.elements == 0 || b.nodes == 0 || (corners > 0 && b.nodes >= corners)) return;
    throw std::runtime_error(
        path + ": cannot be read: " + describe(id, b) +
        (corners > 0 ? ", fewer than its " + std::to_string(corners) + " corners" : ", a type that is not known"));
}

/* An open Exodus file, whose integers are read with 64 bits. */
class exodus_file
{
  public:
    explicit exodus_file(const std::string &path)
    {
        int word_bytes = 8, file_word_bytes = 0;
        float version = 0;
        id_ = ex_open(path.c_str(), EX_READ | EX_ALL_INT64_API, &word_bytes, &file_word_bytes, &version);
    }
    ~exodus_file()
    {
        if (is_open()) ex_close(id_);
    }
    exodus_file(const exodus_file &) = delete;
    exodus_file &operator=(const exodus_file &) = delete;

    bool is_open() const { return id_ >= 0; }

    /* Returns the element blocks by their ids; empty if they cannot be read. */
    std::map<int64_t, element_block> blocks() const
    {
        std::map<int64_t, element_block> all;
        const int64_t count = ex_inquire_int(id_, EX_INQ_ELEM_BLK);
        std::vector<int64_t> ids(static_cast<size_t>(std::max<int64_t>(count, 0)));
        if (ids.empty() || ex_get_ids(id_, EX_ELEM_BLOCK, ids.data()) < 0) return all;
        for (const int64_t id : ids) {
            std::array<char, MAX_STR_LENGTH + 1> type{};
            element_block b;
            int64_t edges = 0, faces = 0, attributes = 0;
            if (ex_get_block(id_, EX_ELEM_BLOCK, id, type.data(), &b.elements, &b.nodes, &edges, &faces, &attributes) <
                0)
                continue;
            b.type = type.data();
            const std::string kind = upper(b.type);
            if (kind == "NSIDED" || kind == "NFACED") b.nodes = 0;
            all[id] = b;
        }
        return all;
    }

    /* Returns the nodes of all elements of a block, counted from 1; empty if they cannot be read. */
    std::vector<int64_t> connectivity(int64_t block, const element_block &b) const
    {
        std::vector<int64_t> nodes(static_cast<size_t>(b.elements * b.nodes));
        if (ex_get_conn(id_, EX_ELEM_BLOCK, block, nodes.data(), nullptr, nullptr) < 0) nodes.clear();
        return nodes;
    }

  private:
    int id_ = -1;
};

/* Replaces the grid's cells by linear cells with the same corners. Returns an error message, or "". */
std::string set_cells(vtkUnstructuredGrid *grid, const element_block &b, const std::vector<int64_t> &nodes)
{
    const shape s = find_shape(b);
    const vtkIdType points = grid->GetNumberOfPoints();
    if (nodes.empty()) return "have a connectivity that cannot be read";
    vtkNew<vtkIdTypeArray> offsets, corners;
    offsets->SetNumberOfValues(b.elements + 1);
    corners->SetNumberOfValues(b.elements * s.corners);
    for (int64_t e = 0; e <= b.elements; e++) offsets->SetValue(e, e * s.corners);
    for (int64_t e = 0; e < b.elements; e++)
        for (int64_t k = 0; k < s.corners; k++) {
            const int64_t node = nodes[static_cast<size_t>(e * b.nodes + k)];
            if (node < 1 || node > points)
                return "name a node " + std::to_string(node) + ", of " + std::to_string(points) + " nodes";
            corners->SetValue(e * s.corners + k, node - 1);
        }
    vtkNew<vtkCellArray> cells;
    cells->SetData(offsets, corners);
    grid->SetCells(s.cell_type, cells);
    return "";
}

vtkMultiBlockDataSet *element_blocks_of(vtkMultiBlockDataSet *output)
{
    for (unsigned i = 0; output && i < output->GetNumberOfBlocks(); i++) {
        const char *name = output->HasMetaData(i) ? output->GetMetaData(i)->Get(vtkCompositeDataSet::NAME()) : nullptr;
        if (name && std::string(name) == "Element Blocks")
            return vtkMultiBlockDataSet::SafeDownCast(output->GetBlock(i));
    }
    return nullptr;
}

class reader : public vtkExodusIIReader
{
  public:
    static reader *New();
    vtkTypeMacro(reader, vtkExodusIIReader);

    void set_blocks(std::map<int64_t, element_block> blocks) { blocks_ = std::move(blocks); }

  protected:
    int RequestData(vtkInformation *request, vtkInformationVector **in, vtkInformationVector *out) override
    {
        if (!Superclass::RequestData(request, in, out)) return 0;
        const std::string wrong = correct_cells(element_blocks_of(vtkMultiBlockDataSet::GetData(out)));
        if (wrong.empty()) return 1;
        vtkErrorMacro(<< wrong);
        return 0;
    }

  private:
    std::map<int64_t, element_block> blocks_;

    /* Returns the block from which a grid was made; null if it is unknown or the grid has no cells. */
    const element_block *find_block(vtkUnstructuredGrid *grid, int64_t &id) const
    {
        vtkDataArray *ids = grid ? grid->GetCellData()->GetArray(GetObjectIdArrayName()) : nullptr;
        if (!ids || ids->GetNumberOfTuples() == 0 || grid->GetNumberOfCells() == 0) return nullptr;
        id = static_cast<int64_t>(ids->GetComponent(0, 0));
        const auto found = blocks_.find(id);
        return found == blocks_.end() ? nullptr : &found->second;
    }

    /* Checks whether the cells of a block's grid have a different number of points than the block's elements. */
    static bool has_other_cells(vtkUnstructuredGrid *grid, const element_block &b)
    {
        return b.nodes > 0 && (grid->GetCells()->GetCellSize(0) != b.nodes || grid->GetCellType(0) == VTK_EMPTY_CELL);
    }

    /* Replaces wrong cells, and reduces the points of each block to those that it uses. Returns an error message, or
     * "". */
    std::string correct_cells(vtkMultiBlockDataSet *all)
    {
        for (unsigned i = 0; all && i < all->GetNumberOfBlocks(); i++) {
            auto *grid = vtkUnstructuredGrid::SafeDownCast(all->GetBlock(i));
            if (!grid) continue;
            int64_t id = 0;
            const element_block *b = find_block(grid, id);
            if (b && has_other_cells(grid, *b)) {
                const std::string wrong = replace_cells(grid, id, *b);
                if (!wrong.empty()) return describe(id, *b) + " " + wrong;
            }
            if (GetSqueezePoints()) continue;
            const std::string bad = find_bad_cell(grid);
            if (!bad.empty()) return "element block " + std::to_string(id) + ": " + bad;
            std::vector<vtkIdType> cells(static_cast<size_t>(grid->GetNumberOfCells()));
            std::iota(cells.begin(), cells.end(), vtkIdType{0});
            all->SetBlock(i, extract_cells(grid, cells));
        }
        return "";
    }

    std::string replace_cells(vtkUnstructuredGrid *grid, int64_t id, const element_block &b)
    {
        if (GetSqueezePoints() || find_shape(b).cell_type == VTK_EMPTY_CELL) return "are of no type that is read";
        const exodus_file file(GetFileName());
        return set_cells(grid, b, file.is_open() ? file.connectivity(id, b) : std::vector<int64_t>{});
    }
};

vtkStandardNewMacro(reader)

} // namespace

vtkSmartPointer<vtkAlgorithm> make_exodus_reader(const std::string &path)
{
    auto r = vtkSmartPointer<reader>::New();
    const exodus_file file(path);
    if (file.is_open()) {
        const auto blocks = file.blocks();
        for (const auto &[id, b] : blocks) check_elements(path, id, b);
        r->SetSqueezePoints(std::all_of(blocks.begin(), blocks.end(), [](auto &b) { return has_vtk_type(b.second); }));
        r->set_blocks(blocks);
    }
    r->SetFileName(path.c_str());
    r->UpdateInformation();
    r->SetAllArrayStatus(vtkExodusIIReader::NODAL, 1);
    r->SetAllArrayStatus(vtkExodusIIReader::ELEM_BLOCK, 1);
    return r;
}

/* Warns of displaced points: VTK's reader displaces the points by the first vector field at nodes whose name begins
 * with "dis". */
std::string exodus_warnings(const std::string &path, vtkAlgorithm *algorithm)
{
    auto *r = vtkExodusIIReader::SafeDownCast(algorithm);
    for (int i = 0; r && r->GetApplyDisplacements() && i < r->GetNumberOfPointResultArrays(); i++) {
        const std::string name = r->GetPointResultArrayName(i);
        if (upper(name.substr(0, 3)) != "DIS" ||
            r->GetNumberOfObjectArrayComponents(vtkExodusIIReader::NODAL, i) != r->GetDimensionality())
            continue;
        return std::string(path)
            .append(": points are moved by the displacement \"")
            .append(name)
            .append("\" of the file\n");
    }
    return "";
}

} // namespace render_tool
