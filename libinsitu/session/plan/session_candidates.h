/* Determines the candidates of a mesh. These are the cells that the due images can show, according to the cells'
 * values. A partial tree, that is, a bounding volume hierarchy over some of the mesh's cells, contains only the
 * candidates. */
#ifndef SESSION_CANDIDATES_H
#define SESSION_CANDIDATES_H

#include "scene.h"
#include "session_mesh.h"
#include "session_space.h"

/* Marks on this rank's meshes and scalars the data that the images need, and clears the marks of an earlier step.
 * Returns false if memory ran out. Local. */
bool session_mark_needed_data(session_meshes *meshes, const scene_image *const *images, int count,
                              const session_extent *extent);

/* Returns whether the candidates can be selected by the cells' values. If so, *key becomes a hash of the scalars and of
 * the intervals of their visible values. Otherwise any cell may be visible. Local. */
bool session_hash_candidate_queries(const session_mesh *mesh, uint64_t *key);
/* Selects the candidates among the mesh's cells. Also counts, for each scalar that images show, the cells with values
 * that are not finite (session_scalar.unusable_count). Parallel. Local. */
insitu_status session_select_candidates(session_mesh *mesh, int threads, mmbvh_selection *out, base_error *error);

#endif
