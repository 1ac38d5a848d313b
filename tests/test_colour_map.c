/* Colour maps: the published ends and middles, lightness that rises where it must, and the sRGB curve. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>

#include "colour_map.h"

static double code_of(float linear)
{
    const double l = linear;
    return 255 * (l <= 0.0031308 ? 12.92 * l : 1.055 * pow(l, 1 / 2.4) - 0.055);
}

static void check_entry(const float *table, int entry, int r, int g, int b, double tolerance)
{
    const int expected[3] = {r, g, b};
    for (int c = 0; c < 3; c++) {
        const double code = code_of(table[3 * entry + c]);
        if (!(fabs(code - expected[c]) <= tolerance)) {
            fail_msg("entry %d channel %d is %g, expected %d", entry, c, code, expected[c]);
        }
    }
}

static const float *table_of(const char *name)
{
    int count = 0;
    const float *table = colour_map_table(name, &count);
    assert_non_null(table);
    assert_int_equal(count, 256);
    return table;
}

/* The ends are keys, exact but for the float32 of linear light: its step is below 1e-4 of a code. Between keys the
 * published tables are met to within what neighbouring entries of theirs differ by, 4 codes. */
static void colour_map_meets_published_colours(void **state)
{
    (void)state;
    const float *viridis = table_of("viridis"), *inferno = table_of("inferno"), *diverging = table_of("cool_to_warm");
    check_entry(viridis, 0, 68, 1, 84, 1e-3);
    check_entry(viridis, 64, 59, 82, 139, 4);
    check_entry(viridis, 128, 33, 145, 140, 4);
    check_entry(viridis, 191, 94, 201, 98, 4);
    check_entry(viridis, 255, 253, 231, 37, 1e-3);
    check_entry(inferno, 0, 0, 0, 4, 1e-3);
    check_entry(inferno, 64, 87, 16, 110, 4);
    check_entry(inferno, 128, 188, 55, 84, 4);
    check_entry(inferno, 191, 249, 142, 9, 4);
    check_entry(inferno, 255, 252, 255, 164, 1e-3);
    check_entry(diverging, 0, 59, 76, 192, 0.5);
    check_entry(diverging, 127, 221, 221, 221, 2);
    check_entry(diverging, 128, 221, 221, 221, 2);
    check_entry(diverging, 255, 180, 4, 38, 0.5);
    for (int i = 0; i < 256; i++) check_entry(table_of("grey"), i, i, i, i, 1e-3);
}

static void colour_map_lightness_rises(void **state)
{
    (void)state;
    static const char *const rising[] = {"viridis", "inferno", "grey"};
    for (int map = 0; map < 3; map++) {
        const float *table = table_of(rising[map]);
        double last = -1;
        for (int i = 0; i < 256; i++) {
            const float *c = table + 3 * (size_t)i;
            const double luminance = 0.2126 * (double)c[0] + 0.7152 * (double)c[1] + 0.0722 * (double)c[2];
            if (!(luminance > last)) fail_msg("%s falls at %d", rising[map], i);
            last = luminance;
        }
    }
}

static void colour_map_steps_are_small(void **state)
{
    (void)state;
    static const char *const names[] = {"viridis", "inferno", "cool_to_warm", "grey"};
    for (int map = 0; map < 4; map++) {
        const float *table = table_of(names[map]);
        for (int i = 0; i < 3 * 255; i++) {
            assert_true(table[i] >= 0 && table[i] <= 1);
            /* a mistyped key or a hue that turns the wrong way jumps by tens; sRGB is steepest in the dark, where
             * cool_to_warm's green ends */
            const double step = fabs(code_of(table[i + 3]) - code_of(table[i]));
            if (!(step < 12)) fail_msg("%s jumps by %g codes at %d", names[map], step, i / 3);
        }
    }
}

static void colour_map_of_unknown_name_is_null(void **state)
{
    (void)state;
    int count = 7;
    assert_null(colour_map_table("jet", &count));
    assert_int_equal(count, 7);
}

/* Float32 in and out: half a step of 2^-24 each way, through slopes of at most 12.92. */
static void colour_curve_is_srgb_and_back(void **state)
{
    (void)state;
    assert_true(colour_linear_from_srgb(0) == 0 && colour_srgb_from_linear(0) == 0);
    assert_true(colour_linear_from_srgb(1) == 1 && colour_srgb_from_linear(1) == 1);
    for (int i = 0; i <= 65535; i++) {
        const float srgb = (float)i / 65535;
        const double exact = srgb <= 0.04045F ? (double)srgb / 12.92 : pow(((double)srgb + 0.055) / 1.055, 2.4);
        const float linear = colour_linear_from_srgb(srgb);
        assert_true(fabs((double)linear - exact) <= exact * 6e-8);
        assert_true(fabs((double)colour_srgb_from_linear(linear) - (double)srgb) < 2e-7);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(colour_map_meets_published_colours), cmocka_unit_test(colour_map_lightness_rises),
        cmocka_unit_test(colour_map_steps_are_small),         cmocka_unit_test(colour_map_of_unknown_name_is_null),
        cmocka_unit_test(colour_curve_is_srgb_and_back),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
