/* Checks deep pictures. The samples of every pixel must be sorted by depth without overlaps, and blending them in
 * double must give the flat picture. For surfaces and for reproducible volumes, the samples of any partition must be
 * bit-identical to those of one rank. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "test_session_fixture.h"

enum { SIDE = 3, WIDTH = 48, HEIGHT = 36, PIXELS = WIDTH * HEIGHT };

/* All colour components are 0 or 1, which have the same values in sRGB and in linear light. */
#define SCENE(layers, more)                                                                                            \
    "images:\n  - name: a\n    size: [48, 36]\n    background: [0, 1, 0, 0.5]\n" more "    layers:\n" layers           \
    "    outputs: [{path: flat.exr}, {path: deep.exr, deep: true}]\n"
#define CLEAR "      - isosurface: {field: f, values: [-0.4, -0.2, 0.1], opacity: 0.4}\n"
#define SOLID "      - isosurface: {field: f, values: [0.3]}\n"
#define SLICE "      - slice: {field: f, opacity: 0.7, planes: [{normal: [1, 0.2, 0.1]}]}\n"
#define VOLUME "      - volume: {field: f, opacity: [[0, 0.1], [0.5, 0.2], [0.5, 0.9], [1, 0.4]]}\n"
#define SAMPLES "    sampling: {method: samples}\n"
#define REPRODUCIBLE(more) "    sampling: {" more ", reproducible: true}\n"

typedef struct deep_case {
    const char *name, *scene;
    bool is_of_surfaces;
    bool is_reproducible; /* whether the samples of any partition are bit-identical */
} deep_case;

static const deep_case cases[] = {
    {"surfaces", SCENE(CLEAR SOLID SLICE, ""), true, false},
    {"surfaces, antialias", SCENE(CLEAR SOLID SLICE, "    antialias: 4\n"), true, false},
    {"volume", SCENE(VOLUME, ""), false, false},
    {"volume, clear surfaces", SCENE(VOLUME CLEAR, ""), false, false},
    {"volume, all", SCENE(VOLUME CLEAR SOLID SLICE, "    sampling: {max_error: 0.001}\n"), false, false},
    {"samples", SCENE(VOLUME CLEAR SOLID, SAMPLES), false, false},
    {"segments", SCENE(VOLUME CLEAR, "    sampling: {method: segments}\n"), false, false},
    {"two volumes", SCENE(VOLUME VOLUME CLEAR, SAMPLES), false, false},
    {"two volumes, max_error", SCENE(VOLUME VOLUME SOLID, "    sampling: {max_error: 0.01}\n"), false, false},
    {"volume, reproducible", SCENE(VOLUME, REPRODUCIBLE("max_error: 0.01")), false, true},
    {"volume, all, reproducible", SCENE(VOLUME CLEAR SOLID SLICE, REPRODUCIBLE("max_error: 0.001")), false, true},
    {"samples, reproducible", SCENE(VOLUME CLEAR SOLID, REPRODUCIBLE("method: samples")), false, true},
    {"segments, reproducible", SCENE(VOLUME CLEAR, REPRODUCIBLE("method: segments")), false, true},
    {"two volumes, reproducible", SCENE(VOLUME VOLUME CLEAR, REPRODUCIBLE("method: samples")), false, true},
    {"nothing", SCENE("      - isosurface: {field: f, values: [1000]}\n", ""), true, false},
};
enum { CASES = sizeof cases / sizeof *cases, ANTIALIASED = 1 };

/* ---- one picture ---------------------------------------------------------------------------------------------- */

/* Returns the bound of the error of a pixel with this number of samples. A float's rounding error is at most 2^-24, as
 * all numbers are at most 1. Compositing a sample takes two products and a sum, and the opacity in the deep picture is
 * a difference: four roundings. For mixed segments the flat picture multiplies the transmittance of several consecutive
 * ones as one number: two more roundings. The background takes a product and a sum. */
static double compute_error_bound(int64_t samples)
{
    return ldexp((double)(6 * samples + 2), -24);
}

static bool is_in_order(const insitu_deep_sample *samples, int64_t count)
{
    for (int64_t i = 0; i < count; i++) {
        if (!(samples[i].z <= samples[i].z_back)) return false;
        if (i > 0 && !(samples[i - 1].z_back <= samples[i].z)) return false;
        if (!(samples[i].rgba[3] >= 0 && samples[i].rgba[3] <= 1)) return false;
    }
    return true;
}

/* Returns the largest difference between a channel of the flat pixel and of the samples blended over the background. */
static double distance_from_flattened(const insitu_deep_sample *samples, int64_t count, const double behind[4],
                                      const float *flat)
{
    double rgba[4] = {0, 0, 0, 0}, worst = 0;
    for (int64_t i = 0; i < count; i++) {
        const double through = 1 - rgba[3];
        for (int c = 0; c < 4; c++) rgba[c] += through * (double)samples[i].rgba[c];
    }
    for (int c = 0; c < 4; c++)
        worst = test_larger_error(worst, fabs(rgba[c] + (1 - rgba[3]) * behind[c] - (double)flat[c]));
    return worst;
}

static const double linear_background[4] = {0, 0.5, 0, 0.5};

static bool is_the_flat_picture(const caught_picture *deep, const caught_picture *flat, const char *name)
{
    int64_t shown = 0;
    for (int p = 0; p < PIXELS; p++) {
        const insitu_deep_sample *samples = deep->samples + deep->first[p];
        const int64_t count = deep->first[p + 1] - deep->first[p];
        const double off = distance_from_flattened(samples, count, linear_background, flat->rgba + 4 * p);
        shown += count;
        if (is_in_order(samples, count) && off <= compute_error_bound(count)) continue;
        fprintf(stderr, "%s, %d ranks, pixel %d of %d samples: off by %g\n", name, rank_count, p, (int)count, off);
        return false;
    }
    return shown > 0 || strcmp(name, "nothing") == 0;
}

/* Checks that the depth in the flat picture is that of the first sample, which belongs to the nearest surface because
 * the scene has no volume. */
static bool has_depths(const caught_picture *deep, const caught_picture *flat)
{
    for (int p = 0; p < PIXELS; p++) {
        const bool is_empty = deep->first[p] == deep->first[p + 1];
        if (is_empty ? isfinite(flat->depth[p]) : deep->samples[deep->first[p]].z != flat->depth[p]) return false;
    }
    return true;
}

static bool is_the_same_flat(const caught_picture *a, const caught_picture *b)
{
    return memcmp(a->rgba, b->rgba, 4 * PIXELS * sizeof *a->rgba) == 0;
}

/* ---- pictures ------------------------------------------------------------------------------------------------- */

typedef struct two_pictures {
    caught_picture flat, deep;
} two_pictures;

static two_pictures draw_flat_and_deep(MPI_Comm comm, const char *scene, const session_input *in)
{
    two_pictures out = {0};
    insitu_session *session = open_session_and_draw(comm, scene, in);
    if (own_rank == 0) {
        assert_int_equal(caught_count, 2);
        out = (two_pictures){caught[0], caught[1]};
        caught_count = 0;
    }
    insitu_destroy(&session);
    return out;
}

static void free_pictures(two_pictures *pictures)
{
    free_caught(&pictures->flat);
    free_caught(&pictures->deep);
}

static bool verify_case(const deep_case *c, const session_input *whole, const session_input *part)
{
    const char *scene = write_scene(c->scene);
    two_pictures ours = draw_flat_and_deep(MPI_COMM_WORLD, scene, part), alone = {0};
    if (own_rank != 0) return true;
    alone = draw_flat_and_deep(MPI_COMM_SELF, scene, whole);
    const bool is_averaged = c == &cases[ANTIALIASED];
    bool is_well = is_averaged || is_the_flat_picture(&ours.deep, &ours.flat, c->name);
    is_well = is_well && (is_averaged || is_the_flat_picture(&alone.deep, &alone.flat, c->name));
    if (is_well && c->is_of_surfaces)
        is_well = has_depths(&ours.deep, &ours.flat) && are_same_pictures(&ours.deep, &alone.deep);
    if (is_well && c->is_reproducible)
        is_well = is_the_same_flat(&ours.flat, &alone.flat) && are_same_pictures(&ours.deep, &alone.deep);
    free_pictures(&ours);
    free_pictures(&alone);
    return is_well;
}

static void verify_deep_pictures(test_mesh_kind kind, test_partition_kind distributed)
{
    session_input whole = {0}, part = {0};
    input_create(&whole, kind, SIDE, distributed, 0, 1);
    input_create(&part, kind, SIDE, distributed, own_rank, rank_count);
    for (int i = 0; i < CASES; i++) {
        const bool is_well = verify_case(&cases[i], &whole, &part);
        if (!is_well) fprintf(stderr, "%s: %s\n", test_mesh_kind_name(kind), cases[i].name);
        everywhere(is_well);
    }
    input_free(&part);
    input_free(&whole);
}

static void deep_pictures_match_flat_pictures(void **state)
{
    (void)state;
    verify_deep_pictures(TEST_TETS, TEST_BLOCK);
    verify_deep_pictures(TEST_HEXES, TEST_CHECKERBOARD);
    verify_deep_pictures(TEST_POLYHEDRA, TEST_RANDOM);
    verify_deep_pictures(TEST_MIXED, TEST_RANDOM);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(deep_pictures_match_flat_pictures)};
    return run_session_tests(argc, argv, tests, NULL, NULL);
}
