/* Tables of the corners, edges and faces of each type of linear cell. Corners are numbered in VTK's order. */
#ifndef SESSION_SHAPE_H
#define SESSION_SHAPE_H

enum { SHAPE_MOST_FACES = 6 };

typedef struct session_shape {
    /* GRID_* type of a linear cell with a fixed number of corners, that is, neither a polygon nor a polyhedron */
    int type;
    int corner_count, edge_count, face_count;
    /* Indices i, j, k of each corner in a lattice of order 1. The axes of the lattice are the edges at the first corner
     * (session_find_node_in_connectivity()). */
    signed char corners[8][3];
    signed char edges[12][2]; /* two corners of each edge; edges are in VTK's order of their midpoints */
    /* corners of each face, in the order of session_face_table (session_cell_faces.h); the fourth corner of a triangle
     * is -1, and the only face of a shell is the shell */
    signed char faces[SHAPE_MOST_FACES][4];
} session_shape;

/* Returns the shape of a linear type. */
const session_shape *session_get_cell_shape(int type);

/* Computes a normal of a face's plane in the reference cell; its length is not 1. The normal of the only face of a
 * triangle or quad is parallel to z, because the reference cell lies in the plane z = 0. */
void session_find_face_plane(const session_shape *shape, int face, int out[3]);

/* Returns a bit mask of the faces on which a node of a lattice of this order lies; bit f stands for shape->faces[f].
 * node: lattice indices of the node. */
unsigned session_faces_of_node(const session_shape *shape, int order, const int node[3]);

#endif
