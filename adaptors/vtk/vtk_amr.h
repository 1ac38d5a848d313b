/* Converts the levels of overlapping AMR to levels of refinement of one mesh. */
#ifndef VTK_AMR_H
#define VTK_AMR_H

#include <array>
#include <cstdint>
#include <vector>

#include "insitu/insitu.h"

class vtkOverlappingAMR;

namespace insitu_vtk
{

/* For each level and axis: the number of the level's cells along one cell of level 0. */
using amr_refinements = std::vector<std::array<int64_t, 3>>;

/* Finds the refinement of each level. Returns an empty list if boxes, spacings or ratios are not set, or if a box
 * begins or ends within a cell of the next coarser level. The result is the same on all ranks, because VTK requires
 * these data on every rank. */
amr_refinements find_refinements(vtkOverlappingAMR *amr);

/* Describes the lattice of a grid as a part of its level: sets the origin to that of the AMR, `first` to the first
 * index of the grid's box, and the refinement if there are several levels. Returns false without changes if the box
 * does not fit the grid. */
bool place_on_level(vtkOverlappingAMR *amr, const amr_refinements &refinements, unsigned level, unsigned number,
                    insitu_lattice &lattice);

} // namespace insitu_vtk

#endif
