/* Vertices that hang on the face of a larger cell, and their values.
 *
 * Where a mesh is refined, a vertex of small cells lies on a triangle or quad of a large cell, or on its edge, without
 * being a vertex of that cell. The mean over the cells around such a vertex differs from the large cell's value there,
 * so that an isosurface would have gaps. Therefore the vertex takes the face's own value, which is linear or bilinear
 * in its corners' values.
 *
 * Vertices may hang on faces that only one cell has, over all ranks' parts of its mesh. Vertices that may hang are
 * those of faces that a rank has once. A vertex hangs on a face that contains it if faces with this vertex as a corner
 * face the opposite way and are all smaller: then it lies between a large cell and small ones, and not beside both, as
 * on a wall along which two meshes overlap. Of several such faces the largest is used. Faces' corners may hang
 * themselves, on still larger faces. The face, and the vertex's position on it, are determined from coordinates alone,
 * with the same result on all ranks, whichever mesh of a joint has the face. */
#ifndef SESSION_HANGING_H
#define SESSION_HANGING_H

#include "session_catalogue.h"
#include "session_exchange.h"

/* This rank's vertices; equal vertices are in one group. Vertices of the joint's meshes, and the groups of their drawn
 * cells' vertices, are numbered consecutively. */
typedef struct session_hanging_basis {
    session_joint *joint;
    int part_count;
    const session_mesh *const *meshes; /* this rank's parts of the joint's meshes */
    const int64_t *firsts;             /* per part, the number of its first vertex */
    const int64_t *of_vertex;          /* per vertex, its group; -1: it belongs to no drawn cell */
    int64_t group_count;
} session_hanging_basis;

/* Returns whether vertices of the joint that differ only by rounding are one: those of several meshes, and those of
 * levels of refinement. */
bool session_has_twins(const session_joint *joint);

/* Finds the joint's borders and the twins of its vertices if they are not known. parts: this rank's. Collective,
 * agreed. */
insitu_status session_update_borders(session_joint *joint, const session_joint_parts *parts, const session_team *team,
                                     base_error *error);

/* Updates the joint's hanging vertices, unless they are up to date. Its borders must be. Collective, agreed. */
insitu_status session_update_hanging(const session_hanging_basis *basis, const session_team *team, base_error *error);

/* Sets hanging vertices to their faces' values. means: of the groups. If a face's own values are not finite, its
 * hanging vertices keep theirs. Collective, agreed. */
insitu_status session_constrain_hanging(const session_hanging *hanging, const session_team *team, double *means,
                                        base_error *error);

#endif
