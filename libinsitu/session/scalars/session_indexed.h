/* Fields whose values stand in another order than the mesh's vertices or cells. */
#ifndef SESSION_INDEXED_H
#define SESSION_INDEXED_H

#include "scene.h"
#include "session_mesh.h"

/* Note that statistics of this step need the field, on all meshes that it is on. Local. */
void session_want_field(const session_meshes *meshes, const scene_field *field);

/* Copy values by their index where they were not copied yet or have changed since: of fields that are wanted, which
 * they then are no longer, or of those that scalars in use are of. To be called before the values are read. Local. */
insitu_status session_copy_wanted(const session_meshes *meshes, int threads, base_error *error);
insitu_status session_copy_used(const session_meshes *meshes, int threads, base_error *error);

#endif
