/* Checks that the points of VTK's contour lines on a plane lie on pixels that the library's contour lines cover. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "test_contour_vtk.h"
#include "test_render_fixture.h"

enum { WIDTH = 640, HEIGHT = 480, SIDE = 40, LEVELS = 5 };

static const double through = 0, origin[3] = {0.036, -0.048, 0.08}, normal[3] = {0.36, -0.48, 0.8};
static const double levels[LEVELS] = {-1.2, -0.6, 0.1, 0.7, 1.3};
static const float black[3] = {0, 0, 0};
static const float white[3 * LEVELS] = {1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1};

static double distance_field(const double p[3])
{
    return normal[0] * p[0] + normal[1] * p[1] + normal[2] * p[2] - 0.1;
}

/* test_wave_field() stretched by two, so that its wavelength is 42 cells. */
static double compute_wave_field_value(const double p[3])
{
    return test_wave_field((const double[]){p[0] / 2, p[1] / 2, p[2] / 2});
}

/* Returns the fraction of the point's pixel that lines cover. Returns -1 if the point is outside the picture, or so
 * near to the border of the cube that the pixel's middle may not be on the plane. */
static double get_line_coverage(const render_camera *c, const image *picture, const double point[3])
{
    const double size = 2 * c->half_height / c->height;
    double x = 0, y = 0, z = 0;
    for (int a = 0; a < 3; a++) {
        if (fabs(point[a]) > 0.99) return -1;
        x += (point[a] - c->eye[a]) * c->right[a];
        y += (point[a] - c->eye[a]) * c->up[a];
        z += (point[a] - c->eye[a]) * c->forward[a];
    }
    if (c->is_orthographic) z = 1;
    const double column = floor(x / z / size + 0.5 * c->width), row = floor(0.5 * c->height - y / z / size);
    if (!(column >= 0 && column < c->width && row >= 0 && row < c->height)) return -1;
    return (double)picture->rgba[4 * ((int)row * c->width + (int)column)];
}

/* Checks the coverage of the pixels at VTK's points. A point is at most half of a pixel's diagonal (0.71) from the
 * pixel's middle, and a line is 1.5 pixels wide, so it covers at least 1.25 - 0.71 of the pixel. VTK cuts the polygon
 * of a hex into triangles. On 40 cubes this moves lines of this field by at most 0.1 of a pixel. At sharp turns of a
 * line, at a saddle or near an extremum, the lines of neither program are straight, so 1 of 1000 points may be off the
 * line. */
static void check_kind(test_mesh_kind kind, int type, fixture_camera camera)
{
    test_mesh mesh, values;
    test_view view;
    render_fixture f;
    drawn_frame drawn;
    double *points;
    test_mesh_make_lattice(kind, SIDE, 0.1, distance_field, &mesh);
    test_mesh_make_lattice(kind, SIDE, 0.1, compute_wave_field_value, &values);
    test_view_create(&values, (test_layout){.wide_coordinates = true, .wide_values = true}, &view);
    fixture_create_lattice(&f, kind, SIDE, 0.1, distance_field);
    fixture_set_camera(&f, camera, WIDTH, HEIGHT);
    fixture_add_surface(&f, &through, 1, 1);
    const render_lines lines = {
        .field = {&view.field, f.ranges}, .count = LEVELS, .values = levels, .width = 1.5F, .colours = white};
    f.surfaces[0].lines = &lines;
    f.surfaces[0].colours = black;
    f.surfaces[0].material = (render_material){.ambient = 1, .shininess = 1};
    fixture_draw(&f, &drawn);
    const int64_t count =
        test_vtk_compute_contours(mesh.vertex_count, mesh.coordinates, mesh.cell_count, type, mesh.connectivity,
                                  values.values, origin, normal, LEVELS, levels, &points);
    int64_t seen = 0, beside = 0;
    for (int64_t i = 0; i < count; i++) {
        const double cover = get_line_coverage(&f.job.camera, &drawn.picture, points + 3 * i);
        seen += cover >= 0;
        beside += cover >= 0 && !(cover > 0.3);
    }
    printf("%s, %s: %lld of %lld points beside lines\n", test_mesh_kind_name(kind), fixture_camera_name(camera),
           (long long)beside, (long long)seen);
    assert_true(seen > 5000 && (double)beside <= 0.001 * (double)seen);
    free(points);
    drawn_frame_free(&drawn);
    test_view_free(&view);
    test_mesh_free(&mesh);
    test_mesh_free(&values);
    fixture_free(&f);
}

static void points_of_vtk_contours_lie_on_drawn_lines(void **state)
{
    (void)state;
    check_kind(TEST_TETS, 10, CAMERA_OUTSIDE);
    check_kind(TEST_HEXES, 12, CAMERA_OUTSIDE);
    check_kind(TEST_HEXES, 12, CAMERA_ORTHOGRAPHIC);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(points_of_vtk_contours_lie_on_drawn_lines)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
