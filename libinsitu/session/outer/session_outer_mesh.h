/* A mesh on the outer faces of another: its outer surface is an isosurface of it.
 *
 * On each face stands a pyramid, or a tet on a triangle, into the cell; polygons of more corners are fans of triangles
 * from their least vertex, as polyhedra have them. Its scalar is 0 at the face's vertices and -1 at the apex: the face
 * is the isosurface 0. So it is found as isosurfaces are, at the same depth as by the cell that has it, because a
 * crossing of a face is computed from the face's vertices alone. */
#ifndef SESSION_OUTER_MESH_H
#define SESSION_OUTER_MESH_H

#include "session_mesh.h"
#include "session_team.h"

/* Make outer->mesh of the faces, and the scalar, ready to be drawn. Nothing is done where it is there. Local. */
insitu_status session_make_outer_mesh(const session_mesh *whole, session_outer *outer, base_error *error);

/* The values of a field of the whole mesh on the mesh of its outer faces, from base_alloc(). NULL: no memory. */
double *session_gather_outer_values(const session_outer *outer, const grid_field *field);

#endif
