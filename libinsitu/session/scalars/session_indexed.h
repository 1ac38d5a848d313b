/* Fields whose values are stored in another order than the mesh's vertices or cells. */
#ifndef SESSION_INDEXED_H
#define SESSION_INDEXED_H

#include "scene.h"
#include "session_mesh.h"

/* Records that statistics of this step need the field, on all meshes that it is on. Local. */
void session_want_field(const session_meshes *meshes, const scene_field *field);

/* Copy values by their index, unless their copy is up to date: session_copy_wanted() those of wanted fields, whose
 * marks it clears, session_copy_used() those of scalars in use and of sources. Must be called before the values are
 * read. Local. */
insitu_status session_copy_wanted(const session_meshes *meshes, int threads, base_error *error);
insitu_status session_copy_used(const session_meshes *meshes, int threads, base_error *error);

#endif
