/* Lattices (structured blocks of cells): checks of the caller's description, and the grid built from it. */
#ifndef SESSION_LATTICE_H
#define SESSION_LATTICE_H

#include "session_mesh.h"

/* Checks the description mesh->lattice, which must not be NULL. Local. */
insitu_status session_check_lattice(const insitu_mesh *mesh, base_error *error);

/* Returns whether the cells are quads, which is the case if the lattice has no cells along one axis. */
bool session_is_quad_lattice(const insitu_lattice *lattice);

/* Returns whether the coordinates are given along a lattice's axes instead of by vertex. */
bool session_has_axes(const insitu_mesh *mesh);

/* Returns the INSITU_CHANGED_* bits for the differences between two lattices, either of which may be NULL.
 * INSITU_CHANGED_ALL means that their shapes differ. */
unsigned session_lattice_changes(const insitu_lattice *a, const insitu_lattice *b);

/* Copies the lattice of the description, if it has one, into the mesh, and makes given.lattice point to the copy.
 * Local. */
void session_copy_lattice(session_mesh *mesh);

/* Completes the grid of a mesh with a lattice: sets the cell type, the indices and, unless coordinates are given by
 * vertex, the coordinates. */
void session_read_lattice(session_mesh *mesh, grid *g);

/* Computes the cells[axis] + 1 coordinates along an axis of a lattice that is uniform or rectilinear. Local. */
void session_fill_axis(const insitu_lattice *lattice, int axis, double *out);

/* Computes the coordinates along the axes from the current contents of the arrays. Fails if one is not finite.
 * Local. */
insitu_status session_make_axes(session_mesh *mesh, base_error *error);

#endif
