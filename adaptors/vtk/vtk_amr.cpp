/* Every rank has the boxes of all levels, including those whose data are on other ranks. A box is a range of cell
 * indices of its level, counted from a common origin. From the boxes, the session finds which cells are covered by
 * finer levels. */
#include "vtk_amr.h"

#include <algorithm>
#include <cmath>

#include <vtkAMRBox.h>
#include <vtkAMRInformation.h>
#include <vtkOverlappingAMR.h>

namespace insitu_vtk
{

namespace
{

/* Relative tolerance for numbers that writers compute in different ways; rounding errors are far below it. */
constexpr double tolerance = 1e-6;

/* Returns a / b if the quotient is an integer within rounding, otherwise 0. */
int64_t compute_whole_ratio(double a, double b)
{
    if (!(a > 0) || !(b > 0) || !(a / b < 1e6)) return 0;
    const int64_t ratio = std::llround(a / b);
    return std::abs(a / b - static_cast<double>(ratio)) <= tolerance * a / b ? ratio : 0;
}

/* Computes, for each axis, the number of the level's cells along a cell of the next coarser level; 0 if it is
 * unknown. */
std::array<int64_t, 3> compute_ratios_to_coarser(vtkAMRInformation *information, unsigned level)
{
    std::array<int64_t, 3> ratios{};
    if (information->HasSpacing(level - 1) && information->HasSpacing(level)) {
        double coarse[3], fine[3];
        information->GetSpacing(level - 1, coarse);
        information->GetSpacing(level, fine);
        for (size_t axis = 0; axis < 3; axis++) ratios[axis] = compute_whole_ratio(coarse[axis], fine[axis]);
    } else if (information->HasRefinementRatio()) {
        ratios.fill(std::max(information->GetRefinementRatio(level - 1), 0));
    }
    return ratios;
}

/* Checks whether the box begins and ends at borders of cells of the coarser level. Along an axis without cells, the
 * ratio is ignored. */
bool fits_coarser_level(const vtkAMRBox &box, const std::array<int64_t, 3> &ratios)
{
    for (int axis = 0; axis < 3; axis++) {
        const int64_t ratio = ratios[static_cast<size_t>(axis)];
        if (box.EmptyDimension(axis)) continue;
        if (ratio < 1 || box.GetLoCorner()[axis] % ratio != 0 || (box.GetHiCorner()[axis] + 1) % ratio != 0)
            return false;
    }
    return true;
}

} // namespace

amr_refinements find_refinements(vtkOverlappingAMR *amr)
{
    vtkAMRInformation *information = amr->GetAMRInfo();
    amr_refinements out;
    if (!information) return out;
    for (unsigned level = 0; level < amr->GetNumberOfLevels(); level++) {
        const unsigned count = amr->GetNumberOfDataSets(level);
        std::array<int64_t, 3> ratios = {1, 1, 1};
        if (count == 0) break;
        if (level > 0) ratios = compute_ratios_to_coarser(information, level);
        for (unsigned number = 0; number < count; number++) {
            const vtkAMRBox &box = amr->GetAMRBox(level, number);
            if (box.IsInvalid() || !fits_coarser_level(box, ratios)) return {};
        }
        for (size_t axis = 0; axis < 3 && level > 0; axis++)
            ratios[axis] = std::max<int64_t>(ratios[axis], 1) * out.back()[axis];
        out.push_back(ratios);
    }
    return out;
}

bool place_on_level(vtkOverlappingAMR *amr, const amr_refinements &refinements, unsigned level, unsigned number,
                    insitu_lattice &lattice)
{
    if (level >= refinements.size()) return false;
    const vtkAMRBox &box = amr->GetAMRBox(level, number);
    const double *origin = amr->GetOrigin();
    insitu_lattice placed = lattice;
    for (int axis = 0; axis < 3; axis++) {
        const int64_t low = box.GetLoCorner()[axis], cells = lattice.cells[axis];
        if (cells == 0 && box.EmptyDimension(axis)) continue;
        const double first =
            (lattice.origin[axis] - origin[axis]) / lattice.spacing[axis] + static_cast<double>(lattice.first[axis]);
        if (box.EmptyDimension(axis) || box.GetHiCorner()[axis] + 1 - low != cells ||
            !(std::abs(first - static_cast<double>(low)) <= tolerance * (1 + std::abs(first))))
            return false;
        placed.origin[axis] = origin[axis];
        placed.first[axis] = low;
        if (refinements.size() > 1) placed.refinement[axis] = refinements[level][static_cast<size_t>(axis)];
    }
    lattice = placed;
    return true;
}

} // namespace insitu_vtk
