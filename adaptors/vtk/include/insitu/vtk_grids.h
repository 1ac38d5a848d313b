/* Converts any VTK data set to an unstructured grid, which insitu-render needs to distribute cells to ranks, and reads
 * ghost flags and types of cells. insitu_vtk_set() does not need this conversion for structured data sets. */
#ifndef INSITU_VTK_GRIDS_H
#define INSITU_VTK_GRIDS_H

#include <cstdint>

#include "insitu/status.h"

class vtkDataSet;
class vtkDataSetAttributes;
class vtkUnsignedCharArray;
class vtkUnstructuredGrid;

extern "C" {

/* Converts a data set to an unstructured grid. Images, rectilinear and curvilinear grids become hexahedra, or quads if
 * they are flat; all other data keep their cells. Point and cell arrays are shared with data, and so are the points if
 * data lists them, and the polygons of polygonal data that has nothing else. The list of cells takes 37 bytes per
 * hexahedron including its offset and type, or 73 bytes if there are more than 268 million points. For images and
 * rectilinear grids, a list of points is allocated too, with 24 bytes per point, or 12 if the axes are floats. A cell
 * with a hidden point is flagged as hidden. The caller owns the grid and must call its Delete(). data does not change.
 * May throw std::bad_alloc. Local. */
INSITU_API vtkUnstructuredGrid *insitu_vtk_make_grid(vtkDataSet *data);

/* Returns the ghost flags of cells or points in VTK's format: data's own vtkGhostType if it consists of bytes;
 * otherwise a new array of that name, computed from a vtkGhostType of other integer types and from VisIt's
 * avtGhostZones, whose nonzero values are treated as duplicate cells. Returns NULL if data has no such array with
 * `count` values. The caller must release the array by UnRegister(). data does not change. May throw std::bad_alloc.
 * Local. */
INSITU_API vtkUnsignedCharArray *insitu_vtk_ghost_flags(vtkDataSetAttributes *data, int64_t count);

/* Returns whether grid has polygons, polyhedra, or prisms of five or six sides. insitu_vtk_set() draws cells of higher
 * order by their corners if they are in one grid with such cells. Local. */
INSITU_API bool insitu_vtk_has_polygons_or_polyhedra(vtkUnstructuredGrid *grid);

} // extern "C"

#endif
