/* Finds the faces that only one cell has, over all cells of a mesh except ghosts, or over those within a threshold, on
 * all ranks. */
#ifndef SESSION_OUTER_FACES_H
#define SESSION_OUTER_FACES_H

#include "session_homes.h"
#include "session_mesh.h"
#include "session_team.h"

/* One of this rank's parts of a mesh. */
typedef struct session_face_part {
    const session_mesh *mesh;
    session_outer *outer;     /* gets the faces; its threshold says of which cells */
    unsigned char *is_border; /* NULL, or a byte per vertex, which is set to 1 for those of the faces that this rank has
                                 once */
} session_face_part;

/* Finds the outer faces of the parts of one mesh. Two faces are the same if their vertices are: if these have the same
 * global ids or, without ids, the same bits of coordinates. So a face that meets several smaller ones is outer, and so
 * are these. homes: must be up to date. Collective, agreed, but for memory of the faces themselves: if that runs out,
 * only *error says so. */
insitu_status session_find_outer_faces(const session_face_part *parts, int count, const session_homes *homes,
                                       const session_team *team, base_error *error);

#endif
