/* Compares every instruction set with the scalar kernels. A process selects the set that INSITU_ISA names only one
 * time, so this program starts itself to check the selection; with an argument it only prints the selected set. The
 * sets differ in the width of a packet, which must not change any result, and in fused multiply-adds, which change
 * roundings: t by about 6e-8 times the conditioning, and a colour by this error times the slopes of shading. The usual
 * run draws each scene from a single camera, another one for each kind of mesh. The long run draws from all cameras. */
#include "test_effort.h"
#include "test_render_fixture.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

enum {
    WIDTH = 53,
    HEIGHT = 43,
    NUMBERS = 5 * WIDTH * HEIGHT,
    SCENES = 5,
    FRAMES = TEST_KIND_COUNT * CAMERA_PLANE * SCENES
};

static const char *program;

/* Sets an opacity with steps and a narrow ramp. Segments in which they lie are bisected in double
 * (kernel_bisection.h), ray by ray, from the caller's coordinates. */
static void set_steps(render_fixture *f)
{
    static const double values[6] = {-0.7, -0.15, -0.15, 0.3, 0.301, 0.7};
    static const float opacities[6] = {0.2f, 0.05f, 0.6f, 0.3f, 0, 0.1f};
    f->transfer.opacity_count = 6;
    f->transfer.opacity_values = values;
    f->transfer.opacities = opacities;
    f->job.integration = RENDER_SEGMENTS;
    f->job.max_error = 1e-2;
}

static void draw_scene(int frame, float *numbers)
{
    static const double values[2] = {-0.2, 0.3};
    const int scene = frame % SCENES;
    render_fixture f;
    drawn_frame drawn;
    fixture_create_lattice(&f, (test_mesh_kind)(frame / (SCENES * CAMERA_PLANE)), 4, 0.2, test_wave_field);
    fixture_set_camera(&f, (fixture_camera)(frame / SCENES % CAMERA_PLANE), WIDTH, HEIGHT);
    if (scene % 2 == 0) fixture_add_surface(&f, values, 2, scene == 0 ? 1 : 0.4f);
    if (scene != 0) fixture_set_volume(&f, 0.3);
    if (scene == 3) set_steps(&f);
    if (scene == 4) {
        f.job.integration = RENDER_SEGMENTS;
        /* rays are integrated in several intervals (kernel_local_segments.h) */
        f.job.max_error = frame / SCENES % CAMERA_PLANE ? 1e-3 : 1e-4;
    }
    fixture_draw(&f, &drawn);
    memcpy(numbers, drawn.picture.rgba, 4 * WIDTH * HEIGHT * sizeof *numbers);
    memcpy(numbers + 4 * WIDTH * HEIGHT, drawn.picture.depth, WIDTH * HEIGHT * sizeof *numbers);
    drawn_frame_free(&drawn);
    fixture_free(&f);
}

/* Returns whether a frame is drawn. */
static bool is_case_selected(int frame)
{
    const int scene = frame % SCENES, camera = frame / SCENES % CAMERA_PLANE, kind = frame / (SCENES * CAMERA_PLANE);
    return test_is_long_run() || (kind + scene) % CAMERA_PLANE == camera;
}

/* Returns the largest difference of the numbers with indices from first to last - 1. Returns infinity if one number is
 * infinite and the other is not. */
static double find_largest_difference(const float *a, const float *b, int first, int last)
{
    double worst = 0;
    for (int i = first; i < last; i++) {
        const double x = (double)a[i], y = (double)b[i];
        if (isinf(x) && isinf(y)) continue;
        worst = test_larger_error(worst, fabs(x - y));
    }
    return worst;
}

static void every_isa_draws_the_scalar_picture(void **state)
{
    static float plain[NUMBERS], other[NUMBERS];
    (void)state;
    for (int frame = 0; frame < FRAMES; frame++) {
        if (!is_case_selected(frame)) continue;
        for (int set = 0; set < fixture_isa_count(); set++) {
            fixture_select_isa(set);
            draw_scene(frame, set ? other : plain);
            if (!set) continue;
            const double colour = find_largest_difference(plain, other, 0, 4 * WIDTH * HEIGHT);
            const double depth = find_largest_difference(plain, other, 4 * WIDTH * HEIGHT, NUMBERS);
            if (depth <= 5e-6 && colour <= 2e-5) continue;
            fail_msg("frame %d, %s and plain: depth %.2g of the scene's size, colour %.2g", frame,
                     fixture_isa_name(set), depth, colour);
        }
    }
}

/* Starts this program to find the instruction set that INSITU_ISA = isa selects. */
static void find_selected_isa(const char *isa, char used[16])
{
    char command[600];
    snprintf(command, sizeof command, "INSITU_ISA=%s '%s' set", isa, program);
    FILE *answer = popen(command, "r");
    assert_non_null(answer);
    assert_int_equal(fscanf(answer, "%15s", used), 1);
    assert_int_equal(pclose(answer), 0);
}

static void environment_variable_selects_the_isa(void **state)
{
    char used[16];
    (void)state;
    for (int set = 0; set < fixture_isa_count(); set++) {
        find_selected_isa(fixture_isa_name(set), used);
        assert_string_equal(used, fixture_isa_name(set));
    }
    find_selected_isa("mmx", used);
    assert_string_not_equal(used, "mmx");
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_isa_draws_the_scalar_picture),
        cmocka_unit_test(environment_variable_selects_the_isa),
    };
    program = argv[0];
    if (argc > 1) return puts(render_isa()) < 0;
    return cmocka_run_group_tests(tests, NULL, NULL);
}
