/* Checks fields that have a value at each corner of each cell. Discontinuous fields must give pictures that are
 * bit-identical to those of a mesh whose vertices the caller duplicated: beside fields at vertices and at cells, with
 * values given through an index or in rows, with another order of vertices, with vertex ids, and after values and
 * coordinates change. Averaged fields must give the pictures of means at vertices, which are computed by brute force.
 * Errors must be returned on all ranks. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "test_meshes.h"
#include "test_session_fixture.h"
#include "session.h"

enum { SIDE = 3, PIXELS = 64 * 48, PICTURES = 4, STEPS = 3, ROW = 11 };

#define IMAGE(name, layers)                                                                                            \
    "  - name: " name "\n    size: [64, 48]\n    background: [0, 0, 0, 0]\n    layers:\n" layers                       \
    "    outputs: [{path: " name ".exr}]\n"

/* clang-format off */
static const char discontinuous_scene[] =
    "images:\n"
    IMAGE("a", "      - isosurface: {field: f, values: [0.1, 0.3], opacity: 0.6, colour_by: {field: g, map: turbo}}\n"
               "      - isosurface: {field: g, values: [0.2], colour_by: {field: f}}\n")
    IMAGE("b", "      - volume: {field: f}\n")
    IMAGE("c", "      - slice: {field: f, planes: [{normal: [1, 2, 3]}]}\n"
               "      - isosurface: {field: c, values: [0.1]}\n")
    IMAGE("d", "      - surface: {threshold: {field: f, from: 0.05}, colour_by: {field: f}, edges: {}}\n");

static const char joined_scene[] =
    "images:\n"
    IMAGE("a", "      - isosurface: {field: f, interpolate: vertex, values: [0.1, 0.3], opacity: 0.6}\n")
    IMAGE("b", "      - volume: {field: f, interpolate: vertex}\n")
    IMAGE("c", "      - slice: {field: f, interpolate: vertex, planes: [{normal: [1, 2, 3]}]}\n")
    IMAGE("d", "      - surface: {colour_by: {field: f, interpolate: vertex}}\n");
/* clang-format on */

/* ---- two meshes ------------------------------------------------------------------------------------------------ */

typedef struct form {
    bool is_by_index, is_in_rows, is_lexicographic, has_ids;
} form;

/* The fields as plain arrays: at shared vertices, at corners and at cells. gathered: values of the vertices at the
 * corners. */
typedef struct values {
    int64_t corners;
    double *at_vertices, *at_corners, *at_cells, *gathered;
    double *distributed; /* values at corners in the layout of the form */
    int64_t *index;      /* index of each corner's value; NULL if the form has no index */
    int64_t distributed_count;
    double *coordinates; /* coordinates, and below connectivity and ids, of the mesh with duplicated vertices */
    int64_t *connectivity, *ids, *doubled_ids;
} values;

static double *allocate_numbers(int64_t count)
{
    double *out = malloc((size_t)(count + 1) * sizeof *out);
    assert_non_null(out);
    return out;
}

static int64_t *allocate_integers(int64_t count)
{
    int64_t *out = malloc((size_t)(count + 1) * sizeof *out);
    assert_non_null(out);
    return out;
}

/* Returns a number that depends only on the cell's coordinates, and therefore not on the rank that owns the cell. */
static double compute_cell_number(const test_mesh *part, int64_t cell)
{
    double sum = 0;
    for (int64_t i = part->offsets[cell]; i < part->offsets[cell + 1]; i++)
        for (int axis = 0; axis < 3; axis++) sum += (axis + 1) * part->coordinates[3 * part->connectivity[i] + axis];
    return 0.3 * sin(20 * sum);
}

static int64_t find_corner_index(const form *of, const test_mesh *part, int64_t cell, int64_t corner)
{
    return of->is_in_rows ? cell * ROW + corner - part->offsets[cell] : corner;
}

static void fill_values(values *v, const form *of, const test_mesh *part, double scale)
{
    for (int64_t i = 0; i < v->distributed_count; i++) v->distributed[i] = (double)NAN;
    for (int64_t i = 0; i < part->vertex_count; i++) v->at_vertices[i] = scale * part->values[i];
    for (int64_t cell = 0; cell < part->cell_count; cell++) {
        v->at_cells[cell] = compute_cell_number(part, cell);
        for (int64_t i = part->offsets[cell]; i < part->offsets[cell + 1]; i++) {
            const int64_t place = find_corner_index(of, part, cell, i),
                          at = of->is_by_index ? v->distributed_count - 1 - i : place;
            v->at_corners[i] = scale * (part->values[part->connectivity[i]] + compute_cell_number(part, cell));
            v->gathered[i] = v->at_vertices[part->connectivity[i]];
            v->distributed[at] = v->at_corners[i];
            if (of->is_by_index) v->index[place] = at;
        }
    }
}

static void duplicate_vertices(values *v, const test_mesh *part)
{
    for (int64_t i = 0; i < part->vertex_count; i++) v->ids[i] = 7 * i;
    for (int64_t i = 0; i < v->corners; i++) {
        v->connectivity[i] = i;
        v->doubled_ids[i] = 7 * part->connectivity[i];
        memcpy(v->coordinates + 3 * i, part->coordinates + 3 * part->connectivity[i], 3 * sizeof(double));
    }
}

static values make_values(const form *of, const test_mesh *part)
{
    const int64_t corners = part->connectivity_count, places = of->is_in_rows ? part->cell_count * ROW : corners;
    values v = {.corners = corners,
                .at_vertices = allocate_numbers(part->vertex_count),
                .at_corners = allocate_numbers(corners),
                .at_cells = allocate_numbers(part->cell_count),
                .gathered = allocate_numbers(corners),
                .distributed = allocate_numbers(places + corners),
                .index = allocate_integers(places),
                .distributed_count = places + (of->is_by_index ? 5 : 0),
                .coordinates = allocate_numbers(3 * corners)};
    v.connectivity = allocate_integers(corners);
    v.ids = allocate_integers(part->vertex_count);
    v.doubled_ids = allocate_integers(corners);
    /* invalid indices, which remain after the corners of each row and must not be read */
    for (int64_t i = 0; i < places; i++) v.index[i] = -1;
    fill_values(&v, of, part, 1);
    duplicate_vertices(&v, part);
    return v;
}

static void free_values(values *v)
{
    free(v->at_vertices), free(v->at_corners), free(v->at_cells), free(v->gathered), free(v->distributed),
        free(v->index);
    free(v->coordinates), free(v->connectivity), free(v->ids), free(v->doubled_ids);
}

/* Changes the vertices of hexes to lexicographic order; the permutation is its own inverse. */
static void sort_hex_vertices(test_mesh *part)
{
    for (int64_t i = 0; i + 3 < part->connectivity_count; i += 4) {
        const int64_t third = part->connectivity[i + 2];
        part->connectivity[i + 2] = part->connectivity[i + 3];
        part->connectivity[i + 3] = third;
    }
}

static insitu_cell_type get_cell_type(test_mesh_kind kind)
{
    static const insitu_cell_type types[] = {INSITU_TET, INSITU_HEX, INSITU_WEDGE, INSITU_PYRAMID};
    return types[kind];
}

static insitu_mesh describe_mesh(const session_input *in, const values *v, const form *of, bool is_doubled)
{
    insitu_mesh mesh = in->mesh;
    if (of->is_in_rows) {
        mesh.offsets = mesh.cell_types = (insitu_array){0};
        mesh.cell_type = get_cell_type(in->kind);
    }
    if (of->is_lexicographic) mesh.vertex_order = INSITU_ORDER_LEXICOGRAPHIC;
    if (of->has_ids) mesh.vertex_ids = (insitu_array){is_doubled ? v->doubled_ids : v->ids, INSITU_INT64, 0};
    if (!is_doubled) return mesh;
    mesh.vertex_count = v->corners;
    insitu_mesh_interleaved(&mesh, v->coordinates, INSITU_FLOAT64);
    mesh.connectivity = (insitu_array){v->connectivity, INSITU_INT64, 0};
    return mesh;
}

static void set_field(insitu_session *session, const char *name, insitu_centring centring, int64_t count,
                      const double *of, const form *distributed, const values *v)
{
    insitu_field field;
    insitu_field_defaults(&field);
    field.name = name;
    field.centring = centring;
    field.count = count;
    field.values = (insitu_array){of, INSITU_FLOAT64, 0};
    if (distributed && distributed->is_by_index) field.index = (insitu_array){v->index, INSITU_INT64, 0};
    if (distributed && distributed->is_in_rows) field.corner_row = ROW;
    const insitu_status status = insitu_set_field(session, "m", &field);
    if (status) fprintf(stderr, "%s\n", insitu_error(session));
    everywhere(status == INSITU_OK);
}

static void set_fields(insitu_session *session, const session_input *in, const values *v, const form *of,
                       bool is_doubled)
{
    const test_mesh *part = &in->part;
    set_field(session, "c", INSITU_CELL, part->cell_count, v->at_cells, NULL, v);
    if (is_doubled) {
        set_field(session, "f", INSITU_VERTEX, v->corners, v->at_corners, NULL, v);
        set_field(session, "g", INSITU_VERTEX, v->corners, v->gathered, NULL, v);
    } else {
        set_field(session, "f", INSITU_CORNER, v->distributed_count, v->distributed, of, v);
        set_field(session, "g", INSITU_VERTEX, part->vertex_count, v->at_vertices, NULL, v);
    }
}

/* ---- pictures ------------------------------------------------------------------------------------------------- */

typedef struct drawing {
    caught_picture pictures[STEPS][PICTURES];
    int64_t copied;
} drawing;

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

static void scale_coordinates(session_input *in, values *v, double scale)
{
    for (int64_t i = 0; i < 3 * in->part.vertex_count; i++) in->part.coordinates[i] *= scale;
    for (int64_t i = 0; i < 3 * v->corners; i++) v->coordinates[i] *= scale;
}

/* Draws the mesh in three steps: first as it is, then with other values, and then with other coordinates. */
static drawing draw_form(session_input *in, values *v, const form *of, bool is_doubled)
{
    drawing out = {.copied = 0};
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(discontinuous_scene));
    for (int step = 0; step < STEPS; step++) {
        insitu_mesh mesh = describe_mesh(in, v, of, is_doubled);
        mesh.changed = step ? INSITU_CHANGED_GEOMETRY : INSITU_CHANGED_ALL;
        if (step == 1) mesh.changed = INSITU_CHANGED_NOTHING;
        if (step == 1) fill_values(v, of, &in->part, 0.5);
        if (step == 2) scale_coordinates(in, v, 0.5);
        everywhere(insitu_set_mesh(session, "m", &mesh) == INSITU_OK);
        if (step < 2) set_fields(session, in, v, of, is_doubled);
        step_and_catch(session, step, out.pictures[step]);
    }
    out.copied = insitu_last_report(session)->bytes_copied;
    insitu_destroy(&session);
    scale_coordinates(in, v, 2);
    fill_values(v, of, &in->part, 1);
    return out;
}

static void compare_drawings(drawing *a, drawing *b, int steps)
{
    bool same = true, differ = own_rank != 0;
    for (int step = 0; step < steps && own_rank == 0; step++)
        for (int i = 0; i < PICTURES; i++) {
            same = same && are_same_pictures(&a->pictures[step][i], &b->pictures[step][i]);
            differ = differ || steps == 1 || !are_same_pictures(&a->pictures[0][i], &a->pictures[step][i]);
            free(b->pictures[step][i].rgba), free(b->pictures[step][i].depth);
        }
    for (int step = 0; step < steps && own_rank == 0; step++)
        for (int i = 0; i < PICTURES; i++) free(a->pictures[step][i].rgba), free(a->pictures[step][i].depth);
    everywhere(same);
    everywhere(differ);
}

static void check_form(test_mesh_kind kind, const form *of)
{
    session_input in = {0};
    input_create(&in, kind, SIDE, TEST_RANDOM, own_rank, rank_count);
    if (of->has_ids && rank_count > 1) return input_free(&in); /* the ids are unique only within one rank */
    if (of->is_lexicographic) sort_hex_vertices(&in.part);
    values v = make_values(of, &in.part);
    drawing doubled = draw_form(&in, &v, of, true), discontinuous = draw_form(&in, &v, of, false);
    /* bytes copied for each corner: coordinates, an index, and g; also f if it cannot be read in place */
    const int64_t tuples = 3 * 8 + 4 + 8 + (of->is_by_index || of->is_in_rows ? 8 : 0);
    everywhere(discontinuous.copied == doubled.copied + tuples * v.corners);
    compare_drawings(&doubled, &discontinuous, STEPS);
    free_values(&v);
    input_free(&in);
}

static void corner_fields_match_duplicated_vertices(void **state)
{
    (void)state;
    static const form forms[] = {{0}, {.is_by_index = true}, {.has_ids = true}};
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++)
        for (size_t i = 0; i < sizeof forms / sizeof forms[0] && kind != TEST_POLYHEDRA; i++)
            check_form(kind, &forms[i]);
}

static void corners_in_rows_and_other_orders_match_plain_corners(void **state)
{
    (void)state;
    for (test_mesh_kind kind = TEST_TETS; kind <= TEST_PYRAMIDS; kind++) {
        check_form(kind, &(form){.is_in_rows = true});
        check_form(kind, &(form){.is_in_rows = true, .is_by_index = true});
    }
    check_form(TEST_HEXES, &(form){.is_lexicographic = true});
    check_form(TEST_HEXES, &(form){.is_lexicographic = true, .is_in_rows = true, .is_by_index = true});
}

/* ---- means ---------------------------------------------------------------------------------------------------- */

/* Returns the mean over all corners of the whole mesh at one position. The summation order, by increasing magnitude, is
 * that of the library's means of cells. */
static double compute_corner_mean(const test_mesh *whole, const double at[3])
{
    double found[256], sum = 0;
    int count = 0;
    for (int64_t cell = 0; cell < whole->cell_count; cell++)
        for (int64_t i = whole->offsets[cell]; i < whole->offsets[cell + 1]; i++)
            if (memcmp(whole->coordinates + 3 * whole->connectivity[i], at, 3 * sizeof *at) == 0 && count < 256)
                found[count++] = whole->values[whole->connectivity[i]] + compute_cell_number(whole, cell);
    assert_true(count > 0 && count < 256);
    qsort(found, (size_t)count, sizeof *found, compare_doubles);
    for (int i = 0; i < count; i++) sum += found[i];
    return sum / count;
}

static void joined_corners_have_their_means(void **state)
{
    (void)state;
    const form plain = {0};
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++) {
        if (kind == TEST_POLYHEDRA) continue;
        session_input in = {0}, whole = {0};
        input_create(&in, kind, SIDE, TEST_RANDOM, own_rank, rank_count);
        input_create(&whole, kind, SIDE, TEST_BLOCK, 0, 1);
        values v = make_values(&plain, &in.part);
        drawing drawn[2];
        for (int is_joined = 0; is_joined < 2; is_joined++) {
            insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(joined_scene));
            everywhere(insitu_set_mesh(session, "m", &in.mesh) == INSITU_OK);
            set_fields(session, &in, &v, &plain, false);
            for (int64_t i = 0; i < in.part.vertex_count && !is_joined; i++)
                v.at_vertices[i] = compute_corner_mean(&whole.part, in.part.coordinates + 3 * i);
            if (!is_joined) set_field(session, "f", INSITU_VERTEX, in.part.vertex_count, v.at_vertices, NULL, &v);
            step_and_catch(session, 0, drawn[is_joined].pictures[0]);
            insitu_destroy(&session);
        }
        compare_drawings(&drawn[0], &drawn[1], 1);
        free_values(&v);
        input_free(&in);
        input_free(&whole);
    }
}

/* ---- errors --------------------------------------------------------------------------------------------------- */

static void set_too_few_values(session_input *in)
{
    in->field.centring = INSITU_CORNER;
    in->field.count = in->part.connectivity_count - 1;
}
static void use_owned_cells(session_input *in)
{
    in->field.centring = INSITU_CORNER;
    in->mesh.cell_types = (insitu_array){0};
    in->mesh.cell_type = INSITU_POLYHEDRON;
}
static void set_short_rows(session_input *in)
{
    in->field.centring = INSITU_CORNER;
    in->mesh.cell_types = in->mesh.offsets = (insitu_array){0};
    in->mesh.cell_type = INSITU_HEX;
    in->field.corner_row = 7;
}
static void use_rows_with_offsets(session_input *in)
{
    in->field.centring = INSITU_CORNER;
    in->field.corner_row = 8;
}
static void use_rows_of_vertices(session_input *in)
{
    in->field.corner_row = 8;
}
static void set_unknown_centring(session_input *in)
{
    in->field.centring = (insitu_centring)3;
}

static const corrupted_case cases[] = {
    {"few", set_too_few_values, INSITU_ERROR_FIELD, true, {"field \"f\": has ", "corners of cells"}},
    {"polyhedra", use_owned_cells, INSITU_ERROR_FIELD, true, {"the mesh has polyhedra, whose corners have no order"}},
    {"short", set_short_rows, INSITU_ERROR_FIELD, true, {"corner_row is 7, a cell has 8 vertices"}},
    {"offsets", use_rows_with_offsets, INSITU_ERROR_FIELD, true, {"corner_row is 8 and the mesh has offsets"}},
    {"vertices", use_rows_of_vertices, INSITU_ERROR_ARGUMENT, true, {"corner_row is 8, and its centring 0"}},
    {"centring", set_unknown_centring, INSITU_ERROR_ARGUMENT, true, {"unknown centring 3"}},
};

static void wrong_input_is_reported_on_all_ranks(void **state)
{
    (void)state;
    session_input in = {0};
    input_create(&in, TEST_HEXES, 3, TEST_RANDOM, own_rank, rank_count);
    check_all_faults_are_reported(&in, cases, sizeof cases / sizeof cases[0]);
    input_free(&in);
}

/* Checks errors in the contents of arrays, which only a step detects. The centring is the same on all ranks. */
static void wrong_array_contents_are_reported_on_all_ranks(void **state)
{
    (void)state;
    session_input in = {0};
    const form of = {.is_by_index = true};
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(error_scene));
    input_create(&in, TEST_HEXES, 3, TEST_RANDOM, own_rank, rank_count);
    values v = make_values(&of, &in.part);
    everywhere(insitu_set_mesh(session, "m", &in.mesh) == INSITU_OK);
    set_field(session, "f", INSITU_CORNER, v.distributed_count, v.distributed, &of, &v);
    const int64_t good = v.index[9];
    if (own_rank == rank_count - 1) v.index[9] = v.distributed_count;
    for (int step = 0; step < 2; step++)
        check_reported_everywhere(session, insitu_step(session, step, 0), INSITU_ERROR_FIELD,
                                  "the index of corner 9 is ", "outside 0..");
    v.index[9] = good;
    check_step_succeeds(session, 2);
    insitu_destroy(&session);
    free_values(&v);
    input_free(&in);

    session = open_session(MPI_COMM_WORLD, write_scene(error_scene));
    input_create(&in, TEST_POLYHEDRA, 3, TEST_RANDOM, own_rank, rank_count);
    double *zeros = calloc((size_t)in.part.connectivity_count + 1, sizeof *zeros);
    assert_non_null(zeros);
    everywhere(insitu_set_mesh(session, "m", &in.mesh) == INSITU_OK);
    set_field(session, "f", INSITU_CORNER, in.part.connectivity_count, zeros, NULL, NULL);
    check_reported_everywhere(session, insitu_step(session, 0, 0), INSITU_ERROR_FIELD, "is a polyhedron, whose corners",
                              "cell ");
    insitu_destroy(&session);
    free(zeros);
    input_free(&in);
}

/* Checks that a mesh with a field at corners and with polyhedra is left out alone: the other fields of this mesh and
 * of another one are drawn. */
static void other_fields_are_drawn_if_corners_have_no_order(void **state)
{
    (void)state;
    static const char scene[] = "images:\n" IMAGE("a", "      - surface: {colour_by: f}\n")
        IMAGE("b", "      - isosurface: {field: v, values: [0.2]}\n")
            IMAGE("c", "      - isosurface: {field: g, values: [0.2]}\n");
    session_input in = {0}, other = {0};
    input_create(&in, own_rank == rank_count - 1 ? TEST_POLYHEDRA : TEST_HEXES, 3, TEST_RANDOM, own_rank, rank_count);
    input_create(&other, TEST_HEXES, 3, TEST_RANDOM, own_rank, rank_count);
    other.field.name = "g";
    double *zeros = calloc((size_t)in.part.connectivity_count + 1, sizeof *zeros);
    assert_non_null(zeros);
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(scene));
    for (int cycle = 0; cycle < 3; cycle++) {
        insitu_field at_vertices = in.field;
        at_vertices.name = "v";
        everywhere(insitu_set_mesh(session, "other", &other.mesh) == INSITU_OK);
        everywhere(insitu_set_field(session, "other", &other.field) == INSITU_OK);
        everywhere(insitu_set_mesh(session, "m", &in.mesh) == INSITU_OK);
        everywhere(insitu_set_field(session, "m", &at_vertices) == INSITU_OK);
        set_field(session, "f", INSITU_CORNER, in.part.connectivity_count, zeros, NULL, NULL);
        discard_pictures();
        check_reported_everywhere(session, insitu_step(session, cycle, 0), INSITU_ERROR_FIELD,
                                  "is a polyhedron, whose corners", "cell ");
        everywhere(insitu_last_report(session)->images == 2);
    }
    /* later steps with the same mesh refuse it again, but must not compute its data again */
    const session_mesh *mesh = session_find_mesh(&session->meshes, "m");
    const int64_t stamp = mesh->cells_stamp;
    for (int cycle = 3; cycle < 5; cycle++) {
        check_reported_everywhere(session, insitu_step(session, cycle, 0), INSITU_ERROR_FIELD,
                                  "is a polyhedron, whose corners", "cell ");
        everywhere(insitu_last_report(session)->images == 2 && mesh->cells_stamp == stamp &&
                   !mesh->discontinuous.is_active);
    }
    discard_pictures();
    insitu_destroy(&session);
    free(zeros);
    input_free(&in);
    input_free(&other);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(corner_fields_match_duplicated_vertices),
                                       cmocka_unit_test(corners_in_rows_and_other_orders_match_plain_corners),
                                       cmocka_unit_test(joined_corners_have_their_means),
                                       cmocka_unit_test(wrong_input_is_reported_on_all_ranks),
                                       cmocka_unit_test(wrong_array_contents_are_reported_on_all_ranks),
                                       cmocka_unit_test(other_fields_are_drawn_if_corners_have_no_order)};
    return run_session_tests(argc, argv, tests, NULL, NULL);
}
