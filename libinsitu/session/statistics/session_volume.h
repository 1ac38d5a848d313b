/* Computes the volume of a cell, or the area of a shell. The cell's faces have the same shapes as in pictures. */
#ifndef SESSION_VOLUME_H
#define SESSION_VOLUME_H

#include <stddef.h>

#include "grid.h"

/* Buffers of one thread. The struct must be initialized with {0}. */
typedef struct volume_buffer {
    const int64_t *vertices; /* vertices, without duplicates, of the cell whose volume was computed most recently */
    int vertex_count;
    int64_t corners[GRID_MAX_CELL_VERTICES]; /* memory for the vertices of cells whose type has a fixed number of
                                                vertices */
    char *bytes;                             /* memory for polyhedra and polygons */
    /* size: size of `bytes`; requested_size: number of bytes that were requested most recently */
    size_t size, requested_size;
    bool is_out_of_memory; /* set if the requested memory was not available, so that a volume could not be computed */
} volume_buffer;

void session_volume_free(volume_buffer *buffer);

/* Returns the unsigned volume of a valid cell of any shape, and the area of a shell. Quads are bilinear patches; other
 * faces of polyhedra, and their concave quads, are divided into triangles. Returns NaN if memory runs out, which is
 * possible only for a polyhedron or polygon that is larger than all earlier ones. */
double session_cell_volume(const grid *g, int64_t cell, volume_buffer *buffer);

/* Returns the area of a shell's projection along its mean normal. For a flat shell this is its whole area, whether the
 * shell is convex or not. */
double session_shell_area(const grid *g, int64_t cell);

#endif
