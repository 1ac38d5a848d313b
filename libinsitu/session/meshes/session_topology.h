/* Provides the cells in the form that all other code reads. They are read from the caller's arrays or, if these do not
 * have this form, from arrays owned by the session (session_make_topology()). */
#ifndef SESSION_TOPOLOGY_H
#define SESSION_TOPOLOGY_H

#include "session_mesh.h"

/* Returns the array with the vertices of the face, for meshes in which each face has its own array. */
static inline const void *session_face_list(const insitu_mesh *mesh, int64_t face)
{
    const int64_t stride = mesh->face_lists.stride_bytes ? mesh->face_lists.stride_bytes : (int64_t)sizeof(void *);
    return *(const void *const *)(const void *)((const char *)mesh->face_lists.data + face * stride);
}

/* The position at which the vertices of one of the caller's faces are stored. */
typedef struct session_face_row {
    grid_array list;
    int64_t first, size; /* index in `list` of the face's first vertex, and number of the face's vertices */
    int64_t limit;       /* number of entries of `list` */
} session_face_row;

session_face_row session_find_vertices_of_caller_face(const insitu_mesh *mesh, int64_t face);

/* The caller's arrays that give the two cells of each face: the cell that owns the face (its owner), and the cell on
 * the other side (its neighbour). */
typedef struct session_face_sides {
    const insitu_mesh *given;
    grid_array owner, neighbour, boundary_owner;
} session_face_sides;

session_face_sides session_get_owner_arrays(const insitu_mesh *given);
/* Finds the two cells of a face. cells[i] is negative if the cell is missing; if only one cell is missing, it is
 * cells[1]. */
void session_find_cells_of_face(const session_face_sides *sides, int64_t face, int64_t cells[2]);

/* Sets the arrays that the grid reads: the session's own arrays if there are any, otherwise the caller's. Local. */
void session_select_grid_arrays(session_mesh *mesh);

/* Returns the cell's type in the caller's description. The session may read the cell as another type. */
int session_caller_type(const session_mesh *mesh, int64_t cell);

/* Computes, once per topology, the arrays that the caller's description of the mesh lacks:
 * - the faces of each cell, if the caller gives the owner and neighbour of each face;
 * - a single array of the vertices of all faces, if the caller gives several arrays;
 * - the linear pieces of cells of higher order;
 * - the vertices of cells in VTK's order;
 * - tets, hexes, wedges and pyramids that replace polyhedra with the same faces.
 *
 * Afterwards the grid reads these arrays. Errors in owner, neighbour and lists of faces are reported here;
 * session_check.c finds all other errors. After an error nothing is stored. Local. */
insitu_status session_make_topology(session_mesh *mesh, int threads, base_error *error);

#endif
