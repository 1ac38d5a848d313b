/* Computes keys by which equal vertices are recognized. */
#ifndef SESSION_NEIGHBOURS_H
#define SESSION_NEIGHBOURS_H

#include "session_exchange.h"
#include "session_mesh.h"

/* Returns a vertex's key: its global id if by_id is set, and otherwise the bits of its coordinates, with -0 replaced by
 * +0. */
session_key session_vertex_key(const session_mesh *mesh, int64_t vertex, bool by_id);
/* Returns the key of the vertex with this index in the caller's arrays. In a discontinuous mesh, each corner is a
 * vertex of the session, so that the session's index of a vertex differs from the caller's. */
session_key session_caller_vertex_key(const session_mesh *mesh, int64_t vertex, bool by_id);

#endif
