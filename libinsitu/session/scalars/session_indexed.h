/* Copies fields whose values are stored in another order than that of the mesh's vertices or cells: an index array
 * gives the position of the value of each vertex or cell. */
#ifndef SESSION_INDEXED_H
#define SESSION_INDEXED_H

#include "scene.h"
#include "session_finer.h"
#include "session_mesh.h"

/* Marks the field as needed by statistics of this step, on all meshes that have it. Local. */
void session_mark_field_for_statistics(const session_meshes *meshes, const scene_field *field);
/* Removes all marks that session_mark_field_for_statistics() has set. Local. */
void session_clear_statistics_marks(const session_meshes *meshes);

/* Both functions copy values that have an index into the order of the mesh's vertices, cells or corners, unless the
 * copy is up to date. session_copy_requested_fields() copies the fields that statistics need, and clears their marks.
 * session_copy_used_fields() copies the fields of scalars that this step uses, and the fields from which derived fields
 * are computed. If an index is invalid, the error is also stored in session_field.problem, and the other fields are
 * still copied. Both functions must be called before the values are read. Local. */
insitu_status session_copy_requested_fields(const session_meshes *meshes, int threads, base_error *error);
insitu_status session_copy_used_fields(const session_meshes *meshes, int threads, base_error *error);

/* Passes the caller's values at the nodes of cells of higher order to the function `use`. If the field has no values at
 * nodes, or has a fault, `use` is not called. Returns the status of `use`. Local. */
typedef insitu_status session_use_values(void *of, const session_node_values *values, base_error *error);
insitu_status session_pass_node_values(const session_mesh *mesh, int field, session_use_values *use, void *of,
                                       base_error *error);

#endif
