/* Checks fields whose values are in another order than the mesh's vertices or cells, like vectors of degrees of
 * freedom, and are found by an index. Pictures must be bit-identical to those of the same values in the mesh's order,
 * at each step and after the values change. An error in one rank's index must be reported on all ranks. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "test_meshes.h"
#include "test_session_fixture.h"

enum { SIDE = 4, PIXELS = 64 * 48, PICTURES = 4, STEPS = 4 };

/* If an image has a condition, the field's values are read before it is decided which images are drawn. */
#define SCENE(condition)                                                                                               \
    "images:\n  - name: a\n    size: [64, 48]\n    background: [0, 0, 0, 0]\n    layers:\n"                            \
    "      - isosurface: {field: f, values: [0.1, 0.3], opacity: 0.6, colour_by: {field: f, map: turbo}}\n"            \
    "      - surface: {opacity: 0.2, edges: {}, colour_by: {field: f}}\n"                                              \
    "      - slice: {field: f, planes: [{normal: [1, 2, 3]}]}\n"                                                       \
    "    outputs: [{path: a.exr}]\n"                                                                                   \
    "  - name: b\n    size: [64, 48]\n    layers: [{isosurface: {field: f, values: [0.1]}}]\n"                         \
    "    outputs: [{path: b.exr}]\n"                                                                                   \
    "  - name: c\n    size: [64, 48]\n    layers: [{volume: {field: f}}]\n" condition "    outputs: [{path: c.exr}]\n" \
    "  - name: d\n    size: [64, 48]\n    layers: [{surface: {threshold: {field: f, from: 0.05}}}]\n"                  \
    "    outputs: [{path: d.exr}]\n"

static const char scene_text[] = SCENE("");
static const char conditional_scene[] = SCENE("    when: {field: f, above: -5}\n");

/* ---- fields --------------------------------------------------------------------------------------------------- */

typedef struct form {
    bool at_cells, is_narrow; /* is_narrow: values are float and indices int32, which are separated by other numbers */
    int components, base;
} form;

/* One field in two forms: values in the mesh's order (plain), and an index into a longer array (shuffled) whose other
 * values are NaN. */
typedef struct twice {
    form of;
    int64_t places, count;
    char *plain, *shuffled, *index;
} twice;

static double compute_value(const session_input *in, const form *of, int64_t place, int component)
{
    const double own = of->at_cells ? test_uniform_between((uint64_t)place + 1, 5, -1, 1) : in->part.values[place];
    return component ? own * component - 0.2 : own;
}

static void set_number(const form *of, char *array, int64_t i, double value)
{
    if (of->is_narrow)
        ((float *)(void *)array)[i] = (float)value;
    else
        ((double *)(void *)array)[i] = value;
}

static void set_index(const form *of, char *array, int64_t i, int64_t value)
{
    if (of->is_narrow)
        ((int32_t *)(void *)array)[2 * i] = (int32_t)value, ((int32_t *)(void *)array)[2 * i + 1] = -7;
    else
        ((int64_t *)(void *)array)[i] = value;
}

static void fill_values(twice *t, const session_input *in, double scale)
{
    const form *of = &t->of;
    for (int64_t i = 0; i < t->count * of->components; i++) set_number(of, t->shuffled, i, (double)NAN);
    for (int64_t i = 0; i < t->places; i++) {
        const int64_t at = t->count - 1 - 2 * i - i % 2; /* backwards, with gaps; no two values have the same index */
        set_index(of, t->index, i, at + of->base);
        for (int c = 0; c < of->components; c++) {
            const double value = scale * compute_value(in, of, i, c);
            set_number(of, t->plain, i * of->components + c, value);
            set_number(of, t->shuffled, at * of->components + c, value);
        }
    }
}

static twice create_indexed_field(const session_input *in, const form *of)
{
    const int64_t places = of->at_cells ? in->part.cell_count : in->part.vertex_count, count = 2 * places + 3;
    const size_t tuple = sizeof(double) * (size_t)of->components;
    twice t = {
        *of, places, count, malloc(tuple * (size_t)count), malloc(tuple * (size_t)count), malloc(8 * (size_t)count)};
    assert_true(t.plain && t.shuffled && t.index);
    fill_values(&t, in, 1);
    return t;
}

static void free_twice(twice *t)
{
    free(t->plain), free(t->shuffled), free(t->index);
}

static insitu_field describe_field(const twice *t, bool is_by_index)
{
    insitu_field field;
    insitu_field_defaults(&field);
    field.name = "f";
    field.centring = t->of.at_cells ? INSITU_CELL : INSITU_VERTEX;
    field.component_count = t->of.components;
    field.count = is_by_index ? t->count : t->places;
    field.values =
        (insitu_array){is_by_index ? t->shuffled : t->plain, t->of.is_narrow ? INSITU_FLOAT32 : INSITU_FLOAT64, 0};
    if (is_by_index) field.index = (insitu_array){t->index, t->of.is_narrow ? INSITU_INT32 : INSITU_INT64, 8};
    return field;
}

/* ---- pictures ------------------------------------------------------------------------------------------------- */

typedef struct drawing {
    caught_picture pictures[STEPS][PICTURES];
    int64_t copied, borrowed;
    bool gives_reason;
} drawing;

static void make_indices_one_based(session_input *in)
{
    test_mesh *part = &in->part;
    for (int64_t i = 0; i < part->connectivity_count; i++) part->connectivity[i]++;
    for (int64_t i = 0; i <= part->cell_count; i++) part->offsets[i]++;
    for (int64_t i = 0; i <= part->face_count && part->face_count; i++) part->face_offsets[i]++;
    for (int64_t i = 0; i < part->face_connectivity_count; i++) part->face_connectivity[i]++;
    in->mesh.index_base = 1;
}

static void step_and_catch(insitu_session *session, int cycle, caught_picture out[PICTURES])
{
    discard_pictures();
    const insitu_status status = insitu_step(session, cycle, 0);
    if (status) fprintf(stderr, "%s\n", insitu_error(session));
    everywhere(status == INSITU_OK);
    everywhere(own_rank != 0 || caught_count == PICTURES);
    for (int i = 0; i < PICTURES && own_rank == 0; i++) out[i] = caught[i];
    caught_count = 0;
}

/* Draws four steps: the values as they are, halved in the same arrays, declared unchanged, and restored. */
static drawing draw_fields(const session_input *in, twice *t, bool is_by_index)
{
    drawing out = {.copied = 0};
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(t->of.base ? conditional_scene : scene_text));
    insitu_field field = describe_field(t, is_by_index);
    everywhere(insitu_set_mesh(session, "m", &in->mesh) == INSITU_OK);
    for (int step = 0; step < STEPS; step++) {
        fill_values(t, in, step % 3 ? 0.5 : 1);
        field.changed = step == 2 ? INSITU_CHANGED_NOTHING : INSITU_CHANGED_VALUES;
        const insitu_status status = insitu_set_field(session, "m", &field);
        if (status) fprintf(stderr, "%s\n", insitu_error(session));
        everywhere(status == INSITU_OK);
        step_and_catch(session, step, out.pictures[step]);
    }
    const insitu_report *report = insitu_last_report(session);
    out.copied = report->bytes_copied;
    out.borrowed = report->bytes_borrowed;
    out.gives_reason = strstr(report->copied_why, "field \"f\" by its index: ") != NULL;
    insitu_destroy(&session);
    return out;
}

static void compare_drawings(drawing *a, drawing *b)
{
    bool same = true, differ = own_rank != 0;
    for (int step = 0; step < STEPS && own_rank == 0; step++)
        for (int i = 0; i < PICTURES; i++) {
            same = same && are_same_pictures(&a->pictures[step][i], &b->pictures[step][i]);
            differ = differ || !are_same_pictures(&a->pictures[0][i], &a->pictures[step][i]);
        }
    everywhere(same);
    everywhere(differ); /* some later picture differs from that of the first step */
    for (int step = 0; step < STEPS && own_rank == 0; step++)
        for (int i = 0; i < PICTURES; i++) {
            free(a->pictures[step][i].rgba), free(a->pictures[step][i].depth);
            free(b->pictures[step][i].rgba), free(b->pictures[step][i].depth);
        }
}

static void check_form(test_mesh_kind kind, const form *of)
{
    session_input in = {0};
    input_create(&in, kind, SIDE, TEST_RANDOM, own_rank, rank_count);
    if (of->base) make_indices_one_based(&in);
    twice t = create_indexed_field(&in, of);
    drawing plain = draw_fields(&in, &t, false), indexed = draw_fields(&in, &t, true);
    const int64_t size = of->is_narrow ? 4 : 8, tuples = size * of->components;
    everywhere(indexed.copied == plain.copied + t.places * tuples);
    everywhere(indexed.borrowed == plain.borrowed + (t.count - t.places) * tuples + t.places * size);
    everywhere(indexed.gives_reason && !plain.gives_reason);
    compare_drawings(&plain, &indexed);
    free_twice(&t);
    input_free(&in);
}

static void indexed_values_draw_same_picture_as_ordered_values(void **state)
{
    (void)state;
    static const form forms[] = {{false, false, 1, 0}, {false, true, 1, 1},  {true, false, 1, 1},
                                 {true, true, 1, 0},   {false, false, 3, 0}, {true, true, 2, 0}};
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++)
        for (size_t i = 0; i < sizeof forms / sizeof forms[0]; i++) check_form(kind, &forms[i]);
}

/* Checks that a field which no layer uses is neither copied nor checked. */
static void unused_index_is_not_read(void **state)
{
    (void)state;
    session_input in = {0};
    input_create(&in, TEST_HEXES, SIDE, TEST_RANDOM, own_rank, rank_count);
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(scene_text));
    twice t = create_indexed_field(&in, &(form){false, false, 1, 0});
    insitu_field other = describe_field(&t, true);
    other.name = "other";
    ((int64_t *)(void *)t.index)[0] = -9;
    everywhere(submit_input(session, &in) == INSITU_OK);
    everywhere(insitu_step(session, 0, 0) == INSITU_OK);
    const int64_t copied = insitu_last_report(session)->bytes_copied;
    everywhere(insitu_set_field(session, "m", &other) == INSITU_OK);
    everywhere(insitu_step(session, 1, 0) == INSITU_OK);
    everywhere(insitu_last_report(session)->bytes_copied == copied);
    discard_pictures();
    insitu_destroy(&session);
    free_twice(&t);
    input_free(&in);
}

/* ---- errors --------------------------------------------------------------------------------------------------- */

static int64_t *corrupted;

static void use_indexed_field(session_input *in)
{
    free(corrupted);
    corrupted = malloc((size_t)(in->part.vertex_count + in->part.cell_count) * sizeof *corrupted);
    assert_non_null(corrupted);
    for (int64_t i = 0; i < in->part.vertex_count + in->part.cell_count; i++) corrupted[i] = i;
    in->field.index = (insitu_array){corrupted, INSITU_INT64, 0};
}
static void set_large_index(session_input *in)
{
    use_indexed_field(in);
    corrupted[7] = in->part.vertex_count;
    corrupted[9] = -1; /* only the first error is reported */
}
static void set_far_index(session_input *in)
{
    use_indexed_field(in);
    corrupted[2] = INT64_MAX;
}
static void set_negative_index(session_input *in)
{
    use_indexed_field(in);
    corrupted[3] = -1;
}
static void set_index_before_one(session_input *in)
{
    use_indexed_field(in);
    make_indices_one_based(in);
    for (int64_t i = 1; i < in->part.vertex_count; i++) corrupted[i]++;
}
static void set_fewer_values(session_input *in)
{
    use_indexed_field(in);
    in->field.count = 5;
}
static void remove_values(session_input *in)
{
    use_indexed_field(in);
    in->field.count = 0;
}
static void set_negative_value_count(session_input *in)
{
    use_indexed_field(in);
    in->field.count = -2;
}
static void set_null_values(session_input *in)
{
    use_indexed_field(in);
    in->field.values.data = NULL;
}
static void set_float_index(session_input *in)
{
    use_indexed_field(in);
    in->field.index.type = INSITU_FLOAT64;
}
static void set_odd_stride(session_input *in)
{
    use_indexed_field(in);
    in->field.index.stride_bytes = 12;
}
static void set_type_alone(session_input *in)
{
    in->field.index.type = INSITU_INT32;
    in->field.count++;
}

static const corrupted_case cases[] = {
    {"large", set_large_index, INSITU_ERROR_FIELD, false, {"field \"f\": the index of vertex 7 is ", "outside 0.."}},
    {"far", set_far_index, INSITU_ERROR_FIELD, false, {"the index of vertex 2 is 9223372036854775807, outside 0.."}},
    {"-1",
     set_negative_index,
     INSITU_ERROR_FIELD,
     false,
     {"the index of vertex 3 is -1, outside 0..", "index_base is 0"}},
    {"0 of 1",
     set_index_before_one,
     INSITU_ERROR_FIELD,
     false,
     {"index of vertex 1 is 0, outside 1..", "index_base is 1"}},
    {"fewer", set_fewer_values, INSITU_ERROR_FIELD, false, {"the index of vertex 5 is 5, outside 0..4"}},
    {"none", remove_values, INSITU_ERROR_FIELD, false, {"the index of vertex 0 is 0, outside 0..-1"}},
    {"negative", set_negative_value_count, INSITU_ERROR_FIELD, true, {"field \"f\": has -2 values"}},
    {"NULL", set_null_values, INSITU_ERROR_FIELD, true, {"values are not given"}},
    {"float",
     set_float_index,
     INSITU_ERROR_ARGUMENT,
     true,
     {"entries of index are of element type 2, not int32 or int64"}},
    {"stride", set_odd_stride, INSITU_ERROR_FIELD, true, {"entries of index have a stride of 12 bytes"}},
    {"type alone", set_type_alone, INSITU_ERROR_FIELD, true, {"values, the mesh has "}},
};

static void wrong_input_is_reported_on_all_ranks(void **state)
{
    (void)state;
    session_input in = {0};
    input_create(&in, TEST_HEXES, 3, TEST_RANDOM, own_rank, rank_count);
    check_all_faults_are_reported(&in, cases, sizeof cases / sizeof cases[0]);
    input_free(&in);
    free(corrupted);
}

/* Checks fields at cells. The centring must be the same on all ranks, so this error cannot be tested as one of the last
 * rank only. */
static void wrong_indices_of_cell_fields_are_reported(void **state)
{
    (void)state;
    session_input in = {0};
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(error_scene));
    input_create(&in, TEST_HEXES, SIDE, TEST_RANDOM, own_rank, rank_count);
    use_indexed_field(&in);
    in.field.centring = INSITU_CELL;
    if (own_rank == rank_count - 1) corrupted[in.part.cell_count - 1] = 1000000;
    everywhere(submit_input(session, &in) == INSITU_OK);
    for (int step = 0; step < 2; step++)
        check_reported_everywhere(session, insitu_step(session, step, 0), INSITU_ERROR_FIELD,
                                  "mesh \"m\": field \"f\": the index of cell ", " is 1000000, outside 0..");
    corrupted[in.part.cell_count - 1] = 0;
    check_step_succeeds(session, 2); /* The index is corrected in place: nothing was copied. */
    insitu_destroy(&session);
    input_free(&in);
    free(corrupted);
    corrupted = NULL;
}

/* Checks ranks without vertices: the first rank has all cells, but the other ranks also pass their part of the vector
 * of values, with a NULL index. */
static void ranks_without_vertices_have_values(void **state)
{
    (void)state;
    session_input in = {0};
    double vector[4] = {1, 2, 3, 4};
    input_create(&in, TEST_HEXES, SIDE, TEST_BLOCK, own_rank, 1);
    use_indexed_field(&in);
    if (own_rank) {
        in.mesh.vertex_count = in.mesh.cell_count = in.mesh.connectivity_count = 0;
        in.mesh.offsets = in.mesh.cell_types = in.mesh.ghosts = (insitu_array){0};
        in.field.count = 4;
        in.field.values.data = vector;
        in.field.index.data = NULL;
    }
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(error_scene));
    everywhere(submit_input(session, &in) == INSITU_OK);
    check_step_succeeds(session, 0);
    insitu_destroy(&session);
    input_free(&in);
    free(corrupted);
    corrupted = NULL;
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(indexed_values_draw_same_picture_as_ordered_values),
                                       cmocka_unit_test(unused_index_is_not_read),
                                       cmocka_unit_test(ranks_without_vertices_have_values),
                                       cmocka_unit_test(wrong_indices_of_cell_fields_are_reported),
                                       cmocka_unit_test(wrong_input_is_reported_on_all_ranks)};
    return run_session_tests(argc, argv, tests, NULL, NULL);
}
