/* Checks errors of users in the patches of a field (values on boundary faces), each on one rank only. Every rank must
 * get the same message, which names the rank, the mesh, the field, the patch, the face and the error. Nothing may be
 * drawn, and the next step after the correction must draw. */
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "test_owned_faces.h"
#include "test_session_fixture.h"

static const char scene[] =
    "images:\n  - name: a\n    size: [24, 16]\n    layers: [{isosurface: {field: f, values: [0.2]}}]\n"
    "    outputs: [{path: a.exr}]\n";

enum { SIDE = 3, MOST = 64 };

static session_input input;
static owned faces;
static double cell_values[SIDE * SIDE * SIDE], values[2 * MOST];
static int64_t inner, outer; /* numbers of an interior and of a boundary face, counted from index_base */
static int64_t inner_quad[4], outer_quad[4], no_quad[4] = {0, 2, 5, 7}, twice[8], numbers[MOST];
static insitu_patch patches[2];

/* ---- meshes ------------------------------------------------------------------------------------------------------ */

/* Finds the vertices of one boundary face and of one interior face of the hexes. */
static void find_quads(void)
{
    const test_mesh *part = &input.part;
    const int64_t *face = part->face_connectivity;
    for (int64_t f = 0; f < part->face_count; f++) {
        int count = 0;
        for (int64_t i = 0; i < part->connectivity_count; i++) count += part->connectivity[i] == f;
        memcpy(count == 2 ? inner_quad : outer_quad, face + part->face_offsets[f], sizeof inner_quad);
    }
    memcpy(twice, outer_quad, sizeof outer_quad);
    memcpy(twice + 4, outer_quad, sizeof outer_quad);
}

/* Creates a whole mesh on each rank, so that each rank has interior and boundary faces. The ranks' meshes are side by
 * side along x. */
static void create_input(void)
{
    input_create(&input, TEST_HEXES, SIDE, TEST_BLOCK, 0, 1);
    test_mesh_to_polyhedra(&input.part, 1);
    for (int64_t v = 0; v < input.part.vertex_count; v++) input.part.coordinates[3 * v] += 2 * own_rank;
    find_quads();
    free_owned_faces(&faces);
    faces = make_owned_faces(&input.part, 1);
    inner = 1;
    outer = faces.inner + 1;
    for (int i = 0; i < MOST; i++) numbers[i] = outer + i;
    for (int i = 0; i < SIDE * SIDE * SIDE; i++) cell_values[i] = i % 2;
}

/* Describes a mesh by owners with index_base 1, and a patch by the number of its first face. */
static void describe_mesh_and_patch(void)
{
    input_describe(&input);
    describe_owned_faces(&faces, FORM_LISTS, 1, &input.mesh);
    patches[0] = (insitu_patch){.count = 5, .first_face = outer, .values = {values, INSITU_FLOAT64, 0}};
    patches[1] = (insitu_patch){0};
    insitu_field_defaults(&input.field);
    input.field.name = "f";
    input.field.centring = INSITU_CELL;
    input.field.count = input.part.cell_count;
    input.field.values = (insitu_array){cell_values, INSITU_FLOAT64, 0};
    input.field.patches = patches;
    input.field.patch_count = 2;
}

static void set_patch_by_numbers(int64_t second)
{
    numbers[1] = second;
    patches[0].count = 2;
    patches[0].faces = (insitu_array){numbers, INSITU_INT64, 0};
}

/* Sets a patch by vertices on a mesh without owners, whose cells are polyhedra or hexes. Mesh and patch have index_base
 * 0. */
static void set_patch_by_vertices(const int64_t *vertices, int64_t count)
{
    input_describe(&input);
    patches[1] = (insitu_patch){.count = count,
                                .connectivity_count = 4 * count,
                                .connectivity = {vertices, INSITU_INT64, 0},
                                .values = {values, INSITU_FLOAT64, 0}};
    patches[0].count = 0;
    input.field.name = "f";
    input.field.centring = INSITU_CELL;
    input.field.count = input.part.cell_count;
    input.field.values = (insitu_array){cell_values, INSITU_FLOAT64, 0};
    input.field.patches = patches;
    input.field.patch_count = 2;
}

/* ---- faults ------------------------------------------------------------------------------------------------------ */

static void set_large_face_number(void)
{
    set_patch_by_numbers(1000000);
}
static void set_zero_face_number(void)
{
    set_patch_by_numbers(0);
}
static void set_inner_face_number(void)
{
    set_patch_by_numbers(inner);
}
static void repeat_face_number(void)
{
    set_patch_by_numbers(outer);
}
static void set_large_face_range(void)
{
    patches[0].first_face = input.part.face_count - 2;
}
static void set_zero_face_range(void)
{
    patches[0].first_face = 0;
}
static void set_inner_face_range(void)
{
    patches[0].first_face = inner;
}
static void set_vertices_of_inner_face(void)
{
    set_patch_by_vertices(inner_quad, 1);
}
static void set_vertices_of_no_face(void)
{
    set_patch_by_vertices(no_quad, 1);
}
static void repeat_face_by_vertices(void)
{
    set_patch_by_vertices(twice, 2);
}
static void set_large_vertex(void)
{
    set_patch_by_vertices(twice, 2);
    twice[5] = input.part.vertex_count;
}
static void set_face_of_two_vertices(void)
{
    static const int64_t offsets[] = {0, 2};
    set_patch_by_vertices(outer_quad, 1);
    patches[1].offsets = (insitu_array){offsets, INSITU_INT64, 0};
}
static void set_vertices_beyond_array(void)
{
    static const int64_t offsets[] = {0, 7};
    set_patch_by_vertices(outer_quad, 1);
    patches[1].offsets = (insitu_array){offsets, INSITU_INT64, 0};
}
static void set_unequal_vertex_counts(void)
{
    set_patch_by_vertices(twice, 2);
    patches[1].connectivity_count = 7;
}
static void set_offsets_alone(void)
{
    patches[0].offsets = (insitu_array){numbers, INSITU_INT64, 0};
}
static void repeat_patch(void)
{
    set_patch_by_vertices(outer_quad, 1);
    patches[1].faces = (insitu_array){numbers, INSITU_INT64, 0};
}
static void set_float_face_numbers(void)
{
    set_patch_by_numbers(outer + 1);
    patches[0].faces.type = INSITU_FLOAT32;
}
static void remove_values(void)
{
    patches[0].values.data = NULL;
}
static void set_byte_values(void)
{
    patches[0].values.type = INSITU_UINT8;
}
static void set_narrow_stride(void)
{
    patches[0].values.stride_bytes = 12;
}
static void set_component_stride(void)
{
    patches[0].component_stride_bytes = 3;
}
static void set_negative_count(void)
{
    patches[0].count = -1;
}
static void remove_table(void)
{
    input.field.patches = NULL;
}
static void set_negative_table_count(void)
{
    input.field.patch_count = -2;
}
static void make_vertex_field(void)
{
    input.field.centring = INSITU_VERTEX;
    input.field.count = input.part.vertex_count;
}
static insitu_status fill_patch_field(void *data, insitu_field *field)
{
    (void)data, (void)field;
    return INSITU_OK;
}
static void set_fill_function(void)
{
    input.field.values.data = NULL;
    input.field.fill = fill_patch_field;
}

typedef struct fault {
    void (*corrupt)(void);
    insitu_status status;
    bool at_once; /* whether insitu_set_field() fails too, before the step */
    const char *words[2];
} fault;

static const fault faults[] = {
    {set_large_face_number, INSITU_ERROR_FIELD, false, {"patch 0: face 1000000 is outside 1..", "index_base is 1"}},
    {set_zero_face_number, INSITU_ERROR_FIELD, false, {"patch 0: face 0 is outside 1.."}},
    {set_inner_face_number, INSITU_ERROR_FIELD, false, {"patch 0: face 1 is between two cells, not on the boundary"}},
    {repeat_face_number, INSITU_ERROR_FIELD, false, {"patch 0: face ", " is given twice"}},
    {set_large_face_range, INSITU_ERROR_FIELD, true, {"patch 0: has 5 faces from ", ", outside 1.."}},
    {set_zero_face_range, INSITU_ERROR_FIELD, true, {"patch 0: has 5 faces from 0 on, outside 1.."}},
    {set_inner_face_range, INSITU_ERROR_FIELD, false, {"patch 0: face 1 is between two cells"}},
    {set_vertices_of_inner_face,
     INSITU_ERROR_FIELD,
     false,
     {"patch 1: its face 0 is between two cells, not on the boundary"}},
    {set_vertices_of_no_face, INSITU_ERROR_FIELD, false, {"patch 1: its face 0 is no face of a cell"}},
    {repeat_face_by_vertices, INSITU_ERROR_FIELD, false, {"patch 1: its face 0 is given twice"}},
    {set_large_vertex,
     INSITU_ERROR_FIELD,
     false,
     {"patch 1: its face 1 has a vertex index outside 0..", "index_base is 0"}},
    {set_face_of_two_vertices, INSITU_ERROR_FIELD, false, {"patch 1: its face 0 has fewer than three vertices"}},
    {set_vertices_beyond_array,
     INSITU_ERROR_FIELD,
     false,
     {"patch 1: its face 0 has vertices beyond the connectivity"}},
    {set_unequal_vertex_counts,
     INSITU_ERROR_FIELD,
     true,
     {"patch 1: has 7 connectivity indices, no multiple of its 2 faces"}},
    {set_offsets_alone, INSITU_ERROR_FIELD, true, {"patch 0: offsets are given without connectivity"}},
    {repeat_patch, INSITU_ERROR_FIELD, true, {"patch 1: faces and connectivity are given"}},
    {set_float_face_numbers, INSITU_ERROR_ARGUMENT, true, {"patch 0: faces are of element type 1, not int32 or int64"}},
    {remove_values, INSITU_ERROR_FIELD, true, {"patch 0: values are not given"}},
    {set_byte_values, INSITU_ERROR_ARGUMENT, true, {"patch 0: values are of element type 5, not float32, float64"}},
    {set_narrow_stride, INSITU_ERROR_FIELD, true, {"patch 0: values have a stride of 12 bytes"}},
    {set_component_stride, INSITU_ERROR_FIELD, true, {"patch 0: components of values have a stride of 3 bytes"}},
    {set_negative_count, INSITU_ERROR_ARGUMENT, true, {"patch 0: has -1 faces"}},
    {remove_table, INSITU_ERROR_ARGUMENT, true, {"patch_count is 2, and patches are not given"}},
    {set_negative_table_count, INSITU_ERROR_ARGUMENT, true, {"patch_count is -2"}},
    {make_vertex_field, INSITU_ERROR_ARGUMENT, true, {"has patches, and its centring 0 is not cells (1)"}},
    {set_fill_function, INSITU_ERROR_FIELD, true, {"patches and fill are given"}},
};

static void check_fault(insitu_session *session, const fault *c, int cycle)
{
    const bool is_last = own_rank == rank_count - 1;
    char rank[64];
    snprintf(rank, sizeof rank, "rank %d: mesh \"m\": field \"f\"", rank_count - 1);
    create_input();
    describe_mesh_and_patch();
    if (is_last) c->corrupt();
    discard_pictures();
    const insitu_status at_once = submit_input(session, &input);
    everywhere(at_once == (is_last && c->at_once ? c->status : INSITU_OK));
    const insitu_status status = insitu_step(session, cycle, 0);
    check_reported_everywhere(session, status, c->status, rank, c->words[0], c->words[1]);
    everywhere(caught_count == 0);
    input_free(&input);
    create_input();
    describe_mesh_and_patch();
    everywhere(submit_input(session, &input) == INSITU_OK);
    check_step_succeeds(session, cycle + 1);
    input_free(&input);
}

static void wrong_input_is_reported_on_all_ranks(void **state)
{
    (void)state;
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(scene));
    for (int i = 0; i < (int)(sizeof faults / sizeof faults[0]); i++) check_fault(session, &faults[i], 2 * i);
    insitu_destroy(&session);
    free_owned_faces(&faces);
}

/* Checks that a patch given by the numbers of faces is refused for hexes, whose faces have no numbers. */
static void patches_of_hexes_require_vertices(void **state)
{
    (void)state;
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(scene));
    input_create(&input, TEST_HEXES, SIDE, TEST_BLOCK, own_rank, rank_count);
    patches[0] = (insitu_patch){.count = 1, .values = {values, INSITU_FLOAT64, 0}};
    input.field.centring = INSITU_CELL;
    input.field.count = input.part.cell_count;
    input.field.values = (insitu_array){cell_values, INSITU_FLOAT64, 0};
    input.field.patches = patches;
    input.field.patch_count = 1;
    everywhere(submit_input(session, &input) == INSITU_ERROR_FIELD);
    check_reported_everywhere(session, insitu_step(session, 0, 0), INSITU_ERROR_FIELD,
                              "patch 0: names faces by their numbers", "the mesh has none");
    insitu_destroy(&session);
    input_free(&input);
}

static int count_lines(const char *path)
{
    static char text[1 << 12];
    int count = 0;
    read_file(path, sizeof text, text);
    for (const char *c = text; *c; c++) count += *c == '\n';
    return count;
}

/* Checks that images and statistics of another field do not depend on an error in a patch. The patched field is
 * averaged at vertices for an image, and for the statistics of a field that is derived from it. */
static void other_fields_are_drawn_if_a_patch_is_wrong(void **state)
{
    (void)state;
    static const char patched[] = "images:\n"
                                  "  - {name: a, size: [24, 16], layers: [{isosurface: {field: f, values: [0.2]}}], "
                                  "outputs: [{path: a.exr}]}\n"
                                  "  - {name: b, size: [24, 16], layers: [{isosurface: {field: g, values: [0.2]}}], "
                                  "outputs: [{path: b.exr}]}\n";
    static const char derived[] = "fields: {s: {gradient: f, component: x}}\n"
                                  "statistics: [{field: s, path: s.csv}, {field: g, path: g.csv}]\n";
    char text[2048];
    for (int with_derived = 0; with_derived < 2; with_derived++) {
        if (own_rank == 0) unlink("s.csv"), unlink("g.csv");
        snprintf(text, sizeof text, "%s%s", with_derived ? derived : "", patched);
        insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(text));
        for (int cycle = 0; cycle < 3; cycle++) {
            create_input();
            describe_mesh_and_patch();
            if (cycle == 1 && own_rank == rank_count - 1) set_inner_face_number();
            insitu_field g;
            insitu_field_defaults(&g);
            g.name = "g";
            g.count = input.part.vertex_count;
            g.values = (insitu_array){input.part.values, INSITU_FLOAT64, 0};
            everywhere(submit_input(session, &input) == INSITU_OK);
            everywhere(insitu_set_field(session, "m", &g) == INSITU_OK);
            discard_pictures();
            const insitu_status status = insitu_step(session, cycle, 0);
            if (cycle == 1)
                check_reported_everywhere(session, status, INSITU_ERROR_FIELD,
                                          "field \"f\": patch 0: face 1 is between");
            else
                everywhere(status == INSITU_OK);
            everywhere(insitu_last_report(session)->images == (cycle == 1 ? 1 : 2));
            input_free(&input);
        }
        insitu_destroy(&session);
        everywhere(own_rank != 0 || !with_derived || (count_lines("g.csv") == 4 && count_lines("s.csv") == 3));
    }
    discard_pictures();
    free_owned_faces(&faces);
}

static int set_up_test_group(void **state)
{
    (void)state;
    return enter_test_folder("patch_faults") ? 0 : 1;
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(wrong_input_is_reported_on_all_ranks),
                                       cmocka_unit_test(patches_of_hexes_require_vertices),
                                       cmocka_unit_test(other_fields_are_drawn_if_a_patch_is_wrong)};
    return run_session_tests(argc, argv, tests, set_up_test_group, NULL);
}
