/* Checks batches, in which tiles trace one cell per lane (kernel_batch.h, kernel_curved_batch.h): tets of meshes
 * without clips, hexes, wedges and pyramids. Pictures must be bit-identical to those whose cells are traced one by one,
 * which a layer with its own clips enforces. A cell covers one pixel, some or many. The last cells of a mesh share a
 * vector, and several of them may hit the same pixel. The usual run draws each scene from every third camera,
 * alternately, so that each kind of cells is drawn from each camera. */
#include "test_effort.h"
#include "test_render_fixture.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <cmocka.h>

enum { WIDTH = 61, HEIGHT = 47 };

static const float other_colours[2][3] = {{0.9f, 0.9f, 0.1f}, {0.1f, 0.9f, 0.9f}};
static const double values[4] = {-0.2, 0.3, 0.1, -0.5};

static void create_fixture_with_layout(render_fixture *f, const test_mesh *meshes, int count, int n,
                                       fixture_camera camera, test_layout layout)
{
    fixture_create(f, meshes, count, layout, 2.0 / n, 1, (const double[]){0, 0, 0});
    fixture_set_camera(f, camera, WIDTH, HEIGHT);
}

static void create_fixture(render_fixture *f, const test_mesh *meshes, int count, int n, fixture_camera camera)
{
    create_fixture_with_layout(f, meshes, count, n, camera, (test_layout){.is_interleaved = n % 2});
}

static void compare_with_single_cells(render_fixture *f)
{
    drawn_frame batches, alone;
    /* A box that contains all meshes. It clips one layer only, since a clip of all layers would cut the rays
     * themselves. */
    const render_clip everything = {.kind = RENDER_CLIP_BOX, .lower = {-1e6, -1e6, -1e6}, .upper = {1e6, 1e6, 1e6}};
    fixture_draw(f, &batches);
    f->job.clips = &everything;
    f->job.clip_count = 1;
    for (int i = 0; i < f->job.surface_count; i++) {
        f->surfaces[i].clips = 1;
        fixture_draw(f, &alone);
        assert_true(batches.list.count > 100);
        assert_int_equal(batches.list.count, alone.list.count);
        drawn_frame_assert_same(&batches, &alone);
        drawn_frame_free(&alone);
    }
    drawn_frame_free(&batches);
    fixture_free(f);
}

static bool is_case_selected(int turn)
{
    return test_is_long_run() || turn % 6 == 0;
}

static void batches_draw_same_picture_as_single_cells(void **state)
{
    (void)state;
    static const test_mesh_kind kinds[] = {TEST_TETS, TEST_HEXES, TEST_WEDGES, TEST_PYRAMIDS, TEST_MIXED};
    static const struct {
        int n;
        test_function *field;
    } lattices[] = {{2, test_wave_field},
                    {4, test_wave_field},
                    {7, test_wave_field},
                    {13, test_wave_field},
                    {16, test_linear_field}};
    for (size_t i = 0; i < sizeof lattices / sizeof *lattices; i++)
        for (fixture_camera camera = 0; camera < CAMERA_COUNT; camera++)
            for (int turn = 0; turn < 2 * (int)(sizeof kinds / sizeof *kinds); turn++) {
                const int jittered = turn % 2;
                /* not 0, because the kernels have special code for opaque surfaces in cuboids (kernel_cuboids.h), which
                 * test_hits.c checks */
                const double jitter = jittered ? 0.2 : 1e-4;
                render_fixture f;
                test_mesh mesh;
                if (!is_case_selected((int)i + (int)camera + turn)) continue;
                test_mesh_make_lattice(kinds[turn / 2], lattices[i].n, jitter, lattices[i].field, &mesh);
                create_fixture(&f, &mesh, 1, lattices[i].n, camera);
                fixture_add_surface(&f, values, 1 + jittered, 1);
                compare_with_single_cells(&f);
                test_mesh_free(&mesh);
            }
}

/* Checks cells whose vertices are in any order, in arrays of all layouts. Some cells have an edge of length 0, so that
 * quads collapse to triangles and triangles to edges. */
static void any_numbering_gives_the_same_batches(void **state)
{
    static const test_mesh_kind kinds[] = {TEST_HEXES, TEST_WEDGES, TEST_PYRAMIDS, TEST_MIXED};
    (void)state;
    for (int turn = 0; turn < 6 * (int)(sizeof kinds / sizeof *kinds); turn++)
        for (fixture_camera camera = 0; camera < CAMERA_COUNT; camera++) {
            const int n = turn / 2 % 2 ? 12 : 5;
            render_fixture f;
            test_mesh mesh;
            if (!is_case_selected((int)camera + turn)) continue;
            test_mesh_make_lattice(kinds[turn / 6], n, 0.2, test_wave_field, &mesh);
            for (int64_t c = 0; turn % 6 < 4 && c < mesh.cell_count; c += 7)
                mesh.connectivity[mesh.offsets[c] + 1] = mesh.connectivity[mesh.offsets[c]];
            test_mesh_reorder_vertices(&mesh, (uint64_t)turn);
            create_fixture_with_layout(
                &f, &mesh, 1, n, camera,
                (test_layout){.wide_coordinates = turn % 2, .wide_indices = turn % 6 == 4, .is_interleaved = true});
            fixture_add_surface(&f, values, 2, 1);
            compare_with_single_cells(&f);
            test_mesh_free(&mesh);
        }
}

/* Checks scenes with several meshes and layers: all cells of a batch must belong to one mesh and one layer. */
static void batches_contain_one_mesh_and_layer(void **state)
{
    (void)state;
    static const test_mesh_kind kinds[][2] = {
        {TEST_TETS, TEST_HEXES}, {TEST_TETS, TEST_TETS}, {TEST_WEDGES, TEST_PYRAMIDS}, {TEST_MIXED, TEST_WEDGES}};
    for (size_t kind = 0; kind < sizeof kinds / sizeof *kinds; kind++)
        for (fixture_camera camera = 0; camera < CAMERA_COUNT; camera++) {
            render_fixture f;
            test_mesh meshes[2];
            test_mesh_make_lattice(kinds[kind][0], 7, 0.2, test_wave_field, &meshes[0]);
            test_mesh_make_lattice(kinds[kind][1], 8, 0.1, test_linear_field, &meshes[1]);
            create_fixture(&f, meshes, 2, 7, camera);
            fixture_add_surface(&f, values, 2, 1);
            fixture_add_surface(&f, values + 2, 2, kind % 2 ? 1 : 0.4f);
            f.surfaces[1].colours = other_colours[0];
            compare_with_single_cells(&f);
            for (int i = 0; i < 2; i++) test_mesh_free(&meshes[i]);
        }
}

/* Checks hits at equal depths: each hit occurs twice. */
static void hits_at_equal_depth_are_kept(void **state)
{
    (void)state;
    static const test_mesh_kind kinds[] = {TEST_TETS, TEST_HEXES, TEST_WEDGES, TEST_PYRAMIDS};
    for (int turn = 0; turn < 2 * (int)(sizeof kinds / sizeof *kinds); turn++) {
        const int n = turn % 2 ? 16 : 4;
        render_fixture f;
        test_mesh meshes[2];
        for (int i = 0; i < 2; i++) test_mesh_make_lattice(kinds[turn / 2], n, 0.2, test_linear_field, &meshes[i]);
        create_fixture(&f, meshes, 2, n, CAMERA_OUTSIDE);
        fixture_add_surface(&f, values, 1, 1);
        compare_with_single_cells(&f);
        for (int i = 0; i < 2; i++) test_mesh_free(&meshes[i]);
    }
}

/* Checks cells with extreme values, from tiny ones to NaN. They are traced one by one although other cells in the same
 * vector are traced in a batch. */
static void unusual_values_are_handled_one_by_one(void **state)
{
    static const float opacity[1] = {0.3f};
    static const double odd[] = {3e31, -3e31, 1e-41, (double)INFINITY, (double)NAN, 3e38};
    (void)state;
    static const test_mesh_kind kinds[] = {TEST_TETS, TEST_TETS, TEST_HEXES, TEST_WEDGES, TEST_PYRAMIDS};
    for (size_t turn = 0; turn < sizeof kinds / sizeof *kinds; turn++) {
        const bool as_volume = turn == 1;
        render_fixture f;
        test_mesh mesh;
        test_mesh_make_lattice(kinds[turn], 7, 0.2, test_wave_field, &mesh);
        for (int64_t v = 5; v < mesh.vertex_count; v += 37)
            mesh.values[v] = odd[v / 37 % (int64_t)(sizeof odd / sizeof *odd)];
        create_fixture(&f, &mesh, 1, 7, CAMERA_OUTSIDE);
        if (as_volume) {
            fixture_set_volume(&f, 0.1);
            f.transfer.opacity_count = 1; /* the opacity is the same for all values, however large */
            f.transfer.opacities = opacity;
        } else {
            /* a single isovalue, because with two many hits would have equal depths */
            fixture_add_surface(&f, values, 1, 1);
        }
        compare_with_single_cells(&f);
        test_mesh_free(&mesh);
    }
}

/* Checks contour lines over the colours of isovalues and over a colour map. The kernels sort a cell's vertices by their
 * coordinates, so the order of vertices in the mesh must not matter. */
static void lines_of_batches_match_single_cells(void **state)
{
    static const test_mesh_kind kinds[] = {TEST_HEXES, TEST_WEDGES, TEST_PYRAMIDS, TEST_MIXED};
    static const double levels[3] = {-0.4, 0.05, 0.3};
    static const float white[9] = {1, 1, 1, 1, 1, 1, 1, 1, 1};
    (void)state;
    for (int turn = 0; turn < 4 * (int)(sizeof kinds / sizeof *kinds); turn++) {
        const int n = turn % 2 ? 13 : 4;
        render_fixture f;
        test_mesh mesh, other;
        test_view view;
        test_mesh_make_lattice(kinds[turn / 4], n, 0.2, test_wave_field, &mesh);
        test_mesh_make_lattice(kinds[turn / 4], n, 0.2, test_linear_field, &other);
        test_mesh_reorder_vertices(&mesh, 3);
        test_mesh_reorder_vertices(&other, 3);
        test_view_create(&other, (test_layout){.is_interleaved = true}, &view);
        create_fixture(&f, &mesh, 1, n, (fixture_camera)(turn % (int)CAMERA_COUNT));
        fixture_add_surface(&f, values, 2, 1);
        const render_lines lines = {
            .field = {&view.field, f.ranges}, .count = 3, .values = levels, .width = 2, .colours = white};
        f.surfaces[0].lines = &lines;
        if (turn % 4 > 1) {
            fixture_set_volume(&f, 0.3); /* the surface uses the colours of this volume's transfer function */
            f.job.volume_count = 0;
            f.surfaces[0].colour_field = (render_field){&view.field, f.ranges};
            f.surfaces[0].colour_map = &f.transfer;
        }
        compare_with_single_cells(&f);
        test_view_free(&view);
        test_mesh_free(&mesh);
        test_mesh_free(&other);
    }
}

int main(void)
{
    if (fixture_isa_is_unavailable()) return 77;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(batches_draw_same_picture_as_single_cells),
        cmocka_unit_test(any_numbering_gives_the_same_batches),
        cmocka_unit_test(batches_contain_one_mesh_and_layer),
        cmocka_unit_test(hits_at_equal_depth_are_kept),
        cmocka_unit_test(unusual_values_are_handled_one_by_one),
        cmocka_unit_test(lines_of_batches_match_single_cells),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
