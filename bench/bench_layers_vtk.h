/* VTK's ways to slices and outer surfaces as peers: vtk3DLinearGridPlaneCutter and vtkGeometryFilter, in parallel, then
 * OpenGL, on Mesa where there is no GPU. Coloured by the field, without light. */
#ifndef BENCH_LAYERS_VTK_H
#define BENCH_LAYERS_VTK_H

#include "bench_contour.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum bench_layer { BENCH_LAYER_SLICE, BENCH_LAYER_SURFACE, BENCH_LAYER_CLIPPED, BENCH_LAYER_COUNT } bench_layer;

/* Is VTK in this program, and a window to draw in (an X server's)? None of the rest is to be called otherwise. */
bool bench_layers_vtk_is_there(void);

typedef struct bench_layers_vtk bench_layers_vtk;

/* normal: of the plane through the origin that slices, or cuts away the side it points to. */
bench_layers_vtk *bench_layers_vtk_create(const bench_contour_mesh *mesh, const bench_contour_view *view,
                                          const double normal[3], int threads);
void bench_layers_vtk_destroy(bench_layers_vtk *layers);

/* The mesh has other values from now on. */
void bench_layers_vtk_set(bench_layers_vtk *layers, const float *values);

/* From the mesh to the picture, to the end of OpenGL's work; nothing is read back. */
void bench_layers_vtk_draw(bench_layers_vtk *layers, bench_layer layer);

#ifdef __cplusplus
}
#endif

#endif
