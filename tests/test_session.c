/* Checks the life of a session on any number of ranks: what is built in which step, what is borrowed or copied, ranks
 * without cells, scenes edited during a run, ranks with different arguments, and failed allocations. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "memory.h"
#include "session.h"
#include "test_effort.h"
#include "test_session_fixture.h"

#define IMAGE(name, every, layer, rest)                                                                                \
    "  - name: " name "\n    size: [24, 16]\n    every: " every "\n    background: [0, 0, 0, 1]\n    layers:\n"        \
    "      - " layer "\n" rest "    outputs:\n      - path: " name "_{cycle}.exr\n"
#define SURFACE "isosurface: {field: f, values: [0.1]}"
#define VOLUME "volume: {field: f, opacity: [[0, 0.5], [1, 0.5]]}"

static const char plain_scene[] = "images:\n" IMAGE("a", "1", SURFACE, "");

static session_input input;

static void check_step_draws(insitu_session *session, int64_t cycle, int images)
{
    discard_pictures();
    const insitu_status status = insitu_step(session, cycle, 0.5 * (double)cycle);
    check_reported_everywhere(session, status, INSITU_OK, "");
    everywhere(insitu_last_report(session)->images == images);
    everywhere(caught_count == (own_rank == 0 ? images : 0));
}

static int count_covered_pixels(const caught_picture *picture)
{
    int count = 0;
    for (int i = 0; i < picture->width * picture->height; i++)
        count += picture->rgba[4 * i] + picture->rgba[4 * i + 1] + picture->rgba[4 * i + 2] > 0;
    return count;
}

/* ---- due images, and rebuilds ------------------------------------------------------------------------------ */

static void images_are_drawn_when_due(void **context)
{
    (void)context;
    insitu_session *session =
        open_session(MPI_COMM_WORLD, write_scene("images:\n" IMAGE("a", "2", SURFACE, "") IMAGE("b", "3", VOLUME, "")));
    everywhere(submit_input(session, &input) == INSITU_OK);
    const int expected[] = {2, 0, 1, 1, 1, 0, 2};
    for (int cycle = 0; cycle < 7; cycle++) check_step_draws(session, cycle, expected[cycle]);
    everywhere(own_rank != 0 || (!strcmp(caught[0].path, "a_6.exr") && !strcmp(caught[1].path, "b_6.exr")));
    everywhere(insitu_last_report(session)->cycle == 6 && insitu_last_report(session)->time == 3);
    insitu_destroy(&session);
}

static void unchanged_input_rebuilds_nothing(void **context)
{
    (void)context;
    insitu_session *session =
        open_session(MPI_COMM_WORLD, write_scene("images:\n" IMAGE("a", "1", SURFACE, "      - " VOLUME "\n")));
    everywhere(submit_input(session, &input) == INSITU_OK);
    check_step_draws(session, 0, 1);
    const caught_picture first = caught[0];
    caught_count = 0;
    everywhere(insitu_last_report(session)->build_ms > 0 || input.part.cell_count == 0);
    session_input same = input;
    same.mesh.changed = same.field.changed = INSITU_CHANGED_NOTHING;
    everywhere(submit_input(session, &same) == INSITU_OK);
    check_step_draws(session, 1, 1);
    const insitu_report *report = insitu_last_report(session);
    everywhere(report->build_ms == 0 && report->refit_ms == 0);
    everywhere(own_rank != 0 || are_same_pictures(&first, &caught[0]));
    same.field.changed = INSITU_CHANGED_VALUES; /* the caller's statement is used, although no values changed */
    everywhere(submit_input(session, &same) == INSITU_OK);
    check_step_draws(session, 2, 1);
    everywhere(report->build_ms == 0 && report->refit_ms == 0);
    everywhere(strstr(report->left_out, "\"f\" has the values of the last picture"));
    everywhere(own_rank != 0 || are_same_pictures(&first, &caught[0]));
    same.field.changed = INSITU_CHANGED_NOTHING;
    same.mesh.changed = INSITU_CHANGED_GEOMETRY;
    everywhere(submit_input(session, &same) == INSITU_OK);
    check_step_draws(session, 3, 1);
    everywhere(report->build_ms == 0 && (report->refit_ms > 0 || input.part.cell_count == 0));
    everywhere(own_rank != 0 || are_same_pictures(&first, &caught[0]));
    if (own_rank == 0) free(first.rgba), free(first.depth);
    insitu_destroy(&session);
}

/* Checks that the session detects a single changed value on one rank, at any index. */
static void changed_values_are_detected(void **context)
{
    (void)context;
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene("images:\n" IMAGE("a", "1", VOLUME, "")));
    session_input in;
    input_create(&in, TEST_TETS, 4, TEST_BLOCK, own_rank, rank_count);
    everywhere(submit_input(session, &in) == INSITU_OK);
    check_step_draws(session, 0, 1);
    in.mesh.changed = INSITU_CHANGED_NOTHING;
    for (int64_t cycle = 1; cycle < 20; cycle++) {
        const int64_t spots[] = {0, in.part.vertex_count / 3 + cycle, in.part.vertex_count - cycle};
        if (in.part.vertex_count > 60)
            in.part.values[spots[cycle % 3]] = nextafter(in.part.values[spots[cycle % 3]], 9);
        everywhere(submit_input(session, &in) == INSITU_OK);
        check_step_draws(session, cycle, 1);
        everywhere(insitu_last_report(session)->refit_ms > 0 || in.part.vertex_count <= 60);
    }
    input_free(&in);
    insitu_destroy(&session);
}

/* Checks that the picture stays the same and its depth is scaled if the mesh and the camera are moved and scaled by
 * powers of two. */
static void moved_mesh_draws_the_moved_picture(void **context)
{
    (void)context;
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(plain_scene));
    everywhere(submit_input(session, &input) == INSITU_OK);
    check_step_draws(session, 0, 1);
    const caught_picture first = caught[0];
    caught_count = 0;
    session_input moved = input;
    double *coordinates = test_calloc((size_t)input.part.vertex_count * 3 + 1, sizeof *coordinates);
    for (int64_t i = 0; i < 3 * input.part.vertex_count; i++) coordinates[i] = 64 * input.part.coordinates[i];
    insitu_mesh_interleaved(&moved.mesh, coordinates, INSITU_FLOAT64);
    moved.mesh.changed = INSITU_CHANGED_GEOMETRY;
    moved.field.changed = INSITU_CHANGED_NOTHING;
    everywhere(submit_input(session, &moved) == INSITU_OK);
    check_step_draws(session, 1, 1);
    for (int i = 0; own_rank == 0 && i < 24 * 16; i++) caught[0].depth[i] /= 64;
    everywhere(own_rank != 0 || are_same_pictures(&first, &caught[0]));
    if (own_rank == 0) free(first.rgba), free(first.depth);
    insitu_destroy(&session);
    test_free(coordinates);
}

/* ---- arrays borrowed or copied -------------------------------------------------------------------------------- */

static insitu_array make_array(const grid_array *a)
{
    const insitu_type type =
        a->is_integer ? (a->is_wide ? INSITU_INT64 : INSITU_INT32) : (a->is_wide ? INSITU_FLOAT64 : INSITU_FLOAT32);
    return (insitu_array){a->data, type, a->stride};
}

static void native_layouts_are_not_copied(void **context)
{
    (void)context;
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(plain_scene));
    test_mesh rounded;
    session_input in;
    input_create(&in, TEST_HEXES, 4, TEST_BLOCK, own_rank, rank_count);
    rounded = in.part;
    test_mesh_round_to_float(&rounded);
    caught_picture first = {0};
    for (int bits = 0; bits < 32; bits++) {
        const test_layout layout = {.wide_coordinates = bits & 1,
                                    .wide_indices = bits & 2,
                                    .wide_values = bits & 4,
                                    .is_interleaved = bits & 8,
                                    .with_types = bits & 16};
        test_view view;
        test_view_create(&rounded, layout, &view);
        insitu_mesh mesh;
        insitu_field field = in.field;
        insitu_mesh_defaults(&mesh);
        mesh.vertex_count = view.cells.vertex_count;
        for (int axis = 0; axis < 3; axis++) mesh.coordinates[axis] = make_array(&view.cells.coordinates[axis]);
        mesh.cell_count = view.cells.cell_count;
        mesh.cell_type = INSITU_HEX;
        mesh.connectivity_count = rounded.connectivity_count;
        mesh.connectivity = make_array(&view.cells.connectivity);
        if (view.cells.offsets.data) mesh.offsets = make_array(&view.cells.offsets);
        if (view.cells.cell_types) {
            const insitu_type types[] = {[1] = INSITU_UINT8, [4] = INSITU_INT32, [8] = INSITU_INT64};
            mesh.cell_types =
                (insitu_array){view.cells.cell_types, types[view.cells.cell_types_bytes], view.cells.cell_types_stride};
        }
        field.values = make_array(&view.field.values);
        everywhere(insitu_set_mesh(session, "m", &mesh) == INSITU_OK);
        everywhere(insitu_set_field(session, "m", &field) == INSITU_OK);
        check_step_draws(session, bits, 1);
        const insitu_report *report = insitu_last_report(session);
        int64_t borrowed = rounded.vertex_count * (layout.wide_coordinates ? 24 : 12) +
                           rounded.connectivity_count * (layout.wide_indices ? 8 : 4) +
                           rounded.vertex_count * (layout.wide_values ? 8 : 4);
        if (view.cells.offsets.data) borrowed += (rounded.cell_count + 1) * (view.cells.offsets.is_wide ? 8 : 4);
        if (view.cells.cell_types) borrowed += rounded.cell_count * view.cells.cell_types_bytes;
        everywhere(report->bytes_copied == 0 && !strcmp(report->copied_why, ""));
        everywhere(report->bytes_borrowed == borrowed);
        everywhere(report->cells == rounded.cell_count && report->cells_ghost == 0 && report->cells_inverted == 0);
        if (own_rank == 0 && bits == 0) {
            first = caught[0];
            caught_count = 0;
        }
        everywhere(own_rank != 0 || bits == 0 || are_same_pictures(&first, &caught[0]));
        test_view_free(&view);
    }
    free(first.rgba);
    free(first.depth);
    insitu_destroy(&session);
    input_free(&in);
}

static void cells_invisible_in_all_pictures_are_skipped(void **context)
{
    (void)context;
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(plain_scene));
    insitu_field other = input.field;
    other.name = "g";
    everywhere(submit_input(session, &input) == INSITU_OK);
    check_step_draws(session, 0, 1);
    const int64_t trees = insitu_last_report(session)->bytes_trees;
    everywhere(insitu_set_field(session, "m", &other) == INSITU_OK);
    everywhere(insitu_set_mesh(session, "unseen", &input.mesh) == INSITU_OK);
    check_step_draws(session, 1, 1);
    const insitu_report *report = insitu_last_report(session);
    everywhere(strstr(report->left_out, "mesh \"m\": field \"g\"") != NULL);
    everywhere(strstr(report->left_out, "mesh \"unseen\"") != NULL);
    everywhere(report->bytes_trees == trees);
    insitu_destroy(&session);
}

static int64_t sum_over_ranks(int64_t value)
{
    int64_t sum = 0;
    MPI_Allreduce(&value, &sum, 1, MPI_INT64_T, MPI_SUM, MPI_COMM_WORLD);
    return sum;
}

/* Checks the number of left-handed cells. Half of the lattice's pyramids are left-handed from the beginning, because
 * their bases are numbered in the same direction on opposite sides of a cube. */
static void mirrored_cells_are_counted(void **context)
{
    (void)context;
    for (int kind = 0; kind < TEST_KIND_COUNT; kind++) {
        if (kind == TEST_POLYHEDRA) continue; /* polyhedra have no handedness */
        insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(plain_scene));
        session_input in;
        input_create(&in, (test_mesh_kind)kind, 3, TEST_BLOCK, own_rank, rank_count);
        everywhere(submit_input(session, &in) == INSITU_OK);
        check_step_draws(session, 0, 1);
        const int64_t before = insitu_last_report(session)->cells_inverted, cells = in.part.cell_count;
        if (kind == TEST_PYRAMIDS)
            everywhere(2 * sum_over_ranks(before) == sum_over_ranks(cells));
        else
            everywhere(kind == TEST_MIXED || before == 0);
        test_mesh_mirror_cells(&in.part, false);
        everywhere(submit_input(session, &in) == INSITU_OK);
        check_step_draws(session, 1, 1);
        everywhere(insitu_last_report(session)->cells_inverted == cells - before);
        insitu_destroy(&session);
        input_free(&in);
    }
}

static void ghosts_are_counted_and_not_drawn(void **context)
{
    (void)context;
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(plain_scene));
    session_input in;
    input_create(&in, TEST_HEXES, 4, TEST_BLOCK, own_rank, rank_count);
    for (int64_t cell = 0; cell < in.part.cell_count; cell += 3) in.part.ghosts[cell] = 1;
    test_mesh_mirror_cells(&in.part, false);
    everywhere(submit_input(session, &in) == INSITU_OK);
    check_step_draws(session, 0, 1);
    const int64_t ghosts = (in.part.cell_count + 2) / 3;
    everywhere(insitu_last_report(session)->cells_ghost == ghosts);
    everywhere(insitu_last_report(session)->cells_inverted == in.part.cell_count - ghosts);
    memset(in.part.ghosts, 1, (size_t)in.part.cell_count);
    everywhere(submit_input(session, &in) == INSITU_OK);
    check_step_draws(session, 1, 1);
    everywhere(own_rank != 0 || count_covered_pixels(&caught[0]) == 0);
    insitu_destroy(&session);
    input_free(&in);
}

/* ---- few or no cells ----------------------------------------------------------------------------------------- */

static void empty_meshes_draw_the_background(void **context)
{
    (void)context;
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(plain_scene));
    check_step_draws(session, 0, 1);
    everywhere(own_rank != 0 || (count_covered_pixels(&caught[0]) == 0 && isinf(caught[0].depth[0])));
    insitu_mesh none;
    insitu_mesh_defaults(&none);
    everywhere(insitu_set_mesh(session, "m", &none) == INSITU_OK);
    check_step_draws(session, 1, 1);
    everywhere(own_rank != 0 || count_covered_pixels(&caught[0]) == 0);
    insitu_destroy(&session);
}

static void cells_on_one_rank_are_drawn(void **context)
{
    (void)context;
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(plain_scene));
    session_input all;
    input_create(&all, TEST_MIXED, 3, TEST_BLOCK, 0, 1);
    caught_picture first = {0};
    for (int holder = 0; holder < rank_count; holder++) {
        insitu_mesh none;
        insitu_mesh_defaults(&none);
        if (own_rank == holder)
            everywhere(submit_input(session, &all) == INSITU_OK);
        else /* odd ranks have an empty mesh, even ranks have no mesh */
            everywhere(insitu_set_mesh(session, "m", own_rank % 2 ? &none : NULL) == INSITU_OK);
        check_step_draws(session, holder, 1);
        everywhere(own_rank != 0 || count_covered_pixels(&caught[0]) > 20);
        if (own_rank == 0 && holder == 0) {
            first = caught[0];
            caught_count = 0;
        }
        everywhere(own_rank != 0 || holder == 0 || are_same_pictures(&first, &caught[0]));
    }
    free(first.rgba);
    free(first.depth);
    insitu_destroy(&session);
    input_free(&all);
}

/* Checks that the picture of two meshes with different names, into which every rank's part is divided, is that of one
 * mesh. */
static void several_meshes_draw_one_picture(void **context)
{
    (void)context;
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(plain_scene));
    everywhere(submit_input(session, &input) == INSITU_OK);
    check_step_draws(session, 0, 1);
    const caught_picture first = caught[0];
    caught_count = 0;
    everywhere(insitu_set_mesh(session, "m", NULL) == INSITU_OK);
    session_input halves[2];
    for (int half = 0; half < 2; half++) {
        char name[32];
        snprintf(name, sizeof name, "part %d", 2 * (rank_count - own_rank) + half);
        input_create(&halves[half], TEST_HEXES, 4, TEST_RANDOM, own_rank, rank_count);
        session_input *in = &halves[half];
        for (int64_t cell = 0; cell < in->part.cell_count; cell++) in->part.ghosts[cell] = cell % 2 == half;
        everywhere(insitu_set_mesh(session, name, &in->mesh) == INSITU_OK);
        everywhere(insitu_set_field(session, name, &in->field) == INSITU_OK);
    }
    check_step_draws(session, 1, 1);
    everywhere(own_rank != 0 || are_same_pictures(&first, &caught[0]));
    if (own_rank == 0) free(first.rgba), free(first.depth);
    insitu_destroy(&session);
    for (int half = 0; half < 2; half++) input_free(&halves[half]);
}

static bool has_overlap_warning(const insitu_session *session)
{
    return strstr(insitu_last_report(session)->warnings, "where cells overlap") != NULL;
}

/* Checks two meshes at the same position, both on one rank or distributed over the ranks. The pictures must be the
 * same, and every rank must have a warning. */
static void overlapping_meshes_draw_one_picture(void **context)
{
    (void)context;
    insitu_session *session =
        open_session(MPI_COMM_WORLD, write_scene("images:\n" IMAGE("a", "1", VOLUME, "    sampling: {frames: 2}\n")));
    session_input whole[2], distributed[2];
    caught_picture first = {0};
    for (int i = 0; i < 2; i++) {
        const test_mesh_kind kind = i ? TEST_TETS : TEST_HEXES;
        input_create(&whole[i], kind, 3 + i, TEST_BLOCK, 0, 1);
        input_create(&distributed[i], kind, 3 + i, TEST_RANDOM, own_rank, rank_count);
    }
    for (int turn = 0; turn < 2; turn++) {
        const session_input *in = turn ? distributed : whole;
        for (int i = 0; i < 2; i++) {
            const bool has_part = turn || own_rank == rank_count - 1;
            const char *const name = i ? "tets" : "hexes";
            everywhere(insitu_set_mesh(session, name, has_part ? &in[i].mesh : NULL) == INSITU_OK);
            everywhere(!has_part || insitu_set_field(session, name, &in[i].field) == INSITU_OK);
        }
        check_step_draws(session, turn, 1);
        /* the warning is given only in the first of these steps */
        everywhere(has_overlap_warning(session) == (turn == 0));
        if (own_rank != 0 || turn) continue;
        first = caught[0];
        caught_count = 0;
    }
    double worst = 0;
    for (int i = 0; own_rank == 0 && i < 24 * 16 * 4; i++)
        worst = test_larger_error(worst, fabs((double)first.rgba[i] - (double)caught[0].rgba[i]));
    everywhere(worst <= 1e-6 && (own_rank != 0 || count_covered_pixels(&first) > 20));
    everywhere(insitu_set_mesh(session, "tets", NULL) == INSITU_OK);
    check_step_draws(session, 2, 1);
    everywhere(!has_overlap_warning(session));
    everywhere(insitu_set_mesh(session, "tets", &distributed[1].mesh) == INSITU_OK);
    everywhere(insitu_set_field(session, "tets", &distributed[1].field) == INSITU_OK);
    check_step_draws(session, 3, 1);
    /* the warning is given again after the overlap has disappeared and returned */
    everywhere(has_overlap_warning(session));
    free(first.rgba);
    free(first.depth);
    insitu_destroy(&session);
    for (int i = 0; i < 2; i++) {
        input_free(&whole[i]);
        input_free(&distributed[i]);
    }
}

static void constant_fields_are_drawn(void **context)
{
    (void)context;
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene("images:\n" IMAGE("a", "1", VOLUME, "")));
    session_input in;
    input_create(&in, TEST_HEXES, 4, TEST_RANDOM, own_rank, rank_count);
    const double constants[] = {0, 7, -1e30, 1e-300};
    for (int i = 0; i < 4; i++) {
        for (int64_t v = 0; v < in.part.vertex_count; v++) in.part.values[v] = constants[i];
        everywhere(submit_input(session, &in) == INSITU_OK);
        check_step_draws(session, i, 1);
        bool is_finite = true;
        for (int p = 0; own_rank == 0 && p < 24 * 16 * 4; p++) is_finite = is_finite && isfinite(caught[0].rgba[p]);
        everywhere(is_finite);
        everywhere(own_rank != 0 || count_covered_pixels(&caught[0]) > 20);
    }
    insitu_destroy(&session);
    input_free(&in);
}

/* ---- errors on all ranks ------------------------------------------------------------------------------------- */

static void missing_field_leaves_the_other_picture(void **context)
{
    (void)context;
    insitu_session *session = open_session(
        MPI_COMM_WORLD, write_scene("images:\n" IMAGE("a", "1", "isosurface: {field: presure, values: [1]}", "") IMAGE(
                            "b", "1", SURFACE, "") IMAGE("c", "1", "volume: {field: f, component: 2}", "")));
    everywhere(submit_input(session, &input) == INSITU_OK);
    discard_pictures();
    const insitu_status status = insitu_step(session, 0, 0);
    check_reported_everywhere(session, status, INSITU_ERROR_FIELD,
                              ".yaml:7: no mesh has the field \"presure\"; there are", "\"f\" (mesh \"m\")");
    everywhere(insitu_last_report(session)->images == 1);
    everywhere(own_rank != 0 || (caught_count == 1 && !strcmp(caught[0].path, "b_0.exr")));
    insitu_destroy(&session);
}

static void missing_component_is_reported(void **context)
{
    (void)context;
    insitu_session *session =
        open_session(MPI_COMM_WORLD, write_scene("images:\n" IMAGE("c", "1", "volume: {field: f, component: 2}", "")));
    everywhere(submit_input(session, &input) == INSITU_OK);
    const insitu_status status = insitu_step(session, 0, 0);
    check_reported_everywhere(session, status, INSITU_ERROR_FIELD, ".yaml:7: component 2 of field \"f\"",
                              "it has components 0 to 0");
    insitu_destroy(&session);
}

/* Checks images that are due at times that are multiples of a quarter. Times are sums of 0.1: the tenth is less than 1
 * by a rounding, and counts as 1. A step that passes several multiples draws one time, and a step whose time does not
 * increase draws nothing. */
static void images_are_drawn_when_their_time_has_passed(void **context)
{
    (void)context;
    static const int expected[] = {1, 0, 0, 1, 0, 1, 0, 0, 1, 0, 1};
    insitu_session *session =
        open_session(MPI_COMM_WORLD, write_scene("images:\n  - name: a\n    size: [24, 16]\n    every_time: 0.25\n"
                                                 "    layers:\n      - " SURFACE "\n"
                                                 "    outputs:\n      - path: a_{cycle}_{time:.2f}.exr\n"));
    everywhere(submit_input(session, &input) == INSITU_OK);
    double time = 0;
    for (int cycle = 0; cycle < 11; cycle++, time += 0.1) {
        discard_pictures();
        check_reported_everywhere(session, insitu_step(session, cycle, time), INSITU_OK, "");
        everywhere(insitu_last_report(session)->images == expected[cycle]);
    }
    everywhere(own_rank != 0 || !strcmp(caught[0].path, "a_10_1.00.exr"));
    const double later[] = {7.1, 7.1, 7.2, 7.3};
    const int then[] = {1, 0, 0, 1};
    for (int i = 0; i < 4; i++) {
        check_reported_everywhere(session, insitu_step(session, 11 + i, later[i]), INSITU_OK, "");
        everywhere(insitu_last_report(session)->images == then[i]);
    }
    discard_pictures();
    insitu_destroy(&session);
}

static void ranks_at_different_cycles_are_reported(void **context)
{
    (void)context;
    if (rank_count < 2) return;
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(plain_scene));
    everywhere(submit_input(session, &input) == INSITU_OK);
    const insitu_status status = insitu_step(session, own_rank == 1 ? 5 : 4, 0);
    check_reported_everywhere(session, status, INSITU_ERROR_MPI, "ranks disagree on the cycle: 4 on one, 5 on another");
    check_step_draws(session, 6, 1);
    insitu_destroy(&session);
}

static void picture_that_cannot_be_written_is_reported_on_all_ranks(void **context)
{
    (void)context;
    insitu_session *session =
        open_session(MPI_COMM_WORLD, write_scene("images:\n" IMAGE("a", "1", SURFACE, "") IMAGE("b", "1", VOLUME, "")));
    everywhere(submit_input(session, &input) == INSITU_OK);
    discard_pictures();
    unwritable = "a_";
    const insitu_status status = insitu_step(session, 3, 0);
    unwritable = NULL;
    check_reported_everywhere(session, status, INSITU_ERROR_IO, "rank 0: image \"a\": a_3.exr: cannot be written");
    everywhere(own_rank != 0 || (caught_count == 1 && !strcmp(caught[0].path, "b_3.exr")));
    check_step_draws(session, 4, 2);
    insitu_destroy(&session);
}

static void edited_scene_is_used_unless_it_is_invalid(void **context)
{
    (void)context;
    static const char edited[] = "the scene file was edited: its images are drawn from this step on";
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(plain_scene));
    everywhere(submit_input(session, &input) == INSITU_OK);
    check_step_draws(session, 0, 1);
    write_scene("images:\n" IMAGE("first", "1", SURFACE, "") IMAGE("second", "1", VOLUME, ""));
    for (int again = 0; again < 2; again++) {
        check_step_draws(session, 1, 2);
        everywhere(!strcmp(insitu_last_report(session)->warnings, again ? "" : edited));
    }
    write_scene("images:\n  - nmae: a\n");
    for (int cycle = 2; cycle < 4; cycle++) {
        check_step_draws(session, cycle, 2);
        everywhere(strstr(insitu_last_report(session)->warnings, "last edit was not taken") != NULL);
        everywhere(strstr(insitu_last_report(session)->warnings, ".yaml:2: ") != NULL);
    }
    write_scene(plain_scene);
    check_step_draws(session, 4, 1);
    everywhere(!strcmp(insitu_last_report(session)->warnings, edited));
    insitu_destroy(&session);
}

/* Checks images without outputs. They are drawn if the caller keeps pictures in memory. Otherwise a warning states that
 * they are not drawn. */
static void images_without_outputs_are_kept_in_memory(void **context)
{
    (void)context;
    static const char scene[] = "images:\n  - {name: a, size: [24, 16], layers: [" SURFACE "]}\n";
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(scene));
    int count = 0;
    everywhere(submit_input(session, &input) == INSITU_OK);
    for (int cycle = 0; cycle < 4; cycle++) {
        if (cycle == 2) everywhere(insitu_keep_pictures(session, 1) == INSITU_OK);
        discard_pictures();
        everywhere(insitu_step(session, cycle, 0) == INSITU_OK && caught_count == 0);
        everywhere(insitu_last_report(session)->images == (cycle > 1));
        const insitu_picture *kept = insitu_last_pictures(session, &count);
        everywhere(count == (cycle > 1 && own_rank == 0) && (!kept || kept->width == 24));
        const bool is_reported = strstr(insitu_last_report(session)->warnings, "\"a\": it has no outputs") != NULL;
        everywhere(is_reported == (cycle == 0));
    }
    insitu_destroy(&session);
}

static void invalid_scene_opens_no_session(void **context)
{
    (void)context;
    insitu_session *session = (insitu_session *)&input;
    insitu_status status = insitu_create(MPI_COMM_WORLD, write_scene("images:\n  - nmae: a\n"), &session);
    everywhere(session == NULL);
    check_reported_everywhere(NULL, status, INSITU_ERROR_SCENE, ".yaml:2: ", "nmae");
    status = insitu_create(MPI_COMM_WORLD, own_rank == 0 ? "/nowhere/at/all.yaml" : NULL, &session);
    check_reported_everywhere(NULL, status, INSITU_ERROR_SCENE, "/nowhere/at/all.yaml: cannot be read");
    status = insitu_create(MPI_COMM_WORLD, own_rank == 0 ? NULL : "x", &session);
    check_reported_everywhere(NULL, status, INSITU_ERROR_ARGUMENT, "insitu_create: no scene is given");
    write_scene(plain_scene);
    status = insitu_create(MPI_COMM_WORLD, write_scene(plain_scene), own_rank == rank_count - 1 ? NULL : &session);
    check_reported_everywhere(NULL, status, INSITU_ERROR_ARGUMENT, "no place for the session");
    everywhere(insitu_create(MPI_COMM_NULL, "x", &session) == INSITU_ERROR_ARGUMENT);
    everywhere(insitu_destroy(&session) == INSITU_OK && insitu_destroy(NULL) == INSITU_OK);
}

/* ---- memory -------------------------------------------------------------------------------------------------- */

static const char full_scene[] =
    "images:\n" IMAGE("a", "1", SURFACE,
                      "      - isosurface: {field: c, values: [0], colour_by: {field: f}, opacity: 0.5}\n"
                      "      - " VOLUME "\n    sampling: {frames: 2}\n");

static insitu_status submit_two_meshes(insitu_session *session, insitu_field *cells)
{
    const insitu_status status = submit_input(session, &input);
    return status ? status : insitu_set_field(session, "m", cells);
}

/* Checks a scene file that is replaced by a named pipe during a run. The session must not open the pipe, because
 * opening a pipe without a writer would block forever. */
static void missing_scene_file_is_reported(void **context)
{
    (void)context;
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(plain_scene));
    const char *scene = write_scene(plain_scene);
    char kept[1100];
    snprintf(kept, sizeof kept, "%s.kept", scene);
    everywhere(submit_input(session, &input) == INSITU_OK);
    check_step_draws(session, 0, 1);
    everywhere(own_rank != 0 || (rename(scene, kept) == 0 && mkfifo(scene, 0600) == 0));
    for (int cycle = 1; cycle < 3; cycle++) {
        check_step_draws(session, cycle, 1);
        everywhere(strstr(insitu_last_report(session)->warnings, "is a named pipe (FIFO), expected a regular file"));
    }
    insitu_session *other = NULL;
    const insitu_status status = insitu_create(MPI_COMM_WORLD, scene, &other);
    check_reported_everywhere(NULL, status, INSITU_ERROR_SCENE, scene,
                              "is a named pipe (FIFO), expected a regular file");
    everywhere(own_rank != 0 || (unlink(scene) == 0 && rename(kept, scene) == 0));
    const insitu_status of_folder = insitu_create(MPI_COMM_WORLD, "/", &other);
    check_reported_everywhere(NULL, of_folder, INSITU_ERROR_SCENE,
                              "/: cannot be read: it is a directory, expected a regular file");
    insitu_destroy(&session);
}

static void memory_is_freed(void **context)
{
    (void)context;
    const int64_t before = base_memory_held();
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(full_scene));
    insitu_field cells = input.field;
    cells.name = "c", cells.centring = INSITU_CELL, cells.count = input.part.cell_count;
    int64_t held = 0;
    for (int cycle = 0; cycle < 4; cycle++) {
        everywhere(submit_two_meshes(session, &cells) == INSITU_OK);
        check_step_draws(session, cycle, 1);
        everywhere(cycle < 2 || base_memory_held() == held);
        held = base_memory_held();
        everywhere(insitu_last_report(session)->bytes_peak >= held && held > before);
    }
    insitu_destroy(&session);
    everywhere(session == NULL && base_memory_held() == before);
}

/* Checks that the memory of the previous picture is reused for the next one, whether it is larger or smaller, and that
 * no old pixels show. */
static void picture_memory_is_kept_to_a_limit(void **context)
{
    (void)context;
    static const char large[] = "images:\n  - name: b\n    size: [100, 70]\n    layers:\n      - " SURFACE
                                "\n    outputs: [{path: b.png}]\n" IMAGE("a", "1", SURFACE, "");
    static const char huge[] = "images:\n  - name: h\n    size: [2049, 2048]\n    layers:\n      - " SURFACE
                               "\n    outputs: [{path: h.png}]\n";
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(plain_scene));
    everywhere(submit_input(session, &input) == INSITU_OK);
    check_step_draws(session, 0, 1);
    const caught_picture first = caught[0];
    caught_count = 0;
    everywhere(insitu_last_report(session)->bytes_pictures == (own_rank == 0 ? 24 * 16 * 20 : 0));
    insitu_destroy(&session);
    session = open_session(MPI_COMM_WORLD, write_scene(large));
    everywhere(submit_input(session, &input) == INSITU_OK);
    for (int cycle = 0; cycle < 2; cycle++) {
        check_step_draws(session, cycle, 2);
        everywhere(insitu_last_report(session)->bytes_pictures == (own_rank == 0 ? 100 * 70 * 16 : 0));
        everywhere(own_rank != 0 || (!caught[0].depth && are_same_pictures(&first, &caught[1])));
    }
    insitu_destroy(&session);
    session = open_session(MPI_COMM_WORLD, write_scene(huge));
    everywhere(submit_input(session, &input) == INSITU_OK);
    check_step_draws(session, 0, 1);
    everywhere(insitu_last_report(session)->bytes_pictures == 0);
    everywhere(own_rank != 0 || insitu_last_report(session)->bytes_peak >= 2049 * 2048 * 16);
    if (own_rank == 0) free(first.rgba), free(first.depth);
    insitu_destroy(&session);
}

/* Makes the n-th allocation while a mesh is set or a step is made fail, on one rank or on all. Afterwards the session
 * must draw as if the allocation had not failed. */
static void failed_allocation_returns_an_error(void **context)
{
    (void)context;
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(full_scene));
    insitu_field cells = input.field;
    cells.name = "c", cells.centring = INSITU_CELL, cells.count = input.part.cell_count;
    everywhere(submit_two_meshes(session, &cells) == INSITU_OK);
    check_step_draws(session, 0, 1);
    const caught_picture first = caught[0];
    caught_count = 0;
    const int64_t before = base_memory_held();
    /* The usual run on several ranks, where all allocations fail in turn on one rank, takes every third. */
    const int stride = rank_count > 1 ? test_case_count(3, 1) : 1;
    for (int with_all = 0; with_all < (rank_count > 1 ? 2 : 1); with_all++) {
        int failures = 0;
        for (int n = 1 + with_all;; n += stride) {
            const int64_t count_before = base_memory_allocations();
            const bool is_armed = with_all || own_rank == rank_count - 1;
            base_memory_fail_nth(is_armed ? n : 0);
            submit_two_meshes(session, &cells);
            const insitu_status status = insitu_step(session, n, 0);
            base_memory_fail_nth(0);
            int is_over = !is_armed || base_memory_allocations() - count_before < n;
            MPI_Allreduce(MPI_IN_PLACE, &is_over, 1, MPI_INT, MPI_LAND, MPI_COMM_WORLD);
            if (is_over) {
                check_reported_everywhere(session, status, INSITU_OK, "");
                break;
            }
            failures += status != INSITU_OK;
            /* the field of a refused mesh may be refused too */
            if (status != INSITU_OK && status != INSITU_ERROR_FIELD)
                check_reported_everywhere(session, status, INSITU_ERROR_MEMORY, "memory");
            everywhere(submit_two_meshes(session, &cells) == INSITU_OK);
            check_step_draws(session, n, 1);
            everywhere(own_rank != 0 || are_same_pictures(&first, &caught[0]));
        }
        everywhere(failures > 20);
    }
    /* Only texts of the report may have become longer. */
    everywhere(base_memory_held() <= before + 4096);
    if (own_rank == 0) free(first.rgba), free(first.depth);
    insitu_destroy(&session);
}

static void failing_allocation_opens_no_session(void **context)
{
    (void)context;
    const char *scene = write_scene(full_scene);
    const int64_t before = base_memory_held();
    for (int n = 1;; n++) {
        insitu_session *session = NULL;
        base_memory_fail_nth(own_rank == rank_count - 1 ? n : 0);
        const insitu_status status = insitu_create(MPI_COMM_WORLD, scene, &session);
        base_memory_fail_nth(0);
        everywhere((status == INSITU_OK) == (session != NULL));
        if (status != INSITU_OK) check_reported_everywhere(NULL, status, INSITU_ERROR_MEMORY, "memory");
        insitu_destroy(&session);
        everywhere(base_memory_held() == before);
        if (status == INSITU_OK) break;
    }
}

static int set_up_test_group(void **state)
{
    (void)state;
    input_create(&input, TEST_HEXES, 4, TEST_RANDOM, own_rank, rank_count);
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
        cmocka_unit_test(images_are_drawn_when_due),
        cmocka_unit_test(unchanged_input_rebuilds_nothing),
        cmocka_unit_test(changed_values_are_detected),
        cmocka_unit_test(moved_mesh_draws_the_moved_picture),
        cmocka_unit_test(native_layouts_are_not_copied),
        cmocka_unit_test(cells_invisible_in_all_pictures_are_skipped),
        cmocka_unit_test(mirrored_cells_are_counted),
        cmocka_unit_test(ghosts_are_counted_and_not_drawn),
        cmocka_unit_test(empty_meshes_draw_the_background),
        cmocka_unit_test(cells_on_one_rank_are_drawn),
        cmocka_unit_test(several_meshes_draw_one_picture),
        cmocka_unit_test(overlapping_meshes_draw_one_picture),
        cmocka_unit_test(constant_fields_are_drawn),
        cmocka_unit_test(missing_field_leaves_the_other_picture),
        cmocka_unit_test(missing_component_is_reported),
        cmocka_unit_test(ranks_at_different_cycles_are_reported),
        cmocka_unit_test(images_are_drawn_when_their_time_has_passed),
        cmocka_unit_test(picture_that_cannot_be_written_is_reported_on_all_ranks),
        cmocka_unit_test(edited_scene_is_used_unless_it_is_invalid),
        cmocka_unit_test(images_without_outputs_are_kept_in_memory),
        cmocka_unit_test(invalid_scene_opens_no_session),
        cmocka_unit_test(missing_scene_file_is_reported),
        cmocka_unit_test(memory_is_freed),
        cmocka_unit_test(picture_memory_is_kept_to_a_limit),
        cmocka_unit_test(failed_allocation_returns_an_error),
        cmocka_unit_test(failing_allocation_opens_no_session),
    };
    return run_session_tests(argc, argv, tests, set_up_test_group, tear_down_test_group);
}
