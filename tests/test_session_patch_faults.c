/* Tests errors of users in the patches of a field, each on one rank only. Every rank must get the same message, which
 * names the rank, the mesh, the field, the patch, the face and the error; nothing is drawn; and the next step draws
 * once the input is corrected. */
#include <stdio.h>
#include <string.h>

#include "test_owned_faces.h"
#include "test_session_fixture.h"

static const char scene[] =
    "images:\n  - name: a\n    size: [24, 16]\n    layers: [{isosurface: {field: f, values: [0.2]}}]\n"
    "    outputs: [{path: a.exr}]\n";

enum { SIDE = 3, MOST = 64 };

static session_input input;
static owned faces;
static double cell_values[SIDE * SIDE * SIDE], values[2 * MOST];
static int64_t inner, outer; /* an interior and a boundary face, counted from index_base */
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

/* Creates a whole mesh on each rank, so that each rank has interior and boundary faces. The ranks' meshes lie side by
 * side. */
static void create(void)
{
    input_create(&input, TEST_HEXES, SIDE, TEST_BLOCK, 0, 1);
    test_mesh_to_polyhedra(&input.part, 1);
    for (int64_t v = 0; v < input.part.vertex_count; v++) input.part.coordinates[3 * v] += 2 * own_rank;
    find_quads();
    free_owned(&faces);
    faces = make_owned(&input.part, 1);
    inner = 1;
    outer = faces.inner + 1;
    for (int i = 0; i < MOST; i++) numbers[i] = outer + i;
    for (int i = 0; i < SIDE * SIDE * SIDE; i++) cell_values[i] = i % 2;
}

/* Describes a mesh by owners, with index_base 1, and a patch by the number of its first face. */
static void describe(void)
{
    input_describe(&input);
    describe_owned(&faces, FORM_LISTS, 1, &input.mesh);
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

static void by_numbers(int64_t second)
{
    numbers[1] = second;
    patches[0].count = 2;
    patches[0].faces = (insitu_array){numbers, INSITU_INT64, 0};
}

/* Sets a patch by vertices on a mesh without owners, whose cells are polyhedra or hexes. Mesh and patch have index_base
 * 0. */
static void by_vertices(const int64_t *vertices, int64_t count)
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

static void number_large(void)
{
    by_numbers(1000000);
}
static void number_zero(void)
{
    by_numbers(0);
}
static void number_inner(void)
{
    by_numbers(inner);
}
static void number_twice(void)
{
    by_numbers(outer);
}
static void range_large(void)
{
    patches[0].first_face = input.part.face_count - 2;
}
static void range_zero(void)
{
    patches[0].first_face = 0;
}
static void range_inner(void)
{
    patches[0].first_face = inner;
}
static void vertices_inner(void)
{
    by_vertices(inner_quad, 1);
}
static void vertices_none(void)
{
    by_vertices(no_quad, 1);
}
static void vertices_twice(void)
{
    by_vertices(twice, 2);
}
static void vertex_large(void)
{
    by_vertices(twice, 2);
    twice[5] = input.part.vertex_count;
}
static void vertices_two(void)
{
    static const int64_t offsets[] = {0, 2};
    by_vertices(outer_quad, 1);
    patches[1].offsets = (insitu_array){offsets, INSITU_INT64, 0};
}
static void vertices_beyond(void)
{
    static const int64_t offsets[] = {0, 7};
    by_vertices(outer_quad, 1);
    patches[1].offsets = (insitu_array){offsets, INSITU_INT64, 0};
}
static void vertices_uneven(void)
{
    by_vertices(twice, 2);
    patches[1].connectivity_count = 7;
}
static void offsets_alone(void)
{
    patches[0].offsets = (insitu_array){numbers, INSITU_INT64, 0};
}
static void patch_given_twice(void)
{
    by_vertices(outer_quad, 1);
    patches[1].faces = (insitu_array){numbers, INSITU_INT64, 0};
}
static void numbers_of_floats(void)
{
    by_numbers(outer + 1);
    patches[0].faces.type = INSITU_FLOAT32;
}
static void no_values(void)
{
    patches[0].values.data = NULL;
}
static void bytes_for_values(void)
{
    patches[0].values.type = INSITU_UINT8;
}
static void narrow_stride(void)
{
    patches[0].values.stride_bytes = 12;
}
static void component_stride(void)
{
    patches[0].component_stride_bytes = 3;
}
static void negative_count(void)
{
    patches[0].count = -1;
}
static void no_table(void)
{
    input.field.patches = NULL;
}
static void negative_table(void)
{
    input.field.patch_count = -2;
}
static void at_vertices(void)
{
    input.field.centring = INSITU_VERTEX;
    input.field.count = input.part.vertex_count;
}
static insitu_status fill(void *data, insitu_field *field)
{
    (void)data, (void)field;
    return INSITU_OK;
}
static void with_fill(void)
{
    input.field.values.data = NULL;
    input.field.fill = fill;
}

typedef struct fault {
    void (*corrupt)(void);
    insitu_status status;
    bool at_once; /* insitu_set_field() fails too, before the step */
    const char *words[2];
} fault;

static const fault faults[] = {
    {number_large, INSITU_ERROR_FIELD, false, {"patch 0: face 1000000 is outside 1..", "index_base is 1"}},
    {number_zero, INSITU_ERROR_FIELD, false, {"patch 0: face 0 is outside 1.."}},
    {number_inner, INSITU_ERROR_FIELD, false, {"patch 0: face 1 is between two cells, not on the boundary"}},
    {number_twice, INSITU_ERROR_FIELD, false, {"patch 0: face ", " is given twice"}},
    {range_large, INSITU_ERROR_FIELD, true, {"patch 0: has 5 faces from ", ", outside 1.."}},
    {range_zero, INSITU_ERROR_FIELD, true, {"patch 0: has 5 faces from 0 on, outside 1.."}},
    {range_inner, INSITU_ERROR_FIELD, false, {"patch 0: face 1 is between two cells"}},
    {vertices_inner, INSITU_ERROR_FIELD, false, {"patch 1: its face 0 is between two cells, not on the boundary"}},
    {vertices_none, INSITU_ERROR_FIELD, false, {"patch 1: its face 0 is no face of a cell"}},
    {vertices_twice, INSITU_ERROR_FIELD, false, {"patch 1: its face 0 is given twice"}},
    {vertex_large,
     INSITU_ERROR_FIELD,
     false,
     {"patch 1: its face 1 has a vertex index outside 0..", "index_base is 0"}},
    {vertices_two, INSITU_ERROR_FIELD, false, {"patch 1: its face 0 has fewer than three vertices"}},
    {vertices_beyond, INSITU_ERROR_FIELD, false, {"patch 1: its face 0 has vertices beyond the connectivity"}},
    {vertices_uneven, INSITU_ERROR_FIELD, true, {"patch 1: has 7 connectivity indices, no multiple of its 2 faces"}},
    {offsets_alone, INSITU_ERROR_FIELD, true, {"patch 0: offsets are given without connectivity"}},
    {patch_given_twice, INSITU_ERROR_FIELD, true, {"patch 1: faces and connectivity are given"}},
    {numbers_of_floats, INSITU_ERROR_ARGUMENT, true, {"patch 0: faces are of element type 1, not int32 or int64"}},
    {no_values, INSITU_ERROR_FIELD, true, {"patch 0: values are not given"}},
    {bytes_for_values, INSITU_ERROR_ARGUMENT, true, {"patch 0: values are of element type 5, not float32, float64"}},
    {narrow_stride, INSITU_ERROR_FIELD, true, {"patch 0: values have a stride of 12 bytes"}},
    {component_stride, INSITU_ERROR_FIELD, true, {"patch 0: components of values have a stride of 3 bytes"}},
    {negative_count, INSITU_ERROR_ARGUMENT, true, {"patch 0: has -1 faces"}},
    {no_table, INSITU_ERROR_ARGUMENT, true, {"patch_count is 2, and patches are not given"}},
    {negative_table, INSITU_ERROR_ARGUMENT, true, {"patch_count is -2"}},
    {at_vertices, INSITU_ERROR_ARGUMENT, true, {"has patches, and its centring 0 is not cells (1)"}},
    {with_fill, INSITU_ERROR_FIELD, true, {"patches and fill are given"}},
};

static void check_fault(insitu_session *session, const fault *c, int cycle)
{
    const bool is_last = own_rank == rank_count - 1;
    char rank[64];
    snprintf(rank, sizeof rank, "rank %d: mesh \"m\": field \"f\"", rank_count - 1);
    create();
    describe();
    if (is_last) c->corrupt();
    discard_pictures();
    const insitu_status at_once = submit(session, &input);
    everywhere(at_once == (is_last && c->at_once ? c->status : INSITU_OK));
    const insitu_status status = insitu_step(session, cycle, 0);
    reported_everywhere(session, status, c->status, rank, c->words[0], c->words[1]);
    everywhere(caught_count == 0);
    input_free(&input);
    create();
    describe();
    everywhere(submit(session, &input) == INSITU_OK);
    step_is_good(session, cycle + 1);
    input_free(&input);
}

static void wrong_input_is_reported_on_all_ranks(void **state)
{
    (void)state;
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(scene));
    for (int i = 0; i < (int)(sizeof faults / sizeof faults[0]); i++) check_fault(session, &faults[i], 2 * i);
    insitu_destroy(&session);
    free_owned(&faces);
}

/* Checks that a patch given by the numbers of faces is refused for hexes, whose faces have no numbers. */
static void hexes_want_vertices(void **state)
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
    everywhere(submit(session, &input) == INSITU_ERROR_FIELD);
    reported_everywhere(session, insitu_step(session, 0, 0), INSITU_ERROR_FIELD,
                        "patch 0: names faces by their numbers", "the mesh has none");
    insitu_destroy(&session);
    input_free(&input);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(wrong_input_is_reported_on_all_ranks),
                                       cmocka_unit_test(hexes_want_vertices)};
    return run_session_tests(argc, argv, tests, NULL, NULL);
}
