/* Finds the outer faces of a mesh. An outer face belongs to only one cell. The search includes all cells except ghosts,
 * on all ranks, or only the cells selected by a threshold. */
#ifndef SESSION_OUTER_FACES_H
#define SESSION_OUTER_FACES_H

#include "session_homes.h"
#include "session_mesh.h"
#include "session_team.h"

/* A part of a mesh on this rank that is included in a search for outer faces. */
typedef struct session_face_part {
    const session_mesh *mesh;
    session_outer *outer; /* receives the faces; its threshold selects the cells. NULL: see `masks` */
    /* if `outer` is NULL and the mesh is split: one byte per cell of the caller, which receives a bit mask of the
     * cell's outer faces; bit f stands for session_shape.faces[f] */
    unsigned char *masks;
    /* one byte per vertex: the search sets it to 1 if the vertex is on a face that belongs to only one cell of this
     * rank; NULL: not requested */
    unsigned char *is_border;
} session_face_part;

/* Finds the outer faces of the parts of one mesh. Two faces are equal if their vertices are equal, that is, have the
 * same global ids or, without ids, bitwise equal coordinates. Therefore a face that touches several smaller faces is an
 * outer face, and the smaller faces are outer faces too. homes: the home ranks of the mesh, that is, the ranks that
 * compare faces of several ranks (session_homes.h); they must be up to date. Collective; all ranks return the same
 * status. As an exception, if memory for the faces themselves runs out, the error is only stored in *error on this
 * rank. */
insitu_status session_find_outer_faces(const session_face_part *parts, int count, const session_homes *homes,
                                       const session_team *team, base_error *error);

#endif
