/* Groups of this rank's equal vertices.
 *
 * Vertices with equal keys are one vertex (global ids if all ranks give them, else the bits of the coordinates, -0 as
 * +0), also on a single rank: otherwise a mesh that doubles its vertices along a crack would look different on one rank
 * and on two. The same holds for the meshes of a joint (session_joints.h): by coordinates, since ids belong to one
 * mesh. */
#ifndef SESSION_VERTEX_GROUPS_H
#define SESSION_VERTEX_GROUPS_H

#include "session_catalogue.h"

/* What they are made of. */
typedef struct session_vertex_groups_basis {
    uint64_t places;
    int part_count;
    const session_mesh *const *parts; /* this rank's, of all meshes of the joint */
    const session_border *borders;    /* with twins, one per part; NULL: vertices have none */
    const session_homes *homes;
    bool by_id; /* the joint is one mesh, whose vertices are equal if their global ids are */
    int ranks;
} session_vertex_groups_basis;

/* Makes the groups unless they are up to date. False where memory runs out; they are then empty. Local. */
bool session_update_vertex_groups(const session_vertex_groups_basis *basis, session_vertex_groups *groups);

#endif
