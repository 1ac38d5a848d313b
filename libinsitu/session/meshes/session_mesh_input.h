/* Checks the caller's descriptions of meshes and stores them in the table of meshes. */
#ifndef SESSION_MESH_INPUT_H
#define SESSION_MESH_INPUT_H

#include "session_arrays.h"
#include "session_mesh.h"

/* Implements insitu_set_mesh(), if block is SESSION_WHOLE, and otherwise insitu_set_block(). *error is cleared first.
 * Local. */
insitu_status session_set_mesh(session_meshes *meshes, const char *name, int64_t block, const insitu_mesh *given,
                               base_error *error);

/* Stores a valid description of a mesh in the table of meshes. The only possible error is lack of memory; the calling
 * function must then refuse the mesh. Local. */
void session_store_mesh(session_meshes *meshes, session_mesh *mesh, const insitu_mesh *given, base_error *error);

/* Returns whether the mesh is allowed to lack z coordinates, because its cells are, or may be, shells in the plane z =
 * 0. */
bool session_may_lack_z(const insitu_mesh *mesh);

/* Stores the error `what` in *error, and puts the mesh's name and, unless `field` is NULL, the field's name before its
 * message. Returns the error's status. */
insitu_status session_prefix_error(base_error *error, const char *mesh, const char *field, const base_error *what);

#endif
