/* Checks antialiasing. Pixels at edges must be the mean of their samples, which is computed in closed form for a
 * plane's colours. All other pixels, and the depths of all pixels, must be bit-identical to those of the picture with
 * one sample per pixel. The picture must not depend on the number of ranks. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "colour_map.h"
#include "comp_edges.h"
#include "render.h"
#include "test_session_fixture.h"

enum { SIDE = 4, WIDTH = 48, HEIGHT = 36, PIXELS = WIDTH * HEIGHT };

#define IMAGE(keys, layers)                                                                                            \
    "images:\n  - name: a\n    size: [48, 36]\n    background: [0, 0, 0, 0]\n"                                         \
    "    camera: {position: [3, 2.2, 4], focal: [0, 0, 0], angle: 40}\n" keys "    layers:\n" layers                   \
    "    outputs: [{path: a.exr}]\n"
#define SLICE                                                                                                          \
    "      - slice: {field: f, map: turbo, range: [-1.5, 1.7], planes: [{normal: [1, 2, -2], offset: -0.4}]}\n"
#define VOLUME "      - volume: {field: f, map: turbo, range: [-1.5, 1.7]}\n"

/* ---- samples ------------------------------------------------------------------------------------------------- */

/* Checks that the samples lie at the centres of the cells of a grid of count x count cells in the pixel, exactly one in
 * each column and one in each row, so that their mean is the pixel's centre. */
static void samples_are_spread_evenly(void **state)
{
    (void)state;
    for (int count = 1; count <= 16; count *= 2) {
        unsigned columns = 0, rows = 0;
        for (int k = 0; k < count; k++) {
            double offset[2];
            render_camera_sample(count, k, offset);
            columns |= 1u << (int)((offset[0] + 0.5) * count);
            rows |= 1u << (int)((offset[1] + 0.5) * count);
            assert_true(fmod((offset[0] + 0.5) * count, 1) == 0.5 && fmod((offset[1] + 0.5) * count, 1) == 0.5);
        }
        assert_true(columns == (1u << count) - 1 && rows == columns);
    }
}

/* ---- the reference ------------------------------------------------------------------------------------------- */

/* Adds the exact colour of the position (x, y) in the picture to sum: the colour of the plane inside the cube, or
 * nothing if the ray misses it. Returns false if the ray passes within 1e-4 of the border of the plane's section,
 * because rounding then decides whether it hits. */
static bool add_exact_sample(const render_camera *c, double x, double y, double sum[4])
{
    static const double normal[3] = {1. / 3, 2. / 3, -2. / 3};
    const double pixel = 2 * c->half_height / HEIGHT, across = (x - 0.5 * WIDTH) * pixel,
                 up = (0.5 * HEIGHT - y) * pixel;
    double direction[3], along = 0, from = -0.4, at[3], outside = -1;
    for (int a = 0; a < 3; a++) {
        direction[a] = c->forward[a] + across * c->right[a] + up * c->up[a];
        along += normal[a] * direction[a];
        from -= normal[a] * c->eye[a];
    }
    for (int a = 0; a < 3; a++) {
        at[a] = c->eye[a] + from / along * direction[a];
        outside = fmax(outside, fabs(at[a]) - 1);
    }
    int count = 0;
    const float *table = colour_map_table("turbo", &count);
    const double place = fmin(fmax((test_linear_field(at) + 1.5) / 3.2, 0), 1) * (count - 1);
    const int entry = (int)fmin(place, count - 2);
    for (int i = 0; i < 3 && outside < 0; i++) {
        const double a = (double)table[3 * entry + i], b = (double)table[3 * entry + 3 + i];
        sum[i] += a + (place - entry) * (b - a);
    }
    sum[3] += outside < 0;
    return fabs(outside) > 1e-4;
}

/* Returns whether a pixel is the mean of `count` samples, or has a sample too close to the border of the plane's
 * section to decide. The tolerance is the error 5 x 3e-7 of a depth near 5 in single precision, divided by a cosine of
 * at least 0.1, times the slope of the field relative to the range, 1 / 3.2, times the slope of the colour table, at
 * most 12. */
static bool is_pixel_sample_mean(const float *rgba, int pixel, int count)
{
    render_camera camera;
    double sum[4] = {0}, off = 0;
    bool is_clear = true;
    render_camera_look_at(&camera, (const double[]){3, 2.2, 4}, (const double[]){0, 0, 0}, (const double[]){0, 1, 0},
                          40, WIDTH, HEIGHT);
    for (int k = 0; k < count; k++) {
        double offset[2];
        render_camera_sample(count, k, offset);
        is_clear = add_exact_sample(&camera, pixel % WIDTH + 0.5 + offset[0], pixel / WIDTH + 0.5 + offset[1], sum) &&
                   is_clear;
    }
    for (int i = 0; i < 4; i++) off = test_larger_error(off, fabs((double)rgba[i] - sum[i] / count));
    return !is_clear || off < 10 * 5 * 3e-7 / 3.2 * 12;
}

/* ---- pictures ------------------------------------------------------------------------------------------------ */

/* Draws one picture and stores the number of traced rays. The scene is a file made by write_scene(), which all ranks
 * must have called. */
static caught_picture draw_picture(MPI_Comm comm, const char *scene, const session_input *in, int64_t *rays)
{
    insitu_session *session = open_session(comm, scene);
    discard_pictures();
    assert_int_equal(submit_input(session, in), INSITU_OK);
    assert_int_equal(insitu_step(session, 0, 0), INSITU_OK);
    *rays = insitu_last_report(session)->rays;
    const caught_picture picture = pop_caught_picture();
    insitu_destroy(&session);
    return picture;
}

/* Returns whether a picture of count samples is right, compared with plain, the picture with one sample per pixel. rays
 * is the number of traced rays: one for each pixel, and count more for each edge pixel. */
static bool is_exact_mean(const caught_picture *picture, const caught_picture *plain, int count, int64_t rays)
{
    unsigned char edges[PIXELS / 8] = {0};
    const image picture_before = {.width = WIDTH, .height = HEIGHT, .rgba = plain->rgba};
    if (!comp_find_edges(&picture_before, 2, edges)) return false;
    const int64_t edge_count = pixel_set_count(edges, PIXELS);
    bool is_well = rays == PIXELS + count * edge_count && edge_count > PIXELS / 50 && edge_count < PIXELS / 3;
    for (int pixel = 0; pixel < PIXELS && is_well; pixel++) {
        const float *rgba = picture->rgba + 4 * pixel, *before = plain->rgba + 4 * pixel;
        const float *next = pixel % WIDTH < WIDTH - 1 ? before + 4 : before;
        const bool is_edge = pixel_set_has(edges, pixel);
        is_well = is_edge ? is_pixel_sample_mean(rgba, pixel, count) : memcmp(rgba, before, 4 * sizeof *rgba) == 0;
        is_well = is_well && (is_edge || next[3] == before[3]);
        if (!is_well) fprintf(stderr, "pixel %d is off, of %d samples\n", pixel, count);
    }
    return is_well && memcmp(picture->depth, plain->depth, PIXELS * sizeof(float)) == 0;
}

static void edges_are_sample_means_and_other_pixels_are_unchanged(void **state)
{
    (void)state;
    static const char *const scenes[] = {IMAGE("    antialias: 2\n", SLICE), IMAGE("    antialias: 4\n", SLICE),
                                         IMAGE("    antialias: 8\n", SLICE), IMAGE("    antialias: 16\n", SLICE)};
    session_input whole = {0};
    int64_t rays = 0;
    bool is_well = true;
    input_create(&whole, TEST_TETS, SIDE, TEST_BLOCK, 0, 1);
    test_mesh_set_values(&whole.part, test_linear_field);
    caught_picture plain = {0};
    const char *scene = write_scene(IMAGE("", SLICE));
    if (own_rank == 0) plain = draw_picture(MPI_COMM_SELF, scene, &whole, &rays);
    for (int i = 0; i < 4; i++) {
        scene = write_scene(scenes[i]);
        if (own_rank != 0) continue;
        caught_picture picture = draw_picture(MPI_COMM_SELF, scene, &whole, &rays);
        is_well = is_exact_mean(&picture, &plain, 2 << i, rays) && is_well;
        free_caught(&picture);
    }
    everywhere(is_well);
    if (own_rank == 0) free_caught(&plain);
    input_free(&whole);
}

/* Compares the picture that all ranks draw together with the one that rank 0 draws from the whole mesh. worst is the
 * largest allowed difference of a colour channel; depths must be bit-identical. */
static void check_on_ranks(const char *text, test_mesh_kind kind, double worst)
{
    const char *scene = write_scene(text);
    session_input whole = {0}, part = {0};
    int64_t rays = 0;
    caught_picture alone = {0};
    input_create(&whole, kind, SIDE, TEST_BLOCK, 0, 1);
    if (own_rank == 0) alone = draw_picture(MPI_COMM_SELF, scene, &whole, &rays);
    input_create(&part, kind, SIDE, TEST_RANDOM, own_rank, rank_count);
    caught_picture picture = draw_picture(MPI_COMM_WORLD, scene, &part, &rays);
    double off = 0;
    for (int i = 0; i < 4 * PIXELS && own_rank == 0; i++)
        off = test_larger_error(off, fabs((double)picture.rgba[i] - (double)alone.rgba[i]));
    everywhere(off <= worst);
    everywhere(own_rank != 0 || memcmp(picture.depth, alone.depth, PIXELS * sizeof(float)) == 0);
    if (own_rank == 0) free_caught(&alone), free_caught(&picture);
    input_free(&part);
    input_free(&whole);
}

static void any_rank_count_draws_one_picture(void **state)
{
    (void)state;
    check_on_ranks(IMAGE("    antialias: 4\n", SLICE), TEST_TETS, 0);
    check_on_ranks(IMAGE("    antialias: 8\n", SLICE), TEST_HEXES, 0);
    check_on_ranks(IMAGE("    antialias: 2\n", VOLUME), TEST_HEXES, 1e-6);
    check_on_ranks(IMAGE("    antialias: 4\n    sampling: {frames: 5}\n", SLICE VOLUME), TEST_TETS, 1e-6);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(samples_are_spread_evenly),
                                       cmocka_unit_test(edges_are_sample_means_and_other_pixels_are_unchanged),
                                       cmocka_unit_test(any_rank_count_draws_one_picture)};
    return run_session_tests(argc, argv, tests, NULL, NULL);
}
