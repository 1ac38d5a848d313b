/* Finds the outer faces of a mesh. An outer face belongs to only one cell. All cells except ghosts are searched, on all
 * ranks, or only those selected by a threshold. */
#ifndef SESSION_OUTER_FACES_H
#define SESSION_OUTER_FACES_H

#include "session_homes.h"
#include "session_mesh.h"
#include "session_team.h"

/* One of this rank's parts of a mesh in a search for outer faces. */
typedef struct session_face_part {
    const session_mesh *mesh;
    session_outer *outer; /* receives the faces; its threshold selects the cells */
    /* one byte per vertex, which the search sets to 1 if the vertex is on a face that only one cell of this rank has;
     * or NULL */
    unsigned char *is_border;
} session_face_part;

/* Finds the outer faces of the parts of one mesh. Two faces are equal if their vertices are, that is, if these have the
 * same global ids or, without ids, bitwise equal coordinates. So a face that touches several smaller ones is an outer
 * face, and so are the smaller ones. homes must be up to date. Collective; all ranks return the same status. Only if
 * memory for the faces themselves runs out, the error is stored in *error on this rank alone. */
insitu_status session_find_outer_faces(const session_face_part *parts, int count, const session_homes *homes,
                                       const session_team *team, base_error *error);

#endif
