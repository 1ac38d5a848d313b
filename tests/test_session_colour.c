/* Checks the sources of colour ranges over all ranks: the picture with each source is bit-identical to the picture with
 * the explicit range that brute force finds over the whole mesh. Ranges over a run widen from step to step and are kept
 * in a file for later sessions; a corrupt file is an error. Colour maps from files must reach all ranks. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "session_transfer.h"
#include "test_session_fixture.h"

enum { SIDE = 4 };
static const test_mesh_kind kind = TEST_MIXED;

static char folder[512], image_name[32];
static session_input block, distributed;

/* Returns a scene with a coloured isosurface and a volume. The keys are inserted into the isosurface's colours and into
 * the volume. */
static const char *make_scene(const char *surface_keys, const char *volume_keys)
{
    static char text[2048];
    snprintf(
        text, sizeof text,
        "images:\n  - name: %s\n    size: [40, 30]\n    layers:\n"
        "      - isosurface: {field: f, values: [0.1], opacity: 0.7, colour_by: {field: f, component: magnitude%s}}\n"
        "      - volume: {field: f%s}\n    sampling: {step_cells: 0.5}\n    outputs: [{path: "
        "\"%s/{name}_{cycle}.exr\"}]\n",
        image_name, surface_keys, volume_keys, folder);
    return text;
}

static caught_picture draw_step(insitu_session *session, int cycle)
{
    check_step_succeeds(session, cycle);
    const caught_picture picture = pop_caught_picture();
    return picture;
}

static caught_picture draw_with_keys(const session_input *in, const char *surface_keys, const char *volume_keys)
{
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(make_scene(surface_keys, volume_keys)));
    everywhere(submit_input(session, in) == INSITU_OK);
    const caught_picture picture = draw_step(session, 0);
    insitu_destroy(&session);
    return picture;
}

/* Checks that no colour channel differs by more than `allowed`, and frees both pictures. Pictures of surfaces are
 * bit-identical; volumes agree to 1e-6 on several ranks. */
static void assert_similar_pictures(caught_picture *a, caught_picture *b, double allowed)
{
    double worst = 0;
    for (int i = 0; own_rank == 0 && i < 4 * a->width * a->height; i++)
        worst = test_larger_error(worst, fabs((double)a->rgba[i] - (double)b->rgba[i]));
    if (worst > allowed) fprintf(stderr, "pictures differ by %g\n", worst);
    everywhere(worst <= allowed);
    free(a->rgba), free(a->depth), free(b->rgba), free(b->depth);
}

/* ---- ranges by brute force --------------------------------------------------------------------------------------- */

typedef struct truth {
    double least, most, least_positive;
    int64_t count, positive;
    double *middles; /* sorted middles of the ranges of cells: half the sum of a cell's least and greatest value */
} truth;

static truth compute_exact_ranges(void)
{
    test_mesh mesh;
    test_mesh_make_lattice(kind, SIDE, 0.2, test_wave_field, &mesh);
    truth t = {INFINITY, -INFINITY, INFINITY, mesh.cell_count, 0, malloc((size_t)mesh.cell_count * sizeof(double))};
    assert_non_null(t.middles);
    for (int64_t c = 0; c < mesh.cell_count; c++) {
        double low = INFINITY, high = -INFINITY;
        for (int64_t i = mesh.offsets[c]; i < mesh.offsets[c + 1]; i++) {
            low = fmin(low, mesh.values[mesh.connectivity[i]]);
            high = fmax(high, mesh.values[mesh.connectivity[i]]);
        }
        t.least = fmin(t.least, low);
        t.most = fmax(t.most, high);
        if (low > 0) t.least_positive = fmin(t.least_positive, low);
        t.middles[c] = 0.5 * low + 0.5 * high;
        t.positive += t.middles[c] > 0;
    }
    qsort(t.middles, (size_t)t.count, sizeof *t.middles, compare_doubles);
    test_mesh_free(&mesh);
    return t;
}

/* Returns a percentile by the nearest-rank method, ignoring the first `skipped` values: the least value such that
 * `percent` percent of the values are at most as large. */
static double compute_percentile(const truth *t, int64_t skipped, double percent)
{
    const int64_t count = t->count - skipped, rank = (int64_t)ceil(percent / 100 * (double)count);
    return t->middles[skipped + (rank > 0 ? rank - 1 : 0)];
}

static void check_source(const char *keys, const char *scale, double low, double high)
{
    char fixed[256], by_source[256];
    snprintf(fixed, sizeof fixed, "%s, range: [%.17g, %.17g]", scale, low, high);
    snprintf(by_source, sizeof by_source, "%s, range: %s", scale, keys);
    caught_picture truth = draw_with_keys(&block, "", fixed), found = draw_with_keys(&block, "", by_source);
    assert_similar_pictures(&found, &truth, 0);
    truth = draw_with_keys(&block, "", fixed), found = draw_with_keys(&distributed, "", by_source);
    assert_similar_pictures(&found, &truth, 1e-6);
}

static void ranges_match_brute_force(void **state)
{
    (void)state;
    truth t = compute_exact_ranges();
    const double size = fmax(fabs(t.least), fabs(t.most));
    const int64_t negative = t.count - t.positive;
    check_source("data", "", t.least, t.most);
    check_source("symmetric", "", -size, size);
    check_source("symmetric", ", scale: symlog, threshold: 0.1", -size, size);
    check_source("data", ", scale: log", t.least_positive, t.most);
    check_source("{percentile: [0, 100]}", "", compute_percentile(&t, 0, 0), compute_percentile(&t, 0, 100));
    check_source("{percentile: [2, 98]}", "", compute_percentile(&t, 0, 2), compute_percentile(&t, 0, 98));
    check_source("{percentile: [37.5, 50]}", "", compute_percentile(&t, 0, 37.5), compute_percentile(&t, 0, 50));
    check_source("{percentile: [5, 95]}", ", scale: log", compute_percentile(&t, negative, 5),
                 compute_percentile(&t, negative, 95));
    free(t.middles);
}

/* ---- over a run ------------------------------------------------------------------------------------------------ */

static void scale_values(session_input *in, double factor)
{
    for (int64_t v = 0; v < in->part.vertex_count; v++) in->part.values[v] *= factor;
}

static const char *make_ranges_file_name(void)
{
    static char path[600];
    snprintf(path, sizeof path, "%s/%s.ranges", folder, image_name);
    return path;
}

static void remove_ranges(void)
{
    if (own_rank == 0) unlink(make_ranges_file_name());
    MPI_Barrier(MPI_COMM_WORLD);
}

static void ranges_over_a_run_widen_and_persist(void **state)
{
    (void)state;
    truth t = compute_exact_ranges();
    char widest[128];
    const char *run = ", range: run";
    snprintf(widest, sizeof widest, ", range: [%.17g, %.17g]", 2 * t.least, 2 * t.most);
    free(t.middles);
    remove_ranges();
    caught_picture plain = draw_with_keys(&distributed, "", ""),
                   by_data = draw_with_keys(&distributed, "", ", range: data");
    caught_picture fixed = draw_with_keys(&distributed, "", widest);
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(make_scene(run, run)));
    for (int cycle = 0; cycle < 3; cycle++) {
        if (cycle) scale_values(&distributed, cycle == 1 ? 2 : 0.5);
        everywhere(submit_input(session, &distributed) == INSITU_OK);
        caught_picture picture = draw_step(session, cycle);
        if (cycle == 0)
            assert_similar_pictures(&picture, &by_data, 0);
        else
            free(picture.rgba), free(picture.depth);
    }
    insitu_destroy(&session);
    everywhere(own_rank != 0 || access(make_ranges_file_name(), R_OK) == 0);
    /* Another session continues the range from the file. The comparison concerns the volume, because the surface is
     * coloured by another field. */
    caught_picture again = draw_with_keys(&distributed, "", run);
    assert_similar_pictures(&again, &fixed, 0);
    /* The file contains no range for another field yet. */
    caught_picture other = draw_with_keys(&distributed, "", ", component: magnitude, range: run"), fresh;
    fresh = draw_with_keys(&distributed, "", ", component: magnitude");
    assert_similar_pictures(&other, &fresh, 0);
    remove_ranges();
    caught_picture anew = draw_with_keys(&distributed, "", run);
    assert_similar_pictures(&anew, &plain, 0);
    remove_ranges();
}

/* Checks every kind of layer that is coloured by a field, with a range over a run: the picture equals that with the
 * range of the data, and the file has a line for the layer. */
static void every_kind_of_layer_has_a_range_over_a_run(void **state)
{
    (void)state;
    static const char *const layers[][2] = {
        {"isosurface", "isosurface: {field: f, values: [0.1], colour_by: {field: f, component: magnitude%s}}"},
        {"surface", "surface: {colour_by: {field: f%s}}"},
        {"slice", "slice: {field: f, planes: [{normal: [1, 1, 0]}, {normal: [0, 0, 1]}]%s}"},
        {"volume", "volume: {field: f%s}"},
    };
    for (int i = 0; i < 4; i++) {
        caught_picture pictures[2];
        remove_ranges();
        for (int is_run = 0; is_run < 2; is_run++) {
            char text[1024], layer[256], line[128] = "";
            snprintf(layer, sizeof layer, layers[i][1], is_run ? ", range: run" : "");
            snprintf(text, sizeof text,
                     "images:\n  - name: %s\n    size: [40, 30]\n    layers:\n      - %s\n"
                     "    outputs: [{path: \"%s/a.exr\"}]\n",
                     image_name, layer, folder);
            insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(text));
            everywhere(submit_input(session, &block) == INSITU_OK);
            pictures[is_run] = draw_step(session, 0);
            insitu_destroy(&session);
            FILE *file = own_rank == 0 ? fopen(make_ranges_file_name(), "r") : NULL;
            everywhere(own_rank != 0 || (file != NULL) == is_run);
            while (file && fgets(line, sizeof line, file) && line[0] == '#') line[0] = '\0';
            everywhere(!file || strncmp(line, layers[i][0], strlen(layers[i][0])) == 0);
            if (file) fclose(file);
        }
        assert_similar_pictures(&pictures[0], &pictures[1], 1e-6);
    }
    remove_ranges();
}

/* Checks that a layer goes on with its range in the file although another layer of its type is added before it, and
 * that a logarithmic scale does not use a range in the file that reaches 0. */
static void ranges_over_a_run_survive_edits(void **state)
{
    (void)state;
    static const char *const keys[][2] = {{"range: [-3, 3]", "range: run"},
                                          {"scale: log, range: data", "scale: log, range: run"}};
    for (int i = 0; i < 2; i++) {
        caught_picture pictures[2];
        for (int is_run = 0; is_run < 2; is_run++) {
            char text[1024];
            FILE *file = own_rank == 0 ? fopen(make_ranges_file_name(), "w") : NULL;
            if (file) fprintf(file, "slice 0 -2 -3 3 f\n");
            if (file) fclose(file);
            snprintf(text, sizeof text,
                     "images:\n  - name: %s\n    size: [40, 30]\n    layers:\n"
                     "      - slice: {field: f, component: magnitude, range: run, planes: {normal: x}}\n"
                     "      - slice: {field: f, %s}\n    outputs: [{path: \"%s/a.exr\"}]\n",
                     image_name, keys[i][is_run], folder);
            insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(text));
            everywhere(submit_input(session, &block) == INSITU_OK);
            pictures[is_run] = draw_step(session, 0);
            insitu_destroy(&session);
            remove_ranges();
        }
        assert_similar_pictures(&pictures[0], &pictures[1], 1e-6);
    }
}

/* Checks ranges over a run in an image that has no outputs, and so no file: a second, narrower step is drawn with the
 * range of the first. */
static void ranges_over_a_run_need_no_file(void **state)
{
    (void)state;
    float *pixels[2] = {NULL, NULL};
    enum { WIDTH = 40, HEIGHT = 30, CHANNELS = 4 };
    const size_t bytes = sizeof(float) * WIDTH * HEIGHT * CHANNELS;
    const truth t = compute_exact_ranges();
    free(t.middles);
    for (int is_run = 0; is_run < 2; is_run++) {
        char text[1024], range[128] = "run";
        if (!is_run) snprintf(range, sizeof range, "[%.17g, %.17g]", t.least, t.most);
        snprintf(text, sizeof text, "images: [{name: a, size: [%d, %d], layers: [{slice: {field: f, range: %s}}]}]\n",
                 WIDTH, HEIGHT, range);
        insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(text));
        everywhere(insitu_keep_pictures(session, 1) == INSITU_OK);
        everywhere(submit_input(session, &block) == INSITU_OK);
        everywhere(insitu_step(session, 0, 0) == INSITU_OK);
        scale_values(&block, 0.5);
        everywhere(submit_input(session, &block) == INSITU_OK);
        everywhere(insitu_step(session, 1, 1) == INSITU_OK);
        scale_values(&block, 2);
        const insitu_picture *picture = insitu_last_pictures(session, NULL);
        everywhere((picture != NULL) == (own_rank == 0));
        pixels[is_run] = malloc(bytes);
        assert_non_null(pixels[is_run]);
        if (picture) memcpy(pixels[is_run], picture->rgba, bytes);
        insitu_destroy(&session);
    }
    everywhere(own_rank != 0 || memcmp(pixels[0], pixels[1], bytes) == 0);
    free(pixels[0]), free(pixels[1]);
}

/* Checks that two images whose ranges would be kept in one file are reported. */
static void images_with_one_file_of_ranges_are_reported(void **state)
{
    (void)state;
    char text[2048];
    snprintf(text, sizeof text,
             "images:\n"
             "  - {name: %s, size: [8, 6], sweep: {planes: true}, layers: [{slice: {field: f, range: run, planes: "
             "{normal: x, count: 2}}}],\n"
             "     outputs: [{path: \"%s/{name}_{plane}.png\"}]}\n"
             "  - {name: %s.1, size: [8, 6], layers: [{slice: {field: f, range: run}}],\n"
             "     outputs: [{path: \"%s/b.png\"}]}\n",
             image_name, folder, image_name, folder);
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(text));
    everywhere(submit_input(session, &block) == INSITU_OK);
    const insitu_status status = insitu_step(session, 0, 0);
    check_reported_everywhere(session, status, INSITU_ERROR_SCENE, ".1\": its ranges of the run", ".1.ranges",
                              "give one of the two another name");
    insitu_destroy(&session);
    discard_pictures();
    remove_ranges();
}

static void broken_file_of_ranges_is_reported_on_all_ranks(void **state)
{
    (void)state;
    static const char *const lines[] = {"volume 0 -2 3 1 f", "volume 0 -2 nan 1 f", "volume 0 -2 1 f", "whatever"};
    for (int i = 0; i < 4; i++) {
        FILE *file = own_rank == 0 ? fopen(make_ranges_file_name(), "w") : NULL;
        if (file) fprintf(file, "# kept\nvolume 7 -2 0 1 f\n%s\n", lines[i]);
        if (file) fclose(file);
        insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(make_scene("", ", range: run")));
        everywhere(submit_input(session, &block) == INSITU_OK);
        const insitu_status status = insitu_step(session, 0, 0);
        check_reported_everywhere(session, status, INSITU_ERROR_SCENE, image_name, ".ranges:3: is no range",
                                  "delete the file to begin anew");
        remove_ranges();
        check_step_succeeds(session, 1);
        discard_pictures();
        insitu_destroy(&session);
        remove_ranges();
    }
}

/* ---- tables of volumes ---- */

static void interpolate_table_colour(const render_transfer *t, double value, double colour[3])
{
    const double from = render_scaled(t->scale, t->threshold, t->low),
                 to = render_scaled(t->scale, t->threshold, t->high);
    const double place = (render_scaled(t->scale, t->threshold, value) - from) / (to - from) * (t->colour_count - 1);
    const double held = fmin(fmax(place, 0), t->colour_count - 1);
    const int i = held < t->colour_count - 1 ? (int)held : t->colour_count - 2;
    for (int c = 0; c < 3; c++) {
        const double low = (double)t->colours[3 * i + c], high = (double)t->colours[3 * i + 3 + c];
        colour[c] = low + (held - i) * (high - low);
    }
}

static void assert_colour(const render_transfer *t, double value, const float expected[3])
{
    double colour[3];
    interpolate_table_colour(t, value, colour);
    for (int c = 0; c < 3; c++)
        if (!(fabs(colour[c] - (double)expected[c]) <= 1e-6))
            fail_msg("value %g, channel %d: %g, expected %g", value, c, colour[c], (double)expected[c]);
}

/* Checks colour bands of volumes and the colours outside the range. Within a sixteenth of a band from its border the
 * colour may be that of the neighbouring band. The colours outside begin one table entry beyond the ends of the
 * range. */
static void volumes_have_bands_and_colours_outside(void **state)
{
    (void)state;
    const float colours[4][3] = {{0.1F, 0, 0}, {0, 0.5F, 0}, {0, 0, 0.9F}, {1, 1, 0}};
    const scene_opacity_point ramp[2] = {{0, 0}, {1, 1}};
    const scene_volume volume = {.opacity_count = 2, .opacity = (scene_opacity_point *)ramp};
    for (int i = 0; i < 12; i++) {
        session_transfer made;
        scene_colour_map map = {.count = 4,
                                .colours = (float *)colours[0],
                                .is_banded = i % 2,
                                .scale = i / 4 == 0   ? SCENE_LINEAR
                                         : i / 4 == 1 ? SCENE_LOG
                                                      : SCENE_SYMLOG,
                                .threshold = 0.5,
                                .has_below = i / 2 % 2,
                                .has_above = true,
                                .outside_colours = {{0.3F, 0.3F, 0.3F}, {0.6F, 0.6F, 0.6F}}};
        assert_true(session_make_transfer(1, &map, 1, 10, &volume, &made));
        const render_transfer *t = &made.transfer;
        assert_true(made.low == 1 && made.high == 10 && t->opacity_values[0] == 1);
        const double from = render_scaled(t->scale, 0.5, 1), width = render_scaled(t->scale, 0.5, 10) - from;
        for (int step = 0; step < 64; step++) {
            const double place = (step + 0.5) / 64;
            const int band = step / 16;
            if (map.is_banded && step % 16 > 0 && step % 16 < 15)
                assert_colour(t, render_unscaled(t->scale, 0.5, from + place * width), colours[band]);
        }
        for (int entry = 0; entry < 4 && !map.is_banded; entry++)
            assert_colour(t, render_unscaled(t->scale, 0.5, from + entry / 3.0 * width), colours[entry]);
        const double gap = width / (map.is_banded ? 63 : 3) * 1.001;
        assert_colour(t, render_unscaled(t->scale, 0.5, from + width + gap), map.outside_colours[1]);
        assert_colour(t, render_unscaled(t->scale, 0.5, from - gap),
                      map.has_below ? map.outside_colours[0] : colours[0]);
        session_transfer_free(&made);
    }
}

/* Checks control points of the opacity on a logarithmic scale: the renderer interpolates the opacity linearly in the
 * scaled value. */
static void opacity_points_follow_the_scale(void **state)
{
    (void)state;
    const scene_opacity_point points[3] = {{0, 0}, {0.25, 1}, {1, 0.5F}};
    const scene_volume volume = {.opacity_count = 3, .opacity = (scene_opacity_point *)points};
    float colours[6] = {0};
    const scene_colour_map map = {.count = 2, .colours = colours, .scale = SCENE_LOG, .threshold = 1};
    session_transfer made;
    assert_true(session_make_transfer(1, &map, 1e-4, 1e4, &volume, &made));
    const double values[3] = {1e-4, 1e-2, 1e4};
    assert_int_equal(made.transfer.opacity_count, 3);
    for (int i = 0; i < 3; i++) {
        assert_true(fabs(made.transfer.opacity_values[i] / values[i] - 1) < 1e-12);
        assert_true(made.transfer.opacities[i] == points[i].opacity);
    }
    session_transfer_free(&made);
}

/* ---- files ------------------------------------------------------------------------------------------------------- */

static void write_map(const char *text)
{
    char path[600];
    snprintf(path, sizeof path, "%s/%s.json", folder, image_name);
    FILE *file = own_rank == 0 ? fopen(path, "w") : NULL;
    everywhere(own_rank != 0 || (file && fputs(text, file) >= 0 && fclose(file) == 0));
}

static void maps_from_files_reach_every_rank(void **state)
{
    (void)state;
    char keys[128];
    write_map("[{\"Name\": \"a\", \"RGBPoints\": [0, 0, 0, 1, 5, 1, 1, 0, 10, 1, 0, 0]}]");
    snprintf(keys, sizeof keys, ", map: {file: %s.json}", image_name);
    const char *list = ", map: {colours: [[0, 0, 1], [1, 1, 0], [1, 0, 0]]}";
    caught_picture by_file = draw_with_keys(&distributed, keys, keys),
                   by_list = draw_with_keys(&distributed, list, list);
    assert_similar_pictures(&by_file, &by_list, 0);
}

static void missing_and_broken_maps_are_reported_on_all_ranks(void **state)
{
    (void)state;
    char keys[128];
    insitu_session *session = NULL;
    insitu_status status =
        insitu_create(MPI_COMM_WORLD, write_scene(make_scene("", ", map: {file: absent.json}")), &session);
    everywhere(status == INSITU_ERROR_SCENE && !session && strstr(insitu_error(NULL), "volume.map.file: ") &&
               strstr(insitu_error(NULL), "absent.json: cannot be read: No such file"));
    write_map("[{\"Name\": \"a\",\n\"RGBPoints\": [0, 0, 0, 1, 5]}]");
    snprintf(keys, sizeof keys, ", map: {file: %s.json}", image_name);
    status = insitu_create(MPI_COMM_WORLD, write_scene(make_scene(keys, "")), &session);
    everywhere(status == INSITU_ERROR_SCENE && !session && strstr(insitu_error(NULL), "colour_by.map.file: ") &&
               strstr(insitu_error(NULL), ".json:2: RGBPoints: expected"));
}

static int set_up_test_group(void **state)
{
    (void)state;
    const char *scene = write_scene("");
    snprintf(folder, sizeof folder, "%.*s", (int)(strrchr(scene, '/') - scene), scene);
    snprintf(image_name, sizeof image_name, "colour_np%d", rank_count);
    input_create(&block, kind, SIDE, TEST_BLOCK, own_rank, rank_count);
    input_create(&distributed, kind, SIDE, TEST_RANDOM, own_rank, rank_count);
    return 0;
}

static int tear_down_test_group(void **state)
{
    (void)state;
    input_free(&block);
    input_free(&distributed);
    return 0;
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(ranges_match_brute_force),
        cmocka_unit_test(ranges_over_a_run_widen_and_persist),
        cmocka_unit_test(every_kind_of_layer_has_a_range_over_a_run),
        cmocka_unit_test(volumes_have_bands_and_colours_outside),
        cmocka_unit_test(opacity_points_follow_the_scale),
        cmocka_unit_test(ranges_over_a_run_survive_edits),
        cmocka_unit_test(ranges_over_a_run_need_no_file),
        cmocka_unit_test(images_with_one_file_of_ranges_are_reported),
        cmocka_unit_test(broken_file_of_ranges_is_reported_on_all_ranks),
        cmocka_unit_test(maps_from_files_reach_every_rank),
        cmocka_unit_test(missing_and_broken_maps_are_reported_on_all_ranks),
    };
    return run_session_tests(argc, argv, tests, set_up_test_group, tear_down_test_group);
}
