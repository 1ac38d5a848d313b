/* Cameras and rays that meet a mesh's faces, edges and vertices, or run within them. Chosen by a fixed sequence. */
#ifndef CHORD_AIM_H
#define CHORD_AIM_H

#include "chord_trace.h"
#include "test_meshes.h"

typedef enum chord_aim {
    CHORD_RANDOM,       /* anywhere, in tiles of any size */
    CHORD_TO_VERTICES,  /* to a cell's vertices, exactly or nearly */
    CHORD_TO_EDGES,     /* to points on its edges */
    CHORD_TO_FACES,     /* to points on its faces */
    CHORD_ALONG_EDGES,  /* the eye on an edge's line: the edge is a point in the picture */
    CHORD_ALONG_FACES,  /* the eye in a face's plane: the face is a line */
    CHORD_AXIS_ALIGNED, /* views along an axis or a diagonal, rays on the lattice's planes, lines and vertices */
    CHORD_FROM_INSIDE,  /* the eye among the cells */
    CHORD_AIM_COUNT
} chord_aim;

/* The next rays at the mesh, a lattice of n^3 cubes in [-1, 1]^3: a camera and the rays in its image plane. counter is
 * the sequence's place, and moves on. */
void chord_aim_rays(const test_mesh *mesh, int n, chord_aim aim, uint64_t *counter, render_camera *camera,
                    chord_rays *rays);

#endif
