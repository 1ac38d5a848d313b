/* Finds the cells of higher order that have outer faces. Images of outer surfaces need finer linear pieces
 * (session_finer.h) only in these cells. */
#ifndef SESSION_OUTER_CELLS_H
#define SESSION_OUTER_CELLS_H

#include "session_catalogue.h"
#include "session_mesh.h"
#include "session_team.h"

/* Computes session_finer.outer_faces of all parts of a mesh whose cells are split. The faces are searched over all
 * ranks, so that they do not depend on the partition. If are_cells_changed is false on all ranks, faces that are known
 * on all ranks are kept. Collective; all ranks return the same status. */
insitu_status session_find_outer_cells(const session_parts *parts, bool are_cells_changed, const session_team *team,
                                       base_error *error);

#endif
