/* Defines a small image and its camera (the view), for tests of sessions that compute the expected pixels in closed
 * form. */
#ifndef TEST_SESSION_VIEW_H
#define TEST_SESSION_VIEW_H

#include "render.h"

enum { WIDTH = 48, HEIGHT = 36, PIXELS = WIDTH * HEIGHT };

#define EYE "    camera: {position: [3, 2.2, 4], focal: [0, 0, 0], angle: 40}\n"

/* The beginning of a scene of one image, with `more` further keys of the image. The layers and IMAGE_END must
 * follow. */
#define IMAGE_BEGIN(more)                                                                                              \
    "images:\n  - name: a\n    size: [48, 36]\n    background: [0, 0, 0, 0]\n" EYE more "    layers:\n"
#define IMAGE_END "    outputs: [{path: a.exr}]\n"
#define IMAGE(layers) IMAGE_BEGIN("") layers IMAGE_END

/* The line base + t direction. */
typedef struct ray {
    double base[3], direction[3];
} ray;

/* Returns the ray through the pixel's centre. */
static inline ray make_pixel_ray(int pixel)
{
    render_camera camera;
    ray out;
    render_camera_look_at(&camera, (const double[]){3, 2.2, 4}, (const double[]){0, 0, 0}, (const double[]){0, 1, 0},
                          40, WIDTH, HEIGHT);
    render_camera_ray(&camera, pixel % WIDTH, pixel / WIDTH, out.base, out.direction);
    return out;
}

#endif
