/* Proof of meshes, before anything reads their arrays. */
#ifndef SESSION_CHECK_H
#define SESSION_CHECK_H

#include "session_mesh.h"
#include "session_team.h"

/* Check the meshes whose cells or coordinates have changed; fill in their bounds and counts, and find their flat cells.
 * What is wrong with one is its problem; the error is the first such of the lowest rank. Collective. */
insitu_status session_check_meshes(const session_meshes *meshes, const session_team *team, base_error *error);

#endif
