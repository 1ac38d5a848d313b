/* VTK's volume mappers as peers, and VTK's files, behind a C face. */
#ifndef BENCH_VTK_H
#define BENCH_VTK_H

#include <stdbool.h>

#ifdef __cplusplus
extern "C" {
/* In C, members that are not named are zero. */
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wmissing-field-initializers"
#endif

#include "test_meshes.h"

#ifdef __cplusplus
#pragma GCC diagnostic pop
#endif

typedef enum bench_vtk_mapper {
    BENCH_VTK_RAY_PARTIAL, /* vtkUnstructuredGridVolumeRayCastMapper with partial pre-integration */
    BENCH_VTK_RAY_LINEAR,  /* the same with the linear ray integrator */
    BENCH_VTK_ZSWEEP,      /* vtkUnstructuredGridVolumeZSweepMapper, partial pre-integration */
    BENCH_VTK_PROJECTED,   /* vtkProjectedTetrahedraMapper, on Mesa's rasterizer */
    BENCH_VTK_RESAMPLE     /* vtkResampleToImage and vtkFixedPointVolumeRayCastMapper */
} bench_vtk_mapper;

/* One picture: perspective, square, over black, without shading. */
typedef struct bench_vtk_request {
    const test_mesh *mesh;
    bench_vtk_mapper mapper;
    int resolution; /* of the sampled image: points along its longest axis */
    double eye[3], focal[3], up[3], degrees;
    int size; /* pixels a side */
    /* Opacity and colour by value, linear between the knots. Each mapper has its own meaning of opacity. */
    int knot_count;
    const double *knots, *opacities;
    const float *colours; /* knot_count × 3 */
    double unit_distance;
    double sample_distance; /* of the fixed-point mapper */
    int runs;               /* frames to time after the first; fewer, but at least one, when seconds have passed */
    double seconds;
    int pixel_count;
    const int *pixels; /* pixel_count × 2: x and y, y = 0 at the top */
} bench_vtk_request;

enum { BENCH_VTK_MAX_RUNS = 16 };

typedef struct bench_vtk_result {
    double first; /* seconds from the mesh to the first picture */
    int runs;
    double frames[BENCH_VTK_MAX_RUNS]; /* seconds of each further one */
} bench_vtk_result;

/* Draws. rgba gets pixel_count × 4, premultiplied, in the mapper's precision. False where VTK has no window to draw in
 * (no X server) or says that the mapper cannot run. VTK may also crash: call it in a process that may be lost. */
bool bench_vtk_draw(const bench_vtk_request *request, bench_vtk_result *result, float *rgba);

/* A .vtu file of tets, hexes, wedges and pyramids with a scalar of its points. False where it cannot be read, or has
 * other cells. */
bool bench_vtk_read(const char *path, const char *field, test_mesh *out);

/* Tells whether VTK is in this program. */
bool bench_vtk_is_available(void);

#ifdef __cplusplus
}
#endif

#endif
