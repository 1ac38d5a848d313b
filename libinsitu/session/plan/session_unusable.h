/* Warns of cells that layers do not show, or show without a colour, because their values are not finite. */
#ifndef SESSION_UNUSABLE_H
#define SESSION_UNUSABLE_H

#include "session_catalogue.h"
#include "session_plan.h"
#include "session_report.h"
#include "session_team.h"

/* Returns a hash of the pairs (mesh, field) for which this rank has cells with values that are not finite; 0 if there
 * are no such pairs. The fields are those that the plan's isosurfaces and volumes show, and those that colour its
 * slices and surfaces. The warnings are the same as before if the hash has not changed on any rank. Parallel. Local. */
uint64_t session_hash_unusable_fields(const session_plan *plan, const session_meshes *meshes, int threads);

/* Counts the cells with values that are not finite over all ranks, and warns of them. Of a field and mesh whose
 * cells are not drawn in an isosurface or volume, there is no second warning for colours. Collective. */
insitu_status session_warn_of_unusable_cells(const session_plan *plan, const session_catalogue *catalogue,
                                             const session_meshes *meshes, const session_team *team,
                                             session_report *report, base_error *error);

#endif
