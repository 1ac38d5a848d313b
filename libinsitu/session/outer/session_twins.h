/* Finds twins: vertices of several meshes that coincide up to rounding.
 *
 * Codes compute the vertex positions of each block or level from its own origin and spacing, so that the positions of a
 * vertex in two meshes differ in the last bits. All twins on outer faces are given the lexicographically least of their
 * positions. Two vertices are twins if their distance is at most 1e-5 of the length of the shortest edge of outer faces
 * at one of the two. If the bound of the coordinates' rounding errors is larger than this distance, it is the limit
 * instead, but at most a quarter of the edge's length. */
#ifndef SESSION_TWINS_H
#define SESSION_TWINS_H

#include "session_catalogue.h"
#include "session_keys.h"
#include "session_team.h"

/* Finds the twins of the mesh group's vertices. Its borders (outer faces of parts, session_catalogue.h) and its
 * session_homes (the ranks near this rank and their bounding boxes) must be up to date. `parts` contains this rank's
 * parts. Errors that occur only on this rank are stored in *error and not returned. Collective. */
insitu_status session_find_coincident_vertices(session_mesh_group *mesh_group, const session_mesh_group_parts *parts,
                                               const session_team *team, base_error *error);

/* Returns the key of a vertex of a part of a mesh: for a twin, that of the position that all its twins have in common,
 * and otherwise session_vertex_key(). border: the part's border, whose twins must be up to date; NULL: vertices are
 * compared bitwise. by_id: vertices are compared by their global ids; there are no twins then. */
session_key session_merged_vertex_key(const session_mesh *mesh, const session_border *border, int64_t vertex,
                                      bool by_id);

#endif
