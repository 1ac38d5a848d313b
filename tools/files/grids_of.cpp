#include "grids_of.h"

#include "extent_parts.h"
#include "insitu/vtk_grids.h"

#include <stdexcept>
#include <vector>

#include <vtkAMRUtilities.h>
#include <vtkCellArray.h>
#include <vtkCellData.h>
#include <vtkCompositeDataIterator.h>
#include <vtkCompositeDataSet.h>
#include <vtkMultiBlockDataSet.h>
#include <vtkNew.h>
#include <vtkOverlappingAMR.h>
#include <vtkTypeInt32Array.h>
#include <vtkTypeInt64Array.h>
#include <vtkUnsignedCharArray.h>
#include <vtkUnstructuredGrid.h>

namespace render_tool
{

namespace
{

/* Returns the grid, or a shallow copy with ghost flags of VTK's type if its cells have other ghost flags. */
vtkSmartPointer<vtkUnstructuredGrid> convert_ghosts_to_bytes(vtkUnstructuredGrid *grid)
{
    const auto flags = vtkSmartPointer<vtkUnsignedCharArray>::Take(
        insitu_vtk_ghost_flags(grid->GetCellData(), grid->GetNumberOfCells()));
    if (!flags || flags == grid->GetCellGhostArray()) return grid;
    auto copy = vtkSmartPointer<vtkUnstructuredGrid>::New();
    copy->ShallowCopy(grid);
    copy->GetCellData()->RemoveArray("avtGhostZones");
    copy->GetCellData()->AddArray(flags);
    return copy;
}

/* Returns the leaves of a composite as a multiblock, each converted by the function. */
template <typename Convert>
vtkSmartPointer<vtkDataObject> convert_leaves(vtkCompositeDataSet *composite, Convert convert)
{
    std::vector<vtkSmartPointer<vtkDataObject>> leaves;
    const auto it = vtkSmartPointer<vtkCompositeDataIterator>::Take(composite->NewIterator());
    it->SkipEmptyNodesOff();
    for (it->InitTraversal(); !it->IsDoneWithTraversal(); it->GoToNextItem()) {
        vtkDataObject *leaf = it->GetCurrentDataObject();
        leaves.push_back(leaf ? convert(leaf) : nullptr);
    }
    auto all = vtkSmartPointer<vtkMultiBlockDataSet>::New();
    all->SetNumberOfBlocks(static_cast<unsigned>(leaves.size()));
    for (size_t i = 0; i < leaves.size(); i++) all->SetBlock(static_cast<unsigned>(i), leaves[i]);
    return all;
}

/* Converts a leaf to an unstructured grid. An object that is not a data set is returned unchanged. */
vtkSmartPointer<vtkDataObject> convert_leaf_to_grid(vtkDataObject *leaf, const std::string &path)
{
    auto *data = vtkDataSet::SafeDownCast(leaf);
    if (!data) return leaf;
    vtkSmartPointer<vtkUnstructuredGrid> grid = vtkUnstructuredGrid::SafeDownCast(data);
    if (!grid) grid.TakeReference(insitu_vtk_make_grid(data));
    const std::string bad = find_bad_cell(grid);
    if (!bad.empty()) throw std::runtime_error(path + ": " + bad);
    return convert_ghosts_to_bytes(grid);
}

template <typename Array>
std::string find_bad_id(Array *offsets, Array *connectivity, vtkIdType cells, vtkIdType points)
{
    const auto *at = offsets->GetPointer(0);
    const auto *ids = connectivity->GetPointer(0);
    const vtkIdType length = connectivity->GetNumberOfValues();
    for (vtkIdType i = 0; i < cells; i++) {
        const std::string cell = "cell " + std::to_string(i) + ": ";
        if (at[i] < 0 || at[i] > at[i + 1] || at[i + 1] > length)
            return cell + "lies outside the " + std::to_string(length) + " entries of the connectivity";
        for (vtkIdType k = at[i]; k < at[i + 1]; k++)
            if (ids[k] < 0 || ids[k] >= points)
                return cell + "has the point " + std::to_string(ids[k]) + ", of " + std::to_string(points) + " points";
    }
    return "";
}

} // namespace

std::string find_bad_cell(vtkUnstructuredGrid *grid)
{
    vtkCellArray *cells = grid->GetCells();
    const vtkIdType count = cells ? cells->GetNumberOfCells() : 0;
    if (count == 0) return "";
    vtkUnsignedCharArray *types = grid->GetCellTypesArray();
    const vtkIdType type_count = types ? types->GetNumberOfValues() : 0;
    if (type_count != count) return std::to_string(count) + " cells but " + std::to_string(type_count) + " cell types";
    const vtkIdType points = grid->GetNumberOfPoints();
    if (cells->IsStorage64Bit())
        return find_bad_id(cells->GetOffsetsArray64(), cells->GetConnectivityArray64(), count, points);
    return find_bad_id(cells->GetOffsetsArray32(), cells->GetConnectivityArray32(), count, points);
}

vtkSmartPointer<vtkDataObject> grids_of(vtkDataObject *data, const std::string &path)
{
    auto *composite = vtkCompositeDataSet::SafeDownCast(data);
    if (!composite) return convert_leaf_to_grid(data, path);
    if (auto *amr = vtkOverlappingAMR::SafeDownCast(data)) vtkAMRUtilities::BlankCells(amr);
    return convert_leaves(composite, [&](vtkDataObject *leaf) { return convert_leaf_to_grid(leaf, path); });
}

vtkSmartPointer<vtkDataObject> convert_to_drawable_data(vtkDataObject *data, const std::string &path)
{
    const auto convert = [&](vtkDataObject *leaf) -> vtkSmartPointer<vtkDataObject> {
        extent whole;
        if (find_extent(leaf, whole)) return leaf;
        return convert_leaf_to_grid(leaf, path);
    };
    auto *composite = vtkCompositeDataSet::SafeDownCast(data);
    if (!composite) return convert(data);
    auto *amr = vtkOverlappingAMR::SafeDownCast(data);
    if (!amr) return convert_leaves(composite, convert);
    vtkAMRUtilities::BlankCells(amr);
    return amr;
}

std::vector<int> count_leaves_of_blocks(vtkDataObject *data)
{
    std::vector<int> counts;
    auto *blocks = vtkMultiBlockDataSet::SafeDownCast(data);
    for (unsigned b = 0; blocks && b < blocks->GetNumberOfBlocks(); b++) {
        vtkNew<vtkMultiBlockDataSet> one;
        one->SetBlock(0, blocks->GetBlock(b));
        const auto it = vtkSmartPointer<vtkCompositeDataIterator>::Take(one->NewIterator());
        it->SkipEmptyNodesOff();
        int count = 0;
        for (it->InitTraversal(); !it->IsDoneWithTraversal(); it->GoToNextItem()) count++;
        counts.push_back(blocks->GetBlock(b) ? count : -1);
    }
    return counts;
}

void add_empty_leaves(vtkDataObject *data, const std::vector<int> &leaf_counts)
{
    auto *blocks = vtkMultiBlockDataSet::SafeDownCast(data);
    for (unsigned b = 0; blocks && b < blocks->GetNumberOfBlocks(); b++) {
        const int count = leaf_counts[b];
        if (blocks->GetBlock(b) || count < 0 || count == 1) continue;
        vtkNew<vtkMultiBlockDataSet> empty;
        empty->SetNumberOfBlocks(static_cast<unsigned>(count));
        blocks->SetBlock(b, empty);
    }
}

std::vector<leaf_mesh> list_leaf_meshes(vtkDataObject *data, const std::string &name)
{
    const auto has_polygons_or_polyhedra = [](vtkDataObject *leaf) {
        auto *grid = vtkUnstructuredGrid::SafeDownCast(leaf);
        return grid && insitu_vtk_has_polygons_or_polyhedra(grid);
    };
    auto *composite = vtkCompositeDataSet::SafeDownCast(data);
    if (!data) return {};
    if (!composite) return {{name, has_polygons_or_polyhedra(data)}};
    std::vector<leaf_mesh> leaves;
    const auto it = vtkSmartPointer<vtkCompositeDataIterator>::Take(composite->NewIterator());
    it->SkipEmptyNodesOff();
    for (it->InitTraversal(); !it->IsDoneWithTraversal(); it->GoToNextItem())
        leaves.push_back(
            {name + "/" + std::to_string(leaves.size()), has_polygons_or_polyhedra(it->GetCurrentDataObject())});
    return leaves;
}

} // namespace render_tool
