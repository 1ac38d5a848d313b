/* The scene of the benchmarks of speed: the bench mesh with its field, seen by one camera, as an isosurface and as a
 * volume.
 *
 * The mesh is the cube [-1, 1]^3 of n^3 jittered cubes, as hexes or six tets each, with the field sin 6x cos 6y + sin
 * 6y cos 6z + sin 6z cos 6x: smooth, with an isosurface that folds back many times, and without cells that could be
 * skipped as outside. Errors end the process. */
#ifndef BENCH_SCENE_H
#define BENCH_SCENE_H

#include "bench_command.h"
#include "bench_error.h"
#include "test_meshes.h"

enum { BENCH_WIDTH = 1920, BENCH_HEIGHT = 1080, BENCH_ISOVALUES = 3, BENCH_KNOTS = 3 };

/* A single isosurface has the first one. */
extern const double bench_isovalues[BENCH_ISOVALUES];

/* Opacity is a tent over |f| < 0.6, so low that a ray through the whole cube keeps a good part of its light. */
extern const double bench_knots[BENCH_KNOTS];
extern const float bench_opacities[BENCH_KNOTS];
extern const double bench_unit_distance;

extern const double bench_eye[3], bench_focal[3], bench_up[3], bench_degrees;

/* The mesh in double, the caller's to free. */
void bench_scene_mesh(test_mesh_kind kind, int n, test_mesh *out);

typedef struct bench_scene {
    bench_subject subject;
    test_mesh_kind kind;
    test_view view;
    mmbvh_options how; /* the tree is built; all 0 at first */
    mmbvh tree;
    fragment_list fragments;
    bench_pixels *pixels; /* NULL until an error is asked for */
    double *integrals;    /* these pixels' integrals, × 4; NULL as long */
    render_job job;       /* camera, space, light, sampling of half a cube's side; no layer */
    render_part part;
    mmbvh_ranges ranges;
    render_transfer transfer;
    render_surface_layer surface;
    render_volume_layer volume;
    base_error error;
} bench_scene;

/* Makes a scene, which must not be moved, with pictures of BENCH_WIDTH × BENCH_HEIGHT and without a tree. program names
 * the subject. */
void bench_scene_create(bench_scene *scene, const char *program, test_mesh_kind kind, int n);
void bench_scene_free(bench_scene *scene);

/* Sets another size of pictures. */
void bench_scene_resize(bench_scene *scene, int width, int height);

/* Builds the tree again, as for a new mesh. */
void bench_scene_build(bench_scene *scene);

/* Makes frames show count isosurfaces, or the volume. */
void bench_scene_show_surfaces(bench_scene *scene, int count);
void bench_scene_show_volume(bench_scene *scene);

/* Draws a frame into fragments. */
void bench_scene_frame(bench_scene *scene);

/* Prints the error of the last frame, of one isosurface or of the volume, as measures that begin with name. A volume's
 * error is against the same samples in double, which shows rounding and missed samples, or against the integral itself,
 * which shows the error of the step. */
void bench_scene_surface_error(bench_scene *scene, const char *name);
void bench_scene_sample_error(bench_scene *scene, const char *name);
void bench_scene_integral_error(bench_scene *scene, const char *name);

/* The pixels at which errors are taken. */
const bench_pixels *bench_scene_pixels(bench_scene *scene);

/* The volume's integral at these pixels by a transfer function: count × 4, the caller's to free. */
double *bench_scene_integrals(bench_scene *scene, const render_transfer *transfer);

/* The pixels' differences from the integrals, where these show something: the largest of the four channels. */
bench_stats bench_scene_pixel_error(const bench_scene *scene, const double *integrals, const float *rgba);

/* A table that a program prints of one mesh. */
typedef struct bench_table {
    const char *name;
    void (*measure)(bench_scene *scene, const bench_command *command);
} bench_table;

/* All of a program whose command line begins with the name of one of its count tables: measures it on the scene of each
 * mesh. Returns what main() returns. */
int bench_run_table(int argc, char **argv, const char *program, const char *about, const bench_table *tables,
                    int count);

#endif
