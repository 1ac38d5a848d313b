/* Finds meshes whose vertices seem to be in another order than the declared one. */
#ifndef SESSION_VERTEX_ORDER_H
#define SESSION_VERTEX_ORDER_H

#include "session_catalogue.h"
#include "session_mesh.h"
#include "session_report.h"
#include "session_team.h"

/* Finds the meshes that consist only of shells, that have cells of higher order, or that have bent cells
 * (session_straight.h), and stores these properties in the catalogue. Warns of meshes most of whose cells, over all
 * ranks, have no volume, are left-handed, or intersect themselves. Collective. */
insitu_status session_check_vertex_order(const session_meshes *meshes, session_catalogue *catalogue,
                                         const session_team *team, session_report *report, base_error *error);

#endif
