/* Hand over VTK data sets as they are: the adaptor borrows VTK's own arrays wherever libinsitu can read them, converts
 * where it cannot, and says in bytes what it converted and why. For C++ codes that hold their mesh in VTK.
 *
 *     insitu_vtk_adaptor *adaptor = NULL;
 *     insitu_vtk_create(session, &adaptor);
 *     insitu_vtk_set(adaptor, "domain", grid, NULL);
 *     insitu_step(session, cycle, time);
 *     ...
 *     insitu_vtk_destroy(&adaptor);
 *     insitu_destroy(&session);
 *
 * It takes all vtkDataSets (unstructured, curvilinear and rectilinear grids, images, polygonal data) and composite data
 * sets of them (multiblock, partitioned data set collections, AMR). The leaves of a composite become the meshes
 * "name/0", "name/1", ..., numbered in the order of VTK's iterator, empty leaves counted. All numeric point and cell
 * arrays become fields.
 *
 * Points: float or double borrowed, whether interleaved (AOS) or a component apart (SOA); others copied to double.
 *
 * Images, rectilinear and curvilinear grids, flat ones too: lattices (insitu_lattice), so that no cells are listed. Of
 * images nothing is copied, unless their axes are turned or have no spacing: then their points are listed. Axes of
 * rectilinear grids and points of curvilinear grids are borrowed if they are float or double.
 *
 * Cells 10, 12, 13, 14, and the shells 5, 7, 9: borrowed, with 32- or 64-bit storage. Voxels (11) and pixels (8): drawn
 * as hexahedra and quads; a copy of the connectivity. Polyhedra (42): their face streams become faces shared between
 * cells; a copy. Pentagonal and hexagonal prisms (15, 16) come as polyhedra too. Quadratic and higher-order cells:
 * drawn by their corners as linear cells, and reported; copied. What else is left, polyhedra without their faces too:
 * not drawn, and reported; so are lines and points.
 *
 * Polygonal data: points are borrowed, and polygons where there are no lines, points and strips beside them.
 *
 * Fields: float, double and 32- or 64-bit signed integers borrowed; other types copied.
 *
 * vtkGhostType of the cells: duplicate, hidden and refined cells are not drawn, nor cells of structured grids with a
 * hidden point; nor those whose avtGhostZones, of VisIt, is not 0. Bytes are borrowed, flags of other types copied.
 *
 * Overlapping AMR: cells within a box of the next level are not drawn, whether or not vtkAMRUtilities::BlankCells() has
 * flagged them, and whichever rank holds the finer grid. Boxes, and spacings or ratios, are to be set for all levels on
 * every rank, as VTK wants them; a warning says where they do not fit the grids.
 *
 * No function throws, and none changes a data set. */
#ifndef INSITU_VTK_H
#define INSITU_VTK_H

#include "insitu/insitu.h"

class vtkDataObject;

extern "C" {

typedef struct insitu_vtk_adaptor insitu_vtk_adaptor;

/* Report of insitu_vtk_set() on one data set, of this rank. */
typedef struct insitu_vtk_report {
    int meshes;              /* meshes handed over: 1, or the leaves with cells to draw */
    int fields;              /* handed over, over all meshes */
    int64_t cells;           /* handed over, ghosts included */
    int64_t cells_split;     /* cells cut into several; at present no type is, so this is 0 */
    int64_t cells_linear;    /* quadratic and higher-order cells drawn by their corners */
    int64_t cells_flat;      /* not drawn: points and lines */
    int64_t cells_not_drawn; /* not drawn: 3-D cells of unknown types, cells with too few points or faces */
    int64_t bytes_borrowed;  /* size of VTK's arrays that are borrowed as they are */
    int64_t bytes_copied;    /* size of converted arrays, held until the mesh is set again */
    const char *copied_why;  /* "" or one "what: why (bytes)" a line; valid until the next call on the adaptor */
    const char *cells_why;   /* "" or, a line each, the kinds of cells that are simplified or not drawn, and how many;
                                valid as long */
    const char *warnings;    /* "" or one other warning a line; valid as long */
} insitu_vtk_report;

/* An adaptor for a session, which must outlive it. On an error *out is NULL. Local. */
INSITU_API insitu_status insitu_vtk_create(insitu_session *session, insitu_vtk_adaptor **out);

/* Set the mesh (or, for a composite, the meshes) called name and all its fields from data. Meshes that an earlier call
 * set under the name and that data no longer has are taken away; NULL for data takes all away. The adaptor holds
 * references to the arrays, so that data itself may go; their values must stay until the next insitu_step() returns.
 * report may be NULL; it is filled on an error too. Local.
 *
 * INSITU_ERROR_ARGUMENT: data is of a class that is not taken. INSITU_ERROR_MESH: data has 3-D cells and none can be
 * drawn, or it is not well formed. Other errors are those of insitu_set_mesh() and insitu_set_field(). */
INSITU_API insitu_status insitu_vtk_set(insitu_vtk_adaptor *adaptor, const char *name, vtkDataObject *data,
                                        insitu_vtk_report *report);

/* The message of the last call on the adaptor that failed, "" if none did. Valid until the next call. Local. */
INSITU_API const char *insitu_vtk_error(const insitu_vtk_adaptor *adaptor);

/* Take the adaptor's meshes away from the session, let go of the arrays and set *adaptor to NULL. Local. NULL, or a
 * pointer to NULL, is fine. */
INSITU_API void insitu_vtk_destroy(insitu_vtk_adaptor **adaptor);

} // extern "C"

#endif
