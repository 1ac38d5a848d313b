/* Montages, which are several pictures side by side in one file (outputs with a grid), and insets over their corners.
 *
 * The writing thread receives a step's pictures one after the other. It draws the decorations of each and copies it
 * into its panel, or over a corner of the panels if it is an inset. After the last picture of the step, the whole
 * picture is written. A panel whose picture is not due, or could not be drawn, remains transparent.
 *
 * If the panels share their colour bars, they are drawn after the last picture, because only then it is known whether
 * all bars are the same. If so, the panels are drawn without them, and the bars in a strip beside the panels. */
#ifndef SESSION_MONTAGE_H
#define SESSION_MONTAGE_H

#include "error.h"
#include "insitu/image_output.h"
#include "scene.h"
#include "session_decorations.h"

typedef struct session_montage {
    float *rgba;      /* the whole picture, with the size set in the scene; NULL: it has not been allocated yet */
    char *path;       /* path of the file for this step */
    bool has_picture; /* set if a picture of this step is in it; otherwise no file is written */
    /* If colour bars are shared: the decorations of each panel, a copy, with which the panel is drawn when those of all
     * panels are known; until then rgba has the panel without them. NULL: the panel has no picture in this step */
    session_decorations **panels;
    int panel_count; /* number of panels; 0 if there are none */
} session_montage;

/* The montages on rank 0. The writing thread owns them while pictures are in its queue. */
typedef struct session_montages {
    int count;
    session_montage *items; /* one for each montage of the scene; NULL before the first picture */
} session_montages;

/* Draws the picture into its panel or as an inset. decorations: those of the picture, or NULL. path is the path of the
 * file; the montage takes ownership of it. Local. */
insitu_status session_add_panel(session_montages *montages, const scene *scene, const scene_image *image,
                                const scene_output *output, const insitu_image *picture,
                                const session_decorations *decorations, char *path, base_error *error);

/* Writes the montages that have panels of this step, even if some fail. The first error is returned. Local. */
insitu_status session_write_montages(session_montages *montages, const scene *scene, base_error *error);

void session_montages_free(session_montages *montages);

#endif
