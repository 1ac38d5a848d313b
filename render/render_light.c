/* Hits' rays in the spaces that kernels want them in (rays/kernel_bundle.h), and hits' colours.
 *
 * The rays of a hemisphere lie on a spiral of equal steps in area, projected upwards from the disk below (Malley's
 * method), so that they are spread as the cosine asks: the share that is open is what the sky gives. Pixels turn the
 * spiral by angles that differ from all their neighbours' (interleaved gradient noise, Jimenez 2014), and move its
 * begin; both depend on the pixel and on the number among the frames that are averaged alone, so a surface that
 * stands still has the same samples at every step. */
#include "render_light.h"

#include <math.h>
#include <omp.h>
#include <stdlib.h>
#include <string.h>

#include "grid.h"
#include "kernel_bundle.h"
#include "kernel_types.h"
#include "memory.h"
#include "mmbvh.h"
#include "render_kernels.h"
#include "render_polyhedra.h"
#include "render_prepare.h"

/* ---- one hit ------------------------------------------------------------------------------------------------- */

typedef struct axes {
    double right[3], up[3], forward[3];
} axes;

/* A hit in the scene: where its rays begin, the normal with two directions across it, and the way to the eye. */
typedef struct place {
    double start[3], view[3];
    axes a;
} place;

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void normalize(double v[3])
{
    const double length = sqrt(dot(v, v));
    for (int a = 0; a < 3; a++) v[a] /= length;
}

/* Finds two unit vectors across a third (Duff et al. 2017). */
static axes axes_around(const double n[3])
{
    const double sign = n[2] < 0 ? -1 : 1, a = -1 / (sign + n[2]), b = n[0] * n[1] * a;
    return (axes){
        {1 + sign * n[0] * n[0] * a, sign * b, -sign * n[0]}, {b, sign + n[1] * n[1] * a, -n[1]}, {n[0], n[1], n[2]}};
}

static void unfold_normal(const float folded[2], double n[3])
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

static place place_of(const render_job *job, const render_hit *hit)
{
    const render_camera *c = &job->camera;
    const uint32_t width = (uint32_t)c->width;
    const double z = (double)hit->t / job->space.scale + job->space.depth_origin, lift = RENDER_LIFT / job->space.scale;
    double base[3], direction[3], n[3];
    place out;
    render_camera_ray(c, (int)(hit->pixel % width), (int)(hit->pixel / width), base, direction);
    unfold_normal(hit->normal, n);
    out.a = axes_around(n);
    for (int a = 0; a < 3; a++) {
        out.start[a] = base[a] + z * direction[a] + lift * n[a];
        out.view[a] = -direction[a];
    }
    normalize(out.view);
    return out;
}

/* Returns the layer that the fragment was hit on. */
static const render_surface_layer *layer_of(const render_job *job, const fragment *f)
{
    int value = (int)(f->kind - FRAGMENT_SURFACE), i = 0;
    while (i + 1 < job->surface_count && value >= job->surfaces[i].value_count) value -= job->surfaces[i++].value_count;
    return &job->surfaces[i];
}

static bool takes_light(const render_material *m)
{
    return m->diffuse != 0 || m->specular != 0;
}

static uint64_t all_samples(int count)
{
    return count < 64 ? ((uint64_t)1 << count) - 1 : ~(uint64_t)0;
}

bool render_hit_of(const render_job *job, const fragment *f, render_hit *hit, render_hit_rays *rays)
{
    double n[3];
    if (f->kind < FRAGMENT_SURFACE || !takes_light(&layer_of(job, f)->material)) return false;
    if (!isfinite(f->t_out) || !isfinite(f->transmittance)) return false; /* a gradient that is no number */
    *hit = (render_hit){f->pixel, f->t_in, {f->t_out, f->transmittance}};
    *rays = (render_hit_rays){all_samples(job->occlusion->samples), 0, 0};
    unfold_normal(hit->normal, n);
    for (int i = 0; i < job->light_count; i++)
        if (job->occlusion->lights >> i & 1 && dot(n, job->lights[i].direction) > 0) rays->lights |= 1u << i;
    return rays->samples || rays->lights;
}

/* ---- the hemisphere ------------------------------------------------------------------------------------------ */

typedef struct hemisphere {
    double cosine, sine; /* of the pixel's turn */
    double begin;        /* 0 .. 1, of the spiral's first step */
} hemisphere;

static double part_of(double x)
{
    return x - floor(x);
}

static hemisphere hemisphere_of(const render_job *job, uint32_t pixel)
{
    const uint32_t width = (uint32_t)job->camera.width;
    const double x = pixel % width + 5.588238 * job->frame, y = pixel / width + 5.588238 * job->frame;
    const double turn = part_of(52.9829189 * part_of(0.06711056 * x + 0.00583715 * y)) * 6.283185307179586;
    return (hemisphere){cos(turn), sin(turn), render_jitter(pixel, (uint32_t)job->frame)};
}

/* The golden angle's cosine and sine. */
static const double golden[2] = {-0.7373688780783197, 0.6754902942615239};

/* The directions of a hit's samples, z along the normal, unit length. The last of them are kept off the horizon, where
 * what is rounding across the surface would be a long way. */
static void sample_directions(const hemisphere *h, int count, double out[RENDER_MAX_SAMPLES][3])
{
    double x = h->cosine, y = h->sine;
    for (int k = 0; k < count; k++) {
        const double share = fmin((k + h->begin) / count, 1 - 1.0 / 1024), radius = sqrt(share), turned = x;
        out[k][0] = radius * x;
        out[k][1] = radius * y;
        out[k][2] = sqrt(1 - share);
        x = golden[0] * turned - golden[1] * y;
        y = golden[1] * turned + golden[0] * y;
    }
}

/* ---- tracing ------------------------------------------------------------------------------------------------- */

/* A thread takes so many hits at once, and keeps the cells that it has fetched for one of them for the others. */
enum { CHUNK_HITS = 256 };

/* Cells of a light's lattice to a scaled unit. */
enum { LIGHT_TILES = 32 };

/* A ray towards a light, in that light's scaled axes. */
typedef struct light_ray {
    int32_t column, row; /* of the lattice */
    int hit;             /* in the chunk */
    double at[3];
} light_ray;

/* What a thread traces with. Its frame is a copy whose job is its own, so that the camera can be moved from space to
 * space. */
typedef struct tracer {
    const kernel_table *kernels;
    const render_job *job; /* as it was given */
    render_job moved;
    kernel_frame frame;
    kernel_thread thread;
    kernel_bundle bundle;
    light_ray light_rays[CHUNK_HITS];
} tracer;

static void tracer_look(tracer *t, const double eye[3], const axes *a, bool is_orthographic)
{
    render_camera *c = &t->moved.camera;
    memcpy(c->eye, eye, sizeof c->eye);
    memcpy(c->right, a->right, sizeof c->right);
    memcpy(c->up, a->up, sizeof c->up);
    memcpy(c->forward, a->forward, sizeof c->forward);
    c->is_orthographic = is_orthographic;
    for (int k = 0; k < 3; k++) {
        t->frame.scaled_axes[0][k] = a->right[k] * t->moved.space.scale;
        t->frame.scaled_axes[1][k] = a->up[k] * t->moved.space.scale;
        t->frame.scaled_axes[2][k] = a->forward[k] * t->moved.space.scale;
    }
}

static void trace_hemisphere(tracer *t, const render_hit *hit, render_hit_rays *rays)
{
    const render_occlusion *o = t->job->occlusion;
    const render_space *space = &t->job->space;
    const place p = place_of(t->job, hit);
    const hemisphere h = hemisphere_of(t->job, hit->pixel);
    kernel_bundle *b = &t->bundle;
    double directions[RENDER_MAX_SAMPLES][3];
    sample_directions(&h, o->samples, directions);
    tracer_look(t, p.start, &p.a, false);
    b->tile.centre_x = b->tile.centre_y = 0;
    b->tile.radius = 0;
    for (int k = 0; k < o->samples; k++) {
        const double *d = directions[k], slope_x = d[0] / d[2], slope_y = d[1] / d[2];
        b->origin_x[k] = b->origin_y[k] = b->t_near[k] = 0;
        b->slope_x[k] = (float)slope_x;
        b->slope_y[k] = (float)slope_y;
        b->t_far[k] = (float)(o->radius * space->scale * d[2]);
        b->tile.radius = fmaxf(b->tile.radius, fmaxf(fabsf(b->slope_x[k]), fabsf(b->slope_y[k])));
        for (int a = 0; a < 3; a++) {
            b->rays[k].base[a] = (p.start[a] - space->origin[a]) * space->scale;
            b->rays[k].direction[a] = p.a.forward[a] + slope_x * p.a.right[a] + slope_y * p.a.up[a];
        }
    }
    b->count = o->samples;
    b->open = rays->samples;
    t->kernels->occlude(&t->frame, &t->thread, b);
    rays->samples = b->open;
}

static int by_lattice(const void *a, const void *b)
{
    const light_ray *x = a, *y = b;
    if (x->row != y->row) return x->row < y->row ? -1 : 1;
    if (x->column != y->column) return x->column < y->column ? -1 : 1;
    return (x->hit > y->hit) - (x->hit < y->hit);
}

static int collect_light_rays(tracer *t, int light, const axes *a, const render_hit *hits, const render_hit_rays *rays,
                              int count)
{
    const render_space *space = &t->job->space;
    int n = 0;
    for (int i = 0; i < count; i++) {
        if (!(rays[i].lights >> light & 1)) continue;
        const place p = place_of(t->job, &hits[i]);
        light_ray *ray = &t->light_rays[n++];
        double from[3];
        for (int k = 0; k < 3; k++) from[k] = (p.start[k] - space->origin[k]) * space->scale;
        ray->at[0] = dot(a->right, from);
        ray->at[1] = dot(a->up, from);
        ray->at[2] = dot(a->forward, from);
        ray->column = (int32_t)floor(ray->at[0] * LIGHT_TILES);
        ray->row = (int32_t)floor(ray->at[1] * LIGHT_TILES);
        ray->hit = i;
    }
    qsort(t->light_rays, (size_t)n, sizeof *t->light_rays, by_lattice);
    return n;
}

/* Traces rays that lie in one cell of the lattice. */
static void trace_light_tile(tracer *t, int light, const axes *a, const light_ray *list, int count,
                             render_hit_rays *rays)
{
    kernel_bundle *b = &t->bundle;
    const double centre[2] = {(list->column + 0.5) / LIGHT_TILES, (list->row + 0.5) / LIGHT_TILES};
    b->tile.centre_x = centre[0] / t->job->space.scale;
    b->tile.centre_y = centre[1] / t->job->space.scale;
    b->tile.radius = 0.5F / LIGHT_TILES;
    for (int i = 0; i < count; i++) {
        const light_ray *ray = &list[i];
        b->origin_x[i] = (float)(ray->at[0] - centre[0]);
        b->origin_y[i] = (float)(ray->at[1] - centre[1]);
        b->slope_x[i] = b->slope_y[i] = 0;
        b->t_near[i] = (float)ray->at[2];
        b->t_far[i] = INFINITY;
        for (int k = 0; k < 3; k++) {
            b->rays[i].base[k] = ray->at[0] * a->right[k] + ray->at[1] * a->up[k];
            b->rays[i].direction[k] = a->forward[k];
        }
    }
    b->count = count;
    b->open = all_samples(count);
    t->kernels->occlude(&t->frame, &t->thread, b);
    for (int i = 0; i < count; i++)
        if (!(b->open >> i & 1)) rays[list[i].hit].lights &= ~(1u << light);
}

static void trace_light(tracer *t, int light, const render_hit *hits, render_hit_rays *rays, int count)
{
    const axes a = axes_around(t->job->lights[light].direction);
    const int n = collect_light_rays(t, light, &a, hits, rays, count);
    tracer_look(t, t->job->space.origin, &a, true);
    for (int first = 0, end; first < n; first = end) {
        const light_ray *from = &t->light_rays[first];
        for (end = first + 1; end < n && end - first < KERNEL_BUNDLE_RAYS; end++)
            if (t->light_rays[end].row != from->row || t->light_rays[end].column != from->column) break;
        trace_light_tile(t, light, &a, from, end - first, rays);
    }
}

static void trace_chunk(tracer *t, const render_hit *hits, render_hit_rays *rays, int count)
{
    t->thread.serial++;
    if (t->thread.polyhedra) polyhedra_reset(t->thread.polyhedra);
    for (int light = 0; light < t->job->light_count; light++)
        if (t->job->occlusion->lights >> light & 1) trace_light(t, light, hits, rays, count);
    for (int i = 0; i < count; i++)
        if (rays[i].samples) trace_hemisphere(t, &hits[i], &rays[i]);
}

static tracer *tracer_create(const kernel_table *kernels, const kernel_frame *frame, const render_job *job)
{
    bool has_polyhedra = false;
    tracer *t = base_calloc(1, sizeof *t);
    if (!t) return NULL;
    for (int i = 0; i < job->part_count; i++) has_polyhedra = has_polyhedra || grid_has_faces(job->parts[i].cells);
    t->kernels = kernels;
    t->job = job;
    t->moved = *frame->job;
    t->frame = *frame;
    t->frame.job = &t->moved;
    t->frame.depth_shift = t->moved.space.depth_origin = 0;
    t->thread = (kernel_thread){.memory = base_alloc(kernels->memory_bytes),
                                .polyhedra = has_polyhedra ? polyhedra_create() : NULL,
                                .find_polyhedron = polyhedra_find,
                                .polyhedron_scratch = polyhedra_scratch};
    if (t->thread.memory) kernels->begin(&t->thread);
    if (t->thread.memory && (t->thread.polyhedra || !has_polyhedra)) return t;
    polyhedra_free(t->thread.polyhedra);
    base_free(t->thread.memory);
    base_free(t);
    return NULL;
}

/* Returns false where memory ran out. */
static bool tracer_free(tracer *t)
{
    if (!t) return false;
    const bool is_well = !t->thread.out_of_memory;
    polyhedra_free(t->thread.polyhedra);
    base_free(t->thread.memory);
    base_free(t);
    return is_well;
}

static bool trace_all(const kernel_frame *frame, const render_job *job, const render_hit *hits, render_hit_rays *rays,
                      int64_t count)
{
    const kernel_table *kernels = render_kernels();
    const int threads = job->threads > 0 ? job->threads : omp_get_max_threads();
    bool is_well = true;
#pragma omp parallel num_threads(threads) reduction(&& : is_well)
    {
        tracer *t = tracer_create(kernels, frame, job);
#pragma omp for schedule(dynamic, 1)
        for (int64_t first = 0; first < count; first += CHUNK_HITS) {
            const int64_t left = count - first;
            if (t && !t->thread.out_of_memory)
                trace_chunk(t, hits + first, rays + first, (int)(left < CHUNK_HITS ? left : CHUNK_HITS));
        }
        is_well = tracer_free(t);
    }
    return is_well;
}

insitu_status render_occlude(const render_job *job, const render_hit *hits, render_hit_rays *rays, int64_t count,
                             base_error *error)
{
    kernel_frame frame;
    render_job surfaces = *job;
    surfaces.volume_count = 0;
    surfaces.separate_samples = surfaces.reproducible = false;
    if (!count || !job->part_count) return INSITU_OK;
    insitu_status status = render_prepare(&surfaces, &frame, error);
    if (status != INSITU_OK) return status;
    if (!trace_all(&frame, job, hits, rays, count))
        status = base_fail(error, INSITU_ERROR_MEMORY, "no memory for the rays of %lld hits", (long long)count);
    render_unprepare(&frame);
    return status;
}

/* ---- which ranks to ask -------------------------------------------------------------------------------------- */

static void grow_box(render_box *box, const render_space *s, const mmbvh *tree)
{
    float lower[4], upper[4];
    mmbvh_node_box(tree, 0, lower, upper);
    for (int a = 0; a < 3; a++) {
        box->lower[a] = fmin(box->lower[a], (double)lower[a] / s->scale + s->origin[a]);
        box->upper[a] = fmax(box->upper[a], (double)upper[a] / s->scale + s->origin[a]);
    }
}

render_box render_occluder_box(const render_job *job)
{
    render_box out = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
    for (int i = 0; i < job->surface_count; i++) {
        if (job->surfaces[i].opacity < 1) continue;
        for (int part = 0; part < job->part_count; part++)
            if (job->surfaces[i].field.ranges[part].low && job->parts[part].tree->node_count)
                grow_box(&out, &job->space, job->parts[part].tree);
    }
    return out;
}

/* Scaled units. Boxes are grown by it, which is more than rays and float32 boxes are off by. */
static const double box_margin = 1e-5;

/* May a ray meet the box before it is reach long? */
static bool meets_box(const double from[3], const double direction[3], double reach, double margin,
                      const render_box *box)
{
    double begin = 0, end = reach;
    for (int a = 0; a < 3; a++) {
        const double low = box->lower[a] - margin - from[a], high = box->upper[a] + margin - from[a];
        if (!(low <= high)) return false;
        if (fabs(direction[a]) < 1e-9) {
            /* So little that only rays far longer than the scene would leave the slab by it. */
            if (low > 0 || high < 0) return false;
            continue;
        }
        begin = fmax(begin, fmin(low / direction[a], high / direction[a]));
        end = fmin(end, fmax(low / direction[a], high / direction[a]));
    }
    return begin <= end;
}

static bool is_near_box(const double from[3], double reach, const render_box *box)
{
    bool is_near = true;
    for (int a = 0; a < 3; a++)
        is_near = is_near && box->lower[a] <= from[a] + reach && from[a] - reach <= box->upper[a];
    return is_near;
}

void render_rays_to_boxes(const render_job *job, const render_hit *hit, const render_hit_rays *rays,
                          const render_box *boxes, int count, render_box_taker *take, void *state)
{
    const render_occlusion *o = job->occlusion;
    const place p = place_of(job, hit);
    const double margin = box_margin / job->space.scale;
    double samples[RENDER_MAX_SAMPLES][3];
    if (rays->samples) {
        const hemisphere h = hemisphere_of(job, hit->pixel);
        sample_directions(&h, o->samples, samples);
        for (int k = 0; k < o->samples; k++) {
            const double d[3] = {samples[k][0], samples[k][1], samples[k][2]};
            for (int a = 0; a < 3; a++) samples[k][a] = d[0] * p.a.right[a] + d[1] * p.a.up[a] + d[2] * p.a.forward[a];
        }
    }
    for (int i = 0; i < count; i++) {
        render_hit_rays met = {0, 0, 0};
        for (uint32_t left = rays->lights; left; left &= left - 1) {
            const int light = __builtin_ctz(left);
            if (meets_box(p.start, job->lights[light].direction, INFINITY, margin, &boxes[i]))
                met.lights |= 1u << light;
        }
        const bool is_near = rays->samples && is_near_box(p.start, o->radius + margin, &boxes[i]);
        for (uint64_t left = is_near ? rays->samples : 0; left; left &= left - 1) {
            const int k = __builtin_ctzll(left);
            if (meets_box(p.start, samples[k], o->radius + margin, margin, &boxes[i])) met.samples |= (uint64_t)1 << k;
        }
        if (met.lights || met.samples) take(state, i, &met);
    }
}

/* ---- colours ------------------------------------------------------------------------------------------------- */

/* Does what kernel_shade() does, by the open lights alone and in double. */
static void shade(const render_job *job, const render_material *m, const place *p, uint32_t lights, double diffuse[3],
                  double specular[3])
{
    const double *n = p->a.forward;
    for (int a = 0; a < 3; a++) diffuse[a] = (double)m->ambient, specular[a] = 0;
    for (int i = 0; i < job->light_count; i++) {
        const double *l = job->lights[i].direction;
        const float *c = job->lights[i].colour;
        double half[3] = {p->view[0] + l[0], p->view[1] + l[1], p->view[2] + l[2]};
        if (!(lights >> i & 1)) continue;
        const double length = sqrt(dot(half, half)), nl = fmax(dot(n, l), 0);
        const double nh = length > 0 ? fmax(dot(n, half) / length, 0) : 0;
        const double shine = nh > 0 ? exp2(log2(fmax(nh, 1e-20)) * (double)m->shininess) : 0;
        for (int a = 0; a < 3; a++) {
            diffuse[a] += nl * (double)m->diffuse * (double)c[a];
            specular[a] += shine * (double)m->specular * (double)c[a];
        }
    }
}

void render_light_fragment(const render_job *job, const render_hit_rays *open, fragment *f)
{
    const render_surface_layer *layer;
    double diffuse[3], specular[3];
    render_hit hit;
    if (f->kind < FRAGMENT_SURFACE) return;
    layer = layer_of(job, f);
    hit = (render_hit){f->pixel, f->t_in, {f->t_out, f->transmittance}};
    f->t_out = f->t_in;
    f->transmittance = layer->opacity >= 1 ? 0 : 1 - layer->opacity;
    if (!takes_light(&layer->material)) {
        for (int a = 0; a < 3; a++) f->colour[a] *= layer->material.ambient;
        return;
    }
    const render_occlusion *o = job->occlusion;
    const place p = place_of(job, &hit);
    const double sky = o->samples ? (double)__builtin_popcountll(open->samples) / o->samples : 1;
    shade(job, &layer->material, &p, open->lights | ~o->lights, diffuse, specular);
    const double opacity = layer->opacity >= 1 ? 1 : (double)layer->opacity;
    for (int a = 0; a < 3; a++) f->colour[a] = (float)((double)f->colour[a] * diffuse[a] * sky + specular[a] * opacity);
}
