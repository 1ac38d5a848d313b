/* Turns the contents of any file into unstructured grids, to be dealt out and drawn. */
#ifndef GRIDS_OF_H
#define GRIDS_OF_H

#include <string>

#include <vtkSmartPointer.h>

class vtkDataObject;
class vtkUnstructuredGrid;

namespace render_tool
{

/* Returns data as a vtkUnstructuredGrid, or, for a composite, as a multiblock with a block for each leaf, in the order
 * of VTK's iterator; empty leaves are empty blocks. Images, rectilinear and curvilinear grids become hexahedra, with
 * VTK's own arrays; cells that they hide by themselves, by a point or, in overlapping AMR, by a finer level get the
 * ghost flag. Unstructured grids are returned as they are. Throws std::runtime_error, which begins with path, where a
 * cell names a point that is not there. */
vtkSmartPointer<vtkDataObject> grids_of(vtkDataObject *data, const std::string &path);

/* "" or what is wrong with the first cell that lies outside the connectivity or names a point that does not exist. */
std::string find_bad_cell(vtkUnstructuredGrid *grid);

} // namespace render_tool

#endif
