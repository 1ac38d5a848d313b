/* Compares polyhedra with the reference, including rays along the lines at which many of a cell's tets meet; with the
 * same cells stored as tets and hexes; beside hexes; and distributed over ranks. */
#include "reference_integral.h"
#include "test_effort.h"
#include "test_render_fixture.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <cmocka.h>

static const double values[3] = {-0.25, 0.1, 0.35};
static const double wave_values[2] = {-0.2, 0.3};
static const float constant_opacity[1] = {0.3f};

static void create_mesh_fixture(render_fixture *f, const test_mesh *meshes, int count, double cell_size)
{
    fixture_create(f, meshes, count, (test_layout){.wide_coordinates = true, .wide_values = true}, cell_size, 1,
                   (const double[]){0, 0, 0});
}

static const char *make_case_name(const char *what, fixture_camera camera)
{
    static char name[96];
    snprintf(name, sizeof name, "%s, %s", what, fixture_camera_name(camera));
    return name;
}

/* Compares a single polyhedron with the reference: a prism with a concave base, an octahedron with spikes, or a cell
 * with a cavity. */
static void compare_shape(test_polyhedron_shape shape, fixture_camera camera, bool is_linear)
{
    test_mesh mesh;
    render_fixture f;
    test_mesh_make_polyhedron(shape, is_linear ? test_linear_field : test_wave_field, &mesh);
    create_mesh_fixture(&f, &mesh, 1, 1);
    fixture_set_camera(&f, camera, 49, 43);
    fixture_add_surface(&f, values, 3, 0.5f);
    fixture_set_volume(&f, 0.05);
    const fixture_outcome o =
        fixture_compare_with_reference(&f, &fixture_usual_bounds, make_case_name(test_polyhedron_name(shape), camera));
    assert_true(o.hits > 20);
    assert_true(!is_linear || 100 * o.ambiguous <= o.rays);
    fixture_free(&f);
    test_mesh_free(&mesh);
}

static void shapes_match_the_reference(void **state)
{
    (void)state;
    for (test_polyhedron_shape shape = 0; shape < TEST_POLYHEDRON_COUNT; shape++)
        for (fixture_camera camera = 0; camera < CAMERA_INSIDE; camera++)
            for (int is_linear = 0; is_linear < 2; is_linear++) compare_shape(shape, camera, is_linear);
}

enum { AIMED_RAYS = 600 };

/* Makes a picture of one pixel. Its ray comes from a random direction and passes through a random point of a spoke: the
 * line from a random vertex to the mean of all vertices, at which the sheets (triangles between two of the cell's tets)
 * of all edges of the vertex meet. */
static void aim_at_spoke(render_fixture *f, const test_mesh *mesh, uint64_t ray)
{
    const uint64_t vertex = (uint64_t)(test_uniform(ray, 1) * (double)mesh->vertex_count);
    const double along = test_uniform(ray, 2), angle = 6.283 * test_uniform(ray, 3),
                 height = 1.8 * test_uniform(ray, 4);
    double mean[3] = {0}, target[3];
    for (int64_t v = 0; v < mesh->vertex_count; v++)
        for (int a = 0; a < 3; a++) mean[a] += mesh->coordinates[3 * v + a] / (double)mesh->vertex_count;
    for (uint64_t a = 0; a < 3; a++) target[a] = mean[a] + along * (mesh->coordinates[3 * vertex + a] - mean[a]);
    const double across = sqrt(1 - (height - 0.9) * (height - 0.9));
    const double eye[3] = {3 * across * cos(angle), 3 * across * sin(angle), 3 * (height - 0.9)};
    assert_true(render_camera_look_at(&f->job.camera, eye, target, (const double[]){0, 0, 1}, 1, 1, 1));
}

/* Checks sums over overlapping tets on rays through a spoke. The field is a sum over the tets that contain the point,
 * and rounding may exchange the ends of neighbouring tets on such rays. A wrong sum would be off by the value of
 * another tet, a few tenths. The tolerance covers values in float32, which have an error of about 1e-6, and the same
 * error of a segment's length in a steep part of the transfer function. The rounding of the ray itself does not change
 * the sum by more, because the field is continuous. */
static void sums_on_spokes_match_the_reference(void **state)
{
    static const test_polyhedron_shape shapes[3] = {TEST_L_PRISM, TEST_BENT_SPIKES, TEST_CAVITY};
    (void)state;
    for (int s = 0; s < 3; s++) {
        test_mesh mesh;
        render_fixture f;
        double worst = 0;
        test_mesh_make_polyhedron(shapes[s], test_linear_field, &mesh);
        for (int64_t v = 0; v < mesh.vertex_count; v++) mesh.values[v] = 2 * test_uniform((uint64_t)v, 5) - 1;
        create_mesh_fixture(&f, &mesh, 1, 1);
        fixture_set_volume(&f, 1);
        f.job.integration = RENDER_SEGMENTS;
        for (uint64_t ray = 0; ray < AIMED_RAYS; ray++) {
            drawn_frame drawn;
            double truth[4];
            aim_at_spoke(&f, &mesh, ray);
            fixture_draw(&f, &drawn);
            reference_integral *scene = reference_integral_create(&f.job, 1e-9);
            reference_integral_trace(scene, 0, 0, fixture_background, NULL, 0, truth);
            reference_integral_free(scene);
            for (int c = 0; c < 4; c++) {
                const double off = fabs((double)drawn.picture.rgba[c] - truth[c]);
                worst = test_larger_error(worst, off);
            }
            drawn_frame_free(&drawn);
        }
        fprintf(stderr, "%s, rays through spokes: %.2g\n", test_polyhedron_name(shapes[s]), worst);
        assert_true(worst < 1e-5);
        fixture_free(&f);
        test_mesh_free(&mesh);
    }
}

static void assert_same_alpha(const drawn_frame *a, const drawn_frame *b)
{
    for (int64_t p = 0; p < (int64_t)a->picture.width * a->picture.height; p++)
        if (a->picture.rgba[4 * p + 3] != b->picture.rgba[4 * p + 3])
            fail_msg("pixel %d: alpha %.9g and %.9g", (int)p, (double)a->picture.rgba[4 * p + 3],
                     (double)b->picture.rgba[4 * p + 3]);
}

typedef void scene_set(render_fixture *f);

static void set_surfaces(render_fixture *f)
{
    fixture_add_surface(f, wave_values, 2, 0.5f);
}

static void set_volume(render_fixture *f)
{
    fixture_set_volume(f, 0.3);
}

/* Sets a volume in which every sample has the same weight. Alpha then depends only on the number of samples inside
 * cells, that is on the cells' intervals. */
static void set_constant_volume(render_fixture *f)
{
    fixture_set_volume(f, 0.07);
    f->transfer.opacity_count = 1;
    f->transfer.opacities = constant_opacity;
}

static void draw_mesh(const test_mesh *mesh, fixture_camera camera, scene_set *set, drawn_frame *out)
{
    render_fixture f;
    create_mesh_fixture(&f, mesh, 1, 0.5);
    fixture_set_camera(&f, camera, 61, 47);
    set(&f);
    fixture_draw(&f, out);
    fixture_free(&f);
}

static void assert_same_as_polyhedra(test_mesh_kind kind, double share, double jitter, scene_set *set)
{
    for (fixture_camera camera = 0; camera < CAMERA_COUNT; camera++) {
        test_mesh mesh;
        drawn_frame first, other;
        test_mesh_make_lattice(kind, 4, jitter, test_wave_field, &mesh);
        draw_mesh(&mesh, camera, set, &first);
        test_mesh_to_polyhedra(&mesh, share);
        draw_mesh(&mesh, camera, set, &other);
        assert_true(first.list.count > 100);
        if (set == set_constant_volume)
            assert_same_alpha(&first, &other);
        else
            drawn_frame_assert_same(&first, &other);
        drawn_frame_free(&first);
        drawn_frame_free(&other);
        test_mesh_free(&mesh);
    }
}

static void tets_passed_as_polyhedra_match_tets(void **state)
{
    (void)state;
    for (int lattice = 0; lattice < 2; lattice++) {
        assert_same_as_polyhedra(TEST_TETS, 1, lattice ? 0 : 0.2, set_surfaces);
        assert_same_as_polyhedra(TEST_TETS, 0.5, lattice ? 0 : 0.2, set_volume);
    }
}

/* Checks that intervals are bit-identical whichever of the two cells at a face is a polyhedron, so that no sample is
 * lost or counted twice. */
static void intervals_of_polyhedra_match_typed_cells(void **state)
{
    (void)state;
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++)
        for (int pass = 0; pass < 4 && kind != TEST_POLYHEDRA; pass++)
            assert_same_as_polyhedra(kind, pass % 2 ? 0.5 : 1, pass / 2 ? 0 : 0.2, set_constant_volume);
}

/* Checks lattices of which all cells or half of them are polyhedra. The usual run draws each from every second camera.
 */
static void polyhedra_beside_other_cells_match_the_reference(void **state)
{
    (void)state;
    static const test_mesh_kind kinds[3] = {TEST_HEXES, TEST_WEDGES, TEST_MIXED};
    for (int i = 0; i < 3; i++)
        for (fixture_camera camera = 0; camera < CAMERA_ALONG_X; camera++)
            for (int half = 0; half < 2; half++) {
                test_mesh mesh;
                render_fixture f;
                if (!test_is_long_run() && (i + (int)camera + half) % 2) continue;
                test_mesh_make_lattice(kinds[i], 4, 0.2, test_wave_field, &mesh);
                test_mesh_to_polyhedra(&mesh, half ? 0.5 : 1);
                create_mesh_fixture(&f, &mesh, 1, 0.5);
                fixture_set_camera(&f, camera, 33, 29);
                fixture_add_surface(&f, wave_values, 2, 0.5f);
                fixture_set_volume(&f, 0.3);
                fixture_compare_with_reference(&f, &fixture_usual_bounds,
                                               make_case_name(test_mesh_kind_name(kinds[i]), camera));
                fixture_free(&f);
                test_mesh_free(&mesh);
            }
}

/* Checks the isosurface of a linear field, which polyhedra represent exactly even if their faces are warped. The
 * tolerance is that of linear_surface_is_a_plane_in_every_kind. */
static void linear_surface_of_warped_polyhedra_is_a_plane(void **state)
{
    (void)state;
    test_mesh mesh;
    render_fixture f;
    drawn_frame drawn;
    test_mesh_make_lattice(TEST_HEXES, 4, 0.2, test_linear_field, &mesh);
    test_mesh_to_polyhedra(&mesh, 0.7);
    create_mesh_fixture(&f, &mesh, 1, 0.5);
    fixture_set_camera(&f, CAMERA_OUTSIDE, 61, 47);
    fixture_add_surface(&f, values, 3, 0.5f);
    fixture_draw(&f, &drawn);
    for (int64_t i = 0; i < drawn.list.count; i++) {
        const fragment *hit = &drawn.list.items[i];
        double base[3], d[3];
        render_camera_ray(&f.job.camera, (int)hit->pixel % 61, (int)hit->pixel / 61, base, d);
        const double slope = 0.3 * d[0] - 0.7 * d[1] + 0.5 * d[2];
        const double value = test_linear_field(base) + slope * fixture_compute_scene_depth(&f, hit->t_in);
        if (!(fabs(value - values[hit->kind - FRAGMENT_SURFACE]) < 2e-6 + 1e-6 * fabs(slope)))
            fail_msg("pixel %u: value %.9g", hit->pixel, value);
    }
    assert_true(drawn.list.count > 300);
    drawn_frame_free(&drawn);
    fixture_free(&f);
    test_mesh_free(&mesh);
}

enum { RANKS = 7 };

/* Draws the mesh on several simulated ranks. If is_turned is set, each cell's vertices are reordered too. Polyhedra do
 * not depend on this order, but the inverse map of a hex does. */
static void draw_distributed(const test_mesh *mesh, bool is_turned, scene_set *set, drawn_frame *out)
{
    render_fixture parts[RANKS];
    int *owners = malloc((size_t)mesh->cell_count * sizeof *owners);
    test_partition_cells(mesh, TEST_RANDOM, 4, RANKS, owners);
    for (int rank = 0; rank < RANKS; rank++) {
        test_mesh part;
        test_mesh_extract_part(mesh, owners, rank, &part);
        test_mesh_shuffle_cells(&part, (uint64_t)rank + 20);
        if (is_turned) test_mesh_reorder_vertices(&part, (uint64_t)rank + 40);
        create_mesh_fixture(&parts[rank], &part, 1, 0.5);
        fixture_set_camera(&parts[rank], CAMERA_OUTSIDE, 61, 47);
        set(&parts[rank]);
        parts[rank].job.is_alone = false;
        test_mesh_free(&part);
    }
    fixture_draw_distributed(parts, RANKS, out);
    for (int rank = 0; rank < RANKS; rank++) fixture_free(&parts[rank]);
    free(owners);
}

/* Checks cells that are distributed randomly over seven ranks. Each rank has its own order of cells, vertices and
 * faces. */
static void random_cell_owners_change_no_pixel(void **state)
{
    (void)state;
    for (int pass = 0; pass < 6; pass++) {
        test_mesh mesh;
        drawn_frame alone, distributed;
        test_mesh_make_lattice(pass % 3 == 0   ? TEST_POLYHEDRA
                               : pass % 3 == 1 ? TEST_HEXES
                                               : TEST_MIXED,
                               4, 0.2, test_wave_field, &mesh);
        if (pass % 3) test_mesh_to_polyhedra(&mesh, pass % 3 == 1 ? 1 : 0.6);
        draw_mesh(&mesh, CAMERA_OUTSIDE, pass < 3 ? set_surfaces : set_volume, &alone);
        draw_distributed(&mesh, pass % 3 < 2, pass < 3 ? set_surfaces : set_volume, &distributed);
        if (pass < 3) drawn_frame_assert_same(&alone, &distributed);
        if (!(drawn_frame_find_largest_difference(&alone, &distributed) <= 1e-6))
            fail_msg("off by %g", drawn_frame_find_largest_difference(&alone, &distributed));
        drawn_frame_free(&alone);
        drawn_frame_free(&distributed);
        test_mesh_free(&mesh);
    }
}

/* With an argument, runs only the tests whose names match this pattern, for runs under valgrind. */
int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(shapes_match_the_reference),
        cmocka_unit_test(sums_on_spokes_match_the_reference),
        cmocka_unit_test(tets_passed_as_polyhedra_match_tets),
        cmocka_unit_test(intervals_of_polyhedra_match_typed_cells),
        cmocka_unit_test(polyhedra_beside_other_cells_match_the_reference),
        cmocka_unit_test(linear_surface_of_warped_polyhedra_is_a_plane),
        cmocka_unit_test(random_cell_owners_change_no_pixel),
    };
    if (argc > 1) cmocka_set_test_filter(argv[1]);
    return cmocka_run_group_tests(tests, NULL, NULL);
}
