/* Draws the plan's images on rank 0. */
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

/* Input of images. */
typedef struct session_drawing {
    const session_team *team;
    const char *scene_path; /* for messages */
    int64_t cycle;
    const session_meshes *meshes; /* with their trees */
    const mmbvh *parent;          /* over these trees (session_trees.h) */
    const session_space *space;
    session_run_ranges *run_ranges;
    session_report *report;
    session_kept_pictures *kept;
    const scene *scene;
    session_cinema *cinema;     /* rank 0's */
    session_montages *montages; /* rank 0's */
    session_overwrites *overwrites;
    session_writer *writer; /* on rank 0 */
    const session_catalogue *catalogue;
    bool writes_behind; /* pictures are written after the step is over */
} session_drawing;

/* Draws the plan's images and passes them to the writer. An image that fails is skipped. Returns the plan's refusal if
 * there is one, else the first failure. *drawn: set to the bits, by number of the image in the file, of the images that
 * were drawn. Collective. */
insitu_status session_draw_images(const session_drawing *d, const session_plan *plan, uint64_t *drawn,
                                  base_error *error);

#endif
