/* Polygons cut into triangles, convex or not, flat or not.
 *
 * How one is cut depends on its corners' places alone, so that both sides of a face agree wherever its list begins and
 * whichever way it runs. It is looked at along its normal, the sum of its triangles' areas as vectors. Corners are
 * taken from the least place on (by x, then y, then z), towards the lesser of its neighbours, or rather so that the
 * list of places is the least. If all triangles of the fan from there have the polygon's orientation, the fan it is;
 * convex polygons are cut in this way. Else ears are cut off, always the first one behind the least corner: a triangle
 * of a corner and its two neighbours that has the polygon's orientation and holds no other corner, on its sides
 * neither. Where a polygon crosses itself no ear may be left; a fan then takes the rest. */
#ifndef BASE_POLYGON_H
#define BASE_POLYGON_H

#include <stdbool.h>
#include <stddef.h>

/* Returns how many bytes of room, 8-byte aligned, a polygon of so many corners takes. */
size_t polygon_room(int count);

/* Cuts count corners, at least 3, into count - 2 triangles of corners' numbers, each of which runs as the polygon does.
 * Triangles at corners in one place or in a line may have no area. */
void polygon_cut(const double (*corners)[3], int count, void *room, int (*triangles)[3]);

/* Tells whether four corners around make a quad one of which points inwards. Quads that cross themselves are none; all
 * but concave quads are cut into a fan. */
bool polygon_is_concave_quad(const double (*corners)[3]);

#endif
