/* Cells whose vertices stand in connectivity in another order than VTK's, or in rows with more in them than vertices.
 */
#ifndef SESSION_CELL_ORDER_H
#define SESSION_CELL_ORDER_H

#include "session_mesh.h"

/* Tells whether session_order_cells() has anything to do. */
bool session_is_reordered(const insitu_mesh *given);

/* The places of VTK's vertices in the other order; NULL: the orders are the same for the type. Each permutation is its
 * own inverse. */
const signed char *session_vertex_turn(insitu_vertex_order order, int type);

/* Copies the cells' vertices into the mesh's topology, one cell after the other, in VTK's order. Bad indices are copied
 * as they are, and cells with bad offsets keep their order: session_check.c reports both. Local. */
insitu_status session_order_cells(session_mesh *mesh, int threads, base_error *error);

/* Bring the entries of each cell from the caller's order into VTK's, or back: both are the same permutation. out has
 * that many entries, one cell after the other. */
void session_turn_cells(const session_mesh *mesh, int64_t entries, int threads, const grid_array *out);

#endif
