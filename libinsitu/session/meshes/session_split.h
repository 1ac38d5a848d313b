/* Splits cells of higher order into linear pieces, which are read instead of the cells. The row of a cell is its list
 * of nodes in the connectivity; rows may end with unused entries. */
#ifndef SESSION_SPLIT_H
#define SESSION_SPLIT_H

#include "session_mesh.h"

/* Returns whether some cells are of higher order. If the mesh has mixed types, the types of all cells are read. */
bool session_has_higher_order(const insitu_mesh *given);

/* Splits the cells into linear pieces, and stores the pieces in mesh->topology. Returns an error, and stores nothing,
 * if types, numbers of nodes, offsets or vertex indices of the caller's cells are invalid. Local. */
insitu_status session_split_cells(session_mesh *mesh, int threads, base_error *error);

/* Creates a second connectivity of the pieces. For each corner of each piece it contains, instead of the index of a
 * vertex, the index of the entry of the caller's connectivity from which the corner was taken; unused entries at the
 * end of each cell's entries are not counted. Local. */
insitu_status session_make_entry_connectivity(const session_mesh *mesh, int threads, grid_array *out,
                                              base_error *error);

/* Converts the index of an entry of the caller's connectivity. `entry` is the entry's index if the unused entries at
 * the end of each cell's row are not counted; the result is its index if all entries are counted. */
int64_t session_find_connectivity_index(const insitu_mesh *given, int64_t entry);

/* Counts the caller's cells of a mesh whose cells are split. A cell is flat if all its pieces are flat. It is inverted
 * if at least one of its pieces is inverted; inverted cells are counted only if any_inverted is set. Local. */
session_counts session_count_split_cells(const session_mesh *mesh, bool any_inverted);

/* Returns the number of the caller's cells that have at least one piece in the list. If memory runs out, returns the
 * number of all drawn cells. Local. */
int64_t session_count_cells_of_pieces(const session_mesh *mesh, const uint32_t *pieces, int64_t count);

#endif
