/* Checks automatic cameras: the sphere or the box to which a camera is fitted lies inside the frame and fills it. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

#include "session_camera.h"

static double draw_uniform(double low, double high)
{
    return low + (high - low) * ((double)rand() / RAND_MAX);
}

static session_extent random_extent(void)
{
    session_extent e = {.cell_count = 1, .solid_count = 1};
    double square = 0;
    const double size = pow(10, draw_uniform(-3, 6));
    for (int a = 0; a < 3; a++) {
        e.lower[a] = size * draw_uniform(-5, 5);
        e.upper[a] = e.lower[a] + size * (rand() % 7 ? draw_uniform(0.01, 1) : 0); /* some boxes are flat */
        square += pow(e.upper[a] - e.lower[a], 2);
    }
    e.half_diagonal = 0.5 * sqrt(square);
    return e;
}

static scene_image random_image(void)
{
    scene_image image = {.width = 64 + rand() % 400, .height = 64 + rand() % 400};
    image.camera = (scene_camera){.is_automatic = true, .angle = draw_uniform(5, 60), .zoom = 1};
    for (int a = 0; a < 3; a++) image.camera.direction[a] = draw_uniform(-1, 1);
    image.camera.up[rand() % 3] = 1;
    return image;
}

/* Computes the bounds of the extent's corners in the picture, in coordinates that are -1 and 1 at the picture's
 * borders. Returns false if a corner is not in front of the eye. */
static bool compute_projected_bounds(const render_camera *c, const session_extent *e, double low[2], double high[2])
{
    const double half[2] = {c->half_height * c->width / c->height, c->half_height};
    bool are_before = true;
    for (int a = 0; a < 2; a++) low[a] = INFINITY, high[a] = -INFINITY;
    for (int corner = 0; corner < 8; corner++) {
        double x[2] = {0, 0}, z = 0;
        for (int a = 0; a < 3; a++) {
            const double offset = (corner >> a & 1 ? e->upper[a] : e->lower[a]) - c->eye[a];
            x[0] += offset * c->right[a];
            x[1] += offset * c->up[a];
            z += offset * c->forward[a];
        }
        are_before = are_before && z > 0;
        for (int a = 0; a < 2; a++) {
            const double place = x[a] / (half[a] * (c->is_orthographic ? 1 : z));
            low[a] = fmin(low[a], place);
            high[a] = fmax(high[a], place);
        }
    }
    return are_before;
}

/* Returns whether the eye has the smallest allowed distance from the nearest corner: a hundredth of the half
 * diagonal. */
static bool is_close(const render_camera *c, const session_extent *e)
{
    double nearest = INFINITY;
    for (int corner = 0; corner < 8; corner++) {
        double z = 0;
        for (int a = 0; a < 3; a++) z += ((corner >> a & 1 ? e->upper[a] : e->lower[a]) - c->eye[a]) * c->forward[a];
        nearest = fmin(nearest, z);
    }
    return nearest < 0.0101 * e->half_diagonal;
}

/* Checks cameras fitted to boxes: along the tighter of width and height the box reaches both borders; along the other
 * it is inside and centred. The tolerance allows for the rounding of bounds that are up to a thousand times as far from
 * the origin as they are large. */
static void check_box(bool is_orthographic)
{
    srand(11);
    for (int i = 0; i < 3000; i++) {
        const session_extent extent = random_extent();
        scene_image image = random_image();
        render_camera camera;
        double low[2], high[2];
        image.camera.fits_box = true;
        image.camera.is_orthographic = is_orthographic;
        if (!(extent.half_diagonal > 0) || !session_make_camera(&extent, &image, &camera)) continue;
        assert_true(compute_projected_bounds(&camera, &extent, low, high));
        double most = 0;
        for (int a = 0; a < 2; a++) most = fmax(most, fmax(-low[a], high[a]));
        assert_true(most <= 0.95 + 1e-9);
        if (fmin(extent.upper[0] - extent.lower[0],
                 fmin(extent.upper[1] - extent.lower[1], extent.upper[2] - extent.lower[2])) > 0)
            assert_true(most > 0.95 - 1e-9 || is_close(&camera, &extent));
    }
}

static void a_box_fills_the_frame(void **state)
{
    (void)state;
    check_box(false);
}

static void a_box_fills_an_orthographic_frame(void **state)
{
    (void)state;
    check_box(true);
}

/* Returns the fraction of half a side of the picture that decorations leave free. words: number of heights of text that
 * the decorations take, 6.5 for a colour bar, 2.4 for a title, 3 for a ruler; size: height of the text in pixels. */
static double compute_undecorated_fraction(double words, double size, int pixels)
{
    return fmax(0.95 - 2 * words * size / pixels, 0.5);
}

/* Checks that the data reaches both borders of the free space along the tighter of width and height, and crosses no
 * border. */
static void decorations_keep_their_space(void **state)
{
    (void)state;
    srand(12);
    for (int i = 0; i < 3000; i++) {
        const session_extent extent = random_extent();
        scene_image image = random_image();
        scene_decorations *d = &image.decorations;
        render_camera camera;
        double low[2], high[2];
        image.camera.fits_box = true;
        image.camera.is_orthographic = i % 2;
        *d = (scene_decorations){.is_given = true, .size = 0.03, .has_bars = i % 3, .has_rulers = i % 5 == 0};
        d->bar_anchor = i % 3 == 1 ? SCENE_LEFT : SCENE_RIGHT;
        d->title = i % 7 ? (char *)(uintptr_t) "title" : NULL;
        if (!(extent.half_diagonal > 0) || !session_make_camera(&extent, &image, &camera)) continue;
        const double size = 0.03 * image.height, ruled = d->has_rulers ? 3 : 0;
        const double most[2] = {compute_undecorated_fraction(ruled + (i % 3 == 2 ? 6.5 : 0), size, image.width),
                                compute_undecorated_fraction(i % 7 ? 2.4 : 0, size, image.height)};
        const double least[2] = {-compute_undecorated_fraction(ruled + (i % 3 == 1 ? 6.5 : 0), size, image.width),
                                 -compute_undecorated_fraction(ruled, size, image.height)};
        assert_true(compute_projected_bounds(&camera, &extent, low, high));
        bool is_filled = is_close(&camera, &extent);
        for (int a = 0; a < 2; a++) {
            assert_true(low[a] >= least[a] - 1e-9 && high[a] <= most[a] + 1e-9);
            is_filled = is_filled || (low[a] < least[a] + 1e-9 && high[a] > most[a] - 1e-9);
        }
        assert_true(is_filled || extent.upper[0] == extent.lower[0] || extent.upper[1] == extent.lower[1] ||
                    extent.upper[2] == extent.lower[2]);
    }
}

/* Checks the sphere around the data's bounds, seen from the eye: it does not overlap the space of bars and texts, is as
 * large as possible, and is off-centre only if necessary. */
static void sphere_does_not_overlap_decorations(void **state)
{
    (void)state;
    srand(13);
    static scene_slice slices[8];
    for (int i = 0; i < 3000; i++) {
        session_extent extent = random_extent();
        scene_image image = random_image();
        scene_decorations *d = &image.decorations;
        scene_words words[2] = {{(char *)(uintptr_t) "word", SCENE_BOTTOM}, {(char *)(uintptr_t) "word", SCENE_TOP}};
        render_camera camera;
        if (!(extent.half_diagonal > 0)) continue;
        image.camera.is_orthographic = i % 2;
        *d = (scene_decorations){.is_given = i % 5, .size = 0.03, .has_bars = i % 3, .bar_anchor = SCENE_RIGHT};
        d->words = words, d->words_count = i % 4 ? 2 : 0;
        image.slices = slices, image.slice_count = i % 8;
        if (!session_make_camera(&extent, &image, &camera)) continue;
        /* With one-line labels, 4 bars fit in a column of a picture 33 lines high. */
        const double columns = i % 5 && i % 3 ? 1 + (i % 8 > 4) : 0, lines = i % 5 && i % 4 ? 2 : 0;
        const double bars = fmin(2 * 6.5 * columns * 0.03 * image.height / image.width, 0.5);
        const double most[4] = {1 - bars, 1, 1 - 2 * lines * 0.03, 1 - 2 * lines * 0.03};
        double centre[3] = {0, 0, 0}, ends[4];
        for (int a = 0; a < 3; a++) {
            const double offset = 0.5 * (extent.lower[a] + extent.upper[a]) - camera.eye[a];
            centre[0] += offset * camera.right[a];
            centre[1] += offset * camera.up[a];
            centre[2] += offset * camera.forward[a];
        }
        double half[2] = {camera.half_height * camera.width / camera.height, camera.half_height};
        bool is_filled[2];
        for (int side = 0; side < 4; side++) {
            /* Distance of the sphere's centre from the plane through the eye and the border, divided by the radius. */
            const double x = side % 2 ? -centre[side / 2] : centre[side / 2], edge = most[side] * half[side / 2];
            ends[side] = camera.is_orthographic ? (edge - x) / extent.half_diagonal
                                                : (edge * centre[2] - x) / hypot(1, edge) / extent.half_diagonal;
            assert_true(ends[side] >= 1 - 1e-6);
        }
        for (int a = 0; a < 2; a++) {
            is_filled[a] = ends[2 * a] < 1 + 1e-6 && ends[2 * a + 1] < 1 + 1e-6;
            const bool is_moved = fabs(centre[a]) > 1e-6 * extent.half_diagonal;
            assert_true(!is_moved || fmin(ends[2 * a], ends[2 * a + 1]) < 1 + 1e-6);
        }
        assert_true(is_filled[0] || is_filled[1]);
    }
}

static void zoom_and_height_scale_the_view(void **state)
{
    (void)state;
    const session_extent extent = {.lower = {0, 0, 0}, .upper = {2, 2, 2}, .half_diagonal = sqrt(3), .cell_count = 1};
    scene_image image = {.width = 200, .height = 100};
    render_camera camera;
    image.camera = (scene_camera){.is_automatic = true,
                                  .angle = 40,
                                  .zoom = 2,
                                  .fits_box = true,
                                  .is_orthographic = true,
                                  .direction = {0, 0, 1},
                                  .up = {0, 1, 0}};
    assert_true(session_make_camera(&extent, &image, &camera));
    assert_true(fabs(camera.half_height - 1 / 0.95 / 2) < 1e-12);
    image.camera.height = 7;
    assert_true(session_make_camera(&extent, &image, &camera) && camera.half_height == 3.5);
    /* The picture of an explicit camera has the same size at the focal point with both projections. */
    image.camera = (scene_camera){
        .eye = {1, 1, 11}, .focal = {1, 1, 1}, .up = {0, 1, 0}, .angle = 90, .zoom = 1, .is_orthographic = true};
    assert_true(session_make_camera(&extent, &image, &camera));
    assert_true(camera.is_orthographic && fabs(camera.half_height - 10) < 1e-12);
}

/* Returns whether the camera is orthographic and looks along this axis, so that two axes of the data point exactly
 * right and up in the picture. */
static bool is_faced(const session_extent *extent, const scene_image *image, int axis)
{
    static const int right[3] = {1, 0, 0}, up[3] = {2, 2, 1};
    static const double towards[3] = {1, -1, 1};
    render_camera c;
    double low[2], high[2], most = 0;
    if (!session_make_camera(extent, image, &c) || !compute_projected_bounds(&c, extent, low, high)) return false;
    for (int a = 0; a < 2; a++) most = fmax(most, fmax(-low[a], high[a]));
    return c.is_orthographic && fabs(c.right[right[axis]] - 1) < 1e-12 && fabs(c.up[up[axis]] - 1) < 1e-12 &&
           fabs(c.forward[axis] + towards[axis]) < 1e-12 && fabs(most - 0.95) < 1e-9;
}

static void flat_data_is_seen_from_the_front(void **state)
{
    (void)state;
    for (int axis = 0; axis < 3; axis++) {
        session_extent extent = {.cell_count = 9};
        scene_image image = {.width = 300, .height = 100};
        render_camera camera;
        image.camera =
            (scene_camera){.is_automatic = true, .angle = 40, .zoom = 1, .direction = {1, 0.8, 1.2}, .up = {0, 1, 0}};
        for (int a = 0; a < 3; a++) extent.upper[a] = a == axis ? 0 : 2 + a;
        extent.half_diagonal = 4; /* the camera's direction does not depend on the size */
        assert_true(session_flat_axis(&extent) == axis && is_faced(&extent, &image, axis));
        extent.upper[axis] = 1.9e-6; /* less than a millionth of the size 2 */
        assert_true(is_faced(&extent, &image, axis));
        extent.upper[axis] = 5e-6;
        assert_true(session_flat_axis(&extent) == -1 && session_make_camera(&extent, &image, &camera));
        assert_true(!camera.is_orthographic && fabs(camera.forward[axis]) < 0.9);
        extent.upper[axis] = 0;
        extent.solid_count = 1;
        assert_true(session_flat_axis(&extent) == -1);
    }
}

/* Checks that each key given in the scene overrides what is derived from flat data, while all other settings of the
 * camera are still derived. */
static void scene_keys_override_the_view_of_flat_data(void **state)
{
    (void)state;
    const session_extent flat = {.upper = {2, 1, 0}, .half_diagonal = sqrt(1.25), .cell_count = 9};
    const scene_camera given = {
        .is_automatic = true, .angle = 40, .zoom = 1, .direction = {0, 0.6, 0.8}, .up = {0, 1, 0}};
    scene_image image = {.width = 200, .height = 100, .camera = given};
    render_camera camera;
    image.camera.has_direction = true;
    assert_true(session_make_camera(&flat, &image, &camera));
    assert_true(camera.is_orthographic && fabs(camera.forward[1] + 0.6) < 1e-12);
    image.camera = given;
    image.camera.has_projection = true;
    assert_true(session_make_camera(&flat, &image, &camera));
    assert_true(!camera.is_orthographic && camera.forward[2] == -1);
    image.camera = given;
    image.camera.has_fit = true; /* the sphere of radius 1.118 in a frame that is twice as wide as high */
    assert_true(session_make_camera(&flat, &image, &camera));
    assert_true(camera.is_orthographic && fabs(camera.half_height - sqrt(1.25)) < 1e-12);
    image.camera = given;
    image.camera.has_up = true;
    image.camera.up[0] = 1, image.camera.up[1] = 0;
    assert_true(session_make_camera(&flat, &image, &camera) && camera.up[0] == 1);
    image.camera = given;
    image.camera.has_bounds = true; /* bounds twice as large as the data */
    image.camera.upper[0] = 4, image.camera.upper[1] = 2;
    assert_true(session_make_camera(&flat, &image, &camera));
    assert_true(fabs(camera.half_height - 1 / 0.95) < 1e-12 && fabs(camera.eye[0] - 2) < 1e-12);
    image.camera = given;
    image.camera.orbit.view_count = 3;
    assert_true(session_make_camera(&flat, &image, &camera) && !camera.is_orthographic);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(a_box_fills_the_frame),
                                       cmocka_unit_test(a_box_fills_an_orthographic_frame),
                                       cmocka_unit_test(decorations_keep_their_space),
                                       cmocka_unit_test(sphere_does_not_overlap_decorations),
                                       cmocka_unit_test(zoom_and_height_scale_the_view),
                                       cmocka_unit_test(flat_data_is_seen_from_the_front),
                                       cmocka_unit_test(scene_keys_override_the_view_of_flat_data)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
