/* The fixture of tests of steps in the opacity: opacity functions with a step or a steep ramp, cells, and comparisons
 * of pictures with the exact integral. */
#ifndef TEST_STEP_FIXTURE_H
#define TEST_STEP_FIXTURE_H

#include "test_render_fixture.h"

enum { STEP_SIDE = 17, STEP_SHAPES = 4 };

/* An opacity function of 4 points: values and opacities, both from 0 to 1, at its beginning, on both sides of a step
 * (or of a ramp), and at its end. */
typedef struct step_function {
    double values[4];
    float opacities[4];
} step_function;

void step_set_function(render_fixture *f, step_function *function, double at, double width, double unit);

/* Sets up the mesh as a volume drawn by segments, in a picture of side × side pixels. */
void step_fixture_create(render_fixture *f, const test_mesh *mesh, fixture_camera camera, int side);

/* Returns the exact colours of every `every`-th pixel, as an array of side × side × 4 numbers of which only these
 * pixels are set. `tolerance` is that of the numerical integration. */
double *step_compute_reference(const render_fixture *f, int every, double tolerance);
/* Draws the picture with every instruction set. Returns the largest difference from the exact colours. */
double step_largest_error_of_isas(const render_fixture *f, const double *truth, int every);

/* Stores in worst, for each of the max_errors 1e-2, 1e-3 and 1e-4, the largest error over all instruction sets. */
void step_measure_errors(render_fixture *f, int every, double tolerance, double worst[3]);
void step_assert_errors_within_bounds(const double worst[3], const char *what);

/* Makes a hex whose field has a maximum just above 0.6. */
void step_make_hex(test_mesh *mesh);

/* Shapes of cells for step_make_cell(), which moves vertices by up to 0.12 of a side, so that the cells are far from
 * folding. */
extern const test_cell_shape step_shapes[STEP_SHAPES];
void step_make_cell(test_cell_shape shape, uint64_t seed, test_mesh *mesh);

#endif
