/* Thresholds of surface layers. A layer may show the outer faces of only those cells of a mesh whose values of a field
 * lie within bounds. */
#ifndef SESSION_THRESHOLDS_H
#define SESSION_THRESHOLDS_H

#include "scene.h"
#include "session_mesh.h"

/* Returns the outer faces that a surface layer with this threshold shows on the mesh. Returns NULL if they have not
 * been marked. */
session_outer *session_find_outer(const session_mesh *mesh, const scene_threshold *threshold);

/* Marks the outer faces as shown by an image of this step. Returns false if memory runs out. Local. */
bool session_mark_outer(session_mesh *mesh, const scene_threshold *threshold);

/* Frees the outer faces of thresholds that no image of this step shows: the values on which they depend will probably
 * have changed before they are used again. */
void session_drop_thresholds(session_mesh *mesh);

/* Returns whether the outer faces have not been computed, or were computed for other values of the threshold's
 * field. */
bool session_is_outer_stale(const session_mesh *mesh, const session_outer *outer);
/* Records that the outer faces were computed for the current values of the threshold's field. */
void session_mark_outer_fresh(const session_mesh *mesh, session_outer *outer);

/* Returns one byte per cell, which is nonzero if the cell is beyond the threshold; NaN counts as beyond. The array is
 * allocated by base_alloc(); NULL if memory runs out. */
unsigned char *session_find_hidden_cells(const session_mesh *mesh, const session_threshold *threshold, int threads);

#endif
