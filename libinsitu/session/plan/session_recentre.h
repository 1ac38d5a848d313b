/* Takes cell values to vertices, for isosurfaces. */
#ifndef SESSION_RECENTRE_H
#define SESSION_RECENTRE_H

#include "session_plan.h"
#include "session_team.h"

/* Adds an item to a list that does not have it yet. False where memory ran out. Local. */
bool session_add_recentring(session_recentring **items, int *count, const session_recentring *item);

/* Fill the recentred arrays of the items that are out of date on any rank. A vertex gets the mean of the finite values
 * of its cells that are no ghosts, over all ranks; NaN where there are none. The homes of the catalogue's meshes
 * must be known. stale: room for count numbers. What fails on this rank at the very end is in *error alone, for the
 * next phase to agree on. Collective, else agreed. */
insitu_status session_recentre(const session_recentring *items, int count, int *stale, const session_meshes *meshes,
                               const session_team *team, base_error *error);

#endif
