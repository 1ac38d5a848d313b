/* Thresholds: a surface layer may show the outer faces of only those cells of a mesh whose values of a field lie within
 * bounds. */
#ifndef SESSION_THRESHOLDS_H
#define SESSION_THRESHOLDS_H

#include "scene.h"
#include "session_mesh.h"

/* Returns the outer faces of a surface layer on the mesh; NULL if they were not marked. */
session_outer *session_find_outer(const session_mesh *mesh, const scene_threshold *threshold);

/* Records that an image of this step shows these faces. Returns false if memory ran out. Local. */
bool session_mark_outer(session_mesh *mesh, const scene_threshold *threshold);

/* Frees the faces of thresholds that no image of this step shows, as the values on which they depend have probably
 * changed before the next use. */
void session_drop_thresholds(session_mesh *mesh);

/* Returns whether the faces are unknown, or were found for other values. */
bool session_is_outer_stale(const session_mesh *mesh, const session_outer *outer);
/* Records that the faces were found for the current values. */
void session_set_outer_fresh(const session_mesh *mesh, session_outer *outer);

/* Returns a byte per cell, from base_alloc(), which is nonzero if the cell is beyond the threshold; NaN counts as
 * beyond. Returns NULL if there is no memory. */
unsigned char *session_hidden_cells(const session_mesh *mesh, const session_threshold *threshold, int threads);

#endif
