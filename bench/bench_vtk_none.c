/* Replaces bench_vtk.cpp in builds without VTK. */
#include "bench_vtk.h"

bool bench_vtk_draw(const bench_vtk_request *request, bench_vtk_result *result, float *rgba)
{
    (void)request, (void)result, (void)rgba;
    return false;
}

bool bench_vtk_read(const char *path, const char *field, test_mesh *out)
{
    (void)path, (void)field, (void)out;
    return false;
}

bool bench_vtk_is_available(void)
{
    return false;
}
