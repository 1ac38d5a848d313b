/* Collects the values of a cell field that the caller gives on boundary faces (patches), as values at the vertices of
 * these faces. */
#ifndef SESSION_PATCHES_H
#define SESSION_PATCHES_H

#include "session_exchange.h"
#include "session_mesh.h"

/* The groups of equal vertices on this rank. Two faces are treated as equal if their vertices belong to the same
 * groups. */
typedef struct session_vertex_numbers {
    /* hash table of the keys of the vertices of drawn cells; vertices with equal keys form a group, whose index is the
     * index of the key in this table */
    const session_key_table *keys;
    const int64_t *group_of_vertex; /* for each vertex of mesh->cells, its group; -1: it belongs to no drawn cell */
    /* set if keys are global vertex ids, and not coordinates */
    bool by_id;
} session_vertex_numbers;

/* A list of `count` pairs of a value and a vertex group. Each face of the patches contributes several pairs with its
 * value: one pair for each group to which its vertices belong. */
typedef struct session_patch_values {
    int64_t count;
    int64_t *groups;
    double *values;
} session_patch_values;

/* Collects the finite values that the field's patches have on faces of drawn cells. It is an error if the mesh does not
 * have a face of a patch, if two cells share the face, or if the face is given twice. Local. */
insitu_status session_find_patch_values(const session_mesh *mesh, int field, int component,
                                        const session_vertex_numbers *numbers, session_patch_values *out,
                                        base_error *error);

void session_patch_values_free(session_patch_values *values);

#endif
