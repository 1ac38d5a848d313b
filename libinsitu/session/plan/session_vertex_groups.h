/* Finds out which vertices of this rank are equal, and numbers the groups of equal vertices.
 *
 * Vertices with equal keys are treated as one vertex. The keys are global ids if all ranks give ids, else the bits of
 * the coordinates, with -0 replaced by +0. Vertices are also grouped if there is only one rank, because otherwise a
 * mesh with duplicate vertices along a crack would look different on one rank and on two. If a mesh group
 * (session_mesh_groups.h) has several meshes, a group of vertices may contain vertices of different meshes. Such
 * vertices are compared by coordinates, because ids are unique only within one mesh. */
#ifndef SESSION_VERTEX_GROUPS_H
#define SESSION_VERTEX_GROUPS_H

#include "session_catalogue.h"

/* Input for grouping the vertices of a mesh group's meshes. */
typedef struct session_vertex_groups_basis {
    /* session_mesh_group.positions_hash; existing groups are up to date if they were computed for the same hash */
    uint64_t positions_hash;
    int part_count;
    const session_mesh *const *parts; /* this rank's parts of all meshes of the mesh group */
    /* outer faces of the parts, with the twins of their vertices (vertices that coincide up to rounding,
     * session_twins.h); NULL: vertices have no twins */
    const session_border *borders;
    const session_homes *homes; /* bounding boxes of other ranks, and home ranks of the vertices in them */
    bool by_id; /* true: the mesh group is a single mesh with global ids, and vertices with equal ids are equal */
    int ranks;  /* number of MPI ranks */
} session_vertex_groups_basis;

/* Computes the groups of equal vertices unless they are up to date. Returns false if memory ran out; the groups are
 * then empty. Local. */
bool session_update_vertex_groups(const session_vertex_groups_basis *basis, session_vertex_groups *groups);

#endif
