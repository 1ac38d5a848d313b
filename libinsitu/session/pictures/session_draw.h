/* Draws the images that are due in a step (session_plan.h), and passes the pictures to the writer of rank 0
 * (session_writer.h). An image is an entry of the scene's `images`; a picture is the result of drawing it in a step. */
#ifndef SESSION_DRAW_H
#define SESSION_DRAW_H

#include "session_catalogue.h"
#include "session_cinema.h"
#include "session_mesh.h"
#include "session_montage.h"
#include "session_overwrites.h"
#include "session_picture.h"
#include "session_plan.h"
#include "session_report.h"
#include "session_run_ranges.h"
#include "session_space.h"
#include "session_team.h"
#include "session_writer.h"

/* Comparison of the colour bars of a montage's pictures during a step. It is used if the scene requests that the
 * pictures share their bars. */
typedef struct session_shared_bars {
    const char *path;    /* path of the output, with placeholders; NULL: no picture has been drawn yet */
    uint64_t hash;       /* session_decorations.bars_hash of the first picture */
    bool has_other_bars; /* set if the bars of a later picture differ from those of the first */
} session_shared_bars;

/* Input for drawing images. */
typedef struct session_drawing {
    const session_team *team;
    const char *scene_path; /* path of the scene file, for messages */
    int64_t cycle;
    const session_meshes *meshes; /* this rank's meshes; their bounding volume hierarchies are up to date */
    const mmbvh *parent; /* bounding volume hierarchy whose leaves are the trees of the mesh parts (session_trees.h) */
    const session_space *space;
    session_run_ranges *run_ranges;
    session_report *report;
    session_kept_pictures *kept;
    const scene *scene;
    session_cinema *cinema;     /* used on rank 0 only */
    session_montages *montages; /* used on rank 0 only */
    session_overwrites *overwrites;
    session_writer *writer; /* used on rank 0 only */
    const session_catalogue *catalogue;
    bool writes_behind; /* set if pictures are written by a thread after the step has ended */
    /* one entry for each montage of the scene, on rank 0, while session_draw_images() runs; otherwise NULL */
    session_shared_bars *shared_bars;
} session_drawing;

/* Draws the plan's images and passes the pictures to the writer. An image that fails is skipped. Returns the error of
 * the plan if there is one, and otherwise the first error of an image. *drawn receives a bit mask of the images that
 * were drawn: bit n stands for the image with index n in the scene file. Collective. */
insitu_status session_draw_images(const session_drawing *drawing, const session_plan *plan, uint64_t *drawn,
                                  base_error *error);

#endif
