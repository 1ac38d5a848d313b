/* Keeps the mirror images that the scene shows of this rank's meshes, with their fields (meshes/session_mirror.h). */
#ifndef SESSION_MIRRORS_H
#define SESSION_MIRRORS_H

#include "scene.h"
#include "session_catalogue.h"
#include "session_report.h"
#include "session_team.h"

/* Makes the images that the scene shows, updates those of parts that have changed, and removes the others. It follows
 * the warps and precedes the check of the meshes. Local. */
void session_update_mirrors(const scene *scene, session_meshes *meshes, int threads, base_error *error);

/* Makes the values of a derived field on the images those of their sources. Local. */
void session_share_derived(const session_meshes *meshes, const char *name);

/* Warns of mirrors that stand for no mesh, or whose planes have cells on both sides, so that the images overlap them.
 * Collective. */
insitu_status session_check_mirrors(const scene *scene, const session_meshes *meshes,
                                    const session_catalogue *catalogue, const session_team *team,
                                    session_report *report, base_error *error);

#endif
