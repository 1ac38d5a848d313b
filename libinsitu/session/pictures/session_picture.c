#include "session_picture.h"

#include <string.h>

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

/* Copies the pixels. If the image has decorations, it was drawn without its background, which is added to the copy. */
static void copy_pixels_over_background(const scene_image *image, const struct image *picture, size_t pixels,
                                        float *rgba)
{
    static const float none[4] = {0, 0, 0, 0};
    const float *behind = image->decorations.is_given ? image->background : none;
    for (size_t p = 0; p < pixels; p++) {
        const float *from = picture->rgba + 4 * p;
        const float through = 1 - from[3];
        for (int i = 0; i < 4; i++) rgba[4 * p + (size_t)i] = from[i] + through * behind[i];
    }
}

insitu_status session_keep_picture(session_kept_pictures *kept, const scene_image *image, const struct image *picture,
                                   base_error *error)
{
    const size_t pixels = (size_t)picture->width * (size_t)picture->height, bytes = pixels * 5 * sizeof(float);
    float *block = base_alloc(bytes);
    if (!block)
        return base_fail(error, INSITU_ERROR_MEMORY, "image \"%s\": no memory to keep it: %lld bytes", image->name,
                         (long long)bytes);
    copy_pixels_over_background(image, picture, pixels, block);
    memcpy(block + 4 * pixels, picture->depth, pixels * sizeof(float));
    kept->items[kept->count++] =
        (insitu_picture){image->name, picture->width, picture->height, block, block + 4 * pixels};
    return INSITU_OK;
}

void session_free_kept_pictures(session_kept_pictures *kept)
{
    for (int i = 0; i < kept->count; i++) base_free((void *)kept->items[i].rgba);
    kept->count = 0;
}
