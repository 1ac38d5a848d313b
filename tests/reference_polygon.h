/* Triangulates a polygon literally by the definition (libinsitu/base/faces/polygon.h), by brute force in double. */
#ifndef REFERENCE_POLYGON_H
#define REFERENCE_POLYGON_H

#include <stdbool.h>

enum { REFERENCE_MAX_CORNERS = 400 };

/* Writes the triangles as indices of corners and returns the number of triangles, count - 2. Each triangle has the
 * orientation of the polygon. */
int reference_polygon_triangulate(const double (*corners)[3], int count, int (*triangles)[3]);

/* Returns whether exactly one corner of a quad points inwards. */
bool reference_is_concave_quad(const double (*corners)[3]);

#endif
