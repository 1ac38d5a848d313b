/* Builds a mesh on the outer faces of another mesh (the whole mesh), such that an isosurface of the new mesh is the
 * outer surface of the whole mesh.
 *
 * The new mesh has a tet on each triangle and a pyramid on each quad, which extend into the cell of the face. Faces
 * with more corners are divided into triangles first. The new mesh has a scalar that is 0 at the vertices of faces and
 * -1 at the apexes, so that the faces are the isosurface 0. The renderer intersects rays with it as with other
 * isosurfaces. The point at which a ray intersects a face is computed from the face's vertices alone, so that it does
 * not depend on the apex. */
#ifndef SESSION_OUTER_MESH_H
#define SESSION_OUTER_MESH_H

#include "session_mesh.h"
#include "session_team.h"

/* Builds outer->mesh and its scalar from the outer faces, unless they exist. If has_normals is set, the scalar has
 * gradients at its vertices that are normals of the faces: in cells of higher order the normals of the curved faces,
 * otherwise those of the bilinear or flat faces. Faces with different normals at a common vertex then do not share this
 * vertex in the new mesh. Local. */
insitu_status session_make_outer_mesh(const session_mesh *whole, session_outer *outer, bool has_normals,
                                      base_error *error);

/* Returns a field's values on the mesh of outer faces, gathered from its values on the whole mesh. The array is
 * allocated by base_alloc(); NULL if memory runs out. */
double *session_gather_outer_values(const session_outer *outer, const grid_field *field);

#endif
