/* Every instruction set against the plain C kernels. The set is chosen once a process, so this program runs itself:
 * with a file's name it draws its scenes by the set of INSITU_ISA and writes colours and depths there; without one it
 * runs itself so for each set, and compares.
 *
 * The sets differ in how wide a packet is, which must change nothing, and in where a multiply and an add are fused,
 * which changes roundings: t by some 6e-8 times the conditioning, a colour by as much times the slopes of shading. */
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

/* Draws by segments, with steps and a narrow ramp of the opacity: stretches are halved in double
 * (kernel_cell_segments.h), ray by ray, from the caller's coordinates. */
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
    fixture_create_lattice(&f, (test_mesh_kind)(frame / (SCENES * CAMERA_PLANE)), 4, 0.2, test_wave);
    fixture_look(&f, (fixture_camera)(frame / SCENES % CAMERA_PLANE), WIDTH, HEIGHT);
    if (scene % 2 == 0) fixture_add_surface(&f, values, 2, scene == 0 ? 1 : 0.4f);
    f.surfaces[0].root = scene % 2 ? RENDER_NEUBAUER : RENDER_ROBUST;
    if (scene != 0) fixture_set_volume(&f, 0.3);
    if (scene == 3) set_steps(&f);
    if (scene == 4) {
        f.job.integration = RENDER_SEGMENTS;
        f.job.max_error = frame / SCENES % CAMERA_PLANE ? 1e-3 : 1e-4; /* ways in parts (kernel_local_segments.h) */
    }
    fixture_draw(&f, &drawn);
    memcpy(numbers, drawn.picture.rgba, 4 * WIDTH * HEIGHT * sizeof *numbers);
    memcpy(numbers + 4 * WIDTH * HEIGHT, drawn.picture.depth, WIDTH * HEIGHT * sizeof *numbers);
    drawn_free(&drawn);
    fixture_free(&f);
}

static int dump(const char *path)
{
    FILE *file = fopen(path, "wb");
    float *numbers = malloc(NUMBERS * sizeof *numbers);
    char isa[16] = {0};
    snprintf(isa, sizeof isa, "%s", render_isa());
    bool good = file && numbers && fwrite(isa, sizeof isa, 1, file) == 1;
    for (int frame = 0; good && frame < FRAMES; frame++) {
        draw_scene(frame, numbers);
        good = fwrite(numbers, sizeof *numbers, NUMBERS, file) == NUMBERS;
    }
    free(numbers);
    if (file && fclose(file)) good = false;
    return good ? 0 : 1;
}

/* The numbers that the set drew, FRAMES × NUMBERS; used gets the set that ran. */
static float *drawn_with(const char *isa, char used[16])
{
    char path[512], command[1200];
    snprintf(path, sizeof path, "%s.%s.frames", program, isa);
    snprintf(command, sizeof command, "INSITU_ISA=%s '%s' '%s'", isa, program, path);
    assert_int_equal(system(command), 0);
    float *numbers = malloc((size_t)FRAMES * NUMBERS * sizeof *numbers);
    FILE *file = fopen(path, "rb");
    assert_non_null(file);
    assert_int_equal(fread(used, 16, 1, file), 1);
    assert_int_equal(fread(numbers, sizeof *numbers, (size_t)FRAMES * NUMBERS, file), FRAMES * NUMBERS);
    fclose(file);
    remove(path);
    return numbers;
}

/* The largest difference in numbers first .. last of each frame; infinite where one is and the other is not. */
static double worst_difference(const float *a, const float *b, int first, int last)
{
    double worst = 0;
    for (int frame = 0; frame < FRAMES; frame++)
        for (int i = first; i < last; i++) {
            const double x = (double)a[frame * NUMBERS + i], y = (double)b[frame * NUMBERS + i];
            if (isinf(x) && isinf(y)) continue;
            const double off = fabs(x - y);
            worst = test_worse(worst, off);
        }
    return worst;
}

static void compare_with_plain(const char *isa)
{
    char plain_used[16], used[16];
    float *plain = drawn_with("plain", plain_used), *other = drawn_with(isa, used);
    assert_string_equal(plain_used, "plain");
    if (strcmp(used, isa)) {
        free(plain);
        free(other);
        print_message("this machine runs %s, not %s\n", used, isa);
        skip();
    }
    const double colour = worst_difference(plain, other, 0, 4 * WIDTH * HEIGHT);
    const double depth = worst_difference(plain, other, 4 * WIDTH * HEIGHT, NUMBERS);
    print_message("%s and plain: depth %.2g of the scene's size, colour %.2g\n", isa, depth, colour);
    assert_true(depth <= 5e-6);
    assert_true(colour <= 2e-5);
    free(plain);
    free(other);
}

static void sse42_draws_what_plain_draws(void **state)
{
    (void)state;
    compare_with_plain("sse4.2");
}

static void avx2_draws_what_plain_draws(void **state)
{
    (void)state;
    compare_with_plain("avx2");
}

static void avx512_draws_what_plain_draws(void **state)
{
    (void)state;
    compare_with_plain("avx512");
}

static void unknown_isa_is_told(void **state)
{
    (void)state;
    char used[16];
    free(drawn_with("mmx", used));
    assert_string_not_equal(used, "mmx");
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sse42_draws_what_plain_draws),
        cmocka_unit_test(avx2_draws_what_plain_draws),
        cmocka_unit_test(avx512_draws_what_plain_draws),
        cmocka_unit_test(unknown_isa_is_told),
    };
    program = argv[0];
    if (argc > 1) return dump(argv[1]);
    return cmocka_run_group_tests(tests, NULL, NULL);
}
