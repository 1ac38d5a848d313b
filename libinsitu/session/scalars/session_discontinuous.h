/* Makes meshes discontinuous: in a discontinuous mesh, no two cells have a common vertex. Discontinuous meshes are used
 * for fields with a value at each corner of each cell.
 *
 * All other code finds a value by the index of a vertex. Therefore a mesh with a corner field is read as a mesh in
 * which every corner is a vertex. Its coordinates are copied corner by corner, and its connectivity is 0, 1, 2, ....
 * All layers of the mesh are drawn in this form, so that fields at corners, vertices and cells can be combined. Code
 * that must find equal vertices (for means at vertices, or for outer faces) compares ids or coordinates across ranks,
 * which also works for corners. */
#ifndef SESSION_DISCONTINUOUS_H
#define SESSION_DISCONTINUOUS_H

#include "scene.h"
#include "session_catalogue.h"
#include "session_mesh.h"
#include "session_team.h"

/* Makes meshes discontinuous if the scene uses a corner field of the mesh. A mesh that is already discontinuous with
 * the current coordinates is not changed. All other meshes are read with the caller's own vertices. Cells must have
 * been checked. If a mesh cannot be made discontinuous because its corners have no order, the error is also stored in
 * session_field.problem of its fields at corners, and no mesh is changed. After the catalogue has been updated, another
 * call treats the mesh on all ranks as if it did not have these fields. Collective. */
insitu_status session_make_discontinuous(session_meshes *meshes, const session_catalogue *catalogue, const scene *scene,
                                         const session_team *team, base_error *error);

/* Returns the index, in the caller's arrays, of the vertex at a corner of a discontinuous mesh. */
int64_t session_vertex_of_corner(const session_mesh *mesh, int64_t corner);

#endif
