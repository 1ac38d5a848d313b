/* Finds and computes the scalars by which layers are drawn. A scalar is a component or the magnitude of a field, as
 * given or recentred (averaged to vertices), or the vertices' distance from a plane. */
#ifndef SESSION_SCALARS_H
#define SESSION_SCALARS_H

#include "scene.h"
#include "session_mesh.h"

/* Returns the index of the component that a layer shows, or -1 for the magnitude (grid_field.component). */
int session_resolve_component(const scene_field *field, int component_count);

/* Returns whether a field of this centring is drawn with values at vertices that the session computes. For cell fields
 * these are means over cells. For vertex fields on a mesh with levels of refinement they are the given values, except
 * at hanging vertices. */
bool session_is_recentred(const scene_field *field, insitu_centring centring, bool is_refined);

/* Marks the scalar of a layer's field on the mesh as used by an image of this step. *marked receives the scalar, or
 * NULL if the mesh does not have the field. Returns false if memory runs out. Local. */
bool session_mark_scalar(session_mesh *mesh, const scene_field *field, bool needs_ranges, session_scalar **marked);

/* Returns the scalar of a layer's field on this rank's mesh; NULL if the mesh does not have the field. */
session_scalar *session_find_scalar(const session_mesh *mesh, const scene_field *field);

/* Returns the scalar that holds the field's values averaged at vertices over a mesh group; NULL if there is none.
 * mesh_group_name: the hash that identifies the mesh group (session_mesh_group.name). */
session_scalar *session_find_recentred_scalar(const session_mesh *mesh, const char *field, int component,
                                              uint64_t mesh_group_name);

/* Returns the mesh's field, or a component of it, with the values that the caller has given, in the order of the
 * vertices or cells. */
grid_field session_get_caller_values(const session_mesh *mesh, int field, int component);

/* Returns whether the field's values are read from the session's copy, in the order of the vertices, cells or corners,
 * and not from the caller's arrays. */
bool session_is_copied(const session_mesh *mesh, const session_field *field);

/* Returns whether the field's copy contains values of the cells' polynomials at the nodes of finer lattices, which
 * divide cells of higher order into more pieces than their own nodes do (session_finer.h). */
bool session_is_interpolated(const session_mesh *mesh, const session_field *field);

/* Returns whether a copy contains the values in their own type. Otherwise it contains doubles: components in separate
 * arrays may have different types, other values may be integers or not aligned, and polynomials are evaluated in
 * double. */
bool session_does_copy_keep_type(const session_mesh *mesh, const session_field *field);

/* Finds the field's values as given by the caller, without creating a scalar. Returns false if the mesh does not have
 * the field. */
bool session_find_values(const session_mesh *mesh, const scene_field *field, grid_field *out);

/* Appends a scalar to the mesh's list, and marks all data of the scalar as stale. All other members are 0; the calling
 * function must set them, for example the index of the scalar's field. Returns NULL if memory runs out. */
session_scalar *session_add_scalar(session_mesh *mesh);

/* Returns whether the scalar is the vertices' distance from a plane. */
bool session_is_distance(const session_scalar *scalar);
/* Returns the scalar's name for messages. */
const char *session_get_scalar_name(const session_mesh *mesh, const session_scalar *scalar);

/* Returns the values of a scalar. */
grid_field session_get_scalar_values(const session_mesh *mesh, const session_scalar *scalar);

/* Returns the number of the caller's drawn cells that have a value which is not finite. Local. */
int64_t session_count_unusable_cells(const session_mesh *mesh, const session_scalar *scalar);

/* Returns the minimum and maximum of the scalar's values in each node of the tree. The scalar must be used in this
 * step. */
mmbvh_ranges session_get_scalar_ranges(const session_mesh *mesh, const session_scalar *scalar);

/* Computes the minimum and maximum of the scalar over those drawn cells all of whose values are finite; low > high if
 * there are none. kind: selects among these cells. Parallel. Local. */
void session_find_scalar_extent(const session_mesh *mesh, session_scalar *scalar, int threads, session_extent_kind kind,
                                double *low, double *high);

/* Returns the number of the caller's drawn cells, including shells, that have a value which is not finite, so that
 * colours by the scalar lack in places. Reads all values if they have changed since they were read for an extent.
 * Parallel. Local. */
int64_t session_count_uncoloured_cells(const session_mesh *mesh, session_scalar *scalar, int threads);
/* Marks the stored minima and maxima as unknown, because the values have changed. */
void session_clear_extents(session_scalar *scalar);

#endif
