/* Computes the values of a cell's polynomial at the nodes of a finer lattice: a regular grid of nodes with a multiple
 * of the cell's order (session_finer.h). The row of a cell is its list of nodes in the connectivity. */
#ifndef SESSION_INTERPOLATION_H
#define SESSION_INTERPOLATION_H

#include <stddef.h>

#include "session_nodes.h"

/* INTERPOLATION_SIDES: number of elements of session_interpolation.sides; INTERPOLATION_MOST_SIDES: maximum number of
 * faces or edges in one of them */
enum { INTERPOLATION_SIDES = 3, INTERPOLATION_MOST_SIDES = 12 };

/* A table of all quads among a cell's faces, of all triangles among them, or of all edges of the cell. The nodes of a
 * face can be listed in several orders: beginning at any of its corners, and in either direction around it. The nodes
 * of an edge can be listed in two orders. */
typedef struct session_interpolation_sides {
    int corner_count; /* number of corners: 4 for a quad, 3 for a triangle, 2 for an edge */
    int count;        /* number of faces or edges in the table */
    int turn_count;   /* number of orders in which the nodes of a face or edge can be listed */
    /* number of nodes on one such face or edge in the lattice of the complete cell (node_count) and in the finer
     * lattice (fine_count) */
    int node_count, fine_count;
    /* corners of each face or edge, in order around it, as indices among the cell's corners */
    signed char corners[INTERPOLATION_MOST_SIDES][4];
    /* node_count entries for each face or edge and each order of listing: indices of its nodes in the lattice of the
     * complete cell (session_interpolation.complete) */
    int *nodes;
    /* fine_count entries for each face or edge and each order of listing: indices of its nodes in the finer lattice
     * (session_interpolation.fine) */
    int *fine_nodes;
} session_interpolation_sides;

/* The interpolation in cells of one type with one number of nodes. */
typedef struct session_interpolation {
    session_nodes of;       /* the cell's own nodes */
    session_nodes complete; /* all nodes of a complete cell of the same order */
    session_nodes fine;     /* the nodes of the finer lattice, which are equispaced */
    /* For each node of the complete cell, in lexicographic order: its position in the cell's list of nodes in the
     * connectivity. A position of at least of.count means that a serendipity cell lacks the node. */
    int *positions;
    int corners[8]; /* for each corner, in VTK's order, its position in the cell's list of nodes in the connectivity */
    /* matrix that gives the values at the finer nodes of an edge (rows) from those at the edge's nodes (columns) */
    double *line;
    /* matrix that gives the values at the finer nodes of a triangle (rows) from those at the triangle's nodes
     * (columns), for triangular faces and the layers of wedges; NULL for hexes and quads */
    double *triangle;
    /* for tets and pyramids: matrix that gives the values at all nodes of the finer lattice (rows) from those at all
     * nodes of the complete cell (columns); NULL for all other types */
    double *whole;
    /* tables of the cell's quads ([0]), triangles ([1]) and edges ([2]) */
    session_interpolation_sides sides[INTERPOLATION_SIDES];
    int own_count; /* number of the cell's own nodes that coincide with a node of the finer lattice */
    /* for each of these own_count nodes: its index in the complete cell ([0]), and the index of the coinciding node of
     * the finer lattice ([1]) */
    int (*own)[2];
} session_interpolation;

/* Largest order of pyramids that can be interpolated. The order is limited because a matrix with one row and one column
 * per node of the pyramid is inverted to set up the interpolation. */
enum { INTERPOLATION_MOST_PYRAMID = 6 };

/* Finds the interpolation from the nodes of a type and order of cells (`of`) to a lattice of the order parts *
 * of->order, which must be at most NODES_MOST_ORDER; pyramids have at most the order INTERPOLATION_MOST_PYRAMID. order:
 * the order in which a cell's nodes are listed in the connectivity. is_lobatto: nodes along the axes of hexes and quads
 * are Gauss-Lobatto points; otherwise they are equispaced. Returns false if memory runs out; the caller must drop *out
 * in any case. */
bool session_make_interpolation(const session_nodes *of, insitu_vertex_order order, int parts, bool is_lobatto,
                                session_interpolation *out);
void session_drop_interpolation(session_interpolation *interpolation);

/* Fills in only those members of *out that session_fill_complete_cell_tuples() needs; members for the finer lattice
 * remain empty. Returns false if memory runs out. */
bool session_map_nodes_to_connectivity(const session_nodes *of, insitu_vertex_order order, session_interpolation *out);

/* Computes the matrix from the values at all nodes of a pyramid of order p to the values at the nodes of a hex of order
 * p whose upper face is collapsed to the apex. With this matrix, a pyramid can be treated as a hex, because the
 * pyramid's basis functions are polynomials of order p along each axis of the hex. Returns NULL if memory runs out; the
 * caller must free the result by base_free(). */
double *session_compute_collapse_matrix(int p);

/* Copies the tuples at the cell's nodes from the order of the nodes in the connectivity into lexicographic order, and
 * computes the tuples at nodes that a serendipity cell lacks. `out` has one tuple for each node of the complete
 * cell. */
void session_fill_complete_cell_tuples(const session_interpolation *of, int components, const double *tuples,
                                       double *out);

/* Returns the number of doubles that session_interpolate() needs as working memory. */
size_t session_interpolation_work_size(const session_interpolation *of, int components);

/* Computes tuples at the nodes of the finer lattice, in lexicographic order, from those at the cell's nodes, in the
 * order of the nodes in connectivity. corners: positions of the cell's corners. They determine the order of additions,
 * so that a tuple on a face or an edge gets the same bits from all cells that have the face or the edge. work:
 * session_interpolation_work_size() doubles of working memory. */
void session_interpolate(const session_interpolation *of, const double (*corners)[3], int components,
                         const double *tuples, double *work, double *out);

#endif
