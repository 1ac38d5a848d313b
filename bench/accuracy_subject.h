/* The subject of bench_accuracy: a mesh with its field, and the picture of it that every method draws. */
#ifndef ACCURACY_SUBJECT_H
#define ACCURACY_SUBJECT_H

#include "render.h"
#include "test_meshes.h"

enum { ACCURACY_KNOTS = 3 };

typedef struct accuracy_view {
    double eye[3], focal[3], up[3];
} accuracy_view;

/* Opacity and colour have the same knots, evenly spaced: VTK's integrators cut cells at the knots of both, and a long
 * colour table, which costs libinsitu nothing, would slow them down. */
typedef struct accuracy_subject {
    char name[64];
    test_mesh mesh;
    test_view view; /* the mesh as a simulation would hold it: float32 coordinates and values, int32 indices */
    mmbvh tree;
    accuracy_view look;
    double degrees; /* the full angle of the square picture, in which the bounds just fit */
    double isovalue;
    double knots[ACCURACY_KNOTS];
    float opacities[ACCURACY_KNOTS], colours[3 * ACCURACY_KNOTS];
    double unit_distance;
    double cell_size; /* unit of step_cells in a scene: the mean over all cells of the cube root of the volume */
    render_camera camera;
    render_space space;
} accuracy_subject;

/* name: a kind of lattice with its number of cubes a side ("tets:31"), or a file of INSITU_TEST_DATA without its ending
 * ("bluntfin_hex"). size: pixels a side. False where there is no such subject. */
bool accuracy_subject_create(const char *name, int size, accuracy_subject *out);
void accuracy_subject_free(accuracy_subject *subject);

/* A job of the subject, whose tree has been built, with all that it points to. It must not be moved. */
typedef struct accuracy_scene {
    render_job job;
    render_part part;
    mmbvh_ranges ranges;
    render_transfer transfer;
    render_surface_layer surface;
    render_volume_layer volume;
} accuracy_scene;

/* Sets the scene to the opaque isosurface, by robust roots, or to the volume, by samples a cell apart. */
void accuracy_scene_surface(accuracy_scene *scene, const accuracy_subject *subject);
void accuracy_scene_volume(accuracy_scene *scene, const accuracy_subject *subject);

/* The cube root of the volume of a cell's box. */
double accuracy_box_size(const grid *cells, int64_t cell);

/* Tells whether every cell is linear along a ray, or piecewise linear with pieces that the kernels know. */
bool accuracy_is_linear(const accuracy_subject *subject);

#endif
