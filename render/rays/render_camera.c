#include <math.h>

#include "render.h"

/* Returns the length of a vector. hypot() is used because it also works for vectors whose squares overflow or
 * underflow. */
static double length3(const double v[3])
{
    return hypot(hypot(v[0], v[1]), v[2]);
}

static void cross3(const double a[3], const double b[3], double out[3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

bool render_camera_look_at(render_camera *camera, const double eye[3], const double focal[3], const double up[3],
                           double vertical_degrees, int width, int height)
{
    render_camera c = {.width = width, .height = height};
    double size = 0;
    for (int a = 0; a < 3; a++) {
        c.eye[a] = eye[a];
        c.forward[a] = focal[a] - eye[a];
        size = fmax(size, fmax(fabs(eye[a]), fabs(focal[a])));
    }
    const double distance = length3(c.forward), up_length = length3(up);
    if (!(distance > 1e-14 * size) || !(up_length > 0)) return false;
    for (int a = 0; a < 3; a++) c.forward[a] /= distance;
    cross3(c.forward, up, c.right);
    const double sine = length3(c.right) / up_length;
    if (!(sine > 1e-9)) return false;
    for (int a = 0; a < 3; a++) c.right[a] /= sine * up_length;
    cross3(c.right, c.forward, c.up);
    c.half_height = tan(vertical_degrees * (3.14159265358979323846 / 360.0));
    *camera = c;
    return true;
}

void render_camera_ray(const render_camera *camera, int x, int y, double base[3], double direction[3])
{
    const double pixel = 2 * camera->half_height / camera->height;
    const double px = (x + (0.5 + camera->offset[0]) - 0.5 * camera->width) * pixel;
    const double py = (0.5 * camera->height - (y + (0.5 + camera->offset[1]))) * pixel;
    for (int a = 0; a < 3; a++) {
        const double sideways = px * camera->right[a] + py * camera->up[a];
        base[a] = camera->eye[a] + (camera->is_orthographic ? sideways : 0);
        direction[a] = camera->forward[a] + (camera->is_orthographic ? 0 : sideways);
    }
}

/* The pixel is divided into count × count squares. Sample k lies at the middle of a square in column k, and each row of
 * squares has one sample. Samples of neighbouring columns lie in rows that are far apart. */
void render_camera_sample(int count, int k, double offset[2])
{
    static const unsigned char few[4] = {1, 3, 0, 2};
    const int row = count <= 2 ? k : count == 4 ? few[k] : count == 8 ? 3 * k % 8 : 5 * k % 16;
    offset[0] = (k + 0.5) / count - 0.5;
    offset[1] = (row + 0.5) / count - 0.5;
}

/* Returns a bijective hash of 32 bits, made of two rounds of multiplying and shifting. */
static uint32_t hash_integer(uint32_t h)
{
    h ^= h >> 16;
    h *= 0x21f0aaadu;
    h ^= h >> 15;
    h *= 0xd35a2d97u;
    h ^= h >> 15;
    return h;
}

double render_jitter(uint32_t pixel, uint32_t frame)
{
    return (hash_integer(hash_integer(pixel) + 0x9e3779b9u * (frame + 1)) >> 8) * (1.0 / 16777216.0);
}
