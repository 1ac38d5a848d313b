/* Computes integrals over cells of higher order, in which positions and values are polynomials. A complete cell has all
 * nodes of the regular grid of its order (session_nodes.h). */
#ifndef SESSION_CELL_RULES_H
#define SESSION_CELL_RULES_H

#include "session_interpolation.h"
#include "session_quadrature.h"

/* The nodal functions on a line, triangle or tet, and a quadrature rule at whose points they are evaluated. The nodal
 * function of a node is the polynomial that is 1 at this node and 0 at all other nodes. The nodal functions of a cell
 * are products of such functions. */
typedef struct session_rule_factor {
    int order, node_count;
    bool is_lobatto; /* set if the nodes of a line are Gauss-Lobatto points */
    session_quadrature rule;
    int width; /* number of points in each block; the last block may have fewer */
    /* for each block of points: values of the nodal functions, then their derivatives along each axis, as arrays of
     * node_count x width. NULL: the arrays would take too much memory, and are computed again for each cell */
    double *functions;
} session_rule_factor;

/* A quadrature rule whose points are all combinations of a point of `first`, a rule on a line, a triangle or a tet, and
 * of points of `line` along up to two further axes. */
typedef struct session_product_rule {
    session_rule_factor first, line;
} session_product_rule;

/* The integration rules for cells of one type with one number of nodes. */
typedef struct session_cell_rules {
    /* the cells' nodes, and all nodes of a complete cell of this order; empty if such cells cannot be integrated */
    session_interpolation nodes;
    /* nodes from which values are interpolated: nodes.complete, or those of a hex for pyramids, which are read as hexes
     * with coincident corners */
    session_nodes lattice;
    /* for pyramids, the matrix that computes values at the nodes of `lattice` from values at nodes.complete; otherwise
     * NULL */
    double *collapse;
    int line_count; /* number of lines by which the line, triangle or tet of straight.first and bent.first is
                       multiplied to give the reference cell: 0 .. 2 */
    int corner_count;
    double *corner_weights; /* values of the corners' linear functions at all nodes: a matrix of nodes x corners */
    /* straight: rules for cells whose map from the reference cell is linear in each factor (line, triangle or tet) of
     * the reference cell; bent: rules for all other cells. Shells and pyramids have only the rules `bent`. */
    session_product_rule straight, bent;
} session_cell_rules;

/* Makes the rules for cells of one type and number of nodes; pyramids have at most the order
 * INTERPOLATION_MOST_PYRAMID. order: the order in which nodes are stored in connectivity. is_lobatto: nodes along the
 * axes of hexes and quads are Gauss-Lobatto points; otherwise they are equispaced. Returns false if memory runs out;
 * the caller must drop *out in any case. */
bool session_make_cell_rules(const session_nodes *of, insitu_vertex_order order, bool is_lobatto,
                             session_cell_rules *out);
void session_drop_cell_rules(session_cell_rules *rules);

/* Function that receives `count` quadrature points of a cell. of: the pointer that was passed to
 * session_visit_quadrature_points(); measures: for each point, its weight times the determinant of the map's Jacobian,
 * or times the area element of a shell; values: for each point, the value of the cell's polynomial. */
typedef void session_visit_points(void *of, int count, const double *measures, const double *values);

/* Returns the number of doubles that session_visit_quadrature_points() needs as working memory. */
size_t session_cell_rules_work_size(const session_cell_rules *rules);

/* Calls `visit` for the quadrature points of a cell, always in the same order. tuples: x, y, z and a value at each of
 * the cell's nodes, in the order of its nodes in connectivity. work: session_cell_rules_work_size() doubles of working
 * memory. of: pointer that is passed to `visit`. */
void session_visit_quadrature_points(const session_cell_rules *rules, const double *tuples, double *work,
                                     session_visit_points *visit, void *of);

#endif
