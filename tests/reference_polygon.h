/* The triangles of a polygon by the letter of their definition (libinsitu/base/faces/polygon.h), by brute force in
 * double. */
#ifndef REFERENCE_POLYGON_H
#define REFERENCE_POLYGON_H

#include <stdbool.h>

enum { REFERENCE_MAX_CORNERS = 400 };

/* Writes the triangles as numbers of corners and returns how many there are: count - 2, each oriented as the polygon
 * is. */
int reference_polygon_triangulate(const double (*corners)[3], int count, int (*triangles)[3]);

/* Returns whether a quad has one corner that points inwards. */
bool reference_is_concave_quad(const double (*corners)[3]);

#endif
