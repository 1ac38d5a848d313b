/* Thresholds: the cells of a mesh whose values of a field lie within bounds, whose outer faces are a layer's. */
#ifndef SESSION_THRESHOLDS_H
#define SESSION_THRESHOLDS_H

#include "scene.h"
#include "session_mesh.h"

/* The faces of a surface layer on the mesh; NULL: they were not marked. */
session_outer *session_find_outer(const session_mesh *mesh, const scene_threshold *threshold);

/* Note that an image of this step shows them. False where memory ran out. Local. */
bool session_mark_outer(session_mesh *mesh, const scene_threshold *threshold);

/* Free those of thresholds that no image of this step shows: they seldom outlive the values. */
void session_drop_thresholds(session_mesh *mesh);

/* Tells whether the faces are not known, or were found for other values. */
bool session_is_outer_stale(const session_mesh *mesh, const session_outer *outer);
/* Notes that the faces were found for the present values. */
void session_set_outer_fresh(const session_mesh *mesh, session_outer *outer);

/* Returns a byte a cell, from base_alloc(), which is not 0 where the cell is beyond the threshold; values that are not
 * numbers are. NULL: no memory. */
unsigned char *session_hidden_cells(const session_mesh *mesh, const session_threshold *threshold, int threads);

#endif
