/* Vertices that hang on a larger cell's face, and their values.
 *
 * Where cells are refined, a vertex of small cells lies on a quad of a large cell, or on its edge, and is no vertex of
 * that cell. The mean over the cells around such a vertex is not what the large cell has there, so that an isosurface
 * would be torn; the value that it takes instead is the quad's own, bilinear in its corners.
 *
 * A quad that one cell alone has, over all ranks, may bear hanging vertices; the vertices are among those of faces that
 * a rank has once. A vertex hangs on the largest quad that holds it, if that is larger than all quads that have it as a
 * corner. Quads' corners may hang themselves, on larger quads still. Which quad it is, and where on it a vertex is, is
 * found from places alone, the same on all ranks. */
#ifndef SESSION_HANGING_H
#define SESSION_HANGING_H

#include "session_catalogue.h"
#include "session_exchange.h"

/* This rank's vertices, those that are the same one in one group. */
typedef struct session_hanging_basis {
    const session_mesh *mesh; /* NULL: this rank has no part */
    const session_homes *homes;
    const int64_t *of_vertex; /* the group of each vertex; -1: of no drawn cell */
    int64_t group_count;
} session_hanging_basis;

/* Finds the hanging vertices where they are not known. Collective, agreed. */
insitu_status session_update_hanging(session_hanging *hanging, const session_hanging_basis *basis,
                                     const session_team *team, base_error *error);

/* Gives hanging vertices their quads' values. means: of the groups. Where a quad's own values are not finite, vertices
 * keep theirs. Collective, agreed. */
insitu_status session_constrain_hanging(const session_hanging *hanging, const session_team *team, double *means,
                                        base_error *error);

#endif
