/* Divides structured data sets among ranks: by extents, so that no cells need to be listed. */
#ifndef EXTENT_PARTS_H
#define EXTENT_PARTS_H

#include <array>
#include <cstdint>

#include <vtkSmartPointer.h>

class vtkDataObject;
class vtkDataSet;

namespace render_tool
{

/* The first and the last point along each axis, as in VTK. */
using extent = std::array<int, 6>;

/* Returns true, and the extent, if data is an image, a rectilinear or a curvilinear grid with cells of two or three
 * dimensions. */
bool find_extent(vtkDataObject *data, extent &out);

/* Returns the number of cells of two or three dimensions in the extent; 0 if it has fewer dimensions. */
int64_t count_cells_of_extent(const extent &whole);

/* A range of the cells that are distributed to ranks: the index of its first cell and its number of cells. `total` is
 * the number of all distributed cells. */
struct cell_range {
    int64_t first, count, total;
};

/* Finds the rank's part of one structured data set: `whole` is its extent, and `range` says which of all distributed
 * cells are its cells. All distributed cells are divided into equal parts, one per rank. The size of the part that a
 * rank gets of this data set is proportional to the number of cells that the rank's equal part and `range` have in
 * common. Returns false if the rank gets no part. */
bool find_part_of_extent(const extent &whole, const cell_range &range, int rank, int ranks, extent &part);

/* Copies the part of a structured data set. */
vtkSmartPointer<vtkDataSet> crop(vtkDataSet *data, const extent &part);

} // namespace render_tool

#endif
