/* Makes of any VTK data set the unstructured grid as which insitu_vtk_set() takes it. */
#ifndef INSITU_VTK_GRIDS_H
#define INSITU_VTK_GRIDS_H

#include "insitu/status.h"

class vtkDataSet;
class vtkUnstructuredGrid;

extern "C" {

/* Images, rectilinear and curvilinear grids become hexahedra, flat ones quads; all other data keep their cells. Point
 * and cell arrays are data's own, by reference, and so are the points where data has a list of them, and the polygons
 * of polygonal data that has nothing else. Newly made are a list of cells, 37 bytes a hexahedron with its offset and
 * type, or 73 where there are more than 268 million points, and for images and rectilinear grids a list of points, 24
 * bytes each, or 12 if the axes are floats. A cell with a hidden point is flagged as hidden. The grid is the caller's,
 * to be given back by its Delete(). data is not changed. May throw std::bad_alloc. Local. */
INSITU_API vtkUnstructuredGrid *insitu_vtk_make_grid(vtkDataSet *data);

} // extern "C"

#endif
