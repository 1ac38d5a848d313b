/* Copies arrays of a mesh that other code cannot read in place. These are coordinates given as integers, small
 * integers, flags of more than one byte, cell types that the caller numbers in its own way, and arrays that are not
 * aligned. */
#ifndef SESSION_CONFORM_H
#define SESSION_CONFORM_H

#include "session_mesh.h"

/* Stores the caller's description in mesh->original. mesh->given receives the same description, in which arrays that
 * cannot be read in place are replaced by copies. Copies are allocated here and filled by session_convert_arrays().
 * Copies of arrays that have not changed, according to the INSITU_CHANGED_* bits of `changed`, are kept. After an error
 * some copies are missing, and the mesh can only be dropped. */
insitu_status session_allocate_converted_arrays(session_mesh *mesh, const insitu_mesh *original, unsigned changed,
                                                base_error *error);

/* Fills the copies from the caller's arrays. Uses all threads. */
void session_convert_arrays(session_mesh *mesh, int threads);

/* Returns whether a map from the caller's numbers to cell types equals the map of the mesh. map: NULL means that there
 * is no map. */
bool session_has_cell_type_map(const session_mesh *mesh, int count, const int *map);

#endif
