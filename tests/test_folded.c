/* Checks cells whose maps are folded. A point in such a cell has several solutions of the inverse map or none, and
 * there is no reference to compare with. But the picture must consist of finite numbers, and it must depend neither on
 * how the simulation numbers a cell's vertices nor on the rank that has the cell. The report must count the inverse
 * maps without a solution; for cells that are not folded, this count is 0. The usual run draws every second pair of a
 * camera and a scene for each kind of cell. */
#include "test_effort.h"
#include "test_render_fixture.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <cmocka.h>

enum { SIDE = 4, RANKS = 7, WIDTH = 45, HEIGHT = 39 };

static const test_mesh_kind kinds[4] = {TEST_HEXES, TEST_WEDGES, TEST_PYRAMIDS, TEST_MIXED};
static const double values[3] = {-0.3, 0.1, 0.4};

/* Makes a lattice and moves its vertices by up to 1.33 cells along each axis, so that the maps of most cells are
 * inverted somewhere. */
static void make_tangled_mesh(test_mesh_kind kind, test_mesh *out)
{
    test_mesh_make_lattice(kind, SIDE, 0.2, test_wave_field, out);
    for (int64_t v = 0; v < out->vertex_count; v++)
        for (int a = 0; a < 3; a++)
            out->coordinates[3 * v + a] += (4.0 / 3 * test_uniform((uint64_t)(3 * v + a), 11) - 2.0 / 3) * 2 / SIDE;
}

typedef enum scene_kind { CLEAR, OPAQUE, DIFFERENCES, SAMPLES, SEGMENTS, SCENE_COUNT } scene_kind;

static void set_scene(render_fixture *f, scene_kind scene)
{
    if (scene == SAMPLES || scene == SEGMENTS) {
        fixture_set_volume(f, 0.2);
        if (scene == SEGMENTS) f->job.integration = RENDER_SEGMENTS;
        return;
    }
    fixture_add_surface(f, values, 3, scene == OPAQUE ? 1 : 0.4f);
    f->surfaces[0].normal = scene == DIFFERENCES ? RENDER_DIFFERENCES : RENDER_GRADIENT;
    f->surfaces[0].difference = 1;
}

static void set_up_frame(render_fixture *f, const test_mesh *mesh, fixture_camera camera, scene_kind scene)
{
    fixture_create(f, mesh, 1, (test_layout){.wide_coordinates = true, .wide_values = true}, 2.0 / SIDE, 1,
                   (const double[]){0, 0, 0});
    fixture_set_camera(f, camera, WIDTH, HEIGHT);
    set_scene(f, scene);
}

static void assert_finite(const fragment *item)
{
    bool is_finite = isfinite(item->t_in) && isfinite(item->t_out) && isfinite(item->transmittance);
    for (int a = 0; a < 3; a++) is_finite = is_finite && isfinite(item->colour[a]);
    if (!is_finite) fail_msg("pixel %u: t %g to %g", item->pixel, (double)item->t_in, (double)item->t_out);
}

static bool is_case_selected(int kind, fixture_camera camera, scene_kind scene)
{
    return test_is_long_run() || (kind + (int)camera + (int)scene) % 4 == 0;
}

static void folded_cells_give_finite_pixels(void **state)
{
    (void)state;
    int64_t failures = 0;
    for (int k = 0; k < 4; k++)
        for (fixture_camera camera = 0; camera < CAMERA_COUNT; camera++)
            for (scene_kind scene = 0; scene < SCENE_COUNT; scene++) {
                test_mesh mesh;
                render_fixture f;
                drawn_frame drawn;
                if (!is_case_selected(k, camera, scene)) continue;
                make_tangled_mesh(kinds[k], &mesh);
                set_up_frame(&f, &mesh, camera, scene);
                fixture_draw(&f, &drawn);
                assert_true(drawn.list.count > 100);
                for (int64_t i = 0; i < drawn.list.count; i++) assert_finite(&drawn.list.items[i]);
                for (int i = 0; i < 4 * WIDTH * HEIGHT; i++) assert_true(isfinite(drawn.picture.rgba[i]));
                failures += drawn.statistics.map_failures;
                drawn_frame_free(&drawn);
                fixture_free(&f);
                test_mesh_free(&mesh);
            }
    printf("%lld inverse maps fell back to the faces' values\n", (long long)failures);
    assert_true(failures > 1000);
}

/* Draws the mesh on seven simulated ranks. Each rank has its own numbering of cells and vertices and its own order of
 * vertices within cells. Compared with a single rank, surfaces are bit-identical, and separate samples agree up to the
 * rounding of the "over" operator. */
static void draw_distributed(const test_mesh *mesh, scene_kind scene, drawn_frame *out)
{
    render_fixture parts[RANKS];
    int *owners = malloc((size_t)mesh->cell_count * sizeof *owners);
    test_partition_cells(mesh, TEST_RANDOM, SIDE, RANKS, owners);
    for (int rank = 0; rank < RANKS; rank++) {
        test_mesh part;
        test_mesh_extract_part(mesh, owners, rank, &part);
        test_mesh_shuffle_cells(&part, (uint64_t)rank + 20);
        test_mesh_reorder_vertices(&part, (uint64_t)rank + 40);
        set_up_frame(&parts[rank], &part, CAMERA_OUTSIDE, scene);
        parts[rank].job.is_alone = false;
        parts[rank].job.separate_samples = scene == SAMPLES;
        test_mesh_free(&part);
    }
    fixture_draw_distributed(parts, RANKS, out);
    for (int rank = 0; rank < RANKS; rank++) fixture_free(&parts[rank]);
    free(owners);
}

static void numbering_and_ranks_change_no_pixel(void **state)
{
    static const scene_kind scenes[2] = {CLEAR, SAMPLES};
    (void)state;
    for (int k = 0; k < 4; k++)
        for (int s = 0; s < 2; s++) {
            test_mesh mesh;
            render_fixture f;
            drawn_frame whole, distributed;
            make_tangled_mesh(kinds[k], &mesh);
            set_up_frame(&f, &mesh, CAMERA_OUTSIDE, scenes[s]);
            f.job.separate_samples = scenes[s] == SAMPLES;
            fixture_draw(&f, &whole);
            draw_distributed(&mesh, scenes[s], &distributed);
            if (scenes[s] != SAMPLES) drawn_frame_assert_same(&whole, &distributed);
            if (!(drawn_frame_find_largest_difference(&whole, &distributed) <= 1e-6))
                fail_msg("off by %g", drawn_frame_find_largest_difference(&whole, &distributed));
            drawn_frame_free(&whole);
            drawn_frame_free(&distributed);
            fixture_free(&f);
            test_mesh_free(&mesh);
        }
}

static void inverse_maps_of_valid_cells_converge(void **state)
{
    (void)state;
    for (int k = 0; k < 4; k++)
        for (fixture_camera camera = 0; camera < CAMERA_COUNT; camera++)
            for (scene_kind scene = 0; scene < SCENE_COUNT; scene++) {
                test_mesh mesh;
                render_fixture f;
                drawn_frame drawn;
                if (!is_case_selected(k, camera, scene)) continue;
                test_mesh_make_lattice(kinds[k], SIDE, 0.2, test_wave_field, &mesh);
                set_up_frame(&f, &mesh, camera, scene);
                fixture_draw(&f, &drawn);
                /* Rays along x lie in faces and edges at the border of the mesh and meet the apexes of pyramids, where
                 * a pyramid's map has no inverse. */
                const int64_t allowed =
                    camera == CAMERA_ALONG_X && kinds[k] == TEST_PYRAMIDS ? drawn.list.count / 50 : 0;
                if (drawn.statistics.map_failures > allowed)
                    fail_msg("%s, %s: %lld inverse maps failed", test_mesh_kind_name(kinds[k]),
                             fixture_camera_name(camera), (long long)drawn.statistics.map_failures);
                drawn_frame_free(&drawn);
                fixture_free(&f);
                test_mesh_free(&mesh);
            }
}

int main(void)
{
    if (fixture_isa_is_unavailable()) return 77;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(folded_cells_give_finite_pixels),
        cmocka_unit_test(numbering_and_ranks_change_no_pixel),
        cmocka_unit_test(inverse_maps_of_valid_cells_converge),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
