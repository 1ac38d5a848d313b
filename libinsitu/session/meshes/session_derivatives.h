/* Derivatives of the polynomials of cells of higher order at the cells' own nodes. A derivative along an axis of the
 * reference cell is a weighted sum of the values at nodes. A kind of cell is a type with a number of nodes
 * (session_rows.h). A finer lattice consists of additional nodes of a cell, at which its polynomial is evaluated; such
 * cells are called refined (session_finer.h). */
#ifndef SESSION_DERIVATIVES_H
#define SESSION_DERIVATIVES_H

#include "session_rows.h"

/* The derivatives in cells of one kind. Each derivative is a sum of terms, and a term is the product of a weight and
 * the value at a node. For node n and axis a, let s be axis_count * n + a: the terms of this derivative have the
 * indices starts[s] .. starts[s + 1] - 1. */
typedef struct session_derivatives {
    int axis_count; /* 3; 2 for triangles and quads; 0 for pyramids, whose derivatives are not implemented */
    /* distance between the first two nodes of an edge of length 1; it differs between equispaced nodes and
     * Gauss-Lobatto points, and is used to distinguish them */
    double first_segment;
    int *starts;
    int *nodes;      /* for each term, the position of its node in the cell's list of nodes in the connectivity */
    double *weights; /* for each term, the weight of the value at its node; weights of a derivative sum to 0 */
} session_derivatives;

/* Computes the derivatives of the shape functions of a type of cell at its nodes. order: the order in which a cell's
 * nodes are listed in the connectivity. is_lobatto: the nodes along edges are Gauss-Lobatto points; otherwise they are
 * equispaced. parts: the cell may have more nodes than its polynomial needs; along each axis every parts-th node
 * determines the polynomial. For serendipity cells, parts must be 1. Returns false if memory runs out; the caller must
 * drop *out in any case. */
bool session_make_derivatives(const session_nodes *of, insitu_vertex_order order, bool is_lobatto, int parts,
                              session_derivatives *out);
void session_drop_derivatives(session_derivatives *derivatives);

/* Returns whether the cell's nodes may be equispaced or Gauss-Lobatto points, which differ in hexes and quads of order
 * 3 and more. */
bool session_may_have_lobatto_nodes(const session_nodes *of);

/* Computes the positions of the p + 1 nodes of an edge from 0 to 1. */
void session_compute_node_positions(int p, bool is_lobatto, double out[NODES_MOST_ORDER + 1]);

/* Finds the directions from a node that a serendipity cell lacks to the nodes around it. at: lattice indices of the
 * missing node. directions: receives vectors d of lattice indices; the nodes around the missing node are at its indices
 * plus sums of the vectors multiplied by -1, 0 or 1. Returns the number of directions: 2 at the middle of a face, 3 at
 * the middle of a hex. */
int session_find_missing_node_directions(int type, const int at[3], int directions[3][3]);

/* The derivatives of the polynomials of all cells of a mesh whose cells of higher order are split into linear
 * pieces. */
typedef struct session_polynomials {
    session_rows rows;
    /* for each of the caller's cells, the index of its first linear piece (session_topology.first_pieces) */
    const int64_t *first_pieces;
    int64_t cell_count; /* number of the caller's cells */
    insitu_vertex_order order;
    /* Two entries for each kind of cell k: kinds[2 k] and kinds[2 k + 1]. If the mesh has no finer lattices, these are
     * the derivatives for equispaced nodes and those for Gauss-Lobatto points. Otherwise they are the derivatives at
     * the nodes of refined cells and those at the nodes of all other cells. */
    session_derivatives *kinds;
    /* If the mesh has finer lattices, `nodal` gives access to the caller's nodes of each cell, kind k of nodal.kinds is
     * the k of `kinds` above, and refined_counts[k] is the number of nodes that a refined cell of this kind has in its
     * finer lattice. Otherwise nodal.kind_count is 0. */
    session_rows nodal;
    int64_t refined_counts[ROWS_MOST_KINDS];
} session_polynomials;

/* Finds the polynomials of a mesh's cells. Returns false if memory runs out; the caller must free *out in any case.
 * Local. */
bool session_polynomials_create(const session_mesh *mesh, session_polynomials *out);
void session_polynomials_free(session_polynomials *polynomials);

/* Returns the derivatives to be used for a cell. positions: positions of the cell's nodes, `stride` doubles apart. In
 * quads and hexes of order 3 and more, the positions show whether nodes are equispaced or Gauss-Lobatto points. */
const session_derivatives *session_find_derivatives_of_cell(const session_polynomials *polynomials, int64_t cell,
                                                            const double *positions, int stride);

#endif
