/* Warps meshes: draws them with their vertices at x + scale * u, where x is the position of a vertex and u a vector
 * field of the caller. The moved coordinates replace the caller's, so that all other code reads the mesh as if the
 * caller had given these coordinates. */
#ifndef SESSION_WARP_H
#define SESSION_WARP_H

#include "session_mesh.h"

/* The displacements of the vertices of a mesh. */
typedef struct session_displacement {
    int field;           /* index of the field in the mesh */
    uint64_t key;        /* hash of all inputs from which the displacements are computed */
    int component_count; /* number of components: 2 or 3 */
    /* for each axis, the array of the displacements along this axis; one entry per tuple of the field */
    grid_array components[3];
    grid_array index; /* for each vertex, the index of its tuple; if it has no data, vertex i has tuple i */
    int64_t count;    /* number of tuples of the field */
    double scale;     /* factor by which displacements are multiplied */
} session_displacement;

/* Moves the vertices, unless they were moved by the same displacements before, and marks the mesh as moved if a
 * coordinate has changed. It fails if an index is out of range or if memory runs out; the mesh is then unusable until
 * its vertices are moved again. Uses all threads. Local. */
insitu_status session_warp_mesh(session_meshes *meshes, session_mesh *mesh, const session_displacement *by, int threads,
                                base_error *error);

/* Restores the caller's own coordinates if the mesh is warped. Local. */
void session_unwarp_mesh(session_meshes *meshes, session_mesh *mesh);

/* Makes the description mesh->given refer to the moved coordinates again after the caller has set the mesh. The caller
 * of this function must then call session_select_grid_arrays(). */
void session_use_moved_coordinates(session_mesh *mesh);

#endif
