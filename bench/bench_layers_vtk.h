/* Measures VTK's pipelines for slices, outer surfaces and pictures derived from them, as peers:
 * vtk3DLinearGridPlaneCutter, vtkGeometryFilter, vtkGradientFilter, vtkContourFilter, vtkWarpVector and
 * vtkReflectionFilter, on as many threads as each can use, then OpenGL, with Mesa if there is no GPU. The pictures are
 * those of bench_session.h: coloured by the field without lighting, and isosurfaces with lighting. */
#ifndef BENCH_LAYERS_VTK_H
#define BENCH_LAYERS_VTK_H

#include "bench_contour.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum bench_layer {
    BENCH_LAYER_SLICE,
    BENCH_LAYER_SURFACE,
    BENCH_LAYER_CLIPPED,
    BENCH_LAYER_Q_CRITERION, /* computes the values at all vertices; draws no picture */
    BENCH_LAYER_VORTICES,
    BENCH_LAYER_LINED_SLICE,
    BENCH_LAYER_LINED_SURFACE,
    BENCH_LAYER_WARPED,
    BENCH_LAYER_MIRRORED,
    BENCH_LAYER_PLANES,
    BENCH_LAYER_MONTAGE,
    BENCH_LAYER_COUNT,
    BENCH_LAYER_NONE = -1
} bench_layer;

/* Returns whether this program was built with VTK and an X server provides a window; if not, no other function here may
   be called. */
bool bench_layers_vtk_is_available(void);

typedef struct bench_layers_vtk bench_layers_vtk;

/* The parameters of the pictures. bench_session.h defines their values. */
typedef struct bench_layers_parameters {
    double
        plane[3]; /* normal of the plane through the origin that slices, or that cuts off the side to which it points */
    double isovalue, range[2], vortex, warp, mirror;
    int line_count, plane_count;
} bench_layers_parameters;

bench_layers_vtk *bench_layers_vtk_create(const bench_contour_mesh *mesh, const bench_contour_view *view,
                                          const bench_layers_parameters *parameters, int threads);
void bench_layers_vtk_destroy(bench_layers_vtk *layers);

/* Sets new values of the mesh, and new velocities (vertices × 3, or NULL). */
void bench_layers_vtk_set(bench_layers_vtk *layers, const float *values, const float *velocities);

/* Computes the picture from the mesh and waits until OpenGL has finished; nothing is read back. */
void bench_layers_vtk_draw(bench_layers_vtk *layers, bench_layer layer);

#ifdef __cplusplus
}
#endif

#endif
