/* The subject of bench_accuracy: a mesh with a field, and the parameters of the picture that every method draws of
 * it. */
#ifndef ACCURACY_SUBJECT_H
#define ACCURACY_SUBJECT_H

#include "render.h"
#include "test_meshes.h"

enum { ACCURACY_KNOTS = 3 };

typedef struct accuracy_view {
    double eye[3], focal[3], up[3];
} accuracy_view;

/* A subject. Its opacity and colour have the same evenly spaced knots, because VTK's integrators divide cells at the
 * knots of both. A long colour table would slow VTK down, but not libinsitu. */
typedef struct accuracy_subject {
    char name[64];
    test_mesh mesh;
    test_view view; /* the mesh as simulations store it: float32 coordinates and values, int32 indices */
    mmbvh tree;
    accuracy_view look;
    double degrees; /* full angle of view of the square picture: the smallest angle that contains the mesh's bounds */
    double isovalue;
    double knots[ACCURACY_KNOTS];
    float opacities[ACCURACY_KNOTS], colours[3 * ACCURACY_KNOTS];
    double unit_distance;
    double cell_size; /* the unit of step_cells in scenes: mean cube root of all cells' volumes */
    render_camera camera;
    render_space space;
} accuracy_subject;

/* Makes the subject that `name` selects: a kind of lattice with its number of cubes along a side ("tets:31"), or a file
 * of INSITU_TEST_DATA without its extension ("bluntfin_hex"). `size` is the picture's width and height in pixels.
 * Returns false if there is no such subject. */
bool accuracy_subject_create(const char *name, int size, accuracy_subject *out);
void accuracy_subject_free(accuracy_subject *subject);

/* A render job of the subject, and everything that the job points to. The subject's tree must have been built. The
 * struct must not be moved, because it contains pointers to its own members. */
typedef struct accuracy_scene {
    render_job job;
    render_part part;
    mmbvh_ranges ranges;
    render_transfer transfer;
    render_surface_layer surface;
    render_volume_layer volume;
} accuracy_scene;

/* accuracy_scene_create_surface() sets the scene to the opaque isosurface, with robust roots;
 * accuracy_scene_create_volume() sets it to the volume, with samples at a distance of one cell. */
void accuracy_scene_create_surface(accuracy_scene *scene, const accuracy_subject *subject);
void accuracy_scene_create_volume(accuracy_scene *scene, const accuracy_subject *subject);

/* Returns the cube root of the volume of a cell's bounding box. */
double accuracy_compute_box_size(const grid *cells, int64_t cell);

/* Returns whether, in every cell, the field is linear along a ray (tets), or piecewise linear with pieces that the
 * kernels distinguish (polyhedra). */
bool accuracy_is_linear(const accuracy_subject *subject);

#endif
