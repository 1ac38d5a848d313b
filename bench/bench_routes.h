/* The alternatives that a user has to libinsitu: VTK's extraction and rendering, and Embree's ray tracing of the
 * extracted triangles. An alternative that was not built into this program, or that has no window, is left out. */
#ifndef BENCH_ROUTES_H
#define BENCH_ROUTES_H

#include "bench_contour.h"
#include "bench_embree.h"
#include "bench_scene.h"

typedef struct bench_routes {
    const bench_subject *subject;
    const render_camera *camera;
    float *interleaved; /* the coordinates in VTK's layout */
    bench_contour *contour;
    bench_embree *embree;
    bool has_window;
    float *depths, *normals; /* of Embree's most recent picture */
    int64_t triangles;       /* number of triangles of the most recent extraction */
    bench_series extract, first, later, build_low, build_medium, trace_low, trace_medium;
    bench_series vtk;                       /* sum of extract and first */
    bench_series embree_low, embree_medium; /* sums of extract, build and trace */
} bench_routes;

void bench_routes_create(bench_routes *routes, const bench_scene *scene);
void bench_routes_free(bench_routes *routes);

/* Sets new coordinates (arrays of x, y and z of vertex_count each) and values of the scene's mesh. */
void bench_routes_set(bench_routes *routes, const float *const coordinates[3], int64_t vertex_count,
                      const float *values);

/* Runs and times all alternatives one time. Run number 0 is the warm-up; its times are dropped. */
void bench_routes_run(bench_routes *routes, const double *isovalues, int count, int number);

/* Prints and removes the collected times. The names of the measures begin with `name`, the name of the layer. */
void bench_routes_print(bench_routes *routes, const char *name);

/* Compares the depths in the alternatives' most recent pictures with `depths`. The array `depths` has one depth for
 * each of the camera's pixels, infinity in empty pixels. Prints the number of pixels that only one of the two pictures
 * covers, and the difference of the depths in pixels that both cover. Writes the depths as PNG files to `folder`,
 * unless it is NULL. */
void bench_routes_compare(bench_routes *routes, const float *depths, const char *name, const char *folder);

#endif
