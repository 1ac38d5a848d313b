/* Trees over this rank's meshes and the ranges of their scalars, brought up to date. */
#ifndef SESSION_TREE_H
#define SESSION_TREE_H

#include "session_plan.h"

/* For every mesh and scalar that the plan marked. Local. */
insitu_status session_update_trees(insitu_session *session, base_error *error);

/* The ranges of a scalar in use. */
mmbvh_ranges session_scalar_ranges(const session_mesh *mesh, const session_scalar *scalar);

/* Least and greatest value over the drawn cells all of whose values are finite; low > high: there are none. Parallel.
 * Local. */
void session_scalar_extent(const session_mesh *mesh, session_scalar *scalar, int threads, double *low, double *high);

#endif
