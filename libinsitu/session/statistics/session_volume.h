/* The volume of a cell as drawn, or the area of a shell. */
#ifndef SESSION_VOLUME_H
#define SESSION_VOLUME_H

#include <stddef.h>

#include "grid.h"

/* A thread's buffers; {0} at first. */
typedef struct volume_room {
    const int64_t *vertices; /* the vertices of the last cell, each once */
    int vertex_count;
    int64_t corners[GRID_MAX_CELL_VERTICES];
    char *bytes;           /* for polyhedra and polygons */
    size_t size, wanted;   /* size and requested size, in bytes */
    bool is_out_of_memory; /* the requested size was not available: a volume could not be computed */
} volume_room;

void session_volume_free(volume_room *room);

/* Returns the unsigned volume of a valid cell of any shape: quads are bilinear patches; other faces of polyhedra, and
 * concave quads of theirs, are their triangles. For a shell it returns the area projected along the mean normal, which
 * for a flat shell is its whole area, convex or not. Returns NaN if memory ran out, which only a polyhedron or polygon
 * larger than all before can cause. */
double session_cell_volume(const grid *g, int64_t cell, volume_room *room);

#endif
