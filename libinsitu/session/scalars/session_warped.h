/* Finds the fields by which the scene warps meshes, and has the vertices moved (meshes/session_warp.h). */
#ifndef SESSION_WARPED_H
#define SESSION_WARPED_H

#include "scene.h"
#include "session_catalogue.h"
#include "session_report.h"

/* Moves the vertices of this rank's meshes as the scene says, as far as the mesh, the field or the scene has changed.
 * It precedes the check of the meshes, which returns errors of the field. scene_path is for messages. Local, but fill
 * functions may communicate. */
void session_update_warps(const scene *scene, const char *scene_path, session_meshes *meshes, int threads);

/* Warns of entries of the scene that stand for no mesh, and of gradients on warped meshes. Local. */
void session_check_warps(const scene *scene, const session_catalogue *catalogue, session_report *report);

/* What the scene does to a mesh. */
typedef enum session_transform { SESSION_WARP = 0, SESSION_MIRROR } session_transform;

/* Warns if no rank has a mesh for which this name of the scene stands. Local. */
void session_warn_of_absent_mesh(const char *name, int line, session_transform transform,
                                 const session_catalogue *catalogue, session_report *report);

#endif
