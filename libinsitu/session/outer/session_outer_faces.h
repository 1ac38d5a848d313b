/* Finds the faces that only one cell has, over all cells of a mesh except ghosts, or over those within a threshold, on
 * all ranks. */
#ifndef SESSION_OUTER_FACES_H
#define SESSION_OUTER_FACES_H

#include "session_homes.h"
#include "session_mesh.h"
#include "session_team.h"

/* Fills in the outer faces. Two faces are the same if their vertices are: if these have the same global ids or, without
 * ids, the same bits of coordinates. So a face that meets several smaller ones is outer, and so are these. mesh and
 * outer: NULL if this rank has no part of the mesh. homes: must be up to date. is_border: NULL, or a byte per vertex,
 * which is set to 1 for those of the faces that this rank has once. Collective, agreed. */
insitu_status session_find_outer_faces(const session_mesh *mesh, session_outer *outer, const session_homes *homes,
                                       const session_team *team, unsigned char *is_border, base_error *error);

#endif
