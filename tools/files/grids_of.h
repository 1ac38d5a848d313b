/* Converts the contents of any file to data sets that can be distributed and drawn. */
#ifndef GRIDS_OF_H
#define GRIDS_OF_H

#include <string>
#include <vector>

#include <vtkSmartPointer.h>

class vtkDataObject;
class vtkUnstructuredGrid;

namespace render_tool
{

/* Returns data as a vtkUnstructuredGrid, or, for a composite, as a multiblock with one block per leaf in the order of
 * VTK's iterator; empty leaves are empty blocks. Images, rectilinear and curvilinear grids become hexahedra whose
 * fields are VTK's arrays without a copy. Cells that are hidden in these grids, because of a hidden point or, in
 * overlapping AMR, a finer level, get a ghost flag. Unstructured grids are returned unchanged. Throws
 * std::runtime_error, whose message begins with path, if a cell refers to a point that does not exist. */
vtkSmartPointer<vtkDataObject> grids_of(vtkDataObject *data, const std::string &path);

/* Returns data in a form that the VTK adaptor draws. Overlapping AMR, and images, rectilinear and curvilinear grids
 * with cells of two or three dimensions, are not converted; cells of AMR that a finer level covers get a ghost flag.
 * All other data is converted as by grids_of(). Throws as grids_of() does. */
vtkSmartPointer<vtkDataObject> convert_to_drawable_data(vtkDataObject *data, const std::string &path);

/* Returns "", or a description of the first cell that lies outside the connectivity or refers to a point that does not
 * exist. */
std::string find_bad_cell(vtkUnstructuredGrid *grid);

/* If a rank reads only some blocks of a multiblock, the others are null, and count as one leaf. These functions give
 * them as many empty leaves as they have on the ranks that read them, so that leaves have the same numbers on all
 * ranks. count_leaves_of_blocks() returns the number of leaves in each block, with -1 for null; the list is empty if
 * data is no multiblock. add_empty_leaves() takes the largest number of any rank for each block. */
std::vector<int> count_leaves_of_blocks(vtkDataObject *data);
void add_empty_leaves(vtkDataObject *data, const std::vector<int> &leaf_counts);

/* The mesh that a leaf of a data set becomes. */
struct leaf_mesh {
    std::string name; // name that the VTK adaptor gives to the mesh if the leaf is not a structured block
    bool has_polygons_or_polyhedra = false; // also true for prisms (insitu_vtk_has_polygons_or_polyhedra())
};

/* Lists the leaves of data, also the empty ones, in the order of VTK's iterator. `name` is the name of the mesh that a
 * data set without leaves becomes. Returns an empty list if data is null. */
std::vector<leaf_mesh> list_leaf_meshes(vtkDataObject *data, const std::string &name);

} // namespace render_tool

#endif
