/* The homes of what several ranks have: vertices and faces on the borders between their parts of a mesh. The home of
 * such a thing is a rank near it, which all ranks that have the thing can find without a message. So neither the mail
 * of a rank nor the number of ranks that it writes to grows with the number of ranks.
 *
 * By coordinates, which are the same bits on all ranks: one of the ranks in whose box all its vertices lie, chosen by
 * its hash. By global ids, with which coordinates may differ in their last bits: ranks divide the ids among them. Each
 * of P ranks begins its share at an id of its own, the r-th rank at the r-th of P quantiles of its ids: near its own
 * where ranks number their vertices one after the other, and evenly spread where ids are dealt out at random. */
#ifndef SESSION_HOMES_H
#define SESSION_HOMES_H

#include <stdbool.h>
#include <stdint.h>

#include "error.h"
#include "insitu/status.h"

struct session_mesh;
struct session_team;

typedef struct session_box {
    double lower[3], upper[3];
} session_box;

/* A rank's knowledge of the parts, on all ranks, of a mesh or of several. */
typedef struct session_homes {
    bool is_known, by_id;
    int rank;
    /* The ranks whose drawn cells' box meets this rank's, itself among them, in ascending order. If a rank is near
     * another, that one is near it. A rank without cells has none. Boxes are widened by 2e-5 of the scene's half
     * diagonal, so that a vertex and what it lies on but for rounding are near each other. */
    int near_count;
    int *near;
    session_box *boxes;
    /* By id: the first id of each share, and the rank that owns it. */
    int share_count;
    int64_t *firsts;
    int *owners;
} session_homes;

void session_homes_free(session_homes *homes);

/* meshes: this rank's parts, NULL: of one it has none; of several meshes they are taken as one. by_id: of one mesh
 * alone. half_diagonal: of the scene. Collective, agreed. */
insitu_status session_homes_find(session_homes *homes, const struct session_mesh *const *meshes, int count, bool by_id,
                                 double half_diagonal, const struct session_team *team, base_error *error);

/* Tells whether the point lies in the box, whose border belongs to it. */
bool session_is_in_box(const session_box *box, const double point[3]);

/* Tells whether the point lies in another rank's box. */
bool session_homes_share(const session_homes *homes, const double point[3]);

/* Returns the home of a thing whose vertices are at these points, at least one, in this rank's box. id is the least of
 * its vertices' ids; without ids the home follows from hash. */
int session_home(const session_homes *homes, const double (*points)[3], int count, uint64_t hash, int64_t id);

#endif
