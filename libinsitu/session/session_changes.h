/* Finds what has changed on any rank since the last step, and whether the ranks' input fits together. */
#ifndef SESSION_CHANGES_H
#define SESSION_CHANGES_H

#include "session.h"

/* The same on every rank. */
typedef struct session_changes {
    int64_t cycle, lowest_cycle; /* equal, unless ranks disagree */
    double time;                 /* rank 0's */
    int failed_rank;             /* the lowest whose set calls left an error behind; -1: none */
    bool of_scene, of_cells, of_names;
    bool are_names_shared; /* all ranks have the same tables of names */
    bool are_threads_lacking;
    bool are_unwritten; /* pictures of earlier steps */
    bool is_filled;     /* some field's values are made on demand: what fills it may call MPI */
    bool writes_behind; /* this step's pictures are written when it is over */
    int isa_level;      /* the lowest of the ranks' instruction sets (render_isa.h) */
    int isa_rank;       /* the lowest rank that has no better */
    int isa_best;       /* the highest of the ranks' */
    int telling_rank;   /* the lowest that has warnings for all ranks; -1: none */
} session_changes;

/* One small reduction. Collective. */
insitu_status session_find_changes(const insitu_session *session, int64_t cycle, double time, session_changes *out,
                                   base_error *error);

/* Tell every rank the error that a set call left behind on one, in *refused: images that need neither the mesh nor the
 * field can be drawn. Ranks at different cycles are the error that is returned. Collective. */
insitu_status session_check_input(const session_changes *changes, const session_meshes *meshes,
                                  const session_team *team, base_error *refused, base_error *error);

#endif
