/* Checks that arrays of any type, address and stride draw the same picture as the same numbers in float64 and int64:
 * arrays of cells and faces, flags, coordinates, and values whose components are interleaved or separate. The number of
 * copied bytes must not increase for arrays that can be read in place. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "test_session_fixture.h"

enum { SIDE = 2, MOST_ROOMS = 64 };

/* The memory layout of an array. */
typedef struct layout {
    insitu_type type;
    int shift; /* offset of the first element from an aligned address, in bytes */
    int gap;   /* bytes between elements */
    bool is_in_place;
} layout;

static const layout index_layouts[] = {
    {INSITU_INT32, 0, 0, true},   {INSITU_INT32, 0, 4, true},   {INSITU_INT64, 0, 8, true},
    {INSITU_UINT32, 0, 0, true},  {INSITU_UINT64, 0, 0, true},  {INSITU_UINT64, 0, 16, true},
    {INSITU_INT8, 0, 0, false},   {INSITU_UINT8, 0, 0, false},  {INSITU_UINT8, 1, 2, false},
    {INSITU_INT16, 0, 0, false},  {INSITU_UINT16, 0, 0, false}, {INSITU_UINT16, 1, 0, false},
    {INSITU_INT32, 1, 0, false},  {INSITU_INT32, 0, 3, false},  {INSITU_INT64, 4, 0, false},
    {INSITU_UINT32, 2, 0, false}, {INSITU_UINT64, 3, 1, false},
};
static const layout number_layouts[] = {
    {INSITU_FLOAT64, 0, 8, true}, {INSITU_FLOAT64, 4, 0, false}, {INSITU_FLOAT64, 0, 1, false},
    {INSITU_INT8, 0, 0, false},   {INSITU_INT16, 1, 0, false},   {INSITU_INT16, 0, 0, false},
    {INSITU_INT32, 0, 0, false},  {INSITU_INT32, 3, 5, false},   {INSITU_INT64, 0, 0, false},
    {INSITU_FLOAT32, 0, 0, true}, {INSITU_FLOAT32, 2, 0, false},
};
enum {
    INDEX_LAYOUTS = sizeof index_layouts / sizeof index_layouts[0],
    NUMBER_LAYOUTS = sizeof number_layouts / sizeof number_layouts[0]
};

static const char scene[] = "images:\n"
                            "  - name: a\n"
                            "    size: [40, 32]\n"
                            "    camera: {automatic: {direction: [1, 0.7, 0.9]}}\n"
                            "    layers:\n"
                            "      - isosurface: {field: f, values: [3]}\n"
                            "      - surface: {colour_by: {field: f}, opacity: 0.3}\n"
                            "      - volume: {field: f, range: [-50, 50], opacity: [[0, 0.4], [1, 0]]}\n"
                            "    outputs: [{path: a.png}]\n";

static void *rooms[MOST_ROOMS];
static int room_count;

static void free_memory_blocks(void)
{
    while (room_count) free(rooms[--room_count]);
}

static double read_number(const insitu_array *a, int64_t i)
{
    if (a->type == INSITU_UINT8) return ((const unsigned char *)a->data)[i];
    if (a->type == INSITU_INT64) return (double)((const int64_t *)a->data)[i];
    return ((const double *)a->data)[i];
}

#define PUT(type)                                                                                                      \
    {                                                                                                                  \
        const type number = (type)value;                                                                               \
        memcpy(out, &number, sizeof number);                                                                           \
        return (double)number == value;                                                                                \
    }

/* Stores a number as the given type; returns false if the type cannot represent it. */
static bool store_number(char *out, insitu_type type, double value)
{
    switch (type) {
    case INSITU_FLOAT32: PUT(float)
    case INSITU_FLOAT64: PUT(double)
    case INSITU_INT8:
        if (fabs(value) > 127) return false;
        PUT(int8_t)
    case INSITU_UINT8:
        if (value < 0 || value > 255) return false;
        PUT(uint8_t)
    case INSITU_INT16: PUT(int16_t)
    case INSITU_UINT16:
        if (value < 0) return false;
        PUT(uint16_t)
    case INSITU_INT32: PUT(int32_t)
    case INSITU_UINT32:
        if (value < 0) return false;
        PUT(uint32_t)
    case INSITU_INT64: PUT(int64_t)
    case INSITU_UINT64:
        if (value < 0) return false;
        PUT(uint64_t)
    }
    return false;
}

static int64_t get_type_size(insitu_type type)
{
    static const int sizes[] = {0, 4, 8, 4, 8, 1, 1, 2, 2, 4, 8};
    return sizes[type];
}

/* Stores an array of float64, int64 or uint8 in another layout; returns false if the layout's type cannot represent the
 * numbers. */
static bool convert_array(insitu_array *a, int64_t count, const layout *as)
{
    const int64_t stride = get_type_size(as->type) + as->gap;
    if (!a->data) return true;
    char *room = malloc((size_t)(count * stride + as->shift + 16)); /* malloc aligns the block to 16 bytes */
    assert_true(room && room_count < MOST_ROOMS);
    rooms[room_count++] = room;
    bool fits = true;
    for (int64_t i = 0; i < count && fits; i++)
        fits = store_number(room + as->shift + i * stride, as->type, read_number(a, i));
    *a = (insitu_array){room + as->shift, as->type, as->gap ? stride : 0};
    return fits;
}

static bool is_true_on_all_ranks(bool here)
{
    int all = here;
    MPI_Allreduce(MPI_IN_PLACE, &all, 1, MPI_INT, MPI_MIN, MPI_COMM_WORLD);
    return all;
}

/* Creates an input whose coordinates and values are integers, so that every type can represent them. */
static void create_integer_input(session_input *in, test_mesh_kind kind)
{
    input_create(in, kind, SIDE, TEST_BLOCK, own_rank, rank_count);
    for (int64_t i = 0; i < 3 * in->part.vertex_count; i++)
        in->part.coordinates[i] = rint(100 * in->part.coordinates[i]);
    for (int64_t i = 0; i < in->part.vertex_count; i++) in->part.values[i] = rint(30 * in->part.values[i]);
    for (int64_t i = 0; i < in->part.cell_count; i++) in->part.ghosts[i] = i % 7 == 3;
    input_describe(in);
}

/* Draws the input. Returns the picture, and in *copied the number of bytes that the step copied. */
static caught_picture draw_and_count_copies(const char *path, const session_input *in, int64_t *copied)
{
    discard_pictures();
    insitu_session *session = open_session_and_draw(MPI_COMM_WORLD, path, in);
    *copied = insitu_last_report(session)->bytes_copied;
    everywhere(in->part.cell_count == 0 || insitu_last_report(session)->bytes_borrowed > 0);
    insitu_destroy(&session);
    return pop_caught_picture();
}

/* Draws the input and compares the picture with the expected one. If is_in_place is set, no more bytes may be copied
 * than for the expected picture. */
static void check_same_picture(const char *path, const session_input *in, const caught_picture *truth, int64_t copied,
                               bool is_in_place)
{
    int64_t own;
    caught_picture picture = draw_and_count_copies(path, in, &own);
    const bool is_same = own_rank || are_same_pictures(&picture, truth);
    everywhere(is_same);
    everywhere(is_in_place ? own <= copied : own > 0 || own == copied);
    free_caught(&picture);
}

static bool convert_cells(insitu_mesh *m, const layout *as)
{
    const int64_t end = m->open_offsets ? 0 : 1;
    bool fits = convert_array(&m->connectivity, m->connectivity_count, as);
    fits = convert_array(&m->offsets, m->cell_count + end, as) && fits;
    fits = convert_array(&m->face_offsets, m->face_count + end, as) && fits;
    return convert_array(&m->face_connectivity, m->face_connectivity_count, as) && fits;
}

static void index_type_changes_no_picture(void **state)
{
    (void)state;
    static const test_mesh_kind kinds[] = {TEST_HEXES, TEST_MIXED, TEST_POLYHEDRA};
    const char *path = write_scene(scene);
    int drawn = 0;
    for (int k = 0; k < 3; k++) {
        session_input in;
        int64_t copied;
        create_integer_input(&in, kinds[k]);
        caught_picture truth = draw_and_count_copies(path, &in, &copied);
        for (int i = 0; i < 2 * INDEX_LAYOUTS; i++) {
            const layout *as = &index_layouts[i / 2];
            input_describe(&in);
            in.mesh.open_offsets = i % 2;
            const bool fits = is_true_on_all_ranks(convert_cells(&in.mesh, as));
            if (fits) check_same_picture(path, &in, &truth, copied, as->is_in_place);
            drawn += fits;
            free_memory_blocks();
        }
        free_caught(&truth);
        input_free(&in);
    }
    everywhere(drawn > 60);
}

/* Checks types and flags in all layouts: cell types are VTK's numbers, or other numbers with a map, and the lowest byte
 * of flags is 0. */
static void type_of_types_and_flags_changes_no_picture(void **state)
{
    (void)state;
    static int map[60];
    const char *path = write_scene(scene);
    session_input in;
    int64_t copied;
    create_integer_input(&in, TEST_MIXED);
    caught_picture truth = draw_and_count_copies(path, &in, &copied);
    for (int type = 0; type < 60; type++) map[type] = (type + 25) % 60;
    for (int i = 0; i < 2 * INDEX_LAYOUTS; i++) {
        const layout *as = &index_layouts[i / 2];
        double flag = as->type == INSITU_INT8 || as->type == INSITU_UINT8 ? 1 : 256;
        input_describe(&in);
        convert_array(&in.mesh.ghosts, in.mesh.cell_count, as);
        for (int64_t c = 0; c < in.mesh.cell_count; c++) {
            char *to = (char *)(uintptr_t)in.mesh.ghosts.data + c * (get_type_size(as->type) + as->gap);
            store_number(to, as->type, in.part.ghosts[c] ? flag : 0);
            /* applies the inverse of the map, which adds 25 modulo 60 */
            if (i % 2) in.part.types[c] = (unsigned char)((in.part.types[c] + 35) % 60);
        }
        if (i % 2) in.mesh.cell_type_map = map;
        if (i % 2) in.mesh.cell_type_map_count = 60;
        everywhere(convert_array(&in.mesh.cell_types, in.mesh.cell_count, as));
        check_same_picture(path, &in, &truth, copied, false);
        for (int64_t c = 0; c < in.mesh.cell_count && i % 2; c++)
            in.part.types[c] = (unsigned char)map[in.part.types[c]];
        free_memory_blocks();
    }
    free_caught(&truth);
    input_free(&in);
}

static void convert_coordinates(session_input *in, const layout *as)
{
    static double apart[3][4096];
    for (int axis = 0; axis < 3; axis++) {
        for (int64_t v = 0; v < in->mesh.vertex_count; v++) apart[axis][v] = in->part.coordinates[3 * v + axis];
        in->mesh.coordinates[axis] = (insitu_array){apart[axis], INSITU_FLOAT64, 0};
        everywhere(convert_array(&in->mesh.coordinates[axis], in->mesh.vertex_count, as));
    }
}

static void coordinate_type_changes_no_picture(void **state)
{
    (void)state;
    const char *path = write_scene(scene);
    session_input in;
    int64_t copied;
    create_integer_input(&in, TEST_MIXED);
    caught_picture truth = draw_and_count_copies(path, &in, &copied);
    for (int i = 0; i < NUMBER_LAYOUTS; i++) {
        input_describe(&in);
        convert_coordinates(&in, &number_layouts[i]);
        check_same_picture(path, &in, &truth, copied, number_layouts[i].is_in_place);
        free_memory_blocks();
    }
    free_caught(&truth);
    input_free(&in);
}

/* Checks that values of any type are read in place. */
static void value_type_changes_no_picture(void **state)
{
    (void)state;
    const char *path = write_scene(scene);
    session_input in;
    int64_t copied;
    for (int k = 0; k < 2; k++) {
        create_integer_input(&in, k ? TEST_TETS : TEST_MIXED);
        caught_picture truth = draw_and_count_copies(path, &in, &copied);
        for (int i = 0; i < NUMBER_LAYOUTS; i++) {
            input_describe(&in);
            everywhere(convert_array(&in.field.values, in.field.count, &number_layouts[i]));
            check_same_picture(path, &in, &truth, copied, true);
            free_memory_blocks();
        }
        free_caught(&truth);
        input_free(&in);
    }
}

/* ---- components -------------------------------------------------------------------------------------------------- */

static const char vector_scene[] = "images:\n"
                                   "  - name: a\n"
                                   "    size: [40, 32]\n"
                                   "    camera: {automatic: {direction: [1, 0.7, 0.9]}}\n"
                                   "    layers:\n"
                                   "      - isosurface: {field: f, component: 1, values: [3]}\n"
                                   "      - surface: {colour_by: {field: f, component: magnitude}, opacity: 0.3}\n"
                                   "      - volume: {field: e, range: [-50, 50], opacity: [[0, 0.4], [1, 0]]}\n"
                                   "    outputs: [{path: a.png}]\n"
                                   "fields: {e: 'f.2 + mag(f)'}\n";

enum { COMPONENTS = 3 };

/* Layouts of the vector field. The expected picture is drawn from packed tuples. */
typedef enum vector_form { TUPLES, APART, APART_BY_INDEX, UNALIGNED_TUPLES, TUPLES_BY_INDEX, VECTOR_FORMS } vector_form;

static insitu_array components[COMPONENTS];

static void make_field(vector_form form, insitu_centring centring, session_input *in)
{
    static const layout apart[COMPONENTS] = {
        {INSITU_FLOAT64, 0, 8, true}, {INSITU_INT16, 1, 0, true}, {INSITU_FLOAT64, 3, 2, true}};
    static const layout packed = {INSITU_FLOAT64, 5, 0, true}, aligned = {INSITU_FLOAT64, 0, 0, true};
    static double tuples[3 * 4096], one[COMPONENTS][4096], numbers[4096];
    const bool by_index = form == APART_BY_INDEX || form == TUPLES_BY_INDEX;
    const int64_t count = centring == INSITU_VERTEX ? in->part.vertex_count : in->part.cell_count;
    insitu_field_defaults(&in->field);
    in->field.name = "f";
    in->field.centring = centring;
    in->field.count = count;
    in->field.component_count = COMPONENTS;
    for (int64_t i = 0; i < count; i++) {
        const int64_t at = by_index ? count - 1 - i : i;
        numbers[i] = (double)at;
        for (int c = 0; c < COMPONENTS; c++)
            tuples[3 * at + c] = one[c][at] = rint(test_uniform_between((uint64_t)(3 * i + c), 11, -40, 40));
    }
    if (form == APART || form == APART_BY_INDEX) {
        for (int c = 0; c < COMPONENTS; c++) {
            components[c] = (insitu_array){one[c], INSITU_FLOAT64, 0};
            convert_array(&components[c], count, &apart[c]);
        }
        in->field.components = components;
    } else {
        in->field.values = (insitu_array){tuples, INSITU_FLOAT64, 0};
        convert_array(&in->field.values, COMPONENTS * count, form == UNALIGNED_TUPLES ? &packed : &aligned);
    }
    static const layout index = {INSITU_INT64, 0, 0, true};
    if (by_index) in->field.index = (insitu_array){numbers, INSITU_FLOAT64, 0};
    if (by_index) convert_array(&in->field.index, count, &index);
}

static void separate_components_draw_the_same_picture(void **state)
{
    (void)state;
    const char *path = write_scene(vector_scene);
    for (int k = 0; k < 4; k++) {
        session_input in;
        int64_t copied;
        const insitu_centring centring = k % 2 ? INSITU_CELL : INSITU_VERTEX;
        create_integer_input(&in, k / 2 ? TEST_POLYHEDRA : TEST_MIXED);
        make_field(TUPLES, centring, &in);
        caught_picture truth = draw_and_count_copies(path, &in, &copied);
        for (vector_form form = APART; form < VECTOR_FORMS; form++) {
            make_field(form, centring, &in);
            check_same_picture(path, &in, &truth, copied, form == APART || form == UNALIGNED_TUPLES);
            free_memory_blocks();
        }
        free_caught(&truth);
        input_free(&in);
        free_memory_blocks();
    }
}

/* Checks that a field is read correctly if it is set in each step with the same values, declared as changed or
 * unchanged, and if the caller overwrites the table of components after the call. */
static void components_can_be_set_again(void **state)
{
    (void)state;
    static const char recentred[] = "images:\n"
                                    "  - name: a\n"
                                    "    size: [40, 32]\n"
                                    "    layers:\n"
                                    "      - isosurface: {field: f, component: magnitude, values: [30]}\n"
                                    "    outputs: [{path: a.png}]\n";
    session_input in;
    create_integer_input(&in, TEST_MIXED);
    make_field(APART, INSITU_CELL, &in);
    insitu_session *session = open_session_and_draw(MPI_COMM_WORLD, write_scene(recentred), &in);
    caught_picture first = pop_caught_picture();
    for (int step = 1; step < 4; step++) {
        insitu_array again[COMPONENTS];
        memcpy(again, components, sizeof again);
        in.mesh.changed = INSITU_CHANGED_NOTHING;
        in.field.changed = step == 2 ? INSITU_CHANGED_VALUES : INSITU_CHANGED_NOTHING;
        in.field.components = again;
        everywhere(submit_input(session, &in) == INSITU_OK);
        memset(again, 0, sizeof again);
        check_step_succeeds(session, step);
        caught_picture picture = pop_caught_picture();
        const bool is_same = own_rank || are_same_pictures(&picture, &first);
        everywhere(is_same);
        free_caught(&picture);
    }
    free_caught(&first);
    insitu_destroy(&session);
    free_memory_blocks();
    input_free(&in);
}

/* Checks a session whose arrays change their layout from step to step, and then get new coordinates: it must draw the
 * same pictures as a session whose arrays are always float64. */
static void forms_can_change_between_steps(void **state)
{
    (void)state;
    static const layout forms[] = {{INSITU_INT8, 0, 0, false},
                                   {INSITU_FLOAT64, 0, 0, true},
                                   {INSITU_FLOAT64, 4, 0, false},
                                   {INSITU_INT32, 0, 0, false},
                                   {INSITU_INT8, 1, 1, false}};
    const char *path = write_scene(scene);
    session_input in;
    create_integer_input(&in, TEST_MIXED);
    insitu_session *session = open_session(MPI_COMM_WORLD, path), *plain = open_session(MPI_COMM_WORLD, path);
    for (int step = 0; step < 10; step++) {
        for (int64_t i = 0; i < in.part.vertex_count && step == 5; i++) in.part.coordinates[3 * i] += 3;
        caught_picture pictures[2];
        for (int k = 0; k < 2; k++) {
            input_describe(&in);
            in.mesh.changed = INSITU_CHANGED_GEOMETRY;
            if (k) convert_coordinates(&in, &forms[step % 5]);
            if (k) everywhere(convert_array(&in.field.values, in.field.count, &forms[step % 5]));
            everywhere(submit_input(k ? session : plain, &in) == INSITU_OK);
            check_step_succeeds(k ? session : plain, step);
            pictures[k] = pop_caught_picture();
        }
        const bool is_same = own_rank || are_same_pictures(&pictures[0], &pictures[1]);
        everywhere(is_same);
        for (int k = 0; k < 2; k++) free_caught(&pictures[k]);
        if (room_count > MOST_ROOMS - 8) free_memory_blocks(); /* a session reads arrays until its next step */
    }
    insitu_destroy(&session);
    insitu_destroy(&plain);
    free_memory_blocks();
    input_free(&in);
}

/* ---- faults ------------------------------------------------------------------------------------------------------ */

static const int short_map[] = {0, INSITU_TET, INSITU_HEX};

static void remove_value_type(session_input *in)
{
    for (int64_t i = 0; i < in->part.cell_count; i++) in->part.types[i] = (unsigned char)(i == 3 ? 7 : 2);
    in->mesh.cell_type_map = short_map;
    in->mesh.cell_type_map_count = 3;
}

static void remove_type_map(session_input *in)
{
    in->mesh.cell_type_map_count = 3;
}

static void set_half_open_offsets(session_input *in)
{
    in->mesh.open_offsets = 2;
}

static void lengthen_last_cell(session_input *in)
{
    in->mesh.open_offsets = 1;
    in->mesh.connectivity_count++;
}

static void set_values_twice(session_input *in)
{
    components[0] = in->field.values;
    in->field.components = components;
}

static void remove_component(session_input *in)
{
    components[0] = in->field.values;
    components[1] = components[2] = (insitu_array){NULL, INSITU_FLOAT64, 0};
    in->field.values.data = NULL;
    in->field.component_count = 2;
    in->field.components = components;
}

static void set_component_without_type(session_input *in)
{
    remove_component(in);
    components[1] = components[0];
    components[1].type = (insitu_type)77;
}

static const corrupted_case faults[] = {
    {"no type", remove_value_type, INSITU_ERROR_MESH, false, {"cell 3", "type 7"}},
    {"no map",
     remove_type_map,
     INSITU_ERROR_ARGUMENT,
     true,
     {"cell_type_map_count is 3, and cell_type_map is not given"}},
    {"open", set_half_open_offsets, INSITU_ERROR_ARGUMENT, true, {"open_offsets is 2, expected 0 or 1"}},
    {"long", lengthen_last_cell, INSITU_ERROR_MESH, false, {"offsets", "do not lie 8 apart"}},
    {"twice", set_values_twice, INSITU_ERROR_FIELD, true, {"values and components are given"}},
    {"no component", remove_component, INSITU_ERROR_FIELD, true, {"component 1: values are not given"}},
    {"no type",
     set_component_without_type,
     INSITU_ERROR_ARGUMENT,
     true,
     {"component 1: values are of element type 77"}},
};

static void faults_are_reported_on_all_ranks(void **state)
{
    (void)state;
    session_input in;
    input_create(&in, TEST_HEXES, 4, TEST_BLOCK, own_rank, rank_count);
    check_all_faults_are_reported(&in, faults, sizeof faults / sizeof faults[0]);
    input_free(&in);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(index_type_changes_no_picture),
        cmocka_unit_test(type_of_types_and_flags_changes_no_picture),
        cmocka_unit_test(coordinate_type_changes_no_picture),
        cmocka_unit_test(value_type_changes_no_picture),
        cmocka_unit_test(separate_components_draw_the_same_picture),
        cmocka_unit_test(components_can_be_set_again),
        cmocka_unit_test(forms_can_change_between_steps),
        cmocka_unit_test(faults_are_reported_on_all_ranks),
    };
    return run_session_tests(argc, argv, tests, NULL, NULL);
}
