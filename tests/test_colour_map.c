/* Checks colour maps: the published colours at the ends and in the middle, the monotonic lightness of the maps that are
 * documented as monotonic, and the sRGB curve. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>

#include "colour_map.h"

#define NAME(word, name) name,
static const char *const names[COLOUR_MAP_COUNT] = {COLOUR_MAPS(NAME)};

static double encode_srgb(float linear)
{
    const double l = linear;
    return 255 * (l <= 0.0031308 ? 12.92 * l : 1.055 * pow(l, 1 / 2.4) - 0.055);
}

static void check_entry(const float *table, int entry, int r, int g, int b, double tolerance)
{
    const int expected[3] = {r, g, b};
    for (int c = 0; c < 3; c++) {
        const double code = encode_srgb(table[3 * entry + c]);
        if (!(fabs(code - expected[c]) <= tolerance)) {
            fail_msg("entry %d channel %d is %g, expected %d", entry, c, code, expected[c]);
        }
    }
}

static const float *find_colour_table(const char *name)
{
    int count = 0;
    const float *table = colour_map_table(name, &count);
    assert_non_null(table);
    assert_int_equal(count, 256);
    return table;
}

/* The published tables as 8-bit codes: the FNV-1a hash of all 768 codes, and entry 128. They are taken from matplotlib
 * 3.6.3 (ColorBrewer maps are interpolated by matplotlib between keys); batlow is taken from Scientific Colour Maps
 * 7.0.1. */
static const struct published {
    const char *name;
    uint64_t hash;
    int middle;
} published[] = {
    {"viridis", 0x1b8e5490518c939b, 0x21918c},
    {"plasma", 0xb80f5cf20e4372dc, 0xcc4778},
    {"inferno", 0x0c171f8959472839, 0xbc3754},
    {"magma", 0x18a2c8df7018d2be, 0xb73779},
    {"cividis", 0x7a7f3ae563911aa6, 0x7d7c78},
    {"turbo", 0xcf9a52c7e29b2626, 0xa4fc3c},
    {"batlow", 0x18ad1e62ec607887, 0x828231},
    {"greys", 0xf33f582248e54d76, 0x959595},
    {"blues", 0x0dc5e5d460214bf4, 0x6aaed6},
    {"greens", 0xb5289f4daf97bace, 0x73c476},
    {"oranges", 0xce05e27f03ce3489, 0xfd8c3b},
    {"purples", 0x8b477f035131ed0f, 0x9e9ac8},
    {"reds", 0x4b51e5fdeb650535, 0xfb694a},
    {"yellow_green_blue", 0x658d52c452472cbf, 0x40b5c4},
    {"yellow_orange_red", 0xa5637577ad0c7540, 0xfd8c3c},
    {"red_blue", 0x74d1d10c5c6a4bcb, 0xf6f7f7},
    {"red_yellow_blue", 0x206e59501ec27df8, 0xfeffc0},
    {"red_yellow_green", 0xeb57446331c7b02a, 0xfeffbe},
    {"spectral", 0x0768154cf418ccda, 0xffffbe},
    {"brown_teal", 0xcaebb1e4aa95445f, 0xf4f5f5},
    {"orange_purple", 0x629e139d160e34ac, 0xf6f6f7},
    {"purple_green", 0x827cabbf52617ea0, 0xf6f7f6},
};
enum { published_count = sizeof published / sizeof *published };

static void colour_map_codes_match_published_codes(void **state)
{
    (void)state;
    for (int map = 0; map < published_count; map++) {
        const float *table = find_colour_table(published[map].name);
        const int m = published[map].middle;
        uint64_t hash = 0xcbf29ce484222325;
        check_entry(table, 128, m >> 16, m >> 8 & 255, m & 255, 0.5);
        for (int i = 0; i < 768; i++) hash = (hash ^ (uint64_t)lround(encode_srgb(table[i]))) * 0x100000001b3;
        if (hash != published[map].hash) fail_msg("%s is not the published table", published[map].name);
    }
}

/* Checks Moreland's map. The library computes it by a formula. The published colours at its ends must match to half a
 * code. The published middle is the middle of a table of 257 entries; it lies between two entries of the library's
 * table of 256 and must match to one code more. */
static void colour_map_matches_published_colours(void **state)
{
    (void)state;
    const float *diverging = find_colour_table("cool_to_warm");
    check_entry(diverging, 0, 59, 76, 192, 0.5);
    check_entry(diverging, 127, 221, 221, 221, 1.5);
    check_entry(diverging, 128, 221, 221, 221, 1.5);
    check_entry(diverging, 255, 180, 4, 38, 0.5);
    for (int i = 0; i < 256; i++) check_entry(find_colour_table("grey"), i, i, i, i, 1e-3);
}

static void colour_map_names_are_found(void **state)
{
    (void)state;
    for (int i = 0; i < COLOUR_MAP_COUNT; i++) {
        assert_non_null(find_colour_table(names[i]));
        for (int j = 0; j < i; j++)
            assert_memory_not_equal(find_colour_table(names[i]), find_colour_table(names[j]), 768 * sizeof(float));
    }
}

static void colour_map_lightness_rises(void **state)
{
    (void)state;
    static const char *const rising[] = {"viridis", "plasma", "inferno", "magma", "cividis", "batlow", "grey"};
    for (int map = 0; map < (int)(sizeof rising / sizeof *rising); map++) {
        const float *table = find_colour_table(rising[map]);
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
    for (int map = 0; map < COLOUR_MAP_COUNT; map++) {
        const char *name = names[map];
        const float *table = find_colour_table(name);
        for (int i = 0; i < 3 * 255; i++) {
            assert_true(table[i] >= 0 && table[i] <= 1);
            /* A mistyped key or a hue that runs in the wrong direction makes a jump of tens of codes. The limit of 12
             * codes follows from the steepest part of sRGB, in the dark, where the green of cool_to_warm ends. */
            const double step = fabs(encode_srgb(table[i + 3]) - encode_srgb(table[i]));
            if (!(step < 12)) fail_msg("%s jumps by %g codes at %d", name, step, i / 3);
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

static void colour_curve_is_srgb(void **state)
{
    (void)state;
    assert_true(colour_linear_from_srgb(0) == 0 && colour_linear_from_srgb(1) == 1);
    for (int i = 0; i <= 65535; i++) {
        const float srgb = (float)i / 65535;
        const double exact = srgb <= 0.04045F ? (double)srgb / 12.92 : pow(((double)srgb + 0.055) / 1.055, 2.4);
        const float linear = colour_linear_from_srgb(srgb);
        assert_true(fabs((double)linear - exact) <= exact * 6e-8);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(colour_map_codes_match_published_codes),
        cmocka_unit_test(colour_map_names_are_found),
        cmocka_unit_test(colour_map_matches_published_colours),
        cmocka_unit_test(colour_map_lightness_rises),
        cmocka_unit_test(colour_map_steps_are_small),
        cmocka_unit_test(colour_map_of_unknown_name_is_null),
        cmocka_unit_test(colour_curve_is_srgb),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
