/* The faces of the caller's cells of higher order, and their rims. A rim consists of the nodes along a face's edges.
 * Cells are split into linear pieces, so that the outer faces of pieces are parts of these faces. The row of a cell is
 * its list of nodes in the connectivity. */
#ifndef SESSION_RIMS_H
#define SESSION_RIMS_H

#include "session_rows.h"
#include "session_shape.h"

enum { RIMS_MOST_FACES = SHAPE_MOST_FACES, RIMS_MOST_NODES = 4 * NODES_MOST_ORDER };

/* The faces and rims of cells of one type and order. A node is given by its position in the cell's list of nodes in the
 * connectivity. */
typedef struct session_rim_kind {
    int counts[RIMS_MOST_FACES]; /* number of nodes of each face's rim; 0: the cell does not have this face */
    int nodes[RIMS_MOST_FACES][RIMS_MOST_NODES];
    unsigned char *faces_of_node; /* for each node, a bit mask of the faces on which it lies */
} session_rim_kind;

typedef struct session_rims {
    session_rows rows;
    session_rim_kind *kinds;
    int64_t cell; /* the caller's cell to which faces_of_vertex refers; -1: no cell yet */
    /* for each vertex of session_mesh.cells, a bit mask of the faces of the caller's cell `cell` on which it lies */
    unsigned char *faces_of_vertex;
} session_rims;

/* Finds the faces and rims of the cells of a mesh, once for each combination of type and order. The mesh's cells of
 * higher order must be split into pieces. Returns false if memory runs out; the caller must free *out in any case.
 * Local. */
bool session_rims_create(const session_mesh *mesh, session_rims *out);
void session_rims_free(session_rims *rims);

/* Returns the number of nodes of all rims of one of the caller's cells. */
int64_t session_count_rim_nodes(const session_rims *rims, int64_t cell);

/* Returns a bit mask of those faces of the caller's cell that contain all of the given vertices. */
unsigned session_find_faces_with_vertices(session_rims *rims, int64_t cell, const int64_t *vertices, int64_t count);

/* Returns the index of the first face of the caller's cell that contains all of the given vertices, or -1 if there is
 * none. */
int session_find_face_of_vertices(session_rims *rims, int64_t cell, const int64_t *vertices, int64_t count);

/* Computes the normal, of any length, of the plane in which a face of the reference cell lies. The normal is (0, 0, z)
 * if the cell is a triangle or quad. */
void session_find_face_plane_normal(const session_nodes *of, int face, double out[3]);

/* Returns the faces and rims of cells with the type and order of the given cell of the caller. */
static inline const session_rim_kind *session_get_rims_of_cell(const session_rims *rims, int64_t cell)
{
    return &rims->kinds[session_find_kind_of_cell(&rims->rows, cell)];
}

#endif
