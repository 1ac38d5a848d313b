/* Finds the cells of higher order that have outer faces. Images of outer surfaces need finer linear pieces
 * (session_finer.h) only in these cells. */
#ifndef SESSION_OUTER_CELLS_H
#define SESSION_OUTER_CELLS_H

#include "session_catalogue.h"
#include "session_mesh.h"
#include "session_team.h"

/* Discards the bit masks of outer faces (session_finer.outer_faces) of all meshes. This must be called on all ranks if
 * cells or positions have changed on any rank, also if no image shows an outer surface. Local. */
void session_forget_outer_cells(const session_meshes *meshes);

/* Computes the bit masks of each cell's outer faces (session_finer.outer_faces) for all parts of a mesh whose cells are
 * split, unless the masks are known on all ranks. The faces are searched over all ranks, so that the masks do not
 * depend on the partition. Collective; all ranks return the same status. */
insitu_status session_find_outer_cells(const session_parts *parts, const session_team *team, base_error *error);

#endif
