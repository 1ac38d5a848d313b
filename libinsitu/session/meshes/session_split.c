/* Trees and kernels support linear cells only. Cells of higher order are therefore split into linear pieces between
 * their own nodes, once per topology. The pieces of a cell are consecutive, and the index of the cell is stored with
 * each piece, so that ghost flags, cell values, thresholds and counts refer to the caller's cells.
 *
 * The split of a serendipity cell depends on the lexicographic order of its nodes' positions (session_pattern.c), so
 * the pieces are computed again when nodes move. The split of other cells depends only on the cell's type and order. */
#include "session_split.h"

#include <string.h>

#include "memory.h"
#include "session_pattern.h"
#include "session_region.h"
#include "session_rows.h"
#include "session_tally.h"
#include "vector3.h"

enum { LINEAR_TYPES = GRID_POLYHEDRON + 1 };

/* The input and results of splitting the caller's cells. */
typedef struct split_work {
    const session_mesh *mesh;
    session_rows rows;
    /* for each kind of cell (type and number of nodes), the pieces into which it is split */
    session_pattern patterns[ROWS_MOST_KINDS];
    bool is_of_type[LINEAR_TYPES]; /* for each linear type, set if some piece has this type */
    int only_type;                 /* the type of all pieces; 0 if pieces have different types */
    /* first_pieces: for each cell, the index of its first piece; a last element has the number of pieces.
     * first_entries: for each cell, the index in piece_entries at which the vertices of its pieces begin; a last
     * element has the number of entries. first_entries is NULL if all pieces have one type. */
    int64_t *first_pieces, *first_entries;
    const session_piece_set *set; /* selects the pieces that are made of each cell */
    /* true: piece_entries has, for each corner of a piece, the index of an entry of the caller's connectivity; false:
     * the index of a vertex */
    bool stores_entries;
    grid_array piece_entries; /* connectivity of the pieces, piece by piece */
} split_work;

/* ---- access to the caller's cells -------------------------------------------------------------------------------- */

bool session_has_higher_order(const insitu_mesh *given)
{
    if (given->cell_count == 0 || given->lattice || session_has_face_owners(given)) return false;
    if (!given->cell_types.data) return session_get_linear_type((int)given->cell_type) != GRID_NO_TYPE;
    const grid g = session_caller_grid(given);
    int64_t cell = 0;
    while (cell < given->cell_count && session_get_linear_type(grid_cell_type(&g, cell)) == GRID_NO_TYPE) cell++;
    return cell < given->cell_count;
}

int64_t session_find_connectivity_index(const insitu_mesh *given, int64_t entry)
{
    const int64_t used = session_count_cell_nodes(given), row = given->connectivity_row;
    return !row || given->offsets.data || row == used ? entry : entry / used * row + entry % used;
}

static const session_pattern *find_cell_pattern(const split_work *w, int64_t cell)
{
    return &w->patterns[session_find_kind_of_cell(&w->rows, cell)];
}

/* ---- lists of pieces by type of cell, and checks of the caller's cells ------------------------------------------- */

static insitu_status report_unsupported_cell_type(const session_mesh *mesh, int64_t cell, int type, int64_t count,
                                                  base_error *error)
{
    const long long at = cell, nodes = count;
    if (type == GRID_POLYHEDRON || type == GRID_POLYGON)
        return base_fail(error, INSITU_ERROR_MESH,
                         "mesh \"%s\": cell %lld is a %s, and others are of higher order: give them in another mesh",
                         mesh->label, at, type == GRID_POLYGON ? "polygon" : "polyhedron");
    if (session_get_linear_type(type) == GRID_NO_TYPE && !grid_type_vertex_count(type))
        return base_fail(error, INSITU_ERROR_MESH, "mesh \"%s\": cell %lld: unknown cell type %d", mesh->label, at,
                         type);
    return base_fail(error, INSITU_ERROR_MESH,
                     "mesh \"%s\": cell %lld of type %d has %lld nodes by its offsets, which no order from 1 to %d has",
                     mesh->label, at, type, nodes, NODES_MOST_ORDER);
}

static insitu_status add_pattern(split_work *w, int64_t cell, int type, int64_t count, base_error *error)
{
    session_nodes nodes = {type, 1, grid_type_vertex_count(type), true, false};
    const insitu_vertex_order order = w->mesh->given.vertex_order;
    const bool is_linear = nodes.count && nodes.count == count;
    if (!is_linear && !session_describe_nodes(type, count, &nodes))
        return report_unsupported_cell_type(w->mesh, cell, type, count, error);
    const char *why = is_linear ? NULL : session_describe_unsupported_node_order(&nodes, order);
    if (why)
        return base_fail(error, INSITU_ERROR_MESH,
                         "mesh \"%s\": cell %lld of type %d and order %d: vertex_order is %d: %s", w->mesh->label,
                         (long long)cell, type, nodes.order, (int)order, why);
    if (w->rows.kind_count == ROWS_MOST_KINDS)
        return base_fail(error, INSITU_ERROR_MESH, "mesh \"%s\": cell %lld: more than %d types and orders of cells",
                         w->mesh->label, (long long)cell, ROWS_MOST_KINDS);
    session_pattern *made = &w->patterns[w->rows.kind_count];
    w->rows.kinds[w->rows.kind_count++] = (session_row_kind){type, nodes};
    if (!session_make_split_pattern(type, &nodes, order, made))
        return base_fail(error, INSITU_ERROR_MEMORY, "mesh \"%s\": no memory for the pieces of a cell", w->mesh->label);
    for (int i = 0; i < made->piece_count; i++) w->is_of_type[made->types[i]] = true;
    if (!nodes.is_complete) w->is_of_type[nodes.type == GRID_QUAD ? GRID_TRIANGLE : GRID_TET] = true;
    return INSITU_OK;
}

static insitu_status check_offsets(const split_work *w, int64_t cell, base_error *error)
{
    const insitu_mesh *given = &w->mesh->given;
    const long long base = given->index_base, first = session_find_first_entry_of_cell(&w->rows, cell) + base,
                    next = first + session_count_nodes_of_cell(&w->rows, cell);
    const long long last = given->connectivity_count + base;
    if (!w->rows.cells.offsets.data || (first >= base && next >= first && next <= last)) return INSITU_OK;
    return base_fail(error, INSITU_ERROR_MESH,
                     "mesh \"%s\": cell %lld: offsets %lld and %lld do not rise or are outside %lld..%lld",
                     w->mesh->label, (long long)cell, first, next, base, last);
}

static void find_common_type_of_pieces(split_work *w)
{
    int types = 0;
    for (int type = 0; type < LINEAR_TYPES; type++) {
        types += w->is_of_type[type];
        if (w->is_of_type[type]) w->only_type = type;
    }
    if (types > 1) w->only_type = 0;
}

/* Makes the list of pieces (pattern) for each kind of cell in the mesh. Returns an error for the first cell that cannot
 * be split or has invalid offsets. */
static insitu_status find_patterns(split_work *w, base_error *error)
{
    const insitu_mesh *given = &w->mesh->given;
    const int64_t cells = w->rows.cells.offsets.data ? given->cell_count : 1;
    int last_type = -1;
    int64_t last_size = -1;
    for (int64_t cell = 0; cell < cells; cell++) {
        if (check_offsets(w, cell, error)) return error->status;
        const int type = grid_cell_type(&w->rows.cells, cell);
        const int64_t size = session_count_nodes_of_cell(&w->rows, cell);
        if (type == last_type && size == last_size) continue;
        if (session_find_cell_kind(&w->rows, type, size) < 0 && add_pattern(w, cell, type, size, error))
            return error->status;
        last_type = type;
        last_size = size;
    }
    const int64_t end =
        w->rows.cells.offsets.data ? grid_offset_end(&w->rows.cells.offsets, cells - 1) : given->connectivity_count;
    if (end != given->connectivity_count)
        return base_fail(error, INSITU_ERROR_MESH,
                         "mesh \"%s\": the last offset is %lld, not connectivity_count%s, %lld", w->mesh->label,
                         (long long)end + given->index_base, given->index_base ? " + 1" : "",
                         (long long)given->connectivity_count + given->index_base);
    find_common_type_of_pieces(w);
    return INSITU_OK;
}

static insitu_status report_invalid_vertex_index(const split_work *w, int64_t cell, base_error *error)
{
    const long long base = w->mesh->given.index_base, last = w->mesh->given.vertex_count - 1 + base;
    const int64_t first = session_find_first_entry_of_cell(&w->rows, cell);
    int64_t n = 0;
    while (session_row_vertex(&w->rows, first + n) >= 0 &&
           session_row_vertex(&w->rows, first + n) < w->mesh->given.vertex_count)
        n++;
    return base_fail(error, INSITU_ERROR_MESH,
                     "mesh \"%s\": cell %lld: index %lld of its node %lld is outside %lld..%lld (index_base is %lld)",
                     w->mesh->label, (long long)cell, (long long)session_row_vertex(&w->rows, first + n) + base,
                     (long long)n, base, last, base);
}

static insitu_status check_indices(const split_work *w, int threads, base_error *error)
{
    const int64_t cells = w->mesh->given.cell_count, vertices = w->mesh->given.vertex_count;
    int64_t bad = cells;
#pragma omp parallel num_threads(session_choose_loop_threads(threads, cells))
    {
        region_enter();
#pragma omp for schedule(static) reduction(min : bad) nowait
        for (int64_t cell = 0; cell < cells; cell++) {
            const int64_t first = session_find_first_entry_of_cell(&w->rows, cell),
                          size = session_count_nodes_of_cell(&w->rows, cell);
            for (int64_t n = 0; n < size && cell < bad; n++) {
                const int64_t vertex = session_row_vertex(&w->rows, first + n);
                if (vertex < 0 || vertex >= vertices) bad = cell;
            }
        }
        region_leave();
    }
    return bad < cells ? report_invalid_vertex_index(w, bad, error) : INSITU_OK;
}

/* ---- making the pieces of all cells ------------------------------------------------------------------------------ */

/* Computes, for each midpoint of a serendipity cell, the number of midpoints before it in the lexicographic order of
 * positions; midpoints at equal positions have equal numbers. */
static void order_midpoints_by_position(const split_work *w, const session_pattern *of, int64_t first, int ranks[27])
{
    double at[12][3];
    for (int n = 0; n < of->midpoint_count; n++)
        for (int axis = 0; axis < 3; axis++) {
            const int64_t vertex = session_row_vertex(&w->rows, first + of->midpoints[n]);
            at[n][axis] = grid_read_number(&w->rows.cells.coordinates[axis], vertex);
        }
    for (int n = 0; n < of->midpoint_count; n++) {
        int rank = 0;
        for (int m = 0; m < of->midpoint_count; m++) rank += vector3_compare(at[m], at[n]) < 0;
        ranks[of->midpoints[n]] = rank;
    }
}

/* Iterator over the pieces of a complete cell that are made, which are the pieces in a session_piece_set. */
typedef struct piece_walk {
    const uint64_t *words; /* NULL: all pieces are made */
    int count;             /* number of pieces of the pattern */
    int next;              /* index, in the pattern, of the first piece that has not been returned */
} piece_walk;

static piece_walk begin_piece_walk(const split_work *w, const session_pattern *of, int64_t cell)
{
    const int64_t *first = w->set->first_words;
    /* All pieces of a pyramid are made, whatever its bits in the set are, because they have two types: pyramids and
     * tets. */
    const bool has_words = first && first[cell] < first[cell + 1] && of->nodes.type != GRID_PYRAMID;
    return (piece_walk){has_words ? w->set->bits + first[cell] : NULL, of->piece_count, 0};
}

/* Returns the index, in the pattern, of the next piece that is made, or -1 if there are no more. */
static int next_piece(piece_walk *walk)
{
    while (walk->words && walk->next < walk->count) {
        const uint64_t left = walk->words[walk->next / 64] >> walk->next % 64;
        if (left) {
            walk->next += __builtin_ctzll(left);
            break;
        }
        walk->next = (walk->next / 64 + 1) * 64;
    }
    return walk->next < walk->count ? walk->next++ : -1;
}

static int count_made_pieces(const split_work *w, const session_pattern *of, int64_t cell)
{
    piece_walk walk = begin_piece_walk(w, of, cell);
    int count = 0;
    while (walk.words && next_piece(&walk) >= 0) count++;
    return walk.words ? count : of->piece_count;
}

static int cut_cell(const split_work *w, const session_pattern *of, int64_t cell, int pieces[PATTERN_MOST_LOOSE][4])
{
    int ranks[27] = {0};
    order_midpoints_by_position(w, of, session_find_first_entry_of_cell(&w->rows, cell), ranks);
    return session_split_serendipity_cell(of, ranks, pieces);
}

static void count_pieces(const split_work *w, int64_t cell)
{
    const session_pattern *of = find_cell_pattern(w, cell);
    int loose[PATTERN_MOST_LOOSE][4];
    const int count = of->polygon_count ? cut_cell(w, of, cell, loose) : count_made_pieces(w, of, cell);
    w->first_pieces[cell + 1] = count;
    if (!w->first_entries) return;
    if (of->polygon_count)
        w->first_entries[cell + 1] = count * (of->nodes.type == GRID_QUAD ? 3 : 4);
    else /* pieces of a cell have different types only if all pieces of the cell are made */
        w->first_entries[cell + 1] =
            count == of->piece_count ? of->piece_size : count * grid_type_vertex_count(of->types[0]);
}

static void accumulate_counts(int64_t *counts, int64_t cells)
{
    for (int64_t cell = 0; cell < cells; cell++) counts[cell + 1] += counts[cell];
}

static insitu_status count_all_pieces(split_work *w, int threads, base_error *error)
{
    const int64_t cells = w->mesh->given.cell_count, most = 4294967294;
    const size_t bytes = (size_t)(cells + 1) * sizeof *w->first_pieces;
    w->first_pieces = base_calloc(bytes, 1);
    if (!w->only_type) w->first_entries = base_calloc(bytes, 1);
    if (!w->first_pieces || (!w->only_type && !w->first_entries))
        return base_fail(error, INSITU_ERROR_MEMORY, "mesh \"%s\": no memory for %zu bytes of cells' pieces",
                         w->mesh->label, bytes);
#pragma omp parallel num_threads(session_choose_loop_threads(threads, cells))
    {
        region_enter();
#pragma omp for schedule(static) nowait
        for (int64_t cell = 0; cell < cells; cell++) count_pieces(w, cell);
        region_leave();
    }
    accumulate_counts(w->first_pieces, cells);
    if (w->first_entries) accumulate_counts(w->first_entries, cells);
    if (w->first_pieces[cells] <= most) return INSITU_OK;
    return base_fail(error, INSITU_ERROR_MESH, "mesh \"%s\": its cells have %lld pieces, at most %lld are supported",
                     w->mesh->label, (long long)w->first_pieces[cells], (long long)most);
}

static int64_t entry_count(const split_work *w)
{
    const int64_t cells = w->mesh->given.cell_count;
    return w->first_entries ? w->first_entries[cells] : w->first_pieces[cells] * grid_type_vertex_count(w->only_type);
}

/* Stores a corner of a piece at index `at` of the pieces' connectivity: as a vertex or, if stores_entries is set, as an
 * entry of the caller's connectivity. node: position of the corner in the cell's list of nodes. */
static void store_corner(const split_work *w, int64_t cell, int64_t at, int node)
{
    const int64_t first = session_find_first_entry_of_cell(&w->rows, cell);
    session_store_index(&w->piece_entries, at,
                        w->stores_entries ? session_row_entry(&w->rows, cell, node)
                                          : session_row_vertex(&w->rows, first + node));
}

static void store_pieces_of_cell(const split_work *w, int64_t cell)
{
    const session_pattern *of = find_cell_pattern(w, cell);
    int64_t at =
        w->first_entries ? w->first_entries[cell] : w->first_pieces[cell] * grid_type_vertex_count(w->only_type);
    piece_walk walk = begin_piece_walk(w, of, cell);
    if (!walk.words)
        for (int n = 0; n < of->piece_size; n++) store_corner(w, cell, at++, of->piece_positions[n]);
    const int corners = walk.words ? grid_type_vertex_count(of->types[0]) : 0;
    for (int piece; walk.words && (piece = next_piece(&walk)) >= 0;)
        for (int n = 0; n < corners; n++) store_corner(w, cell, at++, of->piece_positions[piece * corners + n]);
    if (!of->polygon_count) return;
    int loose[PATTERN_MOST_LOOSE][4];
    const int size = of->nodes.type == GRID_QUAD ? 3 : 4, count = cut_cell(w, of, cell, loose);
    for (int i = 0; i < count; i++)
        for (int n = 0; n < size; n++) store_corner(w, cell, at++, loose[i][n]);
}

static void store_pieces_of_all_cells(const split_work *w, int threads)
{
    const int64_t cells = w->mesh->given.cell_count;
#pragma omp parallel num_threads(session_choose_loop_threads(threads, cells))
    {
        region_enter();
#pragma omp for schedule(static) nowait
        for (int64_t cell = 0; cell < cells; cell++) store_pieces_of_cell(w, cell);
        region_leave();
    }
}

/* ---- storing the pieces as the cells that are read --------------------------------------------------------------- */

/* Stores, for each piece, the index and the ghost flag of the caller's cell that contains it, and the type and offset
 * of the piece. */
static void store_cell_of_each_piece(const split_work *w, session_topology *t)
{
    const insitu_mesh *given = &w->mesh->given;
    for (int64_t cell = 0; cell < given->cell_count; cell++) {
        const session_pattern *of = find_cell_pattern(w, cell);
        int64_t at = w->first_entries ? w->first_entries[cell] : 0;
        for (int64_t i = w->first_pieces[cell]; i < w->first_pieces[cell + 1]; i++) {
            const int loose = of->nodes.type == GRID_QUAD ? GRID_TRIANGLE : GRID_TET;
            const int type = of->polygon_count ? loose : of->types[i - w->first_pieces[cell]];
            t->parents[i] = (uint32_t)cell;
            if (t->ghosts) t->ghosts[i] = grid_is_ghost(&w->rows.cells, cell);
            if (!w->first_entries) continue;
            t->cell_types[i] = (unsigned char)type;
            session_store_index(&t->offsets, i, at);
            at += grid_type_vertex_count(type);
        }
    }
    if (w->first_entries) session_store_index(&t->offsets, w->first_pieces[given->cell_count], entry_count(w));
}

static insitu_status make_topology(split_work *w, session_mesh *mesh, int threads, base_error *error)
{
    session_topology *t = &mesh->topology;
    const int64_t pieces = w->first_pieces[mesh->given.cell_count], entries = entry_count(w);
    t->has_own_cells = t->is_split = true;
    t->cell_type = w->only_type;
    t->cell_count = pieces;
    t->connectivity_count = entries;
    for (int i = 0; i < w->rows.kind_count; i++)
        t->depends_on_coordinates = t->depends_on_coordinates || w->patterns[i].polygon_count;
    if (!session_allocate_indices(mesh, "cells' pieces", entries, mesh->given.vertex_count, &t->connectivity, error))
        return error->status;
    if (w->first_entries && !session_allocate_indices(mesh, "cells' pieces", pieces, entries, &t->offsets, error))
        return error->status;
    t->parents = base_alloc((size_t)(pieces + 1) * sizeof *t->parents);
    if (w->first_entries) t->cell_types = base_alloc((size_t)pieces + 1);
    if (mesh->given.ghosts.data) t->ghosts = base_alloc((size_t)pieces + 1);
    if (!t->parents || (w->first_entries && !t->cell_types) || (mesh->given.ghosts.data && !t->ghosts))
        return base_fail(error, INSITU_ERROR_MEMORY, "mesh \"%s\": no memory for %lld pieces of cells", mesh->label,
                         (long long)pieces);
    store_cell_of_each_piece(w, t);
    w->piece_entries = t->connectivity;
    store_pieces_of_all_cells(w, threads);
    t->cell_bytes = (entries + 1) * t->connectivity.stride + pieces * (int64_t)sizeof *t->parents;
    if (w->first_entries) t->cell_bytes += (pieces + 1) * t->offsets.stride + pieces;
    if (t->ghosts) t->cell_bytes += pieces;
    t->first_pieces = w->first_pieces;
    t->cell_bytes += (mesh->given.cell_count + 1) * (int64_t)sizeof *t->first_pieces;
    w->first_pieces = NULL;
    return INSITU_OK;
}

static void free_split_work(split_work *w)
{
    for (int i = 0; i < w->rows.kind_count; i++) session_drop_split_pattern(&w->patterns[i]);
    base_free(w->first_pieces);
    base_free(w->first_entries);
}

insitu_status session_split_cells(session_mesh *mesh, int threads, base_error *error)
{
    split_work w = {.mesh = mesh, .rows = session_describe_rows(mesh), .set = &mesh->finer.pieces};
    insitu_status status = find_patterns(&w, error);
    if (!status) status = check_indices(&w, threads, error);
    if (!status) status = count_all_pieces(&w, threads, error);
    if (!status) status = make_topology(&w, mesh, threads, error);
    free_split_work(&w);
    return status;
}

insitu_status session_make_entry_connectivity(const session_mesh *mesh, int threads, grid_array *out, base_error *error)
{
    split_work w = {.mesh = mesh, .rows = session_describe_rows(mesh), .set = &mesh->finer.pieces};
    insitu_status status = find_patterns(&w, error);
    const int64_t nodes = session_count_cell_nodes(&mesh->given), cells = mesh->given.cell_count;
    const int64_t largest = w.rows.cells.offsets.data ? mesh->given.connectivity_count : cells * nodes;
    w.stores_entries = true;
    if (!status) status = count_all_pieces(&w, threads, error);
    if (!status && !session_allocate_indices(mesh, "cells' corners", entry_count(&w), largest, out, error))
        status = error->status;
    w.piece_entries = *out;
    if (!status) store_pieces_of_all_cells(&w, threads);
    free_split_work(&w);
    return status;
}

/* ---- counts of the caller's cells -------------------------------------------------------------------------------- */

session_counts session_count_split_cells(const session_mesh *mesh, bool any_inverted)
{
    const grid *g = &mesh->cells;
    session_counts out = {0};
    for (int64_t cell = 0; cell < mesh->given.cell_count; cell++) {
        const int64_t first = session_first_piece(mesh, cell), end = session_first_piece(mesh, cell + 1);
        const bool is_ghost = grid_is_ghost(g, first);
        bool is_flat = true;
        mesh_tally of = tally_empty();
        for (int64_t piece = first; piece < end; piece++) {
            is_flat = is_flat && grid_is_flat(g, piece);
            if (any_inverted) tally_cell(g, piece, &of);
        }
        out.ghost_count += is_ghost;
        out.drawn_count += !is_ghost;
        out.inverted_count += of.inverted_count > 0;
        out.flat_count += is_flat && !is_ghost;
        out.shell_count += is_flat && !is_ghost && grid_is_shell_type(grid_cell_type(g, first));
    }
    return out;
}

int64_t session_count_cells_of_pieces(const session_mesh *mesh, const uint32_t *pieces, int64_t count)
{
    uint64_t *bits = base_calloc((size_t)(mesh->given.cell_count + 63) / 64, sizeof *bits);
    int64_t parents = 0;
    if (!bits) return mesh->given_counts.drawn_count;
    for (int64_t i = 0; i < count; i++) {
        const uint32_t cell = mesh->topology.parents[pieces[i]];
        const uint64_t bit = (uint64_t)1 << cell % 64;
        parents += !(bits[cell / 64] & bit);
        bits[cell / 64] |= bit;
    }
    base_free(bits);
    return parents;
}
