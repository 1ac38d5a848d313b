/* Checks meshes of every form and fields with random errors, on one rank or on all ranks: in counts, strides, NULL
 * pointers, types, alignment, indices, offsets, coordinates, values and options, and missing arrays. Each step must
 * either return the same error on all ranks, or draw its pictures. After the input is corrected, the next step must
 * draw the same as the first step.
 *
 * The library must be able to detect each error, so no error describes an array as longer than its memory: counts and
 * elements are made smaller, or so large that no array of this size can exist. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "test_effort.h"
#include "test_mesh_forms.h"
#include "test_mesh_make.h"

enum { SIDE = 2, CASES = 120, ALL_CASES = 3000, FAULTS = 3, MOST_PIXELS = 12 * 9 };

/* The random number generator of a case. */
typedef struct dice {
    uint64_t seed, next;
} dice;

static int64_t draw_random(dice *d, int64_t sides)
{
    return (int64_t)(test_hash(d->next++, d->seed) % (uint64_t)sides);
}

#define PICK(d, list) (list)[draw_random((d), (int64_t)(sizeof(list) / sizeof(list)[0]))]

/* ---- arrays ---------------------------------------------------------------------------------------------------- */

/* An array of the input: its description, which may be corrupted, and its correct description (truth). */
typedef struct input_array {
    insitu_array *array;
    insitu_array truth;
    int64_t count; /* correct number of elements */
    /* are_indices: elements are indices; is_table: elements are pointers, or the sizes of lists */
    bool are_indices, is_table;
} input_array;

enum { ARRAYS = 22 };

/* Lists the arrays of the input. `right` is the input before it was corrupted. */
static int list_arrays(formed_mesh *m, const formed_mesh *right, input_array *out)
{
    insitu_mesh *a = &m->mesh;
    const insitu_mesh *r = &right->mesh;
    const input_array all[ARRAYS] = {
        {&a->coordinates[0], r->coordinates[0], r->vertex_count, false, false},
        {&a->coordinates[1], r->coordinates[1], r->vertex_count, false, false},
        {&a->coordinates[2], r->coordinates[2], r->vertex_count, false, false},
        {&a->vertex_ids, r->vertex_ids, r->vertex_count, true, false},
        {&a->cell_types, r->cell_types, r->cell_count, true, false},
        {&a->connectivity, r->connectivity, r->connectivity_count, true, false},
        {&a->offsets, r->offsets, r->cell_count + 1, true, false},
        {&a->ghosts, r->ghosts, r->cell_count, true, false},
        {&a->face_offsets, r->face_offsets, r->face_count + 1, true, false},
        {&a->face_connectivity, r->face_connectivity, r->face_connectivity_count, true, false},
        {&a->owner, r->owner, r->face_count, true, false},
        {&a->neighbour, r->neighbour, r->neighbour_count, true, false},
        {&a->face_sizes, r->face_sizes, r->face_count, false, true},
        {&a->face_lists, r->face_lists, r->face_count, false, true},
        {&m->fields[FORMED_F].values, right->fields[FORMED_F].values, right->fields[FORMED_F].count, false, false},
        {&m->fields[FORMED_C].values, right->fields[FORMED_C].values, right->fields[FORMED_C].count, false, false},
        {&m->fields[FORMED_I].values, right->fields[FORMED_I].values, right->fields[FORMED_I].count, false, false},
        {&m->fields[FORMED_I].index, right->fields[FORMED_I].index, right->fields[FORMED_I].count, true, false},
        {&m->fields[FORMED_D].values, right->fields[FORMED_D].values, right->fields[FORMED_D].count, false, false},
        {&m->patch.values, right->patch.values, right->patch.count, false, false},
        {&m->patch.faces, right->patch.faces, right->patch.count, true, false},
        {&m->patch.connectivity, right->patch.connectivity, right->patch.connectivity_count, true, false},
    };
    int count = 0;
    for (int i = 0; i < ARRAYS; i++)
        if (all[i].truth.data && all[i].count > 0) out[count++] = all[i];
    return count;
}

static int64_t get_type_size(insitu_type type)
{
    return type == INSITU_UINT8 ? 1 : type == INSITU_FLOAT32 || type == INSITU_INT32 ? 4 : 8;
}

static void store_index(const input_array *a, int64_t i, int64_t value)
{
    const int64_t size = get_type_size(a->truth.type);
    char *p = (char *)(uintptr_t)a->truth.data + i * (a->truth.stride_bytes ? a->truth.stride_bytes : size);
    const int32_t narrow = (int32_t)value;
    const unsigned char byte = (unsigned char)value;
    memcpy(p, size == 8 ? (const void *)&value : size == 4 ? (const void *)&narrow : &byte, (size_t)size);
}

static void store_number(const input_array *a, int64_t i, double value)
{
    const int64_t size = get_type_size(a->truth.type);
    char *p = (char *)(uintptr_t)a->truth.data + i * (a->truth.stride_bytes ? a->truth.stride_bytes : size);
    const float narrow = (float)value;
    memcpy(p, size == 8 ? (const void *)&value : &narrow, (size_t)size);
}

/* Replaces the contents of one to three elements. */
static void corrupt_elements(const input_array *a, dice *d)
{
    const int64_t indices[] = {-1, 0, 1, -7, INT32_MIN, INT32_MAX, INT64_MIN, INT64_MAX, (int64_t)1 << 40, a->count};
    const double numbers[] = {NAN, INFINITY, -INFINITY, 1e200, -1e300, 1e30, 0, -0.0, 1e-310, 7};
    for (int64_t n = draw_random(d, 3); n >= 0; n--) {
        const int64_t at = draw_random(d, a->count), index = PICK(d, indices), shift = draw_random(d, 4);
        const double number = PICK(d, numbers);
        if (a->are_indices)
            store_index(a, at, shift ? index : draw_random(d, a->count));
        else if (!a->is_table)
            store_number(a, at, number);
    }
}

static void corrupt_stride(const input_array *a, dice *d)
{
    static const int64_t wild[] = {
        (int64_t)1 << 60, (int64_t)1 << 62, INT64_MIN, INT64_MAX, -((int64_t)1 << 50), 1, 3, 0};
    const int64_t stride = PICK(d, wild), size = get_type_size(a->truth.type);
    a->array->stride_bytes = stride == 3 && size < stride ? size : stride; /* stays within the array's memory */
}

/* Sets another type of at most as many bytes, which can be valid or invalid for this array, or a number that is no
 * type. */
static void corrupt_type(const input_array *a, dice *d)
{
    static const int types[] = {INSITU_FLOAT32, INSITU_FLOAT64, INSITU_INT32, INSITU_INT64, INSITU_UINT8, 0, -1, 77};
    const int type = PICK(d, types);
    if (a->is_table || (type >= 1 && type <= 5 && get_type_size((insitu_type)type) > get_type_size(a->truth.type)))
        return;
    a->array->type = (insitu_type)type;
}

/* Copies the array to an address that is not a multiple of the size of its elements. */
static void unalign_array(const input_array *a)
{
    static char copies[ARRAYS][1 << 14];
    static int next;
    const int64_t size = get_type_size(a->truth.type), stride = a->truth.stride_bytes ? a->truth.stride_bytes : size;
    const int64_t bytes = (a->count - 1) * stride + size;
    if (size == 1 || stride < 0 || bytes >= (int64_t)sizeof copies[0]) return;
    char *copy = copies[next++ % ARRAYS];
    a->array->data = memcpy(copy + 1, a->truth.data, (size_t)bytes);
}

static void corrupt_array(formed_mesh *m, const formed_mesh *right, dice *d)
{
    input_array arrays[ARRAYS];
    const int count = list_arrays(m, right, arrays);
    if (!count) return;
    const input_array *a = &arrays[draw_random(d, count)];
    switch (draw_random(d, 6)) {
    case 0: a->array->data = NULL; return;
    case 1: corrupt_stride(a, d); return;
    case 2: corrupt_type(a, d); return;
    case 3: unalign_array(a); return;
    default: corrupt_elements(a, d);
    }
}

/* ---- counts and choices ---------------------------------------------------------------------------------------- */

static int64_t choose_other_count(int64_t count, dice *d)
{
    static const int64_t huge[] = {INT64_MAX, INT64_MIN, -1, ((int64_t)1 << 58) - 1, (int64_t)1 << 62, 0};
    return draw_random(d, 2) ? PICK(d, huge) : draw_random(d, count > 0 ? count : 1);
}

static void corrupt_count(formed_mesh *m, dice *d)
{
    insitu_mesh *a = &m->mesh;
    int64_t *const counts[] = {&a->vertex_count,
                               &a->cell_count,
                               &a->connectivity_count,
                               &a->face_count,
                               &a->face_connectivity_count,
                               &a->neighbour_count,
                               &m->fields[FORMED_F].count,
                               &m->fields[FORMED_C].count,
                               &m->fields[FORMED_I].count,
                               &m->fields[FORMED_D].count,
                               &m->patch.count,
                               &m->patch.connectivity_count};
    int64_t *count = PICK(d, counts);
    *count = choose_other_count(*count, d);
    if (draw_random(d, 2)) formed_mesh_resize_fields(m);
}

static void corrupt_option(formed_mesh *m, dice *d)
{
    static const int types[] = {0, 5, 7, 9, 10, 11, 12, 13, 14, 41, 42, -1};
    static const int64_t rows[] = {-1, 0, 3, 6, 9, 12, (int64_t)1 << 60, INT64_MIN, INT64_MAX};
    static const int64_t component_strides[] = {0, 3, 6, (int64_t)1 << 60, INT64_MIN, INT64_MAX};
    insitu_mesh *a = &m->mesh;
    insitu_field *field = &m->fields[draw_random(d, FORMED_FIELDS)];
    switch (draw_random(d, 11)) {
    case 0: a->index_base = (int)draw_random(d, 4) - 1; return;
    case 1: a->vertex_order = (insitu_vertex_order)draw_random(d, 4); return;
    case 2: a->keep_polyhedra = (int)draw_random(d, 3); return;
    case 3: a->cell_type = (insitu_cell_type)PICK(d, types); return;
    case 4: a->changed = (unsigned)draw_random(d, 9); return;
    case 5: a->connectivity_row = PICK(d, rows); return;
    case 6: field->corner_row = PICK(d, rows); return;
    case 7: field->centring = (insitu_centring)(draw_random(d, field->index.data ? 2 : 5) - 1); return;
    case 8: field->component_count = (int)draw_random(d, 3) - 1; return;
    case 9: field->component_stride_bytes = PICK(d, component_strides); return;
    default: m->patch.first_face = PICK(d, rows);
    }
}

/* Removes this rank's cells, a field, or a name. */
static void remove_cells_or_field(formed_mesh *m, dice *d)
{
    insitu_field *field = &m->fields[draw_random(d, FORMED_FIELDS)];
    switch (draw_random(d, 6)) {
    case 0:
        insitu_mesh_defaults(&m->mesh);
        formed_mesh_resize_fields(m);
        return;
    case 1: field->name = NULL; return;
    case 2: field->name = ""; return;
    case 3: field->patch_count = (int)draw_random(d, 3) - 1; return;
    case 4: field->patches = NULL; return;
    default: field->values.data = field->index.data = NULL;
    }
}

/* Corrupts the input in one random way if is_mine is set. The random numbers of a fault do not depend on the rank's
 * input. */
static void corrupt_input(formed_mesh *m, const formed_mesh *right, uint64_t number, int fault, bool is_mine)
{
    dice d = {number, 1000 * (uint64_t)(fault + 1)};
    const int64_t kind = draw_random(&d, 8);
    if (!is_mine) return;
    if (kind < 4) corrupt_array(m, right, &d);
    if (kind == 4 || kind == 5) corrupt_count(m, &d);
    if (kind == 6) corrupt_option(m, &d);
    if (kind == 7) remove_cells_or_field(m, &d);
}

/* ---- cases ----------------------------------------------------------------------------------------------------- */

typedef struct bench {
    insitu_session *session;
    formed_mesh mesh;
    bool has_corner_fields;
    int pictures, cycle;
    float truth[FORMED_PICTURES][MOST_PIXELS * 4];
} bench;

/* Counts the pixels that differ from those of the first step by more than 0.02. Smaller differences are accepted
 * because a refused mesh can change the origin of coordinates, and thereby the rounding. */
static int count_differing_pixels(const bench *b)
{
    int count = 0;
    for (int i = 0; i < caught_count && i < b->pictures; i++)
        for (int p = 0; p < MOST_PIXELS; p++)
            for (int k = 0; k < 4; k++)
                if (!(fabsf(caught[i].rgba[4 * p + k] - b->truth[i][4 * p + k]) <= 0.02f)) {
                    count++;
                    break;
                }
    return count;
}

static void draw_valid_input(bench *b, bool is_first, int number)
{
    discard_pictures();
    const insitu_status set = formed_mesh_submit(b->session, &b->mesh, b->has_corner_fields);
    const insitu_status status = insitu_step(b->session, b->cycle++, 0);
    if (set || status) fprintf(stderr, "case %d: not healed: %s\n", number, insitu_error(b->session));
    everywhere(set == INSITU_OK && status == INSITU_OK);
    everywhere(insitu_last_report(b->session)->images == b->pictures && caught_count == (own_rank ? 0 : b->pictures));
    for (int i = 0; i < caught_count && is_first; i++) memcpy(b->truth[i], caught[i].rgba, sizeof b->truth[i]);
    const int differing = count_differing_pixels(b);
    if (differing > 4) fprintf(stderr, "case %d: %d pixels are others\n", number, differing);
    everywhere(differing <= 4);
}

static void create_bench(bench *b, mesh_form form, bool has_corner_fields)
{
    *b = (bench){.has_corner_fields = has_corner_fields && formed_mesh_has_corners(form)};
    b->session = open_session(MPI_COMM_WORLD, write_scene(b->has_corner_fields ? formed_corner_scene : formed_scene));
    b->pictures = b->has_corner_fields ? FORMED_CORNER_PICTURES : FORMED_PICTURES;
    formed_mesh_create(form, SIDE, own_rank, rank_count, &b->mesh);
    draw_valid_input(b, true, -1);
}

static void destroy_bench(bench *b)
{
    insitu_destroy(&b->session);
    formed_mesh_free(&b->mesh);
}

/* Draws a corrupted input. Returns whether the step failed. */
static bool draw_corrupted_input(bench *b, int number)
{
    dice d = {(uint64_t)number, 0};
    const int64_t faults = 1 + draw_random(&d, FAULTS), where = draw_random(&d, rank_count + 2);
    const bool is_mine = where >= rank_count || where == own_rank;
    const formed_mesh right = b->mesh;
    for (int fault = 0; fault < faults; fault++) corrupt_input(&b->mesh, &right, (uint64_t)number, fault, is_mine);
    discard_pictures();
    const insitu_status set = formed_mesh_submit(b->session, &b->mesh, b->has_corner_fields);
    const insitu_status status = insitu_step(b->session, b->cycle++, 0);
    const int images = insitu_last_report(b->session)->images;
    const bool is_well = status ? *insitu_error(b->session) != '\0' : !set && images == b->pictures;
    if (!is_well)
        fprintf(stderr, "case %d: set %d, step %d, %d images: %s\n", number, (int)set, (int)status, images,
                insitu_error(b->session));
    everywhere(is_well);
    check_reported_everywhere(b->session, status, status, "");
    return status != INSITU_OK;
}

/* Runs the cases with numbers from `first` to `end` - 1 or, if the environment variable INSITU_TEST_CASE is set, only
 * the case with that number. Returns the number of steps that failed. */
static int run_cases(mesh_form form, bool has_corner_fields, int first, int end)
{
    const char *only = getenv("INSITU_TEST_CASE");
    bench b;
    int failed = 0;
    create_bench(&b, form, has_corner_fields);
    for (int number = first; number < end; number++) {
        if (only && number != atoi(only)) continue;
        failed += draw_corrupted_input(&b, number);
        formed_mesh_restore(&b.mesh);
        draw_valid_input(&b, false, number);
    }
    destroy_bench(&b);
    return failed;
}

static void any_corrupted_input_gives_an_error_or_a_picture(void **state)
{
    (void)state;
    const int each = test_case_count(CASES, ALL_CASES) / (2 * MESH_FORM_COUNT) + 1, all = 2 * MESH_FORM_COUNT * each;
    int failed = 0;
    for (int i = 0; i < 2 * MESH_FORM_COUNT; i++)
        failed += run_cases((mesh_form)(i / 2), i % 2, i * each, (i + 1) * each);
    if (own_rank == 0) fprintf(stderr, "%d cases, %d errors\n", all, failed);
    everywhere(getenv("INSITU_TEST_CASE") ||
               (failed > all / 4 && failed < all)); /* more than a quarter fail, but not all */
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(any_corrupted_input_gives_an_error_or_a_picture),
    };
    return run_session_tests(argc, argv, tests, NULL, NULL);
}
