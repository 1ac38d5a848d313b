/* Traces the rays of hits towards lights and into the hemisphere above the surface, and lights the hits. First all rays
 * are tested in tree space (kernel_occluders.h). If these tests cannot decide whether a cell blocks a ray, the ray is
 * transformed into a tile space of its own and tested exactly in that cell (kernel_bundle.h). */
#include "render_light.h"

#include <math.h>
#include <omp.h>
#include <stdlib.h>
#include <string.h>

#include "kernel_bundle.h"
#include "kernel_types.h"
#include "memory.h"
#include "mmbvh.h"
#include "region.h"
#include "render_hits.h"
#include "render_kernels.h"
#include "render_occluders.h"
#include "render_polyhedra.h"
#include "render_prepare.h"
#include "render_thread.h"

/* ---- the rays of a hit ---------------------------------------------------------------------------------------- */

static hit_frame compute_hit_frame(const render_job *job, const render_hit *hit)
{
    return hit_frame_of(job, hit->pixel, hit->t, hit->normal, RENDER_LIFT);
}

/* Returns the surface layer to which a hit's fragment belongs. The fragment's kind contains the index of an isovalue,
 * and each isovalue belongs to one layer. */
static const render_surface_layer *find_layer_of_fragment(const render_job *job, const fragment *f)
{
    int value = (int)(f->kind - FRAGMENT_SURFACE), i = 0;
    while (i + 1 < job->surface_count && value >= job->surfaces[i].value_count) value -= job->surfaces[i++].value_count;
    return &job->surfaces[i];
}

static uint64_t make_sample_mask(int count)
{
    return count < 64 ? ((uint64_t)1 << count) - 1 : ~(uint64_t)0;
}

bool render_make_hit_from_fragment(const render_job *job, const fragment *f, render_hit *hit, render_hit_rays *rays)
{
    double n[3];
    if (f->kind < FRAGMENT_SURFACE || !render_takes_light(&find_layer_of_fragment(job, f)->material)) return false;
    /* unlit fragments store the normal here; it is not finite if the field's gradient is NaN or infinite */
    if (!isfinite(f->t_out) || !isfinite(f->transmittance)) return false;
    *hit = (render_hit){f->pixel, f->t_in, {f->t_out, f->transmittance}};
    *rays = (render_hit_rays){make_sample_mask(job->occlusion->samples), 0, 0};
    hit_normal(hit->normal, n);
    for (int i = 0; i < job->light_count; i++)
        if (job->occlusion->lights >> i & 1 && hit_dot(n, job->lights[i].direction) > 0) rays->lights |= 1u << i;
    return rays->samples || rays->lights;
}

void render_compute_hemisphere_rays(const render_job *job, const render_hit *hit, double start[3],
                                    double directions[RENDER_MAX_SAMPLES][3])
{
    const hit_frame p = compute_hit_frame(job, hit);
    memcpy(start, p.start, sizeof p.start);
    hit_directions(job, hit->pixel, (const double(*)[3])p.axes, directions);
}

/* ---- tracing rays from hits ----------------------------------------------------------------------------------- */

/* CHUNK_HITS: number of hits that a thread processes together; cells that it has read for one of these hits are cached
 * for the others. CHUNK_RAYS: maximum number of their rays. */
enum { CHUNK_HITS = 64, CHUNK_RAYS = CHUNK_HITS * (RENDER_MAX_SAMPLES + RENDER_MAX_LIGHTS) };

/* Rays towards a light are grouped into tiles, squares in the plane perpendicular to the light's direction. This is the
 * number of tiles per scaled unit along each axis of that plane. */
enum { LIGHT_TILES = 32 };

struct render_occluders {
    const kernel_table *kernels;
    render_job job;     /* the job that the caller gave, without volumes */
    kernel_frame frame; /* the constants of this job's frame */
    kernel_occluders trees;
    int threads;
};

/* The state of a thread that traces rays from hits. Each thread has its own copies of the frame and the job. Their
 * camera is replaced whenever rays are traced in another tile space (kernel_bundle.h). */
typedef struct tracer {
    const render_occluders *of;
    const render_job *job; /* the job from which the occluders were collected */
    render_job moved_job;  /* copy of the job with the camera of the current tile space; frame.job points to it */
    kernel_frame frame;
    kernel_thread thread;
    kernel_bundle bundle;
    kernel_secondary_rays secondary_rays;
    kernel_secondary_ray rays[CHUNK_RAYS];
} tracer;

bool render_grow_undecided(kernel_secondary_rays *s)
{
    const int64_t capacity = s->capacity + s->capacity / 2 + 1024;
    kernel_undecided_pair *undecided = base_realloc(s->undecided, (size_t)capacity * sizeof *undecided);
    if (!undecided) return false;
    s->undecided = undecided;
    s->capacity = capacity;
    return true;
}

/* ---- the list of a chunk's rays, which are tested in tree space */

static void add_ray(tracer *t, int hit, int number, const double start[3], const double direction[3], double far)
{
    const render_space *space = &t->job->space;
    kernel_secondary_ray *ray = &t->rays[t->secondary_rays.count++];
    ray->hit = (int16_t)hit;
    ray->number = (int16_t)number;
    for (int a = 0; a < 3; a++) {
        ray->origin[a] = (float)((start[a] - space->origin[a]) * space->scale);
        ray->direction[a] = (float)direction[a];
    }
    ray->far = (float)far;
    ray->is_open = true;
}

static void add_hit(tracer *t, int i, const render_hit *hit, const render_hit_rays *rays)
{
    const render_occlusion *o = t->job->occlusion;
    const hit_frame p = compute_hit_frame(t->job, hit);
    double samples[RENDER_MAX_SAMPLES][3];
    if (rays->samples) hit_directions(t->job, hit->pixel, (const double(*)[3])p.axes, samples);
    for (uint64_t left = rays->samples; left; left &= left - 1) {
        const int k = __builtin_ctzll(left);
        add_ray(t, i, k, p.start, samples[k], o->radius * t->job->space.scale);
    }
    for (uint32_t left = rays->lights; left; left &= left - 1) {
        const int light = __builtin_ctz(left);
        add_ray(t, i, RENDER_MAX_SAMPLES + light, p.start, t->job->lights[light].direction, INFINITY);
    }
}

/* ---- rays that are traced exactly in a cell, because simpler tests have not decided */

static void tracer_set_tile_space(tracer *t, const double eye[3], const double (*axes)[3], bool is_orthographic)
{
    render_camera *c = &t->moved_job.camera;
    memcpy(c->eye, eye, sizeof c->eye);
    memcpy(c->right, axes[0], sizeof c->right);
    memcpy(c->up, axes[1], sizeof c->up);
    memcpy(c->forward, axes[2], sizeof c->forward);
    c->is_orthographic = is_orthographic;
    for (int a = 0; a < 3; a++)
        for (int k = 0; k < 3; k++) t->frame.scaled_axes[a][k] = axes[a][k] * t->moved_job.space.scale;
}

/* Fills the bundle with the rays of a hit's hemisphere, and sets the camera to that of their tile space, in which they
 * are traced (kernel_bundle.h). */
static void set_hemisphere_rays(tracer *t, const render_hit *hit)
{
    const render_occlusion *o = t->job->occlusion;
    const render_space *space = &t->job->space;
    const hit_frame p = compute_hit_frame(t->job, hit);
    kernel_bundle *b = &t->bundle;
    double directions[RENDER_MAX_SAMPLES][3];
    hit_hemisphere(t->job, hit->pixel, directions);
    tracer_set_tile_space(t, p.start, (const double(*)[3])p.axes, false);
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
            b->rays[k].direction[a] = p.axes[2][a] + slope_x * p.axes[0][a] + slope_y * p.axes[1][a];
        }
    }
    b->count = o->samples;
}

/* Fills the bundle with a hit's ray to a light, and sets the camera to that of the ray's tile space, in which it is
 * traced (kernel_bundle.h). */
static void set_light_ray(tracer *t, const render_hit *hit, int light)
{
    const render_space *space = &t->job->space;
    const hit_frame p = compute_hit_frame(t->job, hit);
    kernel_bundle *b = &t->bundle;
    double from[3], axes[3][3];
    hit_axes_around(t->job->lights[light].direction, axes);
    for (int k = 0; k < 3; k++) from[k] = (p.start[k] - space->origin[k]) * space->scale;
    const double x = hit_dot(axes[0], from), y = hit_dot(axes[1], from);
    const double centre[2] = {(floor(x * LIGHT_TILES) + 0.5) / LIGHT_TILES,
                              (floor(y * LIGHT_TILES) + 0.5) / LIGHT_TILES};
    tracer_set_tile_space(t, space->origin, (const double(*)[3])axes, true);
    b->tile.centre_x = centre[0] / space->scale;
    b->tile.centre_y = centre[1] / space->scale;
    b->tile.radius = 0.5F / LIGHT_TILES;
    b->origin_x[0] = (float)(x - centre[0]);
    b->origin_y[0] = (float)(y - centre[1]);
    b->slope_x[0] = b->slope_y[0] = 0;
    b->t_near[0] = (float)hit_dot(axes[2], from);
    b->t_far[0] = INFINITY;
    for (int k = 0; k < 3; k++) {
        b->rays[0].base[k] = x * axes[0][k] + y * axes[1][k];
        b->rays[0].direction[k] = axes[2][k];
    }
    b->count = 1;
}

static int compare_pairs_by_ray(const void *a, const void *b)
{
    const kernel_undecided_pair *x = a, *y = b;
    if (x->ray != y->ray) return x->ray < y->ray ? -1 : 1;
    return (x->occluder > y->occluder) - (x->occluder < y->occluder);
}

static void test_cell(tracer *t, int32_t occluder)
{
    t->of->kernels->occlude_by_cell(&t->frame, &t->thread, &t->bundle, &t->of->trees.cells[occluder]);
}

/* Value of kernel_undecided_pair.occluder that marks a pair as tested: when a cell is tested, all of the hit's rays
 * that are undecided in this cell are tested at once. */
enum { TESTED = -1 };

/* Tests a hit's rays into the hemisphere exactly: `undecided` has `count` pairs of a ray and a cell that may block it.
 * Clears is_open of the rays that are blocked. */
static void trace_hemisphere(tracer *t, const render_hit *hit, kernel_undecided_pair *undecided, int64_t count)
{
    uint64_t open = 0;
    int32_t ray_of[RENDER_MAX_SAMPLES];
    set_hemisphere_rays(t, hit);
    for (int64_t i = 0; i < count; i++) {
        const int k = t->rays[undecided[i].ray].number;
        ray_of[k] = undecided[i].ray;
        if (t->rays[undecided[i].ray].is_open) open |= (uint64_t)1 << k;
    }
    const uint64_t open_at_first = open;
    for (int64_t i = 0; i < count && open; i++) {
        const int32_t occluder = undecided[i].occluder;
        if (occluder == TESTED) continue;
        t->bundle.open = 0;
        for (int64_t j = i; j < count; j++) {
            if (undecided[j].occluder != occluder) continue;
            t->bundle.open |= (uint64_t)1 << t->rays[undecided[j].ray].number;
            undecided[j].occluder = TESTED;
        }
        t->bundle.open &= open;
        if (!t->bundle.open) continue;
        const uint64_t before = t->bundle.open;
        test_cell(t, occluder);
        open &= ~(before & ~t->bundle.open);
    }
    for (uint64_t closed = open_at_first & ~open; closed; closed &= closed - 1)
        t->rays[ray_of[__builtin_ctzll(closed)]].is_open = false;
}

static void trace_undecided_light_ray(tracer *t, const render_hit *hit, const kernel_undecided_pair *doubt)
{
    kernel_secondary_ray *ray = &t->rays[doubt->ray];
    if (!ray->is_open) return;
    set_light_ray(t, hit, ray->number - RENDER_MAX_SAMPLES);
    t->bundle.open = 1;
    test_cell(t, doubt->occluder);
    ray->is_open = t->bundle.open;
}

static void trace_undecided(tracer *t, const render_hit *hits)
{
    kernel_secondary_rays *s = &t->secondary_rays;
    qsort(s->undecided, (size_t)s->undecided_count, sizeof *s->undecided, compare_pairs_by_ray);
    for (int64_t first = 0, end; first < s->undecided_count; first = end) {
        kernel_undecided_pair *from = &s->undecided[first];
        const kernel_secondary_ray *ray = &t->rays[from->ray];
        for (end = first + 1; end < s->undecided_count && ray->number < RENDER_MAX_SAMPLES; end++) {
            const kernel_secondary_ray *next = &t->rays[s->undecided[end].ray];
            if (next->hit != ray->hit || next->number >= RENDER_MAX_SAMPLES) break;
        }
        if (ray->number < RENDER_MAX_SAMPLES)
            trace_hemisphere(t, &hits[ray->hit], from, end - first);
        else
            trace_undecided_light_ray(t, &hits[ray->hit], from);
    }
}

static void trace_chunk(tracer *t, const render_hit *hits, render_hit_rays *rays, int count)
{
    kernel_secondary_rays *s = &t->secondary_rays;
    t->thread.serial++;
    if (t->thread.polyhedra) polyhedra_reset(t->thread.polyhedra);
    s->count = 0;
    s->undecided_count = 0;
    for (int i = 0; i < count; i++) add_hit(t, i, &hits[i], &rays[i]);
    t->of->kernels->occlude(&t->frame, &t->thread, &t->of->trees, s);
    if (s->undecided_count) trace_undecided(t, hits);
    for (int i = 0; i < s->count; i++) {
        const kernel_secondary_ray *ray = &t->rays[i];
        if (ray->is_open) continue;
        if (ray->number < RENDER_MAX_SAMPLES)
            rays[ray->hit].samples &= ~((uint64_t)1 << ray->number);
        else
            rays[ray->hit].lights &= ~(1u << (ray->number - RENDER_MAX_SAMPLES));
    }
}

/* ---- one tracer per thread */

static tracer *tracer_create(const render_occluders *of)
{
    tracer *t = base_calloc(1, sizeof *t);
    if (!t) return NULL;
    t->of = of;
    t->job = &of->job;
    t->moved_job = of->job;
    t->frame = of->frame;
    t->frame.job = &t->moved_job;
    t->frame.depth_shift = t->moved_job.space.depth_origin = 0;
    t->secondary_rays = (kernel_secondary_rays){.rays = t->rays};
    render_thread_begin(&t->frame, of->kernels, &t->thread);
    return t;
}

/* Frees the tracer. Returns false if t is NULL, or if memory ran out while it traced rays. */
static bool tracer_free(tracer *t)
{
    if (!t) return false;
    const bool is_well = !t->thread.out_of_memory;
    render_thread_end(&t->thread);
    base_free(t->secondary_rays.undecided);
    base_free(t);
    return is_well;
}

static bool trace_all(const render_occluders *of, const render_hit *hits, render_hit_rays *rays, int64_t count)
{
    bool is_well = true;
#pragma omp parallel num_threads(of->threads) reduction(&& : is_well)
    {
        region_enter();
        tracer *t = tracer_create(of);
#pragma omp for schedule(dynamic, 1) nowait
        for (int64_t first = 0; first < count; first += CHUNK_HITS) {
            const int64_t left = count - first;
            if (t && !t->thread.out_of_memory)
                trace_chunk(t, hits + first, rays + first, (int)(left < CHUNK_HITS ? left : CHUNK_HITS));
        }
        is_well = tracer_free(t);
        region_leave();
    }
    return is_well;
}

static insitu_status prepare_and_build_occluders(render_occluders *of, const render_job *job, base_error *error)
{
    const insitu_status status = render_prepare_surfaces(job, &of->job, &of->frame, error);
    if (status) return status;
    of->kernels = render_kernels();
    of->threads = of->job.threads > 0 ? of->job.threads : omp_get_max_threads();
    return occluders_build(&of->frame, of->kernels->width, of->threads, &of->trees, error);
}

insitu_status render_occluders_create(const render_job *job, render_occluders **out, base_error *error)
{
    *out = NULL;
    if (!job->part_count) return INSITU_OK;
    render_occluders *of = base_calloc(1, sizeof *of);
    if (!of) return base_fail(error, INSITU_ERROR_MEMORY, "no memory for what blocks rays from hits");
    const insitu_status status = prepare_and_build_occluders(of, job, error);
    if (status)
        render_occluders_free(of);
    else
        *out = of;
    return status;
}

void render_occluders_free(render_occluders *of)
{
    if (!of) return;
    if (of->kernels) render_free_prepared_frame(&of->frame);
    occluders_free(&of->trees);
    base_free(of);
}

insitu_status render_clear_blocked_rays(const render_occluders *of, const render_hit *hits, render_hit_rays *rays,
                                        int64_t count, base_error *error)
{
    if (!count || !of || !(of->trees.triangles.node_count || of->trees.slabs.node_count)) return INSITU_OK;
    if (trace_all(of, hits, rays, count)) return INSITU_OK;
    return base_fail(error, INSITU_ERROR_MEMORY, "no memory for the rays of %lld hits", (long long)count);
}

/* ---- which ranks' bounding boxes a hit's rays meet ------------------------------------------------------------ */

static bool is_opaque(const render_surface_layer *layer)
{
    return !(layer->opacity < 1);
}

render_box render_occluder_box(const render_job *job)
{
    return hit_box(job, is_opaque);
}

/* Margin by which boxes are extended, in scaled units. It is larger than the rounding errors of rays and of float32
 * boxes. */
static const double box_margin = 1e-5;

/* Returns whether a ray may meet the box, extended by the margin. from: point at which it begins; direction: unit
 * vector; reach: the ray's length; all in scene units. */
static bool meets_box(const double from[3], const double direction[3], double reach, double margin,
                      const render_box *box)
{
    double begin = 0, end = reach;
    for (int a = 0; a < 3; a++) {
        const double low = box->lower[a] - margin - from[a], high = box->upper[a] + margin - from[a];
        if (!(low <= high)) return false;
        if (fabs(direction[a]) < 1e-9) {
            /* the ray is almost parallel to the box's two faces on this axis; it could enter or leave the space between
             * them only if it were far longer than the scene */
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

void render_find_boxes_met_by_rays(const render_job *job, const render_hit *hit, const render_hit_rays *rays,
                                   const render_box *boxes, int count, render_box_callback *take, void *state)
{
    const render_occlusion *o = job->occlusion;
    const hit_frame p = compute_hit_frame(job, hit);
    const double margin = box_margin / job->space.scale;
    double samples[RENDER_MAX_SAMPLES][3];
    if (rays->samples) hit_directions(job, hit->pixel, (const double(*)[3])p.axes, samples);
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

/* ---- lighting of fragments ------------------------------------------------------------------------------------ */

/* Computes the factors of the diffuse and specular light of a hit as kernel_shade() does, but in double and only from
 * the lights whose bits are set in `lights`. */
static void compute_hit_lighting(const render_job *job, const render_material *m, const hit_frame *p, uint32_t lights,
                                 double diffuse[3], double specular[3])
{
    const double *n = p->axes[2];
    for (int a = 0; a < 3; a++) diffuse[a] = (double)m->ambient, specular[a] = 0;
    for (int i = 0; i < job->light_count; i++) {
        const double *l = job->lights[i].direction;
        const float *c = job->lights[i].colour;
        double half[3] = {p->view[0] + l[0], p->view[1] + l[1], p->view[2] + l[2]};
        if (!(lights >> i & 1)) continue;
        const double length = sqrt(hit_dot(half, half)), nl = fmax(hit_dot(n, l), 0);
        const double nh = length > 0 ? fmax(hit_dot(n, half) / length, 0) : 0;
        const double shine = nl > 0 && nh > 0 ? exp2(log2(fmax(nh, 1e-20)) * (double)m->shininess) : 0;
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
    layer = find_layer_of_fragment(job, f);
    if (!render_takes_light(&layer->material)) return;
    hit = (render_hit){f->pixel, f->t_in, {f->t_out, f->transmittance}};
    f->t_out = f->t_in;
    f->transmittance = layer->opacity >= 1 ? 0 : 1 - layer->opacity;
    const render_occlusion *o = job->occlusion;
    const hit_frame p = compute_hit_frame(job, &hit);
    const double sky = o->samples ? (double)__builtin_popcountll(open->samples) / o->samples : 1;
    compute_hit_lighting(job, &layer->material, &p, open->lights | ~o->lights, diffuse, specular);
    const double opacity = layer->opacity >= 1 ? 1 : (double)layer->opacity;
    for (int a = 0; a < 3; a++) f->colour[a] = (float)((double)f->colour[a] * diffuse[a] * sky + specular[a] * opacity);
}
