/* Any VTK data set as the unstructured grid that insitu_vtk_set() takes it for. */
#ifndef INSITU_VTK_GRIDS_H
#define INSITU_VTK_GRIDS_H

#include "insitu/status.h"

class vtkDataSet;
class vtkUnstructuredGrid;

extern "C" {

/* Images, rectilinear and curvilinear grids become hexahedra, flat ones quads; all other data keep their cells. Arrays
 * of points and cells are data's own, by reference, and so are the points where data has a list of them, and the
 * polygons of polygonal data that has nothing else. What is made is a list of cells, 37 bytes a hexahedron with its
 * offset and type, or 73 where there are more than 268 million points, and for images and rectilinear grids a list of
 * points, 24 bytes each, or 12 of axes in float. A cell that has a hidden point gets the flag of a hidden one. The grid
 * is the caller's, to be given back by its Delete(). data is not changed. May throw std::bad_alloc. Local. */
INSITU_API vtkUnstructuredGrid *insitu_vtk_make_grid(vtkDataSet *data);

} // extern "C"

#endif
