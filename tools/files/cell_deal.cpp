/* Cells are numbered through all leaves of a data set in the order of VTK's iterator. The owner depends only on a
 * cell's number or position, so ranks with the same data agree without communication. */
#include "cell_deal.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include <vtkBoundingBox.h>
#include <vtkCompositeDataIterator.h>
#include <vtkCompositeDataSet.h>
#include <vtkMultiBlockDataSet.h>
#include <vtkUnstructuredGrid.h>

#include "cell_extract.h"

namespace render_tool
{

namespace
{

struct leaf {
    vtkDataObject *data; // data of the leaf; null if the leaf is empty
    int64_t first_cell;  // number of the leaf's first cell among all cells
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

    int of(vtkUnstructuredGrid *grid, vtkIdType cell, int64_t number) const
    {
        const auto ranks = static_cast<uint64_t>(ranks_);
        switch (how_) {
        case partition::random: return static_cast<int>(hash_number(static_cast<uint64_t>(number)) % ranks);
        case partition::checkerboard: return static_cast<int>(square(grid, cell) % ranks);
        default: return static_cast<int>(number * ranks_ / cells_);
        }
    }

  private:
    uint64_t square(vtkUnstructuredGrid *grid, vtkIdType cell) const
    {
        vtkIdType count = 0;
        const vtkIdType *points = nullptr;
        grid->GetCellPoints(cell, count, points);
        uint64_t sum = 0;
        for (int axis = 0; axis < 3; axis++) {
            double centre = 0;
            for (vtkIdType i = 0; i < count; i++) centre += grid->GetPoint(points[i])[axis];
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
        auto *grid = vtkUnstructuredGrid::SafeDownCast(l.data);
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
    const int64_t cells = number_cells(leaves, bounds);
    const owner owners(how, ranks, std::max<int64_t>(cells, 1), bounds);
    auto part = [&](const leaf &l) -> vtkSmartPointer<vtkDataObject> {
        if (auto *grid = vtkUnstructuredGrid::SafeDownCast(l.data))
            return extract_part(grid, l.first_cell, owners, rank);
        return rank == 0 ? l.data : nullptr;
    };
    if (!vtkCompositeDataSet::SafeDownCast(data)) return part(leaves[0]);
    auto all = vtkSmartPointer<vtkMultiBlockDataSet>::New();
    all->SetNumberOfBlocks(static_cast<unsigned>(leaves.size()));
    for (size_t i = 0; i < leaves.size(); i++) all->SetBlock(static_cast<unsigned>(i), part(leaves[i]));
    return all;
}

} // namespace render_tool
