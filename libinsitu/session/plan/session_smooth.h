/* Computes gradients at vertices, for isosurfaces whose normals are interpolated between them. */
#ifndef SESSION_SMOOTH_H
#define SESSION_SMOOTH_H

#include "session_plan.h"
#include "session_team.h"

/* Computes, for the isosurfaces of the plan that have smooth normals, the gradients at the vertices of the cells that
 * they cross. Each is computed over the cells around the vertex on all ranks, with the same bits on any partition.
 * Vertices are equal by the same keys as in recentring. extent: the global bounds. The homes of the catalogue's meshes
 * must be up to date. An error of this rank at the very end is stored only in *error, for the next phase to agree on.
 * Collective, otherwise agreed. */
insitu_status session_smooth(const session_plan *plan, const session_catalogue *catalogue, const session_meshes *meshes,
                             const session_team *team, const session_extent *extent, base_error *error);

/* Returns whether an isosurface of the plan has smooth normals. */
bool session_is_smooth(const session_plan *plan, const session_catalogue *catalogue);

/* Returns whether the normals of the isosurface are smooth: if the scene asks for them, or if it asks for gradients and
 * one of the layer's meshes has cells of higher order with values at nodes. The gradient in a piece of such a cell is
 * not that of its polynomial; gradients at nodes are. The same on all ranks. */
bool session_has_smooth_normals(const scene_isosurface *layer, const session_catalogue *catalogue);

#endif
