/* Copies cells whose vertices are not stored in VTK's order, or are stored in rows with more entries than vertices. The
 * row of a cell is its list of vertices in the connectivity. */
#ifndef SESSION_CELL_ORDER_H
#define SESSION_CELL_ORDER_H

#include "session_mesh.h"

/* Returns whether session_order_cells() must copy any cells. */
bool session_is_reordered(const insitu_mesh *given);

/* Returns, for each vertex in VTK's order, its position in the given order; NULL if the given order equals VTK's for
 * this type of cell. Each permutation is its own inverse. */
const signed char *session_vertex_permutation(insitu_vertex_order order, int type);

/* Copies the cells' vertices into the mesh's topology, contiguously and in VTK's order. Bad indices are copied
 * unchanged, and cells with bad offsets keep their order, because session_check.c reports these errors. Local. */
insitu_status session_order_cells(session_mesh *mesh, int threads, base_error *error);

/* Changes the order of the entries of `out` within each cell, in place, from the caller's vertex order to VTK's. `out`
 * has one entry for each vertex of each cell, `entries` in total. A second call restores the caller's order. */
void session_permute_corners_of_cells(const session_mesh *mesh, int64_t entries, int threads, const grid_array *out);

#endif
