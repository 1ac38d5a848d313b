/* Checks that an array is read again if its address has changed, even if the caller states that the array is
 * unchanged. */
#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "test_session_fixture.h"

static const char scene_text[] = "images:\n"
                                 "  - name: a\n"
                                 "    size: [48, 36]\n"
                                 "    layers:\n"
                                 "      - isosurface: {field: f, values: [0.1]}\n"
                                 "      - volume: {field: f}\n"
                                 "    outputs:\n"
                                 "      - path: a_{cycle}.exr\n";

static session_input input;
/* name of the scene file, which is written once, because sessions discard their state after an edit */
static const char *scene;

static void create_input(void)
{
    input_create(&input, TEST_MIXED, 5, TEST_BLOCK, own_rank, rank_count);
    test_mesh_to_polyhedra(&input.part, 0.3);
    input_describe(&input);
}

static insitu_session *open_and_draw(void)
{
    insitu_session *session = open_session(MPI_COMM_WORLD, scene);
    everywhere(submit_input(session, &input) == INSITU_OK);
    check_step_succeeds(session, 0);
    return session;
}

/* ---- faulty arrays at another address ------------------------------------------------------------------------- */

typedef union element {
    double real;
    int64_t index;
    unsigned char byte;
} element;

/* An array of the mesh that is passed a second time, at another address and with one different element. */
typedef struct moved_array {
    const char *name;
    size_t place; /* offset of its insitu_array in insitu_mesh */
    size_t bytes; /* size of an element */
    int64_t at;   /* index of the different element */
    element value;
    const char *words; /* text that the error message contains */
} moved_array;

static const moved_array moved_arrays[] = {
    {"x", offsetof(insitu_mesh, coordinates[0]), 24, 0, {.real = NAN}, "not finite"},
    {"z", offsetof(insitu_mesh, coordinates[2]), 24, 0, {.real = NAN}, "not finite"},
    {"types", offsetof(insitu_mesh, cell_types), 1, 0, {.byte = 99}, "unknown cell type 99"},
    {"connectivity", offsetof(insitu_mesh, connectivity), 8, 0, {.index = (int64_t)1 << 40}, "1099511627776"},
    {"offsets", offsetof(insitu_mesh, offsets), 8, 1, {.index = (int64_t)1 << 40}, "1099511627776"},
    {"face offsets", offsetof(insitu_mesh, face_offsets), 8, 1, {.index = (int64_t)1 << 40}, "1099511627776"},
    {"faces", offsetof(insitu_mesh, face_connectivity), 8, 0, {.index = (int64_t)1 << 40}, "1099511627776"},
};

static int64_t get_element_count(const insitu_mesh *mesh, size_t place)
{
    if (place == offsetof(insitu_mesh, cell_types)) return mesh->cell_count;
    if (place == offsetof(insitu_mesh, connectivity)) return mesh->connectivity_count;
    if (place == offsetof(insitu_mesh, offsets)) return mesh->cell_count + 1;
    if (place == offsetof(insitu_mesh, face_offsets)) return mesh->face_count + 1;
    if (place == offsetof(insitu_mesh, face_connectivity)) return mesh->face_connectivity_count;
    return mesh->vertex_count;
}

/* Copies the array to memory of its own. Coordinates stay interleaved, so that the copy ends after one number of the
 * last element. */
static char *copy_elsewhere(insitu_mesh *mesh, const moved_array *moved)
{
    insitu_array *array = (insitu_array *)((char *)mesh + moved->place);
    const size_t bytes = (size_t)get_element_count(mesh, moved->place) * moved->bytes;
    const size_t tail = moved->bytes == 24 ? 16 : 0;
    char *copy = malloc(bytes);
    assert_non_null(copy);
    memcpy(copy, array->data, bytes - tail);
    array->data = copy;
    return copy;
}

static void corrupted_reallocated_arrays_are_reported(void **context)
{
    (void)context;
    for (size_t i = 0; i < sizeof moved_arrays / sizeof moved_arrays[0]; i++) {
        const moved_array *moved = &moved_arrays[i];
        insitu_session *session = open_and_draw();
        insitu_mesh mesh = input.mesh;
        mesh.changed = INSITU_CHANGED_NOTHING;
        char *copy = copy_elsewhere(&mesh, moved);
        memcpy(copy + (size_t)moved->at * moved->bytes, &moved->value, moved->bytes == 1 ? 1 : 8);
        everywhere(insitu_set_mesh(session, "m", &mesh) == INSITU_OK);
        const insitu_status status = insitu_step(session, 1, 0);
        check_reported_everywhere(session, status, INSITU_ERROR_MESH, "rank 0: mesh \"m\": cell", moved->words);
        insitu_destroy(&session);
        free(copy);
    }
}

/* ---- other pictures ------------------------------------------------------------------------------------------- */

/* Checks that the picture of the session's next step equals that of a fresh session, to which all present arrays are
 * passed. */
static void check_next_picture(insitu_session *session, const session_input *now, insitu_session *fresh)
{
    const size_t pixels = (size_t)48 * 36;
    caught_picture first = {0};
    check_step_succeeds(session, 1);
    if (own_rank == 0) first = caught[0], caught_count = 0;
    everywhere(submit_input(fresh, now) == INSITU_OK);
    check_step_succeeds(fresh, 0);
    everywhere(own_rank != 0 || !memcmp(first.rgba, caught[0].rgba, 4 * pixels * sizeof(float)));
    free(first.rgba);
    free(first.depth);
}

/* Checks the picture after arrays have moved to another address. Only the mesh (or, if is_field, only the field) is set
 * again, and is declared unchanged; now is the input with the new addresses. */
static void check_picture(const session_input *now, bool is_field)
{
    insitu_session *session = open_and_draw(), *fresh = open_session(MPI_COMM_WORLD, scene);
    session_input unchanged = *now;
    unchanged.mesh.changed = unchanged.field.changed = INSITU_CHANGED_NOTHING;
    everywhere((is_field ? insitu_set_field(session, "m", &unchanged.field)
                         : insitu_set_mesh(session, "m", &unchanged.mesh)) == INSITU_OK);
    check_next_picture(session, now, fresh);
    insitu_destroy(&session);
    insitu_destroy(&fresh);
}

static void reallocated_vertices_are_drawn_at_new_positions(void **context)
{
    (void)context;
    session_input now = input;
    const size_t count = 3 * (size_t)input.part.vertex_count;
    double *moved = malloc(count * sizeof *moved);
    assert_non_null(moved);
    /* so far away that the session changes the origin of its coordinates, as a fresh session chooses it */
    for (size_t i = 0; i < count; i++) moved[i] = 64 * input.part.coordinates[i];
    insitu_mesh_interleaved(&now.mesh, moved, INSITU_FLOAT64);
    check_picture(&now, false);
    free(moved);
}

static void reallocated_cells_are_drawn_with_their_fields(void **context)
{
    (void)context;
    session_input now = input;
    unsigned char *ghosts = malloc((size_t)input.part.cell_count);
    assert_non_null(ghosts);
    for (int64_t cell = 0; cell < input.part.cell_count; cell++) ghosts[cell] = cell % 2 != 0;
    now.mesh.ghosts.data = ghosts;
    check_picture(&now, false);
    free(ghosts);
}

static void reallocated_values_are_drawn(void **context)
{
    (void)context;
    session_input now = input;
    double *values = malloc(2 * (size_t)input.part.vertex_count * sizeof *values);
    assert_non_null(values);
    for (int64_t v = 0; v < input.part.vertex_count; v++) {
        values[2 * v] = -input.part.values[v];
        values[2 * v + 1] = input.part.values[v] + 1;
    }
    now.field.values = (insitu_array){values, INSITU_FLOAT64, 16};
    check_picture(&now, true);
    now.field.values.data = values + 1;
    check_picture(&now, true);
    free(values);
}

static void invert_values(void)
{
    for (int64_t v = 0; v < input.part.vertex_count; v++) input.part.values[v] = 0.5 - input.part.values[v];
}

/* Checks values that change in place although they are declared unchanged or are not set again: the new values are
 * drawn, and a warning is given. */
static void undeclared_value_changes_are_reported(void **context)
{
    (void)context;
    static const char words[] = "mesh \"m\": field \"f\" has other values than in the last picture";
    for (int is_set = 0; is_set < 2; is_set++) {
        insitu_session *session = open_and_draw(), *fresh = open_session(MPI_COMM_WORLD, scene);
        invert_values();
        insitu_field unchanged = input.field;
        unchanged.changed = INSITU_CHANGED_NOTHING;
        everywhere(!is_set || insitu_set_field(session, "m", &unchanged) == INSITU_OK);
        check_next_picture(session, &input, fresh);
        everywhere(strstr(insitu_last_report(session)->warnings, words) != NULL);
        check_step_succeeds(session, 2);
        everywhere(!*insitu_last_report(session)->warnings);
        invert_values();
        everywhere(insitu_set_field(session, "m", &input.field) == INSITU_OK);
        check_next_picture(session, &input, fresh);
        everywhere(!*insitu_last_report(session)->warnings);
        insitu_destroy(&session);
        insitu_destroy(&fresh);
    }
}

static int set_up_test_group(void **state)
{
    (void)state;
    create_input();
    scene = write_scene(scene_text);
    return 0;
}

static int tear_down_test_group(void **state)
{
    (void)state;
    input_free(&input);
    return 0;
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(corrupted_reallocated_arrays_are_reported),
        cmocka_unit_test(reallocated_vertices_are_drawn_at_new_positions),
        cmocka_unit_test(reallocated_cells_are_drawn_with_their_fields),
        cmocka_unit_test(reallocated_values_are_drawn),
        cmocka_unit_test(undeclared_value_changes_are_reported),
    };
    return run_session_tests(argc, argv, tests, set_up_test_group, tear_down_test_group);
}
