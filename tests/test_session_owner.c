/* Checks meshes of finite volumes, which are given by faces with an owner and a neighbour. The pictures of every form
 * of this description must be bit-identical to those of the same polyhedra given cell by cell. Polyhedra with the faces
 * of hexes, wedges, pyramids or tets must be drawn as these cell types. An error on one rank must be reported on all
 * ranks. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "memory.h"
#include "test_mesh_make.h"
#include "test_owned_faces.h"
#include "test_session_fixture.h"

enum { SIDE = 4, WIDTH = 64, HEIGHT = 48, PIXELS = WIDTH * HEIGHT };

static const char scene_text[] =
    "images:\n  - name: a\n    size: [64, 48]\n    background: [0, 0, 0, 0]\n    layers:\n"
    "      - isosurface: {field: f, values: [0.1, 0.7], opacity: 0.6, colour_by: {field: f, map: turbo}}\n"
    "      - surface: {opacity: 0.2, edges: {}}\n      - slice: {field: f, planes: [{normal: [1, 2, 3]}]}\n"
    "    outputs: [{path: a.exr}]\n"
    "  - name: b\n    size: [64, 48]\n    layers: [{isosurface: {field: f, values: [0.1]}}]\n"
    "    outputs: [{path: b.exr}]\n"
    "  - name: c\n    size: [64, 48]\n    layers: [{volume: {field: f}}]\n"
    "    outputs: [{path: c.exr}]\n";
enum { PICTURES = 3 };

/* ---- pictures -------------------------------------------------------------------------------------------------- */

typedef struct drawing {
    caught_picture pictures[PICTURES];
    int64_t recognised, copied, inverted;
} drawing;

static void step_and_catch(insitu_session *session, int cycle, drawing *out)
{
    discard_pictures();
    const insitu_status status = insitu_step(session, cycle, 0);
    if (status) fprintf(stderr, "%s\n", insitu_error(session));
    everywhere(status == INSITU_OK);
    const insitu_report *report = insitu_last_report(session);
    *out = (drawing){
        .recognised = report->cells_recognised, .copied = report->bytes_copied, .inverted = report->cells_inverted};
    for (int i = 0; i < PICTURES && own_rank == 0; i++) out->pictures[i] = caught[i];
    caught_count = 0;
}

static drawing draw_input(const char *scene, const session_input *in)
{
    drawing out;
    insitu_session *session = open_session(MPI_COMM_WORLD, scene);
    const insitu_status status = submit_input(session, in);
    if (status) fprintf(stderr, "%s\n", insitu_error(session));
    everywhere(status == INSITU_OK);
    step_and_catch(session, 0, &out);
    insitu_destroy(&session);
    return out;
}

static bool are_same_drawings(const drawing *a, const drawing *b)
{
    bool same = true;
    for (int i = 0; i < PICTURES && own_rank == 0; i++) {
        const caught_picture *p = &a->pictures[i], *q = &b->pictures[i];
        if (memcmp(p->rgba, q->rgba, PIXELS * 4 * sizeof(float)) == 0 &&
            memcmp(p->depth, q->depth, PIXELS * sizeof(float)) == 0)
            continue;
        fprintf(stderr, "picture %d differs\n", i);
        same = false;
    }
    return same;
}

static bool has_visible_pixels(const drawing *d)
{
    bool shows = own_rank != 0;
    for (int i = 0; i < 4 * PIXELS && !shows; i++) shows = d->pictures[0].rgba[i] > 0.01f;
    return shows;
}

static void free_drawing(drawing *d)
{
    for (int i = 0; i < PICTURES; i++) free(d->pictures[i].rgba), free(d->pictures[i].depth);
}

static int64_t sum_over_ranks(int64_t mine)
{
    int64_t sum = 0;
    MPI_Allreduce(&mine, &sum, 1, MPI_INT64_T, MPI_SUM, MPI_COMM_WORLD);
    return sum;
}

/* Creates cells of a kind and converts the given share of them to polyhedra. The vertices of faces run in either
 * direction. */
static void create_polyhedra(session_input *in, test_mesh_kind kind, double share)
{
    input_create(in, kind, SIDE, TEST_RANDOM, own_rank, rank_count);
    if (kind != TEST_POLYHEDRA) test_mesh_to_polyhedra(&in->part, share);
    test_mesh_reorder_vertices(&in->part, 7);
    input_describe(in);
}

/* Exchanges owner and neighbour of every second boundary face. CGNS permits this: a 0 as either of the two means that
 * there is no cell on that side. */
static void swap_owner_and_neighbour(owned *faces, int64_t count)
{
    for (int64_t face = 0; face < count; face += 2) {
        int32_t *pair = faces->pairs + 2 * face;
        if (pair[1] > 0) continue;
        pair[1] = pair[0];
        pair[0] = 0;
    }
}

static void check_forms(test_mesh_kind kind, int keep_polyhedra)
{
    session_input plain = {0};
    const char *scene = write_scene(scene_text);
    create_polyhedra(&plain, kind, 1);
    plain.mesh.keep_polyhedra = keep_polyhedra;
    drawing expected = draw_input(scene, &plain);
    everywhere(has_visible_pixels(&expected));
    for (int base = 0; base < 2; base++) {
        owned faces = make_owned_faces(&plain.part, base);
        for (form which = base ? FORM_PAIRS : 0; which < FORM_COUNT; which++) {
            session_input in = plain;
            if (base && which == FORM_LISTS) swap_owner_and_neighbour(&faces, plain.part.face_count);
            describe_owned_faces(&faces, which, base, &in.mesh);
            drawing drawn = draw_input(scene, &in);
            everywhere(are_same_drawings(&expected, &drawn));
            everywhere(drawn.recognised == expected.recognised);
            everywhere(drawn.copied > expected.copied || !keep_polyhedra);
            free_drawing(&drawn);
        }
        free_owned_faces(&faces);
    }
    free_drawing(&expected);
    input_free(&plain);
}

static void owner_neighbour_form_draws_same_picture_as_plain_form(void **state)
{
    (void)state;
    check_forms(TEST_POLYHEDRA, 1);
    check_forms(TEST_MIXED, 1);
    check_forms(TEST_POLYHEDRA, 0);
    check_forms(TEST_MIXED, 0);
}

/* ---- recognised cells ------------------------------------------------------------------------------------------- */

static void polyhedra_are_recognised_as_typed_cells(void **state)
{
    (void)state;
    static const test_mesh_kind kinds[] = {TEST_TETS, TEST_HEXES, TEST_WEDGES, TEST_PYRAMIDS, TEST_MIXED};
    const char *scene = write_scene(scene_text);
    for (size_t k = 0; k < sizeof kinds / sizeof kinds[0]; k++) {
        session_input cells = {0};
        input_create(&cells, kinds[k], SIDE, TEST_RANDOM, own_rank, rank_count);
        drawing expected = draw_input(scene, &cells);
        for (int half = 0; half < 2; half++) {
            session_input in = {0};
            create_polyhedra(&in, kinds[k], half ? 0.5 : 1);
            int64_t polyhedra = 0;
            for (int64_t c = 0; c < in.part.cell_count; c++) polyhedra += in.part.types[c] == INSITU_POLYHEDRON;
            drawing drawn = draw_input(scene, &in);
            everywhere(are_same_drawings(&expected, &drawn));
            everywhere(drawn.recognised == polyhedra && drawn.copied > expected.copied);
            everywhere(drawn.inverted == 0 || half); /* cells that were not polyhedra may be left-handed */
            free_drawing(&drawn);
            in.mesh.keep_polyhedra = 1;
            drawn = draw_input(scene, &in);
            everywhere(drawn.recognised == 0 && drawn.copied == expected.copied);
            everywhere(kinds[k] != TEST_HEXES || half || own_rank != 0 || !are_same_drawings(&expected, &drawn));
            free_drawing(&drawn);
            input_free(&in);
        }
        free_drawing(&expected);
        input_free(&cells);
    }
}

/* Splits every ninth face of the hexes, which are given as polyhedra, into two triangles. The cells of these faces
 * cannot be recognised as hexes. */
static void split_some_faces(const test_mesh *part, test_mesh *out, unsigned char *is_cut)
{
    test_mesh_allocate(out, part->vertex_count, part->cell_count, 2 * part->connectivity_count);
    test_mesh_allocate_faces(out, 2 * part->face_count, 2 * part->face_connectivity_count);
    int64_t *halves = test_allocate(2 * part->face_count, sizeof *halves);
    for (int64_t v = 0; v < part->vertex_count; v++)
        out->values[test_mesh_add_vertex(out, part->coordinates + 3 * v)] = part->values[v];
    for (int64_t face = 0; face < part->face_count; face++) {
        const int64_t *v = part->face_connectivity + part->face_offsets[face];
        const bool cut = face % 9 == 0;
        halves[2 * face] = test_mesh_add_face(out, v, cut ? 3 : 4);
        halves[2 * face + 1] = cut ? test_mesh_add_face(out, (const int64_t[]){v[0], v[2], v[3]}, 3) : -1;
    }
    for (int64_t cell = 0; cell < part->cell_count; cell++) {
        int64_t faces[12], count = 0;
        for (int64_t i = part->offsets[cell]; i < part->offsets[cell + 1]; i++) {
            const int64_t *half = halves + 2 * part->connectivity[i];
            faces[count++] = half[0];
            if (half[1] >= 0) faces[count++] = half[1], is_cut[cell] = 1;
        }
        test_mesh_add_polyhedron(out, faces, count);
    }
    free(halves);
}

/* Makes a mesh from hexes and polyhedra that describe the same cells: it takes the polyhedra of cells with a split
 * face, and the hexes of all other cells. */
static void mix_cells(const test_mesh *hexes, const test_mesh *polyhedra, const unsigned char *is_cut, test_mesh *out)
{
    test_mesh_allocate(out, hexes->vertex_count, hexes->cell_count, 12 * hexes->cell_count);
    test_mesh_allocate_faces(out, polyhedra->face_count, polyhedra->face_connectivity_count);
    for (int64_t v = 0; v < hexes->vertex_count; v++)
        out->values[test_mesh_add_vertex(out, hexes->coordinates + 3 * v)] = hexes->values[v];
    for (int64_t face = 0; face < polyhedra->face_count; face++)
        test_mesh_add_face(out, polyhedra->face_connectivity + polyhedra->face_offsets[face],
                           polyhedra->face_offsets[face + 1] - polyhedra->face_offsets[face]);
    for (int64_t cell = 0; cell < hexes->cell_count; cell++)
        if (is_cut[cell])
            test_mesh_add_polyhedron(out, polyhedra->connectivity + polyhedra->offsets[cell],
                                     polyhedra->offsets[cell + 1] - polyhedra->offsets[cell]);
        else
            test_mesh_add_cell(out, INSITU_HEX, hexes->connectivity + hexes->offsets[cell],
                               (const int[]){0, 1, 2, 3, 4, 5, 6, 7});
}

static void hexes_among_polyhedra_are_recognised(void **state)
{
    (void)state;
    session_input hexes = {0}, whole = {0}, cut = {0}, mixed = {0};
    const char *scene = write_scene(scene_text);
    input_create(&hexes, TEST_HEXES, SIDE, TEST_RANDOM, own_rank, rank_count);
    create_polyhedra(&whole, TEST_HEXES, 1);
    unsigned char *is_cut = test_allocate(hexes.part.cell_count, 1);
    split_some_faces(&whole.part, &cut.part, is_cut);
    mix_cells(&hexes.part, &cut.part, is_cut, &mixed.part);
    input_describe(&cut);
    input_describe(&mixed);
    mixed.mesh.keep_polyhedra = 1;
    drawing expected = draw_input(scene, &mixed), drawn = draw_input(scene, &cut);
    int64_t kept = 0;
    for (int64_t cell = 0; cell < hexes.part.cell_count; cell++) kept += is_cut[cell];
    everywhere(drawn.recognised == hexes.part.cell_count - kept);
    everywhere(sum_over_ranks(kept) > 0 && sum_over_ranks(drawn.recognised) > 0);
    everywhere(are_same_drawings(&expected, &drawn));
    free_drawing(&drawn);
    owned faces = make_owned_faces(&cut.part, 1);
    for (form which = FORM_PAIRS; which < FORM_COUNT; which++) {
        session_input in = cut;
        describe_owned_faces(&faces, which, 1, &in.mesh);
        drawn = draw_input(scene, &in);
        everywhere(are_same_drawings(&expected, &drawn));
        free_drawing(&drawn);
    }
    free_owned_faces(&faces);
    free_drawing(&expected);
    free(is_cut);
    input_free(&hexes);
    input_free(&whole);
    input_free(&cut);
    input_free(&mixed);
}

/* Makes a polyhedron shaped like an orange of six segments. Like a hex it has six quads and eight vertices, but every
 * quad extends from pole to pole. */
static void make_orange_polyhedron(test_mesh *out)
{
    test_mesh_allocate(out, 8, 1, 6);
    test_mesh_allocate_faces(out, 6, 24);
    int64_t faces[6];
    for (int i = 0; i < 8; i++) {
        const double turn = acos(-1) / 3 * i;
        const double p[3] = {i < 6 ? cos(turn) : 0, i < 6 ? sin(turn) : 0, i < 6 ? 0 : 13 - 2 * i};
        out->values[test_mesh_add_vertex(out, p)] = i % 2;
    }
    for (int i = 0; i < 6; i++) faces[i] = test_mesh_add_face(out, (const int64_t[]){6, i, 7, (i + 1) % 6}, 4);
    test_mesh_add_polyhedron(out, faces, 6);
}

/* Checks that a polyhedron of six quads that is not a hex stays a polyhedron. Only rank 0 has it. */
static void six_quads_that_form_no_hex_stay_a_polyhedron(void **state)
{
    (void)state;
    session_input in = {0};
    const char *scene = write_scene(scene_text);
    if (own_rank == 0)
        make_orange_polyhedron(&in.part);
    else
        input_create(&in, TEST_HEXES, 1, TEST_BLOCK, 0, 2); /* the first of two parts, which has no cell */
    everywhere(in.part.cell_count == (own_rank == 0));
    input_describe(&in);
    drawing drawn = draw_input(scene, &in);
    everywhere(drawn.recognised == 0);
    in.mesh.keep_polyhedra = 1;
    drawing kept = draw_input(scene, &in);
    everywhere(has_visible_pixels(&kept) && are_same_drawings(&kept, &drawn));
    free_drawing(&drawn);
    free_drawing(&kept);
    input_free(&in);
}

/* Checks that a hex is refused as not closed if one of its faces crosses itself; each face is tested. Only the last
 * rank has the hex. */
static void hexes_with_a_crossed_face_are_reported(void **state)
{
    (void)state;
    session_input in = {0};
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(scene_text));
    const bool has_it = own_rank == rank_count - 1;
    input_create(&in, TEST_HEXES, 1, TEST_BLOCK, 0, has_it ? 1 : 2);
    test_mesh_to_polyhedra(&in.part, 1);
    input_describe(&in);
    for (int64_t i = 0; i < 6; i++) {
        int64_t *v = has_it ? in.part.face_connectivity + 4 * i : (int64_t[]){0, 0, 0};
        const int64_t first = v[1], second = v[2];
        v[1] = second, v[2] = first;
        submit_input(session, &in);
        check_reported_everywhere(session, insitu_step(session, i, 0), INSITU_ERROR_MESH,
                                  "mesh \"m\": cell 0 (polyhedron): ", "the surface is not closed");
        v[1] = first, v[2] = second;
    }
    insitu_destroy(&session);
    input_free(&in);
}

/* Draws the mesh twice, the second time with other coordinates. Returns the second drawing. Its member `copied` is the
 * number of bytes by which the second step's copies exceed those of the first step. */
static drawing draw_moved(const char *scene, session_input *in)
{
    insitu_session *session = open_session(MPI_COMM_WORLD, scene);
    drawing before, after;
    everywhere(submit_input(session, in) == INSITU_OK);
    step_and_catch(session, 0, &before);
    for (int64_t i = 0; i < 3 * in->part.vertex_count; i++)
        in->part.coordinates[i] = 0.7 * in->part.coordinates[i] + 0.1;
    if (in->part.face_count)
        memset(in->part.connectivity, 0, (size_t)in->part.connectivity_count * sizeof *in->part.connectivity);
    in->mesh.changed = INSITU_CHANGED_GEOMETRY;
    everywhere(insitu_set_mesh(session, "m", &in->mesh) == INSITU_OK);
    step_and_catch(session, 1, &after);
    after.copied -= before.copied;
    free_drawing(&before);
    insitu_destroy(&session);
    return after;
}

/* Checks that a mesh with new coordinates reuses the cells that were recognised, without reading the faces again: the
 * faces are overwritten before the second step. */
static void moved_cells_match_cells_at_new_positions(void **state)
{
    (void)state;
    session_input hexes = {0}, in = {0};
    const char *scene = write_scene(scene_text);
    input_create(&hexes, TEST_HEXES, SIDE, TEST_RANDOM, own_rank, rank_count);
    create_polyhedra(&in, TEST_HEXES, 1);
    drawing expected = draw_moved(scene, &hexes), moved = draw_moved(scene, &in);
    everywhere(are_same_drawings(&expected, &moved));
    everywhere(moved.recognised == in.part.cell_count && moved.copied == 0);
    free_drawing(&moved);
    free_drawing(&expected);
    input_free(&hexes);
    input_free(&in);
}

/* Lets each allocation of the last rank fail, one in each run. The step must return an error on all ranks or draw the
 * picture, and the next step must draw the picture. */
static void memory_that_runs_out_is_reported(void **state)
{
    (void)state;
    session_input in = {0};
    const char *scene = write_scene(scene_text);
    create_polyhedra(&in, TEST_MIXED, 1);
    owned faces = make_owned_faces(&in.part, 1);
    describe_owned_faces(&faces, FORM_LISTS, 1, &in.mesh);
    drawing expected = draw_input(scene, &in), drawn;
    const int64_t held = base_memory_held();
    int reported = 0;
    for (int n = 1; n <= 12; n++) {
        insitu_session *s = open_session(MPI_COMM_WORLD, scene);
        everywhere(submit_input(s, &in) == INSITU_OK);
        base_memory_fail_nth(own_rank == rank_count - 1 ? n : 0);
        const insitu_status status = insitu_step(s, 0, 0);
        base_memory_fail_nth(0);
        if (status) check_reported_everywhere(s, status, INSITU_ERROR_MEMORY, "no memory");
        reported += status != INSITU_OK && strstr(insitu_error(s), "mesh \"m\"") != NULL;
        step_and_catch(s, 1, &drawn);
        everywhere(are_same_drawings(&expected, &drawn) && drawn.recognised == expected.recognised);
        free_drawing(&drawn);
        insitu_destroy(&s);
        everywhere(base_memory_held() == held);
    }
    everywhere(reported >= 6); /* arrays: 2 of the lists, 2 of owner and neighbour, 1 of types, 2 of cells */
    free_drawing(&expected);
    free_owned_faces(&faces);
    input_free(&in);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(owner_neighbour_form_draws_same_picture_as_plain_form),
        cmocka_unit_test(polyhedra_are_recognised_as_typed_cells),
        cmocka_unit_test(hexes_among_polyhedra_are_recognised),
        cmocka_unit_test(six_quads_that_form_no_hex_stay_a_polyhedron),
        cmocka_unit_test(hexes_with_a_crossed_face_are_reported),
        cmocka_unit_test(moved_cells_match_cells_at_new_positions),
        cmocka_unit_test(memory_that_runs_out_is_reported),
    };
    return run_session_tests(argc, argv, tests, NULL, NULL);
}
