/* Extracts some of a grid's cells into a new grid. */
#ifndef CELL_EXTRACT_H
#define CELL_EXTRACT_H

#include <vector>

#include <vtkSmartPointer.h>
#include <vtkType.h>

class vtkUnstructuredGrid;

namespace render_tool
{

/* Returns a grid of the cells of `grid` with the indices in `cells`, in this order, with the points they use and all
 * arrays with one value per point or cell. All points of the cells must exist (find_bad_cell() in grids_of.h). A
 * polyhedron whose face stream is invalid or missing gets no faces. */
vtkSmartPointer<vtkUnstructuredGrid> extract_cells(vtkUnstructuredGrid *grid, const std::vector<vtkIdType> &cells);

} // namespace render_tool

#endif
