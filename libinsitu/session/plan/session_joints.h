/* Joints: which meshes have one mean of cell values where their vertices are the same.
 *
 * Codes that give each level of refinement, or each block, as a mesh of its own want isosurfaces without a seam between
 * them. What makes meshes one is that a layer shows the same field on them. So layers with lists of their own, one for
 * each material, keep a field apart at the materials' border. */
#ifndef SESSION_JOINTS_H
#define SESSION_JOINTS_H

#include "scene.h"
#include "session_catalogue.h"

/* Makes the joints of all layers of the scene, and names them there, where they are not known; recentred values of
 * other joints are dropped. Local; the same on every rank. What fails is in *error. */
void session_join_meshes(scene *scene, session_catalogue *catalogue, session_meshes *meshes, base_error *error);

#endif
