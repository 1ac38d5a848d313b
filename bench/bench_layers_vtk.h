/* VTK's ways to slices and outer surfaces as peers: vtk3DLinearGridPlaneCutter and vtkGeometryFilter, in parallel, then
 * OpenGL, on Mesa where there is no GPU. Pictures are coloured by the field, without light. */
#ifndef BENCH_LAYERS_VTK_H
#define BENCH_LAYERS_VTK_H

#include "bench_contour.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum bench_layer { BENCH_LAYER_SLICE, BENCH_LAYER_SURFACE, BENCH_LAYER_CLIPPED, BENCH_LAYER_COUNT } bench_layer;

/* Tells whether VTK is in this program, and an X server's window to draw in; otherwise nothing else here may be called.
 */
bool bench_layers_vtk_is_available(void);

typedef struct bench_layers_vtk bench_layers_vtk;

/* normal is that of the plane through the origin that slices, or that cuts away the side it points to. */
bench_layers_vtk *bench_layers_vtk_create(const bench_contour_mesh *mesh, const bench_contour_view *view,
                                          const double normal[3], int threads);
void bench_layers_vtk_destroy(bench_layers_vtk *layers);

/* Sets new values of the mesh. */
void bench_layers_vtk_set(bench_layers_vtk *layers, const float *values);

/* Goes from the mesh to the picture, to the end of OpenGL's work; nothing is read back. */
void bench_layers_vtk_draw(bench_layers_vtk *layers, bench_layer layer);

#ifdef __cplusplus
}
#endif

#endif
