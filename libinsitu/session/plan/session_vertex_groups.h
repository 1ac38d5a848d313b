/* Groups this rank's equal vertices.
 *
 * Vertices with equal keys are treated as one vertex. The keys are global ids if all ranks give ids, else the bits
 * of the coordinates, with -0 replaced by +0. Vertices are also grouped if there is only one rank, because otherwise
 * a mesh with duplicate vertices along a crack would look different on one rank and on two. The meshes of a mesh
 * group (session_mesh_groups.h) share the groups of vertices, but only by coordinates, because ids belong to one
 * mesh. */
#ifndef SESSION_VERTEX_GROUPS_H
#define SESSION_VERTEX_GROUPS_H

#include "session_catalogue.h"

/* Input for grouping the vertices of a mesh group's meshes. */
typedef struct session_vertex_groups_basis {
    uint64_t positions_hash;
    int part_count;
    const session_mesh *const *parts; /* this rank's parts of all meshes of the mesh group */
    /* outer faces of the parts, with the twins of their vertices (vertices that coincide up to rounding,
     * session_twins.h); NULL: vertices have no twins */
    const session_border *borders;
    const session_homes *homes;
    bool by_id; /* true: the mesh group is a single mesh with global ids, and vertices with equal ids are equal */
    int ranks;
} session_vertex_groups_basis;

/* Makes the groups unless they are up to date. Returns false if memory ran out; the groups are then empty. Local. */
bool session_update_vertex_groups(const session_vertex_groups_basis *basis, session_vertex_groups *groups);

#endif
