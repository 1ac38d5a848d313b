/* Checks meshes that consist of blocks (lattices, or lists of cells with ghost layers) distributed over ranks. They
 * must be drawn as the same cells in a single list, without seams between blocks in means, normals, derived fields,
 * outer surfaces, volumes and statistics. The cells of the list are distributed over the same ranks by another rule. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "test_session_fixture.h"

enum {
    CELLS = 12,
    LINE = CELLS + 1,
    DEAL = 3,
    BLOCKS = 3 * 2 * 2,
    WIDE = 8,
    MOST = (WIDE + 1) * (WIDE + 1) * (WIDE + 1)
};

static const int distribute[3] = {3, 2, 2}; /* number of blocks along each axis */

static const char *const images[] = {
    "[{isosurface: {field: c, values: [0.55], normals: vertex}}]",
    "[{isosurface: {field: f, values: [0.62], normals: vertex, colour_by: {field: c}}}]",
    "[{surface: {colour_by: {field: c, interpolate: vertex}, opacity: 0.5}}]",
    "[{surface: {colour_by: {field: f}, opacity: 0.5, threshold: {field: f, from: 0.4}}}]",
    "[{isosurface: {field: steep, values: [0.9]}}]",
    "[{volume: {field: c, interpolate: vertex, opacity: [[0, 0.1], [1, 0.9]]}}]",
    "[{volume: {field: c, opacity: [[0, 0.2], [1, 0.9]]}}, {slice: {planes: [{normal: [1, 2, 3]}], field: mixed}}]",
};
enum { IMAGES = sizeof images / sizeof images[0] };

static const char *write_block_scene(void)
{
    static char text[8192];
    int at = snprintf(text, sizeof text,
                      "fields: {g: {gradient: f}, steep: mag(g), mixed: f + 2 * c}\n"
                      "statistics:\n  - {field: c, path: numbers.csv}\nimages:\n");
    for (int i = 0; i < IMAGES; i++)
        at += snprintf(
            text + at, sizeof text - (size_t)at,
            "  - {name: a%d, size: [60, 50], sampling: {reproducible: true}, layers: %s, outputs: [{path: a%d.exr}]}\n",
            i, images[i], i);
    return write_scene(text);
}

/* ---- the whole mesh ---------------------------------------------------------------------------------------------- */

static double compute_coordinate(int axis, int index)
{
    static const double origin[3] = {-1, -0.75, -0.5}, spacing[3] = {0.15, 0.1, 0.13};
    return origin[axis] + spacing[axis] * (double)index;
}

static double compute_vertex_value(const int at[3])
{
    const double x = compute_coordinate(0, at[0]), y = compute_coordinate(1, at[1]), z = compute_coordinate(2, at[2]);
    return sqrt(x * x + y * y + z * z) + 0.1 * sin(5 * x + y);
}

static double compute_cell_value(const int at[3])
{
    return 0.5 + 0.5 * sin(0.7 * at[0]) * cos(0.5 * at[1] + 0.3 * at[2]);
}

static const int corners[8][3] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0},
                                  {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}};

/* The arrays of a list of hexes or of a block. */
typedef struct cell_arrays {
    int64_t vertex_count, cell_count, connectivity_count;
    double (*places)[3], *f, *c;
    int32_t *hexes, *ghosts;
} cell_arrays;

static void create_arrays(cell_arrays *a, int64_t vertices, int64_t cells)
{
    *a = (cell_arrays){.vertex_count = vertices, .cell_count = cells};
    a->places = malloc((size_t)vertices * sizeof *a->places);
    a->f = malloc((size_t)vertices * sizeof *a->f);
    a->c = malloc((size_t)cells * sizeof *a->c + 1);
    a->hexes = malloc((size_t)cells * 8 * sizeof *a->hexes + 1);
    a->ghosts = calloc((size_t)cells + 1, sizeof *a->ghosts);
    assert_true(a->places && a->f && a->c && a->hexes && a->ghosts);
}

static void destroy_arrays(cell_arrays *a)
{
    free(a->places);
    free(a->f);
    free(a->c);
    free(a->hexes);
    free(a->ghosts);
}

typedef insitu_status set_function(insitu_session *session, int64_t number, const insitu_field *field);

static insitu_status set_field_of_whole_mesh(insitu_session *session, int64_t number, const insitu_field *field)
{
    (void)number;
    return insitu_set_field(session, "m", field);
}

static insitu_status set_field_of_block(insitu_session *session, int64_t number, const insitu_field *field)
{
    return insitu_set_block_field(session, "m", number, field);
}

static bool set_fields(insitu_session *session, int64_t number, const cell_arrays *a, set_function *set)
{
    insitu_field field;
    insitu_field_defaults(&field);
    field.name = "f";
    field.count = a->vertex_count;
    field.values = (insitu_array){a->f, INSITU_FLOAT64, 0};
    if (set(session, number, &field)) return false;
    field.name = "c";
    field.centring = INSITU_CELL;
    field.count = a->cell_count;
    field.values = (insitu_array){a->c, INSITU_FLOAT64, 0};
    return set(session, number, &field) == INSITU_OK;
}

/* Makes this rank's part of the list of all cells: groups of 5 consecutive cells are dealt to the ranks in turn. */
static void make_list(cell_arrays *a)
{
    create_arrays(a, LINE * LINE * LINE, CELLS * CELLS * CELLS);
    int64_t count = 0;
    for (int v = 0; v < LINE * LINE * LINE; v++) {
        const int at[3] = {v % LINE, v / LINE % LINE, v / LINE / LINE};
        for (int axis = 0; axis < 3; axis++) a->places[v][axis] = compute_coordinate(axis, at[axis]);
        a->f[v] = compute_vertex_value(at);
    }
    for (int cell = 0; cell < CELLS * CELLS * CELLS; cell++) {
        const int at[3] = {cell % CELLS, cell / CELLS % CELLS, cell / CELLS / CELLS};
        if ((cell / 5) % rank_count != own_rank) continue;
        for (int i = 0; i < 8; i++)
            a->hexes[8 * count + i] =
                at[0] + corners[i][0] + LINE * (at[1] + corners[i][1] + LINE * (at[2] + corners[i][2]));
        a->c[count++] = compute_cell_value(at);
    }
    a->cell_count = count;
}

static bool set_list(insitu_session *session, const cell_arrays *a)
{
    insitu_mesh mesh;
    insitu_mesh_defaults(&mesh);
    insitu_mesh_interleaved(&mesh, a->places, INSITU_FLOAT64);
    mesh.vertex_count = a->vertex_count;
    mesh.cell_count = a->cell_count;
    mesh.cell_type = INSITU_HEX;
    mesh.connectivity_count = 8 * a->cell_count;
    mesh.connectivity = (insitu_array){a->hexes, INSITU_INT32, 0};
    return insitu_set_mesh(session, "m", &mesh) == INSITU_OK && set_fields(session, 0, a, set_field_of_whole_mesh);
}

/* ---- blocks ------------------------------------------------------------------------------------------------------ */

typedef struct block {
    /* first: index in the whole mesh of the first cell; cells: number of cells; with ghost layers */
    int number, first[3], cells[3];
    int own_first[3], own_end[3]; /* range of the cells without ghost layers, as indices in the block */
    cell_arrays a;
    int64_t *ids; /* ids of the block's vertices in the whole mesh */
} block;

static bool is_own_cell(const block *b, const int at[3])
{
    for (int axis = 0; axis < 3; axis++)
        if (at[axis] < b->own_first[axis] || at[axis] >= b->own_end[axis]) return false;
    return true;
}

/* Fills a block's arrays. Cells in ghost layers have a wrong value, so that pictures differ if it is used. */
static void fill_block(block *b)
{
    const int wide[3] = {b->cells[0] + 1, b->cells[1] + 1, b->cells[2] + 1};
    b->ids = malloc((size_t)wide[0] * (size_t)wide[1] * (size_t)wide[2] * sizeof *b->ids);
    assert_non_null(b->ids);
    create_arrays(&b->a, (int64_t)wide[0] * wide[1] * wide[2], (int64_t)b->cells[0] * b->cells[1] * b->cells[2]);
    for (int v = 0; v < b->a.vertex_count; v++) {
        const int at[3] = {b->first[0] + v % wide[0], b->first[1] + v / wide[0] % wide[1],
                           b->first[2] + v / wide[0] / wide[1]};
        for (int axis = 0; axis < 3; axis++) b->a.places[v][axis] = compute_coordinate(axis, at[axis]);
        b->a.f[v] = compute_vertex_value(at);
        b->ids[v] = at[0] + LINE * (at[1] + LINE * at[2]);
    }
    for (int cell = 0; cell < b->a.cell_count; cell++) {
        const int at[3] = {cell % b->cells[0], cell / b->cells[0] % b->cells[1], cell / b->cells[0] / b->cells[1]};
        const int whole[3] = {at[0] + b->first[0], at[1] + b->first[1], at[2] + b->first[2]};
        for (int i = 0; i < 8; i++)
            b->a.hexes[8 * cell + i] =
                at[0] + corners[i][0] + wide[0] * (at[1] + corners[i][1] + wide[1] * (at[2] + corners[i][2]));
        b->a.c[cell] = is_own_cell(b, at) ? compute_cell_value(whole) : -40;
        b->a.ghosts[cell] = is_own_cell(b, at) ? 0 : 0x10000; /* a flag whose lowest byte is 0 */
    }
}

static void make_block(int number, block *b)
{
    const int place[3] = {number % distribute[0], number / distribute[0] % distribute[1],
                          number / distribute[0] / distribute[1]};
    *b = (block){.number = number};
    for (int axis = 0; axis < 3; axis++) {
        const int width = CELLS / distribute[axis], first = place[axis] * width, end = first + width;
        const int low = first > 0, high = end < CELLS;
        b->first[axis] = first - low;
        b->cells[axis] = width + low + high;
        b->own_first[axis] = low;
        b->own_end[axis] = low + width;
    }
    fill_block(b);
}

static bool with_ids, are_in_slabs;

/* Passes the block to the session as a uniform lattice, a curvilinear lattice, or a list of cells with ghost flags,
 * depending on its number. */
static insitu_status set_block(insitu_session *session, const block *b, unsigned changed)
{
    insitu_lattice lattice = {.origin = {-1, -0.75, -0.5}, .spacing = {0.15, 0.1, 0.13}};
    insitu_mesh mesh;
    insitu_mesh_defaults(&mesh);
    mesh.changed = changed;
    mesh.vertex_count = b->a.vertex_count;
    mesh.cell_count = b->a.cell_count;
    for (int axis = 0; axis < 3; axis++) {
        lattice.cells[axis] = b->cells[axis];
        lattice.first[axis] = b->first[axis];
        lattice.interior_first[axis] = b->own_first[axis];
        lattice.interior_end[axis] = b->own_end[axis];
        if (b->number % 3 == 1) lattice.spacing[axis] = lattice.origin[axis] = 0;
    }
    if (b->number % 3) insitu_mesh_interleaved(&mesh, b->a.places, INSITU_FLOAT64);
    if (b->number % 3 < 2) mesh.lattice = &lattice;
    if (b->number % 3 == 2) {
        mesh.cell_type = INSITU_HEX;
        mesh.connectivity_count = 8 * mesh.cell_count;
        mesh.connectivity = (insitu_array){b->a.hexes, INSITU_INT32, 0};
        mesh.ghosts = (insitu_array){b->a.ghosts, INSITU_INT32, 0};
    }
    if (with_ids) mesh.vertex_ids = (insitu_array){b->ids, INSITU_INT64, 0};
    return insitu_set_block(session, "m", b->number, &mesh);
}

static void destroy_block(block *b)
{
    destroy_arrays(&b->a);
    free(b->ids);
}

static bool submit_block(insitu_session *session, const block *b, unsigned changed)
{
    return set_block(session, b, changed) == INSITU_OK && set_fields(session, b->number, &b->a, set_field_of_block);
}

/* Returns the rank that owns a block. If are_in_slabs is set, each rank owns slabs of blocks, so that ranks share
 * vertices only at the borders of slabs. Otherwise the last of three or more ranks owns no block. */
static int get_block_owner(int number)
{
    if (are_in_slabs) return number % distribute[0] % rank_count;
    return rank_count < 3 ? number % rank_count : (7 * number + 3) % 11 % (rank_count - 1);
}

/* ---- tests ------------------------------------------------------------------------------------------------------- */

static block blocks[BLOCKS];
static caught_picture truth[IMAGES];
static char true_numbers[4096];

static void step_ok(insitu_session *session, int cycle)
{
    const insitu_status status = insitu_step(session, cycle, cycle);
    if (status) fprintf(stderr, "%s\n", insitu_error(session));
    everywhere(status == INSITU_OK);
}

static int set_up_test_group(void **state)
{
    cell_arrays list;
    (void)state;
    if (!enter_test_folder("blocks")) return 1;
    for (int number = 0; number < BLOCKS; number++) make_block(number, &blocks[number]);
    make_list(&list);
    insitu_session *session = open_session(MPI_COMM_WORLD, write_block_scene());
    everywhere(set_list(session, &list));
    if (!own_rank) remove("numbers.csv");
    step_ok(session, 0);
    everywhere(own_rank || caught_count == IMAGES);
    for (int i = 0; i < caught_count; i++) truth[i] = caught[i];
    caught_count = 0;
    insitu_destroy(&session);
    read_file("numbers.csv", sizeof true_numbers, true_numbers);
    destroy_arrays(&list);
    return 0;
}

static int tear_down_test_group(void **state)
{
    (void)state;
    for (int number = 0; number < BLOCKS; number++) destroy_block(&blocks[number]);
    for (int i = 0; i < IMAGES && !own_rank; i++) free_caught(&truth[i]);
    return 0;
}

static void check_pictures_match_reference(void)
{
    everywhere(own_rank || caught_count == IMAGES);
    for (int i = 0; i < caught_count; i++) {
        if (!are_same_pictures(&caught[i], &truth[i])) fprintf(stderr, "differs: %s\n", images[i]);
        assert_true(count_visible_pixels(&truth[i]) > 100);
        assert_true(are_same_pictures(&caught[i], &truth[i]));
    }
    discard_pictures();
}

static void blocks_draw_same_picture_as_their_cell_list(void **state)
{
    char numbers[4096];
    (void)state;
    insitu_session *session = open_session(MPI_COMM_WORLD, write_block_scene());
    bool is_set = true;
    for (int number = 0; number < BLOCKS; number++)
        if (get_block_owner(number) == own_rank)
            is_set = is_set && submit_block(session, &blocks[number], INSITU_CHANGED_ALL);
    everywhere(is_set);
    if (!own_rank) remove("numbers.csv");
    step_ok(session, 0);
    check_pictures_match_reference();
    read_file("numbers.csv", sizeof numbers, numbers);
    everywhere(strcmp(numbers, true_numbers) == 0);
    int64_t cells = insitu_last_report(session)->cells - insitu_last_report(session)->cells_ghost;
    MPI_Allreduce(MPI_IN_PLACE, &cells, 1, MPI_INT64_T, MPI_SUM, MPI_COMM_WORLD);
    everywhere(cells == CELLS * CELLS * CELLS);
    insitu_destroy(&session);
}

static void vertex_ids_connect_blocks(void **state)
{
    with_ids = are_in_slabs = true;
    blocks_draw_same_picture_as_their_cell_list(state);
    with_ids = are_in_slabs = false;
}

/* Checks blocks that are removed and added: those with odd numbers move to another rank at every step, the others
 * stay. */
static void blocks_are_added_and_removed(void **state)
{
    (void)state;
    insitu_session *session = open_session(MPI_COMM_WORLD, write_block_scene());
    for (int cycle = 0; cycle < 4; cycle++) {
        bool is_set = true;
        for (int number = 0; number < BLOCKS; number++) {
            const int moves = number % 2 ? cycle : 0;
            const bool is_here = (number + moves) % rank_count == own_rank;
            const bool was_here = cycle && (number + (number % 2 ? cycle - 1 : 0)) % rank_count == own_rank;
            if (was_here && !is_here) is_set = is_set && !insitu_set_block(session, "m", number, NULL);
            if (is_here && !(was_here && number % 4 == 0))
                is_set = is_set && submit_block(session, &blocks[number], was_here ? 0 : INSITU_CHANGED_ALL);
        }
        everywhere(is_set);
        step_ok(session, cycle);
        check_pictures_match_reference();
    }
    insitu_destroy(&session);
}

/* Checks that the most recent call decides whether a mesh is a single list of cells or consists of blocks. */
static void whole_and_blocks_replace_each_other(void **state)
{
    cell_arrays list;
    (void)state;
    make_list(&list);
    insitu_session *session = open_session(MPI_COMM_WORLD, write_block_scene());
    for (int cycle = 0; cycle < 4; cycle++) {
        bool is_set = true;
        for (int number = 0; number < BLOCKS && cycle % 2; number++)
            if (number % rank_count == own_rank)
                is_set = is_set && submit_block(session, &blocks[number], INSITU_CHANGED_ALL);
        if (cycle % 2 && BLOCKS <= own_rank) is_set = is_set && !insitu_set_mesh(session, "m", NULL);
        if (cycle % 2 == 0) is_set = set_list(session, &list);
        everywhere(is_set);
        step_ok(session, cycle);
        check_pictures_match_reference();
    }
    destroy_arrays(&list);
    insitu_destroy(&session);
}

/* ---- errors ------------------------------------------------------------------------------------------------------ */

static void set_all(insitu_session *session)
{
    for (int number = 0; number < BLOCKS; number++)
        if (get_block_owner(number) == own_rank) submit_block(session, &blocks[number], INSITU_CHANGED_ALL);
}

static void wrong_calls_are_reported_at_once(void **state)
{
    insitu_field field;
    insitu_mesh mesh;
    (void)state;
    insitu_session *session = open_session(MPI_COMM_WORLD, write_block_scene());
    insitu_mesh_defaults(&mesh);
    insitu_field_defaults(&field);
    field.name = "f";
    everywhere(insitu_set_block(session, "m", -2, &mesh) == INSITU_ERROR_ARGUMENT);
    everywhere(strstr(insitu_error(session), "mesh \"m\": the number of the block is -2") != NULL);
    everywhere(insitu_set_block(session, "m", 3, &mesh) == INSITU_OK);
    everywhere(insitu_set_field(session, "m", &field) == INSITU_ERROR_FIELD);
    everywhere(strstr(insitu_error(session), "use insitu_set_block_field") != NULL);
    everywhere(insitu_set_block_field(session, "m", 4, &field) == INSITU_ERROR_FIELD);
    everywhere(strstr(insitu_error(session), "block 4 of its mesh \"m\" is not set") != NULL);
    everywhere(insitu_set_mesh(session, "m", &mesh) == INSITU_OK);
    everywhere(insitu_set_block_field(session, "m", 3, &field) == INSITU_ERROR_FIELD);
    everywhere(strstr(insitu_error(session), "use insitu_set_field") != NULL);
    insitu_destroy(&session);
}

/* Checks that a fault of one block is reported on all ranks, and that the picture equals the reference after the fault
 * is corrected. */
static void faults_of_one_block_are_reported_on_all_ranks(void **state)
{
    const int corrupted = 5;
    const bool is_mine = get_block_owner(corrupted) == own_rank;
    insitu_mesh mesh;
    (void)state;
    insitu_session *session = open_session(MPI_COMM_WORLD, write_block_scene());
    set_all(session);
    insitu_mesh_defaults(&mesh);
    mesh.vertex_count = -1;
    if (is_mine) insitu_set_block(session, "m", corrupted, &mesh);
    check_reported_everywhere(session, insitu_step(session, 0, 0), INSITU_ERROR_ARGUMENT,
                              "mesh \"m[5]\": vertex_count is -1");
    blocks[corrupted].a.hexes[77] = -4; /* block 5 is a list of cells */
    if (is_mine) submit_block(session, &blocks[corrupted], INSITU_CHANGED_ALL);
    check_reported_everywhere(session, insitu_step(session, 1, 1), INSITU_ERROR_MESH, "mesh \"m[5]\": cell 9 ");
    blocks[corrupted].a.hexes[77] = blocks[corrupted].a.hexes[69] + 1;
    if (is_mine) insitu_set_block(session, "m", corrupted, NULL);
    destroy_block(&blocks[corrupted]);
    make_block(corrupted, &blocks[corrupted]);
    if (is_mine) set_block(session, &blocks[corrupted], INSITU_CHANGED_ALL); /* the block is set without its fields */
    if (rank_count > 1 || is_mine)
        check_reported_everywhere(session, insitu_step(session, 2, 2), INSITU_ERROR_FIELD,
                                  "mesh \"m[5]\": field \"c\" is not set, other blocks have it");
    discard_pictures();
    if (is_mine) submit_block(session, &blocks[corrupted], 0);
    step_ok(session, 3);
    check_pictures_match_reference();
    insitu_destroy(&session);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(blocks_draw_same_picture_as_their_cell_list),
                                       cmocka_unit_test(vertex_ids_connect_blocks),
                                       cmocka_unit_test(blocks_are_added_and_removed),
                                       cmocka_unit_test(whole_and_blocks_replace_each_other),
                                       cmocka_unit_test(wrong_calls_are_reported_at_once),
                                       cmocka_unit_test(faults_of_one_block_are_reported_on_all_ranks)};
    return run_session_tests(argc, argv, tests, set_up_test_group, tear_down_test_group);
}
