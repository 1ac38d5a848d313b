/* Signed distances of vertices from planes. A slice is the isosurface of the distance 0: in every cell the interpolant
 * of the distances at its vertices is the distance itself, because positions are interpolated in the same way. */
#ifndef SESSION_DISTANCES_H
#define SESSION_DISTANCES_H

#include "scene.h"
#include "session_mesh.h"
#include "session_space.h"
#include "session_team.h"

/* A slice that lies on the border of the data is moved inside by at most this share of half the diagonal of the global
 * bounds. */
#define SESSION_BORDER_SHARE 1e-6

/* A point of the plane in this step. */
void session_find_plane_point(const scene_plane *plane, const session_extent *extent, double point[3]);

/* Note that an image of this step shows the plane on the mesh. False where memory ran out. Local. */
bool session_mark_distance(session_mesh *mesh, const scene_plane *plane, const session_extent *extent,
                           session_scalar **marked);

/* NULL: the mesh has no distances from the plane. */
session_scalar *session_find_distance(const session_mesh *mesh, const scene_plane *plane);

/* Compute the distances in use that are out of date: from a vertex's own coordinates alone, so that all ranks have the
 * same. Local. */
void session_update_distances(const session_meshes *meshes, const session_team *team, base_error *error);

/* The distance at which the plane is drawn, where the data's distances go from low to high over all ranks: 0, or, if
 * the plane lies on their border, as far inside as it takes to be seen. */
double session_slice_distance(double low, double high, double half_diagonal);

#endif
