/* The values that a field of cells has on the boundary, at the vertices of its faces. */
#ifndef SESSION_PATCHES_H
#define SESSION_PATCHES_H

#include "session_exchange.h"
#include "session_mesh.h"

/* The vertices on this rank that are the same one. */
typedef struct session_vertex_numbers {
    const session_key_table *keys; /* keys of drawn cells' vertices; the keys' numbers are the groups */
    const int64_t *of_vertex;      /* the group of each vertex of mesh->cells; -1: a vertex of no drawn cell */
    bool by_id;
} session_vertex_numbers;

/* count values, and the groups that they are given to, each face's to those of its vertices, once to each. */
typedef struct session_patch_values {
    int64_t count;
    int64_t *groups;
    double *values;
} session_patch_values;

/* Finds the finite values that the field's patches have on faces of drawn cells. Faces that the mesh does not have,
 * that two cells share, or that are given twice are errors. Local. */
insitu_status session_find_patch_values(const session_mesh *mesh, int field, int component,
                                        const session_vertex_numbers *numbers, session_patch_values *out,
                                        base_error *error);

void session_patch_values_free(session_patch_values *values);

#endif
