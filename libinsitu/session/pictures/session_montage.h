/* Montages, which are several pictures side by side in one file (outputs with a grid), and insets over their corners.
 *
 * The writing thread receives a step's pictures one after the other. It draws the decorations of each panel and copies
 * it into its place. A panel whose picture is not due, or could not be drawn, remains transparent. After the last
 * picture of the step, insets are laid over the panels, and the whole picture is written. The decorations of a panel
 * keep clear of all insets of the scene, also of those that are not due, so that they are at the same places in all
 * steps.
 *
 * If the panels share their colour bars, they are drawn after the last picture, because only then it is known whether
 * all bars are the same. If so, the panels are drawn without them, and the bars in a strip beside the panels. An inset
 * does not decide whether bars are shared, but is drawn without its own if they are the same as those in the strip. */
#ifndef SESSION_MONTAGE_H
#define SESSION_MONTAGE_H

#include "error.h"
#include "insitu/image_output.h"
#include "scene.h"
#include "session_decorations.h"

/* The picture of an inset in this step. */
typedef struct session_inset {
    float *rgba;                      /* its pixels without decorations; NULL: there is no picture in this step */
    session_decorations *decorations; /* a copy; NULL: the picture has none */
    bool has_decorations;             /* set if all of them are drawn, otherwise only the background is */
} session_inset;

typedef struct session_montage {
    float *rgba;      /* the whole picture, with the size set in the scene; NULL: it has not been allocated yet */
    char *path;       /* path of the file for this step */
    bool has_picture; /* set if a picture of this step is in it; otherwise no file is written */
    /* If colour bars are shared: the decorations of each panel, a copy, with which the panel is drawn when those of all
     * panels are known; until then rgba has the panel without them. NULL: the panel has no picture in this step */
    session_decorations **panels;
    int panel_count;                     /* number of panels; 0 if there are none */
    session_inset insets[SCENE_ANCHORS]; /* one for each corner */
} session_montage;

/* The montages on rank 0. The writing thread owns them while pictures are in its queue. */
typedef struct session_montages {
    int count;
    session_montage *items; /* one for each montage of the scene; NULL before the first picture */
} session_montages;

/* Finds the parts of a panel, in its own pixels, that insets and their frames will cover. Returns their number. Local.
 */
int session_find_covered(const scene_montage *montage, int panel, insitu_rectangle covered[SCENE_ANCHORS]);

/* Draws the picture into its panel, or keeps it as an inset. decorations: those of the picture, or NULL. path is the
 * path of the file; the montage takes ownership of it. Local. */
insitu_status session_add_panel(session_montages *montages, const scene *scene, const scene_image *image,
                                const scene_output *output, const insitu_image *picture,
                                const session_decorations *decorations, char *path, base_error *error);

/* Writes the montages that have panels of this step, even if some fail. The first error is returned. Local. */
insitu_status session_write_montages(session_montages *montages, const scene *scene, base_error *error);

void session_montages_free(session_montages *montages);

#endif
