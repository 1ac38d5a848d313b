/* Embree as a peer: ray tracing of a triangle mesh, and its builder over the boxes of cells. */
#ifndef BENCH_EMBREE_H
#define BENCH_EMBREE_H

#include "render.h"

/* Is Embree in this program? None of the rest is to be called otherwise. */
bool bench_embree_is_there(void);

typedef struct bench_embree bench_embree;

bench_embree *bench_embree_create(int threads);
void bench_embree_destroy(bench_embree *embree);

/* The acceleration structure of triangles, three vertices of their own each (xyz: triangle_count × 9, borrowed, with 4
 * bytes that can be read behind them), which replaces the last one. is_fast: by Morton codes (RTC_BUILD_QUALITY_LOW),
 * else by binned SAH (MEDIUM). */
void bench_embree_build(bench_embree *embree, const float *xyz, int64_t triangle_count, bool is_fast);

/* What a ray of each pixel hits: the depth along the camera's axis, infinity for nothing, and the triangle's normal
 * (pixels × 3, not of unit length, of either sign). By packets of 16 = 4 × 4 rays. */
void bench_embree_trace(bench_embree *embree, const render_camera *camera, float *depths, float *normals);

typedef enum bench_embree_builder {
    BENCH_EMBREE_LOW,        /* Morton codes, binary */
    BENCH_EMBREE_MEDIUM,     /* binned SAH, binary, up to 7 cells a leaf: the tree that ours is compared with */
    BENCH_EMBREE_MEDIUM_WIDE /* binned SAH, 8-wide, up to 8 cells a leaf: its fastest */
} bench_embree_builder;

/* The boxes of all cells in Embree's form, made once. */
void bench_embree_set_cells(bench_embree *embree, const grid *cells);

/* Seconds of rtcBuildBVH over the boxes, which are copied before, as it sorts them in place. In the memory of the last
 * such build. */
double bench_embree_build_cells(bench_embree *embree, bench_embree_builder builder);

/* SAH cost of a binary tree built last, counted as mmbvh_cost() does. */
double bench_embree_cost(const bench_embree *embree);

#endif
