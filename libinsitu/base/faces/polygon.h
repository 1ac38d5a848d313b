/* Cuts polygons into triangles. Polygons may be concave, and need not be planar.
 *
 * The triangles depend only on the positions of the corners. Two cells that share a face therefore get the same
 * triangles, although their lists of the face's corners may begin at different corners and run in opposite directions.
 * The polygon is projected along its normal, which is the sum of the area vectors of the triangles of any fan. The
 * corners are ordered from the smallest position (by x, then y, then z) in the direction in which the list of positions
 * is lexicographically smaller, which usually means towards the smaller neighbour. If all triangles of the fan from the
 * first corner have the polygon's orientation, the polygon is cut into this fan; this is the case for all convex
 * polygons. Otherwise ears are cut off, always the first ear after the first corner. An ear is a triangle of a corner
 * and its two neighbours that has the polygon's orientation and contains no other corner, not even on its sides. If a
 * polygon crosses itself, there may be no ear left; then the remaining corners are cut into a fan. */
#ifndef BASE_POLYGON_H
#define BASE_POLYGON_H

#include <stdbool.h>
#include <stddef.h>

/* Returns the number of bytes, aligned to 8, of the working memory that a polygon of `count` corners needs. */
size_t polygon_work_bytes(int count);

/* Cuts a polygon of count corners, at least 3, into count - 2 triangles. Each triangle consists of the indices of three
 * corners, in the polygon's own direction of rotation. Triangles of coincident or collinear corners may have no area.
 * work: memory of polygon_work_bytes(count) bytes. */
void polygon_triangulate(const double (*corners)[3], int count, void *work, int (*triangles)[3]);

/* Returns whether four corners form a quad with exactly one concave corner. A quad that crosses itself has no concave
 * corner. All quads except concave ones are cut into a fan from the first corner. */
bool polygon_is_concave_quad(const double (*corners)[3]);

#endif
