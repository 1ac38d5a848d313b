/* Tables of the corners, edges and faces of each type of linear cell. Corners are numbered in VTK's order. */
#ifndef SESSION_SHAPE_H
#define SESSION_SHAPE_H

typedef struct session_shape {
    /* GRID_* type of a linear cell with a fixed number of corners, that is, neither a polygon nor a polyhedron */
    int type;
    int corner_count, edge_count, face_count;
    /* Indices i, j, k of each corner in a lattice of order 1. The axes of the lattice are the edges at the first corner
     * (session_node_index()). */
    signed char corners[8][3];
    signed char edges[12][2]; /* two corners of each edge; edges are in VTK's order of their midpoints */
    /* corners of each face; the fourth corner of a triangle is -1, and the only face of a shell is the shell */
    signed char faces[6][4];
} session_shape;

/* Returns the shape of a linear type. */
const session_shape *session_shape_of(int type);

#endif
