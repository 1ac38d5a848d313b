/* Makes a grid of some of a grid's cells. */
#ifndef CELL_EXTRACT_H
#define CELL_EXTRACT_H

#include <vector>

#include <vtkSmartPointer.h>
#include <vtkType.h>

class vtkUnstructuredGrid;

namespace render_tool
{

/* The cells of grid with these numbers, in this order, with the points they use and all arrays of one value a point or
 * cell. Every cell's points must be the grid's (find_bad_cell() in grids_of.h); a polyhedron whose list of faces is
 * broken or missing comes out without faces. */
vtkSmartPointer<vtkUnstructuredGrid> extract_cells(vtkUnstructuredGrid *grid, const std::vector<vtkIdType> &cells);

} // namespace render_tool

#endif
