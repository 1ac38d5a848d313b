/* Checks a mesh whose faces are not plane: the dual of a tet mesh. Every polyhedron consists of the tets between the
 * triangles of its faces and its centre. Isosurfaces of the mesh must equal those of the same field on these tets,
 * drawn as a tet mesh, in every pixel except those that rounding decides. Cells that are not star-shaped are left out,
 * because their tets overlap. Faces with four vertices are split into triangles for this comparison, because rays
 * intersect unsplit quads on bilinear patches. With unsplit faces, all cells are compared with the reference. */
#include "test_mesh_dual.h"
#include "test_own_tets.h"
#include "test_render_fixture.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <cmocka.h>

static int cubes = 8, width = 320, height = 240;

/* Makes a dual mesh with the wave field and adds noise to the values. */
static void make_dual(int n, double noise, test_mesh *out)
{
    test_mesh_make_dual(n, 0.15, test_wave_field, out);
    for (int64_t v = 0; v < out->vertex_count; v++)
        out->values[v] += noise * test_uniform_between((uint64_t)v, 31, -1, 1);
}

static void dual_cells_match_their_split_tets(void **state)
{
    (void)state;
    for (int pass = 0; pass < 2; pass++) {
        test_mesh mesh;
        make_dual(cubes, pass ? 0.4 : 0, &mesh);
        test_mesh_split_quads(&mesh);
        const own_tets_tally t = compare_with_split_tets(&mesh, 2.0 / cubes, 0.3, width, height);
        printf("%lld cells, %lld of them not star-shaped, %s: %lld pixels, %lld missing, %lld added; %lld left out\n",
               (long long)mesh.cell_count, (long long)t.ghosts, pass ? "noise" : "wave", (long long)t.pixels,
               (long long)t.missing, (long long)t.added, (long long)t.in_band);
        assert_true(t.pixels > width * height / 10);
        assert_int_equal(t.missing, 0);
        assert_int_equal(t.added, 0);
        /* The test leaves out few pixels and cells: of the 7,471 cells of the long run, 258 are not star-shaped. */
        assert_true(1000 * t.in_band < t.pixels && 25 * t.ghosts < mesh.cell_count);
        test_mesh_free(&mesh);
    }
}

static void duals_match_the_reference(void **state)
{
    static const double values[2] = {-0.2, 0.3};
    (void)state;
    for (fixture_camera camera = 0; camera < CAMERA_ALONG_X; camera++) {
        test_mesh mesh;
        render_fixture f;
        make_dual(4, 0.4, &mesh);
        fixture_create(&f, &mesh, 1, (test_layout){.wide_coordinates = true, .wide_values = true}, 0.5, 1,
                       (const double[]){0, 0, 0});
        fixture_set_camera(&f, camera, 33, 29);
        fixture_add_surface(&f, values, 2, 0.5f);
        const fixture_outcome o =
            fixture_compare_with_reference(&f, &fixture_usual_bounds, fixture_camera_name(camera));
        assert_true(o.hits > 100);
        fixture_free(&f);
        test_mesh_free(&mesh);
    }
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(dual_cells_match_their_split_tets),
        cmocka_unit_test(duals_match_the_reference),
    };
    if (argc > 1) cubes = atoi(argv[1]), width = 1280, height = 960;
    return cmocka_run_group_tests(tests, NULL, NULL);
}
