/* Frames for the tests of the renderer: meshes with trees and layers. The kernels draw them, and each ray is compared
 * with the reference. */
#ifndef TEST_RENDER_FIXTURE_H
#define TEST_RENDER_FIXTURE_H

#include "image.h"
#include "reference_render.h"
#include "test_meshes.h"

enum { FIXTURE_MAX_PARTS = 8 };

typedef enum fixture_camera {
    CAMERA_OUTSIDE,
    CAMERA_ORTHOGRAPHIC,
    CAMERA_INSIDE,  /* the eye is inside a cell */
    CAMERA_PLANE,   /* orthographic; the eye's plane passes through the mesh */
    CAMERA_ALONG_X, /* orthographic along lattice lines: rays pass through vertices and along edges and faces */
    CAMERA_COUNT
} fixture_camera;

const char *fixture_camera_name(fixture_camera camera);

typedef struct render_fixture {
    int part_count;
    test_view views[FIXTURE_MAX_PARTS];
    mmbvh trees[FIXTURE_MAX_PARTS];
    mmbvh_ranges ranges[FIXTURE_MAX_PARTS];
    grid_field fields[FIXTURE_MAX_PARTS];
    render_part parts[FIXTURE_MAX_PARTS];
    render_surface_layer surfaces[2];
    render_volume_layer volume;
    render_transfer transfer;
    render_light lights[2];
    render_job job; /* contains pointers into this struct, which therefore must not be copied */
    double cell_size;
    double scale; /* half the side of the mesh's cube; 1 for [-1, 1]^3 */
    double offset[3];
} render_fixture;

/* Copies the meshes, which fill offset + scale × [-1, 1]^3, and builds their trees. The fixture has no layers, and its
 * camera is outside the mesh. */
void fixture_create(render_fixture *f, const test_mesh *meshes, int count, test_layout layout, double cell_size,
                    double scale, const double offset[3]);
/* Creates the usual fixture: one lattice of n^3 cubes in [-1, 1]^3 with coordinates in double. */
void fixture_create_lattice(render_fixture *f, test_mesh_kind kind, int n, double jitter, test_function *field);
void fixture_free(render_fixture *f);

void fixture_set_camera(render_fixture *f, fixture_camera camera, int width, int height);
/* Adds a surface layer with isovalues. The array of isovalues must outlive the fixture. */
void fixture_add_surface(render_fixture *f, const double *values, int count, float opacity);
/* Adds a volume whose opacity is a tent function over |value| < 0.6. step: distance of samples in cells. */
void fixture_set_volume(render_fixture *f, double step);

/* A random transfer function over values from 0 to 1. It must not be freed before the fixture. Opacities are random up
 * to a maximum per unit distance, with or without a step at one value. */
enum { FIXTURE_POINTS = 4, FIXTURE_COLOURS = 5 };
typedef struct fixture_function {
    double values[FIXTURE_POINTS];
    float opacities[FIXTURE_POINTS], colours[3 * FIXTURE_COLOURS];
} fixture_function;
void fixture_set_function(render_fixture *f, fixture_function *function, uint64_t seed, bool step, double most,
                          double unit);

/* The results of a frame. */
typedef struct drawn_frame {
    image picture;      /* the picture blended over fixture_background */
    fragment_list list; /* fragments of the frame, sorted by pixel and depth */
    int64_t *first;     /* pixel p has the fragments first[p] to first[p + 1] - 1 of the list */
    render_statistics statistics;
} drawn_frame;

extern const float fixture_background[4];

/* Returns the depth of a fragment along the camera's axis in scene units. Its t is (depth - depth_origin) * scale. */
double fixture_compute_scene_depth(const render_fixture *f, float t);

void fixture_draw(const render_fixture *f, drawn_frame *out);
/* The instruction sets of this machine up to the one that INSITU_ISA names, by index. fixture_select_isa() selects the
 * set that draws all later frames. By default the widest is selected. fixture_compare_with_reference() compares all
 * sets with one reference. */
int fixture_isa_count(void);
const char *fixture_isa_name(int set);
void fixture_select_isa(int set);
/* Returns whether INSITU_ISA names an instruction set that this machine lacks. A program that is run separately for
 * each set then returns 77. */
bool fixture_isa_is_unavailable(void);
/* Draws each fixture as a separate rank and merges all fragments. */
void fixture_draw_distributed(const render_fixture *fixtures, int count, drawn_frame *out);
void drawn_frame_free(drawn_frame *drawn);

/* Checks that the depths of all pixels are bit-identical. Fails at the first difference. */
void drawn_frame_assert_same_depths(const drawn_frame *a, const drawn_frame *b);
/* Checks that the colours and depths of all pixels are bit-identical. Fails at the first difference. */
void drawn_frame_assert_same(const drawn_frame *a, const drawn_frame *b);
/* Returns the largest difference of a colour channel. */
double drawn_frame_find_largest_difference(const drawn_frame *a, const drawn_frame *b);

/* Bounds of the differences between the kernels and the reference. */
typedef struct fixture_bounds {
    double depth;    /* in cells; more is allowed on grazing rays and in slowly varying fields (compare_hits()) */
    double colour;   /* difference of a channel of the picture over the background */
    double excluded; /* largest fraction of rays that may be excluded */
    /* distance from a different result within which a ray is excluded: in cells, or in ranges of a cell's values */
    double margin;
} fixture_bounds;

extern const fixture_bounds fixture_usual_bounds;

typedef struct fixture_outcome {
    int64_t rays, hits, excluded, ambiguous;
    double worst_depth, worst_colour; /* largest differences among the compared rays */
    double worst_ambiguous;
    double total_depth; /* sum over all hits of the error of depth in cells, including the error of the root finder */
} fixture_outcome;

/* Draws with every instruction set and compares all rays. If a bound is exceeded, fails the test and reports the worst
 * ray. Returns the outcome of the widest set. */
fixture_outcome fixture_compare_with_reference(const render_fixture *f, const fixture_bounds *bounds, const char *what);

#endif
