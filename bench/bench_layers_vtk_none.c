#include "bench_layers_vtk.h"

#include <stddef.h>

bool bench_layers_vtk_is_available(void)
{
    return false;
}

bench_layers_vtk *bench_layers_vtk_create(const bench_contour_mesh *mesh, const bench_contour_view *view,
                                          const bench_layers_parameters *parameters, int threads)
{
    (void)mesh, (void)view, (void)parameters, (void)threads;
    return NULL;
}

void bench_layers_vtk_destroy(bench_layers_vtk *layers)
{
    (void)layers;
}

void bench_layers_vtk_set(bench_layers_vtk *layers, const float *values, const float *velocities)
{
    (void)layers, (void)values, (void)velocities;
}

void bench_layers_vtk_draw(bench_layers_vtk *layers, bench_layer layer)
{
    (void)layers, (void)layer;
}
