/* Chooses the linear pieces of refined cells that are made.
 *
 * A linear piece contains a part of an isosurface only if the isovalue is in the range of the values at the piece's
 * corners. These ranges therefore determine exactly which pieces must be made, because rays find no isosurface in other
 * pieces. If a neighbour of a made piece is missing, the isosurface does not cross their common face.
 *
 * The distance from a plane is a polynomial of the same order as the positions, and its values at the nodes of the
 * finer lattice are computed from those at the cell's nodes. */
#include "session_piece_set.h"

#include <math.h>
#include <string.h>

#include "memory.h"
#include "session_pattern.h"
#include "session_region.h"
#include "session_shape.h"

/* The data by which pieces are selected in cells of one type with one number of nodes. */
typedef struct piece_kind {
    session_interpolation nodes;
    session_pattern pieces;
    int corner_count; /* number of corners of each piece; 0 for pyramids, whose pieces are pyramids and tets */
    /* number of 64-bit words of session_piece_set.bits for one refined cell, with one bit per piece */
    int word_count;
} piece_kind;

typedef struct piece_work {
    session_rows rows; /* access to the nodes of each of the caller's cells */
    piece_kind kinds[ROWS_MOST_KINDS];
    const session_deviation_request *request;
    session_piece_set *set;
} piece_work;

static bool make_piece_kind(const session_nodes *of, insitu_vertex_order order, int parts, bool is_lobatto,
                            piece_kind *out)
{
    const int type = session_lagrange_type(of->type);
    if (!session_make_interpolation(of, order, parts, is_lobatto, &out->nodes)) return false;
    if (!session_make_split_pattern(type, &out->nodes.fine, INSITU_ORDER_LEXICOGRAPHIC, &out->pieces)) return false;
    out->corner_count = of->type == GRID_PYRAMID ? 0 : grid_type_vertex_count(out->pieces.types[0]);
    out->word_count = (out->pieces.piece_count + 63) / 64;
    return true;
}

static void free_piece_work(piece_work *w)
{
    for (int i = 0; i < w->rows.kind_count; i++) {
        session_drop_interpolation(&w->kinds[i].nodes);
        session_drop_split_pattern(&w->kinds[i].pieces);
    }
}

static bool create_piece_work(const session_mesh *mesh, int parts, bool is_lobatto, session_piece_set *set,
                              piece_work *w)
{
    const insitu_mesh *nodal = session_get_mesh_of_caller_nodes(mesh);
    bool is_made = true;
    *w = (piece_work){.rows = session_describe_caller_rows(nodal), .set = set};
    session_list_cell_kinds(&w->rows);
    for (int i = 0; i < w->rows.kind_count && is_made; i++)
        is_made = make_piece_kind(&w->rows.kinds[i].nodes, nodal->vertex_order, parts, is_lobatto, &w->kinds[i]);
    return is_made;
}

static const piece_kind *find_piece_kind_of_cell(const piece_work *w, int64_t cell)
{
    return &w->kinds[session_find_kind_of_cell(&w->rows, cell)];
}

static void set_bit(uint64_t *bits, int piece)
{
    bits[piece / 64] |= (uint64_t)1 << piece % 64;
}

static insitu_status fail_for_memory(const session_mesh *mesh, base_error *error)
{
    return base_fail(error, INSITU_ERROR_MEMORY, "mesh \"%s\": no memory for sets of pieces of its cells", mesh->label);
}

/* ---- pieces at the cell's own nodes ------------------------------------------------------------------------------ */

/* Selects one piece at each of the cell's own nodes, or all pieces if the cell is a pyramid. The result is the same for
 * any order of nodes in the connectivity. is_own: buffer of one flag per node of the finer lattice. out: bit i is set
 * if piece i is selected. */
static void find_pieces_at_nodes(const piece_kind *kind, int parts, bool *is_own, uint64_t *out)
{
    const session_nodes *fine = &kind->nodes.fine;
    const int p = kind->nodes.of.order;
    for (int piece = 0; !kind->corner_count && piece < kind->pieces.piece_count; piece++) set_bit(out, piece);
    if (!kind->corner_count) return;
    memset(is_own, 0, (size_t)fine->count * sizeof *is_own);
    for (int k = 0; k <= p; k++)
        for (int j = 0; j <= p; j++)
            for (int i = 0; i <= p; i++)
                if (session_has_node(&kind->nodes.of, i, j, k) &&
                    session_find_node_in_connectivity(&kind->nodes.of, INSITU_ORDER_VTK, i, j, k) <
                        kind->nodes.of.count)
                    is_own[session_find_node_in_connectivity(fine, INSITU_ORDER_LEXICOGRAPHIC, parts * i, parts * j,
                                                             parts * k)] = true;
    for (int i = 0; i < kind->pieces.piece_size; i++) {
        const int node = kind->pieces.piece_positions[i];
        if (is_own[node]) set_bit(out, i / kind->corner_count);
        is_own[node] = false;
    }
}

/* Selects, in each marked cell, one piece at each of the cell's own nodes. */
static bool select_pieces_at_nodes_of_cells(const piece_work *w, const unsigned char *marks, int parts)
{
    const int64_t cells = w->rows.cells.cell_count;
    uint64_t *at_nodes[ROWS_MOST_KINDS] = {NULL};
    bool is_made = true;
    for (int i = 0; i < w->rows.kind_count && is_made; i++) {
        bool *is_own = base_alloc((size_t)w->kinds[i].nodes.fine.count * sizeof *is_own);
        at_nodes[i] = base_calloc((size_t)w->kinds[i].word_count, sizeof *at_nodes[i]);
        is_made = is_own && at_nodes[i];
        if (is_made) find_pieces_at_nodes(&w->kinds[i], parts, is_own, at_nodes[i]);
        base_free(is_own);
    }
    for (int64_t cell = 0; cell < cells && is_made; cell++) {
        const int kind = session_find_kind_of_cell(&w->rows, cell);
        if (marks[cell])
            memcpy(w->set->bits + w->set->first_words[cell], at_nodes[kind],
                   (size_t)w->kinds[kind].word_count * sizeof **at_nodes);
    }
    for (int i = 0; i < w->rows.kind_count; i++) base_free(at_nodes[i]);
    return is_made;
}

insitu_status session_begin_piece_set(const session_mesh *mesh, const unsigned char *marks, int parts,
                                      session_piece_set *out, base_error *error)
{
    piece_work *w = base_alloc(sizeof *w);
    *out = (session_piece_set){0};
    bool is_made = w && create_piece_work(mesh, parts, false, out, w);
    const int64_t cells = is_made ? w->rows.cells.cell_count : 0;
    if (is_made) out->first_words = base_alloc((size_t)(cells + 1) * sizeof *out->first_words);
    is_made = is_made && out->first_words;
    if (is_made) out->first_words[0] = 0;
    for (int64_t cell = 0; cell < cells && is_made; cell++)
        out->first_words[cell + 1] =
            out->first_words[cell] + (marks[cell] ? find_piece_kind_of_cell(w, cell)->word_count : 0);
    if (is_made) out->bits = base_alloc((size_t)(out->first_words[cells] + 1) * sizeof *out->bits);
    is_made = is_made && out->bits && select_pieces_at_nodes_of_cells(w, marks, parts);
    if (w) free_piece_work(w);
    base_free(w);
    return is_made ? INSITU_OK : fail_for_memory(mesh, error);
}

/* ---- pieces that an isosurface or a plane may cross -------------------------------------------------------------- */

static size_t find_buffer_size(const piece_work *w, int field_size)
{
    size_t most = 0;
    for (int i = 0; i < w->rows.kind_count; i++) {
        const session_interpolation *of = &w->kinds[i].nodes;
        const size_t own = (size_t)of->of.count + (size_t)of->fine.count + session_interpolation_work_size(of, 1);
        most = own > most ? own : most;
    }
    return most + (size_t)field_size;
}

/* Selects the pieces of a cell that an isosurface may cross. values: the values at the nodes of the finer lattice.
 * bits: bit i is set if piece i is selected. */
static void select_crossed_pieces(const piece_kind *kind, const session_isovalues *isovalues, const double *values,
                                  uint64_t *bits)
{
    double most = 0;
    for (int n = 0; n < kind->nodes.fine.count; n++) most = fmax(most, fabs(values[n]));
    const double tolerance = isovalues->tolerance + 1e-6 * most;
    const int *corners = kind->pieces.piece_positions;
    for (int piece = 0; piece < kind->pieces.piece_count; piece++, corners += kind->corner_count) {
        double low = values[corners[0]], high = low;
        for (int c = 1; c < kind->corner_count; c++) {
            const double value = values[corners[c]];
            low = value < low ? value : low;
            high = value > high ? value : high;
        }
        if (session_is_any_isovalue_between(isovalues, low - tolerance, high + tolerance)) set_bit(bits, piece);
    }
}

/* Selects the pieces of a refined cell that an isosurface or the plane of the request may cross. buffer: working memory
 * of find_buffer_size() doubles. */
static void select_crossed_pieces_of_cell(const piece_work *w, int64_t cell, int field_size, double *buffer)
{
    const piece_kind *kind = find_piece_kind_of_cell(w, cell);
    const session_interpolation *of = &kind->nodes;
    const int64_t first = session_find_first_entry_of_cell(&w->rows, cell);
    double corners[8][3], *own = buffer + field_size, *fine = own + of->of.count;
    for (int c = 0; c < grid_type_vertex_count(of->of.type); c++)
        grid_read_vertex_position(&w->rows.cells, session_row_vertex(&w->rows, first + of->corners[c]), corners[c]);
    session_read_request_values(&w->rows, w->request, cell, of->of.count, buffer, own);
    session_interpolate(of, (const double(*)[3])corners, 1, own, fine + of->fine.count, fine);
    select_crossed_pieces(kind, &w->request->isovalues, fine, w->set->bits + w->set->first_words[cell]);
}

static bool select_crossed_pieces_of_all_cells(const piece_work *w, int threads)
{
    const int64_t cells = w->rows.cells.cell_count, *first_words = w->set->first_words;
    const int field_size = w->request->values ? w->request->values->component_count : 1;
    const size_t buffer_size = find_buffer_size(w, field_size);
    bool is_lacking = false;
#pragma omp parallel num_threads(session_choose_loop_threads(threads, first_words[cells])) reduction(|| : is_lacking)
    {
        region_enter();
        double *buffer = base_alloc(buffer_size * sizeof *buffer);
        is_lacking = !buffer;
#pragma omp for schedule(dynamic, 16)
        for (int64_t cell = 0; cell < cells; cell++)
            if (buffer && first_words[cell] < first_words[cell + 1] && find_piece_kind_of_cell(w, cell)->corner_count)
                select_crossed_pieces_of_cell(w, cell, field_size, buffer);
        base_free(buffer);
        region_leave();
    }
    return !is_lacking;
}

insitu_status session_add_crossed_pieces(const session_mesh *mesh, const session_deviation_request *request, int parts,
                                         int threads, session_piece_set *set, base_error *error)
{
    piece_work *w = base_alloc(sizeof *w);
    bool is_made = w && create_piece_work(mesh, parts, request->is_lobatto, set, w);
    if (is_made) w->request = request;
    is_made = is_made && select_crossed_pieces_of_all_cells(w, threads);
    if (w) free_piece_work(w);
    base_free(w);
    return is_made ? INSITU_OK : fail_for_memory(mesh, error);
}

/* ---- pieces on outer faces --------------------------------------------------------------------------------------- */

/* Computes, for each node of the finer lattice, a bit mask of the faces on which the node lies; bit f stands for
 * session_shape.faces[f]. */
static void find_faces_of_nodes(const session_nodes *fine, unsigned char *out)
{
    const session_shape *shape = session_get_cell_shape(fine->type);
    for (int k = 0; k <= fine->order; k++)
        for (int j = 0; j <= fine->order; j++)
            for (int i = 0; i <= fine->order; i++)
                if (session_has_node(fine, i, j, k))
                    out[session_find_node_in_connectivity(fine, INSITU_ORDER_LEXICOGRAPHIC, i, j, k)] =
                        (unsigned char)session_faces_of_node(shape, fine->order, (const int[]){i, j, k});
}

/* Finds, for each face of a cell, the pieces that have a face on it, that is, at least three vertices on it. out: for
 * each face, kind->word_count words with one bit per piece. */
static void find_pieces_on_faces(const piece_kind *kind, const unsigned char *faces_of_nodes, uint64_t *out)
{
    const int *corners = kind->pieces.piece_positions;
    for (int piece = 0; piece < kind->pieces.piece_count; piece++, corners += kind->corner_count) {
        int counts[SHAPE_MOST_FACES] = {0};
        for (int c = 0; c < kind->corner_count; c++)
            for (int f = 0; f < SHAPE_MOST_FACES; f++) counts[f] += faces_of_nodes[corners[c]] >> f & 1;
        for (int f = 0; f < SHAPE_MOST_FACES; f++)
            if (counts[f] >= 3) set_bit(out + f * kind->word_count, piece);
    }
}

/* Returns, for each face of a cell, a set of the pieces that have a face on it: kind->word_count words with one bit per
 * piece. The array must be freed by base_free(); it is NULL if memory runs out. */
static uint64_t *list_pieces_on_faces(const piece_kind *kind)
{
    uint64_t *out = base_calloc(SHAPE_MOST_FACES * (size_t)kind->word_count, sizeof *out);
    unsigned char *faces_of_nodes = base_calloc((size_t)kind->nodes.fine.count, 1);
    const bool is_made = out && faces_of_nodes;
    if (is_made && kind->corner_count) {
        find_faces_of_nodes(&kind->nodes.fine, faces_of_nodes);
        find_pieces_on_faces(kind, faces_of_nodes, out);
    }
    base_free(faces_of_nodes);
    if (is_made) return out;
    base_free(out);
    return NULL;
}

static bool add_outer_pieces(const piece_work *w, const unsigned char *outer_faces)
{
    const int64_t cells = w->rows.cells.cell_count, *first_words = w->set->first_words;
    uint64_t *on_faces[ROWS_MOST_KINDS] = {NULL};
    bool is_made = true;
    for (int i = 0; i < w->rows.kind_count && is_made; i++)
        is_made = (on_faces[i] = list_pieces_on_faces(&w->kinds[i])) != NULL;
    for (int64_t cell = 0; cell < cells && is_made; cell++) {
        const int kind = session_find_kind_of_cell(&w->rows, cell), words = w->kinds[kind].word_count;
        if (first_words[cell] == first_words[cell + 1]) continue;
        for (unsigned left = outer_faces[cell]; left; left &= left - 1)
            for (int n = 0; n < words; n++)
                w->set->bits[first_words[cell] + n] |= on_faces[kind][__builtin_ctz(left) * words + n];
    }
    for (int i = 0; i < w->rows.kind_count; i++) base_free(on_faces[i]);
    return is_made;
}

insitu_status session_add_outer_pieces(const session_mesh *mesh, int parts, session_piece_set *set, base_error *error)
{
    piece_work *w = base_alloc(sizeof *w);
    const bool is_made =
        w && create_piece_work(mesh, parts, false, set, w) && add_outer_pieces(w, mesh->finer.outer_faces);
    if (w) free_piece_work(w);
    base_free(w);
    return is_made ? INSITU_OK : fail_for_memory(mesh, error);
}

bool session_is_same_piece_set(const session_piece_set *a, const session_piece_set *b, int64_t cell_count)
{
    if (!a->first_words || !b->first_words) return a->first_words == b->first_words;
    const size_t firsts = (size_t)(cell_count + 1) * sizeof *a->first_words;
    return memcmp(a->first_words, b->first_words, firsts) == 0 &&
           memcmp(a->bits, b->bits, (size_t)a->first_words[cell_count] * sizeof *a->bits) == 0;
}
