/* Finds the fields by which the scene displaces the vertices of meshes, and applies them (meshes/session_warp.h). */
#ifndef SESSION_WARPED_H
#define SESSION_WARPED_H

#include "scene.h"
#include "session_catalogue.h"
#include "session_report.h"

/* Moves the vertices of the meshes that the scene warps, if the mesh, the field of displacements or the scene has
 * changed. Errors in these fields are stored with the meshes; the check of the meshes, which must follow, returns them.
 * scene_path is used in messages. Local, but fill functions may communicate. */
void session_update_warps(const scene *scene, const char *scene_path, session_meshes *meshes, int threads);

/* Warns if a mesh that the scene warps does not exist, and if gradients are computed on a warped mesh. Local. */
void session_check_warps(const scene *scene, const session_catalogue *catalogue, session_report *report);

/* The kinds of transforms by which the scene changes a mesh. */
typedef enum session_transform { SESSION_WARP = 0, SESSION_MIRROR } session_transform;

/* Warns if the scene names a mesh that exists on no rank. Local. */
void session_warn_of_absent_mesh(const char *name, int line, session_transform transform,
                                 const session_catalogue *catalogue, session_report *report);

#endif
