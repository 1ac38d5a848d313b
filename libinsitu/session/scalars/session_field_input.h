/* Checks the caller's descriptions of fields and stores them in the table of meshes. */
#ifndef SESSION_FIELD_INPUT_H
#define SESSION_FIELD_INPUT_H

#include "session_mesh.h"

/* Implements insitu_set_field(), if block is SESSION_WHOLE, and otherwise insitu_set_block_field(). *error is cleared
 * first. Local. */
insitu_status session_set_field(session_meshes *meshes, const char *name, int64_t block, const insitu_field *field,
                                base_error *error);

/* Checks a field's description on one part of a mesh, and stores it. Returns an error if the description is wrong or if
 * memory runs out; the error of a wrong description is also stored with the field. Local. */
insitu_status session_set_part_field(session_meshes *meshes, session_mesh *mesh, const insitu_field *given,
                                     base_error *error);

/* Checks and stores a field's description after its fill function has set its values. The error message names the mesh
 * and the field. Local. */
insitu_status session_store_filled_field(session_mesh *mesh, int index, const insitu_field *filled, base_error *error);

/* Marks the field's scalars as stale, because its values have changed. */
void session_mark_scalars_stale(session_mesh *mesh, int field);

/* Returns the number of entries of the connectivity that are vertices of cells, without the unused entries at the ends
 * of the cells' lists. The mesh must not have polyhedra. */
int64_t session_count_corners(const insitu_mesh *mesh);
/* Returns the number of the field's values or, if it has an index, of the index's entries. For values at corners that
 * are stored with a fixed distance from cell to cell (insitu_field.corner_row), it is the smallest allowed number. */
int64_t session_count_field_entries(const insitu_mesh *mesh, const insitu_field *field);

#endif
