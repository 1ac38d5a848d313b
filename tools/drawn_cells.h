/* Selects the cells and points of a grid that a picture shows. */
#ifndef DRAWN_CELLS_H
#define DRAWN_CELLS_H

#include <vector>

#include <vtkSmartPointer.h>

class vtkUnstructuredGrid;

namespace render_tool
{

/* Flags of the selected cells of a grid and of the points that they use. Both are empty if all cells and points are
 * selected. */
struct selection {
    std::vector<bool> cells, points;
};

/* Selects the cells whose ghost flags do not hide them. If these are all cells, all points are selected, also those
 * that no cell uses. */
selection select_visible_cells(vtkUnstructuredGrid *grid);

/* Selects the visible cells that have two or three dimensions. The adaptor does not draw some of these cells: triangle
 * strips, convex point sets and cells with too few points. */
selection select_drawn_cells(vtkUnstructuredGrid *grid);

/* Returns a grid of the cells of select_drawn_cells(), with the points that they use. Returns `grid` itself if these
 * are all of its cells and points. */
vtkSmartPointer<vtkUnstructuredGrid> extract_drawn_cells(vtkUnstructuredGrid *grid);

} // namespace render_tool

#endif
