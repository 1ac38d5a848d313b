/* A polygon's triangles by the letter of their definition (libinsitu/base/faces/polygon.h), by brute force in double.
 */
#ifndef REFERENCE_POLYGON_H
#define REFERENCE_POLYGON_H

#include <stdbool.h>

enum { REFERENCE_MAX_CORNERS = 400 };

/* Returns how many triangles of corners' numbers it wrote: count - 2, each of which runs as the polygon does. */
int reference_polygon_triangulate(const double (*corners)[3], int count, int (*triangles)[3]);

/* A quad with one corner that points inwards. */
bool reference_is_concave_quad(const double (*corners)[3]);

#endif
