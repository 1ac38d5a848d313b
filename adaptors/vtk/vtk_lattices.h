/* Converts images, rectilinear and curvilinear grids to lattices (structured grids). A lattice uses VTK's own arrays
 * and needs no list of cells. */
#ifndef VTK_LATTICES_H
#define VTK_LATTICES_H

#include <string>

#include <vtkSmartPointer.h>

#include "vtk_arrays.h"

class vtkDataSet;
class vtkUnsignedCharArray;

namespace insitu_vtk
{

/* Returns the number of cells along each axis of an image, a rectilinear or a curvilinear grid. Returns false for other
 * data, or if fewer than two axes have cells. */
bool count_cells_of_lattice(vtkDataSet *data, int64_t cells[3]);

/* Fills in the lattice and the coordinates of mesh from data, with the same vertices and cells in the same order.
 * Arrays that had to be converted are stored in `held`, and `log` counts their bytes. mesh.lattice is set to point to
 * lattice. Returns false without changes if data is of another class or has fewer than two axes with cells. */
bool view_lattice(vtkDataSet *data, const std::string &what, held_arrays &held, conversion_log &log, insitu_mesh &mesh,
                  insitu_lattice &lattice);

/* Returns the ghost flags of data's cells. Without hidden points, this is VTK's own array; otherwise it is a new array
 * without a name, in which cells with a hidden point are flagged as hidden. Returns null if there are no flags. */
vtkSmartPointer<vtkUnsignedCharArray> make_lattice_ghost_flags(vtkDataSet *data, const insitu_lattice &lattice);

} // namespace insitu_vtk

#endif
