/* Frames for the tests of the renderer: meshes with trees and layers on them, drawn by the kernels and compared with
 * the reference ray by ray. */
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
    CAMERA_PLANE,   /* orthographic, with the eye's plane through the mesh */
    CAMERA_ALONG_X, /* orthographic along the lattice's lines: rays pass through its vertices, along faces and edges */
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
    render_job job; /* points into this struct, which therefore must not be copied */
    double cell_size;
    double scale; /* size of the mesh: 1 for [-1, 1]^3 */
    double offset[3];
} render_fixture;

/* Builds trees over the meshes, which are copied; there are no layers yet, and the camera is outside. The meshes fill
 * offset + scale × [-1, 1]^3. */
void fixture_create(render_fixture *f, const test_mesh *meshes, int count, test_layout layout, double cell_size,
                    double scale, const double offset[3]);
/* Creates the usual fixture: one mesh in [-1, 1]^3 with coordinates in double. */
void fixture_create_lattice(render_fixture *f, test_mesh_kind kind, int n, double jitter, test_function *field);
void fixture_free(render_fixture *f);

void fixture_set_camera(render_fixture *f, fixture_camera camera, int width, int height);
/* Adds a surface layer with isovalues, whose array must outlive the fixture. */
void fixture_add_surface(render_fixture *f, const double *values, int count, float opacity);
/* Adds a volume whose opacity is a tent for |value| < 0.6; step is in cells. */
void fixture_set_volume(render_fixture *f, double step);

/* A random transfer function over 0 .. 1, which must live as long as the fixture draws with it: opacities up to a
 * maximum per unit distance, with or without a step at a value. */
enum { FIXTURE_POINTS = 4, FIXTURE_COLOURS = 5 };
typedef struct fixture_function {
    double values[FIXTURE_POINTS];
    float opacities[FIXTURE_POINTS], colours[3 * FIXTURE_COLOURS];
} fixture_function;
void fixture_set_function(render_fixture *f, fixture_function *function, uint64_t seed, bool step, double most,
                          double unit);

/* The results of a frame. */
typedef struct drawn_frame {
    image picture;      /* blended over fixture_background */
    fragment_list list; /* as drawn, then sorted by pixel and depth */
    int64_t *first;     /* pixel p has items first[p] .. first[p + 1] - 1 */
    render_statistics statistics;
} drawn_frame;

extern const float fixture_background[4];

/* Returns the depth along the camera's axis in scene units of a fragment's t, which is (depth - depth_origin) *
 * scale. */
double fixture_scene_depth(const render_fixture *f, float t);

void fixture_draw(const render_fixture *f, drawn_frame *out);
/* The instruction sets of this machine, up to that of INSITU_ISA, by number. fixture_select_isa() selects the set of
 * all later frames; the default is the best. One reference is compared with all of them. */
int fixture_isa_count(void);
const char *fixture_isa_name(int set);
void fixture_select_isa(int set);
/* For programs that are run once for each set: returns whether INSITU_ISA names a set that this machine lacks. The
 * programs then return 77. */
bool fixture_isa_is_unavailable(void);
/* Draws each fixture as a separate rank and merges all fragments. */
void fixture_draw_distributed(const render_fixture *fixtures, int count, drawn_frame *out);
void drawn_frame_free(drawn_frame *drawn);

/* Checks that every pixel's depth has the same bits; fails at the first difference. */
void drawn_frame_assert_same_depths(const drawn_frame *a, const drawn_frame *b);
/* Checks that every pixel's colour and depth have the same bits; fails at the first difference. */
void drawn_frame_assert_same(const drawn_frame *a, const drawn_frame *b);
/* Returns the largest difference of a channel. */
double drawn_frame_difference(const drawn_frame *a, const drawn_frame *b);

/* Bounds of the difference between kernels and reference. */
typedef struct fixture_bounds {
    double depth;    /* in cells; 5e-7 × conditioning if that is larger */
    double colour;   /* of a channel of the picture over the background */
    double excluded; /* fraction of rays that may be within margin of another decision */
    double margin;   /* in cells, or in ranges of a cell's values */
} fixture_bounds;

extern const fixture_bounds fixture_usual_bounds;

typedef struct fixture_outcome {
    int64_t rays, hits, excluded, ambiguous;
    double worst_depth, worst_colour; /* of the compared rays */
    double worst_ambiguous;
    double total_depth; /* errors of all hits, including the root finder's own, in cells */
} fixture_outcome;

/* Draws with every instruction set and compares all rays; fails the test if a bound is exceeded, with the worst ray in
 * the message. Returns the outcome of the best set. */
fixture_outcome fixture_compare_with_reference(const render_fixture *f, const fixture_bounds *bounds, const char *what);

#endif
