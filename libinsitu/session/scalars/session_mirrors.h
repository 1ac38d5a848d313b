/* Creates and updates the mirror images that the scene requests of this rank's meshes, together with the fields of the
 * images (meshes/session_mirror.h). */
#ifndef SESSION_MIRRORS_H
#define SESSION_MIRRORS_H

#include "scene.h"
#include "session_catalogue.h"
#include "session_report.h"
#include "session_team.h"

/* Creates the mirror images that the scene draws, updates those of parts that have changed, and removes all others. It
 * must be called after meshes are warped and before they are checked. Local. */
void session_update_mirrors(const scene *scene, session_meshes *meshes, int threads, base_error *error);

/* Copies the values of a derived field from the source meshes to their mirror images. Local. */
void session_lend_derived_values_to_mirrors(const session_meshes *meshes, const char *name);

/* Warns of mirrors in the scene that name no mesh, and of meshes with cells on both sides of a mirror plane, because
 * such a mesh overlaps its mirror image. Collective. */
insitu_status session_check_mirrors(const scene *scene, const session_meshes *meshes,
                                    const session_catalogue *catalogue, const session_team *team,
                                    session_report *report, base_error *error);

#endif
