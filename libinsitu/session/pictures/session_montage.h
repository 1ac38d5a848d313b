/* Pictures side by side in one: outputs with a grid.
 *
 * The writing thread, which has a step's pictures one after the other, decorates each as it comes and copies it into
 * its cell. Behind the last of the step the whole is written. A cell whose picture is not due, or could not be drawn,
 * stays transparent. */
#ifndef SESSION_MONTAGE_H
#define SESSION_MONTAGE_H

#include "error.h"
#include "insitu/image_output.h"
#include "scene.h"

typedef struct session_montage {
    float *rgba; /* the whole picture, of the scene's width and height; NULL: no cell of this step has come */
    char *path;
} session_montage;

/* Rank 0's, in the hands of the writing thread while pictures wait for it. */
typedef struct session_montages {
    int count;
    session_montage *items; /* one a montage of the scene; NULL before the first picture */
} session_montages;

/* Puts the picture into its cell. path: the file's, which is taken over. Local. */
insitu_status session_add_cell(session_montages *montages, const scene *scene, const scene_image *image,
                               const scene_output *output, const insitu_image *picture, char *path, base_error *error);

/* Write those that cells have come for, though some fail; the first error is kept. Local. */
insitu_status session_write_montages(session_montages *montages, const scene *scene, base_error *error);

void session_montages_free(session_montages *montages);

#endif
