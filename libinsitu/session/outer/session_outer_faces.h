/* The faces that one cell alone has, of all cells of a mesh on all ranks but ghosts. */
#ifndef SESSION_OUTER_FACES_H
#define SESSION_OUTER_FACES_H

#include "session_mesh.h"
#include "session_team.h"

/* Fill in mesh->outer.faces. Two faces are one where their vertices are: by global ids (by_id), else where the bits of
 * their coordinates are equal; so a face that meets several smaller ones is outer, and so are these. mesh NULL: this
 * rank has no part of it. half_diagonal: of the global bounds. Collective. */
insitu_status session_find_outer_faces(session_mesh *mesh, bool by_id, double half_diagonal, const session_team *team,
                                       base_error *error);

#endif
