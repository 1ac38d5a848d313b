/* Checks slices, which the renderer draws as the isosurface 0 of the vertices' distances from a plane. Positions and
 * colours are compared with a brute-force intersection in double, on warped cells of every type. Positions are also
 * compared with the plane's closed form. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdio.h>

#include "test_render_fixture.h"

enum { SIDE = 4, WIDTH = 33, HEIGHT = 29 };
#define JITTER 0.2

static const double through = 0;
static const double normal[3] = {0.36, -0.48, 0.8};

static double compute_signed_distance(const double position[3])
{
    return normal[0] * position[0] + normal[1] * position[1] + normal[2] * position[2] - 0.1;
}

/* Checks that hits are on the plane. A cell is a quarter as wide as half the cube. The fixture's bound on errors of
 * depths, 2e-6 cells or 5e-7 × conditioning, is then below 1e-5 in the scene for rays that meet the plane at an angle
 * of more than a few degrees. */
static void assert_on_plane(const render_fixture *f, const drawn_frame *drawn, const char *what)
{
    int64_t hits = 0;
    for (int64_t i = 0; i < drawn->list.count; i++) {
        const fragment *item = &drawn->list.items[i];
        double base[3], direction[3], at[3];
        render_camera_ray(&f->job.camera, (int)(item->pixel % WIDTH), (int)(item->pixel / WIDTH), base, direction);
        for (int a = 0; a < 3; a++) at[a] = base[a] + fixture_compute_scene_depth(f, item->t_in) * direction[a];
        if (!(fabs(compute_signed_distance(at)) < 1e-5))
            fail_msg("%s: pixel %lld: %g from the plane", what, (long long)item->pixel, compute_signed_distance(at));
        hits++;
    }
    assert_true(hits > 100);
}

static void check_kind(test_mesh_kind kind)
{
    test_mesh mesh;
    test_view colours;
    render_fixture f;
    drawn_frame drawn;
    test_mesh_make_lattice(kind, SIDE, JITTER, test_wave_field, &mesh);
    test_view_create(&mesh, (test_layout){.wide_coordinates = true, .wide_values = true}, &colours);
    fixture_create_lattice(&f, kind, SIDE, JITTER, compute_signed_distance);
    fixture_set_camera(&f, CAMERA_OUTSIDE, WIDTH, HEIGHT);
    fixture_set_volume(&f, 0.3); /* the volume's colour map also colours the surface */
    f.job.volume_count = 0;
    fixture_add_surface(&f, &through, 1, 1);
    f.surfaces[0].colour_field = (render_field){&colours.field, f.ranges};
    f.surfaces[0].colour_map = &f.transfer;
    f.surfaces[0].material = (render_material){.ambient = 1, .shininess = 1};
    fixture_compare_with_reference(&f, &fixture_usual_bounds, test_mesh_kind_name(kind));
    fixture_draw(&f, &drawn);
    assert_on_plane(&f, &drawn, test_mesh_kind_name(kind));
    drawn_frame_free(&drawn);
    test_view_free(&colours);
    test_mesh_free(&mesh);
    fixture_free(&f);
}

static void slices_of_warped_cells_match_the_reference(void **state)
{
    (void)state;
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++) check_kind(kind);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(slices_of_warped_cells_match_the_reference),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
