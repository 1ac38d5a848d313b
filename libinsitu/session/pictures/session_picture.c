#include "session_picture.h"

#include "memory.h"

void session_drop_picture(session_picture *picture)
{
    base_free(picture->pixels);
    *picture = (session_picture){0};
}

float *session_reserve_picture(session_picture *picture, size_t bytes)
{
    if (picture->bytes >= bytes) return picture->pixels;
    session_drop_picture(picture);
    picture->pixels = base_alloc(bytes);
    picture->bytes = picture->pixels ? bytes : 0;
    return picture->pixels;
}
