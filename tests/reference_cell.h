/* One cell in double: where a ray crosses its faces, and its interpolant inside. The truth that kernels are measured
 * against; made to be obviously right, not fast. */
#ifndef REFERENCE_CELL_H
#define REFERENCE_CELL_H

#include <stdbool.h>

/* A cell in camera coordinates (right, up, forward from the eye). */
typedef struct reference_cell {
    int type; /* GRID_* */
    int count;
    double world[8][3]; /* as the simulation has them: decides how quads are split */
    double position[8][3];
} reference_cell;

/* The ray x = base[0] + slope[0] z, y = base[1] + slope[1] z of camera coordinates. */
typedef struct reference_line {
    double base[2], slope[2];
} reference_line;

/* Where a line meets the cell's surface. That a face is met is decided on its triangles; where a quad is met, on its
 * bilinear patch, at the coordinates u, w. */
typedef struct reference_crossing {
    double z;
    int face;
    double u, w;
    bool is_folded; /* the patch has no or no single such point: z is the triangle's */
} reference_crossing;

enum { REFERENCE_MAX_CROSSINGS = 12 };

/* Crossings sorted by z; their number is even for every line. */
int reference_crossings(const reference_cell *cell, const reference_line *line,
                        reference_crossing crossings[REFERENCE_MAX_CROSSINGS]);

/* The field at a crossing from the face's own vertices: linear on triangles, bilinear on quads. */
double reference_face_value(const reference_cell *cell, const reference_line *line, const reference_crossing *crossing,
                            const double *values, bool *is_folded);

/* The smallest distance, in a plane of constant z, between the line and an edge of the cell. */
double reference_edge_distance(const reference_cell *cell, const reference_line *line);

/* Interpolant at a point. Returns false where the inverse map has no solution (a degenerate cell): value and gradient
 * are then 0. gradient (camera coordinates) may be NULL. */
bool reference_interpolate(const reference_cell *cell, const double point[3], const double *values, double *value,
                           double gradient[3]);

#endif
