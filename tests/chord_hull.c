/* Computes chords of the hull (chord_hull.h). */
#include "chord_hull.h"

#include <math.h>

static const double hull_shift = 1.2e-7, end_allowed = 5e-7, slanted_from = 3e-6, touching_from = 0.01;

static chord_line make_ray_line(const render_job *job, const chord_rays *rays, int i)
{
    const render_camera *c = &job->camera;
    const double unit = c->is_orthographic ? job->space.scale : 1;
    const double x = rays->centre_x + (double)(float)((rays->x[i] - rays->centre_x) * unit) / unit;
    const double y = rays->centre_y + (double)(float)((rays->y[i] - rays->centre_y) * unit) / unit;
    chord_line l;
    for (int a = 0; a < 3; a++) {
        const double sideways = x * c->right[a] + y * c->up[a];
        l.base[a] = c->eye[a] + (c->is_orthographic ? sideways : 0);
        l.direction[a] = c->forward[a] + (c->is_orthographic ? 0 : sideways);
    }
    l.length =
        sqrt(l.direction[0] * l.direction[0] + l.direction[1] * l.direction[1] + l.direction[2] * l.direction[2]);
    return l;
}

/* Returns the depths between which the ray is inside the cube of the given half side, clipped at the eye's plane. */
static chord_depths clip_line_to_cube(const chord_line *l, double half)
{
    chord_depths c = {0, (double)INFINITY};
    for (int a = 0; a < 3; a++) {
        if (l->direction[a] == 0) {
            if (!(fabs(l->base[a]) < half)) return (chord_depths){0, 0};
            continue;
        }
        const double t1 = (-half - l->base[a]) / l->direction[a], t2 = (half - l->base[a]) / l->direction[a];
        c.in = fmax(c.in, fmin(t1, t2));
        c.out = fmin(c.out, fmax(t1, t2));
    }
    return c.in < c.out ? c : (chord_depths){0, 0};
}

static double compute_chord_length(const chord_line *l, chord_depths c)
{
    return (c.out - c.in) * l->length / 2;
}

chord_ray chord_compute_hull_ray(const render_job *job, const chord_rays *rays, int i)
{
    chord_ray r = {.line = make_ray_line(job, rays, i)};
    const chord_depths exact = clip_line_to_cube(&r.line, 1);
    r.within = clip_line_to_cube(&r.line, 1 - 2 * hull_shift);
    r.about = clip_line_to_cube(&r.line, 1 + 2 * hull_shift);
    r.length = compute_chord_length(&r.line, exact);
    r.least = compute_chord_length(&r.line, r.within);
    r.most = compute_chord_length(&r.line, r.about);
    return r;
}

bool chord_is_touching(const chord_ray *r)
{
    return r->most - r->least > touching_from;
}

bool chord_is_slanted(const chord_ray *r)
{
    return !chord_is_touching(r) && r->most - r->least > slanted_from;
}

bool chord_is_within(const chord_ray *r, double low, double high)
{
    const double margin = 2 * end_allowed / r->line.length;
    return low < r->within.out - margin && high > r->within.in + margin;
}

bool chord_is_beyond(const chord_ray *r, double depth)
{
    const double margin = 2 * end_allowed / r->line.length;
    return depth < r->about.in - margin || depth > r->about.out + margin;
}
