/* Checks the arrays of meshes, before other code reads them. */
#ifndef SESSION_CHECK_H
#define SESSION_CHECK_H

#include "session_mesh.h"
#include "session_team.h"

/* Checks the meshes whose cells or coordinates have changed, computes their bounds and numbers of cells, and finds
 * their flat cells, which have no volume. The error of a mesh is stored in session_mesh.problem; on all ranks, *error
 * receives the first error of the lowest rank that has one. Collective. */
insitu_status session_check_meshes(const session_meshes *meshes, const session_team *team, base_error *error);

#endif
