/* Checks the caller's descriptions of fields and puts them into the table of meshes. */
#ifndef SESSION_FIELD_INPUT_H
#define SESSION_FIELD_INPUT_H

#include "session_mesh.h"

/* insitu_set_field(). *error is cleared first. Local. */
insitu_status session_set_field(session_meshes *meshes, const char *name, const insitu_field *field, base_error *error);

/* Checks and takes a field's description after fill has given it its values. The error names the mesh and the
 * field. Local. */
insitu_status session_take_filled(session_mesh *mesh, int index, const insitu_field *filled, base_error *error);

/* The field's values have changed: so have those of its scalars. */
void session_spoil_scalars(session_mesh *mesh, int field);

/* Counts the entries of connectivity that are vertices of cells. The cells are no polyhedra. */
int64_t session_corner_count(const insitu_mesh *mesh);
/* Returns how many values the field has, or, where it has an index, how many entries the index has. For corners in rows
 * it is the least number. */
int64_t session_field_places(const insitu_mesh *mesh, const insitu_field *field);

#endif
