/* Makes an unstructured grid of any VTK data set, as insitu-render needs it to deal cells out, and reads ghost flags.
 * insitu_vtk_set() takes structured data sets as they are. */
#ifndef INSITU_VTK_GRIDS_H
#define INSITU_VTK_GRIDS_H

#include <cstdint>

#include "insitu/status.h"

class vtkDataSet;
class vtkDataSetAttributes;
class vtkUnsignedCharArray;
class vtkUnstructuredGrid;

extern "C" {

/* Images, rectilinear and curvilinear grids become hexahedra, flat ones quads; all other data keep their cells. Point
 * and cell arrays are data's own, by reference, and so are the points where data has a list of them, and the polygons
 * of polygonal data that has nothing else. Newly made are a list of cells, 37 bytes a hexahedron with its offset and
 * type, or 73 where there are more than 268 million points, and for images and rectilinear grids a list of points, 24
 * bytes each, or 12 if the axes are floats. A cell with a hidden point is flagged as hidden. The grid is the caller's,
 * to be given back by its Delete(). data is not changed. May throw std::bad_alloc. Local. */
INSITU_API vtkUnstructuredGrid *insitu_vtk_make_grid(vtkDataSet *data);

/* The ghost flags of cells or points as VTK has them: data's own vtkGhostType if that is of bytes, or a new array of
 * that name from a vtkGhostType of other whole numbers, and from VisIt's avtGhostZones, where not 0, as duplicate
 * cells. NULL where there are none for `count` cells or points. The caller gives it back by UnRegister(). data is not
 * changed. May throw std::bad_alloc. Local. */
INSITU_API vtkUnsignedCharArray *insitu_vtk_ghost_flags(vtkDataSetAttributes *data, int64_t count);

} // extern "C"

#endif
