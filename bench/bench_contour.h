/* VTK's way to an isosurface as a peer: vtkContour3DLinearGrid in parallel, then OpenGL, on Mesa where there is no GPU.
 */
#ifndef BENCH_CONTOUR_H
#define BENCH_CONTOUR_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Borrowed, in the form that VTK takes without a copy. */
typedef struct bench_contour_mesh {
    int64_t vertex_count, cell_count;
    int cell_type;               /* all cells': VTK's id of a tet or a hex */
    const float *xyz;            /* vertex_count × 3 */
    const float *values;         /* vertex_count */
    const int32_t *connectivity; /* cell_count × the type's number of vertices */
} bench_contour_mesh;

typedef struct bench_contour_view {
    double eye[3], focal[3], up[3], degrees; /* perspective, degrees vertical */
    int width, height;
} bench_contour_view;

/* Three vertices a triangle, not shared. */
typedef struct bench_triangles {
    int64_t count;
    const float *xyz; /* count × 9, and 4 readable bytes behind them; valid until the next extraction */
} bench_triangles;

/* Tells whether VTK is in this program; otherwise nothing else here may be called. */
bool bench_contour_is_available(void);

typedef struct bench_contour bench_contour;

bench_contour *bench_contour_create(const bench_contour_mesh *mesh, const bench_contour_view *view, int threads);
void bench_contour_destroy(bench_contour *contour);

/* Tells whether there is an X server's window to draw in. The context is made here, untimed. */
bool bench_contour_can_draw(bench_contour *contour);

/* Sets new coordinates and values of the mesh. */
void bench_contour_set(bench_contour *contour, const float *xyz, const float *values);

bench_triangles bench_contour_extract(bench_contour *contour, const double *isovalues, int count);

/* Draws the last extraction, and waits for the end of OpenGL's work; the first time includes what VTK prepares. Nothing
 * is read back. */
void bench_contour_draw(bench_contour *contour);

/* Depth along the camera's axis in the last picture, row-major, top row first; infinity where nothing is. */
void bench_contour_read(bench_contour *contour, float *depths);

#ifdef __cplusplus
}
#endif

#endif
