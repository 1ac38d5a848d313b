/* Compares pictures of the Voronoi cells of INSITU_TEST_DATA, 8,000 polyhedra with up to 21 faces, with the brute-force
 * renderer: surfaces, samples and segments. Then moves the vertices so that faces are not plane, and compares the
 * polyhedra with the same field on the tets of which they consist. Returns 77 if INSITU_TEST_DATA is not set. */
#include "reference_integral.h"
#include "test_data_mesh.h"
#include "test_effort.h"
#include "test_mesh_dual.h"
#include "test_own_tets.h"
#include "test_render_fixture.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <cmocka.h>

static test_mesh mesh;
static int width,
    /* height of the picture; brute force tests all cells, usually for a third of the rays */
    height;

static void create_cells_fixture(render_fixture *f)
{
    fixture_create(f, &mesh, 1, (test_layout){.wide_coordinates = true, .wide_values = true}, 0.1, 1,
                   (const double[]){0, 0, 0});
    fixture_set_camera(f, CAMERA_OUTSIDE, width, height);
}

static void surfaces_and_samples_match_the_reference(void **state)
{
    static const double opaque[1] = {0.2}, clear[2] = {-0.6, 0.9};
    (void)state;
    for (int pass = 0; pass < 2; pass++) {
        render_fixture f;
        create_cells_fixture(&f);
        fixture_add_surface(&f, pass ? clear : opaque, pass ? 2 : 1, pass ? 0.4f : 1);
        fixture_set_volume(&f, 1);
        const fixture_outcome o = fixture_compare_with_reference(&f, &fixture_usual_bounds, pass ? "clear" : "opaque");
        fprintf(stderr, "%d rays, %d hits, %d excluded: depth %.2g cells, colour %.2g\n", (int)o.rays, (int)o.hits,
                (int)o.excluded, o.worst_depth, o.worst_colour);
        assert_true(o.hits > width * height / 5);
        fixture_free(&f);
    }
}

/* Compares volumes integrated by segments with the adaptive integral. Segments are exact on tets, and therefore on
 * polyhedra. The tolerance is 1e-6 as in test_segments.c, whose rays cross as many cells. */
static void segments_match_the_integral(void **state)
{
    (void)state;
    render_fixture f;
    drawn_frame drawn;
    double worst = 0;
    create_cells_fixture(&f);
    fixture_set_volume(&f, 1);
    f.job.integration = RENDER_SEGMENTS;
    fixture_draw(&f, &drawn);
    reference_integral *scene = reference_integral_create(&f.job, 1e-9);
    for (int p = 0; p < width * height; p += 3) {
        double rgba[4];
        reference_integral_trace(scene, p % width, p / width, fixture_background, NULL, 0, rgba);
        for (int c = 0; c < 4; c++)
            worst = test_larger_error(worst, fabs((double)drawn.picture.rgba[4 * p + c] - rgba[c]));
    }
    reference_integral_free(scene);
    fprintf(stderr, "segments: %.2g\n", worst);
    assert_true(worst < 1e-6);
    drawn_frame_free(&drawn);
    fixture_free(&f);
}

/* Checks polyhedra with curved faces: moves vertices by up to 1 % of a cell along each axis. This test must be the last
 * one, because it changes the mesh. */
static void moved_polyhedra_match_their_split_tets(void **state)
{
    (void)state;
    for (uint64_t i = 0; i < 3 * (uint64_t)mesh.vertex_count; i++)
        mesh.coordinates[i] += test_uniform_between(i, 41, -0.001, 0.001);
    test_mesh_split_quads(&mesh);
    const own_tets_tally t = compare_with_split_tets(&mesh, 0.1, 0.2, 320, 240);
    fprintf(stderr, "%d cells not star-shaped; %d pixels, %d missing, %d added; %d left out\n", (int)t.ghosts,
            (int)t.pixels, (int)t.missing, (int)t.added, (int)t.in_band);
    assert_true(t.pixels > 10000 && 1000 * t.in_band < t.pixels && 10 * t.ghosts < mesh.cell_count);
    assert_int_equal(t.missing, 0);
    assert_int_equal(t.added, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(surfaces_and_samples_match_the_reference),
        cmocka_unit_test(segments_match_the_integral),
        cmocka_unit_test(moved_polyhedra_match_their_split_tets),
    };
    char path[4096];
    const char *folder = getenv("INSITU_TEST_DATA");
    if (!folder || !folder[0]) {
        print_message("skipped: INSITU_TEST_DATA is not set\n");
        return 77;
    }
    snprintf(path, sizeof path, "%s/poly_voronoi.vtu", folder);
    if (!test_data_mesh(path, "f", &mesh)) return 1;
    width = test_case_count(13, 23);
    height = test_case_count(11, 19);
    const int failed = cmocka_run_group_tests(tests, NULL, NULL);
    test_mesh_free(&mesh);
    return failed;
}
