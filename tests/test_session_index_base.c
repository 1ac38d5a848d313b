/* Checks meshes whose indices begin at 1, as in Fortran. Pictures must be bit-identical to those with indices from 0,
 * for all types of cells: with 8-byte indices and offsets, and with 4-byte indices without offsets. Errors must state
 * indices as the caller counts them. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "test_session_fixture.h"

enum { SIDE = 4, PIXELS = 64 * 48 };

static const char scene_text[] =
    "images:\n  - name: a\n    size: [64, 48]\n    background: [0, 0, 0, 0]\n    layers:\n"
    "      - isosurface: {field: f, values: [0.1, 0.7], opacity: 0.6, colour_by: {field: f, map: turbo}}\n"
    "      - surface: {opacity: 0.2, edges: {}}\n      - slice: {field: f, planes: [{normal: [1, 2, 3]}]}\n"
    "      - volume: {field: f, map: viridis}\n    outputs: [{path: a.exr}]\n"
    "  - name: b\n    size: [64, 48]\n    layers: [{isosurface: {field: f, values: [0.1]}}]\n"
    "    outputs: [{path: b.exr}]\n"
    "  - name: c\n    size: [64, 48]\n    layers: [{volume: {field: f}}]\n    sampling: {method: samples}\n"
    "    outputs: [{path: c.exr}]\n";
enum { PICTURES = 3 };

static void add_base_to_indices(int64_t *indices, int64_t count, int64_t base)
{
    for (int64_t i = 0; i < count; i++) indices[i] += base;
}

/* Makes all indices of the part begin at 1: connectivity and offsets, and for polyhedra also faces. */
static void make_indices_one_based(session_input *in)
{
    test_mesh *part = &in->part;
    add_base_to_indices(part->connectivity, part->connectivity_count, 1);
    add_base_to_indices(part->offsets, part->cell_count + 1, 1);
    if (part->face_count) add_base_to_indices(part->face_offsets, part->face_count + 1, 1);
    add_base_to_indices(part->face_connectivity, part->face_connectivity_count, 1);
    in->mesh.index_base = 1;
}

/* The 4-byte arrays that kernels read which process several cells at once. */
typedef struct narrow_arrays {
    float *coordinates, *values;
    int32_t *connectivity;
} narrow_arrays;

static narrow_arrays make_narrow(session_input *in)
{
    const test_mesh *part = &in->part;
    narrow_arrays out = {test_calloc((size_t)part->vertex_count * 3 + 1, sizeof(float)),
                         test_calloc((size_t)part->vertex_count + 1, sizeof(float)),
                         test_calloc((size_t)part->connectivity_count + 1, sizeof(int32_t))};
    for (int64_t i = 0; i < 3 * part->vertex_count; i++) out.coordinates[i] = (float)part->coordinates[i];
    for (int64_t i = 0; i < part->vertex_count; i++) out.values[i] = (float)part->values[i];
    for (int64_t i = 0; i < part->connectivity_count; i++) out.connectivity[i] = (int32_t)part->connectivity[i];
    insitu_mesh_interleaved(&in->mesh, out.coordinates, INSITU_FLOAT32);
    in->mesh.cell_type = in->kind == TEST_TETS ? INSITU_TET : INSITU_HEX;
    in->mesh.cell_types = in->mesh.offsets = in->mesh.ghosts = (insitu_array){0};
    in->mesh.connectivity = (insitu_array){out.connectivity, INSITU_INT32, 0};
    in->field.values = (insitu_array){out.values, INSITU_FLOAT32, 0};
    return out;
}

static void free_narrow(narrow_arrays *n)
{
    test_free(n->coordinates);
    test_free(n->values);
    test_free(n->connectivity);
}

static void draw_pictures(const char *scene, const session_input *in, caught_picture out[PICTURES])
{
    insitu_session *session = open_session(MPI_COMM_WORLD, scene);
    discard_pictures();
    everywhere(submit_input(session, in) == INSITU_OK);
    const insitu_status status = insitu_step(session, 0, 0);
    if (status) fprintf(stderr, "%s\n", insitu_error(session));
    everywhere(status == INSITU_OK);
    for (int i = 0; i < PICTURES; i++) out[i] = own_rank == 0 ? caught[i] : (caught_picture){0};
    caught_count = 0;
    insitu_destroy(&session);
}

static void check_index_base(test_mesh_kind kind, bool is_narrow)
{
    session_input from_zero = {0}, from_one = {0};
    narrow_arrays narrow[2];
    caught_picture pictures[2][PICTURES];
    const char *scene = write_scene(scene_text);
    input_create(&from_zero, kind, SIDE, TEST_RANDOM, own_rank, rank_count);
    input_create(&from_one, kind, SIDE, TEST_RANDOM, own_rank, rank_count);
    make_indices_one_based(&from_one);
    if (is_narrow) {
        narrow[0] = make_narrow(&from_zero);
        narrow[1] = make_narrow(&from_one);
    }
    draw_pictures(scene, &from_zero, pictures[0]);
    draw_pictures(scene, &from_one, pictures[1]);
    bool are_same = true;
    for (int i = 0; i < PICTURES && own_rank == 0; i++) {
        are_same = are_same && memcmp(pictures[0][i].rgba, pictures[1][i].rgba, PIXELS * 4 * sizeof(float)) == 0 &&
                   memcmp(pictures[0][i].depth, pictures[1][i].depth, PIXELS * sizeof(float)) == 0;
        for (int n = 0; n < 2; n++) free(pictures[n][i].rgba), free(pictures[n][i].depth);
    }
    everywhere(are_same);
    for (int n = 0; n < 2 && is_narrow; n++) free_narrow(&narrow[n]);
    input_free(&from_zero);
    input_free(&from_one);
}

static void one_based_indices_draw_same_pictures_as_zero_based(void **state)
{
    (void)state;
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++) check_index_base(kind, false);
    check_index_base(TEST_TETS, true);
    check_index_base(TEST_HEXES, true);
}

/* Checks errors in indices, offsets and index_base, one after another, on the last rank only. */
static void errors_report_one_based_indices(void **state)
{
    (void)state;
    session_input in = {0};
    const bool is_last = own_rank == rank_count - 1;
    input_create(&in, TEST_HEXES, SIDE, TEST_BLOCK, own_rank, rank_count);
    make_indices_one_based(&in);
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(scene_text));
    if (is_last) in.part.connectivity[3] = 0;
    submit_input(session, &in);
    check_reported_everywhere(session, insitu_step(session, 0, 0), INSITU_ERROR_MESH, "vertex index 0 is outside 1..",
                              "index_base is 1");
    if (is_last) in.part.connectivity[3] = in.part.vertex_count + 1;
    submit_input(session, &in);
    check_reported_everywhere(session, insitu_step(session, 1, 0), INSITU_ERROR_MESH, "is outside 1..");
    if (is_last) in.part.connectivity[3] = in.part.vertex_count;
    if (is_last) in.part.offsets[in.part.cell_count]--;
    submit_input(session, &in);
    check_reported_everywhere(session, insitu_step(session, 2, 0), INSITU_ERROR_MESH, "offsets");
    if (is_last) in.part.offsets[in.part.cell_count]++;
    in.mesh.index_base = is_last ? 2 : 1;
    everywhere((insitu_set_mesh(session, "m", &in.mesh) == INSITU_ERROR_ARGUMENT) == is_last);
    check_reported_everywhere(session, insitu_step(session, 3, 0), INSITU_ERROR_ARGUMENT,
                              "index_base is 2, expected 0 or 1");
    insitu_destroy(&session);
    input_free(&in);
}

/* Checks that wrong values of one entry in the last rank's connectivity are reported. cell: the cell that has the
 * entry. */
static void check_wrong_indices_are_reported(insitu_session *session, const session_input *in, int32_t *place,
                                             int64_t cell)
{
    const int32_t wrong[] = {0, (int32_t)in->part.vertex_count + 1, -1, INT32_MIN, INT32_MAX}, good = *place;
    char word[64];
    snprintf(word, sizeof word, "cell %lld ", (long long)cell);
    MPI_Bcast(word, sizeof word, MPI_CHAR, rank_count - 1, MPI_COMM_WORLD);
    for (int i = 0; i < (int)(sizeof wrong / sizeof *wrong); i++) {
        if (own_rank == rank_count - 1) *place = wrong[i];
        submit_input(session, in);
        check_reported_everywhere(session, insitu_step(session, i, 0), INSITU_ERROR_MESH, word, "vertex index ",
                                  " is outside 1..");
    }
    *place = good;
    submit_input(session, in);
    everywhere(insitu_step(session, 9, 0) == INSITU_OK);
}

/* Checks packed arrays, for which many cells are checked at once. The wrong entry is in the middle, or is the last
 * one. */
static void errors_of_many_cells_are_reported(void **state)
{
    (void)state;
    for (test_mesh_kind kind = TEST_TETS; kind <= TEST_HEXES; kind++) {
        session_input in = {0};
        input_create(&in, kind, 2 * SIDE, TEST_RANDOM, own_rank, rank_count);
        make_indices_one_based(&in);
        narrow_arrays narrow = make_narrow(&in);
        insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(scene_text));
        const int64_t count = kind == TEST_TETS ? 4 : 8, cells[] = {in.part.cell_count / 2, in.part.cell_count - 1};
        for (int i = 0; i < 2; i++)
            check_wrong_indices_are_reported(session, &in, &narrow.connectivity[count * cells[i] + i], cells[i]);
        insitu_destroy(&session);
        free_narrow(&narrow);
        input_free(&in);
    }
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(one_based_indices_draw_same_pictures_as_zero_based),
                                       cmocka_unit_test(errors_report_one_based_indices),
                                       cmocka_unit_test(errors_of_many_cells_are_reported)};
    return run_session_tests(argc, argv, tests, NULL, NULL);
}
