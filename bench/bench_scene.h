/* The scene of the benchmarks of speed: a mesh with its field, seen by one camera, as an isosurface and as a volume.
 *
 * The mesh is the cube [-1, 1]^3 of n^3 jittered cubes, each given as a hex or as six tets. Its field, sin 6x cos 6y +
 * sin 6y cos 6z + sin 6z cos 6x, is smooth, has an isosurface with many folds, and leaves no empty outer region whose
 * cells could be skipped. Errors end the process. */
#ifndef BENCH_SCENE_H
#define BENCH_SCENE_H

#include "bench_command.h"
#include "bench_error.h"
#include "test_meshes.h"

enum { BENCH_WIDTH = 1920, BENCH_HEIGHT = 1080, BENCH_ISOVALUES = 3, BENCH_KNOTS = 3 };

/* A picture of a single isosurface shows the first isovalue. */
extern const double bench_isovalues[BENCH_ISOVALUES];

/* Opacity is a tent function over |f| < 0.6. It is so low that a ray through the whole cube keeps much of its light. */
extern const double bench_knots[BENCH_KNOTS];
extern const float bench_opacities[BENCH_KNOTS];
extern const double bench_unit_distance;

extern const double bench_eye[3], bench_focal[3], bench_up[3], bench_degrees;

/* Makes the mesh in double precision. The caller frees it. */
void bench_scene_make_mesh(test_mesh_kind kind, int n, test_mesh *out);

typedef struct bench_scene {
    bench_subject subject;
    test_mesh_kind kind;
    test_view view;
    mmbvh_options how; /* options for building the tree; all 0 at first */
    mmbvh tree;
    fragment_list fragments;
    bench_pixels *pixels; /* NULL until an error is computed */
    double *integrals;    /* exact colours of the volume in `pixels`: count × 4; NULL until they are computed */
    render_job job;       /* camera, space, light, and a step of half a cube's side; no layers */
    render_part part;
    mmbvh_ranges ranges;
    render_transfer transfer;
    render_surface_layer surface;
    render_volume_layer volume;
    base_error error;
} bench_scene;

/* Makes a scene with pictures of BENCH_WIDTH × BENCH_HEIGHT pixels and without a tree. The scene must not be moved.
 * `program` is the subject's name in the CSV. */
void bench_scene_create(bench_scene *scene, const char *program, test_mesh_kind kind, int n);
void bench_scene_free(bench_scene *scene);

/* Sets another size of pictures. */
void bench_scene_resize(bench_scene *scene, int width, int height);

/* Builds the tree anew, as for a new mesh. */
void bench_scene_build(bench_scene *scene);

/* bench_scene_show_surfaces() sets the layers of frames to `count` isosurfaces; bench_scene_show_volume() sets them to
 * the volume. */
void bench_scene_show_surfaces(bench_scene *scene, int count);
void bench_scene_show_volume(bench_scene *scene);

/* Draws a frame into fragments. */
void bench_scene_frame(bench_scene *scene);

/* The following functions print the error of the most recent frame, as measures whose names begin with `name`.
 * bench_scene_print_surface_error() is for a frame with one isosurface. The others are for the volume:
 * bench_scene_print_sample_error() compares it with the same samples in double, which shows the effect of rounding and
 * missed samples; bench_scene_print_integral_error() compares it with the integral, which shows the error of the step.
 */
void bench_scene_print_surface_error(bench_scene *scene, const char *name);
void bench_scene_print_sample_error(bench_scene *scene, const char *name);
void bench_scene_print_integral_error(bench_scene *scene, const char *name);

/* Returns the pixels in which errors are measured. */
const bench_pixels *bench_scene_choose_pixels(bench_scene *scene);

/* Returns the colours of the exact volume integral at the chosen pixels for a transfer function: count × 4 numbers. The
 * caller frees them. */
double *bench_scene_compute_integrals(bench_scene *scene, const render_transfer *transfer);

/* Returns the statistics of the errors of `rgba` against the integrals. The error of a pixel is the largest difference
 * of its four channels. Pixels whose integral is 0 are left out. */
bench_stats bench_scene_compute_pixel_error(const bench_scene *scene, const double *integrals, const float *rgba);

/* A table that a program prints for each mesh. */
typedef struct bench_table {
    const char *name;
    void (*measure)(bench_scene *scene, const bench_command *command);
} bench_table;

/* Implements a program whose command line begins with the name of one of its `count` tables: measures that table on the
 * scene of each mesh. Returns the status for main() to return. */
int bench_run_table(int argc, char **argv, const char *program, const char *about, const bench_table *tables,
                    int count);

#endif
