/* Checks levels of refinement that are given as blocks of one mesh. The cells that finer blocks cover, and the values
 * at hanging vertices, are compared with brute force on integers. A sphere must have no gaps and must be bit-identical
 * on any number of ranks, including ranks that have no block of some level. Blocks may appear and disappear. */
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "session.h"
#include "session_scalars.h"
#include "test_effort.h"
#include "test_session_fixture.h"

enum { SIZE = 200, PIXELS = SIZE * SIZE, SIDE = 8, LEVELS = 3, MOST_BLOCKS = 64, GRIDS = 3 };

/* An orthographic view along z from z = 5; a pixel is 1/100 wide. */
static const char scene_text[] =
    "images:\n  - name: a\n    size: [200, 200]\n    background: [0, 0, 0, 0]\n    camera: {position: [0, 0, 5], "
    "focal: [0, 0, 0], up: [0, 1, 0], projection: orthographic, height: 2}\n    layers:\n"
    "      - isosurface: {field: f, values: [0.72]}\n    outputs: [{path: a.exr}]\n";

/* ---- the levels -------------------------------------------------------------------------------------------------- */

/* A block of cells of one level; its bounds are counted in cells of the coarsest level. */
typedef struct box {
    int level, lower[3], upper[3];
} box;

/* The blocks of a mesh and how they are distributed over ranks. */
typedef struct levels {
    int refinement[LEVELS]; /* number of cells of each level per cell of the coarsest level, along each axis */
    int grid;               /* index of the set of boxes */
    bool is_of_cells;
    bool is_by_level; /* each rank has blocks of one level only */
    bool has_layers;  /* some blocks have ghost layers */
    bool is_mixed;    /* every other block has coordinates for each vertex */
    double off;       /* relative error that is added to these coordinates */
    int rank, ranks;
    int count;
    box boxes[MOST_BLOCKS];
} levels;

static void add_box(levels *l, int level, const int lower[3], const int upper[3])
{
    box *b = &l->boxes[l->count++];
    assert_true(l->count <= MOST_BLOCKS);
    b->level = level;
    memcpy(b->lower, lower, sizeof b->lower);
    memcpy(b->upper, upper, sizeof b->upper);
}

/* Adds a box as two blocks, which are halves along the axis. */
static void add_halves(levels *l, int level, const int lower[3], const int upper[3], int axis)
{
    int middle[3], low[3];
    memcpy(middle, upper, sizeof middle);
    memcpy(low, lower, sizeof low);
    middle[axis] = low[axis] = (lower[axis] + upper[axis]) / 2;
    add_box(l, level, lower, middle);
    add_box(l, level, low, upper);
}

/* Makes boxes of levels 0, 1 and 2. Level 2 is adjacent to level 1, to level 0 and to the border of the domain. */
static void make_levels(levels *l)
{
    static const int fine[GRIDS][4][2][3] = {
        {{{4, 0, 0}, {8, 8, 4}}, {{0, 4, 2}, {4, 8, 6}}, {{5, 2, 1}, {8, 6, 4}}, {{1, 5, 3}, {4, 8, 5}}},
        {{{0, 0, 2}, {5, 6, 8}}, {{5, 3, 4}, {8, 6, 8}}, {{1, 1, 3}, {4, 5, 8}}, {{6, 3, 5}, {7, 5, 8}}},
        {{{2, 2, 2}, {6, 6, 8}}, {{0, 0, 0}, {2, 2, 8}}, {{2, 3, 5}, {5, 5, 8}}, {{0, 0, 4}, {2, 1, 6}}}};
    l->count = 0;
    for (int i = 0; i < 8; i++) {
        const int lower[3] = {i % 2 * 4, i / 2 % 2 * 4, i / 4 * 4};
        add_box(l, 0, lower, (const int[]){lower[0] + 4, lower[1] + 4, lower[2] + 4});
    }
    for (int i = 0; i < 4; i++) add_halves(l, 1 + i / 2, fine[l->grid][i][0], fine[l->grid][i][1], (i + l->grid) % 3);
}

static int get_block_owner(const levels *l, int block)
{
    if (l->is_by_level) return l->boxes[block].level % l->ranks;
    return (int)(test_uniform((uint64_t)(block + 100 * l->grid), 8) * l->ranks);
}

/* ---- brute force, in integer coordinates counted in cells of the finest level ----------------------------------- */

static int get_finest_level(const levels *l)
{
    return l->refinement[LEVELS - 1];
}

/* Returns the distance of a point from the middle of the domain [-1, 1]^3. The point's coordinates are passed doubled,
 * so that those of cell centres are integers too. */
static double compute_distance(const levels *l, const int twice[3])
{
    double square = 0;
    for (int axis = 0; axis < 3; axis++) {
        const double x = twice[axis] / (double)(SIDE * get_finest_level(l)) - 1;
        square += x * x;
    }
    return sqrt(square);
}

/* Returns the finest level of a box that contains the point with these doubled coordinates; -1 if no box does. */
static int find_level(const levels *l, const int twice[3])
{
    int level = -1;
    for (int i = 0; i < l->count; i++) {
        const box *b = &l->boxes[i];
        bool is_in = b->level > level;
        for (int axis = 0; axis < 3; axis++)
            is_in = is_in && 2 * b->lower[axis] * get_finest_level(l) < twice[axis] &&
                    twice[axis] < 2 * b->upper[axis] * get_finest_level(l);
        if (is_in) level = b->level;
    }
    return level;
}

/* Finds the cell of a level that touches the vertex in the direction given by three bits, one for each axis. lower
 * receives the cell's lowest corner. Returns false if no cell of that level is drawn there. */
static bool find_adjacent_cell(const levels *l, int level, const int vertex[3], int bits, int lower[3])
{
    const int width = get_finest_level(l) / l->refinement[level];
    int middle[3];
    for (int axis = 0; axis < 3; axis++) {
        const int up = bits >> axis & 1, rest = vertex[axis] % width;
        lower[axis] = rest ? vertex[axis] - rest : vertex[axis] - (up ? 0 : width);
        middle[axis] = 2 * lower[axis] + width;
    }
    return find_level(l, middle) == level;
}

static bool is_corner(const int vertex[3], const int lower[3], int width)
{
    for (int axis = 0; axis < 3; axis++)
        if (vertex[axis] != lower[axis] && vertex[axis] != lower[axis] + width) return false;
    return true;
}

static double compute_cell_mean(const levels *l, const int vertex[3])
{
    double sum = 0;
    int count = 0;
    for (int bits = 0; bits < 8; bits++)
        for (int level = 0; level < LEVELS; level++) {
            const int width = get_finest_level(l) / l->refinement[level];
            int lower[3];
            if (!find_adjacent_cell(l, level, vertex, bits, lower) || !is_corner(vertex, lower, width)) continue;
            sum += compute_distance(l, (const int[]){2 * lower[0] + width, 2 * lower[1] + width, 2 * lower[2] + width});
            count++;
        }
    return sum / count;
}

/* Finds the largest drawn cell on whose border the vertex lies without being one of the corners; returns false if there
 * is none. */
static bool find_hanging_cell(const levels *l, const int vertex[3], int *width, int lower[3])
{
    for (int level = 0; level < LEVELS; level++)
        for (int bits = 0; bits < 8; bits++) {
            *width = get_finest_level(l) / l->refinement[level];
            if (find_adjacent_cell(l, level, vertex, bits, lower) && !is_corner(vertex, lower, *width)) return true;
        }
    return false;
}

/* Returns the expected value at a vertex. If the vertex hangs on a cell, it is interpolated in that cell; otherwise it
 * is the mean of cells or the field itself. */
static double compute_expected_value(const levels *l, const int vertex[3])
{
    const int twice[3] = {2 * vertex[0], 2 * vertex[1], 2 * vertex[2]};
    int width, lower[3];
    double value = 0;
    if (!find_hanging_cell(l, vertex, &width, lower))
        return l->is_of_cells ? compute_cell_mean(l, vertex) : compute_distance(l, twice);
    for (int corner = 0; corner < 8; corner++) {
        double weight = 1;
        int at[3];
        for (int axis = 0; axis < 3; axis++) {
            const double share = (vertex[axis] - lower[axis]) / (double)width;
            weight *= corner >> axis & 1 ? share : 1 - share;
            at[axis] = lower[axis] + (corner >> axis & 1) * width;
        }
        if (weight > 0) value += weight * compute_expected_value(l, at);
    }
    return value;
}

/* Returns the allowed error of the library's value at a vertex. An interpolated value is a sum of at most 64 products
 * of weights and values below 2, over up to three levels, with less than 200 roundings of numbers below 2. A vertex
 * that does not hang has the same value in all blocks, so that their mean is exact. */
static double compute_allowed_error(const levels *l, const int vertex[3])
{
    int width, lower[3];
    return l->is_of_cells || find_hanging_cell(l, vertex, &width, lower) ? 1e-13 : 0;
}

/* ---- blocks ------------------------------------------------------------------------------------------------------ */

typedef struct block {
    insitu_lattice lattice;
    int64_t vertex_count, cell_count;
    double *values, (*places)[3]; /* places is NULL if the block is uniform */
    int16_t *flags;               /* ghost flags of cells; NULL if there are none */
} block;

typedef enum layer_kind { NO_LAYER, OUTSIDE_INTERIOR, FLAGGED } layer_kind;

/* Returns how a block marks its ghost layer, which is one cell wide: by the interior range, or by flags. Finer blocks
 * cover all cells under them, including those under their own flagged cells, so only blocks of the coarsest level have
 * flagged layers. */
static layer_kind get_ghost_layer(const levels *l, int number)
{
    const layer_kind kind = (layer_kind)(number % 3);
    return !l->has_layers || (kind == FLAGGED && l->boxes[number].level) ? NO_LAYER : kind;
}

/* Returns whether the cell with these indices (a vertex if is_vertex is set) is in the block without its ghost
 * layer. */
static bool is_inner(const block *b, int layer, const int at[3], bool is_vertex)
{
    for (int axis = 0; axis < 3; axis++)
        if (at[axis] < layer || at[axis] >= (int)b->lattice.cells[axis] - layer + is_vertex) return false;
    return true;
}

static void make_flags(block *b)
{
    b->flags = calloc((size_t)b->cell_count, sizeof *b->flags);
    assert_non_null(b->flags);
    const int wide[2] = {(int)b->lattice.cells[0], (int)b->lattice.cells[1]};
    for (int i = 0; i < (int)b->cell_count; i++)
        b->flags[i] =
            is_inner(b, 1, (const int[]){i % wide[0], i / wide[0] % wide[1], i / wide[0] / wide[1]}, false) ? 0 : 256;
}

/* Replaces the uniform lattice of a block by coordinates of its vertices, which are increased by the fraction `off`. */
static void make_coordinates(block *b, double off)
{
    const insitu_lattice *l = &b->lattice;
    const int64_t wide[2] = {l->cells[0] + 1, l->cells[1] + 1};
    b->places = malloc((size_t)b->vertex_count * sizeof *b->places);
    assert_non_null(b->places);
    for (int64_t v = 0; v < b->vertex_count; v++) {
        const int64_t at[3] = {v % wide[0], v / wide[0] % wide[1], v / wide[0] / wide[1]};
        for (int axis = 0; axis < 3; axis++)
            b->places[v][axis] = (l->origin[axis] + l->spacing[axis] * (double)(l->first[axis] + at[axis])) * (1 + off);
    }
    for (int axis = 0; axis < 3; axis++) b->lattice.origin[axis] = b->lattice.spacing[axis] = 0;
}

/* Makes a block. Values in ghost layers are wrong, so that the result differs if they are used. */
static void make_block(const levels *l, int number, block *out)
{
    const box *b = &l->boxes[number];
    const layer_kind kind = get_ghost_layer(l, number);
    const int of = l->refinement[b->level], step = get_finest_level(l) / of, layer = kind != NO_LAYER;
    *out = (block){.vertex_count = 1, .cell_count = 1};
    for (int axis = 0; axis < 3; axis++) {
        out->lattice.cells[axis] = (b->upper[axis] - b->lower[axis]) * of + 2 * layer;
        out->lattice.first[axis] = (int64_t)b->lower[axis] * of - layer;
        if (kind == OUTSIDE_INTERIOR) {
            out->lattice.interior_first[axis] = 1;
            out->lattice.interior_end[axis] = out->lattice.cells[axis] - 1;
        }
        out->lattice.refinement[axis] = of;
        out->lattice.origin[axis] = -1;
        out->lattice.spacing[axis] = 2.0 / (SIDE * of);
        out->cell_count *= out->lattice.cells[axis];
        out->vertex_count *= out->lattice.cells[axis] + 1;
    }
    const int more = l->is_of_cells ? 0 : 1;
    const int64_t count = l->is_of_cells ? out->cell_count : out->vertex_count;
    const int wide[2] = {(int)out->lattice.cells[0] + more, (int)out->lattice.cells[1] + more};
    out->values = malloc((size_t)count * sizeof *out->values);
    assert_non_null(out->values);
    for (int i = 0; i < (int)count; i++) {
        const int at[3] = {i % wide[0], i / wide[0] % wide[1], i / wide[0] / wide[1]};
        int twice[3];
        for (int axis = 0; axis < 3; axis++)
            twice[axis] = 2 * ((int)out->lattice.first[axis] + at[axis]) * step + (l->is_of_cells ? step : 0);
        out->values[i] = is_inner(out, layer, at, more) ? compute_distance(l, twice) : -40;
    }
    if (kind == FLAGGED) make_flags(out);
    if (l->is_mixed && number % 2) make_coordinates(out, l->off);
}

/* Sets a block and its field "f". values: one for each of the block's cells, or for each of its vertices. */
static bool set_block_and_field(insitu_session *session, int number, const insitu_mesh *mesh, bool is_of_cells,
                                const double *values)
{
    insitu_field field;
    insitu_field_defaults(&field);
    field.name = "f";
    field.centring = is_of_cells ? INSITU_CELL : INSITU_VERTEX;
    field.count = is_of_cells ? mesh->cell_count : mesh->vertex_count;
    field.values = (insitu_array){values, INSITU_FLOAT64, 0};
    return insitu_set_block(session, "m", number, mesh) == INSITU_OK &&
           insitu_set_block_field(session, "m", number, &field) == INSITU_OK;
}

static bool set_block(insitu_session *session, int number, const levels *l, const block *b, bool is_new)
{
    insitu_mesh mesh;
    insitu_mesh_defaults(&mesh);
    mesh.vertex_count = b->vertex_count;
    mesh.cell_count = b->cell_count;
    mesh.lattice = &b->lattice;
    if (b->places) insitu_mesh_interleaved(&mesh, b->places, INSITU_FLOAT64);
    if (b->flags) mesh.ghosts = (insitu_array){b->flags, INSITU_INT16, 0};
    if (!is_new) mesh.changed = INSITU_CHANGED_NOTHING;
    return set_block_and_field(session, number, &mesh, l->is_of_cells, b->values);
}

/* Makes the arrays of this rank's blocks; those of other ranks stay empty. */
static void make_blocks(const levels *l, block blocks[MOST_BLOCKS])
{
    for (int i = 0; i < l->count; i++) {
        blocks[i] = (block){.values = NULL};
        if (get_block_owner(l, i) == l->rank) make_block(l, i, &blocks[i]);
    }
}

static void free_blocks(const levels *l, block blocks[MOST_BLOCKS])
{
    for (int i = 0; i < l->count; i++) {
        free(blocks[i].values);
        free(blocks[i].places);
        free(blocks[i].flags);
    }
}

static bool submit_levels(insitu_session *session, const levels *l, const block blocks[MOST_BLOCKS])
{
    bool is_set = true;
    for (int i = 0; i < l->count && is_set; i++)
        if (blocks[i].values) is_set = set_block(session, i, l, &blocks[i], true);
    return is_set;
}

/* ---- results ----------------------------------------------------------------------------------------------------- */

/* Compares the values that are drawn at vertices with brute force. */
static bool check_vertex_values(const insitu_session *session, const levels *l)
{
    const session_parts parts = session_find_parts(&session->meshes, "m");
    for (int i = 0; i < parts.count; i++) {
        const session_mesh *part = parts.items[i];
        const box *b = &l->boxes[part->block];
        const int step = get_finest_level(l) / l->refinement[b->level];
        const int wide[2] = {(int)part->given.lattice->cells[0] + 1, (int)part->given.lattice->cells[1] + 1};
        const double *values = part->scalar_count == 1 ? part->scalars[0].vertex_values : NULL;
        if (!values && part->drawn_count) return false;
        for (int64_t cell = 0; cell < part->cells.cell_count; cell++) {
            int64_t vertices[GRID_MAX_CELL_VERTICES];
            if (grid_is_ghost(&part->cells, cell)) continue;
            grid_cell_vertices(&part->cells, cell, vertices);
            for (int k = 0; k < 8; k++) {
                const int v = (int)vertices[k];
                const int index[3] = {v % wide[0], v / wide[0] % wide[1], v / wide[0] / wide[1]};
                int vertex[3];
                for (int axis = 0; axis < 3; axis++)
                    vertex[axis] = ((int)part->given.lattice->first[axis] + index[axis]) * step;
                const double expected = compute_expected_value(l, vertex);
                if (fabs(values[v] - expected) <= compute_allowed_error(l, vertex)) continue;
                fprintf(stderr, "block %d, level %d, vertex %d %d %d of the finest: %.17g, expected %.17g\n",
                        (int)part->block, b->level, vertex[0], vertex[1], vertex[2], values[v], expected);
                return false;
            }
        }
    }
    return true;
}

static int64_t count_covered_pixels(const levels *l, const box *b)
{
    const int of = l->refinement[b->level], step = get_finest_level(l) / of;
    const int wide[3] = {(b->upper[0] - b->lower[0]) * of, (b->upper[1] - b->lower[1]) * of,
                         (b->upper[2] - b->lower[2]) * of};
    int64_t count = 0;
    for (int cell = 0; cell < wide[0] * wide[1] * wide[2]; cell++) {
        const int at[3] = {cell % wide[0], cell / wide[0] % wide[1], cell / wide[0] / wide[1]};
        int twice[3];
        for (int axis = 0; axis < 3; axis++)
            twice[axis] = 2 * (b->lower[axis] * get_finest_level(l) + at[axis] * step) + step;
        count += find_level(l, twice) > b->level;
    }
    return count;
}

/* Counts the cells that are not drawn because they are covered by finer cells or are in ghost layers. */
static int64_t count_ghosts(const levels *l)
{
    int64_t count = 0;
    for (int i = 0; i < l->count; i++) {
        int64_t inner = 1, all = 1;
        for (int axis = 0; axis < 3; axis++) {
            const int wide = (l->boxes[i].upper[axis] - l->boxes[i].lower[axis]) * l->refinement[l->boxes[i].level];
            inner *= wide;
            all *= wide + 2;
        }
        count += count_covered_pixels(l, &l->boxes[i]);
        if (get_ghost_layer(l, i) != NO_LAYER) count += all - inner;
    }
    return count;
}

static caught_picture step_and_take_picture(insitu_session *session, int cycle)
{
    discard_pictures();
    const insitu_status status = insitu_step(session, cycle, cycle);
    if (status) fprintf(stderr, "%s\n", insitu_error(session));
    assert_int_equal(status, INSITU_OK);
    return pop_caught_picture();
}

/* Draws the levels in a new session; *is_true is cleared if values or counts are wrong. */
static caught_picture draw_levels(MPI_Comm comm, const char *scene, const levels *l, bool *is_true)
{
    block blocks[MOST_BLOCKS];
    insitu_session *session = open_session(comm, scene);
    make_blocks(l, blocks);
    assert_true(submit_levels(session, l, blocks));
    const caught_picture picture = step_and_take_picture(session, 0);
    int64_t ghosts = insitu_last_report(session)->cells_ghost;
    MPI_Allreduce(MPI_IN_PLACE, &ghosts, 1, MPI_INT64_T, MPI_SUM, comm);
    *is_true = check_vertex_values(session, l) && ghosts == count_ghosts(l);
    insitu_destroy(&session);
    free_blocks(l, blocks);
    return picture;
}

static void check_levels(levels l)
{
    const char *scene = write_scene(scene_text);
    bool is_true = true, is_alone_true = true, is_well = true;
    levels whole = l;
    caught_picture alone = {0};
    make_levels(&l);
    whole.rank = 0;
    whole.ranks = 1;
    make_levels(&whole);
    l.rank = own_rank;
    l.ranks = rank_count;
    if (own_rank == 0) alone = draw_levels(MPI_COMM_SELF, scene, &whole, &is_alone_true);
    caught_picture ours = draw_levels(MPI_COMM_WORLD, scene, &l, &is_true);
    if (own_rank == 0) {
        is_well = count_gap_pixels(&alone) == 0 && are_same_pictures(&ours, &alone);
        if (!is_well)
            fprintf(stderr, "levels of %d, %d, grid %d%s: %d pixels torn; %s\n", l.refinement[1], l.refinement[2],
                    l.grid, l.is_of_cells ? ", values of cells" : "", count_gap_pixels(&alone),
                    are_same_pictures(&ours, &alone) ? "the same" : "another picture on ranks");
    }
    free_caught(&ours);
    free_caught(&alone);
    everywhere(is_well && is_true && is_alone_true);
}

/* ---- tests ------------------------------------------------------------------------------------------------------ */

/* Checks a sphere for four sets of refinement ratios. By default each set is drawn on one rank or on several, with
 * values at cells or at vertices, alternating. For the set with a ratio of 3, coordinates of every other block differ
 * in their last bits from those of the same vertices in other blocks. */
static void a_sphere_continues_across_levels(void **state)
{
    static const int refinements[][LEVELS] = {{1, 2, 4}, {1, 4, 8}, {1, 2, 8}, {1, 3, 6}};
    (void)state;
    for (int i = 0; i < 4; i++)
        for (int of_cells = 0; of_cells < 2; of_cells++) {
            if (!test_is_long_run() && (of_cells != i % 2 || i / 2 != (rank_count > 1))) continue;
            levels l = {.grid = i % GRIDS,
                        .is_of_cells = of_cells,
                        .is_by_level = i == 1,
                        .has_layers = i != 2,
                        .is_mixed = i > 1,
                        .off = i == 3 ? DBL_EPSILON : 0};
            memcpy(l.refinement, refinements[i], sizeof l.refinement);
            check_levels(l);
        }
}

static const char walls_text[] =
    "images:\n  - name: a\n    size: [200, 200]\n    background: [0, 0, 0, 0]\n    camera: {position: [3, 2, 5], "
    "focal: [0, 0, 0], up: [0, 1, 0], projection: orthographic, height: 4}\n    layers:\n"
    "      - surface: {colour: [1, 0.5, 0.25], opacity: 0.3}\n    outputs: [{path: a.exr}]\n";

/* Checks that a transparent outer surface of levels equals that of a single block. A wall between levels would be
 * visible through it. The planes of both agree up to rounding, which affects no colour. */
static void outer_surfaces_have_no_faces_between_levels(void **state)
{
    static const int domain[2][3] = {{0, 0, 0}, {SIDE, SIDE, SIDE}};
    const char *scene = write_scene(walls_text);
    (void)state;
    for (int grid = 0; grid < GRIDS; grid++) {
        levels l = {.refinement = {1, 2, 4}, .grid = grid, .is_of_cells = true, .rank = own_rank, .ranks = rank_count};
        levels plain = {.refinement = {1, 1, 1}, .ranks = 1};
        block blocks[MOST_BLOCKS];
        make_levels(&l);
        add_box(&plain, 0, domain[0], domain[1]);
        plain.rank = own_rank;
        insitu_session *session = open_session(MPI_COMM_WORLD, scene);
        make_blocks(&l, blocks);
        everywhere(submit_levels(session, &l, blocks));
        caught_picture ours = step_and_take_picture(session, 0);
        insitu_destroy(&session);
        free_blocks(&l, blocks);
        session = open_session(MPI_COMM_WORLD, scene);
        make_blocks(&plain, blocks);
        everywhere(submit_levels(session, &plain, blocks));
        caught_picture expected = step_and_take_picture(session, 0);
        insitu_destroy(&session);
        free_blocks(&plain, blocks);
        everywhere(own_rank || largest_colour_difference(&ours, &expected) < 1e-5);
        free_caught(&ours);
        free_caught(&expected);
    }
}

/* Checks blocks that change: at every step some blocks of another set of levels replace blocks of the previous step, on
 * other ranks. */
static void levels_are_added_and_removed(void **state)
{
    const char *scene = write_scene(scene_text);
    levels last = {.refinement = {1, 2, 4}, .rank = own_rank, .ranks = rank_count};
    block held[MOST_BLOCKS] = {{.values = NULL}};
    (void)state;
    insitu_session *session = open_session(MPI_COMM_WORLD, scene);
    for (int cycle = 0; cycle < 4; cycle++) {
        levels l = last, whole;
        block blocks[MOST_BLOCKS];
        bool is_true = true, is_set = true;
        caught_picture alone = {0};
        l.grid = cycle % GRIDS;
        make_levels(&l);
        make_blocks(&l, blocks);
        for (int i = 0; i < MOST_BLOCKS && cycle; i++)
            if (i < last.count && held[i].values && !(i < l.count && blocks[i].values))
                is_set = is_set && !insitu_set_block(session, "m", i, NULL);
        is_set = is_set && submit_levels(session, &l, blocks);
        everywhere(is_set);
        free_blocks(&last, held);
        memcpy(held, blocks, sizeof held);
        last = l;
        caught_picture ours = step_and_take_picture(session, cycle);
        everywhere(check_vertex_values(session, &l));
        whole = l;
        whole.rank = 0;
        whole.ranks = 1;
        if (own_rank == 0) alone = draw_levels(MPI_COMM_SELF, scene, &whole, &is_true);
        everywhere(is_true && (own_rank || are_same_pictures(&ours, &alone)));
        free_caught(&ours);
        free_caught(&alone);
    }
    insitu_destroy(&session);
    free_blocks(&last, held);
}

/* Checks the removal of a block of the finest level. Blocks of which the same cells are covered as before are not
 * rebuilt, and keep their trees. */
static void blocks_adjacent_to_a_change_are_kept(void **state)
{
    levels l = {.refinement = {1, 2, 4}, .rank = own_rank, .ranks = rank_count}, rest;
    block blocks[MOST_BLOCKS];
    int64_t stamps[MOST_BLOCKS] = {0};
    int kept = 0, renewed = 0;
    (void)state;
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(scene_text));
    make_levels(&l);
    make_blocks(&l, blocks);
    const int gone = l.count - 1;
    rest = l;
    rest.count = gone;
    everywhere(submit_levels(session, &l, blocks));
    caught_picture picture = step_and_take_picture(session, 0);
    free_caught(&picture);
    for (int i = 0; i < gone; i++)
        if (blocks[i].values) stamps[i] = session_find_block(&session->meshes, "m", i)->cells_stamp;
    everywhere(!blocks[gone].values || !insitu_set_block(session, "m", gone, NULL));
    picture = step_and_take_picture(session, 1);
    free_caught(&picture);
    bool is_well = true;
    for (int i = 0; i < gone; i++) {
        if (!blocks[i].values) continue;
        const session_mesh *part = session_find_block(&session->meshes, "m", i);
        const bool is_uncovered = count_covered_pixels(&rest, &l.boxes[i]) < count_covered_pixels(&l, &l.boxes[i]);
        is_well = is_well && (part->cells_stamp != stamps[i]) == is_uncovered;
        renewed += is_uncovered;
        kept += !is_uncovered;
    }
    everywhere(is_well && (rank_count > 1 || (renewed && kept)));
    insitu_destroy(&session);
    free_blocks(&l, blocks);
}

/* Checks that a block of level 1 that ends inside a cell of level 0 is reported. */
static void blocks_that_do_not_fit_are_reported(void **state)
{
    levels l = {.refinement = {1, 2, 4}, .rank = own_rank, .ranks = rank_count};
    block blocks[MOST_BLOCKS];
    (void)state;
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(scene_text));
    make_levels(&l);
    make_blocks(&l, blocks);
    for (int i = 0; i < l.count; i++)
        if (blocks[i].values && l.boxes[i].level == 2) blocks[i].lattice.first[1]++;
    everywhere(submit_levels(session, &l, blocks));
    check_reported_everywhere(session, insitu_step(session, 0, 0), INSITU_ERROR_MESH, "mesh \"m[",
                              "refinement along j is 4", "begin and end at borders of coarser cells");
    for (int i = 0; i < l.count; i++)
        if (blocks[i].values && l.boxes[i].level == 2) blocks[i].lattice.first[1]--;
    everywhere(submit_levels(session, &l, blocks));
    caught_picture picture = step_and_take_picture(session, 1);
    everywhere(own_rank || count_gap_pixels(&picture) == 0);
    free_caught(&picture);
    blocks[0].lattice.refinement[2] = 0;
    if (blocks[0].values) {
        everywhere(!set_block(session, 0, &l, &blocks[0], true));
    } else {
        everywhere(true);
    }
    check_reported_everywhere(session, insitu_step(session, 2, 2), INSITU_ERROR_MESH,
                              "mesh \"m[0]\": lattice: refinement along k is 0, expected 1..1048576");
    insitu_destroy(&session);
    free_blocks(&l, blocks);
}

/* Makes a block of cubes whose width is 1 / `of` of that of a cell of the coarsest level, which has 4^3 cells in [-1,
 * 1]^3. The field is 0.72 on the plane z = 0.1. */
static block make_nested_block(int of, int first, int cells)
{
    block out = {.vertex_count = (int64_t)(cells + 1) * (cells + 1) * (cells + 1),
                 .cell_count = (int64_t)cells * cells * cells};
    out.values = malloc((size_t)out.vertex_count * sizeof *out.values);
    assert_non_null(out.values);
    for (int axis = 0; axis < 3; axis++) {
        out.lattice.cells[axis] = cells;
        out.lattice.first[axis] = first;
        out.lattice.refinement[axis] = of;
        out.lattice.origin[axis] = -1;
        out.lattice.spacing[axis] = 0.5 / of;
    }
    for (int64_t v = 0; v < out.vertex_count; v++)
        out.values[v] = 0.72 - 0.1 - 1 + 0.5 / of * (double)(first + v / (cells + 1) / (cells + 1));
    return out;
}

/* Counts the pixels that do not show the plane, which has a depth of 4.9. */
static int count_holes(const caught_picture *picture)
{
    int holes = 0;
    for (int pixel = 0; pixel < PIXELS && picture->rgba; pixel++)
        holes += !(picture->rgba[4 * pixel + 3] > 0 && fabs((double)picture->depth[pixel] - 4.9) < 1e-5);
    return holes;
}

/* Checks that the finest block may begin in the middle of a cell of the coarsest level if a level between them covers
 * that cell, and that it is an error if it does not. */
static void intermediate_levels_allow_finer_levels_within_a_cell(void **state)
{
    static const int of[3] = {1, 2, 4}, first[3] = {0, 2, 6}, cells[3] = {4, 4, 4};
    const levels l = {.rank = own_rank, .ranks = rank_count};
    (void)state;
    for (int has_middle = 0; has_middle < 2; has_middle++) {
        insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(scene_text));
        block blocks[3];
        bool is_set = true;
        for (int i = 0; i < 3; i++) {
            blocks[i] = make_nested_block(of[i], first[i], cells[i]);
            if (i % rank_count == own_rank && (i != 1 || has_middle))
                is_set = is_set && set_block(session, i, &l, &blocks[i], true);
        }
        everywhere(is_set);
        if (has_middle) {
            caught_picture picture = step_and_take_picture(session, 0);
            int64_t ghosts = insitu_last_report(session)->cells_ghost;
            MPI_Allreduce(MPI_IN_PLACE, &ghosts, 1, MPI_INT64_T, MPI_SUM, MPI_COMM_WORLD);
            everywhere(ghosts == 8 + 8 && (own_rank || count_holes(&picture) == 0));
            free_caught(&picture);
        } else {
            check_reported_everywhere(session, insitu_step(session, 0, 0), INSITU_ERROR_MESH, "mesh \"m[0]\"",
                                      "block 2 of", "covers part of a cell");
        }
        insitu_destroy(&session);
        for (int i = 0; i < 3; i++) free(blocks[i].values);
    }
}

/* ---- gradients across levels ------------------------------------------------------------------------------------ */

/* A coarse block of 4^3 cells on the first rank and, in its middle, a fine block on the last rank. */
typedef struct two_levels {
    int ratio;
    double spacing; /* size of the coarse cells */
    bool is_of_cells;
    double raise; /* number that is added to the values at hanging vertices */
} two_levels;

enum { MOST_VALUES = 7 * 7 * 7 };

/* Returns whether the fine block's vertex with these indices lies on the block's border, but is no coarse vertex. */
static bool is_hanging(const two_levels *l, const int at[3])
{
    bool is_on_border = false, is_coarse = true;
    for (int axis = 0; axis < 3; axis++) {
        is_on_border = is_on_border || at[axis] == 0 || at[axis] == 2 * l->ratio;
        is_coarse = is_coarse && at[axis] % l->ratio == 0;
    }
    return is_on_border && !is_coarse;
}

static double compute_two_level_value(const two_levels *l, bool is_fine, const int at[3])
{
    const int of = is_fine ? l->ratio : 1, first = is_fine ? l->ratio : 0;
    double place[3];
    for (int axis = 0; axis < 3; axis++) place[axis] = (first + at[axis] + (l->is_of_cells ? 0.5 : 0)) / of;
    const double wave = sin(0.75 * place[0] + 1) * cos(0.5 * place[1]) * cos(0.6 * place[2] + 0.3);
    return 0.5 + 0.5 * wave + (!l->is_of_cells && is_fine && is_hanging(l, at) ? l->raise : 0);
}

static void set_two_levels(insitu_session *session, const two_levels *l, double values[2][MOST_VALUES])
{
    for (int fine = 0; fine < 2; fine++) {
        const int of = fine ? l->ratio : 1, side = fine ? 2 * l->ratio : 4;
        const int wide = l->is_of_cells ? side : side + 1;
        if (own_rank != (fine ? rank_count - 1 : 0)) continue;
        insitu_lattice lattice = {.cells = {side, side, side}};
        for (int axis = 0; axis < 3; axis++) {
            lattice.spacing[axis] = l->spacing / of;
            lattice.first[axis] = fine ? l->ratio : 0;
            lattice.refinement[axis] = of;
        }
        for (int i = 0; i < wide * wide * wide; i++)
            values[fine][i] =
                compute_two_level_value(l, fine, (const int[]){i % wide, i / wide % wide, i / wide / wide});
        insitu_mesh mesh;
        insitu_mesh_defaults(&mesh);
        mesh.lattice = &lattice;
        mesh.cell_count = side * side * side;
        mesh.vertex_count = (side + 1) * (side + 1) * (side + 1);
        assert_true(set_block_and_field(session, fine, &mesh, l->is_of_cells, values[fine]));
    }
}

/* Returns the largest difference, over this rank's blocks, between the derived field "g" of one session and `scale`
 * times that of another. */
static double compare_gradients(const insitu_session *a, const insitu_session *b, double scale)
{
    const session_parts parts = session_find_parts(&a->meshes, "m");
    double worst = 0;
    for (int i = 0; i < parts.count; i++) {
        const session_mesh *of_a = parts.items[i], *of_b = session_find_block(&b->meshes, "m", of_a->block);
        const grid_field x = session_get_caller_values(of_a, session_find_field(of_a, "g"), 0);
        const grid_field y = session_get_caller_values(of_b, session_find_field(of_b, "g"), 0);
        for (int64_t v = 0; v < of_a->cells.vertex_count; v++) {
            const double value = grid_field_value(&x, v), other = scale * grid_field_value(&y, v);
            if (isnan(value) && isnan(other)) continue; /* a vertex of covered cells only */
            worst = test_larger_error(worst, fabs(value - other));
        }
    }
    return worst;
}

static const char gradient_scene[] =
    "fields: {g: {gradient: f, component: magnitude}}\nstatistics: [{field: g, path: g.csv}]\nimages:\n"
    "  - name: a\n    size: [60, 60]\n    camera: {automatic: {direction: [1, 0.8, 1.2]}}\n    layers:\n"
    "      - isosurface: {field: f, values: [0.6], normals: vertex}\n    outputs: [{path: a.exr}]\n";

/* Draws two descriptions of the same levels in two sessions. Checks that the gradients of the second, multiplied by
 * `scale`, are those of the first, and that both pictures show the same. */
static void expect_same_gradients(const two_levels levels[2], double scale, double allowed)
{
    const char *scene = write_scene(gradient_scene);
    double values[2][2][MOST_VALUES];
    insitu_session *sessions[2];
    caught_picture pictures[2];
    for (int i = 0; i < 2; i++) {
        sessions[i] = open_session(MPI_COMM_WORLD, scene);
        set_two_levels(sessions[i], &levels[i], values[i]);
        pictures[i] = step_and_take_picture(sessions[i], 0);
    }
    everywhere(compare_gradients(sessions[0], sessions[1], scale) <= allowed);
    everywhere(largest_colour_difference(&pictures[0], &pictures[1]) < 1e-3);
    everywhere(own_rank != 0 || count_visible_pixels(&pictures[0]) > 100);
    for (int i = 0; i < 2; i++) {
        free_caught(&pictures[i]);
        insitu_destroy(&sessions[i]);
    }
}

/* Checks derived gradients and smooth normals if the vertices that the levels share differ in their last bits. With a
 * spacing of 3 they are bitwise equal, with 0.9 they are not. The results must be the same except for their scale. */
static void gradients_merge_vertices_that_differ_in_last_bits(void **state)
{
    (void)state;
    for (int of_cells = 0; of_cells < 2; of_cells++)
        expect_same_gradients((const two_levels[]){{3, 3, of_cells, 0}, {3, 0.9, of_cells, 0}}, 0.9 / 3, 1e-12);
}

/* Checks that the given values at hanging vertices do not matter for gradients. */
static void gradients_ignore_given_values_at_hanging_vertices(void **state)
{
    (void)state;
    for (int ratio = 2; ratio <= 3; ratio++)
        expect_same_gradients((const two_levels[]){{ratio, 1, false, 0}, {ratio, 1, false, 7}}, 1, 0);
}

/* ---- quads ------------------------------------------------------------------------------------------------------- */

enum { STRIPS = 3, LONG = 4, MOST_ALONG = 8 * LONG + 1 };

/* A plane of quads in three strips, each of which is finer than the one before: their refinements are 1, `ratio` and
 * 2 * ratio. Strip b goes from 2 * b to 2 * b + 2 along the axis `across`, and from 0 to LONG along the axis `along`.
 */
typedef struct quad_strips {
    int across, along; /* the third axis has no cells */
    int ratio;
    bool is_of_cells; /* true: the field has cell values; false: it has values at vertices */
    bool is_turned;   /* set if the coordinates are given by vertex, and the plane is turned */
} quad_strips;

typedef struct quad_strip {
    insitu_lattice lattice;
    int64_t vertex_count, cell_count;
    double values[MOST_ALONG * MOST_ALONG * 2], places[MOST_ALONG * MOST_ALONG * 2][3];
} quad_strip;

static int get_strip_refinement(const quad_strips *q, int number)
{
    return number == 0 ? 1 : number * q->ratio;
}

static bool is_hanging_in_strip(const quad_strips *q, int number, int across, int along)
{
    return number > 0 && across == 0 && along % (number == 1 ? q->ratio : 2) != 0;
}

static double compute_plane_value(double across, double along)
{
    return sin(across) + sin(1.7 * along) * along;
}

/* Sets the values at the strip's vertices. Those at hanging vertices are wrong by 1. */
static void fill_strip_vertices(const quad_strips *q, int number, quad_strip *out)
{
    const insitu_lattice *l = &out->lattice;
    const double of = get_strip_refinement(q, number);
    const int64_t wide[2] = {l->cells[0] + 1, l->cells[1] + 1};
    for (int64_t v = 0; v < out->vertex_count; v++) {
        const int at[3] = {(int)(v % wide[0]), (int)(v / wide[0] % wide[1]), (int)(v / wide[0] / wide[1])};
        const double across = 2 * number + at[q->across] / of, along = at[q->along] / of;
        const double place[3] = {0.6 * across, 0.8 * across, along};
        memcpy(out->places[v], place, sizeof place);
        out->values[v] =
            compute_plane_value(across, along) + is_hanging_in_strip(q, number, at[q->across], at[q->along]);
    }
}

static void make_strip(const quad_strips *q, int number, quad_strip *out)
{
    const int of = get_strip_refinement(q, number);
    insitu_lattice *l = &out->lattice;
    memset(out, 0, sizeof *out);
    l->cells[q->across] = 2 * (int64_t)of;
    l->cells[q->along] = LONG * (int64_t)of;
    l->first[q->across] = 2 * (int64_t)number * of;
    for (int axis = 0; axis < 3; axis++) {
        l->refinement[axis] = of;
        l->spacing[axis] = q->is_turned ? 0 : 1.0 / of;
    }
    out->vertex_count = (l->cells[q->across] + 1) * (l->cells[q->along] + 1);
    out->cell_count = l->cells[q->across] * l->cells[q->along];
    fill_strip_vertices(q, number, out);
    for (int64_t cell = 0; cell < out->cell_count && q->is_of_cells; cell++)
        out->values[cell] = sin(13 * (double)cell + number);
}

static bool submit_strip(insitu_session *session, const quad_strips *q, int number, const quad_strip *strip)
{
    insitu_mesh mesh;
    insitu_mesh_defaults(&mesh);
    mesh.lattice = &strip->lattice;
    mesh.vertex_count = strip->vertex_count;
    mesh.cell_count = strip->cell_count;
    for (int axis = 0; axis < 3 && q->is_turned; axis++)
        mesh.coordinates[axis] = (insitu_array){&strip->places[0][axis], INSITU_FLOAT64, 24};
    return set_block_and_field(session, number, &mesh, q->is_of_cells, strip->values);
}

/* Checks that hanging vertices of a strip have the values interpolated between the ends of the coarser edges, and that
 * values at all other vertices are those that were given. */
static bool check_strip_values(const insitu_session *session, const quad_strips *q)
{
    const session_parts parts = session_find_parts(&session->meshes, "m");
    for (int i = 0; i < parts.count; i++) {
        const session_mesh *part = parts.items[i];
        const double *values = part->scalar_count == 1 ? part->scalars[0].vertex_values : NULL;
        const int number = (int)part->block, ratio = number == 1 ? q->ratio : 2;
        const insitu_lattice *l = part->given.lattice;
        const int64_t step = q->along > q->across ? l->cells[q->across] + 1 : 1;
        if (!values) return false;
        for (int64_t n = 0; n <= l->cells[q->along]; n++) {
            const int64_t low = n / ratio * ratio;
            const double share = (double)(n - low) / ratio;
            const bool is_hanging = is_hanging_in_strip(q, number, 0, (int)n);
            double expected = values[n * step];
            if (is_hanging) expected = (1 - share) * values[low * step] + share * values[(low + ratio) * step];
            if (!is_hanging && !q->is_of_cells)
                expected = compute_plane_value(2 * number, (double)n / get_strip_refinement(q, number));
            if (fabs(values[n * step] - expected) > 1e-13 * LONG) return false;
        }
    }
    return true;
}

static void check_quad_strips(const quad_strips *q)
{
    static const char scene[] =
        "images:\n  - name: a\n    size: [40, 40]\n    layers:\n      - surface: {colour_by: {field: f, "
        "interpolate: vertex}}\n    outputs: [{path: a.exr}]\n";
    static quad_strip strips[STRIPS];
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(scene));
    for (int number = 0; number < STRIPS; number++) {
        make_strip(q, number, &strips[number]);
        if (number % rank_count == own_rank) assert_true(submit_strip(session, q, number, &strips[number]));
    }
    caught_picture picture = step_and_take_picture(session, 0);
    everywhere(check_strip_values(session, q));
    free_caught(&picture);
    insitu_destroy(&session);
}

/* Checks that vertices within edges of coarser quads have the values interpolated on these edges, with cell values and
 * with values at vertices, for planes along each pair of axes. */
static void values_are_interpolated_on_edges_of_quads(void **state)
{
    (void)state;
    for (int kind = 0; kind < 48; kind++) {
        const int flat = kind % 3, is_swapped = kind / 3 % 2;
        const quad_strips q = {.across = (flat + 1 + is_swapped) % 3,
                               .along = (flat + 2 - is_swapped) % 3,
                               .ratio = 2 + kind / 6 % 2,
                               .is_of_cells = kind / 12 % 2,
                               .is_turned = kind / 24};
        check_quad_strips(&q);
    }
}

static int set_up_test_group(void **state)
{
    (void)state;
    return enter_test_folder("levels") ? 0 : 1;
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(a_sphere_continues_across_levels),
                                       cmocka_unit_test(outer_surfaces_have_no_faces_between_levels),
                                       cmocka_unit_test(levels_are_added_and_removed),
                                       cmocka_unit_test(blocks_adjacent_to_a_change_are_kept),
                                       cmocka_unit_test(blocks_that_do_not_fit_are_reported),
                                       cmocka_unit_test(intermediate_levels_allow_finer_levels_within_a_cell),
                                       cmocka_unit_test(gradients_merge_vertices_that_differ_in_last_bits),
                                       cmocka_unit_test(gradients_ignore_given_values_at_hanging_vertices),
                                       cmocka_unit_test(values_are_interpolated_on_edges_of_quads)};
    return run_session_tests(argc, argv, tests, set_up_test_group, NULL);
}
