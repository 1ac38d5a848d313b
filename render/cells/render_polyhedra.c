/* Polyhedra taken apart.
 *
 * The caller's mesh says cells -> faces -> vertices. A ray wants the canonical triangles of the surface (each face a
 * fan from its smallest vertex), the unique edges, and the centre, which with the triangles spans the tets on which the
 * field is linear. All of this is made when a ray of a tile first meets the cell, and forgotten with the tile: no
 * copy of the mesh is kept. A polyhedron of v vertices has 2 v - 4 triangles and 3 v - 6 edges, and takes about 200 v
 * bytes here, some 6 KB for a Voronoi cell of 27 vertices; a store holds STORE_LIMIT of them at most (then it forgets
 * all, and begins again) and one cell more.
 *
 * Vertices are sorted by coordinates, triangles by their vertices, edges in the order in which the triangles have them:
 * another numbering of the mesh, another order of the faces or of a face's vertices give the same polyhedron, bit for
 * bit.
 *
 * The sign of a tet is that of its volume, its triangle turned outward. Faces are turned alike across the edges that
 * they share, piece by piece of the surface (more than one where a cell has a cavity); the sum of a piece's
 * volumes says which way is out, and a piece inside an odd number of others is turned over. */
#include "render_polyhedra.h"

#include <math.h>
#include <string.h>

#include "grid.h"
#include "memory.h"

enum { TABLE_BITS = 10, BLOCK_BYTES = 1 << 18, STORE_LIMIT = 16 << 20 };

typedef struct store_block {
    struct store_block *next;
    size_t size, used;
} store_block;

struct polyhedron_store {
    polyhedron *table[1 << TABLE_BITS];
    store_block *blocks;  /* the one in use first */
    store_block *unused;  /* of the usual size */
    size_t bytes;         /* in blocks */
    char *work, *scratch; /* for taking apart; for the kernels */
    size_t work_bytes, scratch_bytes;
};

polyhedron_store *polyhedra_create(void)
{
    return base_calloc(1, sizeof(polyhedron_store));
}

static void free_blocks(store_block *block)
{
    while (block) {
        store_block *next = block->next;
        base_free(block);
        block = next;
    }
}

void polyhedra_free(polyhedron_store *store)
{
    if (!store) return;
    free_blocks(store->blocks);
    free_blocks(store->unused);
    base_free(store->work);
    base_free(store->scratch);
    base_free(store);
}

void polyhedra_reset(polyhedron_store *store)
{
    if (!store->blocks) return;
    memset(store->table, 0, sizeof store->table);
    while (store->blocks) {
        store_block *block = store->blocks;
        store->blocks = block->next;
        if (block->size == BLOCK_BYTES) {
            block->next = store->unused;
            store->unused = block;
        } else {
            base_free(block);
        }
    }
    store->bytes = 0;
}

/* Takes memory in multiples of the strictest alignment. */
static size_t rounded(size_t bytes)
{
    return (bytes + 63) & ~(size_t)63;
}

static bool add_block(polyhedron_store *store, size_t bytes)
{
    const size_t head = rounded(sizeof(store_block));
    store_block *block = NULL;
    if (head + bytes <= BLOCK_BYTES && store->unused) {
        block = store->unused;
        store->unused = block->next;
    } else {
        const size_t size = head + bytes > BLOCK_BYTES ? head + bytes : BLOCK_BYTES;
        block = base_alloc(size);
        if (!block) return false;
        block->size = size;
    }
    block->used = head;
    block->next = store->blocks;
    store->blocks = block;
    store->bytes += block->size;
    return true;
}

static void *store_alloc(polyhedron_store *store, size_t bytes)
{
    bytes = rounded(bytes);
    if (!store->blocks || store->blocks->size - store->blocks->used < bytes)
        if (!add_block(store, bytes)) return NULL;
    char *p = (char *)store->blocks + store->blocks->used;
    store->blocks->used += bytes;
    return p;
}

static void *grown(char **buffer, size_t *held, size_t bytes)
{
    if (bytes <= *held) return *buffer;
    base_free(*buffer);
    *held = 0;
    *buffer = base_alloc(rounded(bytes + bytes / 2));
    if (*buffer) *held = bytes + bytes / 2;
    return *buffer;
}

void *polyhedra_scratch(polyhedron_store *store, size_t bytes)
{
    return grown(&store->scratch, &store->scratch_bytes, bytes);
}

/* ---- taking apart ---- */

typedef struct work_vertex {
    double position[3], value;
    int64_t vertex;
    int as_met; /* its number before sorting */
} work_vertex;

typedef struct work_facet {
    int vertex[3];
    int face;
    int turn; /* 1 where a, b, c run as the face's vertices do, else -1 */
    double volume;
} work_facet;

/* An edge of the faces: the sides that run along it. */
typedef struct work_edge {
    int low, high; /* vertices; low -1: no edge */
    int side[2];   /* entries; -1: none */
} work_edge;

/* Everything about one cell while it is taken apart. An entry is a vertex of a face; a side runs from an entry to the
 * face's next. */
typedef struct work {
    const grid *g;
    const grid_field *field;
    int face_count, entry_count, vertex_count, facet_count, edge_count, piece_count, table_size;
    int *face_first;           /* face_count + 1 */
    int *entry;                /* vertex as met, then sorted */
    int *face_of;              /* entry's face */
    int *edge_of;              /* side's place in edges */
    int *rank;                 /* of a vertex as met */
    int *piece, *turn, *stack; /* of faces: the connected piece, 1 or -1 */
    double *piece_volume;
    int64_t *seen; /* table_size: vertices met, by hash */
    int *seen_number;
    work_edge *edges; /* table_size, by hash */
    work_vertex *vertices;
    work_facet *facets;
} work;

static size_t hash_of(uint64_t a, uint64_t b)
{
    uint64_t h = (a * 0x9e3779b97f4a7c15u) ^ (b * 0xc2b2ae3d27d4eb4fu);
    h ^= h >> 29;
    return (size_t)((h * 0x9e3779b97f4a7c15u) >> 20);
}

static int vertex_compare(const work_vertex *a, const work_vertex *b)
{
    for (int axis = 0; axis < 3; axis++)
        if (a->position[axis] != b->position[axis]) return a->position[axis] < b->position[axis] ? -1 : 1;
    return a->value != b->value ? (a->value < b->value ? -1 : 1) : 0;
}

static int facet_compare(const work_facet *a, const work_facet *b)
{
    for (int i = 0; i < 3; i++)
        if (a->vertex[i] != b->vertex[i]) return a->vertex[i] < b->vertex[i] ? -1 : 1;
    return 0;
}

/* Shell's sort: short, and good for the hundred items of a usual cell. */
#define DEFINE_SORT(name, type, compare)                                                                               \
    static void name(type *items, int count)                                                                           \
    {                                                                                                                  \
        int gap = 1;                                                                                                   \
        while (gap < count / 3) gap = 3 * gap + 1;                                                                     \
        for (; gap > 0; gap /= 3)                                                                                      \
            for (int i = gap; i < count; i++) {                                                                        \
                const type item = items[i];                                                                            \
                int at = i;                                                                                            \
                for (; at >= gap && compare(&item, &items[at - gap]) < 0; at -= gap) items[at] = items[at - gap];      \
                items[at] = item;                                                                                      \
            }                                                                                                          \
    }
DEFINE_SORT(sort_vertices, work_vertex, vertex_compare)
DEFINE_SORT(sort_facets, work_facet, facet_compare)

static bool count_entries(work *w, int64_t cell)
{
    int64_t first, end, entries = 0;
    grid_cell_faces(w->g, cell, &first, &end);
    if (end - first > INT32_MAX / 64) return false;
    w->face_count = (int)(end - first);
    for (int64_t i = first; i < end; i++) {
        int64_t from, to;
        grid_face_vertices(w->g, grid_array_index(&w->g->connectivity, i), &from, &to);
        entries += to - from;
    }
    if (entries > INT32_MAX / 64) return false;
    w->entry_count = (int)entries;
    w->table_size = 16;
    while (w->table_size < 2 * w->entry_count) w->table_size *= 2;
    return true;
}

/* A buffer that is given out piece by piece; begin NULL: the pieces are only counted. */
typedef struct carving {
    char *begin;
    size_t used;
} carving;

static void *carve(carving *from, size_t bytes)
{
    void *p = from->begin ? from->begin + from->used : NULL;
    from->used += rounded(bytes);
    return p;
}

/* Room for the work; returns how much it is. */
static size_t lay_out(work *w, char *buffer)
{
    carving at = {buffer, 0};
    const size_t faces = (size_t)w->face_count, entries = (size_t)w->entry_count, table = (size_t)w->table_size;
    w->face_first = carve(&at, (faces + 1) * sizeof(int));
    w->entry = carve(&at, entries * sizeof(int));
    w->face_of = carve(&at, entries * sizeof(int));
    w->edge_of = carve(&at, entries * sizeof(int));
    w->rank = carve(&at, entries * sizeof(int));
    w->piece = carve(&at, faces * sizeof(int));
    w->turn = carve(&at, faces * sizeof(int));
    w->stack = carve(&at, faces * sizeof(int));
    w->piece_volume = carve(&at, faces * sizeof(double));
    w->seen = carve(&at, table * sizeof *w->seen);
    w->seen_number = carve(&at, table * sizeof(int));
    w->edges = carve(&at, 2 * table * sizeof *w->edges);
    w->vertices = carve(&at, entries * sizeof *w->vertices);
    w->facets = carve(&at, entries * sizeof *w->facets);
    return at.used;
}

static int number_vertex(work *w, int64_t vertex, int64_t cell)
{
    size_t at = hash_of((uint64_t)vertex, 1) & (size_t)(w->table_size - 1);
    while (w->seen[at] >= 0 && w->seen[at] != vertex) at = (at + 1) & (size_t)(w->table_size - 1);
    if (w->seen[at] == vertex) return w->seen_number[at];
    w->seen[at] = vertex;
    w->seen_number[at] = w->vertex_count;
    work_vertex *v = &w->vertices[w->vertex_count];
    grid_vertex(w->g, vertex, v->position);
    v->value = grid_field_value(w->field, w->field->is_cell_centred ? cell : vertex);
    v->vertex = vertex;
    v->as_met = w->vertex_count;
    return w->vertex_count++;
}

/* Without a vertex that stands beside itself: a quad is one however often its corners are said, as its other cell has
 * it, and a face all of whose entries are one vertex has none. */
static void read_faces(work *w, int64_t cell)
{
    int64_t first, end;
    int entry = 0;
    memset(w->seen, 0xff, (size_t)w->table_size * sizeof *w->seen);
    grid_cell_faces(w->g, cell, &first, &end);
    for (int face = 0; face < w->face_count; face++) {
        int64_t from, to;
        grid_face_vertices(w->g, grid_array_index(&w->g->connectivity, first + face), &from, &to);
        w->face_first[face] = entry;
        int64_t before = grid_array_index(&w->g->face_connectivity, to - 1);
        for (int64_t i = from; i < to; i++) {
            const int64_t vertex = grid_array_index(&w->g->face_connectivity, i);
            if (vertex == before) continue;
            w->face_of[entry] = face;
            w->entry[entry++] = number_vertex(w, vertex, cell);
            before = vertex;
        }
    }
    w->face_first[w->face_count] = w->entry_count = entry;
    sort_vertices(w->vertices, w->vertex_count);
    for (int i = 0; i < w->vertex_count; i++) w->rank[w->vertices[i].as_met] = i;
    for (int i = 0; i < entry; i++) w->entry[i] = w->rank[w->entry[i]];
}

static int side_end(const work *w, int side)
{
    const int face = w->face_of[side];
    return w->entry[side + 1 < w->face_first[face + 1] ? side + 1 : w->face_first[face]];
}

/* The edge's place in the table; a new one has no sides. */
static int find_edge(work_edge *edges, size_t size, int a, int b)
{
    const int low = a < b ? a : b, high = a < b ? b : a;
    size_t at = hash_of((uint64_t)low, (uint64_t)high) & (size - 1);
    while (edges[at].low >= 0 && (edges[at].low != low || edges[at].high != high)) at = (at + 1) & (size - 1);
    if (edges[at].low < 0) edges[at] = (work_edge){low, high, {-1, -1}};
    return (int)at;
}

static void empty_edges(work *w)
{
    for (int i = 0; i < 2 * w->table_size; i++) w->edges[i].low = -1;
}

/* Turn the faces that the stack leads to as the first one is. */
static void turn_piece(work *w, int first)
{
    int height = 0;
    w->stack[height++] = first;
    w->turn[first] = 1;
    w->piece[first] = w->piece_count;
    while (height) {
        const int face = w->stack[--height];
        for (int side = w->face_first[face]; side < w->face_first[face + 1]; side++) {
            const work_edge *edge = &w->edges[w->edge_of[side]];
            const int other = edge->side[0] == side ? edge->side[1] : edge->side[0];
            if (other < 0 || edge->low == edge->high || w->turn[w->face_of[other]]) continue;
            const bool alike = w->entry[side] == w->entry[other];
            w->turn[w->face_of[other]] = alike ? -w->turn[face] : w->turn[face];
            w->piece[w->face_of[other]] = w->piece_count;
            w->stack[height++] = w->face_of[other];
        }
    }
    w->piece_count++;
}

static void turn_faces(work *w)
{
    empty_edges(w);
    for (int side = 0; side < w->entry_count; side++) {
        const int at = find_edge(w->edges, 2 * (size_t)w->table_size, w->entry[side], side_end(w, side));
        work_edge *edge = &w->edges[at];
        w->edge_of[side] = at;
        if (edge->side[0] < 0)
            edge->side[0] = side;
        else if (edge->side[1] < 0)
            edge->side[1] = side;
    }
    memset(w->turn, 0, (size_t)w->face_count * sizeof(int));
    for (int face = 0; face < w->face_count; face++)
        if (!w->turn[face]) turn_piece(w, face);
}

static void swap_pair(work_facet *t, int i, int j)
{
    if (t->vertex[i] <= t->vertex[j]) return;
    const int v = t->vertex[i];
    t->vertex[i] = t->vertex[j];
    t->vertex[j] = v;
    t->turn = -t->turn;
}

/* The fan of a face. A triangle with two corners in one vertex bounds nothing. */
static void add_fan(work *w, int face)
{
    const int first = w->face_first[face], count = w->face_first[face + 1] - first;
    int least = 0;
    for (int i = 1; i < count; i++)
        if (w->entry[first + i] < w->entry[first + least]) least = i;
    for (int i = 1; i + 1 < count; i++) {
        work_facet t = {.face = face, .turn = w->turn[face]};
        for (int k = 0; k < 3; k++) t.vertex[k] = w->entry[first + (least + (k == 0 ? 0 : i + k - 1)) % count];
        swap_pair(&t, 0, 1);
        swap_pair(&t, 1, 2);
        swap_pair(&t, 0, 1);
        if (t.vertex[0] != t.vertex[1] && t.vertex[1] != t.vertex[2]) w->facets[w->facet_count++] = t;
    }
}

/* Six times the volume of the tet with the centre, by the order a, b, c. */
static double tet_volume(const double (*p)[3], const int *v, const double *centre)
{
    double d[3][3];
    for (int i = 0; i < 3; i++)
        for (int axis = 0; axis < 3; axis++) d[i][axis] = p[v[i]][axis] - centre[axis];
    return d[0][0] * (d[1][1] * d[2][2] - d[1][2] * d[2][1]) + d[0][1] * (d[1][2] * d[2][0] - d[1][0] * d[2][2]) +
           d[0][2] * (d[1][0] * d[2][1] - d[1][1] * d[2][0]);
}

/* Does the line from p towards lesser x cross the triangle? Level with a corner counts as above it, and where the
 * shadow is a line it does not cross. */
static bool crosses_below(const double *const t[3], const double *p)
{
    bool inside = false;
    for (int i = 0; i < 3; i++) {
        const double *a = t[i], *b = t[(i + 1) % 3];
        if ((a[2] > p[2]) == (b[2] > p[2])) continue;
        if (p[1] < a[1] + (p[2] - a[2]) / (b[2] - a[2]) * (b[1] - a[1])) inside = !inside;
    }
    if (!inside) return false;
    double d[2][3];
    for (int axis = 0; axis < 3; axis++) {
        d[0][axis] = t[1][axis] - t[0][axis];
        d[1][axis] = t[2][axis] - t[0][axis];
    }
    const double n[3] = {d[0][1] * d[1][2] - d[0][2] * d[1][1], d[0][2] * d[1][0] - d[0][0] * d[1][2],
                         d[0][0] * d[1][1] - d[0][1] * d[1][0]};
    if (n[0] == 0) return false;
    return t[0][0] - (n[1] * (p[1] - t[0][1]) + n[2] * (p[2] - t[0][2])) / n[0] < p[0];
}

/* Is the piece inside an odd number of others? Its smallest vertex has nothing of its own at lesser x. */
static bool is_cavity(const work *w, const double (*world)[3], int piece)
{
    int smallest = w->vertex_count;
    bool inside = false;
    for (int i = 0; i < w->facet_count; i++)
        if (w->piece[w->facets[i].face] == piece && w->facets[i].vertex[0] < smallest)
            smallest = w->facets[i].vertex[0];
    for (int i = 0; i < w->facet_count; i++) {
        const work_facet *t = &w->facets[i];
        const double *const corners[3] = {world[t->vertex[0]], world[t->vertex[1]], world[t->vertex[2]]};
        if (w->piece[t->face] != piece && crosses_below(corners, world[smallest])) inside = !inside;
    }
    return inside;
}

/* Each facet's volume, its piece turned outward. */
static void turn_outward(work *w, const double (*world)[3])
{
    for (int i = 0; i < w->piece_count; i++) w->piece_volume[i] = 0;
    for (int i = 0; i < w->facet_count; i++) {
        work_facet *t = &w->facets[i];
        t->volume = t->turn * tet_volume(world, t->vertex, world[w->vertex_count]);
        w->piece_volume[w->piece[t->face]] += t->volume;
    }
    for (int piece = 0; piece < w->piece_count; piece++) {
        const bool inward = w->piece_volume[piece] < 0;
        const bool turned = w->piece_count > 1 && is_cavity(w, world, piece);
        for (int i = 0; inward != turned && i < w->facet_count; i++)
            if (w->piece[w->facets[i].face] == piece) w->facets[i].volume = -w->facets[i].volume;
    }
}

/* ---- what is kept ---- */

static size_t lay_out_polyhedron(polyhedron *c, char *buffer, int quads)
{
    carving at = {buffer, 0};
    const size_t points = (size_t)c->vertex_count + 1;
    c->world = carve(&at, points * sizeof *c->world);
    c->values = carve(&at, points * sizeof *c->values);
    c->vertices = carve(&at, points * sizeof *c->vertices);
    float **const floats[5] = {&c->x, &c->y, &c->z, &c->f, &c->g};
    for (int i = 0; i < 5; i++) *floats[i] = carve(&at, points * sizeof(float));
    c->facets = carve(&at, (size_t)c->facet_count * sizeof *c->facets);
    c->edges = carve(&at, (size_t)c->facet_count * 3 * sizeof *c->edges);
    c->lines = carve(&at, ((size_t)c->facet_count * 3 + points) * sizeof *c->lines);
    c->quads = carve(&at, (size_t)quads * sizeof *c->quads);
    return at.used;
}

/* The mean of the vertices, summed in their order. */
static void keep_vertices(const work *w, int64_t cell, polyhedron *c)
{
    double sum[4] = {0, 0, 0, 0};
    c->is_finite = grid_has_own_value(w->field, cell);
    c->is_constant = true;
    for (int i = 0; i < c->vertex_count; i++) {
        const work_vertex *v = &w->vertices[i];
        memcpy(c->world[i], v->position, sizeof v->position);
        c->values[i] = v->value;
        c->vertices[i] = v->vertex;
        c->is_finite = c->is_finite && isfinite(v->value);
        c->is_constant = c->is_constant && v->value == w->vertices[0].value;
        for (int axis = 0; axis < 3; axis++) sum[axis] += v->position[axis];
        sum[3] += v->value / c->vertex_count;
    }
    for (int axis = 0; axis < 3; axis++) c->world[c->vertex_count][axis] = sum[axis] / c->vertex_count;
    c->values[c->vertex_count] = c->is_constant ? c->values[0] : sum[3];
}

static bool collapses(const work *w, const int *around)
{
    const double *corners[4];
    for (int i = 0; i < 4; i++) corners[i] = w->vertices[around[i]].position;
    return quad_collapses(corners);
}

static void keep_quads(const work *w, polyhedron *c, int *quad_of)
{
    int count = 0;
    for (int face = 0; face < w->face_count; face++) {
        const int first = w->face_first[face];
        const bool is_quad = w->face_first[face + 1] - first == 4 && !collapses(w, &w->entry[first]);
        quad_of[face] = is_quad ? count : -1;
        if (quad_of[face] >= 0) memcpy(c->quads[count++], &w->entry[first], 4 * sizeof(int));
    }
}

static void keep_facets(work *w, polyhedron *c)
{
    static const int ends[3][2] = {{0, 1}, {1, 2}, {0, 2}};
    int *quad_of = w->stack;
    keep_quads(w, c, quad_of);
    empty_edges(w);
    c->edge_count = 0;
    c->is_star = true;
    for (int i = 0; i < c->facet_count; i++) {
        const work_facet *from = &w->facets[i];
        polyhedron_facet *to = &c->facets[i];
        to->quad = quad_of[from->face];
        to->twin = -1;
        to->sign = from->volume > 0 ? 1 : from->volume < 0 ? -1 : 0;
        c->is_star = c->is_star && to->sign >= 0;
        for (int k = 0; k < 3; k++) {
            to->vertex[k] = from->vertex[k];
            const int a = from->vertex[ends[k][0]], b = from->vertex[ends[k][1]];
            work_edge *edge = &w->edges[find_edge(w->edges, 2 * (size_t)w->table_size, a, b)];
            if (edge->side[0] < 0) {
                c->edges[c->edge_count][0] = a;
                c->edges[c->edge_count][1] = b;
                edge->side[0] = c->edge_count++;
            }
            to->edge[k] = edge->side[0];
        }
    }
}

/* The halves of a quad have its smallest vertex, and so are near each other in the order. */
static void keep_twins(polyhedron *c)
{
    for (int i = 0; i < c->facet_count; i++)
        for (int j = i + 1; c->facets[i].quad >= 0 && c->facets[i].twin < 0 && j < c->facet_count; j++)
            if (c->facets[j].quad == c->facets[i].quad) c->facets[i].twin = j, c->facets[j].twin = i;
}

static polyhedron *keep(polyhedron_store *store, work *w, int64_t cell)
{
    polyhedron shape = {.vertex_count = w->vertex_count, .facet_count = w->facet_count};
    const size_t head = rounded(sizeof shape);
    char *block = store_alloc(store, head + lay_out_polyhedron(&shape, NULL, w->face_count));
    if (!block) return NULL;
    polyhedron *c = (polyhedron *)(void *)block;
    *c = shape;
    lay_out_polyhedron(c, block + head, w->face_count);
    keep_vertices(w, cell, c);
    turn_outward(w, (const double(*)[3])c->world);
    keep_facets(w, c);
    keep_twins(c);
    return c;
}

static polyhedron *take_apart(polyhedron_store *store, const grid *g, const grid_field *field, uint32_t index)
{
    work w = {.g = g, .field = field};
    if (!count_entries(&w, index)) return NULL;
    char *buffer = grown(&store->work, &store->work_bytes, lay_out(&w, NULL));
    if (!buffer) return NULL;
    lay_out(&w, buffer);
    read_faces(&w, index);
    turn_faces(&w);
    for (int face = 0; face < w.face_count; face++) add_fan(&w, face);
    sort_facets(w.facets, w.facet_count);
    return keep(store, &w, index);
}

polyhedron *polyhedra_find(polyhedron_store *store, const grid *g, const grid_field *field, int part, int layer,
                           uint32_t index)
{
    const uint32_t key = index + 0x85ebca6bu * (uint32_t)part + 0xc2b2ae35u * (uint32_t)layer;
    const uint32_t slot = (key * 0x9e3779b1u) >> (32 - TABLE_BITS);
    for (polyhedron *c = store->table[slot]; c; c = c->next)
        if (c->index == index && c->part == part && c->layer == layer) return c;
    if (store->bytes > STORE_LIMIT) polyhedra_reset(store);
    polyhedron *c = take_apart(store, g, field, index);
    if (!c) return NULL;
    c->index = index;
    c->part = part;
    c->layer = layer;
    c->next = store->table[slot];
    store->table[slot] = c;
    return c;
}
