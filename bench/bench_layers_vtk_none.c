#include "bench_layers_vtk.h"

#include <stddef.h>

bool bench_layers_vtk_is_available(void)
{
    return false;
}

bench_layers_vtk *bench_layers_vtk_create(const bench_contour_mesh *mesh, const bench_contour_view *view,
                                          const double normal[3], int threads)
{
    (void)mesh, (void)view, (void)normal, (void)threads;
    return NULL;
}

void bench_layers_vtk_destroy(bench_layers_vtk *layers)
{
    (void)layers;
}

void bench_layers_vtk_set(bench_layers_vtk *layers, const float *values)
{
    (void)layers, (void)values;
}

void bench_layers_vtk_draw(bench_layers_vtk *layers, bench_layer layer)
{
    (void)layers, (void)layer;
}
