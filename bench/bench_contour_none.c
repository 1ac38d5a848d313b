/* Replaces bench_contour.cpp in builds without VTK. */
#include "bench_contour.h"

#include <stdlib.h>

bool bench_contour_is_available(void)
{
    return false;
}

bench_contour *bench_contour_create(const bench_contour_mesh *mesh, const bench_contour_view *view, int threads)
{
    (void)mesh, (void)view, (void)threads;
    return NULL;
}

void bench_contour_destroy(bench_contour *contour)
{
    (void)contour;
}

bool bench_contour_can_draw(bench_contour *contour)
{
    (void)contour;
    return false;
}

void bench_contour_set(bench_contour *contour, const float *xyz, const float *values)
{
    (void)contour, (void)xyz, (void)values;
    abort();
}

bench_triangles bench_contour_extract(bench_contour *contour, const double *isovalues, int count)
{
    (void)contour, (void)isovalues, (void)count;
    abort();
}

void bench_contour_draw(bench_contour *contour)
{
    (void)contour;
    abort();
}

void bench_contour_read_depths(bench_contour *contour, float *depths)
{
    (void)contour, (void)depths;
    abort();
}
