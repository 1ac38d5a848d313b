/* Checks the decorations that a session computes: ticks at round numbers, the edges of the domain's box as the camera
 * sees them, rulers and scale bars. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "session_decorations.h"

/* ---- ticks --------------------------------------------------------------------------------------------------- */

static void ticks_are_at_round_numbers(void **state)
{
    (void)state;
    static const struct {
        session_scale scale;
        int most;
        const char *words; /* texts of all ticks, lowest first */
    } cases[] = {
        {{RENDER_LINEAR, 0, 0, 1, {0}}, 6, "0 0.2 0.4 0.6 0.8 1.0"},
        {{RENDER_LINEAR, 0, -1, 1, {0}}, 6, "-1.0 -0.5 0 0.5 1.0"},
        {{RENDER_LINEAR, 0, 0, 6.3, {0}}, 6, "0 2 4 6"},
        {{RENDER_LINEAR, 0, 0.1, 0.3, {0}}, 3, "0.1 0.2 0.3"},
        {{RENDER_LINEAR, 0, 101300, 101340, {0}}, 6, "101300 101310 101320 101330 101340"},
        {{RENDER_LINEAR, 0, 0, 3.2e7, {0}}, 4, "0 1e7 2e7 3e7"},
        {{RENDER_LINEAR, 0, -2.5e-7, 2.5e-7, {0}}, 4, "-2e-7 0 2e-7"},
        {{RENDER_LINEAR, 0, 1e9, 1e9 + 30, {0}}, 4, "1.00000000e9 1.00000001e9 1.00000002e9 1.00000003e9"},
        {{RENDER_LOG, 0, 0.01, 100, {0}}, 6, "0.01 0.1 1 10 100"},
        {{RENDER_LOG, 0, 1e-8, 1e8, {0}}, 6, "1e-6 0.001 1 1000 1e6"},
        {{RENDER_LOG, 0, 1, 10, {0}}, 6, "1 2 5 10"},
        {{RENDER_LOG, 0, 3, 4, {0}}, 6, "3.0 3.2 3.4 3.6 3.8 4.0"},
        {{RENDER_SYMLOG, 1, -100, 100, {0}}, 8, "-1 -10 -100 0 1 10 100"},
        {{RENDER_LINEAR, 0, 0, 1, {SCENE_FIXED, true, 3}}, 4, "0 0.500 1.000"},
        {{RENDER_LINEAR, 0, 0, 1, {SCENE_SCIENTIFIC, false, 0}}, 6, "0 2.0e-1 4.0e-1 6.0e-1 8.0e-1 1.0e0"},
        {{RENDER_LINEAR, 0, 0, 3.2e7, {SCENE_FIXED, false, 0}}, 4, "0 10000000 20000000 30000000"},
        {{RENDER_LINEAR, 0, 0, 4e40, {SCENE_FIXED, true, 2}}, 4, "0 2.00e40 4.00e40"},
        {{RENDER_LOG, 0, 0.01, 100, {SCENE_SCIENTIFIC, true, 1}}, 6, "1.0e-2 1.0e-1 1.0e0 1.0e1 1.0e2"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        insitu_tick ticks[SESSION_MAX_TICKS];
        char words[400] = "";
        const int count = session_make_ticks(&cases[i].scale, cases[i].most, ticks);
        for (int n = 0; n < count; n++)
            snprintf(words + strlen(words), sizeof words - strlen(words), "%s%s", n ? " " : "", ticks[n].text);
        assert_string_equal(words, cases[i].words);
    }
}

/* Checks that a tick's text is its value to the last printed digit, and that its position on the bar is that of the
 * value. */
static void ticks_are_at_the_positions_of_their_values(void **state)
{
    (void)state;
    srand(7);
    for (int i = 0; i < 20000; i++) {
        const double size = pow(10, rand() % 40 - 20), middle = size * (2.0 * rand() / RAND_MAX - 1);
        const double half = size * pow(10, -(rand() % 6)) * (0.1 + (double)rand() / RAND_MAX);
        const session_scale scale = {.kind = RENDER_LINEAR, .low = middle - half, .high = middle + half};
        const int most = 2 + rand() % 11;
        insitu_tick ticks[SESSION_MAX_TICKS];
        const int count = session_make_ticks(&scale, most, ticks);
        assert_in_range(count, 1, most);
        for (int n = 0; n < count; n++) {
            const double value = scale.low + ticks[n].place * 2 * half;
            /* Round numbers are at least a fifth of the range / `most` apart, and texts are exact to a tenth of this
             * distance. */
            assert_true(fabs(strtod(ticks[n].text, NULL) - value) < 0.02 * half / most + 1e-12 * size);
            if (n) assert_true(strcmp(ticks[n].text, ticks[n - 1].text) != 0 && ticks[n].place > ticks[n - 1].place);
        }
    }
}

/* ---- the box ------------------------------------------------------------------------------------------------- */

/* Checks the ticks of ids in colour bands: of the values 0 to 3 in four bands, value i lies in band i, the part [i / 4,
 * (i + 1) / 4) of the bar, although its position in the range is i / 3. */
static void bands_of_ids_are_centred_on_the_ids(void **state)
{
    (void)state;
    static const struct {
        double low, high;
        int bands, count, first; /* count: number of ticks at ids, 0 if the bands are not ids */
    } cases[] = {{0, 3, 4, 4, 0}, {1, 5, 5, 5, 1},       {-0.5, 3.5, 4, 4, 0}, {7, 7 + 63, 64, 11, 7},
                 {0, 3, 5, 0, 0}, {0.25, 3.25, 4, 0, 0}, {0, 4, 4, 0, 0},      {0, 1e-3, 4, 0, 0}};
    for (size_t n = 0; n < sizeof cases / sizeof *cases; n++) {
        const session_scale scale = {.kind = RENDER_LINEAR, .low = cases[n].low, .high = cases[n].high};
        insitu_tick ticks[SESSION_MAX_TICKS], plain[SESSION_MAX_TICKS];
        const int count = session_make_ticks_for_colour_bands(&scale, cases[n].bands, 6, ticks);
        if (!cases[n].count) {
            assert_int_equal(count, session_make_ticks(&scale, 6, plain));
            for (int i = 0; i < count; i++) assert_true(ticks[i].place == plain[i].place);
            continue;
        }
        assert_int_equal(count, cases[n].count);
        for (int i = 0; i < count; i++) {
            const double band = atof(ticks[i].text) - cases[n].first;
            assert_true(fabs(ticks[i].place - (band + 0.5) / cases[n].bands) < 1e-15);
        }
    }
}

/* Returns the distance of a point from the renderer's ray through a position in the picture. The position is in
 * continuous pixel coordinates. */
static double compute_distance_from_ray(const render_camera *c, const double pixel[2], const double point[3])
{
    double base[3], direction[3], right[3], down[3], unused[3], along = 0, length = 0, square = 0;
    render_camera_ray(c, 0, 0, base, direction);
    render_camera_ray(c, 1, 0, c->is_orthographic ? right : unused, c->is_orthographic ? unused : right);
    render_camera_ray(c, 0, 1, c->is_orthographic ? down : unused, c->is_orthographic ? unused : down);
    double *moved = c->is_orthographic ? base : direction;
    const double start[3] = {moved[0], moved[1], moved[2]};
    for (int a = 0; a < 3; a++)
        moved[a] += (pixel[0] - 0.5) * (right[a] - start[a]) + (pixel[1] - 0.5) * (down[a] - start[a]);
    for (int a = 0; a < 3; a++) {
        along += (point[a] - base[a]) * direction[a];
        length += direction[a] * direction[a];
    }
    for (int a = 0; a < 3; a++) square += pow(point[a] - base[a] - along / length * direction[a], 2);
    return sqrt(square);
}

static void check_corners(const render_camera *c, const double lower[3], const double upper[3])
{
    insitu_stroke strokes[SESSION_BOX_EDGES];
    assert_int_equal(session_compute_box_strokes(lower, upper, c, strokes), SESSION_BOX_EDGES);
    for (int edge = 0; edge < SESSION_BOX_EDGES; edge++) {
        double best[2] = {INFINITY, INFINITY};
        for (int corner = 0; corner < 8; corner++) {
            const double p[3] = {corner & 1 ? upper[0] : lower[0], corner & 2 ? upper[1] : lower[1],
                                 corner & 4 ? upper[2] : lower[2]};
            best[0] = fmin(best[0], compute_distance_from_ray(c, strokes[edge].from, p));
            best[1] = fmin(best[1], compute_distance_from_ray(c, strokes[edge].to, p));
        }
        assert_true(best[0] < 1e-9 && best[1] < 1e-9);
    }
}

static int count_edges_behind_data(const render_camera *c, const double lower[3], const double upper[3])
{
    insitu_stroke strokes[SESSION_BOX_EDGES];
    int count = 0;
    const int all = session_compute_box_strokes(lower, upper, c, strokes);
    for (int i = 0; i < all; i++) count += strokes[i].is_behind;
    return count;
}

static void edges_are_drawn_where_rays_meet_them(void **state)
{
    (void)state;
    const double lower[3] = {-1, 2, 0}, upper[3] = {3, 3, 5}, focal[3] = {1, 2.5, 2.5}, up[3] = {0, 1, 0};
    const double eyes[][3] = {{9, 8, 12}, {-20, 2.5, 2.5}, {1.5, 30, 2}};
    for (int i = 0; i < 3; i++) {
        render_camera c;
        assert_true(render_camera_look_at(&c, eyes[i], focal, i == 2 ? (double[3]){1, 0, 0} : up, 40, 301, 200));
        check_corners(&c, lower, upper);
        c.is_orthographic = true;
        c.half_height = 4;
        check_corners(&c, lower, upper);
    }
}

/* Checks the number of edges behind the data. A box seen over a corner has three of them, a box seen over an edge five.
 * A box seen face on has eight: the four edges of the far face and the four that lead away from the eye. If the eye is
 * inside the box, all twelve are behind the data. */
static void edges_that_data_hides_are_reported(void **state)
{
    (void)state;
    const double lower[3] = {0, 0, 0}, upper[3] = {1, 1, 1}, focal[3] = {0.5, 0.5, 0.5}, up[3] = {0, 1, 0.01};
    const double eyes[][3] = {{4, 5, 6}, {4, 5, 0.5}, {0.5, 0.5, 7}};
    const int expected[] = {3, 5, 8};
    render_camera c;
    for (int i = 0; i < 3; i++) {
        assert_true(render_camera_look_at(&c, eyes[i], focal, up, 40, 64, 64));
        assert_int_equal(count_edges_behind_data(&c, lower, upper), expected[i]);
    }
    const double inside[3] = {0.4, 0.4, 0.4};
    insitu_stroke strokes[SESSION_BOX_EDGES];
    assert_true(render_camera_look_at(&c, inside, focal, up, 40, 64, 64));
    const int count = session_compute_box_strokes(lower, upper, &c, strokes);
    /* edges behind the eye are omitted, and edges that cross the eye's plane are clipped */
    assert_in_range(count, 3, 11);
    for (int i = 0; i < count; i++) {
        assert_true(strokes[i].is_behind);
        for (int a = 0; a < 2; a++) assert_true(isfinite(strokes[i].from[a]) && isfinite(strokes[i].to[a]));
    }
}

/* ---- rulers and scale bars ------------------------------------------------------------------------------------ */

/* Checks the position of an axis's name. It must be equally far from the two nearest ticks, because the numbers at the
 * ticks leave no space for it beside them. */
static void check_name(const insitu_label *name, const insitu_stroke *ticks, int count)
{
    double nearest = INFINITY, next = INFINITY;
    for (int i = 0; i < count; i++) {
        const double distance = hypot(ticks[i].from[0] - name->at[0], ticks[i].from[1] - name->at[1]);
        next = fmin(next, fmax(distance, nearest));
        nearest = fmin(nearest, distance);
    }
    if (fabs(name->away[0]) > fabs(name->away[1]) && count > 1) assert_true(nearest > 1 && next - nearest < 1e-9);
}

/* Checks that the ray through a tick meets the edge at the coordinate that the tick's text states, and that texts are
 * placed outwards. */
static void check_rulers(const render_camera *c, const double lower[3], const double upper[3])
{
    insitu_decorations all = {0};
    insitu_stroke strokes[SESSION_RULER_STROKES];
    insitu_label labels[SESSION_RULER_LABELS];
    session_add_box_rulers(lower, upper, c, 10, &all, strokes, labels);
    assert_in_range(all.stroke_count, 6, SESSION_RULER_STROKES);
    assert_int_equal(all.label_count, all.stroke_count + 3);
    for (int stroke = 0, first = 0, label = 0, axis = 0; label < all.label_count; label++) {
        const insitu_label *words = &labels[label];
        assert_true(fabs(hypot(words->away[0], words->away[1]) - 1) < 1e-12);
        if (strspn(words->text, "xyz") == 1) {
            assert_int_equal(words->text[0], 'x' + axis++);
            check_name(words, strokes + first, stroke - first);
            first = stroke;
            continue;
        }
        const insitu_stroke *tick = &strokes[stroke++];
        double best = INFINITY, outward = 0;
        for (int corner = 0; corner < 4; corner++) {
            double p[3];
            p[axis] = strtod(words->text, NULL);
            p[(axis + 1) % 3] = corner & 1 ? upper[(axis + 1) % 3] : lower[(axis + 1) % 3];
            p[(axis + 2) % 3] = corner & 2 ? upper[(axis + 2) % 3] : lower[(axis + 2) % 3];
            best = fmin(best, compute_distance_from_ray(c, tick->from, p));
        }
        assert_true(best < 1e-9);
        for (int a = 0; a < 2; a++) outward += (tick->to[a] - tick->from[a]) * words->away[a];
        assert_true(outward > 3 && words->at[0] == tick->from[0] && words->at[1] == tick->from[1]);
    }
}

static void rulers_are_aligned_with_their_numbers(void **state)
{
    (void)state;
    const double lower[3] = {-1, 2, 0}, upper[3] = {3, 3, 5}, focal[3] = {1, 2.5, 2.5}, up[3] = {0, 1, 0};
    const double eyes[][3] = {{9, 8, 12}, {-20, 7, -15}, {1.5, 30, 2}};
    for (int i = 0; i < 3; i++) {
        render_camera c;
        assert_true(render_camera_look_at(&c, eyes[i], focal, i == 2 ? (double[3]){1, 0, 0} : up, 40, 601, 400));
        check_rulers(&c, lower, upper);
        c.is_orthographic = true;
        c.half_height = 4;
        check_rulers(&c, lower, upper);
    }
}

/* Checks scale bars. If the bar is moved to the middle of the picture, the rays through its two ends must be as far
 * apart, at the depth of the focal point, as the bar's text states. The bar's length must be a tenth to a fifth of the
 * picture's width. */
static void scale_bars_have_the_stated_length(void **state)
{
    (void)state;
    const double up[3] = {0, 1, 0}, focal[3] = {0, 0, 0};
    for (int i = 0; i < 200; i++) {
        render_camera c;
        const double far = pow(10, i % 17 - 8) * (1 + 0.04 * i), eye[3] = {far, 0.3 * far, 0.7 * far};
        assert_true(render_camera_look_at(&c, eye, focal, up, 10 + i % 100, 640, 480));
        c.is_orthographic = i % 3 == 0;
        if (c.is_orthographic) c.half_height *= far;
        const insitu_scale_bar bar = session_make_scale_bar(&c, focal, i % 2 ? "mm" : NULL);
        char *end;
        const double length = strtod(bar.text, &end);
        const double depth = c.is_orthographic ? 1 : sqrt(1 + 0.09 + 0.49) * far;
        assert_string_equal(end, i % 2 ? " mm" : "");
        assert_true(fabs(bar.length / 480 * 2 * c.half_height * depth / length - 1) < 1e-12);
        assert_true(bar.length <= 128.001 && bar.length > 50);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(ticks_are_at_round_numbers),
                                       cmocka_unit_test(ticks_are_at_the_positions_of_their_values),
                                       cmocka_unit_test(bands_of_ids_are_centred_on_the_ids),
                                       cmocka_unit_test(edges_are_drawn_where_rays_meet_them),
                                       cmocka_unit_test(edges_that_data_hides_are_reported),
                                       cmocka_unit_test(rulers_are_aligned_with_their_numbers),
                                       cmocka_unit_test(scale_bars_have_the_stated_length)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
