/* VTK's ways to slices, outer surfaces and what is made of them as peers: vtk3DLinearGridPlaneCutter,
 * vtkGeometryFilter, vtkGradientFilter, vtkContourFilter, vtkWarpVector and vtkReflectionFilter, on as many threads as
 * each can use, then OpenGL, on Mesa where there is no GPU. Pictures are those of bench_session.h: coloured by the
 * field, without light; isosurfaces with it. */
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
    BENCH_LAYER_Q_CRITERION, /* the values at all vertices, without a picture */
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

/* Tells whether VTK is in this program, and an X server's window to draw in; otherwise nothing else here may be called.
 */
bool bench_layers_vtk_is_available(void);

typedef struct bench_layers_vtk bench_layers_vtk;

/* The parameters of bench_session.h. */
typedef struct bench_layers_parameters {
    double plane[3]; /* normal of the plane through the origin that slices, or that cuts away the side it points to */
    double isovalue, range[2], vortex, warp, mirror;
    int line_count, plane_count;
} bench_layers_parameters;

bench_layers_vtk *bench_layers_vtk_create(const bench_contour_mesh *mesh, const bench_contour_view *view,
                                          const bench_layers_parameters *parameters, int threads);
void bench_layers_vtk_destroy(bench_layers_vtk *layers);

/* Sets new values of the mesh, and velocities, vertices × 3, or NULL. */
void bench_layers_vtk_set(bench_layers_vtk *layers, const float *values, const float *velocities);

/* Goes from the mesh to the picture, to the end of OpenGL's work; nothing is read back. */
void bench_layers_vtk_draw(bench_layers_vtk *layers, bench_layer layer);

#ifdef __cplusplus
}
#endif

#endif
