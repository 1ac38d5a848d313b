/* Creates mesh groups, which are sets of meshes across which cell values are averaged at equal vertices.
 *
 * Codes that describe each level of refinement, or each block, as a separate mesh need isosurfaces without a seam
 * between these. Meshes are joined if one layer shows the same field on them. If each material has a layer of its own,
 * meshes are not joined, and the field is not averaged across the border between materials. */
#ifndef SESSION_MESH_GROUPS_H
#define SESSION_MESH_GROUPS_H

#include "scene.h"
#include "session_catalogue.h"

/* Creates the mesh groups of all layers of the scene, and stores their names in the layers, unless they are up to date;
 * drops recentred values of other mesh_groups. Local; the same on every rank. An error is stored in *error. */
void session_group_meshes(scene *scene, session_catalogue *catalogue, session_meshes *meshes, base_error *error);

#endif
