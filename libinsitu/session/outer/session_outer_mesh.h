/* A mesh on the outer faces of another: its isosurface is the other's outer surface.
 *
 * On each face there is a pyramid, or a tet on a triangle, that extends into the cell; polygons with more corners are
 * fans of triangles from their least vertex, as in polyhedra. The mesh's scalar is 0 at the face's vertices and -1 at
 * the apex, so that the face is the isosurface 0. So it is found as isosurfaces are, at the same depth as by the cell
 * to which it belongs, because a crossing of a face is computed from the face's vertices alone. */
#ifndef SESSION_OUTER_MESH_H
#define SESSION_OUTER_MESH_H

#include "session_mesh.h"
#include "session_team.h"

/* Computes outer->mesh from the faces, and its scalar, ready to be drawn, unless they exist. Local. */
insitu_status session_make_outer_mesh(const session_mesh *whole, session_outer *outer, base_error *error);

/* Returns the values of a field of the whole mesh on the mesh of its outer faces, from base_alloc(); NULL if there is
 * no memory. */
double *session_gather_outer_values(const session_outer *outer, const grid_field *field);

#endif
