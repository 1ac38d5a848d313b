/* Warns of cells that layers do not show because their values are not finite. */
#ifndef SESSION_UNUSABLE_H
#define SESSION_UNUSABLE_H

#include "session_catalogue.h"
#include "session_plan.h"
#include "session_report.h"
#include "session_team.h"

/* A hash of this rank's cells with such values, by what the plan's layers show; 0: there are none. While it is the same
 * on every rank, the warnings are. Local. */
uint64_t session_unusable_key(const session_plan *plan, const session_meshes *meshes);

/* Count such cells over all ranks, and warn. Collective. */
insitu_status session_warn_of_unusable(const session_plan *plan, const session_catalogue *catalogue,
                                       const session_meshes *meshes, const session_team *team, session_report *report,
                                       base_error *error);

#endif
