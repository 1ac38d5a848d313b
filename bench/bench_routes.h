/* The routes that a user would take instead, for the bench's own programs: VTK's extraction and picture, and Embree's
 * ray tracing of what was extracted. What is not in this program, or has no window, is left out. */
#ifndef BENCH_ROUTES_H
#define BENCH_ROUTES_H

#include "bench_contour.h"
#include "bench_embree.h"
#include "bench_scene.h"

typedef struct bench_routes {
    const bench_subject *subject;
    const render_camera *camera;
    float *interleaved; /* the coordinates as VTK takes them */
    bench_contour *contour;
    bench_embree *embree;
    bool has_window;
    float *depths, *normals; /* Embree's last picture */
    int64_t triangles;       /* of the last extraction */
    bench_series extract, first, later, build_low, build_medium, trace_low, trace_medium;
    bench_series vtk;                       /* extract + first */
    bench_series embree_low, embree_medium; /* extract + build + trace */
} bench_routes;

void bench_routes_create(bench_routes *routes, const bench_scene *scene);
void bench_routes_free(bench_routes *routes);

/* New coordinates (x, y, z each, vertex_count) and values of the scene's mesh. */
void bench_routes_set(bench_routes *routes, const float *const coordinates[3], int64_t vertex_count,
                      const float *values);

/* Go all of them once, timed. number 0: the warm-up. */
void bench_routes_run(bench_routes *routes, const double *isovalues, int count, int number);

/* Print and forget the times. name: of the layer, before the measures' names. */
void bench_routes_print(bench_routes *routes, const char *name);

/* Print how far the routes' last pictures are from these depths (of the camera's pixels, infinity where nothing is):
 * the pixels that one shows and the other does not, and the difference in depth where both show it. folder: write the
 * depths there, as PNG; NULL: do not. */
void bench_routes_compare(bench_routes *routes, const float *depths, const char *name, const char *folder);

#endif
