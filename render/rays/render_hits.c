/* The rays into the hemisphere above a hit pass through points on a spiral in the unit disk, spaced by equal areas and
 * projected upwards to the hemisphere (Malley's method). So the density of rays is proportional to the cosine of the
 * angle to the normal, and the fraction of rays that no surface blocks is the hit's ambient light. For each pixel, the
 * spiral is rotated by an angle that differs from those of all neighbouring pixels (interleaved gradient noise, Jimenez
 * 2014), and its samples are shifted along it. Angle and shift depend only on the pixel and on the frame's number among
 * those that are averaged, so a surface that does not move has the same samples at every step. */
#include "render_hits.h"

#include <math.h>
#include <string.h>

#include "mmbvh.h"
#include "render.h"

static void normalize(double v[3])
{
    const double length = sqrt(hit_dot(v, v));
    for (int a = 0; a < 3; a++) v[a] /= length;
}

void hit_axes_around(const double n[3], double axes[3][3])
{
    const double sign = n[2] < 0 ? -1 : 1, a = -1 / (sign + n[2]), b = n[0] * n[1] * a;
    const double out[3][3] = {
        {1 + sign * n[0] * n[0] * a, sign * b, -sign * n[0]}, {b, sign + n[1] * n[1] * a, -n[1]}, {n[0], n[1], n[2]}};
    memcpy(axes, out, sizeof out);
}

void hit_normal(const float folded[2], double n[3])
{
    const double u = (double)folded[0], v = (double)folded[1];
    n[0] = u;
    n[1] = v;
    n[2] = 1 - fabs(u) - fabs(v);
    if (n[2] < 0) {
        n[0] = (1 - fabs(v)) * (u < 0 ? -1 : 1);
        n[1] = (1 - fabs(u)) * (v < 0 ? -1 : 1);
    }
    normalize(n);
}

hit_frame hit_frame_of(const render_job *job, uint32_t pixel, float t, const float normal[2], double lift)
{
    const render_camera *c = &job->camera;
    const uint32_t width = (uint32_t)c->width;
    const double z = (double)t / job->space.scale + job->space.depth_origin, above = lift / job->space.scale;
    double base[3], direction[3], n[3];
    hit_frame out;
    render_camera_ray(c, (int)(pixel % width), (int)(pixel / width), base, direction);
    hit_normal(normal, n);
    hit_axes_around(n, out.axes);
    for (int a = 0; a < 3; a++) {
        out.start[a] = base[a] + z * direction[a] + above * n[a];
        out.view[a] = -direction[a];
    }
    normalize(out.view);
    return out;
}

/* ---- directions of rays into the hemisphere ---- */

static double fractional_part(double x)
{
    return x - floor(x);
}

/* Cosine and sine of the golden angle, by which consecutive samples are rotated. */
static const double golden[2] = {-0.7373688780783197, 0.6754902942615239};

/* The circle through sample k encloses the share (k + begin) / count of the disk's area. `begin`, from 0 to 1, and the
 * angle `turn`, by which the spiral is rotated, depend on the pixel. Samples are kept away from the disk's rim, which
 * stands for rays parallel to the surface: for such rays, a small rounding error of the surface's position greatly
 * changes the distance at which they meet the surface. */
void hit_hemisphere(const render_job *job, uint32_t pixel, double (*out)[3])
{
    const uint32_t width = (uint32_t)job->camera.width, column = pixel % width, row = pixel / width;
    const int count = job->occlusion->samples;
    const double begin = render_jitter(pixel, (uint32_t)job->frame);
    const double shift = 5.588238 * job->frame;
    const double turn =
        fractional_part(52.9829189 * fractional_part(0.06711056 * (column + shift) + 0.00583715 * (row + shift)));
    double x = cos(turn * 6.283185307179586), y = sin(turn * 6.283185307179586);
    for (int k = 0; k < count; k++) {
        const double share = fmin((k + begin) / count, 1 - 1.0 / 1024), radius = sqrt(share), turned = x;
        out[k][0] = radius * x;
        out[k][1] = radius * y;
        out[k][2] = sqrt(1 - share);
        x = golden[0] * turned - golden[1] * y;
        y = golden[1] * turned + golden[0] * y;
    }
}

void hit_directions(const render_job *job, uint32_t pixel, const double (*axes)[3], double (*out)[3])
{
    hit_hemisphere(job, pixel, out);
    for (int k = 0; k < job->occlusion->samples; k++) {
        const double d[3] = {out[k][0], out[k][1], out[k][2]};
        for (int i = 0; i < 3; i++) out[k][i] = d[0] * axes[0][i] + d[1] * axes[1][i] + d[2] * axes[2][i];
    }
}

static void grow_box(render_box *box, const render_space *s, const mmbvh *tree)
{
    float lower[4], upper[4];
    mmbvh_node_box(tree, 0, lower, upper);
    for (int a = 0; a < 3; a++) {
        box->lower[a] = fmin(box->lower[a], (double)lower[a] / s->scale + s->origin[a]);
        box->upper[a] = fmax(box->upper[a], (double)upper[a] / s->scale + s->origin[a]);
    }
}

render_box hit_box(const render_job *job, bool (*is_wanted)(const render_surface_layer *layer))
{
    render_box out = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
    for (int i = 0; i < job->surface_count; i++) {
        if (!is_wanted(&job->surfaces[i])) continue;
        for (int part = 0; part < job->part_count; part++)
            if (job->surfaces[i].field.ranges[part].low && job->parts[part].tree->node_count)
                grow_box(&out, &job->space, job->parts[part].tree);
    }
    return out;
}
