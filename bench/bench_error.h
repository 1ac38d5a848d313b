/* Measures how far a frame is from the truth on some of its pixels: one at a hashed place in each square block of the
 * image. The truth is the tests' brute-force renderer in double, which knows no tree. */
#ifndef BENCH_ERROR_H
#define BENCH_ERROR_H

#include "bench_stats.h"
#include "render.h"

/* The chosen pixels, and the cells that can be seen in them. */
typedef struct bench_pixels bench_pixels;

/* camera is a perspective one with all cells in front of it; block is the side of a block in pixels. Running out of
 * memory ends the process. */
bench_pixels *bench_pixels_create(const grid *cells, const render_camera *camera, int block);
void bench_pixels_destroy(bench_pixels *pixels);

int bench_pixels_count(const bench_pixels *pixels);
void bench_pixels_place(const bench_pixels *pixels, int i, int *x, int *y);

/* The cells that can be seen in the chosen pixels, with the whole mesh's vertices. */
const grid *bench_pixels_cells(const bench_pixels *pixels);

/* Merges the chosen pixels of a frame as compositing would, over a clear background: rgba gets count × 4, depths their
 * depths along the camera's axis, infinite where there is no surface. */
void bench_pixels_merge(const bench_pixels *pixels, const render_space *space, const fragment_list *fragments,
                        float *rgba, double *depths);

typedef struct bench_surface_error {
    int checked;       /* pixels */
    int disagreements; /* pixels hit in the frame or in the reference, but not in both */
    int ambiguous;     /* of these, pixels whose ray met a cell with more than one root */
    bench_stats depth; /* |difference| along the camera's axis, where both hit */
    bench_stats field; /* |exact(point hit) - isovalue|: the error of the cells' interpolation */
} bench_surface_error;

/* fragments are what render_frame() made of job, which has one opaque isosurface and one part, the grid of pixels. */
bench_surface_error bench_surface_compare(const bench_pixels *pixels, const render_job *job,
                                          double (*exact)(const double position[3]), const fragment_list *fragments);

/* For a job with volumes alone: each pixel's largest difference in linear premultiplied red, green, blue or opacity,
 * where the ray meets cells. */
bench_stats bench_volume_compare(const bench_pixels *pixels, const render_job *job, const fragment_list *fragments);

#endif
