/* Measures the largest distance, in pixels, between the polynomials of a mesh's cells of higher order and the linear
 * pieces that are drawn. */
#ifndef SESSION_DEVIATION_H
#define SESSION_DEVIATION_H

#include "session_bound.h"
#include "session_finer.h"
#include "session_rows.h"

/* The sizes of pixels in the views that show a mesh. */
typedef struct session_pixels {
    const void *of; /* first argument of size() */
    /* Returns a lower bound of the size of a pixel at any point of a sphere, in units of coordinates; INFINITY if no
     * view shows the sphere. It is called by several threads at once. */
    double (*size)(const void *of, const double centre[3], double radius);
} session_pixels;

/* A cell whose values are measured. */
typedef struct session_value_cell {
    int count;                 /* number of nodes */
    const double (*tuples)[4]; /* x, y, z and the value at each node, in the order of the cell's row */
    const session_cell_bound *bound;
} session_value_cell;

/* A request to measure a mesh: its isosurfaces, the values of a field, or the positions of its cells. */
typedef struct session_deviation_request {
    /* values of the field that is measured, or whose isosurfaces are. NULL: positions are measured, of the cells that
     * `plane` may cross or, if `plane` is NULL, of all cells. */
    const session_node_values *values;
    int component;               /* component of the field */
    session_isovalues isovalues; /* isovalues of the field; if `plane` is given, the distance 0 from it */
    const session_plane *plane;
    session_pixels pixels;
    bool is_of_values; /* set if the range of the field's values is measured, instead of the error of its isosurfaces */
    /* if is_of_values: receives each cell, and `of_values`; several threads call it at once. NULL: only the range of
     * the values is needed. */
    void (*use_cell)(void *of, const session_value_cell *cell);
    void *of_values;
    bool is_lobatto; /* as in session_make_interpolation() */
    bool marks_only; /* set if cells are only marked, not measured */
    /* one byte per cell, which is set if an isosurface or the plane may cross the cell; NULL: cells are not marked */
    unsigned char *marks;
} session_deviation_request;

/* Computes the request's component of the field, or else the distance from its plane, at the `count` nodes of a cell.
 * rows: rows of the caller's cells. tuple: buffer for all components of the field. */
void session_read_request_values(const session_rows *rows, const session_deviation_request *request, int64_t cell,
                                 int count, double *tuple, double *out);

typedef struct session_deviation {
    double error; /* largest bound in pixels if cells have one piece between two nodes */
    /* number of cells that an isosurface may cross, and of those among them whose bound was replaced by a smaller
     * limit, because their nodes are too far apart to resolve the isosurface */
    int64_t cell_count, unbounded_count;
    double low, high; /* if is_of_values: the range of the values at nodes */
} session_deviation;

/* Measures the caller's cells of a mesh with cells of higher order, ghosts excepted, adds the result to *out, and sets
 * the marks. Parallel. Local. */
insitu_status session_measure_deviation(const session_mesh *mesh, const session_deviation_request *request, int threads,
                                        session_deviation *out, base_error *error);

#endif
