/* Measures the error of a frame in some of its pixels: one at a hashed position in each square block of the image. The
 * true values are computed in double by the tests' brute-force renderer. It uses no tree. */
#ifndef BENCH_ERROR_H
#define BENCH_ERROR_H

#include "bench_stats.h"
#include "render.h"

/* The chosen pixels, and the cells that may be visible in them. */
typedef struct bench_pixels bench_pixels;

/* Chooses the pixels. The camera must have perspective and all cells in front of it; `block` is the side of a block in
 * pixels. Running out of memory ends the process. */
bench_pixels *bench_pixels_create(const grid *cells, const render_camera *camera, int block);
void bench_pixels_destroy(bench_pixels *pixels);

int bench_pixels_count(const bench_pixels *pixels);
void bench_pixels_position(const bench_pixels *pixels, int i, int *x, int *y);

/* Returns a grid of the cells that may be visible in the chosen pixels. The grid has all vertices of the mesh. */
const grid *bench_pixels_cells(const bench_pixels *pixels);

/* Merges the fragments of the chosen pixels as compositing would, over a transparent background. rgba receives count ×
 * 4 numbers. depths receives the depths along the camera's axis, infinite in pixels without a surface. */
void bench_pixels_merge(const bench_pixels *pixels, const render_space *space, const fragment_list *fragments,
                        float *rgba, double *depths);

/* The error of a frame with an isosurface, over the chosen pixels. */
typedef struct bench_surface_error {
    int checked;       /* number of pixels */
    int disagreements; /* pixels hit either in the frame or in the reference, but not in both */
    int ambiguous;     /* disagreements whose ray met a cell with more than one root */
    /* |difference| of the depths along the camera's axis, over pixels that are hit in the frame and in the reference */
    bench_stats depth;
    bench_stats field; /* |exact(position of the hit) - isovalue|: the error of the cells' interpolation */
} bench_surface_error;

/* Compares a frame with the reference. `fragments` are those of render_frame() for `job`. The job must have one opaque
 * isosurface and one part, whose grid was passed to bench_pixels_create(). `exact` returns the exact value of the field
 * at a position. */
bench_surface_error bench_surface_compare(const bench_pixels *pixels, const render_job *job,
                                          double (*exact)(const double position[3]), const fragment_list *fragments);

/* Compares a frame of a job that has only volumes. Returns the largest difference of each pixel in linear premultiplied
 * red, green, blue or opacity, over the pixels whose ray meets cells. */
bench_stats bench_volume_compare(const bench_pixels *pixels, const render_job *job, const fragment_list *fragments);

#endif
