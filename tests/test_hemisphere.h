/* Ambient occlusion rays as docs/development/decisions/surface.md defines them, implemented independently of the
 * library. Directions are points of a spiral on the disk under the hemisphere, with equal areas between its steps. The
 * spiral's rotation and start depend on the pixel. */
#ifndef TEST_HEMISPHERE_H
#define TEST_HEMISPHERE_H

#include <math.h>
#include <stdint.h>

#include "render.h"

/* Computes the direction of sample k of `samples` samples above the normal n, for a pixel of a picture of the given
 * width. */
static inline void test_hemisphere_direction(uint32_t pixel, uint32_t width, int samples, int k, const double n[3],
                                             double out[3])
{
    const double pi = acos(-1.0), x = pixel % width, y = pixel / width;
    const double noise = fmod(52.9829189 * fmod(0.06711056 * x + 0.00583715 * y, 1), 1);
    const double share = fmin((k + render_jitter(pixel, 0)) / samples, 1 - 1.0 / 1024);
    const double angle = 2 * pi * noise + k * pi * (3 - sqrt(5));
    const double sign = n[2] < 0 ? -1 : 1, a = -1 / (sign + n[2]), b = n[0] * n[1] * a;
    const double right[3] = {1 + sign * n[0] * n[0] * a, sign * b, -sign * n[0]};
    const double up[3] = {b, sign + n[1] * n[1] * a, -n[1]};
    for (int i = 0; i < 3; i++)
        out[i] = sqrt(share) * (cos(angle) * right[i] + sin(angle) * up[i]) + sqrt(1 - share) * n[i];
}

#endif
