/* Integrals over cells of higher order, of the polynomials of their positions and values. The row of a cell is its list
 * of nodes in the connectivity. A complete cell has all nodes of the regular grid of its order (session_nodes.h). */
#ifndef SESSION_CELL_RULES_H
#define SESSION_CELL_RULES_H

#include "session_interpolation.h"
#include "session_quadrature.h"

/* The functions of nodes on a line, triangle or tet, and a quadrature rule at whose points they are evaluated. A cell's
 * functions are products of such functions. */
typedef struct session_rule_factor {
    int order, node_count;
    bool is_lobatto; /* set if the nodes of a line are Gauss-Lobatto points */
    session_quadrature rule;
    int width; /* number of points in each block; the last block may have fewer */
    /* for each block of points: values of the functions, then their slopes along each axis, as arrays of node_count x
     * width. NULL: the functions take too much memory and are computed again for each cell */
    double *functions;
} session_rule_factor;

/* A product rule. The first factor is a line, a triangle or a tet; all further factors are lines. */
typedef struct session_product_rule {
    session_rule_factor first, line;
} session_product_rule;

/* The rules of one kind of cell. */
typedef struct session_cell_rules {
    /* the cell's nodes, and all nodes of a complete cell of its order; empty if this kind has no rules */
    session_interpolation nodes;
    session_nodes lattice; /* same as nodes.complete; for pyramids, which are read as collapsed hexes, that of a hex */
    double *collapse;      /* for pyramids: matrix from nodes.complete to `lattice`; otherwise NULL */
    int line_count;        /* number of factors that are lines, not counting the first one */
    int corner_count;
    double *corner_weights; /* values of the corners' linear functions at all nodes: a matrix of nodes x corners */
    /* straight: rules of cells whose positions are linear in each factor; bent: rules of other cells. Shells and
     * pyramids have only the rules `bent`. */
    session_product_rule straight, bent;
} session_cell_rules;

/* Makes the rules of a kind of cell; pyramids have at most the order INTERPOLATION_MOST_PYRAMID. order and is_lobatto:
 * as in session_make_interpolation(). Returns false if memory runs out; the caller must drop *out in any case. */
bool session_make_cell_rules(const session_nodes *of, insitu_vertex_order order, bool is_lobatto,
                             session_cell_rules *out);
void session_drop_cell_rules(session_cell_rules *rules);

/* Receives some points of a cell. measures: the weight of each point times the determinant of the map's Jacobian, or
 * times the area element of a shell; values: the polynomial's values. */
typedef void session_visit_points(void *of, int count, const double *measures, const double *values);

/* Returns the number of doubles that session_visit_cell() needs as working memory. */
size_t session_cell_rules_work_size(const session_cell_rules *rules);

/* Visits the points of a cell's rule, always in the same order. tuples: x, y, z and a value at the cell's nodes, in the
 * order of its row. work: working memory. */
void session_visit_cell(const session_cell_rules *rules, const double *tuples, double *work,
                        session_visit_points *visit, void *of);

#endif
