/* Checks the caller's descriptions of meshes and puts them into the table of meshes. */
#ifndef SESSION_MESH_INPUT_H
#define SESSION_MESH_INPUT_H

#include "session_mesh.h"

/* insitu_set_mesh(). *error is cleared first. Local. */
insitu_status session_set_mesh(session_meshes *meshes, const char *name, const insitu_mesh *given, base_error *error);

enum { SESSION_ALLOW_FLOATS = 1, SESSION_ALLOW_INTEGERS = 2, SESSION_ALLOW_BYTES = 4 };

/* The types that an array may have. */
typedef struct session_array_rule {
    const char *name;
    int64_t count;
    int allowed; /* SESSION_ALLOW_* */
    bool is_optional;
} session_array_rule;

/* Checks that the array is given, has an allowed type and stride, and is aligned. bad: the status where anything but
 * the type is wrong. */
insitu_status session_check_array(const insitu_array *array, const session_array_rule *rule, insitu_status bad,
                                  base_error *error);

/* Tells whether both are read from the same place in the same way. */
bool session_is_same_array(const insitu_array *a, const insitu_array *b);

/* Put "mesh "name": ", and the field's name where there is one, in front of what a check said. */
insitu_status session_place_error(base_error *error, const char *mesh, const char *field, const base_error *what);

#endif
