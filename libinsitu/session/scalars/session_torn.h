/* Meshes whose cells have vertices of their own, for fields with a value at each corner of each cell.
 *
 * The rooms below find values by the number of a vertex. So a mesh with a field at corners is read as one in which
 * every corner is a vertex: its coordinates are copied corner by corner, and its connectivity counts up. All that is
 * drawn of the mesh is drawn by it, so that layers of fields at corners, vertices and cells go together. Code that must
 * know which vertices are the same (means at vertices, outer faces) compares ids or coordinates anyway, across ranks,
 * and so works across corners too. */
#ifndef SESSION_TORN_H
#define SESSION_TORN_H

#include "scene.h"
#include "session_catalogue.h"
#include "session_mesh.h"
#include "session_team.h"

/* Tear the meshes with a corner field that the scene names, unless they are torn by the present coordinates already;
 * make the others whole. Cells have been checked. Collective. */
insitu_status session_tear_meshes(session_meshes *meshes, const session_catalogue *catalogue, const scene *scene,
                                  const session_team *team, base_error *error);

/* Returns the caller's vertex that stands at the corner of a torn mesh. */
int64_t session_torn_origin(const session_torn *torn, int64_t corner);

#endif
