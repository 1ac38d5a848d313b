/* Replaces bench_embree.c in builds without Embree. */
#include "bench_embree.h"

#include <stdlib.h>

bool bench_embree_is_available(void)
{
    return false;
}

bench_embree *bench_embree_create(int threads)
{
    (void)threads;
    return NULL;
}

void bench_embree_destroy(bench_embree *embree)
{
    (void)embree;
}

void bench_embree_build(bench_embree *embree, const float *xyz, int64_t triangle_count, bool is_fast)
{
    (void)embree, (void)xyz, (void)triangle_count, (void)is_fast;
    abort();
}

void bench_embree_trace(bench_embree *embree, const render_camera *camera, float *depths, float *normals)
{
    (void)embree, (void)camera, (void)depths, (void)normals;
    abort();
}

void bench_embree_occlude(bench_embree *embree, const bench_embree_ray *rays, int64_t count, bool *blocked)
{
    (void)embree, (void)rays, (void)count, (void)blocked;
    abort();
}

void bench_embree_set_cells(bench_embree *embree, const grid *cells)
{
    (void)embree, (void)cells;
    abort();
}

double bench_embree_build_cells(bench_embree *embree, bench_embree_builder builder)
{
    (void)embree, (void)builder;
    abort();
}

double bench_embree_compute_cost(const bench_embree *embree)
{
    (void)embree;
    abort();
}
