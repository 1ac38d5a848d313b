/* Deals the cells of a data set out to ranks. */
#ifndef CELL_DEAL_H
#define CELL_DEAL_H

#include <string>

#include <vtkSmartPointer.h>

class vtkDataObject;

namespace render_tool
{

enum class partition {
    block,       // contiguous runs of cells, in the order of the file
    random,      // by a hash of the cell's number: the worst case for compositing
    checkerboard // by the cell's centre on a lattice of 8 × 8 × 8 over the bounds
};

bool parse_partition(const std::string &text, partition &out);

/* This rank's part of data, which has unstructured grids only (grids_of.h): the rank's cells, with the points they use
 * and all arrays. Every cell goes to exactly one rank. Leaves of composites keep their numbers; those without a cell
 * for this rank are null. data is returned as it is where all of it belongs to this rank. */
vtkSmartPointer<vtkDataObject> deal(vtkDataObject *data, partition how, int rank, int ranks);

} // namespace render_tool

#endif
