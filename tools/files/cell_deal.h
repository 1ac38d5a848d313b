/* Distributes the cells of a data set to ranks. */
#ifndef CELL_DEAL_H
#define CELL_DEAL_H

#include <string>

#include <vtkSmartPointer.h>

class vtkDataObject;

namespace render_tool
{

enum class partition {
    block,       // each rank gets a contiguous range of cells, in the order of the file
    random,      // ranks chosen by a hash of the cell's number; this partition is the worst case for compositing
    checkerboard // ranks chosen by the position of the cell's centre in a lattice of 8 × 8 × 8 boxes over the bounds
};

bool parse_partition(const std::string &text, partition &out);

/* Returns this rank's part of data, which must be the result of convert_to_drawable_data() or grids_of() (grids_of.h).
 * Every cell belongs to exactly one rank. Leaves of composites keep their numbers; those without a cell for this rank
 * are null. If all of data belongs to this rank, data itself is returned.
 *
 * - Of unstructured grids the part has the rank's cells, the points they use, and all arrays.
 * - Of structured grids it is a block. In a partition by single cells it is the whole grid, in which the cells of other
 *   ranks are hidden by ghost flags.
 * - Grids of overlapping AMR are not divided: a block must end at borders of coarser cells. */
vtkSmartPointer<vtkDataObject> distribute_cells(vtkDataObject *data, partition how, int rank, int ranks);

} // namespace render_tool

#endif
