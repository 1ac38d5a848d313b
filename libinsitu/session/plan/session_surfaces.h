/* Computes the outer faces of meshes whose surface an image shows. */
#ifndef SESSION_SURFACES_H
#define SESSION_SURFACES_H

#include "session_plan.h"
#include "session_team.h"

/* Finds the outer faces, once for the cells of a mesh, and builds this rank's meshes from them, ready for their trees.
 * The homes of the catalogue's meshes must be up to date. An error that occurs on this rank at the very end is stored
 * only in *error, and is shared in the next phase. Collective; apart from that, all ranks return the same status. */
insitu_status session_update_surfaces(const session_plan *plan, const session_catalogue *catalogue,
                                      const session_meshes *meshes, const session_team *team, base_error *error);

#endif
