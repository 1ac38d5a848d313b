/* Points and weights of Gauss quadrature on lines, triangles and tets. Rules of quads, hexes and wedges are products of
 * such rules. */
#ifndef SESSION_QUADRATURE_H
#define SESSION_QUADRATURE_H

#include <stdbool.h>

enum { QUADRATURE_MOST_POINTS = 128 }; /* maximum number of points along an axis */

/* A rule on the unit simplex: the points whose coordinates are at least 0 and have a sum of at most 1. */
typedef struct session_quadrature {
    int dimensions;      /* 1: line, 2: triangle, 3: tet */
    int count;           /* number of points */
    double (*points)[3]; /* coordinates of the points; coordinates beyond `dimensions` are 0 */
    double *weights;     /* their sum is the volume of the simplex: 1, 1/2 or 1/6 */
} session_quadrature;

/* Makes a rule of `per_axis` points along each axis, at most QUADRATURE_MOST_POINTS. It is exact for polynomials of
 * total degree 2 per_axis - 1. Returns false if memory runs out; the caller must drop *out in any case. */
bool session_make_quadrature(int dimensions, int per_axis, session_quadrature *out);
void session_drop_quadrature(session_quadrature *quadrature);

#endif
