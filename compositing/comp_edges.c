#include "comp_edges.h"

/* Codes go nearly by the root of the light: |root a - root b| > c wherever (a - b)^2 > 2 c^2 (a + b), which takes no
 * root. */
static bool differ(const float *a, const float *b)
{
    const float limit = 0.0018f;
    bool any = false;
    for (int i = 0; i < 4; i++) any = any || (a[i] - b[i]) * (a[i] - b[i]) > limit * (a[i] + b[i]);
    return any;
}

static void compare(const image *picture, int64_t pixel, int64_t other, unsigned char *pixels)
{
    if (!differ(picture->rgba + 4 * pixel, picture->rgba + 4 * other)) return;
    pixel_set_add(pixels, pixel);
    pixel_set_add(pixels, other);
}

void comp_find_edges(const image *picture, unsigned char *pixels)
{
    const int64_t width = picture->width;
    for (int64_t y = 0; y < picture->height; y++)
        for (int64_t x = 0; x < width; x++) {
            const int64_t pixel = y * width + x;
            if (x + 1 < width) compare(picture, pixel, pixel + 1, pixels);
            if (y + 1 == picture->height) continue;
            compare(picture, pixel, pixel + width, pixels);
            if (x > 0) compare(picture, pixel, pixel + width - 1, pixels);
            if (x + 1 < width) compare(picture, pixel, pixel + width + 1, pixels);
        }
}
