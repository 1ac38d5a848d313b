/* Checks cells as finite-element codes store them: with vertices in another order than VTK's, or with vertices that are
 * the first entries of longer rows of indices. Pictures must be bit-identical to those of the same cells in VTK's
 * order. The report must state what is copied for the conversion, no more may be copied than necessary, and an error on
 * one rank must be reported on all. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "test_session_fixture.h"

enum { SIDE = 4, PIXELS = 64 * 48, PICTURES = 3, ROW = 27 };

static const char scene_text[] =
    "images:\n  - name: a\n    size: [64, 48]\n    background: [0, 0, 0, 0]\n    layers:\n"
    "      - isosurface: {field: f, values: [0.1, 0.7], opacity: 0.6, colour_by: {field: f, map: turbo}}\n"
    "      - surface: {opacity: 0.2, edges: {}}\n      - slice: {field: f, planes: [{normal: [1, 2, 3]}]}\n"
    "    outputs: [{path: a.exr}]\n"
    "  - name: b\n    size: [64, 48]\n    layers: [{isosurface: {field: f, values: [0.1]}}]\n"
    "    outputs: [{path: b.exr}]\n"
    "  - name: c\n    size: [64, 48]\n    layers: [{volume: {field: f}}]\n"
    "    outputs: [{path: c.exr}]\n";

/* ---- orders --------------------------------------------------------------------------------------------------- */

/* Returns the position, in the given order, of the vertex that is n-th in VTK's order. It follows from the vertex's
 * position in the unit cell and the direction in which an order goes around a face. */
static int find_vertex_position(insitu_vertex_order order, int type, int n)
{
    const int x = n % 4 == 1 || n % 4 == 2, y = n % 4 / 2, z = n / 4;
    const bool has_quads = type == INSITU_HEX || type == INSITU_QUAD || (type == INSITU_PYRAMID && n < 4);
    if (order == INSITU_ORDER_LEXICOGRAPHIC && has_quads) return x + 2 * y + 4 * z;
    if (order == INSITU_ORDER_DMPLEX && type == INSITU_HEX && n < 4) return (4 - n) % 4;
    if (order == INSITU_ORDER_DMPLEX && type == INSITU_WEDGE && n < 3) return (3 - n) % 3;
    return n;
}

static void reorder_cells(test_mesh *part, insitu_vertex_order order)
{
    for (int64_t cell = 0; cell < part->cell_count; cell++) {
        int64_t *first = part->connectivity + part->offsets[cell], held[8];
        const int64_t count = part->offsets[cell + 1] - part->offsets[cell];
        if (part->types[cell] == INSITU_POLYHEDRON) continue;
        memcpy(held, first, (size_t)count * sizeof *first);
        for (int n = 0; n < count; n++) first[find_vertex_position(order, part->types[cell], n)] = held[n];
    }
}

/* ---- layouts -------------------------------------------------------------------------------------------------- */

typedef enum layout { WITH_TYPES, PACKED, ROWS, NARROW, NARROW_ROWS, LAYOUTS } layout;

static const insitu_cell_type type_of_kind[] = {[TEST_TETS] = INSITU_TET,
                                                [TEST_HEXES] = INSITU_HEX,
                                                [TEST_WEDGES] = INSITU_WEDGE,
                                                [TEST_PYRAMIDS] = INSITU_PYRAMID};

/* Copies of arrays in another layout, to which the mesh description is changed to point. */
typedef struct moved {
    void *connectivity;
    float *coordinates, *values;
} moved;

static void free_moved(moved *m)
{
    free(m->connectivity), free(m->coordinates), free(m->values);
    *m = (moved){0};
}

static void store_index(const moved *m, bool is_narrow, int64_t i, int64_t value)
{
    if (is_narrow)
        ((int32_t *)m->connectivity)[i] = (int32_t)value;
    else
        ((int64_t *)m->connectivity)[i] = value;
}

/* Copies connectivity of one type without offsets, into rows of ROW entries if the layout has rows. Entries after a
 * cell's vertices are invalid indices. The last row ends after the cell's vertices. */
static void move_connectivity(session_input *in, layout how, moved *m)
{
    const test_mesh *part = &in->part;
    const bool is_narrow = how >= NARROW, has_rows = how == ROWS || how == NARROW_ROWS;
    const int64_t corners = part->cell_count ? part->offsets[1] - part->offsets[0] : 1, row = has_rows ? ROW : corners;
    m->connectivity = malloc((size_t)(part->cell_count * row + 1) * 8);
    assert_non_null(m->connectivity);
    for (int64_t i = 0; i < part->cell_count * row; i++) store_index(m, is_narrow, i, -1000000);
    for (int64_t i = 0; i < part->connectivity_count; i++)
        store_index(m, is_narrow, i / corners * row + i % corners, part->connectivity[i] + in->mesh.index_base);
    in->mesh.cell_type = type_of_kind[in->kind];
    in->mesh.cell_types = in->mesh.offsets = in->mesh.ghosts = (insitu_array){0};
    in->mesh.connectivity = (insitu_array){m->connectivity, is_narrow ? INSITU_INT32 : INSITU_INT64, 0};
    in->mesh.connectivity_row = has_rows ? ROW : 0;
    if (has_rows && part->cell_count) in->mesh.connectivity_count = (part->cell_count - 1) * ROW + corners;
}

static moved move_arrays(session_input *in, layout how)
{
    const test_mesh *part = &in->part;
    moved m = {0};
    if (how == WITH_TYPES) return m;
    move_connectivity(in, how, &m);
    if (how < NARROW) return m;
    m.coordinates = malloc((size_t)(3 * part->vertex_count + 1) * sizeof(float));
    m.values = malloc((size_t)(part->vertex_count + 1) * sizeof(float));
    assert_true(m.coordinates && m.values);
    for (int64_t i = 0; i < 3 * part->vertex_count; i++) m.coordinates[i] = (float)part->coordinates[i];
    for (int64_t i = 0; i < part->vertex_count; i++) m.values[i] = (float)part->values[i];
    insitu_mesh_interleaved(&in->mesh, m.coordinates, INSITU_FLOAT32);
    in->field.values = (insitu_array){m.values, INSITU_FLOAT32, 0};
    return m;
}

/* ---- pictures ------------------------------------------------------------------------------------------------- */

typedef struct drawing {
    caught_picture pictures[PICTURES];
    int64_t copied;
    bool is_warned, gives_reason;
} drawing;

static drawing step_and_catch(insitu_session *session, int cycle)
{
    discard_pictures();
    const insitu_status status = insitu_step(session, cycle, 0);
    if (status) fprintf(stderr, "%s\n", insitu_error(session));
    everywhere(status == INSITU_OK);
    const insitu_report *report = insitu_last_report(session);
    drawing out = {.copied = report->bytes_copied,
                   .is_warned = strstr(report->warnings, "INSITU_ORDER_") != NULL,
                   .gives_reason =
                       strstr(report->copied_why, "cells' vertices, one after the other in VTK's order") != NULL};
    for (int i = 0; i < PICTURES && own_rank == 0; i++) out.pictures[i] = caught[i];
    caught_count = 0;
    return out;
}

static drawing draw_input(const session_input *in)
{
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(scene_text));
    const insitu_status status = submit_input(session, in);
    if (status) fprintf(stderr, "%s\n", insitu_error(session));
    everywhere(status == INSITU_OK);
    drawing out = step_and_catch(session, 0);
    insitu_destroy(&session);
    return out;
}

static bool are_same_drawings(const drawing *a, const drawing *b)
{
    bool same = true;
    for (int i = 0; i < PICTURES && own_rank == 0; i++)
        same = same && memcmp(a->pictures[i].rgba, b->pictures[i].rgba, PIXELS * 4 * sizeof(float)) == 0 &&
               memcmp(a->pictures[i].depth, b->pictures[i].depth, PIXELS * sizeof(float)) == 0;
    return same;
}

static void free_drawing(drawing *d)
{
    for (int i = 0; i < PICTURES; i++) free(d->pictures[i].rgba), free(d->pictures[i].depth);
}

/* Returns whether the part has any cell whose vertices are in another order than VTK's. */
static bool has_cells_in_other_order(const test_mesh *part, insitu_vertex_order order)
{
    bool turned = false;
    for (int64_t cell = 0; cell < part->cell_count; cell++)
        for (int n = 0; n < part->offsets[cell + 1] - part->offsets[cell] && part->types[cell] != INSITU_POLYHEDRON;
             n++)
            turned = turned || find_vertex_position(order, part->types[cell], n) != n;
    return turned;
}

static void check_order_and_layout(test_mesh_kind kind, insitu_vertex_order order, layout how, int base)
{
    session_input plain = {0}, in = {0};
    input_create(&plain, kind, SIDE, TEST_RANDOM, own_rank, rank_count);
    input_create(&in, kind, SIDE, TEST_RANDOM, own_rank, rank_count);
    reorder_cells(&in.part, order);
    in.mesh.vertex_order = order;
    in.mesh.index_base = base;
    moved plain_arrays = move_arrays(&plain, how >= NARROW ? NARROW : how == ROWS ? PACKED : how);
    moved arrays = move_arrays(&in, how);
    drawing expected = draw_input(&plain), drawn = draw_input(&in);
    const bool is_copied =
        in.part.cell_count && (in.mesh.connectivity_row || has_cells_in_other_order(&in.part, order));
    everywhere(are_same_drawings(&expected, &drawn));
    everywhere(drawn.copied == expected.copied + is_copied * 4 * (in.part.connectivity_count + 1));
    everywhere(drawn.gives_reason == is_copied && !drawn.is_warned);
    free_drawing(&expected);
    free_drawing(&drawn);
    free_moved(&plain_arrays);
    free_moved(&arrays);
    input_free(&plain);
    input_free(&in);
}

static void every_order_and_layout_draws_the_same(void **state)
{
    (void)state;
    for (int order = INSITU_ORDER_VTK; order <= INSITU_ORDER_DMPLEX; order++) {
        for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++)
            check_order_and_layout(kind, (insitu_vertex_order)order, WITH_TYPES, 0);
        for (test_mesh_kind kind = TEST_TETS; kind <= TEST_PYRAMIDS; kind++)
            for (layout how = PACKED; how < LAYOUTS; how++)
                check_order_and_layout(kind, (insitu_vertex_order)order, how, how == ROWS || how == NARROW);
    }
}

/* Checks hexes of which half are given by their faces: the library must recognise these polyhedra as hexes, beside
 * hexes whose vertices are in another order. */
static void recognised_cells_work_with_any_order(void **state)
{
    (void)state;
    session_input in = {0};
    input_create(&in, TEST_HEXES, SIDE, TEST_RANDOM, own_rank, rank_count);
    test_mesh_to_polyhedra(&in.part, 0.5);
    input_describe(&in);
    drawing expected = draw_input(&in);
    reorder_cells(&in.part, INSITU_ORDER_LEXICOGRAPHIC);
    in.mesh.vertex_order = INSITU_ORDER_LEXICOGRAPHIC;
    drawing drawn = draw_input(&in);
    everywhere(are_same_drawings(&expected, &drawn) && expected.copied == drawn.copied);
    in.mesh.keep_polyhedra = 1;
    drawing kept = draw_input(&in);
    everywhere(kept.copied < drawn.copied && kept.gives_reason);
    free_drawing(&kept);
    free_drawing(&expected);
    free_drawing(&drawn);
    input_free(&in);
}

/* Checks the lower quads of hexes, drawn as shells: each quad is the first 4 entries of a row of 8 indices. */
static void quads_are_shells_in_any_order(void **state)
{
    (void)state;
    session_input in = {0};
    drawing drawn[2];
    input_create(&in, TEST_HEXES, SIDE, TEST_BLOCK, own_rank, rank_count);
    in.mesh.cell_type = INSITU_QUAD;
    in.mesh.cell_types = in.mesh.offsets = (insitu_array){0};
    in.mesh.connectivity_row = 8;
    drawn[0] = draw_input(&in);
    for (int64_t cell = 0; cell < in.part.cell_count; cell++) {
        int64_t *quad = in.part.connectivity + 8 * cell, held = quad[2];
        quad[2] = quad[3], quad[3] = held;
    }
    in.mesh.vertex_order = INSITU_ORDER_LEXICOGRAPHIC;
    drawn[1] = draw_input(&in);
    everywhere(are_same_drawings(&drawn[0], &drawn[1]));
    in.mesh.vertex_order = INSITU_ORDER_VTK;
    free_drawing(&drawn[1]);
    drawn[1] = draw_input(&in);
    everywhere(own_rank != 0 || !are_same_drawings(&drawn[0], &drawn[1]));
    free_drawing(&drawn[0]);
    free_drawing(&drawn[1]);
    input_free(&in);
}

/* Checks a wrong order of vertices and its correction. The wrong order gives a warning; after the correction the cells
 * are drawn, whatever the caller states about changes. A mesh whose vertices move keeps its reordered copy. */
static void wrong_order_can_be_corrected(void **state)
{
    (void)state;
    session_input in = {0};
    input_create(&in, TEST_HEXES, SIDE, TEST_RANDOM, own_rank, rank_count);
    drawing expected = draw_input(&in);
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(scene_text));
    reorder_cells(&in.part, INSITU_ORDER_LEXICOGRAPHIC);
    for (int step = 0; step < 3; step++) {
        in.mesh.changed = step == 2 ? INSITU_CHANGED_GEOMETRY : INSITU_CHANGED_NOTHING;
        in.mesh.vertex_order = step ? INSITU_ORDER_LEXICOGRAPHIC : INSITU_ORDER_VTK;
        everywhere(submit_input(session, &in) == INSITU_OK);
        drawing drawn = step_and_catch(session, step);
        everywhere(drawn.is_warned == (step == 0));
        everywhere(own_rank != 0 || are_same_drawings(&expected, &drawn) == (step > 0));
        free_drawing(&drawn);
    }
    insitu_destroy(&session);
    /* exchanges the vertices back, so that the declared order is wrong */
    reorder_cells(&in.part, INSITU_ORDER_LEXICOGRAPHIC);
    drawing drawn = draw_input(&in);
    everywhere(drawn.is_warned);
    free_drawing(&drawn);
    free_drawing(&expected);
    input_free(&in);
}

/* ---- errors --------------------------------------------------------------------------------------------------- */

static moved corrupted;

static void use_rows(session_input *in)
{
    free_moved(&corrupted);
    corrupted = move_arrays(in, ROWS);
}
static void set_unknown_order(session_input *in)
{
    in->mesh.vertex_order = (insitu_vertex_order)6;
}
static void set_negative_row(session_input *in)
{
    use_rows(in);
    in->mesh.connectivity_row = -8;
}
static void set_short_row(session_input *in)
{
    use_rows(in);
    in->mesh.connectivity_row = 7;
}
static void set_huge_row(session_input *in)
{
    use_rows(in);
    in->mesh.connectivity_row = INT64_MAX;
}
static void remove_last_entry(session_input *in)
{
    use_rows(in);
    in->mesh.connectivity_count--;
}
static void remove_entries(session_input *in)
{
    use_rows(in);
    in->mesh.connectivity_count = 4;
}
static void set_rows_and_offsets(session_input *in)
{
    in->mesh.cell_types.data = NULL;
    in->mesh.cell_type = INSITU_HEX;
    in->mesh.connectivity_row = 8;
}
static void set_rows_and_types(session_input *in)
{
    in->mesh.offsets.data = NULL;
    in->mesh.connectivity_row = 8;
}
static void set_large_vertex_in_row(session_input *in)
{
    use_rows(in);
    in->mesh.vertex_order = INSITU_ORDER_LEXICOGRAPHIC;
    ((int64_t *)corrupted.connectivity)[3 * ROW + 2] = -5;
}
/* Sets an index out of range that would be a valid one if it were truncated to 4 bytes. */
static void set_far_vertex_in_row(session_input *in)
{
    use_rows(in);
    ((int64_t *)corrupted.connectivity)[ROW + 1] = ((int64_t)1 << 32) + 1;
}
static void set_vertex_before_one(session_input *in)
{
    in->mesh.index_base = 1;
    use_rows(in);
    ((int64_t *)corrupted.connectivity)[ROW + 7] = 0;
}
static void set_offsets_with_order(session_input *in)
{
    in->mesh.vertex_order = INSITU_ORDER_LEXICOGRAPHIC;
    in->part.offsets[2]++;
}
static void set_far_offsets(session_input *in)
{
    in->mesh.vertex_order = INSITU_ORDER_LEXICOGRAPHIC;
    in->part.offsets[1] = INT64_MAX - 3;
}
static void set_type_without_order(session_input *in)
{
    in->mesh.vertex_order = INSITU_ORDER_LEXICOGRAPHIC;
    in->part.types[1] = 99;
}

static const corrupted_case cases[] = {
    {"order",
     set_unknown_order,
     INSITU_ERROR_ARGUMENT,
     true,
     {"vertex_order is 6, expected 0 (VTK's), 1 (lexicographic)"}},
    {"row -8", set_negative_row, INSITU_ERROR_MESH, true, {"connectivity_row is -8, a cell has 8 vertices"}},
    {"row 7", set_short_row, INSITU_ERROR_MESH, true, {"connectivity_row is 7, a cell has 8 vertices"}},
    {"huge row", set_huge_row, INSITU_ERROR_MESH, true, {"too few for ", "in rows of 9223372036854775807"}},
    {"one less", remove_last_entry, INSITU_ERROR_MESH, true, {"too few for ", "cells of 8 vertices in rows of 27"}},
    {"four", remove_entries, INSITU_ERROR_MESH, true, {"connectivity_count is 4, too few for "}},
    {"offsets", set_rows_and_offsets, INSITU_ERROR_MESH, true, {"connectivity_row is 8 and offsets are given"}},
    {"types", set_rows_and_types, INSITU_ERROR_MESH, true, {"cell types are given without offsets"}},
    {"vertex", set_large_vertex_in_row, INSITU_ERROR_MESH, false, {"cell 3 (hex): vertex index -5 is outside 0.."}},
    {"far", set_far_vertex_in_row, INSITU_ERROR_MESH, false, {"cell 1 (hex): vertex index 4294967297 is outside 0.."}},
    {"0 of 1",
     set_vertex_before_one,
     INSITU_ERROR_MESH,
     false,
     {"cell 1 (hex): vertex index 0 is outside 1..", "is 1)"}},
    {"bad offsets", set_offsets_with_order, INSITU_ERROR_MESH, false, {"cell 1 (hex): offsets "}},
    {"far offsets", set_far_offsets, INSITU_ERROR_MESH, false, {"cell 0 (hex): offsets "}},
    {"bad type", set_type_without_order, INSITU_ERROR_MESH, false, {"cell 1: unknown cell type 99"}},
};

static void wrong_input_is_reported_on_all_ranks(void **state)
{
    (void)state;
    session_input in = {0};
    input_create(&in, TEST_HEXES, 3, TEST_RANDOM, own_rank, rank_count);
    check_all_faults_are_reported(&in, cases, sizeof cases / sizeof cases[0]);
    input_free(&in);
    free_moved(&corrupted);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_order_and_layout_draws_the_same), cmocka_unit_test(recognised_cells_work_with_any_order),
        cmocka_unit_test(quads_are_shells_in_any_order), cmocka_unit_test(wrong_order_can_be_corrected),
        cmocka_unit_test(wrong_input_is_reported_on_all_ranks)};
    return run_session_tests(argc, argv, tests, NULL, NULL);
}
