/* Checks the volumes of single cells (session_volume.h). Randomly bent hexes, wedges and pyramids of either orientation
 * are compared with quadrature in double. Polyhedra that are not star-shaped or that have a hole or a cavity, with
 * their faces in any order, are compared with closed forms. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <string.h>

#include "session_volume.h"
#include "test_mesh_make.h"

/* ---- quadrature ------------------------------------------------------------------------------------------------ */

enum { POINTS = 4 /* number of Gauss-Legendre points per axis: exact up to degree 7 along each axis */ };
static const double nodes[POINTS] = {0.06943184420297371, 0.33000947820757187, 0.6699905217924281, 0.9305681557970263};
static const double weights[POINTS] = {0.17392742256872692, 0.32607257743127307, 0.32607257743127307,
                                       0.17392742256872692};

/* Maps a point of the unit cube into the cell. The map is trilinear for hexes. For wedges, the triangle is a collapsed
 * square; for pyramids, the base shrinks towards the apex. */
static void map_to_cell(int type, double (*p)[3], const double at[3], double out[3])
{
    const double u = at[0], v = at[1], w = at[2];
    const double square[4] = {(1 - u) * (1 - v), u * (1 - v), u * v, (1 - u) * v};
    const double triangle[3] = {1 - u, u * (1 - v), u * v};
    for (int axis = 0; axis < 3; axis++) {
        out[axis] = 0;
        for (int i = 0; type == GRID_HEX && i < 8; i++) out[axis] += square[i % 4] * (i < 4 ? 1 - w : w) * p[i][axis];
        for (int i = 0; type == GRID_WEDGE && i < 6; i++)
            out[axis] += triangle[i % 3] * (i < 3 ? 1 - w : w) * p[i][axis];
        for (int i = 0; type == GRID_PYRAMID && i < 5; i++) out[axis] += (i < 4 ? square[i] * (1 - w) : w) * p[i][axis];
    }
}

/* Computes the determinant of the map's derivatives. Differences give the derivatives exactly, because the map is
 * linear along each axis. */
static double compute_jacobian_determinant(int type, double (*p)[3], const double at[3])
{
    double d[3][3];
    for (int axis = 0; axis < 3; axis++) {
        double low[3] = {at[0], at[1], at[2]}, high[3] = {at[0], at[1], at[2]}, a[3], b[3];
        low[axis] = 0;
        high[axis] = 1;
        map_to_cell(type, p, low, a);
        map_to_cell(type, p, high, b);
        for (int k = 0; k < 3; k++) d[axis][k] = b[k] - a[k];
    }
    return d[0][0] * (d[1][1] * d[2][2] - d[1][2] * d[2][1]) + d[0][1] * (d[1][2] * d[2][0] - d[1][0] * d[2][2]) +
           d[0][2] * (d[1][0] * d[2][1] - d[1][1] * d[2][0]);
}

static double integrate_volume(int type, double (*p)[3])
{
    double sum = 0;
    for (int i = 0; i < POINTS * POINTS * POINTS; i++) {
        const int n[3] = {i % POINTS, i / POINTS % POINTS, i / POINTS / POINTS};
        const double at[3] = {nodes[n[0]], nodes[n[1]], nodes[n[2]]};
        sum += weights[n[0]] * weights[n[1]] * weights[n[2]] * compute_jacobian_determinant(type, p, at);
    }
    return fabs(sum);
}

/* ---- volumes --------------------------------------------------------------------------------------------------- */

/* Returns the volume of the mesh's only cell. Checks that each vertex of the mesh is found in the cell one time. */
static double compute_mesh_volume(const test_mesh *mesh)
{
    const test_layout wide = {.wide_coordinates = true, .wide_indices = true, .wide_values = true, .with_types = true};
    test_view view;
    volume_buffer room = {0};
    test_view_create(mesh, wide, &view);
    const double volume = session_cell_volume(&view.cells, 0, &room);
    assert_false(room.is_out_of_memory);
    assert_int_equal(room.vertex_count, mesh->vertex_count);
    session_volume_free(&room);
    test_view_free(&view);
    return volume;
}

/* Compares two volumes. The tolerance of 1e-12 covers rounding: sums of a few hundred products of numbers of order 1
 * are off by less than 1e-13. */
static void assert_nearly_equal(double volume, double expected)
{
    if (fabs(volume - expected) <= 1e-12) return;
    print_error("volume %.15g, expected %.15g\n", volume, expected);
    fail();
}

static void volumes_of_bent_cells_match_quadrature(void **state)
{
    (void)state;
    static const test_cell_shape shapes[4] = {TEST_UNIT_TET, TEST_UNIT_HEX, TEST_UNIT_WEDGE, TEST_UNIT_PYRAMID};
    for (int trial = 0; trial < 400; trial++) {
        test_mesh mesh;
        test_mesh_make_single_cell(shapes[trial % 4], test_linear_field, &mesh);
        for (int64_t i = 0; i < 3 * mesh.vertex_count; i++)
            mesh.coordinates[i] += test_uniform_between((uint64_t)(1000 * trial + i), 3, -0.25, 0.25);
        if (trial & 4) test_mesh_mirror_cells(&mesh, false);
        const int type = mesh.types[0];
        double places[8][3];
        for (int i = 0; i < grid_type_vertex_count(type); i++)
            memcpy(places[i], mesh.coordinates + 3 * mesh.connectivity[i], sizeof places[i]);
        const double expected = type == GRID_TET ? NAN : integrate_volume(type, places);
        if (type != GRID_TET) assert_nearly_equal(compute_mesh_volume(&mesh), expected);
        const double before = compute_mesh_volume(&mesh);
        test_mesh_to_polyhedra(&mesh, 1);
        assert_nearly_equal(compute_mesh_volume(&mesh), before);
        test_mesh_reorder_vertices(&mesh, (uint64_t)trial);
        assert_nearly_equal(compute_mesh_volume(&mesh), before);
        test_mesh_free(&mesh);
    }
}

static double compute_shape_volume(const test_mesh *mesh, test_polyhedron_shape shape)
{
    double places[16][3], sum = 0;
    memcpy(places, mesh->coordinates, 3 * (size_t)mesh->vertex_count * sizeof(double));
    if (shape == TEST_CAVITY) return integrate_volume(GRID_HEX, places) - integrate_volume(GRID_HEX, places + 8);
    /* The other shapes are sheared upright prisms. The area of the base is computed from its corners. */
    const int around = shape == TEST_L_PRISM ? 6 : 8;
    for (int i = 0; i < around; i++) {
        const double *a = places[i], *b = places[(i + 1) % around];
        sum += (a[0] * b[1] - a[1] * b[0]) / 2;
    }
    return 0.85 * fabs(sum);
}

static void volumes_of_concave_polyhedra_match_closed_forms(void **state)
{
    (void)state;
    static const test_polyhedron_shape shapes[3] = {TEST_L_PRISM, TEST_U_PRISM, TEST_CAVITY};
    for (int i = 0; i < 3; i++)
        for (uint64_t turn = 0; turn < 20; turn++) {
            test_mesh mesh;
            test_mesh_make_polyhedron(shapes[i], test_linear_field, &mesh);
            const double expected = compute_shape_volume(&mesh, shapes[i]);
            if (turn) test_mesh_reorder_vertices(&mesh, turn);
            assert_nearly_equal(compute_mesh_volume(&mesh), expected);
            test_mesh_free(&mesh);
        }
}

/* Checks a square frame: the cell's centre is in the hole, and the inner faces are seen from behind from there. */
static void volumes_of_rings_match_closed_forms(void **state)
{
    (void)state;
    static const int picks[4][4] = {{0, 1, 5, 4}, {1, 2, 6, 5}, {2, 3, 7, 6}, {3, 0, 4, 7}};
    static const double sides[2] = {0.5, 0.3};
    test_mesh mesh;
    int64_t faces[16];
    int count = 0;
    test_mesh_allocate(&mesh, 16, 1, 16);
    test_mesh_allocate_faces(&mesh, 16, 64);
    for (int ring = 0; ring < 2; ring++)
        for (int i = 0; i < 8; i++)
            test_mesh_add_vertex(&mesh, (const double[]){sides[ring] * ((i + 1) / 2 % 2 ? 1 : -1),
                                                         sides[ring] * (i / 2 % 2 ? 1 : -1), i < 4 ? 0 : 0.5});
    for (int ring = 0; ring < 2; ring++)
        for (int i = 0; i < 4; i++) {
            int64_t quad[4];
            for (int k = 0; k < 4; k++) quad[k] = 8 * ring + picks[i][k];
            faces[count++] = test_mesh_add_face(&mesh, quad, 4);
        }
    for (int level = 0; level < 8; level += 4)
        for (int i = 0; i < 4; i++) {
            const int64_t quad[4] = {level + i, level + (i + 1) % 4, 8 + level + (i + 1) % 4, 8 + level + i};
            faces[count++] = test_mesh_add_face(&mesh, quad, 4);
        }
    test_mesh_add_polyhedron(&mesh, faces, count);
    for (uint64_t turn = 0; turn < 20; turn++) {
        if (turn) test_mesh_reorder_vertices(&mesh, turn);
        assert_nearly_equal(compute_mesh_volume(&mesh), (1 - 0.36) * 0.5);
    }
    test_mesh_free(&mesh);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(volumes_of_bent_cells_match_quadrature),
                                       cmocka_unit_test(volumes_of_concave_polyhedra_match_closed_forms),
                                       cmocka_unit_test(volumes_of_rings_match_closed_forms)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
