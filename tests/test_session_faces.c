/* Checks a user's errors in the faces of polyhedra, on one rank only: every rank gets the same message, with the rank,
 * the mesh, the cell, the face and the value; nothing is drawn; and after the correction the next step draws. A rank's
 * faces and vertices are numbered in the order in which its cells first use them: cell 0 begins with face 0, and no
 * cell precedes it. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "memory.h"
#include "test_mesh_make.h"
#include "test_session_fixture.h"

static const char scene_text[] = "images:\n"
                                 "  - name: a\n"
                                 "    size: [24, 16]\n"
                                 "    layers:\n"
                                 "      - volume: {field: f}\n"
                                 "      - isosurface: {field: f, values: [0.1]}\n"
                                 "    outputs:\n"
                                 "      - path: a_{cycle}.exr\n";

static insitu_session *session;
static session_input input;

/* ---- errors that the set call detects ------------------------------------------------------------------------ */

static void no_face_offsets(session_input *in)
{
    in->mesh.face_offsets.data = NULL;
}
static void no_face_vertices(session_input *in)
{
    in->mesh.face_connectivity.data = NULL;
}
static void face_count_negative(session_input *in)
{
    in->mesh.face_count = -5;
}
static void face_vertex_count_negative(session_input *in)
{
    in->mesh.face_connectivity_count = -1;
}
static void float_face_vertices(session_input *in)
{
    in->mesh.face_connectivity.type = INSITU_FLOAT32;
}
static void one_type_without_offsets(session_input *in)
{
    in->mesh.cell_types.data = in->mesh.offsets.data = NULL;
    in->mesh.cell_type = INSITU_POLYHEDRON;
}

/* ---- errors that the step detects ---------------------------------------------------------------------------- */

static void no_faces_at_all(session_input *in)
{
    in->mesh.face_count = in->mesh.face_connectivity_count = 0;
    in->mesh.face_offsets.data = in->mesh.face_connectivity.data = NULL;
}
static void faces_too_few(session_input *in)
{
    in->mesh.face_count = 2;
}
static void cell_offsets_fall(session_input *in)
{
    in->part.offsets[2] = 1;
}
static void cell_offsets_far(session_input *in)
{
    in->part.offsets[1] = 1 << 30;
}
static void face_offsets_fall(session_input *in)
{
    in->part.face_offsets[1] = -2;
}
static void face_offsets_far(session_input *in)
{
    in->part.face_offsets[1] = 1 << 30;
}
static void face_connectivity_short(session_input *in)
{
    in->mesh.face_connectivity_count = 2;
}
static void face_too_small(session_input *in)
{
    in->part.face_offsets[1] = 2;
}
static void face_index_large(session_input *in)
{
    in->part.connectivity[in->part.offsets[1] + 1] = in->part.face_count + 3;
}
static void face_index_negative(session_input *in)
{
    in->part.connectivity[in->part.offsets[3]] = -7;
}
static void face_vertex_large(session_input *in)
{
    in->part.face_connectivity[1] = 1000000;
}
static void face_vertex_negative(session_input *in)
{
    in->part.face_connectivity[2] = -1;
}
static void three_faces(session_input *in)
{
    in->part.offsets[1] = in->part.offsets[0] + 3;
}
static void face_left_out(session_input *in)
{
    in->part.connectivity[0] = in->part.connectivity[1];
}
/* Gives cell 0 its first face again, taken from the entries of the next cell, which then lacks a face; cell 0 is
 * checked first. */
static void face_once_more(session_input *in)
{
    in->part.connectivity[in->part.offsets[1]] = in->part.connectivity[0];
    in->part.offsets[1]++;
}
/* Removes the last face of the first cell with more than four faces. */
static void face_missing(session_input *in)
{
    int64_t cell = 0;
    while (in->part.offsets[cell + 1] - in->part.offsets[cell] < 5) cell++;
    in->part.offsets[cell + 1]--;
}
static void one_face(session_input *in)
{
    in->part.offsets[1] = in->part.offsets[0] + 1;
}
static void cell_without_faces(session_input *in)
{
    in->part.offsets[1] = in->part.offsets[0];
}
/* Makes a face that goes back and forth: a, b, a. */
static void vertex_twice_apart(session_input *in)
{
    in->part.face_connectivity[2] = in->part.face_connectivity[0];
}
/* Makes a face a, b, b, which is only an edge. */
static void vertex_twice_beside(session_input *in)
{
    in->part.face_connectivity[2] = in->part.face_connectivity[1];
}
static void face_of_another_cell(session_input *in)
{
    in->part.connectivity[0] = in->part.connectivity[in->part.connectivity_count - 1];
}
static void coordinate_nan(session_input *in)
{
    in->part.coordinates[3 * in->part.face_connectivity[0] + 2] = NAN;
}

#define CELL_0 "cell 0 (polyhedron): "

static const corrupted_case at_once[] = {
    {"no face offsets", no_face_offsets, INSITU_ERROR_MESH, true, {"face offsets are not given"}},
    {"no face vertices", no_face_vertices, INSITU_ERROR_MESH, true, {"face vertex indices are not given"}},
    {"face count", face_count_negative, INSITU_ERROR_ARGUMENT, true, {"face_count is -5"}},
    {"vertex count", face_vertex_count_negative, INSITU_ERROR_ARGUMENT, true, {"face_connectivity_count is -1"}},
    {"float vertices",
     float_face_vertices,
     INSITU_ERROR_ARGUMENT,
     true,
     {"face vertex indices are of element type", "not an integer type"}},
    {"no cell offsets",
     one_type_without_offsets,
     INSITU_ERROR_MESH,
     true,
     {"offsets are not given: polyhedra need them"}},
};

static const corrupted_case at_the_step[] = {
    {"no faces at all",
     no_faces_at_all,
     INSITU_ERROR_MESH,
     false,
     {"cell 0 is a polyhedron, and face_offsets are not given"}},
    {"too few faces", faces_too_few, INSITU_ERROR_MESH, false, {CELL_0 "face index 2 is outside 0..1"}},
    {"cell offsets fall",
     cell_offsets_fall,
     INSITU_ERROR_MESH,
     false,
     {"cell 1 (polyhedron): offsets fall from ", " to 1; a polyhedron has at least 4 faces"}},
    {"cell offsets far",
     cell_offsets_far,
     INSITU_ERROR_MESH,
     false,
     {CELL_0 "offsets 0 and 1073741824 are outside 0.."}},
    {"face offsets fall",
     face_offsets_fall,
     INSITU_ERROR_MESH,
     false,
     {CELL_0 "face 0: offsets 0 and -2 do not rise within 0.."}},
    {"face offsets far",
     face_offsets_far,
     INSITU_ERROR_MESH,
     false,
     {CELL_0 "face 0: offsets 0 and 1073741824 do not rise within 0.."}},
    {"face connectivity short",
     face_connectivity_short,
     INSITU_ERROR_MESH,
     false,
     {CELL_0 "face 0: offsets 0 and 3 do not rise within 0..2"}},
    {"face too small",
     face_too_small,
     INSITU_ERROR_MESH,
     false,
     {CELL_0 "face 0 has 2 vertices, at least 3 are needed"}},
    {"face index large",
     face_index_large,
     INSITU_ERROR_MESH,
     false,
     {"cell 1 (polyhedron): face index ", " is outside 0.."}},
    {"face index negative",
     face_index_negative,
     INSITU_ERROR_MESH,
     false,
     {"cell 3 (polyhedron): face index -7 is outside 0.."}},
    {"vertex large",
     face_vertex_large,
     INSITU_ERROR_MESH,
     false,
     {CELL_0 "face 0: vertex index 1000000 is outside 0.."}},
    {"vertex negative", face_vertex_negative, INSITU_ERROR_MESH, false, {CELL_0 "face 0: vertex index -1 is outside"}},
    {"three faces", three_faces, INSITU_ERROR_MESH, false, {CELL_0 "3 faces, a closed surface has at least 4"}},
    {"one face", one_face, INSITU_ERROR_MESH, false, {CELL_0 "1 faces, a closed surface has at least 4"}},
    {"without faces",
     cell_without_faces,
     INSITU_ERROR_MESH,
     false,
     {CELL_0 "0 faces, a closed surface has at least 4"}},
    {"face once more",
     face_once_more,
     INSITU_ERROR_MESH,
     false,
     {CELL_0 "face ", " occurs 3 times, not once in each of two faces"}},
    {"face missing",
     face_missing,
     INSITU_ERROR_MESH,
     false,
     {" (polyhedron): face ", " occurs 1 times, not once in each of two faces"}},
    {"a face there and back",
     vertex_twice_apart,
     INSITU_ERROR_MESH,
     false,
     {CELL_0 "face ", "not once in each of two"}},
    {"a face an edge", vertex_twice_beside, INSITU_ERROR_MESH, false, {CELL_0 "face ", "not once in each of two"}},
    {"face twice", face_left_out, INSITU_ERROR_MESH, false, {CELL_0 "face ", "the surface is not closed"}},
    {"another's face", face_of_another_cell, INSITU_ERROR_MESH, false, {CELL_0 "face ", "the surface is not closed"}},
    {"NaN", coordinate_nan, INSITU_ERROR_MESH, false, {CELL_0, "vertex 0 has a coordinate that is not finite"}},
};

static void corrupted_arrays_are_reported_at_once(void **context)
{
    (void)context;
    for (size_t i = 0; i < sizeof at_once / sizeof at_once[0]; i++)
        corrupted_is_reported_on_all_ranks(session, &input, &at_once[i]);
}

static void corrupted_faces_are_reported_at_the_step(void **context)
{
    (void)context;
    for (size_t i = 0; i < sizeof at_the_step / sizeof at_the_step[0]; i++)
        corrupted_is_reported_on_all_ranks(session, &input, &at_the_step[i]);
}

/* Checks ghosts, which are not drawn: their coordinates may be anything, but their faces must be valid. */
static void ghosts_are_proved_but_for_coordinates(void **context)
{
    (void)context;
    static const corrupted_case ghost = {
        "ghost", face_vertex_large, INSITU_ERROR_MESH, false, {CELL_0 "face 0: vertex index 1000000 is outside 0.."}};
    for (int64_t cell = 0; cell < input.part.cell_count; cell++) input.part.ghosts[cell] = 1;
    coordinate_nan(&input);
    everywhere(submit(session, &input) == INSITU_OK);
    everywhere(insitu_step(session, 3, 0) == INSITU_OK);
    corrupted_is_reported_on_all_ranks(session, &input, &ghost);
}

/* ---- cells without volume ------------------------------------------------------------------------------------ */

/* Adds a flat cell next to every third cell of the part: the cell's first face twice, as front and back, closed by
 * faces that are points, or four faces that are points. Returns the number of flat cells. */
static int64_t add_flat_cells(const test_mesh *part, test_mesh *out)
{
    int *all = test_calloc((size_t)part->cell_count + 1, sizeof *all);
    test_mesh bare;
    int64_t flat = 0;
    test_mesh_part(part, all, 0, &bare);
    test_mesh_allocate(out, part->vertex_count, 2 * part->cell_count, 5 * part->connectivity_count);
    test_mesh_allocate_faces(out, part->face_count + 4 * part->cell_count,
                             part->face_connectivity_count + 16 * part->cell_count);
    for (int64_t v = 0; v < bare.vertex_count; v++)
        out->values[test_mesh_add_vertex(out, bare.coordinates + 3 * v)] = bare.values[v];
    for (int64_t face = 0; face < bare.face_count; face++)
        test_mesh_add_face(out, bare.face_connectivity + bare.face_offsets[face], 3);
    for (int64_t cell = 0; cell < bare.cell_count; cell++) {
        const int64_t *own = bare.connectivity + bare.offsets[cell];
        int64_t faces[4] = {own[0]};
        test_mesh_add_polyhedron(out, own, bare.offsets[cell + 1] - bare.offsets[cell]);
        if (cell % 3) continue;
        const int64_t *v = bare.face_connectivity + bare.face_offsets[own[0]];
        for (int i = 0; i < 4; i++) {
            const int64_t point[3] = {v[i % 3], v[i % 3], v[i % 3]};
            if (i > 0 || cell % 2) faces[i] = test_mesh_add_face(out, i == 1 && cell % 2 == 0 ? v : point, 3);
        }
        test_mesh_add_polyhedron(out, faces, 4);
        flat++;
    }
    test_mesh_free(&bare);
    test_free(all);
    return flat;
}

static void flat_polyhedra_are_counted_and_change_no_picture(void **context)
{
    (void)context;
    session_input more = input;
    everywhere(submit(session, &input) == INSITU_OK);
    step_is_good(session, 5);
    everywhere(insitu_last_report(session)->cells_flat == 0);
    const size_t numbers = own_rank == 0 ? (size_t)4 * 24 * 16 : 0;
    float *before = test_calloc(numbers + 1, sizeof *before);
    if (own_rank == 0) memcpy(before, caught[0].rgba, numbers * sizeof *before);
    const int64_t flat = add_flat_cells(&input.part, &more.part);
    input_describe(&more);
    everywhere(submit(session, &more) == INSITU_OK);
    step_is_good(session, 6);
    everywhere(insitu_last_report(session)->cells_flat == flat);
    everywhere(insitu_last_report(session)->cells_inverted == 0);
    everywhere(own_rank != 0 || memcmp(before, caught[0].rgba, numbers * sizeof *before) == 0);
    everywhere(submit(session, &input) == INSITU_OK);
    step_is_good(session, 7);
    test_mesh_free(&more.part);
    test_free(before);
}

/* Checks a failing allocation. The first allocation of a step that checks polyhedra, and need not recognise any, is for
 * their edges. If it fails, the cells remain unchecked, and the next step must check them again. */
static void check_without_memory_is_reported_and_repeated(void **context)
{
    (void)context;
    char rank_words[32];
    snprintf(rank_words, sizeof rank_words, "rank %d: ", rank_count - 1);
    input.mesh.keep_polyhedra = 1;
    everywhere(submit(session, &input) == INSITU_OK);
    base_memory_fail_nth(own_rank == rank_count - 1);
    const insitu_status status = insitu_step(session, 8, 0);
    base_memory_fail_nth(0);
    reported_everywhere(session, status, INSITU_ERROR_MEMORY, rank_words, "mesh \"m\": no memory to check cell 0");
    const int64_t cells = input.part.cell_count;
    step_is_good(session, 9);
    everywhere(insitu_last_report(session)->cells == cells && insitu_last_report(session)->bytes_trees > 0);
}

static int begin_tests(void **state)
{
    (void)state;
    session = open_session(MPI_COMM_WORLD, write_scene(scene_text));
    input_create(&input, TEST_POLYHEDRA, 3, TEST_RANDOM, own_rank, rank_count);
    return 0;
}

static int end_tests(void **state)
{
    (void)state;
    insitu_destroy(&session);
    input_free(&input);
    return 0;
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(corrupted_arrays_are_reported_at_once),
        cmocka_unit_test(corrupted_faces_are_reported_at_the_step),
        cmocka_unit_test(ghosts_are_proved_but_for_coordinates),
        cmocka_unit_test(flat_polyhedra_are_counted_and_change_no_picture),
        cmocka_unit_test(check_without_memory_is_reported_and_repeated),
    };
    return run_session_tests(argc, argv, tests, begin_tests, end_tests);
}
