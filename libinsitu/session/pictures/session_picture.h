/* Rank 0's memory of the last picture, for the next one: fresh pages cost as much as filling them. */
#ifndef SESSION_PICTURE_H
#define SESSION_PICTURE_H

#include <stddef.h>

typedef struct session_picture {
    float *pixels;
    size_t bytes;
} session_picture;

/* At least so many bytes; NULL where there is no memory. What they hold is undefined. */
float *session_reserve_picture(session_picture *picture, size_t bytes);

void session_drop_picture(session_picture *picture);

#endif
