/* Images of one step that draw the same isosurface share its active cells: the same pictures as each alone, and the
 * memory is there while they are drawn and gone after the step. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "memory.h"
#include "session.h"
#include "session_draw.h"
#include "test_session_fixture.h"

enum { IMAGES = 3, TET_BYTES = 64, HEX_BYTES = 128, MOST_BYTES = 64 << 20, SIDE = 10 };

static const double isovalues[2] = {0.1, -0.4};

/* ---- which images share --------------------------------------------------------------------------------------- */

#define SURFACE(more) "{isosurface: {field: f, values: [0.1, -0.4]" more "}}"
#define VOLUME "{volume: {field: f, range: [-1, 1]}}"

/* Images of these layers and frames, NULL at the end; how many of them, from the first on, store active cells: a bit
 * each. */
static unsigned storing(const char *const *layers, const int *frames)
{
    char text[4096] = "images:\n";
    const scene_image *images[8];
    scene s;
    base_error error = {0};
    unsigned bits = 0;
    for (int i = 0; layers[i]; i++)
        snprintf(text + strlen(text), sizeof text - strlen(text),
                 "  - {name: i%d, layers: [%s], sampling: {frames: %d}, outputs: [{path: p%d.png}]}\n", i, layers[i],
                 frames ? frames[i] : 1, i);
    if (scene_parse(text, strlen(text), "scene.yaml", NULL, &s, &error) != INSITU_OK) fail_msg("%s", error.message);
    for (int i = 0; i < s.image_count; i++) images[i] = &s.images[i];
    const session_plan plan = {.image_count = s.image_count, .images = images};
    for (int i = 0; i < s.image_count; i++) bits |= (unsigned)session_active_cells_pay(&plan, images[i]) << i;
    scene_free(&s);
    return bits;
}

#define STORING(...) storing((const char *const[]){__VA_ARGS__, NULL}, NULL)

static void images_of_one_isosurface_store_its_active_cells(void **context)
{
    (void)context;
    everywhere(STORING(SURFACE("")) == 0);
    everywhere(STORING(SURFACE(""), SURFACE("")) == 0); /* filling costs more than it saves of one */
    everywhere(STORING(SURFACE(""), SURFACE(""), SURFACE("")) == 7);
    everywhere(STORING(SURFACE(""), VOLUME, SURFACE("") ", " VOLUME, SURFACE("")) == 13);
    everywhere(STORING(SURFACE(", colours: [[1, 0, 0]]"), SURFACE(", material: {specular: 0}"), SURFACE("")) == 7);
    /* Frames count as images do. */
    everywhere(storing((const char *const[]){SURFACE("") ", " VOLUME, NULL}, (const int[]){2}) == 0);
    everywhere(storing((const char *const[]){SURFACE("") ", " VOLUME, NULL}, (const int[]){3}) == 1);
    everywhere(storing((const char *const[]){SURFACE("") ", " VOLUME, SURFACE(""), NULL}, (const int[]){2, 1}) == 3);
    /* One that is shared makes the image store. */
    everywhere(STORING(SURFACE("") ", {isosurface: {field: g, values: [1]}}", SURFACE(""), SURFACE("")) == 7);
}

/* The first three images share theirs; the fourth has another. */
static void images_of_another_isosurface_do_not_pay(void **context)
{
    static const char *const others[] = {"{isosurface: {field: g, values: [0.1, -0.4]}}",
                                         "{isosurface: {field: f, values: [0.1]}}",
                                         "{isosurface: {field: f, values: [0.1, -0.5]}}",
                                         SURFACE(", component: magnitude"),
                                         SURFACE(", opacity: 0.5"),
                                         SURFACE(", normals: differences"),
                                         SURFACE(", colour_by: {field: g}"),
                                         VOLUME};
    (void)context;
    for (size_t i = 0; i < sizeof others / sizeof others[0]; i++) {
        everywhere(STORING(SURFACE(""), SURFACE(""), SURFACE(""), others[i]) == 7);
        everywhere(STORING(others[i], SURFACE(""), others[i], SURFACE("")) == 0);
    }
    /* Surfaces that cannot be stored are not shared, however often they are drawn. */
    for (size_t i = 4; i < sizeof others / sizeof others[0]; i++)
        everywhere(STORING(others[i], others[i], others[i]) == 0);
}

/* ---- steps ---------------------------------------------------------------------------------------------------- */

/* This rank's part in the arrays whose cells are stored: float32 and int32, of one cell type. */
typedef struct plain_input {
    session_input whole;
    float *coordinates, *values;
    int32_t *connectivity;
} plain_input;

static void plain_create(plain_input *in, test_mesh_kind kind)
{
    session_input *w = &in->whole;
    input_create(w, kind, SIDE, TEST_BLOCK, own_rank, rank_count);
    const test_mesh *part = &w->part;
    in->coordinates = malloc((size_t)(3 * part->vertex_count + 1) * sizeof *in->coordinates);
    in->values = malloc((size_t)(part->vertex_count + 1) * sizeof *in->values);
    in->connectivity = malloc((size_t)(part->connectivity_count + 1) * sizeof *in->connectivity);
    for (int64_t i = 0; i < 3 * part->vertex_count; i++) in->coordinates[i] = (float)part->coordinates[i];
    for (int64_t i = 0; i < part->vertex_count; i++) in->values[i] = (float)part->values[i];
    for (int64_t i = 0; i < part->connectivity_count; i++) in->connectivity[i] = (int32_t)part->connectivity[i];
    insitu_mesh_interleaved(&w->mesh, in->coordinates, INSITU_FLOAT32);
    w->mesh.cell_type = kind == TEST_TETS ? INSITU_TET : INSITU_HEX;
    w->mesh.cell_types = w->mesh.offsets = (insitu_array){0};
    w->mesh.connectivity = (insitu_array){in->connectivity, INSITU_INT32, 0};
    w->field.values = (insitu_array){in->values, INSITU_FLOAT32, 0};
}

static void plain_free(plain_input *in)
{
    free(in->coordinates);
    free(in->values);
    free(in->connectivity);
    input_free(&in->whole);
}

/* The bytes that this rank's cells take when stored, if an isovalue crosses them. */
static int64_t stored_bytes(const plain_input *in)
{
    const test_mesh *part = &in->whole.part;
    int64_t crossed = 0;
    for (int64_t cell = 0; cell < part->cell_count; cell++) {
        double low = INFINITY, high = -INFINITY;
        for (int64_t i = part->offsets[cell]; i < part->offsets[cell + 1]; i++) {
            low = fmin(low, (double)in->values[part->connectivity[i]]);
            high = fmax(high, (double)in->values[part->connectivity[i]]);
        }
        crossed += (low < isovalues[0] && high >= isovalues[0]) || (low < isovalues[1] && high >= isovalues[1]);
    }
    return crossed * (in->whole.kind == TEST_TETS ? TET_BYTES : HEX_BYTES);
}

/* Image n of the scene, from its own side. */
static void add_image(char *text, size_t size, int n, const char *layers)
{
    static const char *const directions[IMAGES] = {"[1, 0.8, 1.2]", "[-1, 0.3, 0.5]", "[0.2, -1, -0.6]"};
    snprintf(text + strlen(text), size - strlen(text),
             "  - {name: i%d, size: [103, 81], camera: {automatic: {direction: %s}}, layers: [%s],\n"
             "     outputs: [{path: i%d.exr}]}\n",
             n, directions[n], layers, n);
}

/* The second step of a session whose scene has these images; the first may leave memory for the next ones. bytes: what
 * rank 0 held while each was written, beyond what it held before the step. */
static void draw_images(const plain_input *in, int first, int count, const char *layers, const char *refused,
                        int64_t *bytes)
{
    char text[4096] = "images:\n";
    for (int n = first; n < first + count; n++) add_image(text, sizeof text, n, layers);
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(text));
    everywhere(hand_over(session, &in->whole) == INSITU_OK);
    const int before = caught_count;
    told_everywhere(session, insitu_step(session, 0, 0), INSITU_OK, "");
    const int64_t held = base_memory_held();
    while (caught_count > before) {
        caught_count--;
        free(caught[caught_count].rgba);
        free(caught[caught_count].depth);
    }
    unwritable = refused;
    const insitu_status status = insitu_step(session, 1, 0);
    unwritable = NULL;
    told_everywhere(session, status, refused ? INSITU_ERROR_IO : INSITU_OK, refused ? refused : "");
    everywhere(refused || base_memory_held() == held);
    for (int n = before; n < caught_count; n++) bytes[n - before] = caught[n].held - held;
    insitu_destroy(&session);
}

static void assert_same_picture(const caught_picture *a, const caught_picture *b)
{
    const size_t pixels = (size_t)a->width * (size_t)a->height;
    float sum = 0;
    assert_string_equal(a->path, b->path);
    assert_memory_equal(a->rgba, b->rgba, pixels * 4 * sizeof(float));
    assert_memory_equal(a->depth, b->depth, pixels * sizeof(float));
    for (size_t i = 0; i < pixels; i++) sum += a->rgba[4 * i + 3];
    assert_true(sum > 1);
}

/* Three images at once, and one after the other in sessions of their own. */
static void compare_with_images_alone(const plain_input *in, const char *layers, int64_t stored)
{
    int64_t shared[IMAGES] = {0}, alone[IMAGES] = {0};
    forget_pictures();
    draw_images(in, 0, IMAGES, layers, NULL, shared);
    for (int n = 0; n < IMAGES; n++) draw_images(in, n, 1, layers, NULL, &alone[n]);
    if (own_rank > 0) return;
    assert_int_equal(caught_count, 2 * IMAGES);
    for (int n = 0; n < IMAGES; n++) {
        /* Where cells are stored, more memory is held; otherwise only three images' plan is. */
        const int64_t more = shared[n] - alone[n];
        if (more < stored || more > (stored ? MOST_BYTES : 0) + 4096)
            fail_msg("image %d: %lld bytes more than alone, expected %lld", n, (long long)more, (long long)stored);
        assert_same_picture(&caught[n], &caught[IMAGES + n]);
    }
}

static void three_images_draw_what_each_does_alone(void **context)
{
    static const test_mesh_kind kinds[2] = {TEST_TETS, TEST_HEXES};
    (void)context;
    for (int kind = 0; kind < 2; kind++) {
        const int64_t held = base_memory_held();
        plain_input in;
        plain_create(&in, kinds[kind]);
        const int64_t stored = stored_bytes(&in);
        everywhere(stored > 8192);
        compare_with_images_alone(&in, SURFACE(""), stored);
        compare_with_images_alone(&in, SURFACE("") ", " VOLUME, stored);
        compare_with_images_alone(&in, SURFACE(", opacity: 0.5"), 0);
        plain_free(&in);
        forget_pictures();
        everywhere(base_memory_held() == held);
    }
}

/* An image that cannot be written does not stop the others, and leaves no memory behind. */
static void memory_is_back_after_an_error(void **context)
{
    const int64_t held = base_memory_held();
    plain_input in;
    int64_t bytes[IMAGES];
    (void)context;
    plain_create(&in, TEST_TETS);
    forget_pictures();
    draw_images(&in, 0, IMAGES, SURFACE(""), "i1.exr", bytes);
    everywhere(caught_count == (own_rank == 0 ? 2 : 0));
    everywhere(own_rank > 0 || (bytes[0] >= stored_bytes(&in) && bytes[1] >= stored_bytes(&in)));
    forget_pictures();
    plain_free(&in);
    everywhere(base_memory_held() == held);
}

/* Values, cells and the camera of one step are not those of the next. */
static void steps_do_not_share(void **context)
{
    char text[4096] = "images:\n";
    plain_input in;
    (void)context;
    for (int n = 0; n < IMAGES; n++) add_image(text, sizeof text, n, SURFACE(""));
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(text));
    plain_create(&in, TEST_TETS);
    for (int step = 0; step < 3; step++) {
        int64_t bytes[IMAGES];
        forget_pictures();
        for (int64_t i = 0; i < in.whole.part.vertex_count; i++) {
            if (step == 1) in.values[i] = 0.2f - in.values[i]; /* in place */
            if (step == 2) in.coordinates[3 * i] *= 1.25f;
        }
        everywhere(hand_over(session, &in.whole) == INSITU_OK);
        told_everywhere(session, insitu_step(session, step, 0), INSITU_OK, "");
        for (int n = 0; n < IMAGES; n++) draw_images(&in, n, 1, SURFACE(""), NULL, bytes);
        for (int n = 0; n < IMAGES && own_rank == 0; n++) assert_same_picture(&caught[n], &caught[IMAGES + n]);
        write_scene(text); /* the session's own again */
    }
    forget_pictures();
    plain_free(&in);
    insitu_destroy(&session);
}

static int run(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(images_of_one_isosurface_store_its_active_cells),
                                       cmocka_unit_test(images_of_another_isosurface_do_not_pay),
                                       cmocka_unit_test(three_images_draw_what_each_does_alone),
                                       cmocka_unit_test(memory_is_back_after_an_error),
                                       cmocka_unit_test(steps_do_not_share)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}

int main(int argc, char **argv)
{
    return run_session_tests(argc, argv, run);
}
