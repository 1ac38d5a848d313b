/* Computes gradients at vertices, for isosurfaces whose normals are interpolated between the vertices. */
#ifndef SESSION_SMOOTH_H
#define SESSION_SMOOTH_H

#include "session_plan.h"
#include "session_team.h"

/* Computes the gradients at the vertices of the cells that isosurfaces with smooth normals cross. Each gradient is
 * computed from the cells around the vertex on all ranks, and is bit-identical for any partition. Vertices are equal,
 * also on different ranks, if their keys are equal: their global ids or, without ids, the bits of their coordinates
 * (session_keys.h). extent: the global bounds. session_update_home_ranks() must have been called, because session_homes
 * contains the ranks near this rank, which may have cells at the same vertices. Collective. All ranks return the same
 * status. An error that occurs on this rank after the last communication is only stored in *error, and the next phase
 * passes it to all ranks. */
insitu_status session_find_smooth_gradients(const session_plan *plan, const session_catalogue *catalogue,
                                            const session_meshes *meshes, const session_team *team,
                                            const session_extent *extent, base_error *error);

/* Returns whether an isosurface of the plan has smooth normals. */
bool session_plan_has_smooth_normals(const session_plan *plan, const session_catalogue *catalogue);

/* Returns whether the normals of the isosurface are interpolated between vertices. This is the case if the scene
 * requests smooth normals. It is also the case if the scene requests normals from gradients, and one of the layer's
 * meshes has cells of higher order with values at nodes. In such cells, the gradient in a linear piece is not that of
 * the cell's polynomial, while gradients at nodes are. The result is the same on all ranks. */
bool session_has_smooth_normals(const scene_isosurface *layer, const session_catalogue *catalogue);

/* Returns whether outer surfaces have normals at vertices. This is the case if some mesh has bent cells of higher
 * order, because the faces of such cells may be curved. The result is the same on every rank. */
bool session_has_curved_faces(const session_catalogue *catalogue);

#endif
