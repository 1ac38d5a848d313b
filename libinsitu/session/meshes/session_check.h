/* Checks the arrays of meshes, before other code reads them. */
#ifndef SESSION_CHECK_H
#define SESSION_CHECK_H

#include "session_mesh.h"
#include "session_team.h"

/* Checks the meshes whose cells or coordinates have changed, computes their bounds and counts, and finds their flat
 * cells. The error of a mesh is stored as its `problem`; *error is the first one of the lowest rank. Collective. */
insitu_status session_check_meshes(const session_meshes *meshes, const session_team *team, base_error *error);

#endif
