/* Sums the gradients in the cells around each vertex, over the cells of all ranks (scalars/session_gradients.h). Equal
 * vertices have equal keys: their global id or the bits of their coordinates, which twins have in common
 * (session_merged_vertex_key()). For a vertex in the bounding boxes of several ranks, each rank gets the sums of the
 * other ranks and adds them to its own. */
#ifndef SESSION_VERTEX_SUMS_H
#define SESSION_VERTEX_SUMS_H

#include "session_catalogue.h"
#include "session_exchange.h"
#include "session_gradients.h"
#include "session_space.h"

/* One of this rank's parts of the meshes, with the keys of its vertices. */
typedef struct session_sum_part {
    session_mesh *mesh;
    /* border with the twins of the part's vertices (session_twins.h); NULL: vertices are compared bitwise */
    const session_border *border;
    bool of_shells;                       /* true: gradients are summed over shells; false: over cells with a volume */
    grid_field fields[SESSION_GRADIENTS]; /* the scalars whose gradients are summed */
    /* for each vertex, the index of its key in session_vertex_sums.keys; -1: no gradient is computed at the vertex */
    int32_t *key_indices;
    /* the cells' polynomials, computed by session_compute_vertex_sums(); NULL: cells are linear, or values at nodes are
     * means of cell values */
    session_polynomials *polynomials;
} session_sum_part;

/* This rank's data for sums of the same scalars on one or several meshes. part_count is 0 if this rank has no part of
 * the meshes. */
typedef struct session_vertex_sums {
    int part_count;
    session_sum_part *parts;
    int field_count;
    /* true: vertices with equal global ids are equal; false: vertices with equal coordinates are equal */
    bool by_id;
    /* true: `keys` contains the keys of all vertices of this rank's drawn cells, so that keys that other ranks request
     * need not be added */
    bool has_all_vertices;
    session_key_table keys;
    /* number of keys that this rank needs itself; the keys with higher indices were requested by other ranks */
    int64_t own_count;
    session_gradient_bounds bounds; /* bounds, over all ranks, of the numbers that cells add to the sums */
    double length;                  /* session_gradient_basis.length, by which lengths are divided in the sums */
    int64_t *sums;                  /* the sums, session_count_sum_words() words per key */
} session_vertex_sums;

/* Adds the keys of all vertices of drawn cells to sums->keys, and stores the index of each vertex's key in key_indices
 * of its part. Local. */
insitu_status session_assign_keys_to_vertices(session_vertex_sums *sums, base_error *error);

/* Computes the sums for this rank's keys over all ranks. The keys, and key_indices of each part, must be set. A rank
 * that has failed before calls this function with its error in *error. Collective. All ranks return the same status. An
 * error that occurs after the last exchange of messages is only stored in *error. */
insitu_status session_compute_vertex_sums(const session_homes *homes, const session_team *team,
                                          const session_extent *extent, session_vertex_sums *sums, base_error *error);

/* Frees all members except the parts' meshes. */
void session_vertex_sums_free(session_vertex_sums *sums);

#endif
