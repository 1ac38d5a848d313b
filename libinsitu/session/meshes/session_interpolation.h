/* Computes the values of a cell's polynomial at the nodes of a finer lattice: a regular grid of nodes with a multiple
 * of the cell's order (session_finer.h). The row of a cell is its list of nodes in the connectivity. */
#ifndef SESSION_INTERPOLATION_H
#define SESSION_INTERPOLATION_H

#include <stddef.h>

#include "session_nodes.h"

enum { INTERPOLATION_SIDES = 3, INTERPOLATION_MOST_SIDES = 12 };

/* The faces of a cell with the same number of corners, or its edges. The nodes of a face can be numbered in several
 * ways, which begin at each of its corners and follow the face in either direction; those of an edge in two ways. */
typedef struct session_interpolation_sides {
    int corner_count;           /* of a face: 4 or 3; of an edge: 2 */
    int count;                  /* number of these faces or edges of the cell */
    int turn_count;             /* number of ways to number the nodes of one of them */
    int node_count, fine_count; /* numbers of nodes of one of them, in the cell's lattice and in the finer one */
    signed char corners[INTERPOLATION_MOST_SIDES][4];
    int *nodes;      /* for each face or edge and each way, the indices of its nodes in `complete` */
    int *fine_nodes; /* for each face or edge and each way, the indices of its finer nodes in `fine` */
} session_interpolation_sides;

/* The interpolation in one kind of cell. */
typedef struct session_interpolation {
    session_nodes of;       /* the cell's own nodes */
    session_nodes complete; /* all nodes of the lattice of the cell's order */
    session_nodes fine;     /* the nodes of the finer lattice, which are equispaced */
    int *positions; /* for each node of `complete`, in lexicographic order, its position in the cell's row; an entry of
                       at least of.count marks a node that a serendipity cell lacks */
    int corners[8]; /* position of each corner in the cell's row; corners are in VTK's order */
    double *line;   /* weights on an edge: a matrix of (fine nodes of the edge) x (nodes of the edge) */
    double *triangle; /* weights of triangles; NULL if the type of cell has none */
    double *whole;    /* for tets and pyramids: weights, a matrix of (all fine nodes) x (all nodes of `complete`) */
    session_interpolation_sides sides[INTERPOLATION_SIDES]; /* quads, triangles, edges */
    int own_count; /* number of the cell's own nodes that are fine nodes, too */
    int (*own)[2]; /* their indices in `complete` and in `fine` */
} session_interpolation;

/* Largest order of pyramids that can be interpolated, because a matrix of all of their nodes is inverted. */
enum { INTERPOLATION_MOST_PYRAMID = 6 };

/* Finds the interpolation in a kind of cell to a lattice of order parts * of->order, which must be at most
 * NODES_MOST_ORDER; pyramids have at most the order INTERPOLATION_MOST_PYRAMID. order: the order in which nodes are
 * stored in the cell's row. is_lobatto: nodes along the axes of hexes and quads are Gauss-Lobatto points; otherwise
 * they are equispaced. Returns false if memory runs out; the caller must drop *out in any case. */
bool session_make_interpolation(const session_nodes *of, insitu_vertex_order order, int parts, bool is_lobatto,
                                session_interpolation *out);
void session_drop_interpolation(session_interpolation *interpolation);

/* Fills in only the members that session_complete_tuples() needs, without fine nodes and weights. */
bool session_make_completion(const session_nodes *of, insitu_vertex_order order, session_interpolation *out);

/* Computes the matrix from the values at all nodes of a pyramid of order p to the values at the nodes of a hex of order
 * p whose upper face is collapsed to the apex. A pyramid's functions are polynomials of order p along each axis of that
 * hex. Returns NULL if memory runs out; the caller must free the result by base_free(). */
double *session_make_collapse(int p);

/* Puts tuples at the cell's nodes, in the order of its row, into the order of `complete`, and computes the tuples at
 * nodes that a serendipity cell lacks. */
void session_complete_tuples(const session_interpolation *of, int components, const double *tuples, double *out);

/* Returns the number of doubles that session_interpolate() needs as working memory. */
size_t session_interpolation_work_size(const session_interpolation *of, int components);

/* Computes tuples at the fine nodes, in lexicographic order, from those at the cell's nodes, in the order of its row.
 * corners: the positions of the corners, by which a tuple on a face or an edge gets the same bits from all cells that
 * have the face or the edge. work: working memory. */
void session_interpolate(const session_interpolation *of, const double (*corners)[3], int components,
                         const double *tuples, double *work, double *out);

#endif
