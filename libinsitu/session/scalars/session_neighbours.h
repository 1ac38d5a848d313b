/* Which vertices are one, and which of them other ranks may have. */
#ifndef SESSION_NEIGHBOURS_H
#define SESSION_NEIGHBOURS_H

#include "session_exchange.h"
#include "session_mesh.h"
#include "session_team.h"

/* A vertex's global id, or the bits of its coordinates, -0 as +0. */
session_key session_vertex_key(const session_mesh *mesh, int64_t vertex, bool by_id);
/* The same of a vertex by the caller's number, which a torn mesh has at several corners. */
session_key session_given_vertex_key(const session_mesh *mesh, int64_t vertex, bool by_id);

typedef struct session_box {
    double lower[3], upper[3];
} session_box;

/* The boxes of other ranks' drawn cells that meet this one's, each widened by margin: to the front of boxes, which has
 * room for all ranks. mesh NULL: there are no cells here. Collective. */
insitu_status session_gather_boxes(const session_team *team, const session_mesh *mesh, double margin,
                                   session_box *boxes, int *count, base_error *error);

/* Is the vertex in any of the boxes? */
bool session_is_in_boxes(const session_mesh *mesh, int64_t vertex, const session_box *boxes, int count);

#endif
