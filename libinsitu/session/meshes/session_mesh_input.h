/* What the caller says of meshes and fields: checked, and put into the table of meshes. */
#ifndef SESSION_MESH_INPUT_H
#define SESSION_MESH_INPUT_H

#include "session_mesh.h"

/* insitu_set_mesh() and insitu_set_field(). *error is cleared first. Local. */
insitu_status session_set_mesh(session_meshes *meshes, const char *name, const insitu_mesh *given, base_error *error);
insitu_status session_set_field(session_meshes *meshes, const char *name, const insitu_field *field, base_error *error);

#endif
