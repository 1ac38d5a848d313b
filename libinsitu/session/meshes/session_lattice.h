/* Structured blocks, as the caller describes them and as the rooms below the session read them. */
#ifndef SESSION_LATTICE_H
#define SESSION_LATTICE_H

#include "session_mesh.h"

/* Checks the description of mesh->lattice, which is given. Local. */
insitu_status session_check_lattice(const insitu_mesh *mesh, base_error *error);

/* Tells whether the cells are quads: one axis has none. */
bool session_is_plane(const insitu_lattice *lattice);

/* Tells whether the coordinates are a lattice's own, not given by vertex. */
bool session_has_axes(const insitu_mesh *mesh);

/* The INSITU_CHANGED_* bits of what differs between two lattices; either may be NULL. ALL: the shape differs. */
unsigned session_lattice_changes(const insitu_lattice *a, const insitu_lattice *b);

/* Keeps a copy of given.lattice in the mesh, if there is one, and makes given.lattice point to it. Local. */
void session_take_lattice(session_mesh *mesh);

/* Completes the grid of a mesh that has a lattice: type, indices and, except where they are given by vertex, the
 * coordinates. */
void session_read_lattice(session_mesh *mesh, grid *g);

/* Computes the coordinates along the axes, for the present contents of the arrays. Fails where one is not finite.
 * Local.
 */
insitu_status session_make_axes(session_mesh *mesh, base_error *error);

#endif
