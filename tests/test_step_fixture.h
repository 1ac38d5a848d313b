/* Shared by the tests of steps of the opacity: functions with a step or a steep ramp, cells, and comparisons of
 * pictures with the integral. */
#ifndef TEST_STEP_FIXTURE_H
#define TEST_STEP_FIXTURE_H

#include "test_render_fixture.h"

enum { STEP_SIDE = 17, STEP_SHAPES = 4 };

/* The opacities at 0, at both sides of a step (or of a ramp of some width) and at 1, in 0 .. 1. */
typedef struct step_function {
    double values[4];
    float opacities[4];
} step_function;

void step_set_function(render_fixture *f, step_function *function, double at, double width, double unit);

/* The mesh as a volume by segments, in a picture of side x side. */
void step_begin(render_fixture *f, const test_mesh *mesh, fixture_camera camera, int side);

/* The truth of every so many pixels, the others' left as they are: side * side * 4. tolerance: the integral's. */
double *step_truth(const render_fixture *f, int every, double tolerance);
/* Returns how far a picture is from it at most, drawn by every instruction set. */
double step_worst_of_sets(const render_fixture *f, const double *truth, int every);

/* The worst of each error asked for, 1e-2 to 1e-4, and of every instruction set. */
void step_verify(render_fixture *f, int every, double tolerance, double worst[3]);
void step_assert_kept(const double worst[3], const char *what);

/* A hex whose field barely reaches 0.6. */
void step_make_hex(test_mesh *mesh);

/* Vertices moved by up to 0.12 of a side: far from folding. */
extern const test_cell_shape step_shapes[STEP_SHAPES];
void step_make_cell(test_cell_shape shape, uint64_t seed, test_mesh *mesh);

#endif
