/* Computes the intervals of a ray that a job's clips (render.h) keep, in double. The intervals depend only on the ray
 * and the clips, and are the same on all ranks.
 *
 * Clips whose inside is kept leave one interval of a ray. Of these clips, those that apply to all layers are applied
 * first: packets trace only the interval that they leave. If a surface has further clips, each of its hits is tested.
 * If volumes have further clips, they are traced several times, for one interval of each ray at a time, because a clip
 * that cuts out a body divides a ray into several intervals. */
#ifndef RENDER_KERNEL_CLIP_H
#define RENDER_KERNEL_CLIP_H

#include <math.h>
#include <stdbool.h>
#include <stdint.h>

#include "render.h"

/* An interval of a ray between two values of t; empty if begin > end. */
typedef struct kernel_ray_part {
    double begin, end;
} kernel_ray_part;

/* A ray in scaled world coordinates (tree space of kernel_types.h): its points are base + t * direction. */
typedef struct kernel_clip_ray {
    double base[3], direction[3];
} kernel_clip_ray;

#define KERNEL_NO_PART ((kernel_ray_part){0, -1})

static inline double kernel_clip_dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Returns the distance from the ray's point at t = 0 to the clip plane, along the plane's normal, in scaled units and
 * multiplied by the normal's length. It is negative if the point is beyond the plane. */
static inline double kernel_clip_plane_distance(const render_clip *c, const render_space *s, const kernel_clip_ray *ray)
{
    return (c->distance - kernel_clip_dot(c->normal, s->origin)) * s->scale - kernel_clip_dot(c->normal, ray->base);
}

static inline kernel_ray_part kernel_clip_plane(const render_clip *c, const render_space *s, const kernel_clip_ray *ray)
{
    const double left = kernel_clip_plane_distance(c, s, ray), along = kernel_clip_dot(c->normal, ray->direction);
    if (along > 0) return (kernel_ray_part){-INFINITY, left / along};
    if (along < 0) return (kernel_ray_part){left / along, INFINITY};
    return left < 0 ? KERNEL_NO_PART : (kernel_ray_part){-INFINITY, INFINITY};
}

static inline kernel_ray_part kernel_clip_box(const render_clip *c, const render_space *s, const kernel_clip_ray *ray)
{
    kernel_ray_part out = {-INFINITY, INFINITY};
    for (int a = 0; a < 3; a++) {
        const double low = (c->lower[a] - s->origin[a]) * s->scale - ray->base[a];
        const double high = (c->upper[a] - s->origin[a]) * s->scale - ray->base[a], along = ray->direction[a];
        if (along == 0 && (low > 0 || high < 0)) return KERNEL_NO_PART;
        if (along == 0) continue;
        out.begin = fmax(out.begin, fmin(low / along, high / along));
        out.end = fmin(out.end, fmax(low / along, high / along));
    }
    return out;
}

static inline kernel_ray_part kernel_clip_sphere(const render_clip *c, const render_space *s,
                                                 const kernel_clip_ray *ray)
{
    double from[3], across[3];
    for (int a = 0; a < 3; a++) from[a] = (c->centre[a] - s->origin[a]) * s->scale - ray->base[a];
    const double square = kernel_clip_dot(ray->direction, ray->direction);
    const double nearest = kernel_clip_dot(from, ray->direction) / square;
    for (int a = 0; a < 3; a++) across[a] = from[a] - nearest * ray->direction[a];
    const double radius = c->radius * s->scale, left = radius * radius - kernel_clip_dot(across, across);
    if (left < 0) return KERNEL_NO_PART;
    const double half = sqrt(left / square);
    return (kernel_ray_part){nearest - half, nearest + half};
}

/* Returns the interval of the ray that lies within the clip's half space, box or sphere. */
static inline kernel_ray_part kernel_clip_body(const render_clip *c, const render_space *s, const kernel_clip_ray *ray)
{
    switch (c->kind) {
    case RENDER_CLIP_PLANE: return kernel_clip_plane(c, s, ray);
    case RENDER_CLIP_BOX: return kernel_clip_box(c, s, ray);
    case RENDER_CLIP_SPHERE: return kernel_clip_sphere(c, s, ray);
    }
    return KERNEL_NO_PART;
}

/* Inserts a hole (an interval that a clip removes) into the list, which is sorted by begin. Returns the new number of
 * holes. */
static inline int kernel_clip_add_hole(kernel_ray_part *holes, int count, kernel_ray_part hole)
{
    int at = count;
    if (!(hole.begin < hole.end)) return count;
    for (; at > 0 && holes[at - 1].begin > hole.begin; at--) holes[at] = holes[at - 1];
    holes[at] = hole;
    return count + 1;
}

/* Returns one of the intervals that a set of clips leaves of a ray at values of t above `begin`. clips: one bit per
 * clip of the job; number: index of the interval, counted from 0. Returns KERNEL_NO_PART if there are fewer
 * intervals. */
static inline kernel_ray_part kernel_clip_find_interval(const render_job *job, uint32_t clips,
                                                        const kernel_clip_ray *ray, double begin, int number)
{
    kernel_ray_part out = {begin, INFINITY}, holes[RENDER_MAX_CLIPS];
    int hole_count = 0;
    for (; clips; clips &= clips - 1) {
        const render_clip *c = &job->clips[__builtin_ctz(clips)];
        const kernel_ray_part within = kernel_clip_body(c, &job->space, ray);
        if (c->is_outside) {
            hole_count = kernel_clip_add_hole(holes, hole_count, within);
        } else {
            out.begin = fmax(out.begin, within.begin);
            out.end = fmin(out.end, within.end);
        }
    }
    for (int i = 0; i < hole_count && out.begin <= out.end; i++) {
        if (holes[i].end <= out.begin) continue;
        if (holes[i].begin > out.begin && number-- == 0)
            return (kernel_ray_part){out.begin, fmin(out.end, holes[i].begin)};
        out.begin = holes[i].end;
    }
    return number == 0 && out.begin <= out.end ? out : KERNEL_NO_PART;
}

static inline bool kernel_clip_contains(const render_clip *c, const render_space *s, const kernel_clip_ray *ray,
                                        double t)
{
    double square = 0;
    bool is_within = true;
    if (c->kind == RENDER_CLIP_PLANE)
        return kernel_clip_dot(c->normal, ray->direction) * t <= kernel_clip_plane_distance(c, s, ray);
    for (int a = 0; a < 3; a++) {
        const double place = (ray->base[a] + t * ray->direction[a]) / s->scale + s->origin[a];
        is_within = is_within && c->lower[a] <= place && place <= c->upper[a];
        square += (place - c->centre[a]) * (place - c->centre[a]);
    }
    return c->kind == RENDER_CLIP_BOX ? is_within : square <= c->radius * c->radius;
}

/* Returns whether all of the clips keep the ray's point at t. clips: one bit per clip of the job. */
static inline bool kernel_clips_keep_ray_point(const render_job *job, uint32_t clips, const kernel_clip_ray *ray,
                                               double t)
{
    for (; clips; clips &= clips - 1) {
        const render_clip *c = &job->clips[__builtin_ctz(clips)];
        if (kernel_clip_contains(c, &job->space, ray, t) == c->is_outside) return false;
    }
    return true;
}

#endif
