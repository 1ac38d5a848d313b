/* Checks colours over narrow ranges of values far from 0. The field rises linearly from left to right, so that the
 * colour of each pixel has a closed form in its position, computed in double. Every kind of layer is drawn with every
 * scale, for float32 and float64 values. Also checks colour bars of constant fields, warnings about values that cannot
 * be distinguished, and statistics. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "session_ticks.h"
#include "session_transfer.h"
#include "test_session_fixture.h"

enum { SIDE = 4, SIZE = 16, MOST = 1 << 12 };

/* ---- inputs ---------------------------------------------------------------------------------------------------- */

/* An input with two fields: "f" rises from low at x = -1 to high at x = 1; "z" is the third coordinate, of which
 * isosurfaces are drawn. */
typedef struct ramp {
    session_input in;
    double *values, *heights;
    float *singles;
    bool is_single;
} ramp;

static void ramp_create(ramp *r, int side, double low, double high, bool is_single)
{
    input_create(&r->in, TEST_TETS, side, TEST_RANDOM, own_rank, rank_count);
    const size_t count = (size_t)r->in.part.vertex_count;
    r->is_single = is_single;
    r->values = test_calloc(count + 1, sizeof *r->values);
    r->heights = test_calloc(count + 1, sizeof *r->heights);
    r->singles = test_calloc(count + 1, sizeof *r->singles);
    for (size_t v = 0; v < count; v++) {
        const double *x = r->in.part.coordinates + 3 * v, place = 0.5 + 0.5 * x[0];
        r->values[v] = low + place * (high - low);
        r->singles[v] = (float)r->values[v];
        r->heights[v] = x[2];
    }
}

static void ramp_free(ramp *r)
{
    input_free(&r->in);
    test_free(r->values);
    test_free(r->heights);
    test_free(r->singles);
}

static void ramp_submit(const ramp *r, insitu_session *session)
{
    insitu_field field = r->in.field;
    everywhere(insitu_set_mesh(session, "m", &r->in.mesh) == INSITU_OK);
    field.values =
        r->is_single ? (insitu_array){r->singles, INSITU_FLOAT32, 0} : (insitu_array){r->values, INSITU_FLOAT64, 0};
    everywhere(insitu_set_field(session, "m", &field) == INSITU_OK);
    field.name = "z";
    field.values = (insitu_array){r->heights, INSITU_FLOAT64, 0};
    everywhere(insitu_set_field(session, "m", &field) == INSITU_OK);
}

/* ---- pictures -------------------------------------------------------------------------------------------------- */

#define LIT "material: {ambient: 1, diffuse: 0, specular: 0}"

/* Layers in which the colour of every pixel is a function of its position. %s is replaced by the keys of the colour
 * map. */
static const char *const layers[] = {
    "isosurface: {field: z, values: [0.1], colour_by: {field: f, %s}, " LIT "}",
    "slice: {field: f, planes: [{normal: [0, 0, 1]}], %s, " LIT "}",
    "surface: {colour_by: {field: f, %s}, " LIT "}",
    "volume: {field: f, %s, opacity: [[0, 0.9], [1, 0.9]], unit_distance: 0.05}",
};

static const char *make_layer_scene(int layer, const char *keys)
{
    static char text[1024];
    char filled[512];
    const char *of = strstr(layers[layer], "%s");
    snprintf(filled, sizeof filled, "%.*s%s, map: {colours: [[0, 0, 0], [1, 1, 1]]}%s", (int)(of - layers[layer]),
             layers[layer], keys, of + 2);
    snprintf(text, sizeof text,
             "images:\n  - name: a\n    size: [%d, %d]\n    camera: {position: [0, 0, 5], focal: [0, 0, 0], up: [0, 1, "
             "0], projection: orthographic, height: 2}\n    layers: [%s]\n"
             "    outputs: [{path: narrow.png}]\n",
             SIZE, SIZE, filled);
    return text;
}

static double convert_linear_to_srgb(double linear)
{
    return linear <= 0.0031308 ? 12.92 * linear : 1.055 * pow(linear, 1 / 2.4) - 0.055;
}

static double convert_srgb_to_linear(double srgb)
{
    return srgb <= 0.04045 ? srgb / 12.92 : pow((srgb + 0.055) / 1.055, 2.4);
}

/* Returns the largest error of a picture's colours, which are from 0 to 1, in linear light if is_linear is set and else
 * in sRGB. The expected colours follow from the position in the range, because the colour map interpolates linearly in
 * sRGB. */
static double measure_colour_error(const caught_picture *picture, bool is_linear, double (*place)(double value),
                                   double low, double high)
{
    double worst = 0;
    for (int i = 0; own_rank == 0 && i < SIZE * SIZE; i++) {
        const double across = (i % SIZE + 0.5) / SIZE, value = low + across * (high - low);
        const double expected = (place(value) - place(low)) / (place(high) - place(low));
        const float *pixel = picture->rgba + 4 * (size_t)i;
        const double found = (double)pixel[1] / (double)pixel[3];
        const double off =
            is_linear ? found - convert_srgb_to_linear(expected) : convert_linear_to_srgb(found) - expected;
        worst = test_larger_error(worst, pixel[3] > 0.9F ? fabs(off) : 9);
    }
    return worst;
}

static double linear_position(double value)
{
    return value;
}

static double logarithmic_position(double value)
{
    return log(value);
}

typedef struct narrow_case {
    double low, high;
    bool is_single;
    const char *scale;
    double (*place)(double value);
} narrow_case;

static const narrow_case cases[] = {
    {101325, 101325.01, false, "", linear_position},
    {0, 1e-5, false, "", linear_position},
    {1e5, 1e5 + 1e-3, false, "", linear_position},
    {1e8, 1e8 + 1e-2, false, "", linear_position},
    {1e8, 1e8 + 1e-3, false, "", linear_position},
    {-1e8, -1e8 + 1e-2, false, "", linear_position},
    {1, 1 + 1e-11, false, "", linear_position},
    {0, 1e-5, true, "", linear_position},
    {1e5, 1e5 + 8, true, "", linear_position},
    {1e8, 1e8 + 8192, true, "", linear_position},
    {1, 1 + 1e-4, true, "", linear_position},
    {1e5, 1e5 + 1e-3, false, "scale: log, ", logarithmic_position},
    {1e8, 1e8 + 1, false, "scale: log, ", logarithmic_position},
    {1e5, 1.002e5, false, "scale: log, ", logarithmic_position},
    {1e5, 1.0009e5, false, "scale: log, ", logarithmic_position},
    {1e5, 1e5 + 8, true, "scale: log, ", logarithmic_position},
    {1e5, 1e5 + 1e-3, false, "scale: symlog, threshold: 1, ", logarithmic_position},
    {1e8, 1e8 + 1, false, "scale: symlog, threshold: 1, ", logarithmic_position},
};

/* Returns the error allowed to a picture: the rounding of values at vertices; 2e-3 for the colour map's table and for
 * float32 intermediates, to which dark colours are sensitive in sRGB; and 2e-4 for scales that the library approximates
 * linearly over a narrow range. */
static double compute_allowed_error(const narrow_case *c)
{
    const double larger = fmax(fabs(c->low), fabs(c->high));
    return (c->is_single ? 6e-8 : 1.2e-16) * larger / (c->high - c->low) + 2e-3 + (*c->scale ? 2e-4 : 0);
}

static void check_case(const narrow_case *c, int layer, bool is_given)
{
    char keys[256];
    ramp r;
    if (is_given)
        snprintf(keys, sizeof keys, "%srange: [%.17g, %.17g]", c->scale, c->low, c->high);
    else
        snprintf(keys, sizeof keys, "%srange: data", c->scale);
    ramp_create(&r, SIDE, c->low, c->high, c->is_single);
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(make_layer_scene(layer, keys)));
    discard_pictures();
    ramp_submit(&r, session);
    everywhere(insitu_step(session, 0, 0) == INSITU_OK);
    everywhere(!strstr(insitu_last_report(session)->warnings, "too near"));
    caught_picture picture = pop_caught_picture();
    const bool is_volume = layer == 3; /* volumes are integrated to max_error and compared in linear light */
    const double allowed = compute_allowed_error(c) + (is_volume ? 0.01 : 0);
    const double off = measure_colour_error(&picture, is_volume, c->place, c->low, c->high);
    if (!(off <= allowed)) fprintf(stderr, "layer %d, %s: off by %g\n", layer, keys, off);
    everywhere(off <= allowed);
    free_caught(&picture);
    insitu_destroy(&session);
    ramp_free(&r);
}

static void pictures_of_narrow_ranges_match_closed_forms(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++)
        for (int layer = 0; layer < 4; layer++)
            for (int is_given = 0; is_given < 2; is_given++) check_case(&cases[i], layer, is_given);
}

/* ---- percentiles ------------------------------------------------------------------------------------------------ */

/* Returns the middles of the value ranges of all cells of the whole mesh, sorted. */
static double *collect_sorted_middles(const narrow_case *c, int64_t *count)
{
    ramp whole;
    session_input *in = &whole.in;
    input_create(in, TEST_TETS, SIDE, TEST_BLOCK, 0, 1);
    *count = in->part.cell_count;
    double *middles = test_calloc((size_t)*count, sizeof *middles);
    for (int64_t cell = 0; cell < *count; cell++) {
        double low = INFINITY, high = -INFINITY;
        for (int64_t i = in->part.offsets[cell]; i < in->part.offsets[cell + 1]; i++) {
            const double x = in->part.coordinates[3 * in->part.connectivity[i]];
            const double exact = c->low + (0.5 + 0.5 * x) * (c->high - c->low);
            const double value = c->is_single ? (double)(float)exact : exact;
            low = fmin(low, value);
            high = fmax(high, value);
        }
        middles[cell] = 0.5 * low + 0.5 * high;
    }
    qsort(middles, (size_t)*count, sizeof *middles, compare_doubles);
    input_free(in);
    return middles;
}

static caught_picture draw_range(const ramp *r, int layer, const char *scale, const char *range)
{
    char keys[256];
    snprintf(keys, sizeof keys, "%srange: %s", scale, range);
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(make_layer_scene(layer, keys)));
    discard_pictures();
    ramp_submit(r, session);
    everywhere(insitu_step(session, 0, 0) == INSITU_OK);
    const caught_picture picture = pop_caught_picture();
    insitu_destroy(&session);
    return picture;
}

/* Checks that the percentiles equal low and high: the pictures with either range must be bit-identical. */
static void check_percentiles(const ramp *r, int layer, const char *scale, const int percents[2], double low,
                              double high)
{
    char by_percentile[64], linear_position[64];
    snprintf(by_percentile, sizeof by_percentile, "{percentile: [%d, %d]}", percents[0], percents[1]);
    snprintf(linear_position, sizeof linear_position, "[%.17g, %.17g]", low, high);
    caught_picture found = draw_range(r, layer, scale, by_percentile),
                   truth = draw_range(r, layer, scale, linear_position);
    const bool is_same = own_rank != 0 || memcmp(found.rgba, truth.rgba, 4 * SIZE * SIZE * sizeof *found.rgba) == 0;
    if (!is_same) fprintf(stderr, "layer %d: %s is not %s\n", layer, by_percentile, linear_position);
    everywhere(is_same);
    free_caught(&found);
    free_caught(&truth);
}

static void percentiles_are_those_of_doubles(void **state)
{
    (void)state;
    static const int percents[][2] = {{0, 100}, {10, 90}, {37, 52}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const narrow_case *c = &cases[i];
        const int *p = percents[i % 3];
        int64_t count;
        double *middles = collect_sorted_middles(c, &count);
        const int64_t low = (int64_t)ceil(p[0] / 100.0 * (double)count);
        const int64_t high = (int64_t)ceil(p[1] / 100.0 * (double)count);
        ramp r;
        ramp_create(&r, SIDE, c->low, c->high, c->is_single);
        check_percentiles(&r, (int)(i % 4), c->scale, p, middles[low > 0 ? low - 1 : 0], middles[high - 1]);
        ramp_free(&r);
        test_free(middles);
    }
}

/* Checks percentiles of a mesh of 10,368 cells. More than two fifths of the cells have the lower value, and more than
 * two fifths the higher one. */
static void percentiles_are_exact_for_many_equal_values(void **state)
{
    (void)state;
    const double low = 1e5, high = 1e5 + 1e-3;
    ramp r;
    ramp_create(&r, 12, low, high, false);
    for (int64_t v = 0; v < r.in.part.vertex_count; v++) r.values[v] = r.in.part.coordinates[3 * v] < 0 ? low : high;
    check_percentiles(&r, 1, "", (const int[2]){30, 70}, low, high);
    ramp_free(&r);
}

/* ---- legends and warnings -------------------------------------------------------------------------------------- */

static void constant_fields_have_one_tick(void **state)
{
    (void)state;
    static const struct {
        double value;
        const char *text;
    } constants[] = {{1, "1"},          {0, "0"},           {-3.25, "-3.25"},
                     {0.1, "0.1"},      {1e8, "100000000"}, {101325.01, "101325.01"},
                     {2e-300, "2e-300"}};
    float colours[6] = {0};
    for (size_t i = 0; i < sizeof constants / sizeof *constants; i++)
        for (int scale = 0; scale < 2; scale++) {
            const double value = constants[i].value;
            const scene_colour_map map = {
                .count = 2, .colours = colours, .scale = scale ? SCENE_SYMLOG : SCENE_LINEAR, .threshold = 1};
            session_transfer made;
            insitu_tick tick;
            assert_true(session_make_transfer(1, &map, value, value, NULL, &made));
            assert_true(made.is_constant && made.low < made.high);
            assert_int_equal(session_make_constant_tick(made.constant, &(scene_number_form){0}, &tick), 1);
            assert_string_equal(tick.text, constants[i].text);
            assert_true(tick.place == 0.5);
            session_transfer_free(&made);
        }
}

/* Checks that a warning is given only once if values differ by rounding alone, and that there is none for a constant
 * field. All steps must succeed. */
static void values_too_near_are_reported(void **state)
{
    (void)state;
    static const struct {
        double low, high;
        const char *range;
        bool is_reported;
    } near[] = {{1, 1 + 1e-15, "data", true},    {1, 1 + 1e-15, "[1, 1.000000000000001]", true},
                {0, 1e-300, "data", true},       {0, 1e-300, "[0, 1e-300]", true},
                {1e8, 1e8 + 1e-7, "data", true}, {1, 1, "data", false},
                {1, 1 + 1e-12, "data", false},   {0, 1e-30, "data", false}};
    for (size_t i = 0; i < sizeof near / sizeof *near; i++)
        for (int layer = 0; layer < 4; layer++) {
            char keys[256];
            ramp r;
            snprintf(keys, sizeof keys, "range: %s", near[i].range);
            ramp_create(&r, SIDE, near[i].low, near[i].high, false);
            insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(make_layer_scene(layer, keys)));
            for (int cycle = 0; cycle < 2; cycle++) {
                ramp_submit(&r, session);
                everywhere(insitu_step(session, cycle, 0) == INSITU_OK);
                const bool is_reported = strstr(insitu_last_report(session)->warnings, "too near") != NULL;
                if (is_reported != (near[i].is_reported && cycle == 0)) fprintf(stderr, "layer %d, %s\n", layer, keys);
                everywhere(is_reported == (near[i].is_reported && cycle == 0));
            }
            insitu_destroy(&session);
            ramp_free(&r);
        }
    discard_pictures();
}

/* ---- statistics ------------------------------------------------------------------------------------------------ */

/* Checks the statistics of a linear field over a cube: its extremes are at corners, and its mean is the value in the
 * middle. The bins of the histogram must sum to 1, and each must have more than a tenth. */
static void statistics_distinguish_narrow_fields(void **state)
{
    (void)state;
    for (int is_given = 0; is_given < 2; is_given++) {
        const double low = 1e8, high = 1e8 + 1e-2;
        char scene[1200], text[MOST] = "";
        double n[16] = {0};
        ramp r;
        ramp_create(&r, SIDE, low, high, false);
        if (own_rank == 0) unlink("narrow.csv");
        snprintf(scene, sizeof scene, "%sstatistics: [{field: f, path: narrow.csv, histogram: {bins: 4%s}}]\n",
                 make_layer_scene(1, "range: data"), is_given ? ", range: [100000000, 100000000.01]" : "");
        insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(scene));
        ramp_submit(&r, session);
        everywhere(insitu_step(session, 0, 0) == INSITU_OK);
        insitu_destroy(&session);
        read_file("narrow.csv", MOST, text);
        const char *at = strchr(text, '\n');
        for (int i = 0; at && i < 14; i++, at = strchr(at + 1, ',')) n[i] = strtod(at + 1, NULL);
        /* Columns of the table: cycle, time, cells, volume, minimum, maximum, mean, deviation, low, high, bins. Near
         * 1e8, adjacent doubles differ by 1.5e-8. */
        const bool is_well = fabs(n[4] - low) <= 2e-8 && fabs(n[5] - high) <= 2e-8 &&
                             fabs(n[6] - 0.5 * (low + high)) <= 1e-6 && fabs(n[8] - low) <= 2e-8 &&
                             fabs(n[9] - high) <= 2e-8 && fabs(n[10] + n[11] + n[12] + n[13] - 1) < 1e-8 &&
                             n[10] > 0.1 && n[11] > 0.1 && n[12] > 0.1 && n[13] > 0.1;
        if (own_rank == 0 && !is_well) fprintf(stderr, "%s", text);
        everywhere(own_rank != 0 || is_well);
        ramp_free(&r);
        discard_pictures();
    }
}

static int set_up_test_group(void **state)
{
    (void)state;
    return enter_test_folder("narrow") ? 0 : 1;
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(pictures_of_narrow_ranges_match_closed_forms),
                                       cmocka_unit_test(percentiles_are_those_of_doubles),
                                       cmocka_unit_test(percentiles_are_exact_for_many_equal_values),
                                       cmocka_unit_test(constant_fields_have_one_tick),
                                       cmocka_unit_test(values_too_near_are_reported),
                                       cmocka_unit_test(statistics_distinguish_narrow_fields)};
    return run_session_tests(argc, argv, tests, set_up_test_group, NULL);
}
