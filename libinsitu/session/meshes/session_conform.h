/* Copies of a mesh's arrays that the rooms below do not read where they are: integers as coordinates, small integers,
 * flags of more than a byte, numbers of the code's own for cell types, and arrays that are not aligned. */
#ifndef SESSION_CONFORM_H
#define SESSION_CONFORM_H

#include "session_mesh.h"

/* Stores the description in mesh->original, and in mesh->given with the copies in place of such arrays. Copies are
 * allocated here and filled by session_fill_conformed(). Those of what has not changed (INSITU_CHANGED_* bits of
 * changed) stay as they are. On an error some copies are gone, and the mesh can
 * only be dropped. */
insitu_status session_conform_mesh(session_mesh *mesh, const insitu_mesh *original, unsigned changed,
                                   base_error *error);

/* Fills the copies from the caller's arrays. Parallel. */
void session_fill_conformed(session_mesh *mesh, int threads);

/* Tells whether the map from numbers to cell types is the one that was copied; NULL: there is none. */
bool session_has_types(const session_mesh *mesh, int count, const int *map);

#endif
