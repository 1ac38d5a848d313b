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
#include "session_report.h"

/* Removes the caller's vertex ids from meshes with cells of higher order, since finer lattices have none. This must be
 * done before the catalogue is updated. Local. */
void session_drop_ids(const session_meshes *meshes);

/* Makes finer lattices, with so many parts of each edge between two nodes, for the meshes that have cells of higher
 * order. Meshes must have been checked and listed; those that change must be checked again. *is_any is set if some
 * rank has such a mesh. Collective; all ranks return the same status. */
insitu_status session_make_finer(session_meshes *meshes, const session_catalogue *catalogue, int parts,
                                 const session_team *team, session_report *report, bool *is_any, base_error *error);

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
