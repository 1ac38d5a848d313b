/* Groups of this rank's equal vertices.
 *
 * Vertices with equal keys are one vertex (global ids if all ranks give them, else the bits of the coordinates, -0 as
 * +0), also on a single rank: otherwise a mesh that doubles its vertices along a crack would look different on one rank
 * and on two. The same holds for the meshes of a joint (session_joints.h): by coordinates, since ids belong to one
 * mesh. */
#ifndef SESSION_VERTEX_GROUPS_H
#define SESSION_VERTEX_GROUPS_H

#include "session_exchange.h"
#include "session_homes.h"

struct session_mesh;
struct session_border;

/* Those of the vertices of a joint's meshes. They are kept while the meshes stay as they are. */
typedef struct session_vertex_groups {
    uint64_t places;    /* session_joint.places that they are of; 0: not known */
    int64_t *firsts;    /* per mesh, the number of its first vertex, and at the end the number of vertices */
    int64_t *of_vertex; /* group of each vertex; -1: it belongs to no drawn cell */
    int64_t count;
    int64_t *starts; /* count + 1: number of vertices of drawn cells in the groups before */
    session_key_table keys; /* of the groups; empty unless a mesh has patches, which are found by key */
    /* The groups in other ranks' boxes, sorted by their home; none if there is one rank. */
    int64_t shared_count;
    int64_t *shared;
    session_key *shared_keys;
    int64_t *shared_counts; /* per rank, how many have their home there */
} session_vertex_groups;

/* What they are made of. */
typedef struct session_vertex_groups_basis {
    uint64_t places;
    int mesh_count;
    const struct session_mesh *const *meshes; /* NULL: this rank has no part of one */
    const struct session_border *borders;     /* with twins, one per mesh; NULL: vertices have none */
    const session_homes *homes;
    bool by_id; /* the joint is one mesh, whose vertices are equal if their global ids are */
    int ranks;
} session_vertex_groups_basis;

/* Makes the groups unless they are up to date. False where memory runs out; they are then empty. Local. */
bool session_update_vertex_groups(const session_vertex_groups_basis *basis, session_vertex_groups *groups);

void session_vertex_groups_free(session_vertex_groups *groups);

#endif
