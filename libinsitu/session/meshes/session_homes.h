/* Homes of items that several ranks have: vertices and faces on the borders between their parts of a mesh. The home of
 * an item is a rank near it, which all ranks that have the item can determine without communication. So neither a
 * rank's messages nor the number of ranks to which it sends grow with the number of ranks.
 *
 * By coordinates, which have the same bits on all ranks, the home is one of the ranks in whose box all of the item's
 * vertices lie, selected by its hash. By global ids, with which coordinates may differ in their last bits, ranks divide
 * the ids among them. The share of the r-th of P ranks begins at the r-th of P quantiles of its own ids: so its share
 * is near its own ids if ranks number their vertices consecutively, and shares are evenly distributed if ids are
 * random. */
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

/* A rank's knowledge of the parts, on all ranks, of one or several meshes. */
typedef struct session_homes {
    bool is_known, by_id;
    int rank;
    /* The ranks whose drawn cells' box meets this rank's, including itself, in ascending order; the relation is
     * symmetric. A rank without cells has none. Boxes are extended by 2e-5 of the scene's half diagonal, so that a
     * vertex and a face on which it lies up to rounding are near each other. */
    int near_count;
    int *near;
    session_box *boxes;
    /* If by_id: the first id of each share, and the rank that owns it. */
    int share_count;
    int64_t *firsts;
    int *owners;
} session_homes;

void session_homes_free(session_homes *homes);

/* Finds the homes. meshes: this rank's parts, NULL if it has no part of a mesh; several meshes are treated as one.
 * by_id: only for a single mesh. half_diagonal: of the scene. Collective, agreed. */
insitu_status session_homes_find(session_homes *homes, const struct session_mesh *const *meshes, int count, bool by_id,
                                 double half_diagonal, const struct session_team *team, base_error *error);

/* Returns whether the point lies in the box, including its border. */
bool session_is_in_box(const session_box *box, const double point[3]);

/* Returns whether the point lies in another rank's box. */
bool session_homes_share(const session_homes *homes, const double point[3]);

/* Returns the home of an item whose vertices are at these points (at least one), in this rank's box. id: the least of
 * its vertices' ids; without ids the home is determined by hash. */
int session_home(const session_homes *homes, const double (*points)[3], int count, uint64_t hash, int64_t id);

#endif
