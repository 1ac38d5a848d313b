/* Computes the values of a cell's polynomial at the nodes of a finer lattice: a regular grid of nodes with a multiple
 * of the cell's order (session_finer.h). The row of a cell is its list of nodes in the connectivity. */
#ifndef SESSION_INTERPOLATION_H
#define SESSION_INTERPOLATION_H

#include <stddef.h>

#include "session_nodes.h"

/* INTERPOLATION_SIDES: number of elements of session_interpolation.sides; INTERPOLATION_MOST_SIDES: maximum number of
 * faces or edges in one of them */
enum { INTERPOLATION_SIDES = 3, INTERPOLATION_MOST_SIDES = 12 };

/* All quads among the faces of a cell, all triangles among them, or all edges of the cell. The nodes of a face can be
 * listed in several orders, which begin at each of its corners and follow the face in either direction; those of an
 * edge in two orders. */
typedef struct session_interpolation_sides {
    int corner_count; /* of a face: 4 or 3; of an edge: 2 */
    int count;        /* number of these faces or edges of the cell */
    int turn_count;   /* number of orders in which the nodes of a face or edge can be listed */
    /* number of nodes of one such face or edge, in the cell's lattice (node_count) and in the finer one (fine_count) */
    int node_count, fine_count;
    /* for each face or edge, the indices of its corners among the cell's corners, in order around it */
    signed char corners[INTERPOLATION_MOST_SIDES][4];
    int *nodes;      /* for each face or edge and each order, the indices of its nodes in `complete` */
    int *fine_nodes; /* for each face or edge and each order, the indices of its finer nodes in `fine` */
} session_interpolation_sides;

/* The interpolation in cells of one type with one number of nodes. */
typedef struct session_interpolation {
    session_nodes of;       /* the cell's own nodes */
    session_nodes complete; /* all nodes of a complete cell of the same order */
    session_nodes fine;     /* the nodes of the finer lattice, which are equispaced */
    /* For each node of `complete`, in lexicographic order: its position in the cell's list of nodes in the
     * connectivity. A position of at least of.count marks a node that a serendipity cell lacks. */
    int *positions;
    int corners[8]; /* for each corner, in VTK's order, its position in the cell's list of nodes in the connectivity */
    /* matrix that gives the values at the finer nodes of an edge (rows) from those at the edge's nodes (columns) */
    double *line;
    /* matrix that gives the values at the finer nodes of a triangle (rows) from those at the triangle's nodes
     * (columns), for triangular faces and the layers of wedges; NULL for hexes and quads */
    double *triangle;
    /* for tets and pyramids: matrix that gives the values at all nodes of `fine` (rows) from those at all nodes of
     * `complete` (columns) */
    double *whole;
    /* faces and edges: quads, triangles, edges, in this order */
    session_interpolation_sides sides[INTERPOLATION_SIDES];
    int own_count; /* number of the cell's own nodes that coincide with a node of the finer lattice */
    int (*own)[2]; /* for each such node of the cell, its index in `complete` and the index in `fine` */
} session_interpolation;

/* Largest order of pyramids that can be interpolated. It is limited because a matrix with one row and one column per
 * node of the pyramid is inverted. */
enum { INTERPOLATION_MOST_PYRAMID = 6 };

/* Finds the interpolation from the nodes of a type and order of cells (`of`) to a lattice of the order parts *
 * of->order, which must be at most NODES_MOST_ORDER; pyramids have at most the order INTERPOLATION_MOST_PYRAMID. order:
 * the order in which a cell's nodes are listed in the connectivity. is_lobatto: nodes along the axes of hexes and quads
 * are Gauss-Lobatto points; otherwise they are equispaced. Returns false if memory runs out; the caller must drop *out
 * in any case. */
bool session_make_interpolation(const session_nodes *of, insitu_vertex_order order, int parts, bool is_lobatto,
                                session_interpolation *out);
void session_drop_interpolation(session_interpolation *interpolation);

/* Fills in only the members that session_complete_tuples() needs, without fine nodes and weights. Returns false if
 * memory runs out. */
bool session_map_nodes_to_connectivity(const session_nodes *of, insitu_vertex_order order, session_interpolation *out);

/* Computes the matrix from the values at all nodes of a pyramid of order p to the values at the nodes of a hex of order
 * p whose upper face is collapsed to the apex. A pyramid's functions are polynomials of order p along each axis of that
 * hex. Returns NULL if memory runs out; the caller must free the result by base_free(). */
double *session_compute_collapse_matrix(int p);

/* Copies tuples at the cell's nodes, which are in the order of the nodes in connectivity, into the order of `complete`,
 * and computes the tuples at nodes that a serendipity cell lacks. */
void session_complete_tuples(const session_interpolation *of, int components, const double *tuples, double *out);

/* Returns the number of doubles that session_interpolate() needs as working memory. */
size_t session_interpolation_work_size(const session_interpolation *of, int components);

/* Computes tuples at the nodes of the finer lattice, in lexicographic order, from those at the cell's nodes, in the
 * order of the nodes in connectivity. corners: positions of the cell's corners. They determine the order of additions,
 * so that a tuple on a face or an edge gets the same bits from all cells that have the face or the edge. work:
 * session_interpolation_work_size() doubles of working memory. */
void session_interpolate(const session_interpolation *of, const double (*corners)[3], int components,
                         const double *tuples, double *work, double *out);

#endif
