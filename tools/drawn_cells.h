/* Leaves out what a picture does not show of a grid. */
#ifndef DRAWN_CELLS_H
#define DRAWN_CELLS_H

#include <vtkDataSetAttributes.h>
#include <vtkSmartPointer.h>

class vtkUnstructuredGrid;

namespace render_tool
{

/* Ghost flags of the cells that are not drawn. */
constexpr int hiding_flags =
    vtkDataSetAttributes::DUPLICATECELL | vtkDataSetAttributes::HIDDENCELL | vtkDataSetAttributes::REFINEDCELL;

/* Returns a grid of those cells that have two or three dimensions and are not hidden, with the points that they use.
 * Returns `grid` itself if these are all of its cells and points. The adaptor does not draw some of these cells:
 * triangle strips, convex point sets and cells with too few points. */
vtkSmartPointer<vtkUnstructuredGrid> extract_drawn_cells(vtkUnstructuredGrid *grid);

} // namespace render_tool

#endif
