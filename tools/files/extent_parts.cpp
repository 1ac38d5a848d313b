/* An extent is divided recursively: its longest axis is cut in two, and the ranks that share the extent are divided
 * into two sets, one for each side of the cut. Therefore parts are compact. If axes have equal length, the slowest one
 * is cut, so that a part consists of long sequences of bytes of the file. */
#include "extent_parts.h"

#include <algorithm>
#include <cmath>

#include <vtkImageData.h>
#include <vtkRectilinearGrid.h>
#include <vtkStructuredGrid.h>

namespace render_tool
{

namespace
{

int count_cells_along_axis(const extent &of, size_t axis)
{
    return of[2 * axis + 1] - of[2 * axis];
}

size_t longest_axis(const extent &of)
{
    size_t longest = 2;
    for (const size_t axis : {size_t{1}, size_t{0}})
        if (count_cells_along_axis(of, axis) > count_cells_along_axis(of, longest)) longest = axis;
    return longest;
}

/* All distributed cells are divided into equal parts, one per rank. Returns the index of the first cell of the rank's
 * part. */
double compute_first_cell_of_rank(const cell_range &range, int rank, int ranks)
{
    return static_cast<double>(range.total) * rank / ranks;
}

} // namespace

bool find_extent(vtkDataObject *data, extent &out)
{
    if (auto *image = vtkImageData::SafeDownCast(data))
        image->GetExtent(out.data());
    else if (auto *rectilinear = vtkRectilinearGrid::SafeDownCast(data))
        rectilinear->GetExtent(out.data());
    else if (auto *curvilinear = vtkStructuredGrid::SafeDownCast(data))
        curvilinear->GetExtent(out.data());
    else
        return false;
    return count_cells_of_extent(out) > 0;
}

int64_t count_cells_of_extent(const extent &whole)
{
    int64_t cells = 1;
    int dimensions = 0;
    for (size_t axis = 0; axis < 3; axis++) {
        const int along = count_cells_along_axis(whole, axis);
        if (along < 0) return 0;
        if (along == 0) continue;
        cells *= along;
        dimensions++;
    }
    return dimensions > 1 ? cells : 0;
}

bool find_part_of_extent(const extent &whole, const cell_range &range, int rank, int ranks, extent &part)
{
    int first = 0, end = ranks; /* the ranks among which `part` is divided */
    auto low = static_cast<double>(range.first), high = static_cast<double>(range.first + range.count);
    part = whole;
    while (end - first > 1) {
        const int middle = (first + end) / 2;
        const double border = std::clamp(compute_first_cell_of_rank(range, middle, ranks), low, high);
        const size_t axis = longest_axis(part);
        const double share = high > low ? (border - low) / (high - low) : 0;
        const int cut = part[2 * axis] + static_cast<int>(std::lround(share * count_cells_along_axis(part, axis)));
        if (rank < middle) {
            part[2 * axis + 1] = cut;
            high = border;
            end = middle;
        } else {
            part[2 * axis] = cut;
            low = border;
            first = middle;
        }
        if (count_cells_along_axis(part, axis) == 0) return false;
    }
    return true;
}

vtkSmartPointer<vtkDataSet> crop(vtkDataSet *data, const extent &part)
{
    auto copy = vtkSmartPointer<vtkDataSet>::Take(data->NewInstance());
    copy->ShallowCopy(data);
    copy->Crop(part.data());
    return copy;
}

} // namespace render_tool
