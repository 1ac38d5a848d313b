/* Keys that tell which vertices are the same one. */
#ifndef SESSION_NEIGHBOURS_H
#define SESSION_NEIGHBOURS_H

#include "session_exchange.h"
#include "session_mesh.h"

/* A vertex's global id, or the bits of its coordinates, -0 as +0. */
session_key session_vertex_key(const session_mesh *mesh, int64_t vertex, bool by_id);
/* As above, for a vertex by the caller's number, which a torn mesh has at several corners. */
session_key session_given_vertex_key(const session_mesh *mesh, int64_t vertex, bool by_id);

#endif
