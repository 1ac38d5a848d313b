/* Images, rectilinear and curvilinear grids as lattices: VTK's own arrays, without lists of cells. */
#ifndef VTK_LATTICES_H
#define VTK_LATTICES_H

#include <string>

#include <vtkSmartPointer.h>

#include "vtk_arrays.h"

class vtkDataSet;
class vtkUnsignedCharArray;

namespace insitu_vtk
{

/* The cells along the axes of an image, a rectilinear or a curvilinear grid. False for other data, and where fewer than
 * two axes have cells. */
bool cells_of_lattice(vtkDataSet *data, int64_t cells[3]);

/* Fill in the lattice and the coordinates of mesh from data, with as many vertices and cells as data has points and
 * cells, numbered alike. What must be converted is held and counted. False, with nothing done, where data is of another
 * class or has fewer than two axes with cells. The mesh points to lattice. */
bool view_lattice(vtkDataSet *data, const std::string &what, hold &held, tally &count, insitu_mesh &mesh,
                  insitu_lattice &lattice);

/* The flags of data's cells; cells with a hidden point count as hidden. VTK's own array where that is all, a new one
 * without a name where points are hidden, nullptr where there are no flags. */
vtkSmartPointer<vtkUnsignedCharArray> lattice_flags(vtkDataSet *data, const insitu_lattice &lattice);

} // namespace insitu_vtk

#endif
