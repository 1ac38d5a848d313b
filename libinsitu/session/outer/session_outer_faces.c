/* Finds outer faces in two passes over the cells.
 *
 * The first pass gives each face a hash that does not depend on the order of its vertices, and adds it by exclusive or
 * to a sum at each of the face's vertices. Two cells that share a face add the same hash, so that it cancels. A vertex
 * whose sum is 0 lies inside the mesh, and a face with such a vertex is not an outer face.
 *
 * The second pass collects the remaining faces, which are few, and counts faces with equal keys. A key consists of the
 * first three power sums of the hashes of the face's vertices. Memory is therefore needed for vertices and outer faces,
 * not for all faces.
 *
 * Cells of higher order are searched as the linear cells with the same corners (session_corner_cells.h). Each outer
 * face that is found is replaced by the faces of linear pieces that lie on it.
 *
 * Shells are faces that are always kept. A shell on a cell's outer face replaces it, so that only one is drawn there.
 *
 * A face that occurs once on a rank and lies in another rank's box is sent to its home rank (session_homes.h), which
 * counts it over all ranks. */
#include "session_outer_faces.h"

#include <omp.h>
#include <string.h>

#include "memory.h"
#include "region.h"
#include "session_agree.h"
#include "session_cell_faces.h"
#include "session_corner_cells.h"
#include "session_neighbours.h"
#include "session_rims.h"
#include "session_thresholds.h"

/* Maximum number of tables in which threads add up the hashes of the faces at each vertex, by exclusive or. If there
 * are more threads, several threads share a table. A table has one 64-bit word per vertex. */
enum { MOST_TABLES = 4 };

/* The data that the search stores for one part of the mesh. */
typedef struct part_cells {
    /* the cells that are searched: those of the mesh or, if the mesh is split into pieces, the linear cells with the
     * corners of the caller's cells (session_corner_cells.h) */
    const grid *grid;
    session_corner_cells corners;
    /* pieces first_pieces[i] to first_pieces[i + 1] - 1 of the mesh belong to the corner cell i; NULL: the mesh is not
     * split */
    const int64_t *first_pieces;
    session_rims rims; /* the faces on which the pieces' vertices lie, if the mesh is split */
    /* one byte per cell of the mesh, nonzero if the threshold does not select the cell; NULL: there is no
     * threshold */
    unsigned char *is_hidden;
    int64_t first_cell;   /* index of the part's first cell if the cells of all parts are numbered consecutively */
    int64_t first_vertex; /* index of the part's first vertex if the vertices of all parts are numbered consecutively */
    uint64_t *hashes;     /* hash of each vertex's position or global id */
    /* one byte per vertex, nonzero if the vertex's sum of hashes is not 0, so that an outer face may contain the
     * vertex */
    unsigned char *may_be_outer;
} part_cells;

/* A face that may be an outer face. */
typedef struct found_face {
    session_face face;
    int part; /* index of the part that has the face; -1: the face is not an outer face */
} found_face;

typedef struct face_search {
    const session_face_part *parts;
    int part_count;
    int threads;
    part_cells *cells;                /* the cells of each part, with the search's data about them */
    int64_t cell_count, vertex_count; /* numbers of cells and of vertices of all parts together */
    uint64_t *hashes; /* for each vertex of all parts, part by part, the hash of its position or global id */
    /* number of tables in vertex_sums: at most MOST_TABLES, so that several threads may share a table */
    int table_count;
    uint64_t *
        vertex_sums; /* table_count tables with one word per vertex: exclusive or of the hashes of the vertex's faces */
    /* array indexed by the lowest bits of a vertex's hash: exclusive or of the sums of all vertices with these bits.
     * Vertices at the same position have equal hashes and are thereby treated as one vertex. */
    uint64_t *hash_sums;
    /* mask of the lowest bits of a vertex's hash, which are its index in hash_sums */
    uint64_t mask;
    unsigned char *may_be_outer; /* one byte per vertex of all parts, nonzero if an outer face may contain the vertex */
    int64_t count;
    found_face *faces; /* faces that may be outer faces, sorted by part and cell */
    session_key *keys;
    int64_t *groups;      /* for each face, the index of its group; faces with equal keys are in one group */
    int64_t *group_sizes; /* number of faces in each group */
} face_search;

static void search_free(face_search *s)
{
    for (int i = 0; i < s->part_count && s->cells; i++) {
        session_corner_cells_free(&s->cells[i].corners);
        session_rims_free(&s->cells[i].rims);
        base_free(s->cells[i].is_hidden);
    }
    base_free(s->cells);
    base_free(s->hashes);
    base_free(s->vertex_sums);
    base_free(s->hash_sums);
    base_free(s->may_be_outer);
    base_free(s->faces);
    base_free(s->keys);
    base_free(s->groups);
    base_free(s->group_sizes);
}

/* Returns the number of vertices of the part. The number is 0 for a part without cells, because such a part may lack
 * vertex ids although all other parts have them. */
static int64_t count_part_vertices(const part_cells *p)
{
    return p->grid->cell_count ? p->grid->vertex_count : 0;
}

/* ---- keys by which equal faces are recognized -------------------------------------------------------------------- */

/* Returns whether the face's i-th vertex differs from all earlier vertices of the face. A repeated vertex is counted
 * once, so that a quad with two corners at the same position is a triangle. */
static inline bool is_first_occurrence(const part_cells *p, const session_face_loop *loop, int64_t i)
{
    const uint64_t hash = p->hashes[session_face_vertex(loop, i)];
    for (int64_t k = 0; k < i; k++)
        if (p->hashes[session_face_vertex(loop, k)] == hash) return false;
    return true;
}

/* Computes a face's key. Returns false if the face has fewer than three different vertices. */
static bool make_face_key(const part_cells *p, const session_face_loop *loop, session_key *key)
{
    uint64_t sums[3] = {0, 0, 0}, vertices = 0;
    for (int64_t i = 0; i < loop->size; i++) {
        const uint64_t h = p->hashes[session_face_vertex(loop, i)];
        if (!is_first_occurrence(p, loop, i)) continue;
        vertices++;
        sums[0] += h;
        sums[1] += h * h;
        sums[2] += h * h * h;
    }
    sums[0] ^= vertices * 0x9e3779b97f4a7c15u;
    memcpy(key->words, sums, sizeof key->words);
    return vertices >= 3;
}

/* ---- possible outer faces of this rank --------------------------------------------------------------------------- */

static bool is_cell_searched(const part_cells *p, int64_t cell)
{
    if (grid_is_ghost(p->grid, cell)) return false;
    return !p->is_hidden || !p->is_hidden[p->first_pieces ? p->first_pieces[cell] : cell];
}

/* Computes the key of a vertex of the searched cells. */
static session_key find_vertex_key(const face_search *s, int part, int64_t vertex, bool by_id)
{
    const int64_t *origins = s->cells[part].corners.origins;
    return session_vertex_key(s->parts[part].mesh, origins ? origins[vertex] : vertex, by_id);
}

static void hash_vertices(const face_search *s, bool by_id)
{
#pragma omp parallel num_threads(s->threads)
    {
        region_enter();
        for (int part = 0; part < s->part_count; part++) {
            const part_cells *p = &s->cells[part];
            const int64_t count = count_part_vertices(p);
#pragma omp for schedule(static) nowait
            for (int64_t v = 0; v < count; v++) {
                const session_key key = find_vertex_key(s, part, v, by_id);
                p->hashes[v] = session_key_hash(&key);
            }
        }
        region_leave();
    }
}

/* The table to which a thread adds the hashes of faces. */
typedef struct xor_table {
    const part_cells *part; /* the part whose faces are added */
    uint64_t *vertex_sums;  /* one sum for each of the part's vertices */
    bool is_shared;         /* set if other threads add to the table at the same time */
} xor_table;

static inline void xor_into_sum(uint64_t *sum, uint64_t hash, bool is_shared)
{
    if (!is_shared) {
        *sum ^= hash;
        return;
    }
#pragma omp atomic
    *sum ^= hash;
}

/* Adds the face's hash, by exclusive or, to the sums of its vertices. */
static void xor_hash_of_face(const xor_table *x, const session_face_loop *loop)
{
    const part_cells *p = x->part;
    uint64_t sum = 0;
    int64_t vertices = 0;
    for (int64_t i = 0; i < loop->size; i++) {
        if (!is_first_occurrence(p, loop, i)) continue;
        sum += p->hashes[session_face_vertex(loop, i)];
        vertices++;
    }
    if (vertices < 3) return;
    for (int64_t i = 0; i < loop->size; i++)
        if (is_first_occurrence(p, loop, i))
            xor_into_sum(&x->vertex_sums[session_face_vertex(loop, i)], session_mix_bits(sum), x->is_shared);
}

/* Adds the hashes of the faces of a cell whose type has a table of faces, as xor_hashes_of_cell_faces() does. If two
 * vertices of the cell have the same hash, its faces have fewer vertices than in the table; then nothing is added and
 * false is returned. */
static inline bool xor_hashes_of_table_faces(const xor_table *x, const session_face_table *table,
                                             const int64_t *vertices, int count)
{
    uint64_t hashes[GRID_MAX_CELL_VERTICES], sums[GRID_MAX_CELL_VERTICES] = {0};
    bool has_twins = false;
    for (int i = 0; i < count; i++) {
        hashes[i] = x->part->hashes[vertices[i]];
        for (int k = 0; k < i; k++) has_twins |= hashes[k] == hashes[i];
    }
    if (has_twins) return false;
    for (int f = 0; f < table->count; f++) {
        const signed char *corners = table->vertices[f];
        const bool is_quad = corners[3] >= 0;
        const uint64_t sum = hashes[(int)corners[0]] + hashes[(int)corners[1]] + hashes[(int)corners[2]];
        const uint64_t hash = session_mix_bits(is_quad ? sum + hashes[(int)corners[3]] : sum);
        for (int i = 0; i < 3; i++) sums[(int)corners[i]] ^= hash;
        if (is_quad) sums[(int)corners[3]] ^= hash;
    }
    for (int i = 0; i < count; i++) xor_into_sum(&x->vertex_sums[vertices[i]], sums[i], x->is_shared);
    return true;
}

/* Adds, by exclusive or, the hash of each of the cell's faces to the sums of the face's vertices. */
static void xor_hashes_of_cell_faces(const xor_table *x, int64_t cell)
{
    const grid *g = x->part->grid;
    const int type = grid_cell_type(g, cell);
    const session_face_table *table = session_faces_of_type(type);
    if (!is_cell_searched(x->part, cell)) return;
    if (table->count) {
        int64_t vertices[GRID_MAX_CELL_VERTICES];
        const int count = grid_cell_vertices(g, cell, vertices);
        /* the arguments for tets are constants, so that the compiler unrolls all loops of the function */
        const bool is_tet = type == GRID_TET;
        if (is_tet ? xor_hashes_of_table_faces(x, session_faces_of_type(GRID_TET), vertices, 4)
                   : xor_hashes_of_table_faces(x, table, vertices, count))
            return;
    }
    const session_cell_faces faces = session_faces_of_cell(g, cell);
    for (int64_t f = 0; f < faces.count; f++) {
        const session_face_loop loop = session_find_face_loop(&faces, f);
        xor_hash_of_face(x, &loop);
    }
}

/* Adds the sums of a vertex, in all tables, to the element of hash_sums that belongs to the vertex's hash. vertex:
 * index of the vertex, where the vertices of all parts are counted one after the other. */
static void combine_sums_of_vertex(const face_search *s, int64_t vertex)
{
    uint64_t sum = 0;
    for (int i = 0; i < s->table_count; i++) sum ^= s->vertex_sums[i * s->vertex_count + vertex];
    xor_into_sum(&s->hash_sums[s->hashes[vertex] & s->mask], sum, s->threads > 1);
}

/* Computes the sums of the hashes of each vertex's faces, and marks the vertices whose sum is not 0. */
static void mark_possible_outer_vertices(const face_search *s)
{
#pragma omp parallel num_threads(s->threads)
    {
        region_enter();
        uint64_t *table = s->vertex_sums + omp_get_thread_num() % s->table_count * s->vertex_count;
        for (int part = 0; part < s->part_count; part++) {
            const part_cells *p = &s->cells[part];
            const xor_table x = {p, table + p->first_vertex, omp_get_num_threads() > s->table_count};
#pragma omp for schedule(static) nowait
            for (int64_t cell = 0; cell < p->grid->cell_count; cell++) xor_hashes_of_cell_faces(&x, cell);
        }
#pragma omp barrier
#pragma omp for schedule(static)
        for (int64_t v = 0; v < s->vertex_count; v++) combine_sums_of_vertex(s, v);
#pragma omp for schedule(static) nowait
        for (int64_t v = 0; v < s->vertex_count; v++) s->may_be_outer[v] = s->hash_sums[s->hashes[v] & s->mask] != 0;
        region_leave();
    }
}

/* A growing list of faces that may be outer faces, with the key of each face. */
typedef struct face_list {
    int64_t count, capacity;
    found_face *faces;
    session_key *keys;
    bool is_out_of_memory; /* set once memory has run out; the list then lacks faces, even if there is memory again */
} face_list;

static void face_list_free(face_list *list)
{
    base_free(list->faces);
    base_free(list->keys);
}

static bool face_list_reserve(face_list *list)
{
    if (list->count < list->capacity || list->is_out_of_memory) return !list->is_out_of_memory;
    const int64_t capacity = list->capacity * 2 + 1024;
    found_face *faces = base_realloc(list->faces, (size_t)capacity * sizeof *faces);
    if (faces) list->faces = faces;
    session_key *keys = base_realloc(list->keys, (size_t)capacity * sizeof *keys);
    if (keys) list->keys = keys;
    list->is_out_of_memory = !faces || !keys;
    if (!list->is_out_of_memory) list->capacity = capacity;
    return !list->is_out_of_memory;
}

static bool may_be_outer_face(const part_cells *p, const session_face_loop *loop)
{
    for (int64_t i = 0; i < loop->size; i++)
        if (!p->may_be_outer[session_face_vertex(loop, i)]) return false;
    return true;
}

/* Returns whether the cell may have an outer face: at least three of its vertices have the flag may_be_outer, or its
 * type has no table of faces. */
static bool may_have_outer_face(const part_cells *p, int64_t cell)
{
    const grid *g = p->grid;
    int64_t vertices[GRID_MAX_CELL_VERTICES];
    int open = 0;
    if (!session_faces_of_type(grid_cell_type(g, cell))->count) return true;
    const int count = grid_cell_vertices(g, cell, vertices);
    for (int i = 0; i < count; i++) open += p->may_be_outer[vertices[i]];
    return open >= 3;
}

/* Appends to the list the faces of a cell that may be outer faces: a shell, or faces all of whose vertices have the
 * flag may_be_outer. */
static void append_possible_outer_faces(const face_search *s, int part, int64_t cell, face_list *out)
{
    const part_cells *p = &s->cells[part];
    if (!is_cell_searched(p, cell) || !may_have_outer_face(p, cell)) return;
    const session_cell_faces of_cell = session_faces_of_cell(p->grid, cell);
    for (int64_t f = 0; f < of_cell.count; f++) {
        const session_face_loop loop = session_find_face_loop(&of_cell, f);
        session_key key;
        if (!(of_cell.size || may_be_outer_face(p, &loop)) || !make_face_key(p, &loop, &key)) continue;
        if (!face_list_reserve(out)) return;
        out->faces[out->count] = (found_face){{cell, f}, part};
        out->keys[out->count++] = key;
    }
}

/* Appends to the list the possible outer faces of the cells first .. end - 1. Cell indices count the cells of all
 * parts, part after part. */
static void append_faces_of_cells(const face_search *s, int64_t first, int64_t end, face_list *out)
{
    for (int part = 0; part < s->part_count; part++) {
        const part_cells *p = &s->cells[part];
        const int64_t from = first - p->first_cell, to = end - p->first_cell;
        for (int64_t cell = from > 0 ? from : 0; cell < to && cell < p->grid->cell_count; cell++)
            append_possible_outer_faces(s, part, cell, out);
    }
}

/* Concatenates the lists of all threads. Returns false if memory runs out. */
static bool join_lists(face_search *s, const face_list *lists, int count)
{
    int64_t total = 0;
    for (int i = 0; i < count; i++) {
        if (lists[i].is_out_of_memory) return false;
        total += lists[i].count;
    }
    s->faces = base_alloc((size_t)total * sizeof *s->faces);
    s->keys = base_alloc((size_t)total * sizeof *s->keys);
    if (!s->faces || !s->keys) return false;
    for (int i = 0; i < count; i++) {
        if (lists[i].count == 0) continue;
        memcpy(s->faces + s->count, lists[i].faces, (size_t)lists[i].count * sizeof *s->faces);
        memcpy(s->keys + s->count, lists[i].keys, (size_t)lists[i].count * sizeof *s->keys);
        s->count += lists[i].count;
    }
    return true;
}

static bool collect_faces(face_search *s)
{
    const int shares = s->threads;
    face_list *lists = base_calloc((size_t)shares, sizeof *lists);
    if (!lists) return false;
#pragma omp parallel num_threads(s->threads)
    {
        region_enter();
#pragma omp for schedule(static, 1) nowait
        for (int i = 0; i < shares; i++)
            append_faces_of_cells(s, s->cell_count * i / shares, s->cell_count * (i + 1) / shares, &lists[i]);
        region_leave();
    }
    const bool is_done = join_lists(s, lists, shares);
    for (int i = 0; i < shares; i++) face_list_free(&lists[i]);
    base_free(lists);
    return is_done;
}

/* Groups equal keys: (*groups)[i] receives the group of key i, and (*sizes)[g] the number of keys in group g. Returns
 * false if memory runs out. */
static bool group_equal_keys(const session_key *keys, int64_t count, int64_t **groups, int64_t **sizes)
{
    session_key_table table = {0};
    *groups = base_alloc((size_t)count * sizeof **groups);
    *sizes = base_calloc((size_t)count, sizeof **sizes);
    if (!*groups || !*sizes || !session_keys_create(&table, count)) return false;
    for (int64_t i = 0; i < count; i++) {
        (*groups)[i] = session_keys_add(&table, &keys[i]);
        (*sizes)[(*groups)[i]]++;
    }
    session_keys_free(&table);
    return true;
}

static bool is_shell(const face_search *s, const found_face *face)
{
    return grid_is_shell_type(grid_cell_type(s->cells[face->part].grid, face->face.cell));
}

/* Removes the faces whose key occurs several times on this rank, except shells. */
static void keep_single_faces(face_search *s)
{
    int64_t kept = 0;
    for (int64_t i = 0; i < s->count; i++) {
        if (s->group_sizes[s->groups[i]] != 1 && !is_shell(s, &s->faces[i])) continue;
        s->faces[kept] = s->faces[i];
        s->keys[kept++] = s->keys[i];
    }
    s->count = kept;
}

/* Allocates the arrays of the search that have one entry per vertex, and assigns each part its section of them. Returns
 * false if memory runs out. */
static bool allocate_search_arrays(face_search *s)
{
    uint64_t slots = 1;
    while (slots < (uint64_t)s->vertex_count) slots *= 2;
    s->mask = slots - 1;
    s->hashes = base_alloc((size_t)s->vertex_count * sizeof *s->hashes);
    s->table_count = s->threads < MOST_TABLES ? s->threads : MOST_TABLES;
    s->vertex_sums = base_calloc((size_t)(s->vertex_count * s->table_count), sizeof *s->vertex_sums);
    s->hash_sums = base_calloc(slots, sizeof *s->hash_sums);
    s->may_be_outer = base_alloc((size_t)s->vertex_count);
    if (!s->hashes || !s->vertex_sums || !s->hash_sums || !s->may_be_outer) return false;
    for (int part = 0; part < s->part_count; part++) {
        part_cells *p = &s->cells[part];
        p->hashes = s->hashes + p->first_vertex;
        p->may_be_outer = s->may_be_outer + p->first_vertex;
    }
    return true;
}

/* If the mesh's cells are split into pieces, makes the search of part *p read the corner cells (linear cells with the
 * same corners) instead of the pieces. Otherwise does nothing. Returns false if memory runs out. */
static bool create_corner_cells_of_part(const session_mesh *mesh, part_cells *p)
{
    if (!mesh->topology.is_split) return true;
    p->grid = &p->corners.cells;
    p->first_pieces = mesh->topology.first_pieces;
    return session_corner_cells_create(mesh, &p->corners) && session_rims_create(mesh, &p->rims);
}

/* Gives the cells and vertices of all parts consecutive indices, part after part, and finds the cells that thresholds
 * do not select. Returns false if memory runs out. */
static bool number_parts(face_search *s)
{
    s->cells = base_calloc((size_t)s->part_count + 1, sizeof *s->cells);
    if (!s->cells) return false;
    for (int part = 0; part < s->part_count; part++) {
        const session_face_part *of = &s->parts[part];
        part_cells *p = &s->cells[part];
        *p = (part_cells){.grid = &of->mesh->cells, .first_cell = s->cell_count, .first_vertex = s->vertex_count};
        if (!create_corner_cells_of_part(of->mesh, p)) return false;
        s->cell_count += p->grid->cell_count;
        s->vertex_count += count_part_vertices(p);
        if (!of->outer || !of->outer->threshold.is_given) continue;
        p->is_hidden = session_find_hidden_cells(of->mesh, &of->outer->threshold, s->threads);
        if (!p->is_hidden) return false;
    }
    return true;
}

static insitu_status search_own_faces(face_search *s, bool by_id, base_error *error)
{
    bool is_done = number_parts(s);
    if (is_done && s->cell_count == 0) return INSITU_OK;
    is_done = is_done && allocate_search_arrays(s);
    if (is_done) {
        hash_vertices(s, by_id);
        mark_possible_outer_vertices(s);
    }
    is_done = is_done && collect_faces(s) && group_equal_keys(s->keys, s->count, &s->groups, &s->group_sizes);
    if (!is_done)
        return session_fail_for_memory(error, s->vertex_count * (9 + 8 * s->table_count) + (int64_t)(s->mask + 1) * 8,
                                       "outer faces");
    keep_single_faces(s);
    return INSITU_OK;
}

/* ---- faces of several ranks ---------------------------------------------------------------------------------- */

enum { KEY_WORDS = 3 };

/* Returns the home rank of a face, which counts how often the face occurs on all ranks; -1 if only this rank can have
 * it, because some vertex of the face lies in no other rank's box. The home rank is that of the vertex with the least
 * hash, which is the same vertex on all ranks. */
static int find_home_rank_of_face(const face_search *s, const session_homes *homes, int64_t number)
{
    const found_face *face = &s->faces[number];
    const part_cells *p = &s->cells[face->part];
    const session_cell_faces faces = session_faces_of_cell(p->grid, face->face.cell);
    const session_face_loop loop = session_find_face_loop(&faces, face->face.face);
    int64_t first = session_face_vertex(&loop, 0);
    double point[1][3];
    for (int64_t i = 0; i < loop.size; i++) {
        const int64_t vertex = session_face_vertex(&loop, i);
        grid_read_vertex_position(p->grid, vertex, point[0]);
        if (!session_is_in_other_box(homes, point[0])) return -1;
        if (p->hashes[vertex] < p->hashes[first]) first = vertex;
    }
    grid_read_vertex_position(p->grid, first, point[0]);
    const session_key key = find_vertex_key(s, face->part, first, homes->by_id);
    return session_find_home_rank(homes, (const double(*)[3])point, 1, session_key_hash(&s->keys[number]),
                                  (int64_t)key.words[0]);
}

/* Packs the keys of the faces that other ranks may have too, sorted by the faces' home ranks. *order receives the face
 * of each key. Returns false if memory runs out. */
static bool pack_keys(const face_search *s, const session_homes *homes, int ranks, session_mail *mail, int64_t **order)
{
    int64_t *next = base_calloc((size_t)ranks + 1, sizeof *next);
    int *home = base_alloc((size_t)(s->count + 1) * sizeof *home);
    mail->counts = base_calloc((size_t)ranks, sizeof *mail->counts);
    bool is_done = next && home && mail->counts;
    for (int64_t i = 0; i < s->count && is_done; i++) {
        home[i] = find_home_rank_of_face(s, homes, i);
        if (home[i] >= 0) next[home[i] + 1]++;
    }
    for (int rank = 0; rank < ranks && is_done; rank++) {
        mail->counts[rank] = KEY_WORDS * next[rank + 1];
        mail->total += mail->counts[rank];
        next[rank + 1] += next[rank];
    }
    mail->words = base_alloc((size_t)mail->total * sizeof *mail->words);
    *order = base_alloc((size_t)mail->total * sizeof **order);
    is_done = is_done && mail->words && *order;
    for (int64_t i = 0; i < s->count && is_done; i++) {
        if (home[i] < 0) continue;
        const int64_t index = next[home[i]]++;
        memcpy(mail->words + KEY_WORDS * index, s->keys[i].words, KEY_WORDS * sizeof *mail->words);
        (*order)[index] = i;
    }
    base_free(next);
    base_free(home);
    return is_done;
}

/* Computes the reply to each received key: the number of times that the key was received. Returns false if memory runs
 * out. */
static bool count_received_keys(const session_mail *in, int ranks, session_mail *reply)
{
    const int64_t count = in->total / KEY_WORDS;
    int64_t *groups = NULL, *sizes = NULL;
    reply->counts = base_calloc((size_t)ranks, sizeof *reply->counts);
    reply->words = base_alloc((size_t)count * sizeof *reply->words);
    session_key *keys = base_alloc((size_t)count * sizeof *keys);
    bool is_done = reply->counts && reply->words && keys;
    for (int64_t i = 0; i < count && is_done; i++)
        memcpy(keys[i].words, in->words + KEY_WORDS * i, sizeof keys[i].words);
    is_done = is_done && group_equal_keys(keys, count, &groups, &sizes);
    for (int64_t i = 0; i < count && is_done; i++) reply->words[i] = (uint64_t)sizes[groups[i]];
    for (int rank = 0; rank < ranks && is_done; rank++) reply->counts[rank] = in->counts[rank] / KEY_WORDS;
    reply->total = count;
    base_free(groups);
    base_free(sizes);
    base_free(keys);
    return is_done;
}

/* Removes the faces that other ranks have too, except shells. answers: for each key that this rank has sent, the number
 * of times that its home rank received it. order: the face of each of these keys. */
static void drop_shared_faces(face_search *s, const session_mail *answers, const int64_t *order)
{
    int64_t kept = 0;
    for (int64_t i = 0; i < answers->total; i++)
        if (answers->words[i] > 1 && !is_shell(s, &s->faces[order[i]])) s->faces[order[i]].part = -1;
    for (int64_t i = 0; i < s->count; i++)
        if (s->faces[i].part >= 0) s->faces[kept++] = s->faces[i];
    s->count = kept;
}

static insitu_status exchange_keys(face_search *s, const session_mail *mail, const int64_t *order,
                                   const session_team *team, base_error *error)
{
    session_mail in = {0}, reply = {0}, answers = {0};
    insitu_status status = session_mail_deliver(team->comm, SESSION_MAIL_THERE, mail, &in, error);
    if (status) return status;
    if (!error->status && !count_received_keys(&in, team->ranks, &reply))
        session_fail_for_memory(error, in.total * 24, "faces that ranks share");
    status = session_mail_deliver(team->comm, SESSION_MAIL_BACK, &reply, &answers, error);
    if (!status) status = session_agree(team->comm, error);
    if (!status) drop_shared_faces(s, &answers, order);
    session_mail_free(&in);
    session_mail_free(&reply);
    session_mail_free(&answers);
    return status;
}

static insitu_status search_shared_faces(face_search *s, const session_homes *homes, const session_team *team,
                                         base_error *error)
{
    session_mail mail = {0};
    int64_t *order = NULL;
    if (!error->status && !pack_keys(s, homes, team->ranks, &mail, &order))
        session_fail_for_memory(error, s->count * 40, "faces that ranks share");
    const insitu_status status = exchange_keys(s, &mail, order, team, error);
    session_mail_free(&mail);
    base_free(order);
    return status;
}

/* ---- storing the outer faces ------------------------------------------------------------------------------------- */

/* Iterator over the faces of the mesh's cells that lie on an outer face which the search has found: the outer face
 * itself or, if the mesh is split into linear pieces, the faces of pieces on it. */
typedef struct face_walk {
    const session_mesh *mesh;
    part_cells *part;
    session_face of; /* the found face */
    session_face next;
} face_walk;

static face_walk walk_faces(const face_search *s, const found_face *found)
{
    part_cells *p = &s->cells[found->part];
    const session_face first = {p->first_pieces ? p->first_pieces[found->face.cell] : found->face.cell, 0};
    return (face_walk){s->parts[found->part].mesh, p, found->face, p->first_pieces ? first : found->face};
}

static bool is_on_found_face(const face_walk *walk, const session_face_loop *loop)
{
    int64_t vertices[4];
    for (int64_t i = 0; i < loop->size; i++) vertices[i] = session_face_vertex(loop, i);
    return session_find_faces_with_vertices(&walk->part->rims, walk->of.cell, vertices, loop->size) >> walk->of.face &
           1;
}

/* Stores the next face. Returns false if there are no more. */
static bool next_face(face_walk *walk, session_face *out)
{
    const int64_t *first_pieces = walk->part->first_pieces;
    const int64_t end = first_pieces ? first_pieces[walk->of.cell + 1] : walk->of.cell + 1;
    while (walk->next.cell < end) {
        const session_cell_faces faces = session_faces_of_cell(&walk->mesh->cells, walk->next.cell);
        *out = walk->next;
        if (!first_pieces) {
            walk->next.cell++;
            return true;
        }
        for (; walk->next.face < faces.count; walk->next.face++) {
            const session_face_loop loop = session_find_face_loop(&faces, walk->next.face);
            *out = walk->next;
            if (!is_on_found_face(walk, &loop)) continue;
            walk->next.face++;
            return true;
        }
        walk->next = (session_face){walk->next.cell + 1, 0};
    }
    return false;
}

static void mark_borders(const face_search *s)
{
    for (int64_t i = 0; i < s->count; i++) {
        unsigned char *is_border = s->parts[s->faces[i].part].is_border;
        if (!is_border) continue;
        face_walk walk = walk_faces(s, &s->faces[i]);
        for (session_face face; next_face(&walk, &face);) {
            const session_cell_faces faces = session_faces_of_cell(&walk.mesh->cells, face.cell);
            const session_face_loop loop = session_find_face_loop(&faces, face.face);
            for (int64_t k = 0; k < loop.size; k++) is_border[session_face_vertex(&loop, k)] = 1;
        }
    }
}

/* Appends to the list of outer faces those faces of the mesh's cells that lie on the face `found`. Returns false if
 * memory runs out. */
static bool append_faces(const face_search *s, const found_face *found, int64_t *capacity, session_outer *outer)
{
    face_walk walk = walk_faces(s, found);
    for (session_face face; next_face(&walk, &face);) {
        if (outer->face_count == *capacity) {
            const int64_t more = 2 * *capacity + 64;
            session_face *faces = base_realloc(outer->faces, (size_t)more * sizeof *faces);
            if (!faces) return false;
            outer->faces = faces;
            *capacity = more;
        }
        outer->faces[outer->face_count++] = face;
    }
    return true;
}

/* Stores the found faces with the indices first .. end - 1, all of which belong to one part, in that part's list of
 * outer faces. */
static void store_part_faces(const face_search *s, int64_t first, int64_t end, session_outer *outer, base_error *error)
{
    int64_t capacity = end - first + 1;
    session_drop_outer_surface(outer, true);
    outer->faces = base_alloc((size_t)capacity * sizeof *outer->faces);
    bool is_made = outer->faces;
    for (int64_t i = first; i < end && is_made; i++) is_made = append_faces(s, &s->faces[i], &capacity, outer);
    outer->are_faces_known = is_made;
    if (is_made) return;
    session_drop_outer_surface(outer, true);
    session_fail_for_memory(error, capacity * (int64_t)sizeof *outer->faces, "outer faces");
}

/* Stores the outer faces in the parts to which they belong. */
static void store_outer_faces(const face_search *s, base_error *error)
{
    int64_t at = 0;
    for (int part = 0; part < s->part_count; part++) {
        const session_face_part *to = &s->parts[part];
        int64_t end = at;
        while (end < s->count && s->faces[end].part == part) end++;
        if (to->outer) store_part_faces(s, at, end, to->outer, error);
        for (int64_t i = at; i < end && to->masks; i++)
            to->masks[s->faces[i].face.cell] |= (unsigned char)(1U << s->faces[i].face.face);
        at = end;
    }
}

insitu_status session_find_outer_faces(const session_face_part *parts, int count, const session_homes *homes,
                                       const session_team *team, base_error *error)
{
    face_search search = {.parts = parts, .part_count = count, .threads = team->threads};
    search_own_faces(&search, homes->by_id, error);
    if (!error->status) mark_borders(&search);
    const insitu_status status =
        team->ranks > 1 ? search_shared_faces(&search, homes, team, error) : session_agree(team->comm, error);
    if (!status) store_outer_faces(&search, error);
    search_free(&search);
    return status;
}
