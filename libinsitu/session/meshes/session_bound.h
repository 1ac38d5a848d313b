/* Cells of higher order are drawn as linear pieces. Upper bounds of two distances that result from this are computed
 * here: the distance between the isosurfaces of a cell's polynomial and those of its pieces, and the distance between
 * the positions that the curved cell and its pieces give to the same point of the reference cell. The row of a cell is
 * its list of nodes in the connectivity (session_rows.h). A complete cell has all nodes of the regular grid of its
 * order (session_nodes.h). */
#ifndef SESSION_BOUND_H
#define SESSION_BOUND_H

#include "session_interpolation.h"
#include "session_pattern.h"

/* Highest order of cells for which bounds are computed. A finer lattice has at least twice the order of its cell and at
 * most the order NODES_MOST_ORDER. Cells above BOUND_MOST_ORDER therefore cannot have one, and there is no number of
 * pieces to be chosen by a bound. */
enum { BOUND_MOST_ORDER = NODES_MOST_ORDER / 2 };

/* A second difference of Bernstein coefficients along a direction of edges: a weighted sum of `count` coefficients. */
typedef struct session_second_difference {
    /* index of the edge direction along which the difference is taken, in the order of list_differences()
     * (session_bound.c) */
    int direction;
    int count;
    int nodes[10]; /* indices of the Bernstein coefficients that are summed */
    double weights[10];
} session_second_difference;

enum { BOUND_MOST_LEVELS = 3 };

/* Matrices for polynomials on a simplex: a line, a triangle or a tet. The reference cell of each type is a Cartesian
 * product of such simplices, which are called its factors. */
typedef struct session_bound_factor {
    /* number of dimensions: 1 for a line, 2 for a triangle, 3 for a tet; 0: this factor is not used */
    int dimensions;
    int node_count;    /* number of nodes */
    double *bernstein; /* matrix from values at nodes to Bernstein coefficients: node_count x node_count */
    int difference_count;
    /* second differences of the coefficients along all directions that edges of pieces have */
    session_second_difference *differences;
    /* For each finer lattice (index in session_bound.levels): number of its nodes on this simplex, and matrices of
     * fine_counts[level] rows and node_count columns. From the values at the simplex's node_count nodes, `values`
     * computes the values at the nodes of the finer lattice, and slopes[level][a] the derivatives along axis a. */
    int fine_counts[BOUND_MOST_LEVELS];
    double *values[BOUND_MOST_LEVELS], *slopes[BOUND_MOST_LEVELS][3];
} session_bound_factor;

/* A finer lattice: a regular grid of nodes in the reference cell, whose order is a multiple of the cell's order.
 * Gradients of the field are computed at its nodes, and the linear pieces between its nodes are tested for crossings
 * with isosurfaces. */
typedef struct session_bound_level {
    int order, count; /* order of the finer lattice, and number of its nodes */
    session_pattern pieces;
} session_bound_level;

/* Precomputed matrices and lists of pieces, from which the error bounds of cells of one type with one number of nodes
 * are computed. */
typedef struct session_bound {
    /* positions of the nodes in the connectivity, for the cell's own nodes (nodes.of) and for all nodes of a complete
     * cell of the same order (nodes.complete) */
    session_interpolation nodes;
    /* the nodes from whose values polynomials are computed: all nodes of a complete cell of the same type and order.
     * For pyramids these are the nodes of a hex of the same order, because a pyramid is treated as a hex whose upper
     * face is collapsed to the apex. */
    session_nodes lattice;
    /* for pyramids: matrix that computes values at the nodes of the collapsed hex (rows) from values at the nodes of a
     * complete pyramid of the same order (columns); NULL for all other types */
    double *collapse;
    int axis_count; /* number of axes of the reference cell, 2 or 3 */
    int level_count;
    /* the finer lattices, one of which is chosen by the parameter `level` of session_bound_cell_errors(); the order of
     * each is twice that of the one before */
    session_bound_level levels[BOUND_MOST_LEVELS];
    /* The factors of the reference cell, that is, the simplices whose Cartesian product it is. line: used for each axis
     * of hexes, quads and pyramids and for axis k of wedges; simplex: a triangle in triangles and wedges, a tet in
     * tets */
    session_bound_factor line, simplex;
} session_bound;

/* Computes the matrices and lists of pieces for cells of one type and number of nodes. The polynomial order of the
 * cells must be from 1 to BOUND_MOST_ORDER, or to INTERPOLATION_MOST_PYRAMID for pyramids. order: the order in which a
 * cell's nodes are listed in the connectivity. is_lobatto: nodes along the axes of hexes and quads are Gauss-Lobatto
 * points; otherwise they are equispaced. Returns false if memory runs out; the caller must drop *out in any case. */
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
bool session_is_any_isovalue_between(const session_isovalues *isovalues, double low, double high);

/* Returns the number of doubles of working memory that session_may_isosurface_cross_cell() and
 * session_bound_cell_errors() need. */
size_t session_bound_work_size(const session_bound *of);

/* Returns whether a cell may contain a part of an isosurface, with the exact values at its nodes or with these values
 * rounded to float32. Returns false if a value is not finite. values: the field at the cell's nodes, in the order of
 * the nodes in connectivity. work: session_bound_work_size() doubles of working memory. */
bool session_may_isosurface_cross_cell(const session_bound *of, const double *values,
                                       const session_isovalues *isovalues, double *work);

/* Bounds of the errors of one cell that is drawn as linear pieces between its own nodes. Lengths are in units of
 * coordinates. If each edge between two nodes is cut into n pieces instead, position_error, surface_error and
 * value_error must be divided by n^2. */
typedef struct session_cell_bound {
    double centre[3], radius; /* a sphere that contains the cell */
    /* set if the cell may contain a part of an isosurface, or if no isovalues are given. It is false if a value or a
     * position is not finite; all other members are then undefined. */
    bool is_crossed;
    double node_distance; /* distance between neighbouring nodes on an edge: root mean square over the cell's edges */
    /* upper bound of the distance between the two positions of a point of the reference cell: by the polynomial of
     * positions, and by linear interpolation in the pieces */
    double position_error;
    /* upper bound of the distance between the isosurfaces of the cell's polynomial and those of its linear pieces;
     * INFINITY if the gradient may vanish near an isosurface */
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
session_cell_bound session_bound_cell_errors(const session_bound *of, const double *tuples,
                                             const session_isovalues *isovalues, int level, double *work);

#endif
