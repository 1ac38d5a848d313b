/* Computes signed distances of vertices from planes. A slice is drawn as the isosurface of distance 0. This is exact,
 * because distances within a cell are interpolated in the same way as positions. */
#ifndef SESSION_DISTANCES_H
#define SESSION_DISTANCES_H

#include "scene.h"
#include "session_mesh.h"
#include "session_space.h"
#include "session_team.h"

/* Largest shift of a slice that lies on the border of the data, as a fraction of half the diagonal of the global
 * bounds. The slice is shifted to the inside. */
#define SESSION_BORDER_SHARE 1e-6

/* Computes a point on the plane. A plane may be defined relative to the centre of the data's bounds, which may differ
 * from step to step. */
void session_find_plane_point(const scene_plane *plane, const session_extent *extent, double point[3]);

/* Marks the distances from the plane on the mesh as used by an image of this step. *marked receives the scalar that
 * holds these distances. Returns false if memory runs out. Local. */
bool session_mark_distance(session_mesh *mesh, const scene_plane *plane, const session_extent *extent,
                           session_scalar **marked);

/* Returns the distances from the plane; NULL if the mesh has none. */
session_scalar *session_find_distance_scalar(const session_mesh *mesh, const scene_plane *plane);

/* Computes the distances that this step uses and that are out of date. Each distance is computed only from the vertex's
 * coordinates, so that all ranks obtain the same value. Local. */
void session_update_distances(const session_meshes *meshes, const session_team *team, base_error *error);

/* Returns the distance at which the plane is drawn. low, high: minimum and maximum, over all ranks, of the signed
 * distances of the data's vertices from the plane. The result is 0 or, if the plane lies on the border of the data, a
 * distance just far enough inside for the slice to be visible. */
double session_choose_slice_isovalue(double low, double high, double half_diagonal);

#endif
