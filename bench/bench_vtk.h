/* VTK's volume mappers as peers, and a reader of VTK's files, with a C interface. */
#ifndef BENCH_VTK_H
#define BENCH_VTK_H

#include <stdbool.h>

#ifdef __cplusplus
extern "C" {
/* The C headers included here have initializers that leave out members that are 0; g++ would warn of them. */
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wmissing-field-initializers"
#endif

#include "test_meshes.h"

#ifdef __cplusplus
#pragma GCC diagnostic pop
#endif

typedef enum bench_vtk_mapper {
    BENCH_VTK_RAY_PARTIAL, /* vtkUnstructuredGridVolumeRayCastMapper with partial pre-integration */
    BENCH_VTK_RAY_LINEAR,  /* vtkUnstructuredGridVolumeRayCastMapper with the linear ray integrator */
    BENCH_VTK_ZSWEEP,      /* vtkUnstructuredGridVolumeZSweepMapper with partial pre-integration */
    BENCH_VTK_PROJECTED,   /* vtkProjectedTetrahedraMapper with Mesa's rasterizer */
    BENCH_VTK_RESAMPLE     /* vtkResampleToImage and vtkFixedPointVolumeRayCastMapper */
} bench_vtk_mapper;

/* One picture: square, in perspective, over black, without shading. */
typedef struct bench_vtk_request {
    const test_mesh *mesh;
    bench_vtk_mapper mapper;
    int resolution; /* points along the longest axis of the sampled image */
    double eye[3], focal[3], up[3], degrees;
    int size; /* width and height in pixels */
    /* Opacity and colour by value, linear between the knots. Mappers interpret the opacity in different ways. */
    int knot_count;
    const double *knots, *opacities;
    const float *colours; /* knot_count × 3 */
    double unit_distance;
    double sample_distance; /* only for the fixed-point mapper */
    /* number of frames to time after the first; fewer, but at least one, if they take longer than `seconds` */
    int runs;
    double seconds;
    int pixel_count;
    const int *pixels; /* pixel_count × 2: x and y; y = 0 at the top */
} bench_vtk_request;

enum { BENCH_VTK_MAX_RUNS = 16 };

typedef struct bench_vtk_result {
    double first; /* seconds from the mesh to the first picture */
    int runs;
    double frames[BENCH_VTK_MAX_RUNS]; /* seconds of each further picture */
} bench_vtk_result;

/* Draws the picture. rgba receives pixel_count × 4 numbers, premultiplied, in the mapper's precision. Returns false if
 * there is no X server for a window, or if VTK reports that the mapper is not supported. VTK may also crash, so this
 * function should be called in a process of its own. */
bool bench_vtk_draw(const bench_vtk_request *request, bench_vtk_result *result, float *rgba);

/* Reads a .vtu file of tets, hexes, wedges and pyramids with a scalar point field. Returns false if the file cannot be
 * read or has other cells. */
bool bench_vtk_read(const char *path, const char *field, test_mesh *out);

/* Returns whether this program was built with VTK. */
bool bench_vtk_is_available(void);

#ifdef __cplusplus
}
#endif

#endif
