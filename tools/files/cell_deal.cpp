/* Cells are numbered through all leaves of a data set in the order of VTK's iterator. The owner depends only on a
 * cell's number or position, so ranks with the same data agree without communication. */
#include "cell_deal.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include <vtkAMRInformation.h>
#include <vtkBoundingBox.h>
#include <vtkCellData.h>
#include <vtkCompositeDataIterator.h>
#include <vtkCompositeDataSet.h>
#include <vtkDataSetAttributes.h>
#include <vtkFieldData.h>
#include <vtkIdList.h>
#include <vtkMultiBlockDataSet.h>
#include <vtkNew.h>
#include <vtkOverlappingAMR.h>
#include <vtkUniformGrid.h>
#include <vtkUnsignedCharArray.h>
#include <vtkUnstructuredGrid.h>

#include "cell_extract.h"
#include "extent_parts.h"
#include "insitu/vtk_grids.h"

namespace render_tool
{

namespace
{

struct leaf {
    vtkDataObject *data; // data of the leaf; null if the leaf is empty
    int64_t first_cell;  // index of the leaf's first cell among the cells of all leaves
};

/* Returns a hash of the number (the finalizer of splitmix64). */
uint64_t hash_number(uint64_t x)
{
    x += 0x9e3779b97f4a7c15u;
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
    return x ^ (x >> 31);
}

class owner
{
  public:
    owner(partition how, int ranks, int64_t cells, const vtkBoundingBox &bounds)
        : how_(how), ranks_(ranks), cells_(cells), bounds_(bounds)
    {
    }

    int of(vtkDataSet *grid, vtkIdType cell, int64_t number) const
    {
        const auto ranks = static_cast<uint64_t>(ranks_);
        switch (how_) {
        case partition::random: return static_cast<int>(hash_number(static_cast<uint64_t>(number)) % ranks);
        case partition::checkerboard: return static_cast<int>(square(grid, cell) % ranks);
        default: return static_cast<int>(number * ranks_ / cells_);
        }
    }

  private:
    uint64_t square(vtkDataSet *grid, vtkIdType cell) const
    {
        vtkNew<vtkIdList> points;
        grid->GetCellPoints(cell, points);
        const vtkIdType count = points->GetNumberOfIds();
        uint64_t sum = 0;
        for (int axis = 0; axis < 3; axis++) {
            double centre = 0;
            for (vtkIdType i = 0; i < count; i++) centre += grid->GetPoint(points->GetId(i))[axis];
            const double length = bounds_.GetLength(axis);
            if (count == 0 || !(length > 0)) continue;
            const double at = (centre / static_cast<double>(count) - bounds_.GetMinPoint()[axis]) / length * 8;
            sum += static_cast<uint64_t>(std::clamp(at, 0.0, 7.0));
        }
        return sum;
    }

    partition how_;
    int64_t ranks_;
    int64_t cells_;
    const vtkBoundingBox &bounds_;
};

std::vector<leaf> list_leaves(vtkDataObject *data)
{
    std::vector<leaf> leaves;
    auto *composite = vtkCompositeDataSet::SafeDownCast(data);
    if (!composite) return {{data, 0}};
    const auto it = vtkSmartPointer<vtkCompositeDataIterator>::Take(composite->NewIterator());
    it->SkipEmptyNodesOff();
    for (it->InitTraversal(); !it->IsDoneWithTraversal(); it->GoToNextItem())
        leaves.push_back({it->GetCurrentDataObject(), 0});
    return leaves;
}

int64_t number_cells(std::vector<leaf> &leaves, vtkBoundingBox &bounds)
{
    int64_t count = 0;
    for (leaf &l : leaves) {
        l.first_cell = count;
        auto *grid = vtkDataSet::SafeDownCast(l.data);
        if (!grid || grid->GetNumberOfCells() == 0) continue;
        count += grid->GetNumberOfCells();
        bounds.AddBounds(grid->GetBounds());
    }
    return count;
}

vtkSmartPointer<vtkDataObject> extract_part(vtkUnstructuredGrid *grid, int64_t first_cell, const owner &owners,
                                            int rank)
{
    std::vector<vtkIdType> mine;
    for (vtkIdType i = 0; i < grid->GetNumberOfCells(); i++)
        if (owners.of(grid, i, first_cell + i) == rank) mine.push_back(i);
    if (mine.empty()) return nullptr;
    if (static_cast<vtkIdType>(mine.size()) == grid->GetNumberOfCells()) return grid;
    return extract_cells(grid, mine);
}

/* Returns a copy of a structured grid in which the cells that belong to other ranks are hidden. Returns null if no cell
 * belongs to this rank. */
vtkSmartPointer<vtkDataObject> hide_others(vtkDataSet *grid, int64_t first_cell, const owner &owners, int rank)
{
    const vtkIdType count = grid->GetNumberOfCells();
    const auto given = vtkSmartPointer<vtkUnsignedCharArray>::Take(insitu_vtk_ghost_flags(grid->GetCellData(), count));
    vtkNew<vtkUnsignedCharArray> flags;
    flags->SetName(vtkDataSetAttributes::GhostArrayName());
    flags->SetNumberOfValues(count);
    vtkIdType mine = 0;
    for (vtkIdType i = 0; i < count; i++) {
        const bool is_mine = owners.of(grid, i, first_cell + i) == rank;
        const unsigned flag = given ? given->GetValue(i) : 0;
        mine += is_mine;
        flags->SetValue(i, static_cast<unsigned char>(is_mine ? flag : flag | vtkDataSetAttributes::HIDDENCELL));
    }
    if (mine == 0) return nullptr;
    if (mine == count) return grid;
    auto copy = vtkSmartPointer<vtkDataSet>::Take(grid->NewInstance());
    copy->ShallowCopy(grid);
    copy->GetCellData()->AddArray(flags);
    return copy;
}

/* How the cells of a data set are distributed to ranks, and the rank whose part is extracted. */
struct deal {
    const owner &owners;
    partition how;
    int rank, ranks;
    int64_t cells;
};

/* Returns this rank's part of a leaf. */
vtkSmartPointer<vtkDataObject> make_part_of_leaf(const leaf &l, const deal &d)
{
    extent whole, part;
    if (auto *grid = vtkUnstructuredGrid::SafeDownCast(l.data))
        return extract_part(grid, l.first_cell, d.owners, d.rank);
    if (!find_extent(l.data, whole)) return d.rank == 0 ? l.data : nullptr;
    auto *grid = vtkDataSet::SafeDownCast(l.data);
    if (d.how != partition::block) return hide_others(grid, l.first_cell, d.owners, d.rank);
    if (!find_part_of_extent(whole, {l.first_cell, count_cells_of_extent(whole), d.cells}, d.rank, d.ranks, part))
        return nullptr;
    if (part == whole) return grid;
    return crop(grid, part);
}

/* Distributes the grids of overlapping AMR. The boxes of all levels stay on all ranks. */
vtkSmartPointer<vtkDataObject> make_part_of_amr(vtkOverlappingAMR *amr, const std::vector<leaf> &leaves, const deal &d)
{
    std::vector<int> counts;
    for (unsigned level = 0; level < amr->GetNumberOfLevels(); level++)
        counts.push_back(static_cast<int>(amr->GetNumberOfDataSets(level)));
    auto part = vtkSmartPointer<vtkOverlappingAMR>::New();
    part->Initialize(static_cast<int>(counts.size()), counts.data());
    part->SetAMRInfo(amr->GetAMRInfo());
    part->SetFieldData(amr->GetFieldData());
    size_t number = 0;
    for (unsigned level = 0; level < amr->GetNumberOfLevels(); level++)
        for (unsigned i = 0; i < amr->GetNumberOfDataSets(level); i++, number++) {
            const leaf &l = leaves[number];
            auto *grid = vtkUniformGrid::SafeDownCast(l.data);
            if (!grid) continue;
            const int64_t middle = l.first_cell + grid->GetNumberOfCells() / 2;
            vtkSmartPointer<vtkDataObject> mine;
            if (d.how != partition::block)
                mine = hide_others(grid, l.first_cell, d.owners, d.rank);
            else if (middle * d.ranks / d.cells == d.rank)
                mine = grid;
            if (mine) part->SetDataSet(level, i, vtkUniformGrid::SafeDownCast(mine));
        }
    return part;
}

} // namespace

bool parse_partition(const std::string &text, partition &out)
{
    if (text == "block")
        out = partition::block;
    else if (text == "random")
        out = partition::random;
    else if (text == "checkerboard")
        out = partition::checkerboard;
    else
        return false;
    return true;
}

vtkSmartPointer<vtkDataObject> distribute_cells(vtkDataObject *data, partition how, int rank, int ranks)
{
    if (!data || ranks == 1) return data;
    std::vector<leaf> leaves = list_leaves(data);
    vtkBoundingBox bounds;
    const int64_t cells = std::max<int64_t>(number_cells(leaves, bounds), 1);
    const owner owners(how, ranks, cells, bounds);
    const deal d = {owners, how, rank, ranks, cells};
    if (auto *amr = vtkOverlappingAMR::SafeDownCast(data)) return make_part_of_amr(amr, leaves, d);
    if (!vtkCompositeDataSet::SafeDownCast(data)) return make_part_of_leaf(leaves[0], d);
    auto all = vtkSmartPointer<vtkMultiBlockDataSet>::New();
    all->SetNumberOfBlocks(static_cast<unsigned>(leaves.size()));
    for (size_t i = 0; i < leaves.size(); i++) all->SetBlock(static_cast<unsigned>(i), make_part_of_leaf(leaves[i], d));
    return all;
}

} // namespace render_tool
