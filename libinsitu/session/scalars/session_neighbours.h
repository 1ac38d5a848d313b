/* Keys by which equal vertices are recognized. */
#ifndef SESSION_NEIGHBOURS_H
#define SESSION_NEIGHBOURS_H

#include "session_exchange.h"
#include "session_mesh.h"

/* Returns a vertex's global id, or the bits of its coordinates, with -0 as +0. */
session_key session_vertex_key(const session_mesh *mesh, int64_t vertex, bool by_id);
/* As above, for a vertex by the caller's number; a torn mesh has it at several corners. */
session_key session_given_vertex_key(const session_mesh *mesh, int64_t vertex, bool by_id);

#endif
