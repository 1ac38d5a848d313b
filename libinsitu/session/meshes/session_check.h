/* Validation of meshes, before other code reads their arrays. */
#ifndef SESSION_CHECK_H
#define SESSION_CHECK_H

#include "session_mesh.h"
#include "session_team.h"

/* Checks the meshes whose cells or coordinates have changed; fills in their bounds and counts, and finds their flat
 * cells. A mesh's fault is stored as its problem; the error is the first fault of the lowest rank. Collective. */
insitu_status session_check_meshes(const session_meshes *meshes, const session_team *team, base_error *error);

#endif
