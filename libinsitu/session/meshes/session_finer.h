/* Evaluates the polynomials of cells of higher order between their nodes.
 *
 * A cell of order p each of whose edges between two nodes is cut into n parts is read as a cell of order n p whose
 * nodes have the polynomial's values and places. All other code reads these cells in place of the caller's: it splits
 * them into linear pieces, finds their gradients, and counts them by the same numbers. Each cell has its nodes for
 * itself. Nodes on common faces have the same bits in all cells (session_interpolation.h), so that they are found by
 * their coordinates. */
#ifndef SESSION_FINER_H
#define SESSION_FINER_H

#include "session_catalogue.h"

/* Removes the caller's vertex ids from meshes with cells of higher order, since finer lattices have none. This must be
 * done before the catalogue is updated. Local. */
void session_drop_ids(const session_meshes *meshes);

enum { FINER_MOST_PARTS = 8 };

/* The cells of higher order of a mesh on all ranks, and the number of pieces that was chosen for them; the same on
 * every rank. */
typedef struct session_finer_choice {
    int order; /* highest order of its cells; 0: no rank has cells of higher order */
    int64_t pyramid_count, serendipity_count;
    bool is_lobatto; /* set if nodes of hexes and quads are taken as Gauss-Lobatto points */
    /* bytes that finer lattices take on all ranks, by the number of parts: their pieces and nodes, and for each
     * component of a field */
    int64_t bytes[FINER_MOST_PARTS + 1], bytes_per_component[FINER_MOST_PARTS + 1];
    /* number of blocks on all ranks, by the number of parts that they have so far; 0: finer lattices are not made */
    int64_t blocks[FINER_MOST_PARTS + 1];
    int parts; /* number of parts of each edge between two nodes, 1 .. FINER_MOST_PARTS; it is chosen by the caller */
} session_finer_choice;

/* Returns the largest number of parts that is supported for the mesh. */
int session_most_parts(const session_finer_choice *choice);

/* Counts the cells of higher order of each mesh of the catalogue; `parts` is 1. Meshes must have been checked and
 * listed. Collective; all ranks return the same status. */
insitu_status session_count_finer(session_meshes *meshes, const session_catalogue *catalogue, MPI_Comm comm,
                                  session_finer_choice *choices, base_error *error);

/* Makes finer lattices with the chosen numbers of parts, or none for 1 part. Meshes that change must be checked again.
 * *are_changed is set if a mesh on some rank gets another number. Collective; all ranks return the same status. */
insitu_status session_make_finer(session_meshes *meshes, const session_catalogue *catalogue,
                                 const session_finer_choice *choices, const session_team *team, bool *are_changed,
                                 base_error *error);

/* Reads the caller's cells in place of finer lattices, and the vertex ids again. Local. */
void session_end_finer(session_meshes *meshes);

/* The values at the nodes of the caller's cells. */
typedef struct session_node_values {
    const void *of;
    bool is_by_entry;    /* set if positions are entries of connectivity, counted without the unused ends of rows;
                            otherwise they are vertices */
    int component_count; /* number of components of a tuple */
    void (*read)(const void *of, int64_t position, double *tuple);
} session_node_values;

/* Computes the tuples at all nodes of a mesh with finer lattices. Local. */
insitu_status session_interpolate_values(const session_mesh *mesh, const session_node_values *values, int threads,
                                         double *out, base_error *error);

#endif
