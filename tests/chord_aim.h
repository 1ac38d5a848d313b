/* Chooses, by a fixed random sequence, cameras and rays that meet the faces, edges and vertices of a mesh or run within
 * them. A chord is the segment of a ray inside the mesh (chord_hull.h). */
#ifndef CHORD_AIM_H
#define CHORD_AIM_H

#include "chord_trace.h"
#include "test_meshes.h"

typedef enum chord_aim {
    CHORD_RANDOM,       /* rays at random positions, in tiles of any size */
    CHORD_TO_VERTICES,  /* rays through a cell's vertices, exactly or nearly */
    CHORD_TO_EDGES,     /* rays through points on a cell's edges */
    CHORD_TO_FACES,     /* rays through points on a cell's faces */
    CHORD_ALONG_EDGES,  /* the eye is on the line through an edge, so that the edge projects to a point */
    CHORD_ALONG_FACES,  /* the eye is in the plane of a face, so that the face projects to a line */
    CHORD_AXIS_ALIGNED, /* views along an axis or a diagonal; rays on planes, lines and vertices of the lattice */
    CHORD_FROM_INSIDE,  /* the eye is inside the mesh */
    CHORD_AIM_COUNT
} chord_aim;

/* Chooses the next camera and the rays in its image plane. The mesh is a lattice of n^3 cubes in [-1, 1]^3. counter is
 * the position in the random sequence and is advanced. */
void chord_aim_rays(const test_mesh *mesh, int n, chord_aim aim, uint64_t *counter, render_camera *camera,
                    chord_rays *rays);

#endif
