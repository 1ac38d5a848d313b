/* Manages the memory of pictures on rank 0. A picture is the result of drawing an image of the scene in a step. The
 * memory of the previous picture is reused for the next picture, because allocating new pages takes as long as filling
 * them. */
#ifndef SESSION_PICTURE_H
#define SESSION_PICTURE_H

#include <stdbool.h>
#include <stddef.h>

#include "error.h"
#include "image.h"
#include "insitu/insitu.h"
#include "scene.h"

typedef struct session_picture {
    float *pixels;
    size_t bytes;
} session_picture;

/* Ensures that the picture has at least `bytes` bytes, which are uninitialized, and returns them. Returns NULL if
 * memory runs out. */
float *session_reserve_picture(session_picture *picture, size_t bytes);

void session_drop_picture(session_picture *picture);

/* Copies of the most recent step's pictures, for the caller to read. They exist on rank 0 only. */
typedef struct session_kept_pictures {
    bool is_enabled; /* true: pictures are kept, so that all images need depth. The same on every rank */
    int count;
    /* pictures; their names belong to the scene, and pixels and depth of each are one block of memory */
    insitu_picture items[SCENE_MAX_PICTURES];
} session_kept_pictures;

/* Stores a copy of a picture that has depth. Local. */
insitu_status session_keep_picture(session_kept_pictures *kept, const scene_image *image, const struct image *picture,
                                   base_error *error);

void session_free_kept_pictures(session_kept_pictures *kept);

#endif
