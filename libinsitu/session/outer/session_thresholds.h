/* Thresholds of surface layers. With a threshold, a layer shows only the outer faces of cells in which the values of a
 * field lie within bounds. */
#ifndef SESSION_THRESHOLDS_H
#define SESSION_THRESHOLDS_H

#include "scene.h"
#include "session_mesh.h"

/* Returns the outer surface of the mesh that a surface layer with this threshold shows. If threshold->is_given is
 * false, this is the surface of the whole mesh. Returns NULL if session_mark_outer_surface_needed() has not been called
 * for this threshold. */
session_outer *session_find_outer_surface(const session_mesh *mesh, const scene_threshold *threshold);

/* Records that an image of this step shows the outer surface of the mesh with this threshold. The surface is added to
 * the mesh if it does not exist yet. Returns false if memory runs out. Local. */
bool session_mark_outer_surface_needed(session_mesh *mesh, const scene_threshold *threshold);

/* Frees the outer faces of thresholds that no image of this step shows, because the values on which they depend will
 * probably change before these faces are shown again. */
void session_drop_unused_outer_surfaces(session_mesh *mesh);

/* Returns whether the outer faces have not been computed, or were computed for other values of the threshold's
 * field. */
bool session_are_outer_faces_stale(const session_mesh *mesh, const session_outer *outer);
/* Records that the outer faces were computed for the current values of the threshold's field. */
void session_mark_outer_faces_current(const session_mesh *mesh, session_outer *outer);

/* Returns one byte per cell, which is nonzero if the threshold does not select the cell, because a value is outside its
 * bounds or NaN. The array is allocated by base_alloc(); NULL if memory runs out. */
unsigned char *session_find_hidden_cells(const session_mesh *mesh, const session_threshold *threshold, int threads);

#endif
