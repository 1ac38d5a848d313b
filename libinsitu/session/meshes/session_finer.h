/* Evaluates the polynomials of cells of higher order between their nodes.
 *
 * A cell of order p each of whose edges between two nodes is cut into n parts is read as a cell of order n p whose
 * nodes have the polynomial's values and positions. Cells that are not refined have n = 1. All other code reads these
 * cells in place of the caller's: it splits them into linear pieces and finds their gradients. Their indices are those
 * of the caller's cells. Cells do not share nodes. On a face that several cells have in common, the coordinates of
 * their nodes are bitwise equal (session_interpolation.h), so that equal nodes are found by their coordinates. In this
 * file, members and parameters named `parts` are the number n; a part of a mesh is one rank's part, or one block of it
 * (session_mesh.h). */
#ifndef SESSION_FINER_H
#define SESSION_FINER_H

#include "session_catalogue.h"

/* Removes the caller's vertex ids from meshes with cells of higher order, since finer lattices have none. This must be
 * done before the catalogue is updated. Local. */
void session_drop_vertex_ids(const session_meshes *meshes);

/* Maximum number of parts into which an edge between two neighbouring nodes is cut. The number is smaller for cells of
 * order 3 and more, because their finer lattices have at most the order NODES_MOST_ORDER. */
enum { FINER_MOST_PARTS = 12 };

/* Size of finer lattices in bytes. own: size of the linear pieces and of the nodes' coordinates; per_component: size of
 * one component of a field at all nodes. */
typedef struct session_finer_bytes {
    int64_t own, per_component;
} session_finer_bytes;

/* The cells that are refined in a part of a mesh on this rank. */
typedef struct session_cell_marks {
    unsigned char *cells;     /* one byte per cell, which the caller sets if the cell is refined */
    session_piece_set pieces; /* the pieces that are made of refined cells; empty if session_finer_choice.parts is 1 */
} session_cell_marks;

/* Counts of a mesh's cells of higher order over all ranks, and the chosen number of parts between two nodes of an edge.
 * All members except the marks are the same on every rank. */
typedef struct session_finer_choice {
    int order; /* highest order of the mesh's cells on all ranks; 0: no rank has cells of higher order */
    int64_t serendipity_count, shell_count;
    int64_t excluded_count; /* number of pyramids of an order above INTERPOLATION_MOST_PYRAMID; a mesh with such
                               pyramids cannot have finer lattices */
    bool is_lobatto;        /* true: nodes of hexes and quads are treated as Gauss-Lobatto points */
    /* number of parts into which refined cells divide an edge between two nodes, 1 .. FINER_MOST_PARTS; chosen by the
     * caller */
    int parts;
    /* used if `parts` is 1: set by the caller if nodes are added to serendipity cells, so that they have all nodes of
     * their order */
    bool is_completed;
    /* number of elements of `marks`: the number of parts of the mesh on this rank; 0: there are no marks, and all cells
     * are refined */
    int mark_count;
    session_cell_marks *marks; /* marks of refined cells for each part of the mesh on this rank */
} session_finer_choice;

/* Frees the choices of `count` meshes. */
void session_free_choices(session_finer_choice *choices, int count);

/* Returns the maximum number of parts into which an edge between two neighbouring nodes can be cut in all cells of the
 * mesh. */
int session_find_max_edge_parts(const session_finer_choice *choice);

/* Counts the cells of higher order of each mesh of the catalogue, and sets `parts` to 1. Meshes must have been checked
 * and listed in the catalogue before. Collective; all ranks return the same status. */
insitu_status session_count_higher_order_cells(session_meshes *meshes, const session_catalogue *catalogue,
                                               MPI_Comm comm, session_finer_choice *choices, base_error *error);

/* Allocates the arrays of marks for all parts of the mesh, without a marked cell. Only marked cells are refined; in a
 * mesh for which this function has not been called, all cells are. Returns false if memory runs out. Local. */
bool session_allocate_cell_marks(session_finer_choice *choice, const session_parts *parts);

/* Returns the marks of the part of the mesh with this index; NULL: all of the part's cells are refined. */
static inline session_cell_marks *session_get_marks_of_part(const session_finer_choice *choice, int part)
{
    return part < choice->mark_count ? &choice->marks[part] : NULL;
}

/* Adds to out[n] the size in bytes of the mesh's finer lattices if marked cells have n parts between two nodes and all
 * other cells have one part. n is 2 .. FINER_MOST_PARTS. If marks is NULL, all cells count as marked. Local. */
void session_count_finer_bytes(const session_mesh *mesh, const unsigned char *marks,
                               session_finer_bytes out[FINER_MOST_PARTS + 1]);

/* Makes finer lattices in the marked cells with the chosen numbers of parts; if the number is 1, lattices are made only
 * if is_completed is set, and then in all cells. All other cells are split between their own nodes; serendipity cells
 * get all nodes of their order. The sets of pieces in the marks are moved to the meshes. *are_changed is set if the
 * cells of some mesh change on any rank; these meshes must be checked again. Collective; all ranks return the same
 * status. */
insitu_status session_make_finer_lattices(session_meshes *meshes, const session_catalogue *catalogue,
                                          session_finer_choice *choices, const session_team *team, bool *are_changed,
                                          base_error *error);

/* Frees the finer lattices of one mesh. The session then reads the caller's cells of this mesh again. Local. */
void session_free_finer_lattices_of_mesh(session_meshes *meshes, session_mesh *mesh);

/* Frees the finer lattices of all meshes. The session then reads the caller's cells and vertex ids again. Local. */
void session_free_finer_lattices(session_meshes *meshes);

/* The values at the nodes of the caller's cells. */
typedef struct session_node_values {
    const void *of; /* the state that is passed to read() */
    /* true: the argument `position` of read() is the index of an entry of the connectivity, where unused entries are
     * not counted; false: it is the index of a vertex */
    bool is_by_entry;
    int component_count; /* number of components of a tuple */
    /* reads the tuple of values at one node */
    void (*read)(const void *of, int64_t position, double *tuple);
} session_node_values;

/* Computes the tuples of values at all nodes of a mesh's finer lattices from the values at the nodes of the caller's
 * cells. `out` receives one tuple for each vertex of session_finer.fine, in the order of these vertices. Local. */
insitu_status session_interpolate_values(const session_mesh *mesh, const session_node_values *values, int threads,
                                         double *out, base_error *error);

#endif
