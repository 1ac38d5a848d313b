/* Candidates: the cells that the due images can show, told by the values that these show. A partial tree is over them
 * alone. */
#ifndef SESSION_CANDIDATES_H
#define SESSION_CANDIDATES_H

#include "scene.h"
#include "session_mesh.h"
#include "session_space.h"

/* Mark on this rank's meshes and scalars what the images need, and forget what an earlier step's needed. False where
 * memory ran out. Local. */
bool session_mark_needs(session_meshes *meshes, const scene_image *const *images, int count,
                        const session_extent *extent);

/* False where values alone do not tell which cells can be seen, so that any may be. Else *key is a hash of all that
 * decides on the candidates besides values: the scalars and their intervals. */
bool session_find_candidates(const session_mesh *mesh, uint64_t *key);
/* Select the candidates. Sets the scalars' counts of unusable cells. Parallel. Local. */
insitu_status session_select_candidates(session_mesh *mesh, int threads, mmbvh_selection *out, base_error *error);

#endif
