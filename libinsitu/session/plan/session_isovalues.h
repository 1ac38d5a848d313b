/* Warns of isovalues that no cell has. */
#ifndef SESSION_ISOVALUES_H
#define SESSION_ISOVALUES_H

#include "session_mesh.h"
#include "session_plan.h"
#include "session_report.h"
#include "session_team.h"

/* Warn of isovalues outside of their fields. Called after the trees are made, whose ranges decide for most. Collective;
 * an error in any rank's *error becomes that of all. */
insitu_status session_check_isovalues(const session_plan *plan, const session_meshes *meshes, const session_team *team,
                                      session_report *report, base_error *error);

#endif
