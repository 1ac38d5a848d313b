/* Every rank has the boxes of all levels, including those whose data are on other ranks. A box is a range of cell
 * indices of its level, counted from a common origin. Divided by the refinement ratio, it is a box of the coarser
 * level; the cells in it are refined. */
#include "vtk_amr.h"

#include "insitu/vtk_grids.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <vtkAMRBox.h>
#include <vtkAMRInformation.h>
#include <vtkCellData.h>
#include <vtkDataSet.h>
#include <vtkDataSetAttributes.h>
#include <vtkOverlappingAMR.h>
#include <vtkUnsignedCharArray.h>

namespace insitu_vtk
{

namespace
{

/* The cells from low to high - 1 along each axis. An axis without extent counts as one cell. */
struct box {
    std::array<int64_t, 3> low{}, high{};

    bool is_empty() const { return low[0] >= high[0] || low[1] >= high[1] || low[2] >= high[2]; }
    int64_t size(size_t axis) const { return high[axis] - low[axis]; }
    int64_t cells() const { return size(0) * size(1) * size(2); }
};

int64_t rounded_down(int64_t a, int64_t b)
{
    return a / b - (a % b < 0 ? 1 : 0);
}

/* Converts an AMR box, divided by the refinement ratio. The result is empty if the box was never set. */
box cells_of(const vtkAMRBox &of, int64_t ratio)
{
    box b;
    if (of.IsInvalid()) return b;
    for (int axis = 0; axis < 3; axis++) {
        const auto a = static_cast<size_t>(axis);
        b.high[a] = 1;
        if (of.EmptyDimension(axis)) continue;
        b.low[a] = rounded_down(of.GetLoCorner()[axis], ratio);
        b.high[a] = rounded_down(of.GetHiCorner()[axis], ratio) + 1;
    }
    return b;
}

box intersection(const box &a, const box &b)
{
    box c;
    for (size_t axis = 0; axis < 3; axis++) {
        c.low[axis] = std::max(a.low[axis], b.low[axis]);
        c.high[axis] = std::min(a.high[axis], b.high[axis]);
    }
    return c;
}

/* Returns the refinement ratio to the next level, or 0 if neither spacings nor ratios are set. */
int64_t ratio_to_next(vtkOverlappingAMR *amr, unsigned level)
{
    vtkAMRInformation *information = amr->GetAMRInfo();
    if (information->HasSpacing(level) && information->HasSpacing(level + 1)) {
        double coarse[3], fine[3];
        information->GetSpacing(level, coarse);
        information->GetSpacing(level + 1, fine);
        int64_t ratio =
            0; /* the largest over the axes: flat data may have the same spacing on all levels along one axis */
        for (int axis = 0; axis < 3; axis++)
            if (fine[axis] > 0 && coarse[axis] >= fine[axis])
                ratio = std::max<int64_t>(ratio, std::llround(coarse[axis] / fine[axis]));
        if (ratio > 0) return ratio;
    }
    return information->HasRefinementRatio() ? information->GetRefinementRatio(level) : 0;
}

/* Returns a copy of data's ghost flags, or zeros if there are none. */
vtkSmartPointer<vtkUnsignedCharArray> copy_flags(vtkDataSet *data)
{
    const auto own = vtkSmartPointer<vtkUnsignedCharArray>::Take(
        insitu_vtk_ghost_flags(data->GetCellData(), data->GetNumberOfCells()));
    auto flags = vtkSmartPointer<vtkUnsignedCharArray>::New();
    flags->SetName(vtkDataSetAttributes::GhostArrayName());
    flags->SetNumberOfValues(data->GetNumberOfCells());
    for (vtkIdType i = 0; i < data->GetNumberOfCells(); i++) flags->SetValue(i, own ? own->GetValue(i) : 0);
    return flags;
}

/* Sets REFINEDCELL for the cells of box `in` that lie in `part`. In the array i varies fastest. */
void flag_refined(const box &in, const box &part, vtkUnsignedCharArray *flags)
{
    for (int64_t k = part.low[2]; k < part.high[2]; k++)
        for (int64_t j = part.low[1]; j < part.high[1]; j++) {
            const int64_t row = ((k - in.low[2]) * in.size(1) + j - in.low[1]) * in.size(0) - in.low[0];
            for (int64_t i = part.low[0]; i < part.high[0]; i++)
                flags->SetValue(row + i, flags->GetValue(row + i) | vtkDataSetAttributes::REFINEDCELL);
        }
}

} // namespace

vtkSmartPointer<vtkUnsignedCharArray> make_refined_flags(vtkOverlappingAMR *amr, unsigned level, unsigned number,
                                                         vtkDataSet *data, const std::string &what, conversion_log &log)
{
    vtkSmartPointer<vtkUnsignedCharArray> flags;
    if (!amr->GetAMRInfo() || level + 1 >= amr->GetNumberOfLevels()) return flags;
    const unsigned finer = amr->GetNumberOfDataSets(level + 1);
    const box own = cells_of(amr->GetAMRBox(level, number), 1);
    const int64_t ratio = ratio_to_next(amr, level);
    if (finer > 0 && (own.cells() != data->GetNumberOfCells() || ratio < 1)) {
        log.warn(what + ": the AMR's boxes, spacings or ratios are not set, or are not those of its grids: only ghost "
                        "flags tell which of its cells are refined");
        return flags;
    }
    for (unsigned i = 0; i < finer; i++) {
        const box part = intersection(own, cells_of(amr->GetAMRBox(level + 1, i), ratio));
        if (part.is_empty()) continue;
        if (!flags) flags = copy_flags(data);
        flag_refined(own, part, flags);
    }
    return flags;
}

} // namespace insitu_vtk
