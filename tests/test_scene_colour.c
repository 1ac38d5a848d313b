/* Checks the colours of values in a scene: colour tables from lists and from files, modifications of tables, and error
 * messages. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "colour_map.h"
#include "memory.h"
#include "scene.h"

#define NAME(word, name) name,
static const char *const names[COLOUR_MAP_COUNT] = {COLOUR_MAPS(NAME)};

static double convert_srgb_to_linear(double s)
{
    return s <= 0.04045 ? s / 12.92 : pow((s + 0.055) / 1.055, 2.4);
}

static double convert_linear_to_srgb(float linear)
{
    const double l = linear;
    return l <= 0.0031308 ? 12.92 * l : 1.055 * pow(l, 1 / 2.4) - 0.055;
}

/* Tolerance of a colour for its roundings to float32: sRGB to float, pow, and the mean of two colours, each within
 * 2^-24 relative; the slope of the curve is below 2.5. */
#define COLOUR_TOLERANCE 1e-6

static void check_colour(const float c[3], double r, double g, double b)
{
    const double expected[3] = {convert_srgb_to_linear(r), convert_srgb_to_linear(g), convert_srgb_to_linear(b)};
    for (int i = 0; i < 3; i++)
        if (!(fabs((double)c[i] - expected[i]) <= COLOUR_TOLERANCE))
            fail_msg("channel %d is %.9g, expected %.9g", i, (double)c[i], expected[i]);
}

/* ---- files that the parser may read ------------------------------------------------------------------------------ */

#define POINTS "\"RGBPoints\": [10, 0, 0, 0, 20, 1, 0, 0, 30, 1, 1, 1]"

static const struct stored_file {
    const char *path, *text;
} stored_files[] = {
    {"maps/one.json", "{\"Name\": \"red\", " POINTS "}"},
    {"maps/several.json", "[\n\t{\"Name\": \"red\", \"ColorSpace\": \"RGB\", " POINTS "},\n"
                          "\t{\"Name\": \"grey \\/ Lab\", \"ColorSpace\": \"Lab\",\n"
                          "\t \"RGBPoints\": [0, 0, 0, 0, 1, 1, 1, 1], \"NanColor\": [0.25, 0, 0]},\n"
                          "\t{\"Name\": \"moreland\", \"ColorSpace\": \"Diverging\", \"RGBPoints\": [0, 0.23137254902, "
                          "0.298039215686, 0.752941176471, 0.5, 0.865, 0.865, 0.865, 1, 0.705882352941, "
                          "0.0156862745098, 0.149019607843]},\n"
                          "\t{\"Name\": \"hues\", \"ColorSpace\": \"HSV\", \"RGBPoints\": [0, 1, 0, 0, 1, 0, 0, 1]},\n"
                          "\t{\"Name\": \"steps\", \"ColorSpace\": \"Step\", " POINTS "},\n"
                          "\t{\"Name\": \"uneven\", \"RGBPoints\": [0, 0, 0, 0, 1, 1, 0, 0, 4, 1, 1, 1]}\n]\n"},
    {"maps/broken.json", "[{\"Name\": \"a\",\n \"RGBPoints\": [0, 0, 0,\n"},
    {"maps/short.json", "[{\"Name\": \"a\",\n \"RGBPoints\": [0, 0, 0]}]"},
    {"maps/word.json", "[{\"Name\": \"a\", \"RGBPoints\": [0, 0, 0, 0,\n 1, 1, one, 1]}]"},
    {"maps/dark.json", "[{\"Name\": \"a\", \"RGBPoints\": [0, 0, 0, 0,\n\n 1, 1, 1, 255]}]"},
    {"maps/falling.json", "[{\"Name\": \"a\", \"RGBPoints\": [1, 0, 0, 0,\n 0, 1, 1, 1]}]"},
    {"maps/flat.json", "[{\"Name\": \"a\", \"RGBPoints\": [1, 0, 0, 0, 1, 1, 1, 1]}]"},
    {"maps/step.json", "[{\"ColorSpace\":\n \"XYZ\", \"RGBPoints\": [0, 0, 0, 0, 1, 1, 1, 1]}]"},
    {"maps/indexed.json", "[\n{\"Name\": \"a\", \"IndexedColors\": [0, 0, 0, 1, 0.5, 1, 0, 1, 0]}]"},
    {"maps/pale.json", "{\"IndexedColors\": [0, 0, 0, 1,\n 1, 2]}"},
    {"maps/two.json", "{\"IndexedColors\": [0, 0]}"},
    {"maps/bare.json", "[\n{\"Name\": \"a\"}]"},
    {"maps/list.json", "[[1, 2]]"},
    {"maps/empty.json", ""},
    {"maps/none.json", "[]"},
};

static int reads;

static insitu_status read_stored(const char *path, char **text, int64_t *size, base_error *error)
{
    for (size_t i = 0; i < sizeof stored_files / sizeof *stored_files; i++) {
        if (strcmp(stored_files[i].path, path) != 0) continue;
        reads++;
        *size = (int64_t)strlen(stored_files[i].text);
        *text = base_strdup(stored_files[i].text);
        return *text ? INSITU_OK : base_fail(error, INSITU_ERROR_MEMORY, "no memory");
    }
    return base_fail(error, INSITU_ERROR_SCENE, "%s: cannot be read: no such file", path);
}

/* Parses a scene in which the given keys follow "field: f" in the colour_by of an isosurface. */
static insitu_status parse_colour_keys(const char *keys, scene_attachments *files, scene *s, base_error *error)
{
    char text[2048];
    snprintf(text, sizeof text,
             "images:\n- name: a\n  layers:\n  - isosurface:\n      field: f\n      values: [1]\n      colour_by: "
             "{field: f%s}\n"
             "  outputs: [{path: a.png}]\n",
             keys);
    *error = (base_error){.status = INSITU_OK};
    return scene_parse(text, strlen(text), "maps/scene.yaml", files, s, error);
}

static scene parsed;

static const scene_colour_map *parse_colour_map(const char *keys)
{
    base_error error;
    scene_attachments files = {.read = read_stored};
    scene_free(&parsed);
    if (parse_colour_keys(keys, &files, &parsed, &error) != INSITU_OK) fail_msg("%s: %s", keys, error.message);
    scene_attachments_free(&files);
    return &parsed.images[0].isosurfaces[0].colour_map;
}

static const float *get_table_entry(const scene_colour_map *map, int i)
{
    return map->colours + 3 * (size_t)i;
}

static void every_map_is_found_by_its_name(void **state)
{
    (void)state;
    for (int i = 0; i < COLOUR_MAP_COUNT; i++) {
        char keys[64];
        int count;
        const char *name = names[i];
        snprintf(keys, sizeof keys, ", map: %s", name);
        const scene_colour_map *map = parse_colour_map(keys);
        assert_string_equal(map->name, name);
        assert_memory_equal(map->colours, colour_map_table(name, &count), 768 * sizeof(float));
        assert_true(map->count == 256 && !map->is_banded && map->scale == SCENE_LINEAR && !map->range.is_fixed);
        assert_true(!map->has_below && !map->has_above && !map->has_nan);
        check_colour(map->outside_colours[2], 0.6, 0.6, 0.6);
    }
}

/* Checks a colour table made from a list: every second entry is a colour of the list, and the entries between are
 * interpolated linearly in sRGB. */
static void colour_lists_are_interpolated_to_tables(void **state)
{
    (void)state;
    const scene_colour_map *map = parse_colour_map(", map: {colours: [[0, 0, 0], [1, 0, 0], [1, 0.5, 1]]}");
    assert_int_equal(map->count, 257);
    assert_string_equal(map->name, "");
    check_colour(get_table_entry(map, 0), 0, 0, 0);
    check_colour(get_table_entry(map, 64), 0.5, 0, 0);
    check_colour(get_table_entry(map, 128), 1, 0, 0);
    check_colour(get_table_entry(map, 192), 1, 0.25, 0.5);
    check_colour(get_table_entry(map, 256), 1, 0.5, 1);
    map = parse_colour_map(", map: {colours: [[0, 0, 0], [1, 0, 0], [1, 0.5, 1]], at: [0, 0.25, 1]}");
    assert_int_equal(map->count, 1025);
    check_colour(get_table_entry(map, 128), 0.5, 0, 0);
    check_colour(get_table_entry(map, 256), 1, 0, 0);
    check_colour(get_table_entry(map, 640), 1, 0.25, 0.5);
    map = parse_colour_map(", map: {colours: [[0, 0, 0], [1, 1, 1], [0, 0, 1], [0, 0, 0]], at: [0, 0.5, 0.5, 1]}");
    check_colour(get_table_entry(map, 511), 511.0 / 512, 511.0 / 512, 511.0 / 512);
    check_colour(get_table_entry(map, 512), 0, 0, 1);
    map = parse_colour_map(", map: {colours: [[0, 0, 0], [1, 1, 1]], at: [0, 1]}");
    assert_int_equal(map->count, 256);
    for (int i = 0; i < 256; i++) check_colour(get_table_entry(map, i), i / 255.0, i / 255.0, i / 255.0);
}

static void maps_are_reversed_and_cut_into_bands(void **state)
{
    (void)state;
    int count;
    const float *viridis = colour_map_table("viridis", &count);
    const scene_colour_map *map = parse_colour_map(", reversed: true");
    for (int i = 0; i < 256; i++)
        assert_memory_equal(get_table_entry(map, i), viridis + 3 * (255 - i), 3 * sizeof(float));
    map = parse_colour_map(", discrete: 6, map: grey");
    assert_true(map->is_banded && map->count == 6);
    for (int i = 0; i < 6; i++) /* the six colours are entries 0, 51, 102, ... of the table */
        check_colour(get_table_entry(map, i), i / 5.0, i / 5.0, i / 5.0);
    map = parse_colour_map(", discrete: 6, map: grey, reversed: true");
    for (int i = 0; i < 6; i++) check_colour(get_table_entry(map, i), 1 - i / 5.0, 1 - i / 5.0, 1 - i / 5.0);
    map = parse_colour_map(", discrete: 1, map: {colours: [[0, 0, 0], [0, 1, 0], [0, 0, 1]]}");
    assert_int_equal(map->count, 1);
    check_colour(get_table_entry(map, 0), 0, 1, 0);
}

static void scales_and_out_of_range_colours_are_read(void **state)
{
    (void)state;
    const scene_colour_map *map =
        parse_colour_map(", scale: log, range: [1e-3, 1e3], below: [1, 0, 0], nan: [0, 1, 0]");
    assert_true(map->scale == SCENE_LOG && map->has_below && !map->has_above && map->has_nan);
    check_colour(map->outside_colours[0], 1, 0, 0);
    assert_memory_equal(map->outside_colours[1], get_table_entry(map, 255), 3 * sizeof(float));
    check_colour(map->outside_colours[2], 0, 1, 0);
    map = parse_colour_map(", scale: symlog, threshold: 1e-2, above: [0, 0, 1], reversed: true");
    assert_true(map->scale == SCENE_SYMLOG && map->threshold == 1e-2 && !map->has_below && map->has_above);
    assert_memory_equal(map->outside_colours[0], get_table_entry(map, 0), 3 * sizeof(float));
    check_colour(map->outside_colours[1], 0, 0, 1);
}

static void sources_of_ranges_are_read(void **state)
{
    (void)state;
    const scene_range *r = &parse_colour_map("")->range;
    assert_true(!r->is_fixed && r->source == SCENE_RANGE_DATA);
    assert_true(parse_colour_map(", range: data")->range.source == SCENE_RANGE_DATA);
    assert_true(parse_colour_map(", range: run, scale: log")->range.source == SCENE_RANGE_RUN);
    assert_true(parse_colour_map(", range: symmetric")->range.source == SCENE_RANGE_SYMMETRIC);
    r = &parse_colour_map(", range: {percentile: [2, 98.5]}")->range;
    assert_true(!r->is_fixed && r->source == SCENE_RANGE_PERCENTILES && r->low == 2 && r->high == 98.5);
    r = &parse_colour_map(", range: [-1, 1e9]")->range;
    assert_true(r->is_fixed && r->low == -1 && r->high == 1e9);
}

/* Checks colour tables made from ParaView's files. The greys of CIELAB are those of sRGB; the lightness is 116 cbrt(Y)
 * - 16 for a luminance Y. */
static void paraview_colour_maps_become_tables(void **state)
{
    (void)state;
    int count;
    const scene_colour_map *map = parse_colour_map(", map: {file: one.json}");
    check_colour(get_table_entry(map, 0), 0, 0, 0);
    check_colour(get_table_entry(map, 128), 1, 0, 0);
    check_colour(get_table_entry(map, 192), 1, 0.5, 0.5);
    map = parse_colour_map(", map: {file: several.json, name: red}");
    assert_string_equal(map->name, "red");
    check_colour(get_table_entry(map, 64), 0.5, 0, 0);
    map = parse_colour_map(", map: {file: several.json, name: grey / Lab}");
    for (int i = 0; i < 256; i += 15) {
        const double f = (100.0 * i / 255 + 16) / 116, y = f > 6.0 / 29 ? f * f * f : (f - 4.0 / 29) * 108 / 841;
        for (int c = 0; c < 3; c++) assert_true(fabs((double)get_table_entry(map, i)[c] - y) < 1e-5);
    }
    map = parse_colour_map(", map: {file: several.json, name: hues}");
    check_colour(get_table_entry(map, 0), 1, 0, 0);
    check_colour(get_table_entry(map, 51), 1, 204 * 0.2 / 51, 0);
    check_colour(get_table_entry(map, 255), 0, 0, 1);
    map = parse_colour_map(", map: {file: several.json, name: steps}");
    check_colour(get_table_entry(map, 0), 0, 0, 0);
    check_colour(get_table_entry(map, 1), 1, 0, 0);
    check_colour(get_table_entry(map, 128), 1, 0, 0);
    check_colour(get_table_entry(map, 129), 1, 1, 1);
    map = parse_colour_map(", map: {file: indexed.json}, reversed: true");
    assert_true(map->is_banded && map->count == 3);
    check_colour(get_table_entry(map, 0), 0, 1, 0);
    check_colour(get_table_entry(map, 1), 1, 0.5, 1);
    map = parse_colour_map(", map: {file: several.json, name: uneven}");
    check_colour(get_table_entry(map, 256), 1, 0, 0);
    /* The lightness in the middle of the library's Moreland map is 88, that of the file 88.1. This difference is less
     * than one code. */
    const float *moreland = colour_map_table("cool_to_warm", &count);
    map = parse_colour_map(", map: {file: several.json, name: moreland}");
    for (int i = 0; i < 3; i++) {
        const int of_file[3] = {0, 128, 256}, of_ours[3] = {0, 127, 255};
        for (int c = 0; c < 3; c++)
            assert_true(fabs(convert_linear_to_srgb(get_table_entry(map, of_file[i])[c]) -
                             convert_linear_to_srgb(moreland[3 * of_ours[i] + c])) < 1.5 / 255);
    }
}

/* Checks that each file is read one time and kept, and that a second parse, as on the other ranks, uses the kept text
 * and reads no file. */
static void colour_files_are_read_once_and_reused(void **state)
{
    (void)state;
    base_error error;
    scene s, again;
    scene_attachments files = {.read = read_stored};
    reads = 0;
    const char *keys = ", map: {file: one.json}}\n  - volume:\n      {field: f, map: {file: ../maps/one.json}";
    assert_int_equal(parse_colour_keys(keys, &files, &s, &error),
                     INSITU_ERROR_SCENE); /* a path at which there is no file */
    assert_non_null(strstr(error.message, "maps/scene.yaml:9: images[0].layers[1].volume.map.file: "
                                          "maps/../maps/one.json: cannot be read: no such file"));
    keys = ", map: {file: one.json}}\n  - volume:\n      {field: f, map: {file: one.json, name: red}";
    scene_attachments_free(&files);
    reads = 0;
    assert_int_equal(parse_colour_keys(keys, &files, &s, &error), INSITU_OK);
    assert_true(reads == 1 && files.count == 1);
    files.read = NULL;
    assert_int_equal(parse_colour_keys(keys, &files, &again, &error), INSITU_OK);
    const scene_colour_map *a = &s.images[0].volumes[0].colour_map, *b = &again.images[0].volumes[0].colour_map;
    assert_memory_equal(a->colours, b->colours, 3 * (size_t)a->count * sizeof *a->colours);
    scene_free(&s);
    scene_free(&again);
    scene_attachments_free(&files);
    assert_int_equal(parse_colour_keys(keys, &files, &s, &error), INSITU_ERROR_SCENE);
    assert_int_equal(parse_colour_keys(keys, NULL, &s, &error), INSITU_ERROR_SCENE);
    assert_non_null(strstr(error.message, "no file can be read here"));
}

/* Keys of line 7, and two texts that the message must contain after "maps/scene.yaml:7:
 * images[0].layers[0].isosurface.colour_by." */
static const char *const bad_keys[][3] = {
    {", map: jet", "map: \"jet\" is not allowed (did you mean turbo?), expected one of viridis, plasma",
     "; or a mapping with the keys colours, at"},
    {", map: [1, 2]", "map: a list is not allowed, expected one of viridis", "or a mapping"},
    {", map: {}", "map: holds neither, expected one of colours and file", ""},
    {", map: {colour: 1}", "map: the key \"colour\" is unknown",
     "expected a mapping with the keys colours, at, file, name"},
    {", map: {colours: [[0, 0, 0], [1, 1, 1]], file: one.json}", "map: holds both, expected one of", ""},
    {", map: {colours: [[0, 0, 0], [1, 1, 1]], name: a}", "map.name: given beside colours", ""},
    {", map: {file: one.json, at: [0, 1]}", "map.at: given beside file", ""},
    {", map: {colours: [[0, 0, 0]]}",
     "map.colours: a list of 1 is not allowed, expected a list of 2 to 1024 lists of 3", ""},
    {", map: {colours: [[0, 0, 0], [1, 1]]}", "map.colours[1]: a list of 2 is not allowed", "from 0 to 1"},
    {", map: {colours: [[0, 0, 0], [1, 1, 255]]}", "map.colours[1][2]: \"255\" is not allowed", "from 0 to 1"},
    {", map: {colours: [[0, 0, 0], rouge]}", "map.colours[1]: \"rouge\" is not allowed", "3 numbers"},
    {", map: {colours: rouge}", "map.colours: \"rouge\" is not allowed", "a list of 2 to 1024"},
    {", map: {colours: [[0, 0, 0], [1, 1, 1]], at: [0]}", "map.at: a list of 1 is not allowed", "2 to 1024 numbers"},
    {", map: {colours: [[0, 0, 0], [1, 1, 1]], at: [0, 0.5, 1]}", "map.at: 3 places for 2 colours", "one each"},
    {", map: {colours: [[0, 0, 0], [1, 1, 1]], at: [0, 0.5]}", "map.at[1]: 0.5 is the last place, expected 1", ""},
    {", map: {colours: [[0, 0, 0], [1, 1, 1]], at: [0.5, 1]}", "map.at[0]: 0.5 is the first place, expected 0", ""},
    {", map: {colours: [[0, 0, 0], [1, 1, 1], [0, 1, 1]], at: [0, 0.5, 0.4]}", "map.at[2]: 0.4 comes after 0.5",
     "do not fall"},
    {", map: {file: absent.json}", "map.file: maps/absent.json: cannot be read: no such file", ""},
    {", map: {file: [a]}", "map.file: a list is not allowed, expected a text of 1 to 1024 bytes", ""},
    {", map: {file: several.json}", "map.file: several.json: holds 6 colour maps, expected the name of one", "\"red\""},
    {", map: {file: several.json, name: blue}", "several.json: none of its 6 colour maps is called \"blue\"",
     "\"red\""},
    {", map: {file: one.json, name: blue}", "one.json: its colour map is not called \"blue\", expected \"red\"", ""},
    {", map: {file: broken.json}", "map.file: broken.json:3: not valid JSON", ""},
    {", map: {file: short.json}", "map.file: short.json:2: RGBPoints: expected 2 to 4096 times four numbers", ""},
    {", map: {file: word.json}", "map.file: word.json:2: RGBPoints: not a number", ""},
    {", map: {file: dark.json}", "map.file: dark.json:3: RGBPoints: a colour is outside of 0 to 1", ""},
    {", map: {file: falling.json}", "map.file: falling.json:2: RGBPoints: values fall", ""},
    {", map: {file: flat.json}", "map.file: flat.json:1: RGBPoints: all values are the same", ""},
    {", map: {file: step.json}",
     "map.file: step.json:2: ColorSpace: expected one of RGB, HSV, Lab, CIELAB, Diverging and Step", ""},
    {", map: {file: bare.json}", "map.file: bare.json:2: the map has no RGBPoints", ""},
    {", map: {file: pale.json}", "map.file: pale.json:2: IndexedColors: a colour is outside of 0 to 1", ""},
    {", map: {file: two.json}", "map.file: two.json:1: IndexedColors: expected 1 to 4096 times three", ""},
    {", discrete: 3, map: {file: indexed.json}", "discrete: given beside a map of 3 bands", ""},
    {", map: {file: list.json}", "map.file: list.json:1: expected a colour map", ""},
    {", map: {file: empty.json}", "map.file: empty.json:1: is empty", ""},
    {", map: {file: none.json}", "map.file: none.json:1: holds no colour map", ""},
    {", reversed: 1", "reversed: \"1\" is not allowed (did you mean true?), expected true or false", ""},
    {", discrete: 0", "discrete: \"0\" is not allowed, expected a whole number from 1 to 64", ""},
    {", scale: ln", "scale: \"ln\" is not allowed, expected one of linear, log, symlog", ""},
    {", scale: symlog", "threshold: missing, expected a number above 0 for scale: symlog", ""},
    {", scale: log, threshold: 1", "threshold: given without scale: symlog", ""},
    {", threshold: 1", "threshold: given without scale: symlog", ""},
    {", scale: symlog, threshold: 0", "threshold: \"0\" is not allowed, expected a number above 0", ""},
    {", scale: log, range: [0, 1]", "range: begins with 0, expected above 0 for scale: log", ""},
    {", scale: log, range: [1e-20, 1e20]", "range: [1e-20, 1e+20] is too wide for scale: log", ""},
    {", below: bleu", "below: \"bleu\" is not allowed, expected a list of 3 numbers from 0 to 1", ""},
    {", above: [1, 1, 2]", "above[2]: \"2\" is not allowed", "from 0 to 1"},
    {", nan: [1, 1]", "nan: a list of 2 is not allowed", "a list of 3 numbers"},
    {", range: [1, 1]", "range: [1, 1] does not rise", ""},
    {", range: [1]", "range: a list of 1 is not allowed, expected a list of 2 numbers", ""},
    {", range: wide", "range: \"wide\" is not allowed, expected a list of 2 numbers; or one of data, run, symmetric",
     "; or a mapping with the keys percentile"},
    {", range: {}", "range.percentile: missing, expected a list of 2 numbers from 0 to 100", ""},
    {", range: {percentile: 5}", "range.percentile: \"5\" is not allowed, expected a list of 2", ""},
    {", range: {percentile: [5, 101]}", "range.percentile[1]: \"101\" is not allowed", "from 0 to 100"},
    {", range: {percentile: [5, 5]}", "range.percentile: [5, 5] does not rise", ""},
    {", range: {percent: [5, 95]}", "range: the key \"percent\" is unknown", "percentile"},
    {", range: symmetric, scale: log", "range: symmetric is not allowed beside scale: log", "symlog"},
};

static void wrong_keys_are_reported_with_position_and_expectation(void **state)
{
    (void)state;
    const int64_t held = base_memory_held();
    static const char place[] = "maps/scene.yaml:7: images[0].layers[0].isosurface.colour_by.";
    for (size_t i = 0; i < sizeof bad_keys / sizeof *bad_keys; i++) {
        scene s;
        base_error error;
        scene_attachments files = {.read = read_stored};
        const insitu_status status = parse_colour_keys(bad_keys[i][0], &files, &s, &error);
        const bool is_reported = strncmp(error.message, place, strlen(place)) == 0 &&
                                 strstr(error.message, bad_keys[i][1]) && strstr(error.message, bad_keys[i][2]);
        scene_attachments_free(&files);
        if (status != INSITU_ERROR_SCENE || !is_reported) fail_msg("%s: %s", bad_keys[i][0], error.message);
        assert_int_equal(base_memory_held(), held);
    }
}

static void volumes_reject_surface_keys(void **state)
{
    (void)state;
    static const char *const keys[][2] = {
        {"nan: [1, 0, 0]", "the key \"nan\" is unknown"},
    };
    for (int i = 0; i < 1; i++) {
        char text[512];
        scene s;
        base_error error = {.status = INSITU_OK};
        snprintf(text, sizeof text, "images: [{name: a, layers: [{volume: {field: f, %s}}], outputs: [{path: a.png}]}]",
                 keys[i][0]);
        assert_int_equal(scene_parse(text, strlen(text), "a.yaml", NULL, &s, &error), INSITU_ERROR_SCENE);
        if (!strstr(error.message, keys[i][1])) fail_msg("%s", error.message);
    }
}

/* Checks that each failed allocation is reported as an error and leaks no memory. */
static void failed_allocations_are_errors_without_a_leak(void **state)
{
    (void)state;
    scene_free(&parsed);
    const int64_t held = base_memory_held();
    insitu_status status = INSITU_ERROR_MEMORY;
    for (int n = 1; status != INSITU_OK && n < 1000; n++) {
        scene s;
        base_error error;
        scene_attachments files = {.read = read_stored};
        base_memory_fail_nth(n);
        status = parse_colour_keys(", discrete: 5, map: {file: several.json, name: uneven}", &files, &s, &error);
        base_memory_fail_nth(0);
        assert_true(status == INSITU_OK || status == INSITU_ERROR_MEMORY);
        scene_free(&s);
        scene_attachments_free(&files);
        assert_int_equal(base_memory_held(), held);
    }
    assert_int_equal(status, INSITU_OK);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_map_is_found_by_its_name),
        cmocka_unit_test(colour_lists_are_interpolated_to_tables),
        cmocka_unit_test(maps_are_reversed_and_cut_into_bands),
        cmocka_unit_test(scales_and_out_of_range_colours_are_read),
        cmocka_unit_test(sources_of_ranges_are_read),
        cmocka_unit_test(paraview_colour_maps_become_tables),
        cmocka_unit_test(colour_files_are_read_once_and_reused),
        cmocka_unit_test(wrong_keys_are_reported_with_position_and_expectation),
        cmocka_unit_test(volumes_reject_surface_keys),
        cmocka_unit_test(failed_allocations_are_errors_without_a_leak),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
