/* Tests the installed interface: uses only the public header and the shared library, and writes real picture files. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmocka.h>

#include "insitu/insitu.h"

static int own_rank, rank_count;
static const char *folder = ".";
static char scene_name[1024];

static void assert_everywhere(bool is_well, int line)
{
    int mine = is_well, all = 0;
    if (!is_well) fprintf(stderr, "%s:%d: rank %d of %d: not so\n", __FILE__, line, own_rank, rank_count);
    MPI_Allreduce(&mine, &all, 1, MPI_INT, MPI_LAND, MPI_COMM_WORLD);
    assert_true(all);
}
#define everywhere(condition) assert_everywhere((condition), __LINE__)

static void write_scene_of(const char *keys, const char *output)
{
    if (own_rank == 0) {
        FILE *file = fopen(scene_name, "w");
        fprintf(
            file,
            "%simages:\n  - name: a\n    size: [24, 16]\n    layers:\n      - isosurface: {field: x, values: [0.4]}\n"
            "    outputs:\n      - path: %s\n",
            keys, output);
        fclose(file);
    }
    MPI_Barrier(MPI_COMM_WORLD);
}

/* Writes a scene whose pictures are written before the step ends. */
static void write_scene(const char *output)
{
    write_scene_of("writing: step\n", output);
}

/* The hex that submit_plane() submits on each rank. The hexes of the ranks lie side by side along y. */
static float corners[8][3], values[8];
static const int32_t indices[8] = {0, 1, 2, 3, 4, 5, 6, 7};

static void submit_plane(insitu_session *session)
{
    for (int i = 0; i < 8; i++) {
        corners[i][0] = i % 4 == 1 || i % 4 == 2;
        corners[i][1] = (float)(own_rank + i % 4 / 2);
        corners[i][2] = (float)(i / 4);
        values[i] = corners[i][0];
    }
    insitu_mesh mesh;
    insitu_mesh_defaults(&mesh);
    mesh.vertex_count = 8;
    insitu_mesh_interleaved(&mesh, corners, INSITU_FLOAT32);
    mesh.cell_count = 1;
    mesh.cell_type = INSITU_HEX;
    mesh.connectivity_count = 8;
    mesh.connectivity = (insitu_array){indices, INSITU_INT32, 0};
    insitu_field field;
    insitu_field_defaults(&field);
    field.name = "x";
    field.count = 8;
    field.values = (insitu_array){values, INSITU_FLOAT32, 0};
    everywhere(insitu_set_mesh(session, "hex", &mesh) == INSITU_OK);
    everywhere(insitu_set_field(session, "hex", &field) == INSITU_OK);
}

static bool file_exists(const char *name, int64_t least_bytes)
{
    char path[8192];
    struct stat found;
    snprintf(path, sizeof path, "%s/%s", folder, name);
    return own_rank != 0 || (stat(path, &found) == 0 && found.st_size >= least_bytes);
}

static void picture_is_written_to_the_path_of_the_scene(void **context)
{
    (void)context;
    char output[2048];
    snprintf(output, sizeof output, "%s/api_np%d/deep/{name}_{cycle:03}.png", folder, rank_count);
    write_scene(output);
    insitu_session *session = NULL;
    everywhere(insitu_create(MPI_COMM_WORLD, scene_name, &session) == INSITU_OK);
    everywhere(insitu_last_report(session)->images == 0 && !strcmp(insitu_last_report(session)->warnings, ""));
    submit_plane(session);
    everywhere(insitu_step(session, 7, 0.5) == INSITU_OK && !strcmp(insitu_error(session), ""));
    everywhere(insitu_last_report(session)->images == 1);
    snprintf(output, sizeof output, "api_np%d/deep/a_007.png", rank_count);
    everywhere(file_exists(output, 60));
    insitu_destroy(&session);
    everywhere(session == NULL);
}

static void folder_that_cannot_be_written_is_named(void **context)
{
    (void)context;
    /* The path of the output folder is a regular file, so that creating the folder fails even for root. */
    char output[2048];
    snprintf(output, sizeof output, "%s/a.png", scene_name);
    write_scene(output);
    insitu_session *session = NULL;
    everywhere(insitu_create(MPI_COMM_WORLD, scene_name, &session) == INSITU_OK);
    submit_plane(session);
    for (int cycle = 0; cycle < 2; cycle++) {
        everywhere(insitu_step(session, cycle, 0) == INSITU_ERROR_IO);
        everywhere(strstr(insitu_error(session), "rank 0: image \"a\": ") && strstr(insitu_error(session), scene_name));
    }
    insitu_destroy(&session);
}

/* Checks errors of pictures that are written in the background. A later step reports for which cycle a picture was not
 * written, and steps continue. Failures that no step has reported are reported when the session is destroyed. */
static void picture_that_is_not_written_is_reported_later(void **context)
{
    (void)context;
    char output[2048];
    snprintf(output, sizeof output, "%s/{cycle}.png", scene_name);
    write_scene_of("", output);
    insitu_session *session = NULL;
    everywhere(insitu_create(MPI_COMM_WORLD, scene_name, &session) == INSITU_OK);
    submit_plane(session);
    insitu_status status = insitu_step(session, 20, 0);
    everywhere(status == INSITU_OK && insitu_last_report(session)->images == 1);
    for (int cycle = 21; cycle < 600 && status == INSITU_OK; cycle++) {
        usleep(10000);
        status = insitu_step(session, cycle, 0);
    }
    everywhere(status == INSITU_ERROR_IO && strstr(insitu_error(session), "cycle 20: image \"a\": ") &&
               strstr(insitu_error(session), scene_name));
    everywhere(insitu_destroy(&session) == INSITU_ERROR_IO && !session);
    everywhere(strstr(insitu_error(NULL), "image \"a\": ") && strstr(insitu_error(NULL), scene_name));
    everywhere(insitu_destroy(&session) == INSITU_OK);
}

static int handled;

static void count_error(MPI_Comm *comm, int *code, ...)
{
    (void)comm, (void)code;
    handled++;
}

static void callers_error_handler_stays(void **context)
{
    (void)context;
    MPI_Errhandler ours, found;
    MPI_Comm comm;
    insitu_session *session = NULL;
    MPI_Comm_dup(MPI_COMM_WORLD, &comm);
    MPI_Comm_create_errhandler(count_error, &ours);
    MPI_Comm_set_errhandler(comm, ours);
    write_scene("unused_{name}.png");
    everywhere(insitu_create(comm, "/no/such.yaml", &session) == INSITU_ERROR_SCENE);
    everywhere(insitu_create(comm, scene_name, &session) == INSITU_OK);
    MPI_Comm_get_errhandler(comm, &found);
    everywhere(found == ours && handled == 0);
    MPI_Errhandler_free(&found);
    int nowhere = 0;
    /* an error of the caller's own call must reach the caller's error handler */
    MPI_Send(&nowhere, 1, MPI_INT, rank_count + 5, 0, comm);
    everywhere(handled == 1);
    insitu_destroy(&session);
    MPI_Errhandler_free(&ours);
    MPI_Comm_free(&comm);
}

static void sessions_of_split_communicators_are_independent(void **context)
{
    (void)context;
    MPI_Comm half;
    char output[2048], name[64];
    insitu_session *session = NULL;
    MPI_Comm_split(MPI_COMM_WORLD, own_rank % 2, 0, &half);
    snprintf(output, sizeof output, "%s/api_np%d_{cycle}.exr", folder, rank_count);
    write_scene(output);
    const insitu_status status = insitu_create(half, scene_name, &session);
    MPI_Comm_free(&half); /* the session uses its own duplicate of the communicator */
    everywhere(status == INSITU_OK);
    submit_plane(session);
    everywhere(insitu_step(session, own_rank % 2, 0) == INSITU_OK);
    for (int cycle = 0; cycle < 2 && cycle < rank_count; cycle++) {
        snprintf(name, sizeof name, "api_np%d_%d.exr", rank_count, cycle);
        everywhere(file_exists(name, 100));
    }
    insitu_destroy(&session);
}

static bool are_same_files(const char *one, const char *other)
{
    static char bytes[2][1 << 16];
    size_t sizes[2];
    const char *const names[2] = {one, other};
    for (int i = 0; i < 2; i++) {
        char path[8192];
        snprintf(path, sizeof path, "%s/%s", folder, names[i]);
        FILE *file = fopen(path, "rb");
        sizes[i] = file ? fread(bytes[i], 1, sizeof bytes[i], file) : 0;
        if (file) fclose(file);
    }
    return sizes[0] > 60 && sizes[0] == sizes[1] && memcmp(bytes[0], bytes[1], sizes[0]) == 0;
}

static const char scene_words[] =
    "images:\n  - name: a\n    size: [24, 16]\n    layers:\n      - isosurface: {field: x, values: [0.4]}\n"
    "    outputs:\n      - path: %s\n";

static void submit_and_draw(insitu_session *session)
{
    submit_plane(session);
    everywhere(insitu_step(session, 0, 0) == INSITU_OK);
    insitu_destroy(&session);
}

static void scene_text_draws_same_pictures_as_scene_file(void **context)
{
    (void)context;
    char output[2][2048], names[2][64], text[4096];
    for (int i = 0; i < 2; i++) {
        snprintf(names[i], sizeof names[i], "api_np%d_%s.png", rank_count, i ? "text" : "file");
        snprintf(output[i], sizeof output[i], "%s/%s", folder, names[i]);
    }
    insitu_session *session = NULL;
    write_scene(output[0]);
    everywhere(insitu_create(MPI_COMM_WORLD, scene_name, &session) == INSITU_OK);
    submit_and_draw(session);
    snprintf(text, sizeof text, scene_words, output[1]);
    /* Only rank 0's text is used, and it is not read after the call returns. */
    const insitu_status status = insitu_create_from_text(MPI_COMM_WORLD, own_rank ? NULL : text, &session);
    memset(text, '!', sizeof text);
    everywhere(status == INSITU_OK);
    submit_and_draw(session);
    everywhere(own_rank != 0 || are_same_files(names[0], names[1]));
}

/* Draws the plane x = 0.4, seen along x from a distance of 5, in two images: one without and one with decorations. */
static const char kept_words[] =
    "images:\n"
    "  - {name: plain, size: [24, 16], every: 2, background: [1, 0, 0], camera: {position: [5.4, %g, 0.5],\n"
    "     focal: [0, %g, 0.5], projection: orthographic, height: %d}, layers: [isosurface: {field: x, values: "
    "[0.4]}],\n"
    "     outputs: [{path: \"%s/{name}.png\"}]}\n"
    "  - {name: titled, size: [24, 16], every: 2, background: [1, 0, 0], decorations: {title: T},\n"
    "     camera: {position: [5.4, %g, 0.5], focal: [0, %g, 0.5], projection: orthographic, height: %d},\n"
    "     layers: [isosurface: {field: x, values: [0.4]}], outputs: [{path: \"%s/{name}.png\"}]}\n";

static bool is_plane_picture(const insitu_picture *p)
{
    static const float background[4] = {1, 0, 0, 1};
    const int middle = 8 * p->width + 12;
    return p->width == 24 && p->height == 16 && memcmp(p->rgba, background, sizeof background) == 0 &&
           isinf(p->depth[0]) && memcmp(p->rgba + 4 * middle, background, sizeof background) != 0 &&
           /* tolerance: float32 rounding of a few operations */
           p->rgba[4 * middle + 3] == 1 && fabs(p->depth[middle] - 5.0) < 5e-6;
}

static void pictures_are_kept_in_memory_if_requested(void **context)
{
    (void)context;
    char text[8192];
    const double y = rank_count / 2.0;
    const int high = 2 * rank_count, here = own_rank == 0 ? 2 : 0;
    snprintf(text, sizeof text, kept_words, y, y, high, folder, y, y, high, folder);
    insitu_session *session = NULL;
    int count = -1;
    everywhere(insitu_create_from_text(MPI_COMM_WORLD, text, &session) == INSITU_OK);
    submit_plane(session);
    everywhere(insitu_step(session, 0, 0) == INSITU_OK && !insitu_last_pictures(session, &count) && count == 0);
    everywhere(insitu_keep_pictures(session, own_rank == 0) == INSITU_OK); /* only rank 0's argument is used */
    everywhere(insitu_step(session, 2, 0) == INSITU_OK);
    const insitu_picture *p = insitu_last_pictures(session, &count);
    everywhere(count == here && !p == !here);
    everywhere(!p || (!strcmp(p[0].image, "plain") && !strcmp(p[1].image, "titled")));
    everywhere(!p || (is_plane_picture(&p[0]) && is_plane_picture(&p[1])));
    everywhere(!p || memcmp(p[0].rgba, p[1].rgba, 24 * 16 * 4 * sizeof(float)) == 0);
    everywhere(insitu_step(session, 3, 0) == INSITU_OK && !insitu_last_pictures(session, &count) && count == 0);
    everywhere(insitu_step(session, 4, 0) == INSITU_OK && !insitu_last_pictures(session, NULL) == !here);
    everywhere(insitu_keep_pictures(session, 0) == INSITU_OK && !insitu_last_pictures(session, &count));
    everywhere(insitu_step(session, 6, 0) == INSITU_OK && !insitu_last_pictures(session, &count) && count == 0);
    insitu_destroy(&session);
}

static void wrong_scene_text_is_reported_with_its_line(void **context)
{
    (void)context;
    insitu_session *session = NULL;
    const char *text = own_rank ? NULL : "images:\n  - name: a\n    sise: [24, 16]\n";
    everywhere(insitu_create_from_text(MPI_COMM_WORLD, text, &session) == INSITU_ERROR_SCENE && !session);
    everywhere(strstr(insitu_error(NULL), "scene text:3: images[0]: the key \"sise\""));
    everywhere(insitu_create_from_text(MPI_COMM_WORLD, NULL, &session) == INSITU_ERROR_ARGUMENT && !session);
    everywhere(strstr(insitu_error(NULL), "insitu_create_from_text: no scene is given"));
    everywhere(insitu_create_from_text(MPI_COMM_NULL, text, &session) == INSITU_ERROR_ARGUMENT);
    /* The text is longer than the limit of scene texts. It must be refused, not truncated. */
    const size_t size = (size_t)5 << 20;
    char *comment = malloc(size);
    memset(comment, '#', size);
    comment[size - 1] = '\0';
    const insitu_status status = insitu_create_from_text(MPI_COMM_WORLD, comment, &session);
    free(comment);
    everywhere(status == INSITU_ERROR_SCENE && strstr(insitu_error(NULL), "scene text:1: "));
}

static void calls_on_null_session_return_errors(void **context)
{
    (void)context;
    insitu_mesh mesh;
    insitu_field field;
    insitu_mesh_defaults(&mesh);
    insitu_field_defaults(&field);
    insitu_mesh_defaults(NULL);
    insitu_field_defaults(NULL);
    insitu_mesh_interleaved(NULL, NULL, INSITU_FLOAT64);
    assert_int_equal(mesh.changed, INSITU_CHANGED_ALL);
    assert_int_equal(field.component_count, 1);
    assert_int_equal(insitu_set_mesh(NULL, "m", &mesh), INSITU_ERROR_ARGUMENT);
    assert_int_equal(insitu_set_field(NULL, "m", &field), INSITU_ERROR_ARGUMENT);
    assert_int_equal(insitu_step(NULL, 0, 0), INSITU_ERROR_ARGUMENT);
    assert_null(insitu_last_report(NULL));
    assert_int_equal(insitu_keep_pictures(NULL, 1), INSITU_ERROR_ARGUMENT);
    assert_null(insitu_last_pictures(NULL, NULL));
    assert_string_equal(insitu_status_name(INSITU_ERROR_MESH), "INSITU_ERROR_MESH");
    assert_int_equal(insitu_destroy(NULL), INSITU_OK);
}

/* Returns whether the calls that communicate return an error after MPI_Finalize(), and do not abort the process. */
static bool are_calls_after_finalize_refused(insitu_session *session)
{
    insitu_session *late = NULL;
    return insitu_create_from_text(MPI_COMM_WORLD, "", &late) == INSITU_ERROR_MPI && !late &&
           insitu_step(session, 0, 0) == INSITU_ERROR_MPI &&
           !strcmp(insitu_error(session), "insitu_step: MPI is not running") &&
           insitu_keep_pictures(session, 1) == INSITU_ERROR_MPI &&
           !strcmp(insitu_error(session), "insitu_keep_pictures: MPI is not running");
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(picture_is_written_to_the_path_of_the_scene),
        cmocka_unit_test(folder_that_cannot_be_written_is_named),
        cmocka_unit_test(picture_that_is_not_written_is_reported_later),
        cmocka_unit_test(callers_error_handler_stays),
        cmocka_unit_test(sessions_of_split_communicators_are_independent),
        cmocka_unit_test(scene_text_draws_same_pictures_as_scene_file),
        cmocka_unit_test(pictures_are_kept_in_memory_if_requested),
        cmocka_unit_test(wrong_scene_text_is_reported_with_its_line),
        cmocka_unit_test(calls_on_null_session_return_errors),
    };
    insitu_session *early = NULL, *late = NULL;
    const bool is_refused = insitu_create(MPI_COMM_WORLD, "x", &early) == INSITU_ERROR_MPI && !early;
    MPI_Init(&argc, &argv);
    MPI_Comm_rank(MPI_COMM_WORLD, &own_rank);
    MPI_Comm_size(MPI_COMM_WORLD, &rank_count);
    if (argc > 1) folder = argv[1];
    snprintf(scene_name, sizeof scene_name, "%s/test_api_np%d.yaml", folder, rank_count);
    int failed = cmocka_run_group_tests(tests, NULL, NULL);
    write_scene("unused.png");
    failed += insitu_create(MPI_COMM_WORLD, scene_name, &late) != INSITU_OK;
    MPI_Finalize();
    failed += !are_calls_after_finalize_refused(late);
    /* The session is destroyed after MPI_Finalize(). insitu_destroy() must return an error and not crash. */
    failed += insitu_destroy(&late) != INSITU_OK || late || !is_refused;
    return failed;
}
