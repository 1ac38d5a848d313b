/* Computes the outer faces of meshes whose surface an image shows. */
#ifndef SESSION_SURFACES_H
#define SESSION_SURFACES_H

#include "session_plan.h"
#include "session_team.h"

/* Finds the outer faces of each mesh, which are kept until its cells change. Builds this rank's meshes on these faces,
 * so that their trees can be built. The homes of the catalogue's meshes must be up to date. An error that occurs on
 * this rank at the very end is stored only in *error, and is shared in the next phase. Collective; apart from that, all
 * ranks return the same status. */
insitu_status session_update_surfaces(const session_plan *plan, const session_catalogue *catalogue,
                                      const session_meshes *meshes, const session_team *team, base_error *error);

#endif
