/* The faces that one cell alone has, of all cells of a mesh, or of those of a threshold, on all ranks but ghosts. */
#ifndef SESSION_OUTER_FACES_H
#define SESSION_OUTER_FACES_H

#include "session_homes.h"
#include "session_mesh.h"
#include "session_team.h"

/* Fills in the outer's faces. Two faces are the same if their vertices are: if these have the same global ids or,
 * without ids, the same bits of coordinates. So a face that meets several smaller ones is outer, and so are these. mesh
 * and outer NULL: this rank has no part of it. homes: known. is_border: NULL, or a byte for each vertex, set to 1 for
 * those of the faces that this rank has once. Collective, agreed. */
insitu_status session_find_outer_faces(const session_mesh *mesh, session_outer *outer, const session_homes *homes,
                                       const session_team *team, unsigned char *is_border, base_error *error);

#endif
