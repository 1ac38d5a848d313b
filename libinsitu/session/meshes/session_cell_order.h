/* Cells whose vertices stand in connectivity in another order than VTK's, or in rows with more in them than vertices.
 */
#ifndef SESSION_CELL_ORDER_H
#define SESSION_CELL_ORDER_H

#include "session_mesh.h"

/* Is there anything to be done? */
bool session_is_reordered(const insitu_mesh *given);

/* The cells' vertices one cell after the other in VTK's order, in the mesh's topology. Indices are taken as they are,
 * good or not; cells with bad offsets are left in the order they have: session_check.c tells of both. Local. */
insitu_status session_order_cells(session_mesh *mesh, int threads, base_error *error);

/* Bring the entries of each cell from the caller's order into VTK's, or back: it is the same. out has so many entries,
 * cells one after the other. */
void session_turn_cells(const session_mesh *mesh, int64_t entries, int threads, const grid_array *out);

#endif
