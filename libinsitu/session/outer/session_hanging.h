/* Vertices that hang on a larger cell's face, and their values.
 *
 * Where cells are refined, a vertex of small cells lies on a triangle or quad of a large cell, or on its edge, and is
 * no vertex of that cell. The mean over the cells around such a vertex is not what the large cell has there, so that an
 * isosurface would be torn; the value that it takes instead is the face's own, linear or bilinear in its corners.
 *
 * A face that one cell alone has, of all ranks' parts of its mesh, may bear hanging vertices; the vertices are among
 * those of faces that a rank has once. A vertex hangs on a face that holds it where faces with this vertex as a corner
 * look the other way and are all smaller: then it lies between a large cell and small ones, and not beside both, as on
 * a wall along which two meshes overlap. Of several such faces it takes the largest. Faces' corners may hang
 * themselves, on larger faces still. Which face it is, and where on it a vertex is, is found from places alone, the
 * same on all ranks, and in whichever mesh of a joint the face is. */
#ifndef SESSION_HANGING_H
#define SESSION_HANGING_H

#include "session_catalogue.h"
#include "session_exchange.h"

/* This rank's vertices, those that are the same one in one group. Vertices of the meshes of the joint, and the groups
 * of their drawn cells' vertices, are numbered through. */
typedef struct session_hanging_basis {
    session_joint *joint;
    const session_mesh *const *meshes; /* the joint's meshes; NULL: this rank has no part of one */
    const int64_t *firsts;             /* the number of each one's first vertex */
    const int64_t *of_vertex;          /* the group of each vertex; -1: of no drawn cell */
    int64_t group_count;
} session_hanging_basis;

/* Finds the joint's borders if they are not known, and for a joint of several meshes also which vertices are twins.
 * meshes: as above. Collective, agreed. */
insitu_status session_update_borders(session_joint *joint, const session_mesh *const *meshes, const session_team *team,
                                     base_error *error);

/* Finds the joint's hanging vertices where they are not known. Its borders are. Collective, agreed. */
insitu_status session_update_hanging(const session_hanging_basis *basis, const session_team *team, base_error *error);

/* Gives hanging vertices their faces' values. means: of the groups. Where a face's own values are not finite, vertices
 * keep theirs. Collective, agreed. */
insitu_status session_constrain_hanging(const session_hanging *hanging, const session_team *team, double *means,
                                        base_error *error);

#endif
