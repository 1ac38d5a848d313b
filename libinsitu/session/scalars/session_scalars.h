/* The scalars by which layers are drawn: a component or the magnitude of a field, as given or recentred to vertices; or
 * the vertices' distances from a plane. */
#ifndef SESSION_SCALARS_H
#define SESSION_SCALARS_H

#include "scene.h"
#include "session_mesh.h"

/* Returns the component that a layer shows, as grid_field.component. */
int session_resolve_component(const scene_field *field, int component_count);

/* Returns whether a field of this centring is shown by values at vertices that the session computes: by means, or, on a
 * mesh with levels of refinement, by the given ones except at hanging vertices. */
bool session_is_recentred(const scene_field *field, insitu_centring centring, bool is_refined);

/* Records that an image of this step uses the layer's field on the mesh; *marked: NULL if the mesh does not have it.
 * Returns false if memory ran out. Local. */
bool session_mark_scalar(session_mesh *mesh, const scene_field *field, bool wants_ranges, session_scalar **marked);

/* Returns this rank's scalar for a layer's field; NULL if the mesh does not have it. */
session_scalar *session_find_scalar(const session_mesh *mesh, const scene_field *field);

/* As above, for means at vertices over the meshes with this hash (scene_field.joined). */
session_scalar *session_find_recentred(const session_mesh *mesh, const char *field, int component, uint64_t joined);

/* Returns the mesh's field, or a component of it, as given by the caller, in the order of the vertices or cells. */
grid_field session_given_field(const session_mesh *mesh, int field, int component);

/* Returns whether the values are read from the session's copy, which is in the order of the vertices, cells or
 * corners. */
bool session_is_copied(const session_mesh *mesh, const session_field *field);

/* Tells whether a copy has the values in their own type; else they are doubles: components that are arrays of their own
 * may differ in it, and others are integers or not aligned. */
bool session_is_plain_copy(const session_field *field);

/* The field's values as the caller gave them, with no scalar for it; false where the mesh does not have it. */
bool session_find_values(const session_mesh *mesh, const scene_field *field, grid_field *out);

/* Adds a scalar of field 0, all of whose data is stale. Returns NULL if memory ran out. */
session_scalar *session_add_scalar(session_mesh *mesh);

/* Returns whether the scalar is the vertices' distance from a plane. */
bool session_is_distance(const session_scalar *scalar);
/* Returns the scalar's name for messages. */
const char *session_scalar_name(const session_mesh *mesh, const session_scalar *scalar);

/* Returns the values of a scalar. */
grid_field session_scalar_field(const session_mesh *mesh, const session_scalar *scalar);

/* Returns the ranges of a scalar in use. */
mmbvh_ranges session_scalar_ranges(const session_mesh *mesh, const session_scalar *scalar);

/* Computes the minimum and maximum over the drawn cells all of whose values are finite; low > high: there are none.
 * Parallel. Local. */
void session_scalar_extent(const session_mesh *mesh, session_scalar *scalar, int threads, session_extent_kind kind,
                           double *low, double *high);
/* Drops the stored extents, because the values have changed. */
void session_forget_extents(session_scalar *scalar);

#endif
