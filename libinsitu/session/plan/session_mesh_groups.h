/* Creates mesh groups. A mesh group is a set of meshes across which values are averaged at equal vertices.
 *
 * Some codes describe each level of refinement, or each block, as a separate mesh, and isosurfaces must have no seam
 * between these meshes. Meshes are in one group if one layer shows the same field on them. If each material has a
 * separate mesh and layer, the meshes are in different groups, and the field is not averaged across the border between
 * materials. */
#ifndef SESSION_MESH_GROUPS_H
#define SESSION_MESH_GROUPS_H

#include "scene.h"
#include "session_catalogue.h"

/* Creates the mesh groups of all layers and derived fields of the scene, unless they are up to date. Stores the names
 * of the groups in scene_field.mesh_group_name and scene_derived.mesh_group_name. Frees values that were averaged to
 * vertices over groups that no longer exist. Local; the same on every rank. An error is stored in *error. */
void session_group_meshes(scene *scene, session_catalogue *catalogue, session_meshes *meshes, base_error *error);

#endif
