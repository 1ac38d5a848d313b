/* Embree as a peer: it traces rays in a triangle mesh, and builds trees over the boxes of cells. */
#ifndef BENCH_EMBREE_H
#define BENCH_EMBREE_H

#include "render.h"

/* Tells whether Embree is in this program; otherwise nothing else here may be called. */
bool bench_embree_is_available(void);

typedef struct bench_embree bench_embree;

bench_embree *bench_embree_create(int threads);
void bench_embree_destroy(bench_embree *embree);

/* Builds the acceleration structure of triangles that share no vertices (xyz: triangle_count × 9, borrowed, with 4
 * readable bytes behind them); it replaces the last one. If is_fast, by Morton codes (RTC_BUILD_QUALITY_LOW), else by
 * binned SAH (MEDIUM). */
void bench_embree_build(bench_embree *embree, const float *xyz, int64_t triangle_count, bool is_fast);

/* Traces a ray for each pixel, in packets of 16 = 4 × 4. depths gets the hit's depth along the camera's axis, or
 * infinity; normals the triangle's normal (pixels × 3, not of unit length, of either sign). */
void bench_embree_trace(bench_embree *embree, const render_camera *camera, float *depths, float *normals);

/* A ray of unit length's direction that ends after far. */
typedef struct bench_embree_ray {
    float origin[3], direction[3], far;
} bench_embree_ray;

/* Finds which of the rays meet a triangle, by packets of 16 in the order given. */
void bench_embree_occlude(bench_embree *embree, const bench_embree_ray *rays, int64_t count, bool *blocked);

typedef enum bench_embree_builder {
    BENCH_EMBREE_LOW,        /* Morton codes, binary */
    BENCH_EMBREE_MEDIUM,     /* binned SAH, binary, up to 7 cells a leaf: the tree that ours is compared with */
    BENCH_EMBREE_MEDIUM_WIDE /* binned SAH, 8-wide, up to 8 cells a leaf: its fastest */
} bench_embree_builder;

/* Makes the boxes of all cells in Embree's form, once. */
void bench_embree_set_cells(bench_embree *embree, const grid *cells);

/* Runs rtcBuildBVH over a copy of the boxes, which it sorts in place, in the memory of the last such build. Returns the
 * seconds without the copy. */
double bench_embree_build_cells(bench_embree *embree, bench_embree_builder builder);

/* SAH cost of the last tree, a binary one, counted as by mmbvh_cost(). */
double bench_embree_cost(const bench_embree *embree);

#endif
