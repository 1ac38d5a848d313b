/* Determines home ranks. Several ranks share items: the vertices and faces on the borders between the ranks' parts of a
 * mesh. The home of an item is the rank that combines the data of all ranks that have the item. It is a rank near the
 * item, and all ranks that have the item can determine it without communication. Therefore neither the size of a rank's
 * messages nor the number of their receivers grows with the number of ranks.
 *
 * If items are identified by coordinates, which are bitwise equal on all ranks, the home is one of the ranks in whose
 * box all of the item's vertices lie; a hash of the item selects one of them. If items are identified by global ids,
 * their coordinates may differ in the last bits, so the ids are divided among the ranks instead. With P ranks, the
 * range of ids of rank r starts at the (r + 1/2) / P quantile of the ids of its own vertices. This range is near the
 * rank's own ids if ranks number their vertices consecutively, and the ranges are evenly distributed if ids are
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

/* The data by which a rank finds the homes of items of one or several meshes. */
typedef struct session_homes {
    bool is_computed; /* set if all other members of the homes are up to date */
    bool by_id;       /* set if homes are found by global vertex ids, and not by positions */
    int rank;         /* this rank */
    /* The ranks near this rank, including this rank, in ascending order: ranks whose bounding box of drawn cells
     * intersects that of this rank. The relation is symmetric. A rank without cells has no near ranks. Boxes are
     * extended by 2e-5 of the scene's half diagonal, so that the boxes of a vertex and of a face on which it lies up to
     * rounding intersect. */
    int near_count;
    int *near_ranks;
    session_box *boxes; /* bounding box of each near rank */
    /* Used if by_id is set: global ids are divided into share_count ranges. Range i begins with the id first_ids[i],
     * and owners[i] is the home rank of the vertices with ids in the range. */
    int share_count;
    int64_t *first_ids;
    int *owners;
} session_homes;

void session_homes_free(session_homes *homes);

/* Computes the data by which the homes of the vertices and faces of one or several meshes are found. meshes: this
 * rank's `count` parts of these meshes; an entry is NULL if this rank has no part of that mesh. by_id is allowed only
 * for a single mesh. half_diagonal: half of the diagonal of the scene's bounds. Collective; all ranks return the same
 * status. */
insitu_status session_compute_home_ranks(session_homes *homes, const struct session_mesh *const *meshes, int count,
                                         bool by_id, double half_diagonal, const struct session_team *team,
                                         base_error *error);

/* Returns whether the point lies inside the box or on its border. */
bool session_is_in_box(const session_box *box, const double point[3]);

/* Returns whether the point lies in the box of another rank. */
bool session_is_in_other_box(const session_homes *homes, const double point[3]);

/* Returns the home rank of an item. points: positions of the item's vertices (at least one), which lie in this rank's
 * box. id: smallest global id of the item's vertices, used if homes->by_id is set. hash: hash of the item, which
 * selects the home otherwise. */
int session_find_home_rank(const session_homes *homes, const double (*points)[3], int count, uint64_t hash, int64_t id);

#endif
