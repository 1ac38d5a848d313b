/* Determines what has changed on any rank since the previous step, and whether the ranks' input is consistent. */
#ifndef SESSION_CHANGES_H
#define SESSION_CHANGES_H

#include "session.h"

/* The result of the reduction; it is the same on every rank. */
typedef struct session_changes {
    /* highest and lowest cycle of all ranks; they are equal if all ranks are at the same cycle */
    int64_t cycle, lowest_cycle;
    double time;     /* time of the step on rank 0 */
    int failed_rank; /* lowest rank on which an insitu_set_*() call has failed; -1: none */
    /* Each member is set if something has changed on some rank since the previous step. is_scene_changed: the scene
     * file; are_cells_changed: cells or coordinates; are_names_changed: names of meshes or fields. */
    bool is_scene_changed, are_cells_changed, are_names_changed;
    bool are_levels_changed;     /* set if blocks with levels of refinement have changed on some rank */
    bool are_names_shared;       /* set if all ranks have the same names of meshes and fields */
    bool needs_more_threads;     /* set if some rank has too few threads and must start more */
    bool has_unwritten_pictures; /* set if pictures of earlier steps could not be written */
    /* set if some field has a fill function (a function of the caller that computes its values), which may call MPI */
    bool is_filled;
    bool writes_behind; /* set if this step's pictures are written after the step is over */
    int isa_level;      /* lowest instruction set of any rank (render_isa.h) */
    int isa_rank;       /* lowest rank that has the instruction set isa_level */
    int isa_best;       /* highest instruction set of any rank */
    int reporting_rank; /* lowest rank that has warnings for all ranks; -1: none */
} session_changes;

/* Determines what has changed on any rank, by one small reduction. Collective. */
insitu_status session_reduce_changes_over_ranks(const insitu_session *session, int64_t cycle, double time,
                                                session_changes *out, base_error *error);

/* Sends the error of a failed insitu_set_*() call from the lowest failed rank to all ranks, in *refused. The step
 * continues, because images that need neither the mesh nor the field can still be drawn. Returns an error if ranks are
 * at different cycles. Collective. */
insitu_status session_check_errors_and_cycle(const session_changes *changes, const session_meshes *meshes,
                                             const session_team *team, base_error *refused, base_error *error);

#endif
