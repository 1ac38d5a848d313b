/* Converts a topology of a Blueprint domain to the mesh that is passed to the session. */
#ifndef BLUEPRINT_MESH_H
#define BLUEPRINT_MESH_H

#include "blueprint_node.h"

enum { OWNED_ARRAYS_MAX = 4 };

/* Arrays that the adaptor allocates because the node does not contain them. The session borrows them with the mesh. */
typedef struct owned_arrays {
    void *arrays[OWNED_ARRAYS_MAX];
    int count;
} owned_arrays;

typedef struct blueprint_mesh {
    insitu_mesh mesh;
    insitu_lattice lattice; /* the lattice to which mesh.lattice points, unless the topology is unstructured */
    bool is_left_out;       /* true if the topology is not drawn; the log contains the reason */
    bool has_first;         /* true if the topology states elements/origin */
    bool has_level;         /* true if the lattice is uniform and the domain states a level of refinement */
    bool has_cell_strides;  /* true if lattice.cell_strides are those of an element field */
    int *type_map;          /* the table to which mesh.cell_type_map points; may be NULL */
    owned_arrays owned;
} blueprint_mesh;

/* Allocates an array that lives as long as the mesh. If memory runs out, sets the error and returns NULL. */
void *owned_arrays_add(const node *of, owned_arrays *owned, int64_t bytes);
void owned_arrays_free(owned_arrays *owned);

/* Reads the topology and its coordset. Returns false if the node is invalid. */
bool blueprint_read_topology(const node *domain, const node *topology, blueprint_mesh *out);

/* Frees the tables that are needed only until the mesh is set, but not the arrays in `owned`. */
void blueprint_mesh_free_tables(blueprint_mesh *mesh);

/* Reads the cells of an unstructured topology. The vertices must have been read already. */
bool blueprint_read_unstructured(const node *topology, blueprint_mesh *out);

/* Reads the strides of a lattice's element fields, and the ghost flags of the topology. */
bool blueprint_read_ghosts(const node *domain, const char *topology, blueprint_mesh *out);

enum { WHOLE_MESH = -1 };

/* A mesh of the session, or one of its blocks. */
typedef struct mesh_target {
    insitu_session *session;
    const char *name;
    int64_t number; /* number of the block, or WHOLE_MESH */
} mesh_target;

/* Sets `mesh` on the session as the target's mesh or block. If `mesh` is NULL, removes the target. */
insitu_status blueprint_set_target(const mesh_target *target, const insitu_mesh *mesh);

/* Sets all fields of the topology on the target, and increases *count by their number. Returns false if the node is
 * invalid or the session rejects a field. */
bool blueprint_set_fields(const node *domain, const char *topology, const blueprint_mesh *mesh,
                          const mesh_target *target, int *count);

/* Returns a hash of the names, associations and numbers of components of the fields that blueprint_set_fields() would
 * set. It does not depend on their order. */
uint64_t blueprint_hash_fields(const node *domain, const char *topology, const blueprint_mesh *mesh);

/* Returns the number of array elements from the first to the last cell or vertex, including padding. */
int64_t blueprint_count_spanned_elements(const int64_t counts[3], const int64_t strides[3]);

#endif
