/* Measures Embree as a peer: it traces rays in a triangle mesh, and builds trees over the bounding boxes of cells. */
#ifndef BENCH_EMBREE_H
#define BENCH_EMBREE_H

#include "render.h"

/* Returns whether this program was built with Embree; if not, no other function here may be called. */
bool bench_embree_is_available(void);

typedef struct bench_embree bench_embree;

bench_embree *bench_embree_create(int threads);
void bench_embree_destroy(bench_embree *embree);

/* Builds the acceleration structure of triangles that share no vertices, and replaces the previous structure. xyz:
 * triangle_count × 9, borrowed, followed by 4 readable bytes. Uses Morton codes (RTC_BUILD_QUALITY_LOW) if is_fast, and
 * binned SAH (MEDIUM) otherwise. */
void bench_embree_build(bench_embree *embree, const float *xyz, int64_t triangle_count, bool is_fast);

/* Traces a ray for each pixel, in packets of 16 = 4 × 4. `depths` receives the hit's depth along the camera's axis, or
 * infinity. `normals` receives the triangle's normal (pixels × 3, of any length and either sign). */
void bench_embree_trace(bench_embree *embree, const render_camera *camera, float *depths, float *normals);

/* A ray with a direction of length 1 that ends at the distance `far`. */
typedef struct bench_embree_ray {
    float origin[3], direction[3], far;
} bench_embree_ray;

/* Finds which rays hit a triangle. Traces packets of 16 rays in the given order. */
void bench_embree_occlude(bench_embree *embree, const bench_embree_ray *rays, int64_t count, bool *blocked);

typedef enum bench_embree_builder {
    BENCH_EMBREE_LOW,    /* Morton codes, binary */
    BENCH_EMBREE_MEDIUM, /* binned SAH, binary, up to 7 cells per leaf: the tree that libinsitu's is compared with */
    BENCH_EMBREE_MEDIUM_WIDE /* binned SAH, 8-wide, up to 8 cells per leaf: Embree's fastest */
} bench_embree_builder;

/* Stores the bounding boxes of all cells in Embree's format. */
void bench_embree_set_cells(bench_embree *embree, const grid *cells);

/* Runs rtcBuildBVH on a copy of the boxes, because the builder sorts them in place. The memory of the previous build is
 * reused. Returns the time in seconds, excluding the copy. */
double bench_embree_build_cells(bench_embree *embree, bench_embree_builder builder);

/* Returns the SAH cost of the most recently built tree, as mmbvh_cost() defines it. The tree must be binary. */
double bench_embree_compute_cost(const bench_embree *embree);

#endif
