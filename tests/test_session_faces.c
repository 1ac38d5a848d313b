/* Checks errors of a user in the faces of polyhedra, on one rank only. Every rank must get the same message, which
 * states the rank, the mesh, the cell, the face and the value. Nothing may be drawn, and the next step after the
 * correction must draw. The faces and vertices of a rank's part are numbered in the order in which its cells first use
 * them, so that cell 0 begins with face 0. */
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

static void remove_face_offsets(session_input *in)
{
    in->mesh.face_offsets.data = NULL;
}
static void remove_face_vertices(session_input *in)
{
    in->mesh.face_connectivity.data = NULL;
}
static void set_negative_face_count(session_input *in)
{
    in->mesh.face_count = -5;
}
static void set_negative_face_vertex_count(session_input *in)
{
    in->mesh.face_connectivity_count = -1;
}
static void set_float_face_vertices(session_input *in)
{
    in->mesh.face_connectivity.type = INSITU_FLOAT32;
}
static void set_one_type_without_offsets(session_input *in)
{
    in->mesh.cell_types.data = in->mesh.offsets.data = NULL;
    in->mesh.cell_type = INSITU_POLYHEDRON;
}

/* ---- errors that the step detects ---------------------------------------------------------------------------- */

static void remove_all_faces(session_input *in)
{
    in->mesh.face_count = in->mesh.face_connectivity_count = 0;
    in->mesh.face_offsets.data = in->mesh.face_connectivity.data = NULL;
}
static void make_too_few_faces(session_input *in)
{
    in->mesh.face_count = 2;
}
static void set_decreasing_cell_offsets(session_input *in)
{
    in->part.offsets[2] = 1;
}
static void set_far_cell_offsets(session_input *in)
{
    in->part.offsets[1] = 1 << 30;
}
static void set_decreasing_face_offsets(session_input *in)
{
    in->part.face_offsets[1] = -2;
}
static void set_far_face_offsets(session_input *in)
{
    in->part.face_offsets[1] = 1 << 30;
}
static void shorten_face_connectivity(session_input *in)
{
    in->mesh.face_connectivity_count = 2;
}
static void make_face_too_small(session_input *in)
{
    in->part.face_offsets[1] = 2;
}
static void set_large_face_index(session_input *in)
{
    in->part.connectivity[in->part.offsets[1] + 1] = in->part.face_count + 3;
}
static void set_negative_face_index(session_input *in)
{
    in->part.connectivity[in->part.offsets[3]] = -7;
}
static void set_large_face_vertex(session_input *in)
{
    in->part.face_connectivity[1] = 1000000;
}
static void set_negative_face_vertex(session_input *in)
{
    in->part.face_connectivity[2] = -1;
}
static void leave_three_faces(session_input *in)
{
    in->part.offsets[1] = in->part.offsets[0] + 3;
}
static void exclude_first_face_of_cell(session_input *in)
{
    in->part.connectivity[0] = in->part.connectivity[1];
}
/* Lists the first face of cell 0 twice. The second entry overwrites the first entry of cell 1, which then lacks a face.
 * Cell 0 is checked first, so that its error is reported. */
static void repeat_face(session_input *in)
{
    in->part.connectivity[in->part.offsets[1]] = in->part.connectivity[0];
    in->part.offsets[1]++;
}
/* Removes the last face of the first cell with more than four faces. */
static void remove_last_face(session_input *in)
{
    int64_t cell = 0;
    while (in->part.offsets[cell + 1] - in->part.offsets[cell] < 5) cell++;
    in->part.offsets[cell + 1]--;
}
static void leave_one_face(session_input *in)
{
    in->part.offsets[1] = in->part.offsets[0] + 1;
}
static void remove_faces_of_cell(session_input *in)
{
    in->part.offsets[1] = in->part.offsets[0];
}
/* Makes a face whose outline goes back and forth between two vertices: a, b, a. */
static void repeat_vertex_apart(session_input *in)
{
    in->part.face_connectivity[2] = in->part.face_connectivity[0];
}
/* Makes a face with the vertices a, b, b, which is only an edge. */
static void repeat_adjacent_vertex(session_input *in)
{
    in->part.face_connectivity[2] = in->part.face_connectivity[1];
}
static void add_face_of_another_cell(session_input *in)
{
    in->part.connectivity[0] = in->part.connectivity[in->part.connectivity_count - 1];
}
static void set_nan_coordinate(session_input *in)
{
    in->part.coordinates[3 * in->part.face_connectivity[0] + 2] = NAN;
}

#define CELL_0 "cell 0 (polyhedron): "

static const corrupted_case at_once[] = {
    {"no face offsets", remove_face_offsets, INSITU_ERROR_MESH, true, {"face offsets are not given"}},
    {"no face vertices", remove_face_vertices, INSITU_ERROR_MESH, true, {"face vertex indices are not given"}},
    {"face count", set_negative_face_count, INSITU_ERROR_ARGUMENT, true, {"face_count is -5"}},
    {"vertex count", set_negative_face_vertex_count, INSITU_ERROR_ARGUMENT, true, {"face_connectivity_count is -1"}},
    {"float vertices",
     set_float_face_vertices,
     INSITU_ERROR_ARGUMENT,
     true,
     {"face vertex indices are of element type", "not an integer type"}},
    {"no cell offsets",
     set_one_type_without_offsets,
     INSITU_ERROR_MESH,
     true,
     {"offsets are not given: polyhedra need them"}},
};

static const corrupted_case at_the_step[] = {
    {"no faces at all",
     remove_all_faces,
     INSITU_ERROR_MESH,
     false,
     {"cell 0 is a polyhedron, and face_offsets are not given"}},
    {"too few faces", make_too_few_faces, INSITU_ERROR_MESH, false, {CELL_0 "face index 2 is outside 0..1"}},
    {"cell offsets fall",
     set_decreasing_cell_offsets,
     INSITU_ERROR_MESH,
     false,
     {"cell 1 (polyhedron): offsets fall from ", " to 1; a polyhedron has at least 4 faces"}},
    {"cell offsets far",
     set_far_cell_offsets,
     INSITU_ERROR_MESH,
     false,
     {CELL_0 "offsets 0 and 1073741824 are outside 0.."}},
    {"face offsets fall",
     set_decreasing_face_offsets,
     INSITU_ERROR_MESH,
     false,
     {CELL_0 "face 0: offsets 0 and -2 do not rise within 0.."}},
    {"face offsets far",
     set_far_face_offsets,
     INSITU_ERROR_MESH,
     false,
     {CELL_0 "face 0: offsets 0 and 1073741824 do not rise within 0.."}},
    {"face connectivity short",
     shorten_face_connectivity,
     INSITU_ERROR_MESH,
     false,
     {CELL_0 "face 0: offsets 0 and 3 do not rise within 0..2"}},
    {"face too small",
     make_face_too_small,
     INSITU_ERROR_MESH,
     false,
     {CELL_0 "face 0 has 2 vertices, at least 3 are needed"}},
    {"face index large",
     set_large_face_index,
     INSITU_ERROR_MESH,
     false,
     {"cell 1 (polyhedron): face index ", " is outside 0.."}},
    {"face index negative",
     set_negative_face_index,
     INSITU_ERROR_MESH,
     false,
     {"cell 3 (polyhedron): face index -7 is outside 0.."}},
    {"vertex large",
     set_large_face_vertex,
     INSITU_ERROR_MESH,
     false,
     {CELL_0 "face 0: vertex index 1000000 is outside 0.."}},
    {"vertex negative",
     set_negative_face_vertex,
     INSITU_ERROR_MESH,
     false,
     {CELL_0 "face 0: vertex index -1 is outside"}},
    {"three faces", leave_three_faces, INSITU_ERROR_MESH, false, {CELL_0 "3 faces, a closed surface has at least 4"}},
    {"one face", leave_one_face, INSITU_ERROR_MESH, false, {CELL_0 "1 faces, a closed surface has at least 4"}},
    {"without faces",
     remove_faces_of_cell,
     INSITU_ERROR_MESH,
     false,
     {CELL_0 "0 faces, a closed surface has at least 4"}},
    {"face once more",
     repeat_face,
     INSITU_ERROR_MESH,
     false,
     {CELL_0 "face ", " occurs 3 times, not once in each of two faces"}},
    {"face missing",
     remove_last_face,
     INSITU_ERROR_MESH,
     false,
     {" (polyhedron): face ", " occurs 1 times, not once in each of two faces"}},
    {"a face there and back",
     repeat_vertex_apart,
     INSITU_ERROR_MESH,
     false,
     {CELL_0 "face ", "not once in each of two"}},
    {"a face an edge", repeat_adjacent_vertex, INSITU_ERROR_MESH, false, {CELL_0 "face ", "not once in each of two"}},
    {"face twice", exclude_first_face_of_cell, INSITU_ERROR_MESH, false, {CELL_0 "face ", "the surface is not closed"}},
    {"another's face",
     add_face_of_another_cell,
     INSITU_ERROR_MESH,
     false,
     {CELL_0 "face ", "the surface is not closed"}},
    {"NaN", set_nan_coordinate, INSITU_ERROR_MESH, false, {CELL_0, "vertex 0 has a coordinate that is not finite"}},
};

static void corrupted_arrays_are_reported_at_once(void **context)
{
    (void)context;
    for (size_t i = 0; i < sizeof at_once / sizeof at_once[0]; i++)
        check_fault_is_reported(session, &input, &at_once[i]);
}

static void corrupted_faces_are_reported_at_the_step(void **context)
{
    (void)context;
    for (size_t i = 0; i < sizeof at_the_step / sizeof at_the_step[0]; i++)
        check_fault_is_reported(session, &input, &at_the_step[i]);
}

/* Checks faults in ghost cells, which are not drawn: any coordinates are accepted, but faces must be valid. */
static void ghost_cells_are_checked_except_coordinates(void **context)
{
    (void)context;
    static const corrupted_case ghost = {"ghost",
                                         set_large_face_vertex,
                                         INSITU_ERROR_MESH,
                                         false,
                                         {CELL_0 "face 0: vertex index 1000000 is outside 0.."}};
    for (int64_t cell = 0; cell < input.part.cell_count; cell++) input.part.ghosts[cell] = 1;
    set_nan_coordinate(&input);
    everywhere(submit_input(session, &input) == INSITU_OK);
    everywhere(insitu_step(session, 3, 0) == INSITU_OK);
    check_fault_is_reported(session, &input, &ghost);
}

/* ---- cells without volume ------------------------------------------------------------------------------------ */

/* Adds a flat polyhedron after every third cell of the part. It consists of the cell's first face twice, as front and
 * back, and two faces that have shrunk to points, or of four faces that are points. Returns the number of flat
 * cells. */
static int64_t add_flat_cells(const test_mesh *part, test_mesh *out)
{
    int *all = test_calloc((size_t)part->cell_count + 1, sizeof *all);
    test_mesh bare;
    int64_t flat = 0;
    test_mesh_extract_part(part, all, 0, &bare);
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
    everywhere(submit_input(session, &input) == INSITU_OK);
    check_step_succeeds(session, 5);
    everywhere(insitu_last_report(session)->cells_flat == 0);
    const size_t numbers = own_rank == 0 ? (size_t)4 * 24 * 16 : 0;
    float *before = test_calloc(numbers + 1, sizeof *before);
    if (own_rank == 0) memcpy(before, caught[0].rgba, numbers * sizeof *before);
    const int64_t flat = add_flat_cells(&input.part, &more.part);
    input_describe(&more);
    everywhere(submit_input(session, &more) == INSITU_OK);
    check_step_succeeds(session, 6);
    everywhere(insitu_last_report(session)->cells_flat == flat);
    everywhere(insitu_last_report(session)->cells_inverted == 0);
    everywhere(own_rank != 0 || memcmp(before, caught[0].rgba, numbers * sizeof *before) == 0);
    everywhere(submit_input(session, &input) == INSITU_OK);
    check_step_succeeds(session, 7);
    test_mesh_free(&more.part);
    test_free(before);
}

/* Checks a failing allocation. If a step checks polyhedra and need not recognise any, its first allocation is for their
 * edges. If this allocation fails, the cells remain unchecked, and the next step must check them. */
static void check_without_memory_is_reported_and_repeated(void **context)
{
    (void)context;
    char rank_words[32];
    snprintf(rank_words, sizeof rank_words, "rank %d: ", rank_count - 1);
    input.mesh.keep_polyhedra = 1;
    everywhere(submit_input(session, &input) == INSITU_OK);
    base_memory_fail_nth(own_rank == rank_count - 1);
    const insitu_status status = insitu_step(session, 8, 0);
    base_memory_fail_nth(0);
    check_reported_everywhere(session, status, INSITU_ERROR_MEMORY, rank_words,
                              "mesh \"m\": no memory to check cell 0");
    const int64_t cells = input.part.cell_count;
    check_step_succeeds(session, 9);
    everywhere(insitu_last_report(session)->cells == cells && insitu_last_report(session)->bytes_trees > 0);
}

static int set_up_test_group(void **state)
{
    (void)state;
    session = open_session(MPI_COMM_WORLD, write_scene(scene_text));
    input_create(&input, TEST_POLYHEDRA, 3, TEST_RANDOM, own_rank, rank_count);
    return 0;
}

static int tear_down_test_group(void **state)
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
        cmocka_unit_test(ghost_cells_are_checked_except_coordinates),
        cmocka_unit_test(flat_polyhedra_are_counted_and_change_no_picture),
        cmocka_unit_test(check_without_memory_is_reported_and_repeated),
    };
    return run_session_tests(argc, argv, tests, set_up_test_group, tear_down_test_group);
}
