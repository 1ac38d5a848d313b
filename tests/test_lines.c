/* Compares contour lines on surfaces with closed forms. The position of a level's line in the picture follows from the
 * formulas of the surface and of the field. The reference for the coverage of a pixel is the fraction of points in the
 * pixel that are nearer to the line than half the line's width. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "test_render_fixture.h"

enum { WIDTH = 97, HEIGHT = 83, PIXELS = WIDTH * HEIGHT, POINTS = 16 };

static const double through = 0;
static const double normal[3] = {0.36, -0.48, 0.8};
static const float black[3] = {0, 0, 0};
static const float white[12] = {1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1};

/* ---- surfaces and fields ---------------------------------------------------------------------------------------- */

static double distance_field(const double p[3])
{
    return normal[0] * p[0] + normal[1] * p[1] + normal[2] * p[2] - 0.1;
}

static double square_radius(const double p[3])
{
    return p[0] * p[0] + p[1] * p[1] + p[2] * p[2] - 0.64;
}

/* Returns the depth at which a ray meets the plane. */
static double compute_plane_depth(const double base[3], const double direction[3])
{
    const double along = normal[0] * direction[0] + normal[1] * direction[1] + normal[2] * direction[2];
    return -distance_field(base) / along;
}

static double compute_sphere_depth(const double base[3], const double direction[3])
{
    double a = 0, b = 0;
    for (int i = 0; i < 3; i++) {
        a += direction[i] * direction[i];
        b += base[i] * direction[i];
    }
    return (-b - sqrt(b * b - a * square_radius(base))) / a;
}

static double quadratic_field(const double p[3])
{
    return 0.6 * p[0] - 0.4 * p[1] + 0.3 * p[2] + 0.1 * p[0] * p[0] - 0.08 * p[0] * p[2] + 0.06 * p[1] * p[1];
}

typedef struct lines_case {
    const char *name;
    test_function *surface;
    double (*depth)(const double base[3], const double direction[3]);
    test_function *field;
    fixture_camera camera;
    float width;
    int cubes;     /* number of the lattice's cubes along an axis */
    double jitter; /* jitter of the lattice's vertices */
    int count;
    double values[4];
} lines_case;

/* The cases. A linear field is represented exactly in every cell, and so is the distance from a plane, so that cells
 * may have any size. For the other fields, the interpolants of cells have an error. On 40 cubes, it is an eighth of the
 * second derivative along a tet's longest edge, times the square of this edge's length, 0.09. That makes 4e-4 for the
 * quadratic field, whose slope is at least 0.6, and 2e-3 for the square of the radius, whose slope is 1.6. A pixel is
 * 0.03 of the scene, so that lines are off by up to 0.02 and 0.04 of a pixel. */
static const lines_case cases[] = {
    {"a linear field on a plane",
     distance_field,
     compute_plane_depth,
     test_linear_field,
     CAMERA_OUTSIDE,
     1.5F,
     4,
     0.2,
     3,
     {-0.3, 0, 0.25}},
    {"thin lines",
     distance_field,
     compute_plane_depth,
     test_linear_field,
     CAMERA_OUTSIDE,
     0.7F,
     4,
     0.2,
     2,
     {-0.1, 0.3}},
    {"wide lines",
     distance_field,
     compute_plane_depth,
     test_linear_field,
     CAMERA_ORTHOGRAPHIC,
     4,
     4,
     0.2,
     2,
     {-0.3, 0.25}},
    {"a quadratic field on a plane",
     distance_field,
     compute_plane_depth,
     quadratic_field,
     CAMERA_OUTSIDE,
     1.5F,
     40,
     0.1,
     3,
     {-0.4, 0.1, 0.5}},
    {"a linear field on a sphere",
     square_radius,
     compute_sphere_depth,
     test_linear_field,
     CAMERA_OUTSIDE,
     1.5F,
     40,
     0,
     2,
     {-0.1, 0.3}},
};
enum { CASES = sizeof cases / sizeof *cases };

/* ---- the reference ---------------------------------------------------------------------------------------------- */

typedef struct truth {
    const lines_case *of;
    render_camera camera;
    /* coverage of each pixel; -1 if the surface or the cube ends near the pixel */
    double cover[PIXELS];
} truth;

/* Returns the field at a position in the picture. The position is measured in pixels from the middle of the first
 * pixel. Returns NaN outside the surface and outside the cube. */
static double evaluate_field(const truth *t, double x, double y)
{
    render_camera camera = t->camera;
    double base[3], direction[3], at[3];
    camera.offset[0] = x;
    camera.offset[1] = y;
    render_camera_ray(&camera, 0, 0, base, direction);
    const double z = t->of->depth(base, direction);
    if (!(z > 0)) return NAN;
    for (int a = 0; a < 3; a++) {
        at[a] = base[a] + z * direction[a];
        if (!(fabs(at[a]) < 1)) return NAN;
    }
    return t->of->field(at);
}

/* Returns the distance from a position in the picture to the line of a level, found by Newton's method along the
 * gradient in the picture. */
static double compute_line_distance(const truth *t, double level, double x, double y)
{
    const double h = 1e-3;
    double px = x, py = y;
    for (int step = 0; step < 4; step++) {
        const double dx = (evaluate_field(t, px + h, py) - evaluate_field(t, px - h, py)) / (2 * h);
        const double dy = (evaluate_field(t, px, py + h) - evaluate_field(t, px, py - h)) / (2 * h);
        const double move = (evaluate_field(t, px, py) - level) / (dx * dx + dy * dy);
        px -= move * dx;
        py -= move * dy;
    }
    return hypot(px - x, py - y);
}

/* Returns the fraction of points in the pixel that lie within half the line's width. It is 0 without any search if the
 * pixel's middle is farther away than that plus one pixel, since no point is farther than half a diagonal from the
 * middle. */
static double compute_exact_coverage(const truth *t, double level, double x, double y)
{
    const double reach = 0.5 * (double)t->of->width, middle = compute_line_distance(t, level, x, y);
    int inside = 0;
    if (middle > reach + 1) return 0;
    for (int j = 0; j < POINTS; j++)
        for (int i = 0; i < POINTS; i++)
            inside +=
                compute_line_distance(t, level, x + (i + 0.5) / POINTS - 0.5, y + (j + 0.5) / POINTS - 0.5) <= reach;
    return (double)inside / (POINTS * POINTS);
}

static bool is_inside(const truth *t, double x, double y)
{
    const double far = (double)t->of->width + 3;
    return isfinite(evaluate_field(t, x - far, y - far)) && isfinite(evaluate_field(t, x + far, y - far)) &&
           isfinite(evaluate_field(t, x - far, y + far)) && isfinite(evaluate_field(t, x + far, y + far));
}

static double compute_pixel_coverage(const truth *t, int x, int y)
{
    int nearest = 0;
    double value = evaluate_field(t, x, y);
    if (!is_inside(t, x, y)) return -1;
    for (int i = 1; i < t->of->count; i++)
        if (fabs(value - t->of->values[i]) < fabs(value - t->of->values[nearest])) nearest = i;
    return compute_exact_coverage(t, t->of->values[nearest], x, y);
}

static truth *compute_reference(const lines_case *of, const render_camera *camera)
{
    truth *t = malloc(sizeof *t);
    assert_non_null(t);
    t->of = of;
    t->camera = *camera;
    for (int p = 0; p < PIXELS; p++) t->cover[p] = compute_pixel_coverage(t, p % WIDTH, p / WIDTH);
    return t;
}

/* ---- frames ------------------------------------------------------------------------------------------------------ */

typedef struct lines_frame {
    render_fixture f;
    test_mesh mesh;
    test_view field;
    render_lines lines;
} lines_frame;

/* Creates a frame that shows white lines on a black surface, with cells of the given kind. */
static void create_frame(lines_frame *out, const lines_case *of, test_mesh_kind kind, test_layout layout)
{
    test_mesh lines;
    test_mesh_make_lattice(kind, of->cubes, of->jitter, of->surface, &out->mesh);
    test_mesh_make_lattice(kind, of->cubes, of->jitter, of->field, &lines);
    test_view_create(&lines, layout, &out->field);
    test_mesh_free(&lines);
    fixture_create(&out->f, &out->mesh, 1, layout, 2.0 / of->cubes, 1, (const double[]){0, 0, 0});
    fixture_set_camera(&out->f, of->camera, WIDTH, HEIGHT);
    fixture_add_surface(&out->f, &through, 1, 1);
    out->lines = (render_lines){.field = {&out->field.field, out->f.ranges},
                                .count = of->count,
                                .values = of->values,
                                .width = of->width,
                                .colours = white};
    out->f.surfaces[0].lines = &out->lines;
    out->f.surfaces[0].colours = black;
    out->f.surfaces[0].material = (render_material){.ambient = 1, .shininess = 1};
}

static void free_frame(lines_frame *frame)
{
    test_view_free(&frame->field);
    test_mesh_free(&frame->mesh);
    fixture_free(&frame->f);
}

typedef struct lines_error {
    int count;
    double squares, drawn, exact; /* sums over the pixels that lines touch */
} lines_error;

static lines_error compare_coverage(const truth *t, const drawn_frame *drawn)
{
    lines_error e = {0};
    for (int p = 0; p < PIXELS; p++) {
        const double is = (double)drawn->picture.rgba[4 * p], off = is - t->cover[p];
        if (t->cover[p] < 0 || (t->cover[p] == 0 && is == 0)) continue;
        e.count++;
        e.squares += off * off;
        e.drawn += is;
        e.exact += t->cover[p];
    }
    return e;
}

/* ---- tests ------------------------------------------------------------------------------------------------------- */

static const test_layout layouts[2] = {{.wide_coordinates = true, .wide_values = true, .wide_indices = true},
                                       {.is_interleaved = true}};

/* Compares the lines of a frame with the reference. The root mean square error of a pixel must be below 0.02: the
 * kernels use a ramp one pixel wide for lines in all directions. Its error is up to 0.06 for diagonal lines, because
 * the exact ramp of a diagonal line is wider. The sum of the coverage, which is the width times the length, must agree
 * to 0.01. */
static void check_frame(const truth *t, const lines_frame *frame, const char *kind, int set)
{
    drawn_frame drawn;
    fixture_select_isa(set);
    fixture_draw(&frame->f, &drawn);
    const lines_error e = compare_coverage(t, &drawn);
    const double rms = sqrt(e.squares / e.count), share = e.drawn / e.exact;
    if (getenv("TEST_LINES_SHOW"))
        printf("%s, %s, %s: %d pixels, %.4f rms, width %.4f\n", t->of->name, kind, fixture_isa_name(set), e.count, rms,
               share);
    if (!(e.count > 100 && rms < 0.02 && fabs(share - 1) < 0.01))
        fail_msg("%s, %s, %s: %d pixels, %g rms, %g of the width", t->of->name, kind, fixture_isa_name(set), e.count,
                 rms, share);
    drawn_frame_free(&drawn);
}

/* Checks a case on all kinds of cells. Fine lattices are drawn with tets and hexes only. */
static void check_case(const lines_case *of)
{
    truth *t = NULL;
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++) {
        lines_frame frame;
        if (of->cubes > 8 && kind != TEST_TETS && kind != TEST_HEXES) continue;
        create_frame(&frame, of, kind, layouts[(int)kind % 2]);
        if (!t) t = compute_reference(of, &frame.f.job.camera);
        for (int set = 0; set < fixture_isa_count(); set++) check_frame(t, &frame, test_mesh_kind_name(kind), set);
        free_frame(&frame);
    }
    free(t);
}

static void line_coverage_matches_exact_strips(void **state)
{
    (void)state;
    for (int i = 0; i < CASES; i++) check_case(&cases[i]);
}

/* Checks that the picture of the whole mesh and the pictures composited from three ranks, for every partition, are
 * bit-identical. */
static void lines_are_the_same_on_any_partition(void **state)
{
    (void)state;
    enum { RANKS = 3 };
    const lines_case *of = &cases[0];
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++)
        for (test_partition_kind partition = 0; partition < TEST_PARTITION_COUNT; partition++) {
            static render_fixture parts[RANKS];
            static test_view fields[RANKS];
            static render_lines lines[RANKS];
            lines_frame whole;
            test_mesh values;
            drawn_frame one, several;
            create_frame(&whole, of, kind, layouts[0]);
            test_mesh_make_lattice(kind, of->cubes, of->jitter, of->field, &values);
            int *owners = malloc((size_t)values.cell_count * sizeof *owners);
            assert_non_null(owners);
            test_partition_cells(&values, partition, of->cubes, RANKS, owners);
            for (int rank = 0; rank < RANKS; rank++) {
                test_mesh part;
                test_mesh_extract_part(&values, owners, rank, &part);
                test_view_create(&part, layouts[0], &fields[rank]);
                test_mesh_free(&part);
                test_mesh_extract_part(&whole.mesh, owners, rank, &part);
                fixture_create(&parts[rank], &part, 1, layouts[0], 2.0 / of->cubes, 1, (const double[]){0, 0, 0});
                test_mesh_free(&part);
                lines[rank] = whole.lines;
                lines[rank].field = (render_field){&fields[rank].field, parts[rank].ranges};
                fixture_set_camera(&parts[rank], of->camera, WIDTH, HEIGHT);
                fixture_add_surface(&parts[rank], &through, 1, 1);
                parts[rank].surfaces[0] = whole.f.surfaces[0];
                parts[rank].surfaces[0].field = (render_field){parts[rank].fields, parts[rank].ranges};
                parts[rank].surfaces[0].lines = &lines[rank];
            }
            fixture_draw(&whole.f, &one);
            fixture_draw_distributed(parts, RANKS, &several);
            drawn_frame_assert_same(&one, &several);
            for (int rank = 0; rank < RANKS; rank++) {
                fixture_free(&parts[rank]);
                test_view_free(&fields[rank]);
            }
            free(owners);
            test_mesh_free(&values);
            drawn_frame_free(&one);
            drawn_frame_free(&several);
            free_frame(&whole);
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(line_coverage_matches_exact_strips),
        cmocka_unit_test(lines_are_the_same_on_any_partition),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
