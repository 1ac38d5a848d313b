/* Lattices (structured blocks of cells): checks of the caller's description, and the grid built from it. */
#ifndef SESSION_LATTICE_H
#define SESSION_LATTICE_H

#include "session_mesh.h"

/* Checks the description mesh->lattice, which must not be NULL. Local. */
insitu_status session_check_lattice(const insitu_mesh *mesh, base_error *error);

/* Returns whether the cells are quads, which is the case if the lattice has no cells along one axis. */
bool session_is_quad_lattice(const insitu_lattice *lattice);

/* Returns whether the coordinates are given along a lattice's axes instead of by vertex. */
bool session_has_axis_coordinates(const insitu_mesh *mesh);

/* Returns the INSITU_CHANGED_* bits for the differences between two lattices, either of which may be NULL. Returns
 * INSITU_CHANGED_ALL if their shapes differ, so that the mesh counts as a new one. */
unsigned session_lattice_changes(const insitu_lattice *a, const insitu_lattice *b);

/* Copies the lattice of the caller's description, if it has one, into mesh->lattice, and makes mesh->given.lattice
 * point to the copy. Local. */
void session_copy_lattice(session_mesh *mesh);

/* If the mesh has a lattice, makes its grid compute the vertices of cells from the lattice: sets the cell type, the
 * lattice and, unless coordinates are given by vertex, the coordinates. */
void session_set_lattice_of_grid(session_mesh *mesh, grid *g);

/* Computes the cells[axis] + 1 coordinates along an axis of a lattice that is uniform or rectilinear. Local. */
void session_fill_axis_coordinates(const insitu_lattice *lattice, int axis, double *out);

/* Computes session_lattice.axis_coordinates from the current contents of the caller's arrays. Does nothing if the
 * lattice's coordinates are given by vertex. Fails if a coordinate is not finite. Local. */
insitu_status session_compute_axis_coordinates(session_mesh *mesh, base_error *error);

#endif
