/* Recentres fields: averages cell values to vertices, for isosurfaces. A recentring is the request to do this for one
 * component of a field on a group of meshes (session_plan.h). */
#ifndef SESSION_RECENTRE_H
#define SESSION_RECENTRE_H

#include "session_plan.h"
#include "session_team.h"

/* Adds a recentring to the list *items unless the list already contains it. Returns false if memory ran out. Local. */
bool session_add_recentring(session_recentring **items, int *count, const session_recentring *item);

/* Computes the values at vertices of those recentrings in `items` whose values are out of date on any rank. A vertex
 * gets the mean of the finite values of its cells that are not ghosts, over all ranks; NaN if there are none. The home
 * ranks of the catalogue's meshes, that is, the ranks that combine the values of a vertex that several ranks have, must
 * be up to date (session_update_home_ranks()). stale: working memory for one number per recentring. Collective. All
 * ranks return the same status. An error of a field's patches is also stored in session_field.problem. An error that
 * occurs on this rank after the last exchange of messages is only stored in *error, and the next phase passes it to all
 * ranks. */
insitu_status session_recentre(const session_recentring *items, int count, int *stale, const session_meshes *meshes,
                               const session_team *team, base_error *error);

#endif
