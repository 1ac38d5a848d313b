/* Draws one frame on all ranks: traces rays, composites, and redraws the pixels in which cells overlap. */
#ifndef SESSION_FRAME_H
#define SESSION_FRAME_H

#include "comp.h"
#include "render.h"

/* The cost of a frame on this rank. Only `overlaps` and `turns` are the same on every rank. */
typedef struct session_frame {
    int64_t rays, map_failures, fragments;
    double surface_ms, volume_ms, composite_ms;
    int64_t overlaps; /* number of pixels in which cells overlap */
    /* number of turns in which pixels with overlaps were drawn; a turn is a pass over some of these pixels */
    int turns;
    int64_t sent_bytes;
    /* schedule of compositing that was used; COMP_AUTOMATIC: nothing was sent to other ranks */
    comp_schedule schedule;
    /* occluders for shadow and occlusion rays; created by the first turn that needs them, freed and set to NULL after
     * the frame is drawn */
    struct render_occluders *occluders;
} session_frame;

/* The ranks that draw a frame, and the settings that they share. */
typedef struct session_frame_target {
    MPI_Comm comm;
    comp_group compositing;
    const float *background; /* background colour, linear premultiplied RGBA; borrowed */
    /* maximum number of fragments that a rank may store at once for pixels in which cells overlap; if there are more,
     * these pixels are drawn in several turns. The same on every rank. */
    int64_t fragment_limit;
} session_frame_target;

/* Draws one frame of the job into the picture `out`, whose pixels are stored on rank 0 (comp_composite()). The jobs of
 * the ranks may differ only in their meshes (render_job.parts). Collective; returns the same status on all ranks. */
insitu_status session_draw_frame(const session_frame_target *t, const render_job *job, image *out, session_frame *frame,
                                 base_error *error);

#endif
