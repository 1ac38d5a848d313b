/* Passes VTK data sets to libinsitu. The adaptor borrows VTK's arrays if libinsitu can read them and converts the
 * others; its report states what was converted, why, and how many bytes it takes. For C++ codes that hold their mesh in
 * VTK.
 *
 *     insitu_vtk_adaptor *adaptor = NULL;
 *     insitu_vtk_create(session, &adaptor);
 *     insitu_vtk_set(adaptor, "domain", grid, NULL);
 *     insitu_step(session, cycle, time);
 *     ...
 *     insitu_vtk_destroy(&adaptor);
 *     insitu_destroy(&session);
 *
 * The adaptor accepts all vtkDataSets (unstructured, curvilinear and rectilinear grids, images, polygonal data) and
 * composite data sets of them (multiblock, partitioned data set collections, AMR). All numeric point and cell arrays
 * become fields.
 *
 * The leaves of a composite are numbered in the order of VTK's iterator, including empty leaves. Images, rectilinear
 * and curvilinear grids become blocks of one mesh (insitu_set_block), so that there is no seam between them. In
 * overlapping AMR this mesh is called "name". In other composites, structured leaves with the fields a and b become
 * blocks of the mesh "name/blocks of a, b", or of "name/flat blocks of a, b" if they have two dimensions. The name
 * of a field of cells is followed by its centring, and that of a field of several components by their number, as in
 * "name/blocks of p (cells), u (3 components)". All other leaves become the meshes "name/0", "name/1", ....
 *
 * The names contain the fields because all blocks of a mesh must have the same fields on all ranks, with the same
 * centring and number of components, and one rank does not know the fields of the other ranks' blocks. Scenes hardly
 * need them: `mesh: name` stands for all leaves, and a layer without mesh is drawn on the leaves that have its field. A
 * layer cannot be drawn on one block of a mesh. To draw a structured leaf alone, set it by a separate call, under a
 * different name.
 *
 * Points are borrowed if they are float or double, interleaved (AOS) or with separate components (SOA); others are
 * copied to double.
 *
 * Images, rectilinear and curvilinear grids become lattices (insitu_lattice), also if they are flat, so that no cells
 * are listed. Nothing of an image is copied, unless its axes are rotated or a spacing is 0. In these cases its points
 * are listed. Axes of rectilinear grids and points of curvilinear grids are borrowed if they are float or double.
 *
 * Cells of the types 10, 12, 13, 14, and of the shell types 5, 7, 9, are borrowed with 32- or 64-bit storage. Voxels
 * (11) and pixels (8) are drawn as hexahedra and quads, with a copied connectivity. The face streams of polyhedra (42)
 * are copied to a list of faces that cells share. Pentagonal and hexagonal prisms (15, 16) become polyhedra too.
 * Quadratic and Lagrange cells are borrowed, and are drawn as linear cells between their points. For cells of the types
 * 33, 34 and 37, the first 20, 6 and 14 points are copied. Bezier cells, cells whose order differs between axes, and
 * all cells of higher order in grids with polygons or polyhedra are copied, drawn as linear cells with the same
 * corners, and reported. insitu_vtk_draw_by_corners() is for grids that have polygons or polyhedra on other ranks. All
 * other cells are reported and not drawn, including polyhedra without faces, lines and points.
 *
 * Of polygonal data the points are borrowed, and the polygons too if there are no lines, points or strips.
 *
 * Fields that are float, double, or 32- or 64-bit signed integers are borrowed; other types are copied.
 *
 * Cells that vtkGhostType flags as duplicate, hidden or refined are not drawn, nor are cells of structured grids with a
 * hidden point, nor cells whose avtGhostZones (VisIt) is not 0. Flags that are bytes are borrowed, others copied.
 *
 * The levels of overlapping AMR become levels of refinement (insitu_lattice): cells within a box of a finer level are
 * not drawn, whichever rank holds the finer grid, and values are continuous between levels. Boxes, and spacings or
 * ratios, must be set for all levels on every rank, as VTK requires, and boxes must end at borders of coarser cells. If
 * they do not match each other or the grids, a warning is reported, and only ghost flags hide cells, such as those that
 * vtkAMRUtilities::BlankCells() sets. All grids must have the same fields.
 *
 * No function throws exceptions or changes a data set. */
#ifndef INSITU_VTK_H
#define INSITU_VTK_H

#include "insitu/insitu.h"

class vtkDataObject;

extern "C" {

typedef struct insitu_vtk_adaptor insitu_vtk_adaptor;

/* The report of insitu_vtk_set() on one data set, on this rank. */
typedef struct insitu_vtk_report {
    int meshes;           /* number of meshes and blocks set: 1, or, for composites, the number of leaves with cells */
    int fields;           /* number of fields set, over all meshes */
    int64_t cells;        /* number of cells set, including ghosts */
    int64_t cells_split;  /* number of cells split into several; currently always 0 */
    int64_t cells_linear; /* number of cells of higher order that are drawn as linear cells with the same corners. These
                             are Bezier cells, cells whose order differs between axes or with points missing, and all
                             cells of higher order in grids with polygons or polyhedra. */
    int64_t cells_flat;   /* number of points and lines, which are not drawn */
    int64_t cells_not_drawn; /* number of 3-D cells not drawn: unknown types, too few points or faces */
    int64_t bytes_borrowed;  /* size in bytes of VTK's arrays that are borrowed */
    int64_t bytes_copied;    /* size of converted arrays, which are held until the mesh is set again */
    const char *copied_why;  /* "", or lines of "what: why (bytes)"; valid until the next call on the adaptor */
    const char *cells_why;   /* "", or one line per kind of cells that are simplified or not drawn, with their number;
                                valid as long as copied_why */
    const char *warnings;    /* "", or one line per other warning; valid as long as copied_why */
} insitu_vtk_report;

/* Creates an adaptor for the session, which must outlive it. On an error *out is NULL. Local. */
INSITU_API insitu_status insitu_vtk_create(insitu_session *session, insitu_vtk_adaptor **out);

/* Sets the mesh (or, for a composite, the meshes) called name, and all its fields, from data. Meshes that an earlier
 * call set under this name and that data no longer contains are removed; if data is NULL, all are removed. The adaptor
 * holds references to the arrays, so that data itself may be deleted; the values must not change until the next
 * insitu_step() returns. report may be NULL; it is filled on an error too. Local.
 *
 * Returns INSITU_ERROR_ARGUMENT if data is of an unsupported class, and INSITU_ERROR_MESH if data has 3-D cells of
 * which none can be drawn, or if data is not well formed. Other errors are those of insitu_set_mesh() and
 * insitu_set_field(). */
INSITU_API insitu_status insitu_vtk_set(insitu_vtk_adaptor *adaptor, const char *name, vtkDataObject *data,
                                        insitu_vtk_report *report);

/* Chooses whether later calls of insitu_vtk_set() draw all cells of higher order of a mesh by their corners, even if
 * its grid on this rank has neither polygons nor polyhedra. `mesh` is the name of a whole mesh, such as "domain", or
 * that of a leaf of a composite, such as "domain/3". A grid whose cells are distributed over ranks is drawn the same on
 * any number of ranks only if all ranks choose this as soon as one rank's part has polygons or polyhedra. Local.
 *
 * Returns INSITU_ERROR_ARGUMENT if adaptor or mesh is NULL, and INSITU_ERROR_MEMORY if memory runs out; the choice is
 * then unchanged. */
INSITU_API insitu_status insitu_vtk_draw_by_corners(insitu_vtk_adaptor *adaptor, const char *mesh, bool is_by_corners);

/* Returns the message of the last call that failed on this adaptor, or "" if none did. Valid until the next call.
 * Local. */
INSITU_API const char *insitu_vtk_error(const insitu_vtk_adaptor *adaptor);

/* Removes the adaptor's meshes from the session, releases the arrays and sets *adaptor to NULL. NULL and a pointer to
 * NULL are allowed. Local. */
INSITU_API void insitu_vtk_destroy(insitu_vtk_adaptor **adaptor);

} // extern "C"

#endif
