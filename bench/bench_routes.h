/* The routes that a user would take instead of libinsitu: VTK's extraction and picture, and Embree's ray tracing of the
 * extraction. A route that is not in this program, or has no window, is left out. */
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

/* Sets new coordinates (x, y, z, vertex_count each) and values of the scene's mesh. */
void bench_routes_set(bench_routes *routes, const float *const coordinates[3], int64_t vertex_count,
                      const float *values);

/* Runs and times all routes once; number 0 is the warm-up. */
void bench_routes_run(bench_routes *routes, const double *isovalues, int count, int number);

/* Prints and forgets the times. name is the layer's, put before the measures' names. */
void bench_routes_print(bench_routes *routes, const char *name);

/* Compares the routes' last pictures with these depths (of the camera's pixels, infinity where nothing is). Prints the
 * number of pixels that only one of them shows, and the difference in depth where both do. Depths are written to folder
 * as PNG, unless it is NULL. */
void bench_routes_compare(bench_routes *routes, const float *depths, const char *name, const char *folder);

#endif
