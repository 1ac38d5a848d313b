/* Checks errors of a user in a mesh or a field, on one rank only. Every rank must get the same message, which states
 * the rank and the error; nothing may be drawn; and the next step after the correction must draw. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "test_session_fixture.h"

static const char scene_text[] = "images:\n"
                                 "  - name: a\n"
                                 "    size: [24, 16]\n"
                                 "    layers:\n"
                                 "      - isosurface: {field: f, values: [0.1]}\n"
                                 "    outputs:\n"
                                 "      - path: a_{cycle}.exr\n";

static insitu_session *session;
static session_input input;

/* ---- corrupted meshes ---------------------------------------------------------------------------------------- */

static void set_large_index(session_input *in)
{
    in->part.connectivity[8 * 2 + 3] = in->part.vertex_count + 12;
}
static void set_negative_index(session_input *in)
{
    in->part.connectivity[8 * 1 + 7] = -3;
}
static void set_two_bad_indices(session_input *in)
{
    in->part.connectivity[8 * 3] = -1;
    in->part.connectivity[8 * 1] = -9;
}
static void set_nan_coordinate(session_input *in)
{
    in->part.coordinates[3 * in->part.connectivity[0] + 1] = NAN;
}
static void set_infinite_coordinate(session_input *in)
{
    in->part.coordinates[3 * in->part.connectivity[0]] = INFINITY;
}
static void set_decreasing_offsets(session_input *in)
{
    in->part.offsets[2] = 3;
}
static void set_far_offsets(session_input *in)
{
    in->part.offsets[1] = 1 << 30;
}
static void set_offsets_with_wrong_step(session_input *in)
{
    in->part.offsets[1] = 7;
}
static void shorten_offsets(session_input *in)
{
    in->mesh.connectivity_count += 8;
}
static void set_unknown_type(session_input *in)
{
    in->part.types[1] = 11;
}
static void set_wide_types(session_input *in)
{
    static int64_t types[64];
    for (int64_t cell = 0; cell < in->part.cell_count; cell++) types[cell] = INSITU_HEX;
    types[2] = (1LL << 32) + INSITU_HEX;
    in->mesh.cell_types = (insitu_array){types, INSITU_INT64, 0};
}
static void set_negative_type(session_input *in)
{
    static int64_t types[64];
    for (int64_t cell = 0; cell < in->part.cell_count; cell++) types[cell] = INSITU_HEX;
    types[0] = -(1LL << 40);
    in->mesh.cell_types = (insitu_array){types, INSITU_INT64, 0};
}
static void set_far_coordinate(session_input *in)
{
    for (int64_t i = 0; i < 3 * in->part.vertex_count; i++) in->part.coordinates[i] *= 1e300;
}
static void remove_offsets(session_input *in)
{
    in->mesh.offsets.data = NULL;
}
static void set_unknown_single_type(session_input *in)
{
    in->mesh.cell_types.data = NULL;
    in->mesh.cell_type = (insitu_cell_type)41;
}
static void set_single_type_with_wrong_count(session_input *in)
{
    in->mesh.cell_types.data = in->mesh.offsets.data = NULL;
    in->mesh.cell_type = INSITU_WEDGE;
}
static void remove_coordinates(session_input *in)
{
    in->mesh.coordinates[2].data = NULL;
}
static void remove_coordinates_of_hexes(session_input *in)
{
    in->mesh.cell_types.data = in->mesh.offsets.data = NULL;
    remove_coordinates(in);
}
static void remove_connectivity(session_input *in)
{
    in->mesh.connectivity.data = NULL;
}
static void count_negative(session_input *in)
{
    in->mesh.vertex_count = -1;
}
static void set_too_many_cells(session_input *in)
{
    in->mesh.cell_count = 4294967295;
}
static void set_float_indices(session_input *in)
{
    in->mesh.connectivity.type = INSITU_FLOAT64;
}
static void set_coordinates_without_type(session_input *in)
{
    in->mesh.coordinates[0].type = (insitu_type)11;
}
static void set_unknown_array_type(session_input *in)
{
    in->mesh.offsets.type = (insitu_type)77;
}
static void set_float_ghosts(session_input *in)
{
    in->mesh.ghosts.type = INSITU_FLOAT32;
}
static void set_unknown_change_flag(session_input *in)
{
    in->mesh.changed = 64;
}

/* ---- corrupted fields ---------------------------------------------------------------------------------------- */

static void set_too_few_values(session_input *in)
{
    in->field.count--;
}
static void remove_values(session_input *in)
{
    in->field.values.data = NULL;
}
static void set_values_without_type(session_input *in)
{
    in->field.values.type = (insitu_type)0;
}
static void set_unknown_centring(session_input *in)
{
    in->field.centring = (insitu_centring)5;
}
static void set_other_centring(session_input *in)
{
    in->field.centring = INSITU_CELL;
}
static void set_zero_components(session_input *in)
{
    in->field.component_count = 0;
}
static void remove_field_name(session_input *in)
{
    in->field.name = NULL;
}

static const corrupted_case cases[] = {
    {"index too large", set_large_index, INSITU_ERROR_MESH, false, {"cell 2 (hex): vertex index ", " is outside 0.."}},
    {"index negative", set_negative_index, INSITU_ERROR_MESH, false, {"cell 1 (hex): vertex index -3 is outside 0.."}},
    {"lowest cell", set_two_bad_indices, INSITU_ERROR_MESH, false, {"cell 1 (hex): vertex index -9"}},
    {"NaN", set_nan_coordinate, INSITU_ERROR_MESH, false, {"cell 0 (hex): vertex ", "coordinate that is not finite"}},
    {"infinite", set_infinite_coordinate, INSITU_ERROR_MESH, false, {"cell 0 (hex)", "not finite: (inf"}},
    {"offsets fall", set_decreasing_offsets, INSITU_ERROR_MESH, false, {"cell 1 (hex): offsets fall from 8 to 3"}},
    {"offsets far",
     set_far_offsets,
     INSITU_ERROR_MESH,
     false,
     {"cell 0 (hex): offsets 0 and 1073741824 are outside 0.."}},
    {"offsets step",
     set_offsets_with_wrong_step,
     INSITU_ERROR_MESH,
     false,
     {"cell 0 (hex): offsets 0 and 7 do not lie 8 apart"}},
    {"last offset", shorten_offsets, INSITU_ERROR_MESH, false, {"the last offset is ", "not connectivity_count"}},
    {"unknown type", set_unknown_type, INSITU_ERROR_MESH, false, {"cell 1: unknown cell type 11"}},
    {"type of 33 bits", set_wide_types, INSITU_ERROR_MESH, false, {"cell 2: unknown cell type 4294967308"}},
    {"type below 32 bits", set_negative_type, INSITU_ERROR_MESH, false, {"cell 0: unknown cell type -1099511627776"}},
    {"far coordinate",
     set_far_coordinate,
     INSITU_ERROR_MESH,
     false,
     {"cell 0 (hex): vertex ", "coordinates of at most 1e+100 are supported"}},
    {"types alone", remove_offsets, INSITU_ERROR_MESH, true, {"cell types are given without offsets"}},
    {"one unknown type", set_unknown_single_type, INSITU_ERROR_MESH, true, {"unknown cell_type 41"}},
    {"one type's count",
     set_single_type_with_wrong_count,
     INSITU_ERROR_MESH,
     true,
     {"connectivity_count is ", "of 6 vertices"}},
    {"no coordinates", remove_coordinates_of_hexes, INSITU_ERROR_MESH, true, {"z coordinates are not given"}},
    {"no coordinates of mixed cells",
     remove_coordinates,
     INSITU_ERROR_MESH,
     false,
     {"z coordinates are not given, but cell 0 (hex) needs them"}},
    {"no connectivity", remove_connectivity, INSITU_ERROR_MESH, true, {"connectivity indices are not given"}},
    {"negative count", count_negative, INSITU_ERROR_ARGUMENT, true, {"vertex_count is -1"}},
    {"too many cells", set_too_many_cells, INSITU_ERROR_ARGUMENT, true, {"cell_count is 4294967295"}},
    {"float indices", set_float_indices, INSITU_ERROR_ARGUMENT, true, {"connectivity indices", "not an integer type"}},
    {"no numbers",
     set_coordinates_without_type,
     INSITU_ERROR_ARGUMENT,
     true,
     {"x coordinates", "float32, float64 or an integer"}},
    {"no such type", set_unknown_array_type, INSITU_ERROR_ARGUMENT, true, {"offsets are of element type 77"}},
    {"real ghosts", set_float_ghosts, INSITU_ERROR_ARGUMENT, true, {"ghost flags", "not an integer type"}},
    {"unknown bits", set_unknown_change_flag, INSITU_ERROR_ARGUMENT, true, {"changed is 64"}},
    {"too few values", set_too_few_values, INSITU_ERROR_FIELD, true, {"field \"f\": has ", " values, the mesh has "}},
    {"no values", remove_values, INSITU_ERROR_FIELD, true, {"field \"f\": values are not given"}},
    {"no numbers", set_values_without_type, INSITU_ERROR_ARGUMENT, true, {"field \"f\": values", "float32, float64"}},
    {"unknown centring", set_unknown_centring, INSITU_ERROR_ARGUMENT, true, {"field \"f\": unknown centring 5"}},
    {"other centring", set_other_centring, INSITU_ERROR_FIELD, true, {"field \"f\": has ", " cells"}},
    {"no components", set_zero_components, INSITU_ERROR_ARGUMENT, true, {"field \"f\": component_count is 0"}},
};

static void corrupted_input_is_reported_on_all_ranks(void **context)
{
    (void)context;
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) check_fault_is_reported(session, &input, &cases[i]);
}

static void call_without_a_mesh_is_reported_once(void **context)
{
    (void)context;
    const bool is_bad = own_rank == 0;
    everywhere(!is_bad || insitu_set_field(session, "nowhere", &input.field) == INSITU_ERROR_FIELD);
    insitu_status status = insitu_step(session, 3, 0);
    check_reported_everywhere(session, status, INSITU_ERROR_FIELD, "rank 0: ", "\"nowhere\" is not set");
    check_step_succeeds(session, 4);
    everywhere(!is_bad || insitu_set_mesh(session, NULL, &input.mesh) == INSITU_ERROR_ARGUMENT);
    status = insitu_step(session, 5, 0);
    check_reported_everywhere(session, status, INSITU_ERROR_ARGUMENT, "rank 0: ", "no name");
    check_step_succeeds(session, 6);
    if (is_bad) remove_field_name(&input);
    everywhere(!is_bad || insitu_set_field(session, "m", &input.field) == INSITU_ERROR_ARGUMENT);
    status = insitu_step(session, 7, 0);
    check_reported_everywhere(session, status, INSITU_ERROR_ARGUMENT, "rank 0: ", "without a name");
    input_restore(&input);
    everywhere(submit_input(session, &input) == INSITU_OK);
    check_step_succeeds(session, 8);
}

static void field_missing_on_one_rank_is_reported_with_the_rank(void **context)
{
    (void)context;
    if (rank_count < 2) return;
    char words[64];
    snprintf(words, sizeof words, "rank %d: mesh \"m\": field \"f\" is not set", rank_count - 1);
    everywhere(insitu_set_mesh(session, "m", &input.mesh) == INSITU_OK);
    everywhere(own_rank == rank_count - 1 || insitu_set_field(session, "m", &input.field) == INSITU_OK);
    insitu_status status = insitu_step(session, 9, 0);
    check_reported_everywhere(session, status, INSITU_ERROR_FIELD, words);
    everywhere(submit_input(session, &input) == INSITU_OK);
    check_step_succeeds(session, 10);
}

static void field_of_two_centrings_is_refused(void **context)
{
    (void)context;
    if (rank_count < 2) return;
    everywhere(submit_input(session, &input) == INSITU_OK);
    insitu_field other = input.field;
    other.centring = INSITU_CELL;
    other.count = input.part.cell_count; /* the cells are fewer than the vertices, so that the array is long enough */
    everywhere(own_rank != 1 || insitu_set_field(session, "m", &other) == INSITU_OK);
    const insitu_status status = insitu_step(session, 11, 0);
    check_reported_everywhere(session, status, INSITU_ERROR_FIELD, "rank 1: mesh \"m\": field \"f\"",
                              "another centring");
    everywhere(submit_input(session, &input) == INSITU_OK);
    check_step_succeeds(session, 12);
}

static void nan_outside_drawn_cells_is_accepted(void **context)
{
    (void)context;
    /* Adds a vertex that no cell uses, with NaN as coordinate and value. */
    double *coordinates = test_calloc((size_t)input.part.vertex_count * 3 + 3, sizeof *coordinates);
    double *values = test_calloc((size_t)input.part.vertex_count + 1, sizeof *values);
    memcpy(coordinates, input.part.coordinates, (size_t)input.part.vertex_count * 3 * sizeof *coordinates);
    memcpy(values, input.part.values, (size_t)input.part.vertex_count * sizeof *values);
    coordinates[3 * input.part.vertex_count] = values[input.part.vertex_count] = NAN;
    session_input more = input;
    more.mesh.vertex_count++;
    more.field.count++;
    insitu_mesh_interleaved(&more.mesh, coordinates, INSITU_FLOAT64);
    more.field.values.data = values;
    everywhere(submit_input(session, &more) == INSITU_OK);
    check_step_succeeds(session, 13);
    everywhere(insitu_last_report(session)->cells_unusable == 0);
    everywhere(submit_input(session, &input) == INSITU_OK);
    test_free(coordinates);
    test_free(values);
}

static void value_that_is_not_finite_is_counted(void **context)
{
    (void)context;
    const bool is_bad = own_rank == rank_count - 1;
    if (is_bad) input.part.values[input.part.connectivity[0]] = NAN;
    int64_t expected = 0;
    for (int64_t cell = 0; cell < input.part.cell_count && is_bad; cell++) {
        bool is_hit = false;
        for (int v = 0; v < 8; v++) is_hit = is_hit || isnan(input.part.values[input.part.connectivity[8 * cell + v]]);
        expected += is_hit;
    }
    everywhere(submit_input(session, &input) == INSITU_OK);
    check_step_succeeds(session, 14);
    const insitu_report *report = insitu_last_report(session);
    everywhere(report->cells_unusable == expected);
    everywhere(!is_bad || strstr(report->warnings, "values of field \"f\" are not finite"));
    input_restore(&input);
    everywhere(submit_input(session, &input) == INSITU_OK);
}

/* Moves every vertex to a random position, so that cells are folded and the inverse map fails at some points of
 * cells. */
static void inverse_maps_that_fail_are_counted(void **context)
{
    (void)context;
    check_step_succeeds(session, 15);
    everywhere(insitu_last_report(session)->map_failures == 0);
    for (int64_t i = 0; i < 3 * input.part.vertex_count; i++)
        input.part.coordinates[i] = 2 * test_uniform((uint64_t)i, 21 + (uint64_t)own_rank) - 1;
    everywhere(submit_input(session, &input) == INSITU_OK);
    check_step_succeeds(session, 16);
    everywhere(insitu_last_report(session)->map_failures > 0);
    input_restore(&input);
    everywhere(submit_input(session, &input) == INSITU_OK);
}

/* Changes the mesh to cells of a single type, with 4-byte indices instead of 8-byte ones. */
static void make_single_type(session_input *in)
{
    char *indices = (char *)in->part.connectivity;
    for (int64_t i = 0; i < in->part.connectivity_count; i++) {
        const int32_t narrow = (int32_t)in->part.connectivity[i];
        memcpy(indices + i * (int64_t)sizeof narrow, &narrow, sizeof narrow);
    }
    in->mesh.connectivity.type = INSITU_INT32;
    in->mesh.cell_types.data = in->mesh.offsets.data = NULL;
    in->mesh.cell_type = INSITU_HEX;
}

/* Checks the message for meshes with a single cell type, in which several cells are checked at once. */
static void invalid_cell_of_a_single_type_mesh_is_reported(void **context)
{
    (void)context;
    int64_t cells = input.part.cell_count; /* number of cells of rank 0 */
    MPI_Bcast(&cells, 1, MPI_INT64_T, 0, MPI_COMM_WORLD);
    for (int cell = 0; cell < 20 && cell < cells; cell += 3) {
        char words[64];
        snprintf(words, sizeof words, "rank 0: mesh \"m\": cell %d (hex): vertex index ", cell);
        if (own_rank == 0) input.part.connectivity[8 * cell + cell % 8] = cell % 2 ? -1 : input.part.vertex_count;
        make_single_type(&input);
        everywhere(submit_input(session, &input) == INSITU_OK);
        check_reported_everywhere(session, insitu_step(session, 17 + cell, 0), INSITU_ERROR_MESH, words);
        input_restore(&input);
        make_single_type(&input);
        everywhere(submit_input(session, &input) == INSITU_OK);
        check_step_succeeds(session, 18 + cell);
        input_restore(&input);
    }
    everywhere(submit_input(session, &input) == INSITU_OK);
}

/* ---- cells without volume ------------------------------------------------------------------------------------ */

/* The kinds of flat cells. A cell is an affine image of the reference cell of its type. Cells that are points, lines or
 * have a repeated face have a volume of exactly 0; the computed volume of oblique ones is a rounding error. */
typedef enum flatness { GOOD, SLIVER, OBLIQUE, REPEATED_FACE, LINE, POINT, FLATNESS_COUNT } flatness;

/* TILTED: number of cells at the beginning whose computed volume is never exactly 0. The library checks several cells
 * at once only if the volume of none of them is exactly 0. */
enum { FLAT_TYPES = 4, TILTED = 240, FLAT_CELLS = TILTED + 64, FLAT_CORNERS = 8 * FLAT_CELLS };

static const insitu_cell_type flat_types[FLAT_TYPES] = {INSITU_TET, INSITU_HEX, INSITU_WEDGE, INSITU_PYRAMID};
static const int flat_corner_count[FLAT_TYPES] = {4, 8, 6, 5};
static const signed char flat_corners[FLAT_TYPES][8][3] = {
    {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}},
    {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}},
    {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {0, 1, 1}},
    {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0, 0, 1}},
};

static flatness get_flatness(int cell)
{
    return (flatness)(cell < TILTED ? cell % (OBLIQUE + 1) : cell % FLATNESS_COUNT);
}

/* Returns a coordinate. Coordinates along x and y are multiples of 2^-40; those along z are multiples of 2^-16, which
 * are exact in float. Sums of coordinates are therefore exact, and flat cells are exactly flat. */
static double compute_flat_coordinate(int type, int cell, int corner, int axis)
{
    const flatness how = get_flatness(cell);
    const double unit = axis == 2 ? 0x1p-16 : 0x1p-40;
    double v[4];
    for (int i = 0; i < 4; i++)
        v[i] = unit * floor((2 * test_uniform((uint64_t)(16 * cell + 4 * axis + i), 31) - 1) / unit);
    if (how == SLIVER) v[3] = v[1] - v[2] + 0x1p-16 * floor(8 * v[3]); /* thickness of about 1e-4 */
    if (how == OBLIQUE) v[3] = v[1] - v[2];
    if (how == REPEATED_FACE) v[3] = 0;
    if (how == LINE) v[2] = v[3] = v[1];
    if (how == POINT) v[1] = v[2] = v[3] = 0;
    const signed char *at = flat_corners[type][corner];
    return v[0] + at[0] * v[1] + at[1] * v[2] + at[2] * v[3];
}

/* Checks the number of flat cells that is reported: for a single cell type, where several cells are checked at once;
 * with a type for each cell, where cells are checked one by one; with coordinates of mixed widths, which other code
 * checks; and for the first eight cells only, whose volumes are small but not 0. */
static void flat_cells_are_counted(void **context)
{
    (void)context;
    static double xyz[FLAT_CORNERS][3], values[FLAT_CORNERS];
    static float narrow_z[FLAT_CORNERS];
    static int32_t indices[FLAT_CORNERS], offsets[FLAT_CELLS + 1];
    static unsigned char types[FLAT_CELLS];
    for (int type = 0; type < FLAT_TYPES; type++) {
        const int corners = flat_corner_count[type], count = corners * FLAT_CELLS;
        for (int i = 0; i < count; i++) {
            for (int axis = 0; axis < 3; axis++)
                xyz[i][axis] = compute_flat_coordinate(type, i / corners, i % corners, axis);
            narrow_z[i] = (float)xyz[i][2];
            indices[i] = i;
        }
        for (int i = 0; i <= FLAT_CELLS; i++) offsets[i] = corners * i;
        memset(types, (int)flat_types[type], sizeof types);
        for (int layout = 0; layout < 4; layout++) {
            session_input flat = input;
            const int cells = layout == 3 ? 8 : FLAT_CELLS;
            int64_t expected = 0;
            for (int cell = 0; cell < cells; cell++) expected += get_flatness(cell) >= OBLIQUE;
            insitu_mesh_defaults(&flat.mesh);
            flat.mesh.vertex_count = flat.field.count = count;
            flat.mesh.cell_count = cells;
            flat.mesh.connectivity_count = cells * corners;
            flat.mesh.cell_type = flat_types[type];
            flat.mesh.connectivity = (insitu_array){indices, INSITU_INT32, 0};
            insitu_mesh_interleaved(&flat.mesh, xyz, INSITU_FLOAT64);
            if (layout == 1) flat.mesh.cell_types = (insitu_array){types, INSITU_UINT8, 0};
            if (layout == 1) flat.mesh.offsets = (insitu_array){offsets, INSITU_INT32, 0};
            if (layout == 2) flat.mesh.coordinates[2] = (insitu_array){narrow_z, INSITU_FLOAT32, 0};
            flat.field.values = (insitu_array){values, INSITU_FLOAT64, 0};
            everywhere(submit_input(session, &flat) == INSITU_OK);
            check_step_succeeds(session, 40 + 4 * type + layout);
            everywhere(insitu_last_report(session)->cells_flat == expected);
        }
    }
    everywhere(submit_input(session, &input) == INSITU_OK);
    check_step_succeeds(session, 60);
    everywhere(insitu_last_report(session)->cells_flat == 0);
}

/* Checks that the message of a failed step persists until the next step. If another call fails in between, its message
 * replaces that of the step. */
static void error_message_persists_until_the_next_step(void **context)
{
    (void)context;
    const int64_t right = input.part.connectivity[0];
    input.part.connectivity[0] = -1;
    everywhere(submit_input(session, &input) == INSITU_OK);
    check_reported_everywhere(session, insitu_step(session, 70, 0), INSITU_ERROR_MESH, "vertex index -1");
    input.part.connectivity[0] = right;
    everywhere(submit_input(session, &input) == INSITU_OK);
    everywhere(insitu_keep_pictures(session, 0) == INSITU_OK);
    everywhere(insitu_last_report(session)->cycle == 70 && strstr(insitu_error(session), "vertex index -1"));
    everywhere(insitu_set_field(session, "none", &input.field) == INSITU_ERROR_FIELD);
    everywhere(strstr(insitu_error(session), "its mesh \"none\" is not set") != NULL);
    check_reported_everywhere(session, insitu_step(session, 71, 0), INSITU_ERROR_FIELD,
                              "rank 0: ", "its mesh \"none\" is not set");
    check_step_succeeds(session, 72);
    everywhere(*insitu_error(session) == '\0');
}

/* ---- other images ---------------------------------------------------------------------------------------------- */

#define OF(name, layer) "  - {name: " name ", size: [24, 16], layers: [" layer "], outputs: [{path: " name ".exr}]}\n"
/* Images "f", "g" and "s" have layers on meshes of any name, "m" on the mesh "m" only. */
static const char several[] =
    "images:\n" OF("f", "{isosurface: {field: f, values: [0.1]}}") OF("g", "{isosurface: {field: g, values: [0.1]}}")
        OF("m", "{surface: {mesh: m, colour_by: {field: f}}}") OF("s", "{surface: {}}");

static void set_negative_cell_count(session_input *in)
{
    in->mesh.cell_count = -1;
}

static insitu_status return_io_error(void *data, insitu_field *field)
{
    (void)data, (void)field;
    return INSITU_ERROR_IO;
}
static void use_failing_fill_function(session_input *in)
{
    in->field.fill = return_io_error;
    in->field.values.data = NULL;
    in->field.count = 0;
}
static void set_short_values_with_index(session_input *in)
{
    in->field.index = in->mesh.connectivity; /* the index has an entry for each vertex, but only one value exists */
    in->field.count = 1;
}

/* Passes the mesh "n" with the field "g". A call may fail on the last rank, whose input can be corrupted. */
static void submit_other(const session_input *in)
{
    insitu_field g = in->field;
    g.name = "g";
    if (insitu_set_mesh(session, "n", &in->mesh) == INSITU_OK || own_rank == rank_count - 1)
        (void)insitu_set_field(session, "n", &g);
}

/* Makes a step and checks its status and that rank 0 has caught pictures with exactly these names, in this order. */
static void check_step_draws(const char *names, insitu_status expected, const char *words)
{
    char drawn[8] = "";
    discard_pictures();
    const insitu_status status = insitu_step(session, 1, 0);
    check_reported_everywhere(session, status, expected, words);
    for (int i = 0; i < caught_count && i < 7; i++) drawn[i] = caught[i].path[0];
    if (own_rank == 0 && strcmp(drawn, names) != 0) fprintf(stderr, "drawn: %s, expected: %s\n", drawn, names);
    everywhere(own_rank != 0 || strcmp(drawn, names) == 0);
}

static void images_without_corrupted_input_are_drawn(void **context)
{
    (void)context;
    static const struct {
        corrupt_function *corrupt;
        insitu_status status;
        const char *drawn, *words;
    } cases[] = {
        {set_negative_cell_count, INSITU_ERROR_ARGUMENT, "fm", "mesh \"n\": cell_count is -1"},
        {set_large_index, INSITU_ERROR_MESH, "fm", "mesh \"n\": cell 2 (hex): vertex index"},
        {set_nan_coordinate, INSITU_ERROR_MESH, "fm", "coordinate that is not finite"},
        {set_too_few_values, INSITU_ERROR_FIELD, "fms", "mesh \"n\": field \"g\": "},
        {use_failing_fill_function, INSITU_ERROR_FIELD, "fms", "mesh \"n\": field \"g\": its fill returned"},
        {set_short_values_with_index, INSITU_ERROR_FIELD, "fms", "mesh \"n\": field \"g\": the index of vertex"},
    };
    insitu_session *const before = session;
    session = open_session(MPI_COMM_WORLD, write_scene(several));
    session_input other;
    input_restore(&input);
    input_create(&other, TEST_HEXES, 4, TEST_RANDOM, own_rank, rank_count);
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        everywhere(submit_input(session, &input) == INSITU_OK);
        submit_other(&other);
        check_step_draws("fgms", INSITU_OK, "");
        if (own_rank == rank_count - 1) cases[i].corrupt(&other);
        submit_other(&other);
        for (int again = 0; again < 2; again++) check_step_draws(cases[i].drawn, cases[i].status, cases[i].words);
        input_restore(&other);
        submit_other(&other);
        check_step_draws("fgms", INSITU_OK, "");
        everywhere(insitu_set_field(session, "none", &input.field) == INSITU_ERROR_FIELD);
        check_step_draws("gms", INSITU_ERROR_FIELD, "its mesh \"none\" is not set");
    }
    input_free(&other);
    insitu_destroy(&session);
    session = before;
}

static int set_up_test_group(void **state)
{
    (void)state;
    session = open_session(MPI_COMM_WORLD, write_scene(scene_text));
    input_create(&input, TEST_HEXES, 4, TEST_RANDOM, own_rank, rank_count);
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
        cmocka_unit_test(corrupted_input_is_reported_on_all_ranks),
        cmocka_unit_test(call_without_a_mesh_is_reported_once),
        cmocka_unit_test(field_missing_on_one_rank_is_reported_with_the_rank),
        cmocka_unit_test(field_of_two_centrings_is_refused),
        cmocka_unit_test(nan_outside_drawn_cells_is_accepted),
        cmocka_unit_test(value_that_is_not_finite_is_counted),
        cmocka_unit_test(inverse_maps_that_fail_are_counted),
        cmocka_unit_test(invalid_cell_of_a_single_type_mesh_is_reported),
        cmocka_unit_test(flat_cells_are_counted),
        cmocka_unit_test(error_message_persists_until_the_next_step),
        cmocka_unit_test(images_without_corrupted_input_are_drawn),
    };
    return run_session_tests(argc, argv, tests, set_up_test_group, tear_down_test_group);
}
