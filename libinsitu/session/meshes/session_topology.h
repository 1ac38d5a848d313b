/* The cells as the rooms below the session read them: the caller's arrays, or arrays of the session's own where cells
 * are described by their faces. */
#ifndef SESSION_TOPOLOGY_H
#define SESSION_TOPOLOGY_H

#include "session_mesh.h"

/* The vertices of a face that is given by a list of its own. */
static inline const void *session_face_list(const insitu_mesh *mesh, int64_t face)
{
    const int64_t stride = mesh->face_lists.stride_bytes ? mesh->face_lists.stride_bytes : (int64_t)sizeof(void *);
    return *(const void *const *)(const void *)((const char *)mesh->face_lists.data + face * stride);
}

/* The place of a given face's vertices. */
typedef struct session_face_row {
    grid_array list;
    int64_t first, size;
    int64_t limit; /* entries of the list */
} session_face_row;

session_face_row session_given_face(const insitu_mesh *mesh, int64_t face);

/* Owners and neighbours of faces. */
typedef struct session_face_sides {
    const insitu_mesh *given;
    grid_array owner, neighbour, boundary_owner;
} session_face_sides;

session_face_sides session_sides(const insitu_mesh *given);
/* The two cells of a face. One that is not there is negative, and then it is cells[1], unless neither is there. */
void session_cells_of_face(const session_face_sides *sides, int64_t face, int64_t cells[2]);

/* The grid that reads these arrays: the session's own where they are made, else the caller's. Local. */
void session_read_topology(session_mesh *mesh);

/* The type that the caller gave the cell, whatever it is read as. */
int session_given_type(const session_mesh *mesh, int64_t cell);

/* Make what the description leaves to the library, once for each topology: cells' faces from owner and neighbour,
 * faces' vertices in one array from several, cells' vertices in VTK's order, and tets, hexes, wedges and pyramids from
 * the polyhedra that are such. Then read it. Errors in owner, neighbour and lists are reported; session_check.c looks
 * for all others. On an error nothing is made. Local. */
insitu_status session_make_topology(session_mesh *mesh, int threads, base_error *error);

#endif
