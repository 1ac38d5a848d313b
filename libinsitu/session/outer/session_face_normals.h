/* Normals of the faces of cells of higher order. Outer surfaces are shaded with these normals as curved faces, instead
 * of with the normals of the flat or bilinear faces of pieces. */
#ifndef SESSION_FACE_NORMALS_H
#define SESSION_FACE_NORMALS_H

#include "session_derivatives.h"

typedef struct session_face_normals {
    session_polynomials polynomials;
    int64_t cell; /* the caller's cell that was read most recently; -1: no cell has been read */
    const session_derivatives *derivatives; /* derivatives of the polynomials of `cell` */
    /* positions x, y and z of the nodes of `cell`, in the order of its list of nodes in the connectivity */
    double *positions;
} session_face_normals;

/* Prepares the normals of the faces of a mesh whose cells are split. Returns false if memory runs out; the caller must
 * free *out in any case. Local. */
bool session_face_normals_create(const session_mesh *mesh, session_face_normals *out);
void session_face_normals_free(session_face_normals *normals);

/* Returns whether the normals of a cell's faces can be computed, which is not supported for pyramids. */
bool session_has_face_normals(session_face_normals *normals, const session_mesh *mesh, int64_t cell);

/* Computes the normal, of any length, of a face of one of the caller's cells at one of the cell's nodes. face: index of
 * the face in the cell (session_find_face_of_vertices()). vertex: the node, as a vertex of session_mesh.cells. Normals
 * at all nodes of a face point to the same side of the face. Returns false if the normal is 0 or cannot be computed. */
bool session_find_face_normal(session_face_normals *normals, const session_mesh *mesh, int64_t cell, int face,
                              int64_t vertex, double out[3]);

#endif
