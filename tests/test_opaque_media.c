/* Checks volumes that absorb all light in front of their end, so that the kernels skip the cells behind without visible
 * change. The medium is black in front and white behind: if light that is not negligible were missing, the picture
 * would change. Pictures are compared with brute force in double, and with pictures of the same cells on several ranks.
 * One test checks that fewer cells are transformed. */
#include "reference_integral.h"
#include "test_effort.h"
#include "test_render_fixture.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <cmocka.h>

enum { WIDTH = 33, HEIGHT = 27, RANKS = 4, COLOURS = 32 };

typedef enum method { SAMPLES, SEGMENTS, MAX_ERROR, METHOD_COUNT } method;

static const char *const method_names[METHOD_COUNT] = {"samples", "segments", "max_error"};
static const double max_error = 1e-2;

/* A field that is 0 at the mesh's corner next to the eye of CAMERA_OUTSIDE and 1 at the opposite corner. */
static double front_to_back_field(const double position[3])
{
    return 0.5 - (2.4 * position[0] + 1.6 * position[1] + 3 * position[2]) / (2 * (2.4 + 1.6 + 3));
}

/* Sets a medium with a constant extinction: the optical depth of a distance of 1 is `depth`. Its colour is black up to
 * the middle plane and white behind it. Rays arrive at this plane with any fraction of their light, from all to
 * none. */
static void set_medium(render_fixture *f, method how, double depth)
{
    static const float opacity = 0.5f;
    static float colours[3 * COLOURS];
    for (int i = 3 * COLOURS / 2; i < 3 * COLOURS; i++) colours[i] = 1;
    fixture_set_volume(f, 0.25);
    f->transfer = (render_transfer){.low = 0,
                                    .high = 1,
                                    .colour_count = COLOURS,
                                    .colours = colours,
                                    .opacity_count = 1,
                                    .opacity_values = &f->transfer.low,
                                    .opacities = &opacity,
                                    .unit_distance = log(2) / depth};
    f->job.integration = how == SAMPLES ? RENDER_SAMPLES : RENDER_SEGMENTS;
    f->job.max_error = how == MAX_ERROR ? max_error : 0;
    f->job.sample_group = RENDER_MAX_GROUP;
}

static void set_up_frame(render_fixture *f, test_mesh_kind kind, int n, method how, double depth)
{
    fixture_create_lattice(f, kind, n, 0.2, front_to_back_field);
    fixture_set_camera(f, CAMERA_OUTSIDE, WIDTH, HEIGHT);
    set_medium(f, how, depth);
}

/* The traversals: cells are searched for the whole picture at a time, or for each tile. */
static const render_traversal traversals[2] = {RENDER_BINNED, RENDER_TILES};

static void compare_samples(render_fixture *f, const char *what)
{
    for (int i = 0; i < 2; i++) {
        f->job.traversal = traversals[i];
        fixture_compare_with_reference(f, &fixture_usual_bounds, what);
    }
}

static void compare_integrals(render_fixture *f, double most, const char *what)
{
    drawn_frame drawn[2];
    reference_integral *truth = reference_integral_create(&f->job, 1e-10);
    double worst = 0;
    for (int i = 0; i < 2; i++) {
        f->job.traversal = traversals[i];
        fixture_draw(f, &drawn[i]);
    }
    for (int p = 0; p < WIDTH * HEIGHT; p++) {
        double rgba[4];
        reference_integral_trace(truth, p % WIDTH, p / WIDTH, fixture_background, NULL, 0, rgba);
        for (int k = 0; k < 8; k++)
            worst = test_larger_error(worst, fabs((double)drawn[k / 4].picture.rgba[4 * p + k % 4] - rgba[k % 4]));
    }
    reference_integral_free(truth);
    for (int i = 0; i < 2; i++) drawn_frame_free(&drawn[i]);
    if (!(worst <= most)) fail_msg("%s: off by %g", what, worst);
}

/* Compares pictures with the reference. Colours are at most 1, and the kernels skip what would change the colour of a
 * ray by less than 1e-7. A change a thousand times as large, nearly 1e-4, would be detected: it is about ten times the
 * error of samples (fixture_usual_bounds). For segments, values at their ends have an error of up to 4e-7 of the
 * transfer function's domain (docs/development/decisions/volume.md), and colours have this error times the number of
 * table entries. */
static void skipping_hidden_cells_changes_no_picture(void **state)
{
    (void)state;
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++)
        for (method how = 0; how < METHOD_COUNT; how++) {
            char what[96];
            render_fixture f;
            if (!test_is_long_run() && ((int)kind + (int)how) % 2) continue;
            set_up_frame(&f, kind, 5, how, 12);
            snprintf(what, sizeof what, "%s, %s", test_mesh_kind_name(kind), method_names[how]);
            if (how == SAMPLES)
                compare_samples(&f, what);
            else
                compare_integrals(&f, how == SEGMENTS ? 4e-7 * (COLOURS - 1) : max_error, what);
            fixture_free(&f);
        }
}

/* Compares the picture that several ranks draw together with the picture of one rank. A rank skips only what is behind
 * its own cells, so the ranks skip less than one rank that has all cells. */
static void ranks_skip_cells_behind_their_own_cells(void **state)
{
    (void)state;
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++)
        for (test_partition_kind partition = 0; partition < TEST_PARTITION_COUNT; partition++)
            for (method how = 0; how < METHOD_COUNT; how++) {
                test_mesh mesh;
                render_fixture whole, parts[RANKS];
                drawn_frame one, all;
                set_up_frame(&whole, kind, 6, how, 12);
                test_mesh_make_lattice(kind, 6, 0.2, front_to_back_field, &mesh);
                int *owners = malloc((size_t)mesh.cell_count * sizeof *owners);
                test_partition_cells(&mesh, partition, 6, RANKS, owners);
                for (int rank = 0; rank < RANKS; rank++) {
                    test_mesh part;
                    test_mesh_extract_part(&mesh, owners, rank, &part);
                    fixture_create(&parts[rank], &part, 1, (test_layout){.wide_coordinates = true, .wide_values = true},
                                   whole.cell_size, 1, (const double[]){0, 0, 0});
                    fixture_set_camera(&parts[rank], CAMERA_OUTSIDE, WIDTH, HEIGHT);
                    set_medium(&parts[rank], how, 12);
                    parts[rank].job.is_alone = false;
                    parts[rank].job.extent = whole.job.extent = 2 * sqrt(3);
                    test_mesh_free(&part);
                }
                fixture_draw(&whole, &one);
                fixture_draw_distributed(parts, RANKS, &all);
                if (!(drawn_frame_find_largest_difference(&one, &all) <= 1e-6))
                    fail_msg("%s, %s, %s: off by %g", test_mesh_kind_name(kind), test_partition_kind_name(partition),
                             method_names[how], drawn_frame_find_largest_difference(&one, &all));
                drawn_frame_free(&one);
                drawn_frame_free(&all);
                for (int rank = 0; rank < RANKS; rank++) fixture_free(&parts[rank]);
                fixture_free(&whole);
                free(owners);
                test_mesh_free(&mesh);
            }
}

static int64_t count_cells_placed(test_mesh_kind kind, render_traversal traversal, double depth)
{
    render_fixture f;
    drawn_frame drawn;
    set_up_frame(&f, kind, 24, SAMPLES, depth);
    fixture_set_camera(&f, CAMERA_OUTSIDE, 8 * WIDTH, 8 * HEIGHT);
    f.job.step = 0.5 * f.cell_size;
    f.job.traversal = traversal;
    fixture_draw(&f, &drawn);
    const int64_t placed = drawn.statistics.volume_cells;
    drawn_frame_free(&drawn);
    fixture_free(&f);
    return placed;
}

/* Checks that a dense medium needs less than 0.6 of the cells of a thin one. The first three or more of a ray's 24
 * cells absorb all light. More cells are transformed for two reasons: with binned traversal, a window of depths
 * contains all cells if memory allows, and the first tile has a deep window; other windows are at least four cells
 * deep, and a slanted face takes two to three cells in a tile. */
static void cells_behind_opaque_media_are_skipped(void **state)
{
    static const test_mesh_kind kinds[] = {TEST_TETS, TEST_HEXES, TEST_MIXED};
    (void)state;
    for (int k = 0; k < 3; k++)
        for (render_traversal traversal = RENDER_BINNED; traversal <= RENDER_TILES; traversal++) {
            const int64_t thin = count_cells_placed(kinds[k], traversal, 0.1);
            const int64_t dense = count_cells_placed(kinds[k], traversal, 80);
            const double share = (double)dense / (double)thin;
            fprintf(stderr, "%s, traversal %d: %.3f of %lld cells\n", test_mesh_kind_name(kinds[k]), (int)traversal,
                    share, (long long)thin);
            if (!(share < 0.6)) fail_msg("%g of the cells are placed", share);
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(skipping_hidden_cells_changes_no_picture),
                                       cmocka_unit_test(ranks_skip_cells_behind_their_own_cells),
                                       cmocka_unit_test(cells_behind_opaque_media_are_skipped)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
