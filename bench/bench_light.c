/* Measures rays from the hits of an isosurface, towards a light and into the hemisphere. They are measured in turns
 * with the frame that finds the hits, and with Embree, in one process. Embree traces the same rays in the triangles
 * that VTK extracts. Prints CSV. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bench_command.h"
#include "bench_routes.h"
#include "memory.h"
#include "render_light.h"

enum { SAMPLES = 16 };

/* The radius of ambient occlusion is 1/3. This is a sixth of the mesh's side, which is 2, and about a tenth of its
 * diagonal, which is the default of scenes. */
static const render_occlusion shadows = {1, 0, 1}, sky = {0, SAMPLES, 1.0 / 3};

/* The rays of one kind, shadow or occlusion rays. */
typedef struct kind {
    const char *name;
    const render_occlusion *occlusion;
    int64_t rays, blocked;
    bench_series trace, embree;
    bench_embree_ray *list;
    bool *theirs;
} kind;

enum { KINDS = 2 };

typedef struct lit {
    bench_scene scene;
    bench_routes routes;
    bench_series frame, prepare;
    render_hit *hits;
    render_hit_rays *rays, *open;
    int64_t count;
    kind kinds[KINDS];
} lit;

static void *require_memory(void *p)
{
    if (!p) abort();
    return p;
}

static void exit_with_error(lit *l)
{
    fprintf(stderr, "bench_light: %s\n", l->scene.error.message);
    exit(1);
}

static void copy_hits(lit *l)
{
    const size_t most = (size_t)l->scene.fragments.count + 1;
    l->hits = require_memory(realloc(l->hits, most * sizeof *l->hits));
    l->rays = require_memory(realloc(l->rays, most * sizeof *l->rays));
    l->open = require_memory(realloc(l->open, most * sizeof *l->open));
    l->count = 0;
    for (int64_t i = 0; i < l->scene.fragments.count; i++)
        l->count += render_make_hit_from_fragment(&l->scene.job, &l->scene.fragments.items[i], &l->hits[l->count],
                                                  &l->rays[l->count]);
}

static int count_ray_bits(const render_hit_rays *rays)
{
    return __builtin_popcountll(rays->samples) + __builtin_popcount(rays->lights);
}

/* Lists the rays in Embree's format, in the order of the hits. */
static void list_rays(lit *l, kind *k)
{
    const render_job *job = &l->scene.job;
    double directions[RENDER_MAX_SAMPLES][3], start[3];
    k->list = require_memory(realloc(k->list, (size_t)(k->rays + 1) * sizeof *k->list));
    k->theirs = require_memory(realloc(k->theirs, (size_t)(k->rays + 1) * sizeof *k->theirs));
    bench_embree_ray *to = k->list;
    for (int64_t i = 0; i < l->count; i++) {
        render_compute_hemisphere_rays(job, &l->hits[i], start, directions);
        for (int n = 0; n < count_ray_bits(&l->rays[i]); n++, to++)
            for (int a = 0; a < 3; a++) {
                to->origin[a] = (float)start[a];
                to->direction[a] = (float)(job->occlusion->lights ? job->lights[0].direction : directions[n])[a];
                to->far = job->occlusion->lights ? INFINITY : (float)job->occlusion->radius;
            }
    }
}

static void count_rays(lit *l, kind *k)
{
    k->rays = k->blocked = 0;
    for (int64_t i = 0; i < l->count; i++) {
        k->rays += count_ray_bits(&l->rays[i]);
        k->blocked += count_ray_bits(&l->rays[i]) - count_ray_bits(&l->open[i]);
    }
}

static void measure_kind(lit *l, kind *k, const render_occluders *occluders, int number)
{
    l->scene.job.occlusion = k->occlusion;
    copy_hits(l);
    memcpy(l->open, l->rays, (size_t)l->count * sizeof *l->open);
    const double began = bench_start_timer();
    if (render_clear_blocked_rays(occluders, l->hits, l->open, l->count, &l->scene.error)) exit_with_error(l);
    bench_stop_timer(began, number, &k->trace);
    count_rays(l, k);
    if (!l->routes.embree) return;
    list_rays(l, k);
    const double theirs_began = bench_start_timer();
    bench_embree_occlude(l->routes.embree, k->list, k->rays, k->theirs);
    bench_stop_timer(theirs_began, number, &k->embree);
}

static void measure_all_kinds(lit *l, int number)
{
    const double began = bench_start_timer();
    bench_scene_frame(&l->scene);
    bench_stop_timer(began, number, &l->frame);
    bench_routes_run(&l->routes, bench_isovalues, 1, number);
    for (int i = 0; i < KINDS; i++) {
        render_occluders *occluders;
        l->scene.job.occlusion = l->kinds[i].occlusion;
        const double prepare_began = bench_start_timer();
        if (render_occluders_create(&l->scene.job, &occluders, &l->scene.error)) exit_with_error(l);
        bench_stop_timer(prepare_began, number, &l->prepare);
        measure_kind(l, &l->kinds[i], occluders, number);
        render_occluders_free(occluders);
    }
}

static void print_rate(const lit *l, const kind *k, const char *what, bench_series *series)
{
    char measure[96];
    if (!series->count) return;
    snprintf(measure, sizeof measure, "%s %s", k->name, what);
    bench_print_series(&l->scene.subject, measure, series);
    const bench_stats stats = bench_compute_stats(series->seconds, series->count);
    snprintf(measure, sizeof measure, "%s %s rate", k->name, what);
    bench_print_number(&l->scene.subject, measure, "Mrays/s", 1e-3 * (double)k->rays / stats.median);
}

/* Prints the share of rays that Embree finds blocked, for comparison with libinsitu's share. The shares may differ: if
 * cells are not tets, the triangles are a different surface, and Embree rounds differently. */
static void print_share_blocked_in_embree(const lit *l, const kind *k)
{
    int64_t theirs = 0;
    char measure[96];
    if (!l->routes.embree) return;
    for (int64_t i = 0; i < k->rays; i++) theirs += k->theirs[i];
    snprintf(measure, sizeof measure, "%s embree blocked", k->name);
    bench_print_number(&l->scene.subject, measure, "share", (double)theirs / (double)k->rays);
}

static void print_measurements(lit *l)
{
    char measure[96];
    const bench_subject *subject = &l->scene.subject;
    bench_print_number(subject, "hits", "hits", (double)l->count);
    bench_print_series(subject, "frame", &l->frame);
    bench_print_series(subject, "prepare", &l->prepare);
    for (int i = 0; i < KINDS; i++) {
        kind *k = &l->kinds[i];
        snprintf(measure, sizeof measure, "%s blocked", k->name);
        bench_print_number(subject, measure, "share", (double)k->blocked / (double)k->rays);
        print_share_blocked_in_embree(l, k);
        print_rate(l, k, "trace", &k->trace);
        print_rate(l, k, "embree trace", &k->embree);
    }
    bench_routes_print(&l->routes, "isosurface");
}

static void measure_mesh(const bench_command *command, test_mesh_kind mesh, int n)
{
    static lit l;
    memset(&l, 0, sizeof l);
    l.kinds[0] = (kind){.name = "shadow", .occlusion = &shadows};
    l.kinds[1] = (kind){.name = "sky", .occlusion = &sky};
    bench_scene_create(&l.scene, "bench_light", mesh, n);
    bench_scene_resize(&l.scene, BENCH_WIDTH / command->shrink, BENCH_HEIGHT / command->shrink);
    bench_scene_show_surfaces(&l.scene, 1);
    bench_scene_build(&l.scene);
    l.scene.surface.contact = 0.5F; /* the default of sessions */
    l.scene.job.paint = RENDER_UNLIT;
    l.scene.job.occlusion = &shadows;
    bench_routes_create(&l.routes, &l.scene);
    for (int i = 0; i <= command->runs; i++) measure_all_kinds(&l, i);
    print_measurements(&l);
    for (int i = 0; i < KINDS; i++) {
        free(l.kinds[i].list);
        free(l.kinds[i].theirs);
    }
    free(l.hits);
    free(l.rays);
    free(l.open);
    bench_routes_free(&l.routes);
    bench_scene_free(&l.scene);
}

int main(int argc, char **argv)
{
    return bench_measure_meshes(
        argc, argv,
        "Measures rays from the hits of an isosurface of each MESH (tets or hexes) of N^3 cubes,\n"
        "towards a light and into the hemisphere, beside Embree's on VTK's triangles.",
        TEST_HEXES, measure_mesh);
}
