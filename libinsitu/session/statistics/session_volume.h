/* The volume of a cell as it is drawn, or the area of a shell. */
#ifndef SESSION_VOLUME_H
#define SESSION_VOLUME_H

#include <stddef.h>

#include "grid.h"

/* A thread's room; {0} at first. */
typedef struct volume_room {
    const int64_t *vertices; /* the vertices of the cell whose volume was found last, each once */
    int vertex_count;
    int64_t corners[GRID_MAX_CELL_VERTICES];
    char *bytes;           /* for polyhedra and polygons */
    size_t size, wanted;   /* bytes */
    bool is_out_of_memory; /* there are not as many as wanted: a volume was not found */
} volume_room;

void session_volume_free(volume_room *room);

/* The volume of a good cell, without a sign, whatever its shape: quads are bilinear patches, other faces of polyhedra
 * and concave quads of theirs their triangles. Of a shell its area, seen along its mean normal: that is the whole area
 * of a flat one, convex or not. NaN where memory ran out, as only a polyhedron or polygon larger than all before may
 * find. */
double session_cell_volume(const grid *g, int64_t cell, volume_room *room);

#endif
