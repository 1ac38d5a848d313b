/* Cells of higher order are drawn as linear pieces. Upper bounds of two distances that result from this are computed
 * here: the distance between the isosurfaces of a cell's polynomial and those of its pieces, and the distance between
 * the positions that the curved cell and its pieces give to the same point of the reference cell. The row of a cell is
 * its list of nodes in the connectivity (session_rows.h). A complete cell has all nodes of the regular grid of its
 * order (session_nodes.h). */
#ifndef SESSION_BOUND_H
#define SESSION_BOUND_H

#include "session_interpolation.h"
#include "session_pattern.h"

/* Cells above this order are split into pieces only between their own nodes, so that no bound is needed. */
enum { BOUND_MOST_ORDER = NODES_MOST_ORDER / 2 };

/* A second difference of Bernstein coefficients: a weighted sum of `count` coefficients. */
typedef struct session_second_difference {
    /* index of the edge direction along which the difference is taken, in the order of list_differences()
     * (session_bound.c) */
    int direction;
    int count;
    int nodes[10]; /* indices of the coefficients in the sum */
    double weights[10];
} session_second_difference;

enum { BOUND_MOST_LEVELS = 3 };

/* Matrices for polynomials on a line, a triangle or a tet. A cell's polynomials are products of such polynomials. */
typedef struct session_bound_factor {
    int dimensions;    /* 1: line, 2: triangle, 3: tet; 0: not used */
    int node_count;    /* number of nodes */
    double *bernstein; /* matrix from values at nodes to Bernstein coefficients: node_count x node_count */
    int difference_count;
    /* second differences of the coefficients along all directions that edges of pieces have */
    session_second_difference *differences;
    /* For each finer lattice (session_bound.levels): the number of its nodes in this factor, and matrices that give
     * values and derivatives at these nodes from values at the cell's nodes. The matrices have fine_counts[level] rows
     * and node_count columns. */
    int fine_counts[BOUND_MOST_LEVELS];
    double *values[BOUND_MOST_LEVELS], *slopes[BOUND_MOST_LEVELS][3];
} session_bound_factor;

/* A finer lattice, whose pieces are tested for crossings with isosurfaces, and at whose nodes gradients are
 * computed. */
typedef struct session_bound_level {
    int order, count; /* order, and number of nodes */
    session_pattern pieces;
} session_bound_level;

/* Precomputed matrices and patterns for computing the bounds of cells of one type with one number of nodes. */
typedef struct session_bound {
    session_interpolation nodes; /* the cell's nodes, and all nodes of a complete cell of its order */
    /* the nodes from which polynomials are computed: nodes.complete, except for pyramids. A pyramid is read as a hex
     * whose upper face is collapsed to the apex, so that these are the nodes of a hex. */
    session_nodes lattice;
    /* for pyramids, the matrix that computes values at the nodes of `lattice` from values at nodes.complete; otherwise
     * NULL */
    double *collapse;
    int axis_count; /* number of axes of the reference cell, 2 or 3 */
    int level_count;
    /* the finer lattices, one of which is chosen by the parameter `level` of session_bound_cell(); the order of each is
     * twice that of the one before */
    session_bound_level levels[BOUND_MOST_LEVELS];
    /* The factors of which the cell is a product. line: used for the axes of hexes, quads and pyramids and for axis k
     * of wedges; simplex: a triangle, used for triangles and wedges, or a tet, used for tets */
    session_bound_factor line, simplex;
} session_bound;

/* Makes the matrices and patterns for cells of one type and number of nodes. The polynomial order of the cells must be
 * from 1 to BOUND_MOST_ORDER, or to INTERPOLATION_MOST_PYRAMID for pyramids. order: the order in which a cell's nodes
 * are listed in the connectivity. is_lobatto: nodes along the axes of hexes and quads are Gauss-Lobatto points;
 * otherwise they are equispaced. Returns false if memory runs out; the caller must drop *out in any case. */
bool session_make_bound(const session_nodes *of, insitu_vertex_order order, bool is_lobatto, session_bound *out);
void session_drop_bound(session_bound *bound);

/* The isovalues of the isosurfaces of one field. */
typedef struct session_isovalues {
    int count;
    const double *values;
    double tolerance; /* an isosurface may cross a cell if the cell's range of values, extended by this tolerance on
                         both sides, contains an isovalue */
} session_isovalues;

/* Returns whether any isovalue is in the closed interval from `low` to `high`. */
bool session_is_any_between(const session_isovalues *isovalues, double low, double high);

/* Returns the number of doubles of working memory that session_may_cross() and session_bound_cell() need. */
size_t session_bound_work_size(const session_bound *of);

/* Returns whether a cell may contain a part of an isosurface, even after its values are rounded to float32. Returns
 * false if a value is not finite. values: the field at the cell's nodes, in the order of the nodes in connectivity.
 * work: session_bound_work_size() doubles of working memory. */
bool session_may_cross(const session_bound *of, const double *values, const session_isovalues *isovalues, double *work);

/* Bounds of the errors of one cell, in units of coordinates, if the cell is drawn as linear pieces between its nodes.
 * If each edge between two nodes is cut into n pieces instead, the errors must be divided by n^2. */
typedef struct session_cell_bound {
    double centre[3], radius; /* a sphere that contains the cell */
    /* set if the cell may contain a part of an isosurface, or if no isovalues are given. It is false if a value or a
     * position is not finite; all other members are then undefined. */
    bool is_crossed;
    double node_distance; /* distance between neighbouring nodes: the root mean square over the cell's edges */
    /* upper bound of the distance between the positions that the cell and its pieces give to the same point of the
     * reference cell */
    double position_error;
    /* upper bound of the distance between the isosurfaces of the cell and of its pieces; INFINITY if the gradient may
     * vanish near the isosurface */
    double surface_error;
    /* Estimates that are computed only without isovalues. value_error is the root mean square of the difference between
     * the fields of the cell and of its pieces at the same point of space, in units of the field; it may be not finite
     * if the cell is flat. volume is the cell's volume, which is 0 for shells. */
    double value_error, volume;
} session_cell_bound;

/* Computes the bounds of a cell. tuples: x, y, z and the field's value at the cell's nodes, in the order of the nodes
 * in connectivity. isovalues: NULL if only the bounds of positions and values are needed. level: index in of->levels of
 * the finer lattice to use; a finer one mostly gives a smaller bound, but takes longer. work: session_bound_work_size()
 * doubles of working memory. */
session_cell_bound session_bound_cell(const session_bound *of, const double *tuples, const session_isovalues *isovalues,
                                      int level, double *work);

#endif
