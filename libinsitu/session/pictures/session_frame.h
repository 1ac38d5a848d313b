/* One frame on all ranks: tracing, compositing, and correction of the pixels in which cells overlap. */
#ifndef SESSION_FRAME_H
#define SESSION_FRAME_H

#include "comp.h"
#include "render.h"

/* Cost of a frame on this rank; only overlaps and turns are the same on every rank. */
typedef struct session_frame {
    int64_t rays, map_failures, fragments;
    double surface_ms, volume_ms, composite_ms;
    int64_t overlaps; /* number of pixels in which cells overlap */
    int turns;        /* number of turns in which these pixels are drawn */
    int64_t sent_bytes;
    comp_schedule schedule;             /* COMP_AUTOMATIC: nothing went to other ranks */
    struct render_occluders *occluders; /* made by the first drawing that needs them; NULL once the frame is drawn */
} session_frame;

/* Where and how a frame is drawn. */
typedef struct session_frame_target {
    MPI_Comm comm;
    comp_group compositing;
    const float *background; /* 4; borrowed */
    int64_t fragment_limit;  /* most fragments the busiest rank may make at once for pixels in which cells overlap;
                                beyond it these pixels are drawn in turns. The same on every rank */
} session_frame_target;

/* Draws one frame of the job into out (comp.h). The ranks' jobs may differ only in their parts. Collective; returns the
 * same status on all ranks. */
insitu_status session_draw_frame(const session_frame_target *t, const render_job *job, image *out, session_frame *frame,
                                 base_error *error);

#endif
