/* Recentres cell values to vertices, for isosurfaces. */
#ifndef SESSION_RECENTRE_H
#define SESSION_RECENTRE_H

#include "session_plan.h"
#include "session_team.h"

/* Adds an item to a list unless the list already contains it. Returns false if memory ran out. Local. */
bool session_add_recentring(session_recentring **items, int *count, const session_recentring *item);

/* Computes the recentred values of the items that are out of date on any rank. A vertex gets the mean of the finite
 * values of its cells that are not ghosts, over all ranks; NaN if there are none. The homes of the catalogue's meshes
 * must be up to date. stale: working memory for `count` numbers. Collective. All ranks return the same status. An error
 * that occurs on this rank after the last exchange of messages is only stored in *error, and the next phase passes it
 * to all ranks. */
insitu_status session_recentre(const session_recentring *items, int count, int *stale, const session_meshes *meshes,
                               const session_team *team, base_error *error);

#endif
