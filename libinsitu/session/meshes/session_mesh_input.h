/* Checks the caller's descriptions of meshes and puts them into the table of meshes. */
#ifndef SESSION_MESH_INPUT_H
#define SESSION_MESH_INPUT_H

#include "session_mesh.h"

/* insitu_set_mesh(). *error is cleared first. Local. */
insitu_status session_set_mesh(session_meshes *meshes, const char *name, const insitu_mesh *given, base_error *error);

enum {
    SESSION_ALLOW_FLOATS = 1,
    SESSION_ALLOW_INTEGERS = 2,
    SESSION_ALLOW_BYTES = 4,
    SESSION_IS_OPTIONAL = 8,
    SESSION_HAS_END = 16 /* one element more than its count, as offsets have */
};

/* What an array must be. */
typedef struct session_array_rule {
    const char *name; /* in the plural */
    int64_t count;    /* of its elements */
    int kind;         /* the bits above */
    int per_tuple;    /* elements from one to the next if there is no stride */
} session_array_rule;

/* Checks that the array is given, has an allowed type, is aligned, and has a stride by which its elements can lie in
 * memory. bad: the status where anything but the type is wrong. */
insitu_status session_check_array(const insitu_array *array, const session_array_rule *rule, insitu_status bad,
                                  base_error *error);

/* Checks the stride from each component of data's tuples to the next. name: of the components. */
insitu_status session_check_components(const insitu_array *data, int count, int64_t stride, const char *name,
                                       base_error *error);

/* Tells whether both are read from the same place in the same way. */
bool session_is_same_array(const insitu_array *a, const insitu_array *b);

/* Put "mesh "name": ", and the field's name where there is one, in front of what a check said. */
insitu_status session_place_error(base_error *error, const char *mesh, const char *field, const base_error *what);

#endif
