/* Rank 0's memory of the last picture, reused for the next one: new pages cost as much as filling them. */
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

/* Ensures at least `bytes` bytes, uninitialized, and returns them; NULL if there is no memory. */
float *session_reserve_picture(session_picture *picture, size_t bytes);

void session_drop_picture(session_picture *picture);

/* The pictures of the last step for the caller: copies on rank 0. */
typedef struct session_kept_pictures {
    bool is_on; /* the same on every rank, because all images then have depth */
    int count;
    /* names belong to the scene; pixels and depth of each picture are one block */
    insitu_picture items[SCENE_MAX_PICTURES];
} session_kept_pictures;

/* Copies a picture that has depth. Local. */
insitu_status session_keep_picture(session_kept_pictures *kept, const scene_image *image, const struct image *picture,
                                   base_error *error);

void session_drop_kept(session_kept_pictures *kept);

#endif
