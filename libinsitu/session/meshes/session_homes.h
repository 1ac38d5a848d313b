/* Where ranks meet about what several of them have: vertices and faces on the borders between their parts of a mesh.
 * Each such thing has a home, a rank that all who have it know without a word, and that lies near them: so what a rank
 * sends to how many does not grow with the number of ranks.
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

/* What a rank knows of a mesh's parts on all ranks. */
typedef struct session_homes {
    bool is_known, by_id;
    int rank;
    /* Ranks, this one among them, whose drawn cells' box meets that of this one's, in their order. Each is one of the
     * others' too. None where there are no cells here. Boxes are widened a little where there are ids. */
    int near_count;
    int *near;
    session_box *boxes;
    /* By id: where shares begin, and whose they are. */
    int share_count;
    int64_t *firsts;
    int *owners;
} session_homes;

void session_homes_free(session_homes *homes);

/* mesh: this rank's part, NULL: it has none. half_diagonal: of the scene. Collective, agreed. */
insitu_status session_homes_find(session_homes *homes, const struct session_mesh *mesh, bool by_id,
                                 double half_diagonal, const struct session_team *team, base_error *error);

/* Does the point lie in another rank's box? */
bool session_homes_share(const session_homes *homes, const double point[3]);

/* The home of what has vertices at so many points, at least one, in this rank's box. id: the least of its vertices', of
 * which hash is made without ids. */
int session_home(const session_homes *homes, const double (*points)[3], int count, uint64_t hash, int64_t id);

#endif
