/* Measures the largest distance, in pixels, between the polynomials of a mesh's cells of higher order and the linear
 * pieces that are drawn. The row of a cell is its list of nodes in the connectivity (session_rows.h). */
#ifndef SESSION_DEVIATION_H
#define SESSION_DEVIATION_H

#include "session_bound.h"
#include "session_finer.h"
#include "session_rows.h"

/* Callback that computes the size of a pixel in the views that show a mesh. */
typedef struct session_pixels {
    const void *of; /* first argument of the callback size() */
    /* Returns a lower bound of the size of a pixel at any point of a sphere, in units of coordinates; INFINITY if no
     * view shows the sphere. It is called by several threads at once. */
    double (*size)(const void *of, const double centre[3], double radius);
} session_pixels;

/* A cell that is passed to session_deviation_request.use_cell(). */
typedef struct session_value_cell {
    int count; /* number of nodes */
    /* positions and values: x, y, z and the field's value at each node, in the order of the cell's nodes in
     * connectivity */
    const double (*tuples)[4];
    const session_cell_bound *bound;
} session_value_cell;

/* A request to measure a mesh: the errors of its isosurfaces, the range of a field's values, or the errors of its
 * cells' positions. */
typedef struct session_deviation_request {
    /* values of the field that is measured, or whose isosurfaces are measured. NULL: positions are measured, in the
     * cells that `plane` may cross or, if `plane` is NULL, in the cells of `measured`. */
    const session_node_values *values;
    int component;               /* component of the field */
    session_isovalues isovalues; /* isovalues of the field; if `plane` is given, the single isovalue 0 of the distance
                                    from the plane */
    const session_plane *plane;
    session_pixels pixels;
    /* true: the range of the field's values is measured; false: the error of its isosurfaces, or of positions */
    bool is_of_values;
    /* callback for each cell if is_of_values is set; its first argument is `of_values`. Several threads may call it at
     * once. NULL: only the range of the values is needed. */
    void (*use_cell)(void *of, const session_value_cell *cell);
    void *of_values;
    /* set if nodes along the axes of hexes and quads are Gauss-Lobatto points; otherwise they are equispaced */
    bool is_lobatto;
    bool marks_only; /* true: cells are only marked in `marks`, and their errors are not computed */
    /* one byte per cell, which is set if an isosurface or the plane may cross the cell; NULL: cells are not marked */
    unsigned char *marks;
    /* if positions are measured: one byte per cell, nonzero if the cell is measured; NULL: all cells are measured */
    const unsigned char *measured;
} session_deviation_request;

/* Computes the values at the `count` nodes of a cell: the component of the request's field or, if the request has no
 * field, the signed distances from its plane. rows: access to the caller's cells. tuple: buffer for all components of
 * the field at one node. out: receives one value per node. */
void session_read_request_values(const session_rows *rows, const session_deviation_request *request, int64_t cell,
                                 int count, double *tuple, double *out);

typedef struct session_deviation {
    /* largest error bound of all measured cells, in pixels, for cells that are split only between their own nodes */
    double error;
    /* cell_count: number of cells that an isosurface may cross. unbounded_count: number of these cells in which the
     * nodes are too far apart to resolve the isosurface; a limit is reported there instead of the larger error bound */
    int64_t cell_count, unbounded_count;
    /* estimated number of pixels that show the isosurfaces, in units of 1/16 of a pixel */
    int64_t area;
    double low, high; /* if is_of_values: the range of the values at nodes */
} session_deviation;

/* Measures the caller's cells of a mesh with cells of higher order, except ghosts, and sets the marks of the request.
 * *out contains the results of earlier calls: maxima, minima and sums in it are extended by the cells of this mesh.
 * Parallel. Local. */
insitu_status session_measure_linearization_error(const session_mesh *mesh, const session_deviation_request *request,
                                                  int threads, session_deviation *out, base_error *error);

#endif
