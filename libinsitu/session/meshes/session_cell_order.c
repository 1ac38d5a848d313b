/* All other code expects each cell's vertices contiguously and in VTK's order, and kernels process eight such cells at
 * once. If the caller uses another vertex order, the connectivity is copied into VTK's order, so that kernels need not
 * distinguish orders. Cells of types for which both orders are the same, such as tets, are not copied. */
#include "session_cell_order.h"

#include "region.h"

const signed char *session_vertex_permutation(insitu_vertex_order order, int type)
{
    static const signed char lexicographic[GRID_MAX_CELL_VERTICES] = {0, 1, 3, 2, 4, 5, 7, 6};
    static const signed char plex_hex[] = {0, 3, 2, 1, 4, 5, 6, 7}, plex_wedge[] = {0, 2, 1, 3, 4, 5};
    if (order == INSITU_ORDER_LEXICOGRAPHIC && (type == GRID_HEX || type == GRID_QUAD || type == GRID_PYRAMID))
        return lexicographic;
    if (order == INSITU_ORDER_DMPLEX && type == GRID_HEX) return plex_hex;
    if (order == INSITU_ORDER_DMPLEX && type == GRID_WEDGE) return plex_wedge;
    return NULL;
}

bool session_must_reorder_vertices(const insitu_mesh *given)
{
    if (given->cell_count == 0 || session_has_face_owners(given)) return false;
    if (given->cell_types.data) return given->vertex_order != INSITU_ORDER_VTK;
    const int type = (int)given->cell_type;
    const bool has_gaps = given->connectivity_row && given->connectivity_row != grid_type_vertex_count(type);
    return has_gaps || session_vertex_permutation(given->vertex_order, type);
}

/* Returns whether a mesh of mixed cells contains a cell whose vertices are in another order than VTK's. */
static bool has_reordered_cells(const session_mesh *mesh)
{
    const grid *g = &mesh->cells;
    int64_t cell = 0;
    while (cell < g->cell_count && !session_vertex_permutation(mesh->given.vertex_order, grid_cell_type(g, cell)))
        cell++;
    return cell < g->cell_count;
}

/* The entries of the caller's connectivity that belong to cells. A row is the sequence of entries from the first vertex
 * of a cell to the first vertex of the next cell; its last entries may be unused. */
typedef struct cell_rows {
    const grid_array *connectivity;
    int64_t count;       /* number of entries that belong to cells */
    int64_t row_length;  /* number of entries in each row */
    int64_t used_length; /* number of entries at the start of each row that list vertices of the cell */
} cell_rows;

static int64_t read_entry(const cell_rows *rows, int64_t i)
{
    return grid_read_index(rows->connectivity, rows->row_length == rows->used_length
                                                   ? i
                                                   : i / rows->used_length * rows->row_length + i % rows->used_length);
}

static cell_rows make_cell_rows(const session_mesh *mesh)
{
    const insitu_mesh *given = &mesh->given;
    cell_rows rows = {&mesh->cells.connectivity, given->connectivity_count, 1, 1};
    if (!given->connectivity_row) return rows;
    rows.row_length = given->connectivity_row;
    rows.used_length = grid_type_vertex_count((int)given->cell_type);
    rows.count = given->cell_count * rows.used_length;
    return rows;
}

/* Returns whether all entries fit into 4 bytes; otherwise the entries are copied with 8 bytes. An entry that does not
 * fit may be an invalid index; with 8 bytes it is copied unchanged, so that the error message shows it. */
static bool do_entries_fit_in_32_bits(const cell_rows *rows, int threads)
{
    int64_t least = 0, most = 0;
#pragma omp parallel num_threads(threads)
    {
        region_enter();
#pragma omp for schedule(static) reduction(min : least) reduction(max : most) nowait
        for (int64_t i = 0; i < rows->count; i++) {
            const int64_t entry = read_entry(rows, i);
            least = entry < least ? entry : least;
            most = entry > most ? entry : most;
        }
        region_leave();
    }
    return least >= INT32_MIN && most <= INT32_MAX;
}

/* Finds the entry of the copied connectivity with the cell's first vertex. count: number of the cell's vertices;
 * entries: total number of entries. Returns false if the cell's offsets are invalid. */
static bool find_first_entry_of_cell(const grid *g, int64_t cell, int count, int64_t entries, int64_t *first)
{
    *first = cell * count;
    if (!g->offsets.data) return true;
    *first = grid_read_index(&g->offsets, cell);
    return *first >= 0 && *first <= entries - count && grid_offset_end(&g->offsets, cell) - *first == count;
}

static void reorder_cell(const session_mesh *mesh, int64_t cell, int64_t entries, const grid_array *out)
{
    const int type = grid_cell_type(&mesh->cells, cell), count = grid_type_vertex_count(type);
    const signed char *turn = session_vertex_permutation(mesh->given.vertex_order, type);
    int64_t vertices[GRID_MAX_CELL_VERTICES], first;
    if (!turn || !find_first_entry_of_cell(&mesh->cells, cell, count, entries, &first)) return;
    for (int i = 0; i < count; i++) vertices[i] = grid_read_index(out, first + turn[i]);
    for (int i = 0; i < count; i++) session_store_index(out, first + i, vertices[i]);
}

void session_permute_corners_of_cells(const session_mesh *mesh, int64_t entries, int threads, const grid_array *out)
{
#pragma omp parallel num_threads(threads)
    {
        region_enter();
#pragma omp for schedule(static) nowait
        for (int64_t cell = 0; cell < mesh->cells.cell_count; cell++) reorder_cell(mesh, cell, entries, out);
        region_leave();
    }
}

insitu_status session_order_cells(session_mesh *mesh, int threads, base_error *error)
{
    session_topology *t = &mesh->topology;
    const cell_rows rows = make_cell_rows(mesh);
    if (mesh->cells.cell_types && !has_reordered_cells(mesh)) return INSITU_OK;
    const int64_t largest = do_entries_fit_in_32_bits(&rows, threads) ? 0 : INT64_MAX;
    if (!session_allocate_indices(mesh, "cells' vertices in VTK's order", rows.count, largest, &t->connectivity, error))
        return error->status;
#pragma omp parallel num_threads(threads)
    {
        region_enter();
#pragma omp for schedule(static) nowait
        for (int64_t i = 0; i < rows.count; i++) session_store_index(&t->connectivity, i, read_entry(&rows, i));
        region_leave();
    }
    session_permute_corners_of_cells(mesh, rows.count, threads, &t->connectivity);
    t->has_own_order = true;
    t->connectivity_count = rows.count;
    t->cell_bytes = (rows.count + 1) * t->connectivity.stride;
    return INSITU_OK;
}
