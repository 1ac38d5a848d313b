/* Computes the outer faces of meshes whose surface an image shows. */
#ifndef SESSION_SURFACES_H
#define SESSION_SURFACES_H

#include "session_plan.h"
#include "session_team.h"

/* Finds the outer faces of each mesh whose surface the plan shows, and builds this rank's meshes on these faces, so
 * that trees can be built for them. The faces of a mesh are kept until its cells change. The home ranks of the
 * catalogue's meshes, that is, the ranks that compare the faces of several ranks, must be up to date
 * (session_update_home_ranks()). Collective. All ranks return the same status. An error that occurs on this rank after
 * the last communication is only stored in *error, and the next phase passes it to all ranks. */
insitu_status session_update_surfaces(const session_plan *plan, const session_catalogue *catalogue,
                                      const session_meshes *meshes, const session_team *team, base_error *error);

#endif
