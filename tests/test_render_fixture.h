/* Frames for the tests of the renderer: meshes with trees and layers about them, drawn by the kernels, and the drawn
 * compared with the reference ray by ray. */
#ifndef TEST_RENDER_FIXTURE_H
#define TEST_RENDER_FIXTURE_H

#include "image.h"
#include "reference_render.h"
#include "test_meshes.h"

enum { FIXTURE_MAX_PARTS = 8 };

typedef enum fixture_camera {
    CAMERA_OUTSIDE,
    CAMERA_ORTHOGRAPHIC,
    CAMERA_INSIDE,  /* the eye in a cell */
    CAMERA_PLANE,   /* orthographic, the eye's plane through the mesh */
    CAMERA_ALONG_X, /* orthographic along the lattice's lines, rays through its vertices, along faces and edges */
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
    render_job job; /* points into this struct: not to be copied */
    double cell_size;
    double scale; /* of the mesh: 1 for [-1, 1]^3 */
    double offset[3];
} render_fixture;

/* Trees over the meshes (copied), no layer yet, the camera outside. The meshes fill offset + scale × [-1, 1]^3. */
void fixture_create(render_fixture *f, const test_mesh *meshes, int count, test_layout layout, double cell_size,
                    double scale, const double offset[3]);
/* The usual: one mesh in [-1, 1]^3, doubles. */
void fixture_create_lattice(render_fixture *f, test_mesh_kind kind, int n, double jitter, test_function *field);
void fixture_free(render_fixture *f);

void fixture_set_camera(render_fixture *f, fixture_camera camera, int width, int height);
/* A further surface layer with isovalues (static). */
void fixture_add_surface(render_fixture *f, const double *values, int count, float opacity);
/* A volume of a tent of opacity for |value| < 0.6. step in cells. */
void fixture_set_volume(render_fixture *f, double step);

/* A random transfer function over 0 .. 1, for as long as the fixture draws by it: opacities to most, of the unit
 * distance, with a step at a value or without. */
enum { FIXTURE_POINTS = 4, FIXTURE_COLOURS = 5 };
typedef struct fixture_function {
    double values[FIXTURE_POINTS];
    float opacities[FIXTURE_POINTS], colours[3 * FIXTURE_COLOURS];
} fixture_function;
void fixture_set_function(render_fixture *f, fixture_function *function, uint64_t seed, bool step, double most,
                          double unit);

/* The results of a frame. */
typedef struct drawn_frame {
    image picture;      /* over the background of fixture_background */
    fragment_list list; /* as made, then sorted by pixel and depth */
    int64_t *first;     /* pixel p has items first[p] .. first[p + 1] - 1 */
    render_statistics statistics;
} drawn_frame;

extern const float fixture_background[4];

/* A fragment's t as depth along the camera's axis in scene units: t is (depth - depth_origin) * scale. */
double fixture_depth(const render_fixture *f, float t);

void fixture_draw(const render_fixture *f, drawn_frame *out);
/* The instruction sets of this machine, up to that of INSITU_ISA, by number. fixture_use_set() chooses the one for all
 * later frames; before, it is the best. One truth serves all of them. */
int fixture_set_count(void);
const char *fixture_set_name(int set);
void fixture_use_set(int set);
/* For programs that run once for each set: tells whether INSITU_ISA names one that this machine lacks. They then return
 * 77. */
bool fixture_set_is_unavailable(void);
/* Each fixture drawn as a rank of its own, all their fragments merged. */
void fixture_draw_apart(const render_fixture *fixtures, int count, drawn_frame *out);
void drawn_free(drawn_frame *drawn);

/* Every pixel's depth the same bits; the first that is not fails the test. */
void drawn_assert_same_depth(const drawn_frame *a, const drawn_frame *b);
/* Every pixel's colour and depth the same bits; the first that is not fails the test. */
void drawn_assert_same(const drawn_frame *a, const drawn_frame *b);
/* The largest difference of a channel. */
double drawn_difference(const drawn_frame *a, const drawn_frame *b);

/* Bounds of how far the kernels may be from the reference. */
typedef struct fixture_bounds {
    double depth;    /* in cells; 5e-7 × conditioning where that is more */
    double colour;   /* of a channel over the background */
    double excluded; /* the share of rays that may be within margin of another decision */
    double margin;   /* in cells, or ranges of a cell's values */
} fixture_bounds;

extern const fixture_bounds fixture_usual_bounds;

typedef struct fixture_outcome {
    int64_t rays, hits, excluded, ambiguous;
    double worst_depth, worst_colour; /* of the rays that count */
    double worst_ambiguous;
    double total_depth; /* the errors of all hits together, the root finder's own included, in cells */
} fixture_outcome;

/* Draw by every instruction set and compare all rays; fails the test where a bound is broken, with the worst ray in the
 * message. Returns what came of the best set. */
fixture_outcome fixture_compare(const render_fixture *f, const fixture_bounds *bounds, const char *what);

#endif
