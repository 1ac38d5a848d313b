/* How far a frame is from the truth, on some of its pixels: one at a hashed place in each block of BENCH_BLOCK ×
 * BENCH_BLOCK. The truth is the tests' brute-force renderer in double, which knows no tree. */
#ifndef BENCH_ERROR_H
#define BENCH_ERROR_H

#include "bench_stats.h"
#include "render.h"

enum { BENCH_BLOCK = 60 };

/* The chosen pixels, and the cells that can be seen in them. */
typedef struct bench_pixels bench_pixels;

/* camera is a perspective one with all cells in front of it. Running out of memory ends the process. */
bench_pixels *bench_pixels_create(const grid *cells, const render_camera *camera);
void bench_pixels_destroy(bench_pixels *pixels);

typedef struct bench_surface_error {
    int checked;       /* pixels */
    int disagreements; /* pixels hit in the frame or in the reference, but not in both */
    int ambiguous;     /* of those: pixels whose ray met a cell with more than one root */
    bench_stats depth; /* |difference| along the camera's axis, where both hit */
    bench_stats field; /* |exact(point hit) - isovalue|: what the cells' interpolation costs */
} bench_surface_error;

/* fragments: what render_frame() made of job, which has one opaque isosurface and one part: the grid of pixels. */
bench_surface_error bench_surface_compare(const bench_pixels *pixels, const render_job *job,
                                          double (*exact)(const double position[3]), const fragment_list *fragments);

/* The largest difference of a pixel's linear premultiplied red, green, blue or opacity, where the ray meets cells, of a
 * job with volumes alone. */
bench_stats bench_volume_compare(const bench_pixels *pixels, const render_job *job, const fragment_list *fragments);

#endif
