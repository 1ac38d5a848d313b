/* Warns of layers that show nothing: isosurfaces that cross no cell, volumes that are transparent at all values of
 * their fields, and surfaces whose thresholds exclude all cells. */
#ifndef SESSION_EMPTY_LAYERS_H
#define SESSION_EMPTY_LAYERS_H

#include "session_catalogue.h"
#include "session_plan.h"
#include "session_report.h"
#include "session_team.h"

/* Warns of layers that show no value of their fields, and of cells that layers cannot show because their values are not
 * finite (session_unusable.h). Must be called after the trees are built, because it reads the ranges of values in the
 * trees. Collective; an error in *error on any rank is returned on all ranks. */
insitu_status session_warn_of_empty_layers(const session_plan *plan, const session_catalogue *catalogue,
                                           const session_meshes *meshes, const session_team *team,
                                           session_report *report, base_error *error);

#endif
