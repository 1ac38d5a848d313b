/* Copies cells whose vertices are not stored in VTK's order, or are stored in rows with more entries than vertices. The
 * row of a cell is its list of vertices in the connectivity. */
#ifndef SESSION_CELL_ORDER_H
#define SESSION_CELL_ORDER_H

#include "session_mesh.h"

/* Returns whether session_order_cells() must copy any cells. */
bool session_must_reorder_vertices(const insitu_mesh *given);

/* Returns a table with one entry for each vertex of a cell in VTK's order: the vertex's position in the given order.
 * Returns NULL if the given order equals VTK's for this type of cell. Each of these permutations is its own inverse. */
const signed char *session_vertex_permutation(insitu_vertex_order order, int type);

/* Copies the cells' vertices into the mesh's topology, contiguously and in VTK's order. Invalid vertex indices are
 * copied unchanged, and cells with invalid offsets keep their order; session_check.c reports these errors later.
 * Local. */
insitu_status session_order_cells(session_mesh *mesh, int threads, base_error *error);

/* Changes, in place, the order of the entries of `out` within each cell from the caller's vertex order to VTK's. `out`
 * has one entry for each vertex of each cell, `entries` in total. A second call restores the caller's order, because
 * each permutation is its own inverse. */
void session_permute_corners_of_cells(const session_mesh *mesh, int64_t entries, int threads, const grid_array *out);

#endif
