/* Checks the caller's descriptions of meshes and puts them into the table of meshes. */
#ifndef SESSION_MESH_INPUT_H
#define SESSION_MESH_INPUT_H

#include "session_arrays.h"
#include "session_mesh.h"

/* insitu_set_mesh(). *error is cleared first. Local. */
insitu_status session_set_mesh(session_meshes *meshes, const char *name, const insitu_mesh *given, base_error *error);

/* Put "mesh "name": ", and the field's name where there is one, in front of what a check said. */
insitu_status session_place_error(base_error *error, const char *mesh, const char *field, const base_error *what);

#endif
