/* The corners, edges and faces of cells, by numbers of corners in VTK's order. */
#ifndef SESSION_SHAPE_H
#define SESSION_SHAPE_H

typedef struct session_shape {
    int type; /* GRID_* type of a linear cell with corners of its own: no polygon and no polyhedron */
    int corner_count, edge_count, face_count;
    /* Nodes of the corners in the lattice of order 1, whose axes are the edges at the first corner
     * (session_node_index()). */
    signed char corners[8][3];
    signed char edges[12][2]; /* in VTK's order of their midpoints */
    signed char faces[6][4];  /* the fourth corner of a triangle is -1; the face of a shell is the shell */
} session_shape;

/* Returns the shape of a linear type. */
const session_shape *session_shape_of(int type);

#endif
