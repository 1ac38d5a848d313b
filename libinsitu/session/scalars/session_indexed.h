/* Copies fields whose values are stored in another order than the mesh's vertices or cells. */
#ifndef SESSION_INDEXED_H
#define SESSION_INDEXED_H

#include "scene.h"
#include "session_mesh.h"

/* Marks the field as needed by statistics of this step, on all meshes that have it. Local. */
void session_want_field(const session_meshes *meshes, const scene_field *field);

/* Copies values according to their index, unless the copy is up to date. session_copy_wanted() copies the fields that
 * statistics need, and clears their marks; session_copy_used() copies those of scalars in use, and the fields from
 * which derived ones are computed. Must be called before the values are read. Local. */
insitu_status session_copy_wanted(const session_meshes *meshes, int threads, base_error *error);
insitu_status session_copy_used(const session_meshes *meshes, int threads, base_error *error);

#endif
