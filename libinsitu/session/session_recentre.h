/* Cell values to vertices, for isosurfaces. */
#ifndef SESSION_RECENTRE_H
#define SESSION_RECENTRE_H

#include "session_plan.h"

/* Fill the recentred arrays of the plan that are out of date on any rank. A vertex gets the mean of the finite values
 * of its cells that are no ghosts, over all ranks; NaN where there are none. Collective. */
insitu_status session_recentre(insitu_session *session, const session_plan *plan, base_error *error);

#endif
