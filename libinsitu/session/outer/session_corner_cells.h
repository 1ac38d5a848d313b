/* The linear cells that have the corners of a mesh's cells of higher order. An outer face of such a linear cell is an
 * outer face of the higher-order cell with the same corners. */
#ifndef SESSION_CORNER_CELLS_H
#define SESSION_CORNER_CELLS_H

#include "session_mesh.h"

typedef struct session_corner_cells {
    grid cells;       /* one cell for each of the caller's cells; each cell has vertices of its own */
    int64_t *origins; /* for each vertex of `cells`, the vertex of session_mesh.cells at the same corner */
    double *coordinates;
    int64_t *connectivity, *offsets;
    unsigned char *types;
} session_corner_cells;

/* Makes the linear cells of a mesh whose cells are split into pieces. Returns false if memory runs out; the caller must
 * free *out in any case. Local. */
bool session_corner_cells_create(const session_mesh *mesh, session_corner_cells *out);
void session_corner_cells_free(session_corner_cells *cells);

#endif
