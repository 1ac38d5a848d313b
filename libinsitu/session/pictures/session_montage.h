/* Draws montages and insets. A montage consists of several pictures (panels) side by side in one file. An inset is a
 * picture over a corner of a montage.
 *
 * The writing thread receives a step's pictures one after the other. It draws the decorations of each panel and copies
 * the panel into its place. A panel remains transparent if its picture is not due or could not be drawn. After the last
 * picture of the step, the insets are drawn over the panels, and the montage is written. The decorations of a panel are
 * placed so that no inset of the scene covers them, even if the inset is not due, so that they have the same position
 * in all steps.
 *
 * If the panels are to share their colour bars, decorations are drawn after the last picture, because only then it
 * is known whether the bars of all panels are equal. If all are equal, the panels are drawn without bars, and the
 * common bars are drawn in a strip beside the panels. An inset does not influence whether bars are shared, but is
 * drawn without its own bars if they equal those in the strip. */
#ifndef SESSION_MONTAGE_H
#define SESSION_MONTAGE_H

#include "error.h"
#include "insitu/image_output.h"
#include "scene.h"
#include "session_decorations.h"

/* The picture of an inset in this step. */
typedef struct session_inset {
    float *rgba; /* pixels of the inset without decorations; NULL: the inset has no picture in this step */
    session_decorations *decorations; /* copy of the inset's decorations; NULL: the inset has no decorations */
    bool has_decorations;             /* set if all decorations are drawn; otherwise only the background is */
} session_inset;

typedef struct session_montage {
    float *rgba;      /* pixels of the montage; NULL: not allocated yet */
    char *path;       /* path of the file for this step */
    bool has_picture; /* true: the montage contains a picture of this step; false: no file is written */
    /* if bars are to be shared: a copy of the decorations of each panel. They are drawn when the decorations of all
     * panels are known; until then `rgba` contains the panels without decorations. NULL: the panel has no picture in
     * this step. */
    session_decorations **panels;
    int panel_count;                     /* number of entries of `panels`; 0 if it is NULL */
    session_inset insets[SCENE_ANCHORS]; /* the inset of each corner */
} session_montage;

/* The montages on rank 0. The writing thread owns them while pictures are in its queue. */
typedef struct session_montages {
    int count;
    session_montage *items; /* one for each montage of the scene; NULL before the first picture */
} session_montages;

/* Finds the areas of a panel, in pixels of the panel, that insets and their frames will cover. Returns the number of
 * areas. Local. */
int session_find_areas_under_insets(const scene_montage *montage, int panel, insitu_rectangle covered[SCENE_ANCHORS]);

/* Draws the picture into its panel, or stores it as an inset. decorations: the picture's decorations, or NULL. path:
 * the path of the file, of which the montage takes ownership. Local. */
insitu_status session_add_panel(session_montages *montages, const scene *scene, const scene_image *image,
                                const scene_output *output, const insitu_image *picture,
                                const session_decorations *decorations, char *path, base_error *error);

/* Writes the montages that have panels of this step, even if some fail. The first error is returned. Local. */
insitu_status session_write_montages(session_montages *montages, const scene *scene, base_error *error);

void session_montages_free(session_montages *montages);

#endif
