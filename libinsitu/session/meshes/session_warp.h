/* Meshes that are drawn with their vertices at x + scale * u, u being a field of the caller's. The moved coordinates
 * are read in place of the caller's, so that everything that reads the mesh meets the mesh that the caller would have
 * given with these coordinates. */
#ifndef SESSION_WARP_H
#define SESSION_WARP_H

#include "session_mesh.h"

/* The displacements of the vertices of a mesh. */
typedef struct session_displacement {
    int field;                /* index of the field in the mesh */
    uint64_t key;             /* hash that differs if the displacements may differ */
    int component_count;      /* 2 or 3 */
    grid_array components[3]; /* displacement along each axis, in the order of the caller's tuples */
    grid_array index;         /* tuple of each vertex; without data, vertex i has tuple i */
    int64_t count;            /* number of tuples */
    double scale;             /* factor of the displacements */
} session_displacement;

/* Moves the vertices, unless they were moved by the same displacements before, and marks the mesh as moved if a
 * coordinate has changed. An error is one of the index, or lack of memory; it leaves the mesh unusable until it is
 * moved again. Uses all threads. Local. */
insitu_status session_warp_mesh(session_meshes *meshes, session_mesh *mesh, const session_displacement *by, int threads,
                                base_error *error);

/* Reads the caller's own coordinates again, if the mesh is warped. Local. */
void session_unwarp_mesh(session_meshes *meshes, session_mesh *mesh);

/* Makes the description mesh->given refer to the moved coordinates, after the caller has set the mesh again. The grid
 * must be read afterwards. */
void session_read_warp(session_mesh *mesh);

#endif
