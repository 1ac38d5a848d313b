/* Bounds of the distance between an isosurface of the polynomials of cells of higher order and that of their linear
 * pieces, and of the distance between positions in both. */
#ifndef SESSION_BOUND_H
#define SESSION_BOUND_H

#include "session_interpolation.h"
#include "session_pattern.h"

/* Cells above this order are drawn between their own nodes, so that no bound is needed. */
enum { BOUND_MOST_ORDER = NODES_MOST_ORDER / 2 };

/* A second difference of Bernstein coefficients. */
typedef struct session_second_difference {
    int direction; /* the direction along which it is taken, in the order of list_differences() */
    int count;
    int nodes[10]; /* numbers of the coefficients */
    double weights[10];
} session_second_difference;

enum { BOUND_MOST_LEVELS = 3 };

/* The polynomials on a line, a triangle or a tet. */
typedef struct session_bound_factor {
    int dimensions;    /* 1: line, 2: triangle, 3: tet; 0: not used */
    int node_count;    /* number of nodes */
    double *bernstein; /* Bernstein coefficients by values at nodes: node_count x node_count */
    int difference_count;
    session_second_difference *differences; /* in all directions of the edges of pieces */
    /* by level: number of nodes of the finer lattice, and values and derivatives there by values at nodes, each
     * fine_counts[level] x node_count */
    int fine_counts[BOUND_MOST_LEVELS];
    double *values[BOUND_MOST_LEVELS], *slopes[BOUND_MOST_LEVELS][3];
} session_bound_factor;

/* A finer lattice, on whose pieces crossings and gradients are determined. */
typedef struct session_bound_level {
    int order, count; /* order, and number of nodes */
    session_pattern pieces;
} session_bound_level;

/* What is needed for the bounds of one kind of cell. */
typedef struct session_bound {
    session_interpolation nodes; /* the cell's nodes, and all nodes of its order */
    int axis_count;              /* number of axes of the reference cell, 2 or 3 */
    int level_count;
    session_bound_level levels[BOUND_MOST_LEVELS]; /* each of twice the order of the one before */
    session_bound_factor line, simplex;
} session_bound;

/* Returns false if memory runs out; the caller must drop *out in any case. of: cells other than pyramids, of an order
 * from 1 to BOUND_MOST_ORDER. order and is_lobatto: as in session_make_interpolation(). */
bool session_make_bound(const session_nodes *of, insitu_vertex_order order, bool is_lobatto, session_bound *out);
void session_drop_bound(session_bound *bound);

/* The isosurfaces of one field. */
typedef struct session_isovalues {
    int count;
    const double *values;
    double tolerance; /* a cell may be crossed if its range is so near to a value */
} session_isovalues;

/* Returns whether one of the values is in the interval. */
bool session_is_any_between(const session_isovalues *isovalues, double low, double high);

/* Returns the number of doubles that the functions below need as working memory. */
size_t session_bound_work_size(const session_bound *of);

/* Returns whether a cell may have a part of an isosurface, also if values are rounded to float32; false if a value is
 * not finite. values: the field at its
 * nodes, in the order of its row. */
bool session_may_cross(const session_bound *of, const double *values, const session_isovalues *isovalues, double *work);

/* The distances, in scene units, if the cell has one piece between two nodes. With n pieces they are divided by the
 * square of n. */
typedef struct session_cell_bound {
    double centre[3], radius; /* of a sphere around the cell */
    /* set if the cell may have a part of an isosurface, or if no isovalues are given; false if a value or a position is
     * not finite, and then nothing else holds */
    bool is_crossed;
    double node_distance;  /* distance of two neighbouring nodes: the root mean square of that on the cell's edges */
    double position_error; /* distance of positions */
    double surface_error;  /* distance of isosurfaces; INFINITY if the gradient may vanish near one */
    double value_error;    /* difference of the field, in its unit */
} session_cell_bound;

/* Computes the bounds of a cell. tuples: x, y, z and the field's value at its nodes, in the order of its row.
 * isovalues: NULL if only positions are of interest. level: that of the lattice, 0 .. level_count - 1; a finer
 * one mostly gives a smaller bound, but takes longer. */
session_cell_bound session_bound_cell(const session_bound *of, const double *tuples, const session_isovalues *isovalues,
                                      int level, double *work);

#endif
