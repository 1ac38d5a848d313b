/* Measures VTK's isosurfaces as a peer: extraction by vtkContour3DLinearGrid in parallel, then rendering by OpenGL,
 * with Mesa if there is no GPU. */
#ifndef BENCH_CONTOUR_H
#define BENCH_CONTOUR_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* The mesh, borrowed, in the layout that VTK reads without a copy. */
typedef struct bench_contour_mesh {
    int64_t vertex_count, cell_count;
    int cell_type;               /* type of all cells: VTK's id of a tet or a hex */
    const float *xyz;            /* vertex_count × 3 */
    const float *values;         /* vertex_count */
    const int32_t *connectivity; /* cell_count × vertices per cell */
} bench_contour_mesh;

typedef struct bench_contour_view {
    double eye[3], focal[3], up[3], degrees; /* perspective; degrees is the vertical angle of view */
    int width, height;
} bench_contour_view;

/* Triangles, each with three vertices of its own. */
typedef struct bench_triangles {
    int64_t count;
    const float *xyz; /* count × 9, followed by 4 readable bytes; valid until the next extraction */
} bench_triangles;

/* Returns whether this program was built with VTK; if not, no other function here may be called. */
bool bench_contour_is_available(void);

typedef struct bench_contour bench_contour;

bench_contour *bench_contour_create(const bench_contour_mesh *mesh, const bench_contour_view *view, int threads);
void bench_contour_destroy(bench_contour *contour);

/* Returns whether an X server provides a window to draw in. Creates the OpenGL context, so that this is not timed
 * later. */
bool bench_contour_can_draw(bench_contour *contour);

/* Sets new coordinates and values of the mesh. */
void bench_contour_set(bench_contour *contour, const float *xyz, const float *values);

bench_triangles bench_contour_extract(bench_contour *contour, const double *isovalues, int count);

/* Draws the triangles of the most recent bench_contour_extract(), and waits until OpenGL has finished. The first call
 * includes VTK's preparations. No pixels are read back. */
void bench_contour_draw(bench_contour *contour);

/* Reads the depths of the most recently drawn picture along the camera's axis, row-major with the top row first;
 * infinity in empty pixels. */
void bench_contour_read_depths(bench_contour *contour, float *depths);

#ifdef __cplusplus
}
#endif

#endif
