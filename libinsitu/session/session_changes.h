/* Determines what has changed on any rank since the last step, and whether the ranks' input is consistent. */
#ifndef SESSION_CHANGES_H
#define SESSION_CHANGES_H

#include "session.h"

/* Result of the reduction; the same on every rank. */
typedef struct session_changes {
    int64_t cycle, lowest_cycle; /* equal, unless ranks disagree */
    double time;                 /* time of rank 0 */
    int failed_rank;             /* the lowest rank with an error of a set call; -1: none */
    bool of_scene, of_cells, of_names;
    bool of_levels;        /* of blocks with levels of refinement */
    bool are_names_shared; /* all ranks have the same tables of names */
    bool are_threads_lacking;
    bool are_unwritten; /* pictures of earlier steps could not be written */
    bool is_filled;     /* some field has a fill function, which may call MPI */
    bool writes_behind; /* this step's pictures are written after it is over */
    int isa_level;      /* the lowest of the ranks' instruction sets (render_isa.h) */
    int isa_rank;       /* the lowest rank with that set */
    int isa_best;       /* the highest of the ranks' instruction sets */
    int telling_rank;   /* the lowest rank that has warnings for all ranks; -1: none */
} session_changes;

/* Performs one small reduction. Collective. */
insitu_status session_find_changes(const insitu_session *session, int64_t cycle, double time, session_changes *out,
                                   base_error *error);

/* Sends the error of one rank's set call to every rank, in *refused: images that need neither the mesh nor the field
 * can still be drawn. Returns an error if ranks are at different cycles. Collective. */
insitu_status session_check_input(const session_changes *changes, const session_meshes *meshes,
                                  const session_team *team, base_error *refused, base_error *error);

#endif
