#include "bench_routes.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "session_image.h"

static void *require_memory(void *p)
{
    if (!p) abort();
    return p;
}

static const float *get_float_data(const grid_array *a)
{
    return (const float *)(const void *)a->data;
}

static void interleave_coordinates(bench_routes *r, const float *const coordinates[3], int64_t count)
{
#pragma omp parallel for schedule(static)
    for (int64_t v = 0; v < count; v++)
        for (int axis = 0; axis < 3; axis++) r->interleaved[3 * v + axis] = coordinates[axis][v];
}

static void create_contour(bench_routes *r, const bench_scene *scene)
{
    const grid *g = &scene->view.cells;
    const bench_contour_mesh mesh = {.vertex_count = g->vertex_count,
                                     .cell_count = g->cell_count,
                                     .cell_type = g->cell_type,
                                     .xyz = r->interleaved,
                                     .values = get_float_data(&scene->view.field.values),
                                     .connectivity = (const int32_t *)(const void *)g->connectivity.data};
    bench_contour_view view = {.degrees = bench_degrees, .width = r->camera->width, .height = r->camera->height};
    for (int axis = 0; axis < 3; axis++) {
        view.eye[axis] = bench_eye[axis];
        view.focal[axis] = bench_focal[axis];
        view.up[axis] = bench_up[axis];
    }
    r->contour = bench_contour_create(&mesh, &view, scene->subject.threads);
    r->has_window = bench_contour_can_draw(r->contour);
    if (!r->has_window) fprintf(stderr, "%s: no X server: VTK draws nothing\n", scene->subject.program);
}

void bench_routes_create(bench_routes *r, const bench_scene *scene)
{
    const grid *g = &scene->view.cells;
    const size_t pixels = (size_t)scene->job.camera.width * (size_t)scene->job.camera.height;
    memset(r, 0, sizeof *r);
    r->subject = &scene->subject;
    r->camera = &scene->job.camera;
    if (!bench_contour_is_available()) return;
    r->interleaved = require_memory(malloc(3 * (size_t)g->vertex_count * sizeof(float)));
    const float *coordinates[3];
    for (int axis = 0; axis < 3; axis++) coordinates[axis] = get_float_data(&g->coordinates[axis]);
    interleave_coordinates(r, coordinates, g->vertex_count);
    create_contour(r, scene);
    if (!bench_embree_is_available()) return;
    r->embree = bench_embree_create(scene->subject.threads);
    r->depths = require_memory(malloc(pixels * sizeof *r->depths));
    r->normals = require_memory(malloc(3 * pixels * sizeof *r->normals));
}

void bench_routes_free(bench_routes *r)
{
    bench_embree_destroy(r->embree);
    bench_contour_destroy(r->contour);
    free(r->interleaved);
    free(r->depths);
    free(r->normals);
}

void bench_routes_set(bench_routes *r, const float *const coordinates[3], int64_t vertex_count, const float *values)
{
    if (!r->contour) return;
    interleave_coordinates(r, coordinates, vertex_count);
    bench_contour_set(r->contour, r->interleaved, values);
}

static void run_embree(bench_routes *r, bench_triangles triangles, double extract, int number, bool is_fast)
{
    double began = bench_start_timer();
    bench_embree_build(r->embree, triangles.xyz, triangles.count, is_fast);
    const double build = bench_stop_timer(began, number, is_fast ? &r->build_low : &r->build_medium);
    began = bench_start_timer();
    bench_embree_trace(r->embree, r->camera, r->depths, r->normals);
    const double trace = bench_stop_timer(began, number, is_fast ? &r->trace_low : &r->trace_medium);
    bench_add_sample(extract + build + trace, number, is_fast ? &r->embree_low : &r->embree_medium);
}

static void run_window(bench_routes *r, double extract, int number)
{
    double began = bench_start_timer();
    bench_contour_draw(r->contour);
    const double first = bench_stop_timer(began, number, &r->first);
    bench_add_sample(extract + first, number, &r->vtk);
    began = bench_start_timer();
    bench_contour_draw(r->contour);
    bench_stop_timer(began, number, &r->later);
}

void bench_routes_run(bench_routes *r, const double *isovalues, int count, int number)
{
    if (!r->contour) return;
    const double began = bench_start_timer();
    const bench_triangles triangles = bench_contour_extract(r->contour, isovalues, count);
    const double extract = bench_stop_timer(began, number, &r->extract);
    r->triangles = triangles.count;
    if (r->has_window) run_window(r, extract, number);
    if (!r->embree) return;
    run_embree(r, triangles, extract, number, true);
    run_embree(r, triangles, extract, number, false);
}

static void print_series(bench_routes *r, const char *name, const char *what, bench_series *series)
{
    char measure[96];
    snprintf(measure, sizeof measure, "%s %s", name, what);
    if (series->count) bench_print_series(r->subject, measure, series);
    series->count = 0;
}

void bench_routes_print(bench_routes *r, const char *name)
{
    char measure[96];
    if (!r->contour) return;
    snprintf(measure, sizeof measure, "%s triangles", name);
    bench_print_number(r->subject, measure, "triangles", (double)r->triangles);
    print_series(r, name, "vtk extract", &r->extract);
    print_series(r, name, "vtk first render", &r->first);
    print_series(r, name, "vtk later render", &r->later);
    print_series(r, name, "vtk route", &r->vtk);
    print_series(r, name, "embree build low", &r->build_low);
    print_series(r, name, "embree build medium", &r->build_medium);
    print_series(r, name, "embree trace low", &r->trace_low);
    print_series(r, name, "embree trace medium", &r->trace_medium);
    print_series(r, name, "embree route low", &r->embree_low);
    print_series(r, name, "embree route medium", &r->embree_medium);
}

/* ---- comparison of pictures ---- */

static void compare_depths(bench_routes *r, const float *own, const float *theirs, const char *name, const char *peer)
{
    const int64_t count = (int64_t)r->camera->width * r->camera->height;
    double *differences = require_memory(malloc((size_t)count * sizeof *differences));
    char measure[96];
    int64_t either = 0, one = 0;
    int both = 0;
    for (int64_t i = 0; i < count; i++) {
        const bool is_own = isfinite(own[i]), is_theirs = isfinite(theirs[i]);
        either += is_own || is_theirs;
        one += is_own != is_theirs;
        if (is_own && is_theirs) differences[both++] = fabs((double)own[i] - (double)theirs[i]);
    }
    snprintf(measure, sizeof measure, "%s %s coverage difference", name, peer);
    bench_print_number(r->subject, measure, "share", either ? (double)one / (double)either : 0);
    bench_stats depth = bench_compute_stats(differences, both);
    /* the largest 1 % are left out, because at silhouettes the two hits may be on different sheets of the surface */
    if (both) depth.high = differences[(int64_t)both * 99 / 100];
    snprintf(measure, sizeof measure, "%s %s depth difference", name, peer);
    bench_print(r->subject, measure, "scene (max: of 99%)", depth);
    free(differences);
}

/* Writes depths as grey levels: black at a distance of 1.5 behind the scene's centre, white at 1.5 in front of it. */
static void write_depths(const bench_routes *r, const float *depths, const char *folder, const char *name)
{
    const int64_t count = (int64_t)r->camera->width * r->camera->height;
    const double middle = sqrt(bench_eye[0] * bench_eye[0] + bench_eye[1] * bench_eye[1] + bench_eye[2] * bench_eye[2]);
    float *rgba = require_memory(malloc(4 * (size_t)count * sizeof *rgba));
    char path[1024];
    base_error error;
    for (int64_t i = 0; i < count; i++) {
        const double grey = isfinite(depths[i]) ? 0.5 - ((double)depths[i] - middle) / 3 : 0;
        for (int channel = 0; channel < 3; channel++) rgba[4 * i + channel] = (float)fmin(1, fmax(0, grey));
        rgba[4 * i + 3] = 1;
    }
    const insitu_image image = {.width = r->camera->width, .height = r->camera->height, .rgba = rgba};
    snprintf(path, sizeof path, "%s/%s-%d-%s.png", folder, r->subject->mesh, r->subject->n, name);
    if (session_write_image(&image, INSITU_PNG8, path, &error) != INSITU_OK) fprintf(stderr, "%s\n", error.message);
    free(rgba);
}

void bench_routes_compare(bench_routes *r, const float *depths, const char *name, const char *folder)
{
    const size_t count = (size_t)r->camera->width * (size_t)r->camera->height;
    if (folder) write_depths(r, depths, folder, "insitu");
    if (r->has_window) {
        float *drawn = require_memory(malloc(count * sizeof *drawn));
        bench_contour_read_depths(r->contour, drawn);
        compare_depths(r, depths, drawn, name, "vtk");
        if (folder) write_depths(r, drawn, folder, "vtk");
        free(drawn);
    }
    if (!r->embree) return;
    compare_depths(r, depths, r->depths, name, "embree");
    if (folder) write_depths(r, r->depths, folder, "embree");
}
