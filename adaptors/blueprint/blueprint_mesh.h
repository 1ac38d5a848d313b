/* One topology of one domain as the session takes it. */
#ifndef BLUEPRINT_MESH_H
#define BLUEPRINT_MESH_H

#include "blueprint_node.h"

enum { DOOR_OWNED = 4 };

/* What of a mesh the session borrows from the door: arrays that the node lacks. */
typedef struct door_owned {
    void *arrays[DOOR_OWNED];
    int count;
} door_owned;

typedef struct door_mesh {
    insitu_mesh mesh;
    insitu_lattice lattice; /* what mesh.lattice points to, of all but unstructured topologies */
    bool is_left_out;       /* nothing of it is drawn; the log says why */
    bool has_cell_order;    /* lattice.cell_strides are those of an element field */
    int *type_map;          /* what mesh.cell_type_map points to */
    door_owned owned;
} door_mesh;

/* Allocates an array that lives as long as the mesh; NULL, an error, where memory runs out. */
void *door_own(const node *of, door_owned *owned, int64_t bytes);
void door_owned_free(door_owned *owned);

/* Reads the topology with its coordset. False where the node is wrong. */
bool door_read_topology(const node *domain, const node *topology, door_mesh *out);

/* Releases the tables, but not what is owned. */
void door_mesh_end(door_mesh *mesh);

/* Reads cells of an unstructured topology; vertices are known. */
bool door_read_unstructured(const node *topology, door_mesh *out);

/* Takes the order of element fields of a lattice and the flags of cells that are not drawn. */
bool door_read_ghosts(const node *domain, const char *topology, door_mesh *out);

/* Sets all fields of the topology on the session's mesh. names: a sum over their names; count: of them. False where
 * the node is wrong or the session refuses one. */
bool door_set_fields(const node *domain, const char *topology, const door_mesh *mesh, insitu_session *session,
                     const char *name, int *count);

/* A sum over the names of the fields that the above would set. */
uint64_t door_field_names(const node *domain, const char *topology);

/* How many numbers so many cells or vertices span, from the first to the last. */
int64_t door_reach(const int64_t counts[3], const int64_t strides[3]);

#endif
