/* Checks structured blocks that are faulty or that change. A faulty description on one rank must give the same error on
 * all ranks, with the axis and the number, and must have no effect after its correction. After each change of its form
 * or position, a session must draw the same picture as a second session, to which each block is a new mesh. The second
 * session draws as many pictures, because a session keeps the origin of its coordinates while the cells stay
 * approximately at the same position. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "test_session_fixture.h"

enum { NI = 6, NJ = 5, NK = 4, CELLS = NI * NJ * NK, VERTICES = (NI + 1) * (NJ + 1) * (NK + 1), LONGEST = NI + 1 };

static const char blocks_scene[] = "images:\n  - name: a\n    size: [32, 24]\n    layers:\n"
                                   "      - isosurface: {field: f, values: [0.55]}\n"
                                   "      - surface: {colour_by: {field: c}, opacity: 0.4}\n"
                                   "    camera: {position: [9, 14, 11], focal: [5, 2, 2], up: [0, 0, 1]}\n"
                                   "    outputs: [{path: a.exr}]\n";

/* A rank's block, with the arrays of all forms. The blocks of the ranks are side by side along i. Strides of 0 mean
 * that the lattice is packed. */
typedef struct block {
    insitu_lattice lattice;
    insitu_mesh mesh;
    insitu_field f, c;
    double places[3][VERTICES], axes[3][LONGEST], f_values[VERTICES], c_values[CELLS];
    int64_t hexes[8 * CELLS];
    unsigned char ghosts[CELLS];
} block;

static insitu_array make_double_array(const double *data)
{
    return (insitu_array){data, INSITU_FLOAT64, 0};
}

static void fill_cell(block *b, int64_t cell, int i, int j, int k)
{
    static const int corner[8][3] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0},
                                     {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}};
    b->c_values[cell] = 0.5 + 0.4 * sin(0.9 * (i + NI * own_rank) + 0.5 * j * k);
    b->ghosts[cell] = 0;
    for (int n = 0; n < 8; n++)
        b->hexes[8 * cell + n] =
            i + corner[n][0] + (NI + 1) * (j + corner[n][1] + (NJ + 1) * (int64_t)(k + corner[n][2]));
}

static void fill_arrays(block *b)
{
    int64_t vertex = 0, cell = 0;
    for (int k = 0; k <= NK; k++)
        for (int j = 0; j <= NJ; j++)
            for (int i = 0; i <= NI; i++, vertex++) {
                const int at = i + NI * own_rank;
                b->places[0][vertex] = at + 0.2 * sin(j + k);
                b->places[1][vertex] = j + 0.2 * sin(at);
                b->places[2][vertex] = k + 0.1 * sin(at + j);
                b->f_values[vertex] = 0.5 + 0.5 * sin(0.7 * at) * cos(0.5 * j + 0.4 * k);
                b->axes[0][i] = at + 0.03 * (at * at % 7);
                b->axes[1][j] = j + 0.03 * (j * j % 7);
                b->axes[2][k] = k + 0.03 * (k * k % 7);
            }
    for (int k = 0; k < NK; k++)
        for (int j = 0; j < NJ; j++)
            for (int i = 0; i < NI; i++) fill_cell(b, cell++, i, j, k);
}

static void make_uniform(block *b)
{
    for (int axis = 0; axis < 3; axis++) {
        b->lattice.axes[axis] = (insitu_array){0};
        b->mesh.coordinates[axis] = (insitu_array){0};
        b->lattice.spacing[axis] = 1;
    }
    b->lattice.first[0] = NI * own_rank;
    b->mesh.lattice = &b->lattice;
}

static void make_rectilinear(block *b)
{
    for (int axis = 0; axis < 3; axis++) {
        b->lattice.spacing[axis] = 0;
        b->lattice.axes[axis] = make_double_array(b->axes[axis]);
        b->mesh.coordinates[axis] = (insitu_array){0};
    }
}

static void make_curvilinear(block *b)
{
    for (int axis = 0; axis < 3; axis++) {
        b->lattice.spacing[axis] = 0;
        b->lattice.axes[axis] = (insitu_array){0};
        b->mesh.coordinates[axis] = make_double_array(b->places[axis]);
    }
}

static void make_hexes(block *b)
{
    make_curvilinear(b);
    b->mesh.lattice = NULL;
    b->mesh.cell_type = INSITU_HEX;
    b->mesh.connectivity_count = 8 * CELLS;
    b->mesh.connectivity = (insitu_array){b->hexes, INSITU_INT64, 0};
}

static block *make_block(void)
{
    block *b = calloc(1, sizeof *b);
    assert_non_null(b);
    fill_arrays(b);
    b->lattice = (insitu_lattice){.cells = {NI, NJ, NK}};
    insitu_mesh_defaults(&b->mesh);
    b->mesh.vertex_count = VERTICES;
    b->mesh.cell_count = CELLS;
    make_uniform(b);
    insitu_field_defaults(&b->f);
    b->f.name = "f";
    b->f.count = VERTICES;
    b->f.values = make_double_array(b->f_values);
    b->c = b->f;
    b->c.name = "c";
    b->c.centring = INSITU_CELL;
    b->c.count = CELLS;
    b->c.values = make_double_array(b->c_values);
    return b;
}

static insitu_status set_block(insitu_session *session, const block *b)
{
    insitu_status status = insitu_set_mesh(session, "m", &b->mesh);
    if (!status) status = insitu_set_field(session, "m", &b->f);
    if (!status) status = insitu_set_field(session, "m", &b->c);
    return status;
}

static bool is_same(const caught_picture *a, const caught_picture *b)
{
    const size_t pixels = (size_t)a->width * (size_t)a->height;
    return b->rgba && a->width == b->width && a->height == b->height &&
           memcmp(a->rgba, b->rgba, 4 * pixels * sizeof(float)) == 0 &&
           memcmp(a->depth, b->depth, pixels * sizeof(float)) == 0;
}

/* ---- faulty blocks ---------------------------------------------------------------------------------------------- */

#define SPOIL(name, ...)                                                                                               \
    static void name(block *b)                                                                                         \
    {                                                                                                                  \
        __VA_ARGS__;                                                                                                   \
    }

SPOIL(no_cells_along_j_and_k, b->lattice.cells[1] = b->lattice.cells[2] = 0)
SPOIL(no_cells_at_all, b->lattice.cells[0] = b->lattice.cells[1] = b->lattice.cells[2] = 0)
SPOIL(negative_cells, b->lattice.cells[2] = -4)
SPOIL(huge_cells, b->lattice.cells[0] = (int64_t)1 << 60)
SPOIL(many_cells, b->lattice.cells[0] = b->lattice.cells[1] = b->lattice.cells[2] = 4294967294)
SPOIL(another_cell, b->lattice.cells[1] = NJ + 1)
SPOIL(strides_of_one, b->lattice.vertex_strides[0] = b->lattice.vertex_strides[1] = b->lattice.vertex_strides[2] = 1)
SPOIL(strides_that_overlap,
      memcpy(b->lattice.vertex_strides, (int64_t[]){1, NI, (NI + 1) * (NJ + 1)}, sizeof b->lattice.vertex_strides))
SPOIL(stride_of_zero,
      memcpy(b->lattice.vertex_strides, (int64_t[]){1, 0, (NI + 1) * (NJ + 1)}, sizeof b->lattice.vertex_strides))
SPOIL(negative_stride, memcpy(b->lattice.cell_strides, (int64_t[]){-1, NI, NI *NJ}, sizeof b->lattice.cell_strides))
SPOIL(huge_stride,
      memcpy(b->lattice.vertex_strides, (int64_t[]){1, NI + 1, (int64_t)1 << 60}, sizeof b->lattice.vertex_strides))
SPOIL(longest_stride, memcpy(b->lattice.cell_strides, (int64_t[]){1, NI, INT64_MAX}, sizeof b->lattice.cell_strides))
SPOIL(padded_cells, memcpy(b->lattice.cell_strides, (int64_t[]){1, NI + 1, 50}, sizeof b->lattice.cell_strides))
SPOIL(interior_beyond, memcpy(b->lattice.interior_end, (int64_t[]){NI, NJ + 1, NK}, sizeof b->lattice.interior_end))
SPOIL(interior_before, b->lattice.interior_first[0] = -1)
SPOIL(interior_backwards, {
    memcpy(b->lattice.interior_first, (int64_t[]){0, 0, 3}, sizeof b->lattice.interior_first);
    memcpy(b->lattice.interior_end, (int64_t[]){NI, NJ, 2}, sizeof b->lattice.interior_end);
})
SPOIL(spacing_of_zero, b->lattice.spacing[1] = 0)
SPOIL(spacing_nan, b->lattice.spacing[2] = (double)NAN)
SPOIL(spacing_huge, b->lattice.spacing[2] = 1e300)
SPOIL(spacing_beyond, b->lattice.spacing[2] = 1e308)
SPOIL(origin_infinite, b->lattice.origin[0] = (double)INFINITY)
SPOIL(first_huge, b->lattice.first[1] = INT64_MAX)
SPOIL(first_least, b->lattice.first[1] = INT64_MIN)
SPOIL(nothing_given, b->lattice.spacing[0] = b->lattice.spacing[1] = b->lattice.spacing[2] = 0)
SPOIL(axis_missing, (make_rectilinear(b), b->lattice.axes[1].data = NULL))
SPOIL(axis_nan, (make_rectilinear(b), b->axes[2][3] = (double)NAN))
SPOIL(axis_of_no_type, (make_rectilinear(b), b->lattice.axes[0].type = (insitu_type)77))
SPOIL(axis_stride, (make_rectilinear(b), b->lattice.axes[0].stride_bytes = (int64_t)1 << 60))
SPOIL(spacing_and_axes, b->lattice.axes[0] = make_double_array(b->axes[0]))
SPOIL(coordinates_and_spacing, b->mesh.coordinates[2] = make_double_array(b->places[2]))
SPOIL(coordinates_and_axes, (make_rectilinear(b), b->mesh.coordinates[0] = make_double_array(b->places[0])))
SPOIL(coordinate_missing, (make_curvilinear(b), b->mesh.coordinates[1].data = NULL))
SPOIL(coordinate_nan, (make_curvilinear(b), b->places[1][57] = (double)NAN))
SPOIL(connectivity_too,
      (b->mesh.connectivity_count = 8 * CELLS, b->mesh.connectivity = (insitu_array){b->hexes, INSITU_INT64, 0}))
SPOIL(offsets_too, b->mesh.offsets = (insitu_array){b->hexes, INSITU_INT64, 0})
SPOIL(types_too, b->mesh.cell_types = (insitu_array){b->ghosts, INSITU_UINT8, 0})
SPOIL(rows_too, b->mesh.connectivity_row = 8)
SPOIL(owner_too, {
    b->mesh.cell_type = INSITU_POLYHEDRON;
    b->mesh.owner = (insitu_array){b->hexes, INSITU_INT64, 0};
})
SPOIL(few_cells, b->mesh.cell_count = CELLS - 1)
SPOIL(few_vertices, b->mesh.vertex_count = VERTICES - 1)
SPOIL(no_vertices, b->mesh.vertex_count = 0)
SPOIL(most_cells, b->mesh.cell_count = 4294967295)
SPOIL(corner_field,
      (b->f.centring = INSITU_CORNER, b->f.count = 8 * CELLS, b->f.values = make_double_array(b->f_values)))
SPOIL(field_short, b->f.count = VERTICES - 1)
SPOIL(cell_field_short, b->c.count = CELLS - 1)

typedef struct wrong_block {
    const char *name;
    void (*corrupt)(block *b);
    bool at_once; /* whether a set call fails, not only the step */
    const char *words;
    insitu_status status;
} wrong_block;

#define WRONG(corrupt, at_once, words) #corrupt, corrupt, at_once, words, INSITU_ERROR_MESH

static const wrong_block wrong_blocks[] = {
    {WRONG(no_cells_along_j_and_k, true, "0 and 0 along i, j and k, expected 0 along at most one of them")},
    {WRONG(no_cells_at_all, true, "lattice: there are no cells along i, j and k, and cell_count is 120")},
    {WRONG(negative_cells, true, "lattice: cells along k are -4, expected 0..4294967294")},
    {WRONG(huge_cells, true, "lattice: cells along i are 1152921504606846976, expected 0..")},
    {WRONG(many_cells, true, "lattice: ")},
    {WRONG(another_cell, true, "lattice: 5 vertices along k with a stride of 49 do not fit into arrays of 210")},
    {WRONG(strides_of_one, true, "lattice: the stride of vertices along j is 1, at least 7 is needed")},
    {WRONG(strides_that_overlap, true, "lattice: the stride of vertices along j is 6, at least 7 is needed")},
    {WRONG(stride_of_zero, true, "lattice: the stride of vertices along j is 0, at least 1 is needed")},
    {WRONG(negative_stride, true, "lattice: the stride of cells along i is -1, at least 1 is needed")},
    {WRONG(huge_stride, true, "along k with a stride of 1152921504606846976 do not fit into arrays of 210")},
    {WRONG(longest_stride, true, "along k with a stride of 9223372036854775807 do not fit into arrays of 120")},
    {WRONG(padded_cells, true, "lattice: 4 cells along k with a stride of 50 do not fit into arrays of 120")},
    {WRONG(interior_beyond, true, "lattice: the interior along j is 0..6, expected a range within 0..5")},
    {WRONG(interior_before, true, "lattice: the interior along i is -1..0, expected a range within 0..6")},
    {WRONG(interior_backwards, true, "lattice: the interior along k is 3..2, expected a range within 0..4")},
    {WRONG(spacing_of_zero, true, "lattice: the spacing along j is 0")},
    {WRONG(spacing_nan, true, "lattice: origin 0 and spacing nan along k are not finite")},
    {WRONG(spacing_huge, false, "cell 0 (hex): vertex 42 is at (")},
    {WRONG(spacing_beyond, false, "along k is not finite: inf")},
    {WRONG(origin_infinite, true, "lattice: origin inf and spacing 1 along i are not finite")},
    {WRONG(first_huge, true,
           "lattice: first along j is 9223372036854775807, expected at most 9007199254740992 in size")},
    {WRONG(first_least, true, "lattice: first along j is -9223372036854775808, expected at most 9007199254740992")},
    {WRONG(nothing_given, true, "lattice: neither spacing nor axes nor coordinates are given")},
    {WRONG(axis_missing, true, "coordinates along j are not given")},
    {WRONG(axis_nan, false, "lattice: coordinate 3 along k is not finite: nan")},
    {"axis_of_no_type", axis_of_no_type, true, "coordinates along i are of element type 77", INSITU_ERROR_ARGUMENT},
    {WRONG(axis_stride, true, "coordinates along i have a stride of 1152921504606846976 bytes")},
    {WRONG(spacing_and_axes, true, "lattice: spacing and axes are given: give coordinates by one of them")},
    {WRONG(coordinates_and_spacing, true, "lattice: spacing and coordinates of vertices are given")},
    {WRONG(coordinates_and_axes, true, "lattice: axes and coordinates of vertices are given")},
    {WRONG(coordinate_missing, true, "y coordinates are not given")},
    {WRONG(coordinate_nan, false, "mesh \"m\"")},
    {WRONG(connectivity_too, true, "a lattice and connectivity indices are given: give cells by one of them")},
    {WRONG(offsets_too, true, "a lattice and offsets are given")},
    {WRONG(types_too, true, "a lattice and cell types are given")},
    {WRONG(rows_too, true, "a lattice and rows of connectivity are given")},
    {WRONG(owner_too, true, "a lattice and owners of faces are given")},
    {WRONG(few_cells, true, "lattice: 4 cells along k with a stride of 30 do not fit into arrays of 119")},
    {WRONG(few_vertices, true, "do not fit into arrays of 209")},
    {WRONG(no_vertices, true, "do not fit into arrays of 0")},
    {"most_cells", most_cells, true, "cell_count is 4294967295, at most 4294967294", INSITU_ERROR_ARGUMENT},
    {"corner_field", corner_field, true, "has values at corners, and the mesh is a lattice", INSITU_ERROR_FIELD},
    {"field_short", field_short, true, "209", INSITU_ERROR_FIELD},
    {"cell_field_short", cell_field_short, true, "119", INSITU_ERROR_FIELD},
};

static void expect_report(insitu_session *session, const wrong_block *wrong, int cycle)
{
    const bool is_last = own_rank == rank_count - 1;
    block *b = make_block();
    char rank[32];
    snprintf(rank, sizeof rank, "rank %d", rank_count - 1);
    if (is_last) wrong->corrupt(b);
    const insitu_status at_once = set_block(session, b);
    if (is_last && (at_once != 0) != wrong->at_once) fprintf(stderr, "%s: %s\n", wrong->name, insitu_error(session));
    everywhere((at_once != 0) == (is_last && wrong->at_once));
    for (int i = 0; i < 2; i++) {
        const insitu_status status = insitu_step(session, cycle + i, 0);
        if (status != wrong->status) fprintf(stderr, "%s: %s\n", wrong->name, insitu_error(session));
        check_reported_everywhere(session, status, wrong->status, rank, wrong->words);
    }
    free(b);
}

static void wrong_blocks_are_reported_on_all_ranks(void **state)
{
    (void)state;
    block *right = make_block();
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(blocks_scene));
    discard_pictures();
    everywhere(set_block(session, right) == INSITU_OK);
    everywhere(insitu_step(session, 0, 0) == INSITU_OK);
    caught_picture truth = pop_caught_picture();
    for (size_t i = 0; i < sizeof wrong_blocks / sizeof wrong_blocks[0]; i++) {
        expect_report(session, &wrong_blocks[i], (int)(3 * i + 1));
        discard_pictures();
        everywhere(set_block(session, right) == INSITU_OK);
        everywhere(insitu_step(session, (int64_t)(3 * i + 3), 0) == INSITU_OK);
        caught_picture healed = pop_caught_picture();
        everywhere(own_rank || is_same(&healed, &truth));
        free_caught(&healed);
    }
    free_caught(&truth);
    insitu_destroy(&session);
    free(right);
}

/* ---- blocks that change ----------------------------------------------------------------------------------------- */

static void set_row_major_strides(block *b)
{
    memcpy(b->lattice.vertex_strides, (int64_t[]){(NJ + 1) * (NK + 1), NK + 1, 1}, sizeof b->lattice.vertex_strides);
    memcpy(b->lattice.cell_strides, (int64_t[]){NJ * NK, NK, 1}, sizeof b->lattice.cell_strides);
}

static void set_default_strides(block *b)
{
    memset(b->lattice.vertex_strides, 0, sizeof b->lattice.vertex_strides);
    memset(b->lattice.cell_strides, 0, sizeof b->lattice.cell_strides);
}

static void set_interior(block *b)
{
    memcpy(b->lattice.interior_first, (int64_t[]){0, 1, 1}, sizeof b->lattice.interior_first);
    memcpy(b->lattice.interior_end, (int64_t[]){NI, NJ, NK - 1}, sizeof b->lattice.interior_end);
}

static void drop_interior(block *b)
{
    memset(b->lattice.interior_first, 0, sizeof b->lattice.interior_first);
    memset(b->lattice.interior_end, 0, sizeof b->lattice.interior_end);
}

static void blank_every_nth(block *b, int of)
{
    for (int c = 0; c < CELLS; c++) b->ghosts[c] = c % of == 0;
    b->mesh.ghosts = (insitu_array){b->ghosts, INSITU_UINT8, 0};
}

SPOIL(as_it_was, (void)b)
SPOIL(move_origin, b->lattice.origin[1] = 0.7)
SPOIL(move_first, b->lattice.first[1] -= 1)
SPOIL(wider_spacing, b->lattice.spacing[2] = 1.25)
SPOIL(mirror, (b->lattice.spacing[1] = -1, b->lattice.first[1] = -NJ))
SPOIL(mirror_back, (b->lattice.spacing[1] = 1, b->lattice.first[1] = 0))
SPOIL(move_axis, b->axes[2][NK] += 0.5)
SPOIL(move_vertices, for (int v = 0; v < VERTICES; v++) b->places[2][v] *= 1.25)
SPOIL(blank_some, blank_every_nth(b, 7))
SPOIL(blank_others, blank_every_nth(b, 5))
SPOIL(blank_none, b->mesh.ghosts = (insitu_array){0})
SPOIL(make_lattice_again, {
    b->mesh.lattice = &b->lattice;
    b->mesh.connectivity_count = 0;
    b->mesh.connectivity = (insitu_array){0};
})
SPOIL(make_quads, (make_uniform(b), b->lattice.cells[2] = 0))
SPOIL(make_cells, b->lattice.cells[2] = NK)

/* Makes the block smaller than its arrays. The padding at the end of the arrays belongs to no vertex. */
SPOIL(fewer_layers, (make_curvilinear(b), b->lattice.cells[2] = NK - 1))
SPOIL(shorter_rows, b->lattice.cells[0] = 2)

/* A change of a block, and what the caller declares as changed. Fields are set again if sets_fields is set, or if the
 * mesh is passed to the second session, where it is new. */
typedef struct change {
    const char *name;
    void (*make)(block *b);
    unsigned changed;
    bool sets_fields;
} change;

#define CHANGE(make, changed, sets_fields) #make, make, changed, sets_fields

static const change changes[] = {
    {CHANGE(as_it_was, INSITU_CHANGED_NOTHING, false)},
    {CHANGE(as_it_was, INSITU_CHANGED_NOTHING, true)},
    {CHANGE(move_origin, INSITU_CHANGED_NOTHING, false)},
    {CHANGE(move_first, INSITU_CHANGED_NOTHING, false)},
    {CHANGE(wider_spacing, INSITU_CHANGED_GEOMETRY, false)},
    {CHANGE(set_interior, INSITU_CHANGED_NOTHING, false)},
    {CHANGE(blank_some, INSITU_CHANGED_NOTHING, true)},
    {CHANGE(blank_others, INSITU_CHANGED_TOPOLOGY, true)},
    {CHANGE(drop_interior, INSITU_CHANGED_NOTHING, false)},
    {CHANGE(blank_none, INSITU_CHANGED_NOTHING, true)},
    {CHANGE(mirror, INSITU_CHANGED_NOTHING, false)},
    {CHANGE(mirror_back, INSITU_CHANGED_NOTHING, false)},
    {CHANGE(make_rectilinear, INSITU_CHANGED_NOTHING, false)},
    {CHANGE(move_axis, INSITU_CHANGED_GEOMETRY, false)},
    {CHANGE(set_row_major_strides, INSITU_CHANGED_NOTHING, true)},
    {CHANGE(set_default_strides, INSITU_CHANGED_NOTHING, true)},
    {CHANGE(make_curvilinear, INSITU_CHANGED_NOTHING, false)},
    {CHANGE(move_vertices, INSITU_CHANGED_GEOMETRY, false)},
    {CHANGE(make_hexes, INSITU_CHANGED_NOTHING, true)},
    {CHANGE(make_lattice_again, INSITU_CHANGED_NOTHING, true)},
    {CHANGE(make_quads, INSITU_CHANGED_NOTHING, true)},
    {CHANGE(make_cells, INSITU_CHANGED_NOTHING, true)},
    {CHANGE(fewer_layers, INSITU_CHANGED_NOTHING, true)},
    {CHANGE(shorter_rows, INSITU_CHANGED_NOTHING, true)},
};

static bool step_and_take_picture(insitu_session *session, int cycle, caught_picture *out)
{
    discard_pictures();
    const insitu_status status = insitu_step(session, cycle, 0);
    if (status) fprintf(stderr, "%s\n", insitu_error(session));
    everywhere(status == INSITU_OK);
    *out = pop_caught_picture();
    return true;
}

static void changed_blocks_draw_same_picture_as_new_blocks(void **state)
{
    (void)state;
    block *b = make_block();
    const char *scene = write_scene(blocks_scene);
    insitu_session *session = open_session(MPI_COMM_WORLD, scene), *twin = open_session(MPI_COMM_WORLD, scene);
    caught_picture before = {0};
    for (size_t i = 0; i < sizeof changes / sizeof changes[0]; i++) {
        const change *c = &changes[i];
        const bool shows_nothing =
            i && (c->make == make_hexes || c->make == make_lattice_again || c->make == as_it_was);
        caught_picture found, truth;
        c->make(b);
        b->mesh.changed = i ? c->changed : INSITU_CHANGED_ALL;
        const bool is_set = c->sets_fields || i == 0;
        everywhere((is_set ? set_block(session, b) : insitu_set_mesh(session, "m", &b->mesh)) == INSITU_OK);
        step_and_take_picture(session, (int)i, &found);
        everywhere(b->mesh.lattice != NULL || strstr(insitu_last_report(session)->copied_why, "lattice") == NULL);
        b->mesh.changed = INSITU_CHANGED_ALL;
        everywhere(insitu_set_mesh(twin, "m", NULL) == INSITU_OK && set_block(twin, b) == INSITU_OK);
        step_and_take_picture(twin, (int)i, &truth);
        if (!own_rank && !is_same(&found, &truth)) fprintf(stderr, "%s: another picture\n", c->name);
        everywhere(own_rank || is_same(&found, &truth));
        if (!own_rank && is_same(&found, &before) != shows_nothing) fprintf(stderr, "%s: changes\n", c->name);
        everywhere(own_rank || is_same(&found, &before) == shows_nothing);
        free_caught(&before);
        free_caught(&truth);
        before = found;
    }
    free_caught(&before);
    insitu_destroy(&session);
    insitu_destroy(&twin);
    free(b);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(wrong_blocks_are_reported_on_all_ranks),
                                       cmocka_unit_test(changed_blocks_draw_same_picture_as_new_blocks)};
    return run_session_tests(argc, argv, tests, NULL, NULL);
}
