/* Decomposes polyhedra.
 *
 * The caller's mesh is a list of faces per cell and of vertices per face. To intersect rays with a cell, the kernels
 * need the triangles of its surface (each face is cut into triangles as polygon.h defines), its edges, each once, and
 * its centre, which forms with each triangle a tet on which the field is linear. All of this is computed when a ray of
 * a tile first meets the cell, and deleted with the tile: no copy of the mesh is kept. A polyhedron of v vertices has 2
 * v - 4 triangles and 3 v - 6 edges, and takes about 200 v bytes here, about 6 KB for a Voronoi cell of 27 vertices.
 * When a thread's store is full, all of its polyhedra are removed, and its memory is enlarged, unless twice its size
 * would be STORE_LIMIT bytes or more. If a single polyhedron needs more memory, that much is allocated.
 *
 * Vertices are sorted by coordinates, triangles by their vertices, and edges are stored in the order in which the
 * triangles first use them. So the polyhedron is bit-identical for any numbering of the mesh and any order of faces or
 * of a face's vertices.
 *
 * The sign of a tet is that of its volume, with its triangle oriented outward (closed_faces.h). */
#include "render_polyhedra.h"

#include <math.h>
#include <string.h>

#include "closed_faces.h"
#include "grid.h"
#include "memory.h"

enum { TABLE_BITS = 10, STORE_BYTES = 1 << 18, STORE_LIMIT = 16 << 20 };

struct polyhedron_store {
    polyhedron *table[1 << TABLE_BITS];
    char *memory; /* the polyhedra, one after the other */
    size_t memory_bytes, used;
    char *work, *scratch; /* buffers for the temporary arrays of decompose_polyhedron() and for those of the kernels */
    size_t work_bytes, scratch_bytes;
};

polyhedron_store *polyhedra_create(void)
{
    return base_calloc(1, sizeof(polyhedron_store));
}

void polyhedra_free(polyhedron_store *store)
{
    if (!store) return;
    base_free(store->memory);
    base_free(store->work);
    base_free(store->scratch);
    base_free(store);
}

void polyhedra_reset(polyhedron_store *store)
{
    if (store->used) memset(store->table, 0, sizeof store->table);
    store->used = 0;
}

/* Rounds the size up to a multiple of 64 bytes, the strictest alignment. */
static size_t rounded(size_t bytes)
{
    return (bytes + 63) & ~(size_t)63;
}

static void *replace_buffer(char **buffer, size_t *held, size_t bytes)
{
    base_free(*buffer);
    *buffer = base_alloc(rounded(bytes));
    *held = *buffer ? bytes : 0;
    return *buffer;
}

/* Makes the buffer hold at least `bytes` bytes. Its contents are lost if it is enlarged, which adds half of `bytes`, so
 * that it is seldom enlarged. */
static void *ensure_buffer_size(char **buffer, size_t *held, size_t bytes)
{
    return bytes <= *held ? *buffer : replace_buffer(buffer, held, bytes + bytes / 2);
}

void *polyhedra_scratch(polyhedron_store *store, size_t bytes)
{
    return ensure_buffer_size(&store->scratch, &store->scratch_bytes, bytes);
}

/* Returns memory for a polyhedron. If there is no space, all other polyhedra are removed from the store. */
static void *store_alloc(polyhedron_store *store, size_t bytes)
{
    bytes = rounded(bytes);
    if (store->memory_bytes - store->used < bytes) {
        const size_t twice = store->memory_bytes ? 2 * store->memory_bytes : STORE_BYTES;
        const size_t wanted = twice < STORE_LIMIT ? twice : store->memory_bytes;
        const size_t needed = wanted > bytes ? wanted : bytes;
        polyhedra_reset(store);
        if (needed > store->memory_bytes && !replace_buffer(&store->memory, &store->memory_bytes, needed)) return NULL;
    }
    store->used += bytes;
    return store->memory + store->used - bytes;
}

/* ---- decomposing a cell ---- */

typedef struct work_vertex {
    double position[3], value;
    int64_t vertex;
    int input_index; /* index of the vertex before sorting */
} work_vertex;

/* Temporary data of one cell while it is decomposed. */
typedef struct work {
    const grid *g;
    const grid_field *field;
    closed_faces faces;
    int *rank; /* rank of each vertex in the order of coordinates, by the index that the vertex has before sorting */
    double (*positions)[3];
    work_vertex *vertices;
} work;

static int vertex_compare(const work_vertex *a, const work_vertex *b)
{
    for (int axis = 0; axis < 3; axis++)
        if (a->position[axis] != b->position[axis]) return a->position[axis] < b->position[axis] ? -1 : 1;
    return a->value != b->value ? (a->value < b->value ? -1 : 1) : 0;
}

static int facet_compare(const closed_triangle *a, const closed_triangle *b)
{
    for (int i = 0; i < 3; i++)
        if (a->vertex[i] != b->vertex[i]) return a->vertex[i] < b->vertex[i] ? -1 : 1;
    return 0;
}

/* Defines a Shell sort, which is short, and fast for the hundred items of a typical cell. */
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
DEFINE_SORT(sort_facets, closed_triangle, facet_compare)

/* Sets the pointers to the temporary arrays of *w to consecutive parts of the buffer, and returns the size of all
 * arrays in bytes. If the buffer is NULL, only the size is computed. */
static size_t lay_out_work_arrays(work *w, char *buffer)
{
    base_arena at = {buffer, closed_faces_lay_out(&w->faces, buffer)};
    w->rank = base_arena_alloc(&at, (size_t)w->faces.entry_count * sizeof(int));
    w->positions = base_arena_alloc(&at, (size_t)w->faces.entry_count * sizeof *w->positions);
    w->vertices = base_arena_alloc(&at, (size_t)w->faces.entry_count * sizeof *w->vertices);
    return at.used;
}

/* Reads the cell's faces and sorts the vertices by coordinates. In the faces, each vertex is then identified by its
 * rank in this order. */
static void read_faces(work *w, int64_t cell)
{
    closed_faces *c = &w->faces;
    closed_faces_read(c, w->g, cell);
    for (int i = 0; i < c->vertex_count; i++) {
        work_vertex *v = &w->vertices[i];
        grid_read_vertex_position(w->g, c->vertices[i], v->position);
        v->value = grid_field_value(w->field, w->field->is_cell_centred ? cell : c->vertices[i]);
        v->vertex = c->vertices[i];
        v->input_index = i;
    }
    sort_vertices(w->vertices, c->vertex_count);
    for (int i = 0; i < c->vertex_count; i++) {
        w->rank[w->vertices[i].input_index] = i;
        memcpy(w->positions[i], w->vertices[i].position, sizeof w->positions[i]);
    }
    for (int i = 0; i < c->entry_count; i++) c->entry_vertices[i] = w->rank[c->entry_vertices[i]];
}

/* ---- storing the decomposed cell ---- */

static size_t lay_out_polyhedron(polyhedron *c, char *buffer, int quads)
{
    base_arena at = {buffer, 0};
    const size_t points = (size_t)c->vertex_count + 1;
    c->world = base_arena_alloc(&at, points * sizeof *c->world);
    c->values = base_arena_alloc(&at, points * sizeof *c->values);
    c->vertices = base_arena_alloc(&at, points * sizeof *c->vertices);
    float **const floats[5] = {&c->x, &c->y, &c->z, &c->f, &c->g};
    for (int i = 0; i < 5; i++) *floats[i] = base_arena_alloc(&at, points * sizeof(float));
    c->facets = base_arena_alloc(&at, (size_t)c->facet_count * sizeof *c->facets);
    c->edges = base_arena_alloc(&at, (size_t)c->facet_count * 3 * sizeof *c->edges);
    c->lines = base_arena_alloc(&at, ((size_t)c->facet_count * 3 + points) * sizeof *c->lines);
    c->quads = base_arena_alloc(&at, (size_t)quads * sizeof *c->quads);
    return at.used;
}

/* Stores the vertices, sorted by coordinates, and their values. Then stores the centre, which is the mean of the
 * vertices; its coordinates and value are summed in the order of the sorted vertices. */
static void store_vertices(const work *w, int64_t cell, polyhedron *c)
{
    double sum[4] = {0, 0, 0, 0};
    c->is_finite = grid_has_finite_cell_value(w->field, cell);
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

static bool is_quad_collapsed(const work *w, const int *around)
{
    const double *corners[4];
    /* cppcheck-suppress objectIndex ; around is four entries of a face, not one */
    for (int i = 0; i < 4; i++) corners[i] = w->positions[around[i]];
    return quad_collapses(corners);
}

static void store_quads(const work *w, polyhedron *c, int *quad_of)
{
    int count = 0;
    for (int face = 0; face < w->faces.face_count; face++) {
        const int first = w->faces.first_entries[face];
        const bool is_quad = closed_face_is_bilinear_patch(&w->faces, face, (const double(*)[3])w->positions) &&
                             !is_quad_collapsed(w, &w->faces.entry_vertices[first]);
        quad_of[face] = is_quad ? count : -1;
        if (quad_of[face] >= 0) memcpy(c->quads[count++], &w->faces.entry_vertices[first], 4 * sizeof(int));
    }
}

static void store_facets(work *w, polyhedron *c)
{
    static const int ends[3][2] = {{0, 1}, {1, 2}, {0, 2}};
    int *quad_of = w->faces.stack;
    store_quads(w, c, quad_of);
    closed_edges_clear(&w->faces);
    c->edge_count = 0;
    c->is_star_shaped = true;
    for (int i = 0; i < c->facet_count; i++) {
        const closed_triangle *from = &w->faces.triangles[i];
        polyhedron_facet *to = &c->facets[i];
        to->quad = quad_of[from->face];
        to->other_half = -1;
        to->sign = from->volume > 0 ? 1 : from->volume < 0 ? -1 : 0;
        c->is_star_shaped = c->is_star_shaped && to->sign >= 0;
        for (int k = 0; k < 3; k++) {
            to->vertex[k] = from->vertex[k];
            const int a = from->vertex[ends[k][0]], b = from->vertex[ends[k][1]];
            closed_edge *edge = &w->faces.edges[closed_edges_find(&w->faces, a, b)];
            if (edge->side[0] < 0) {
                c->edges[c->edge_count][0] = a;
                c->edges[c->edge_count][1] = b;
                edge->side[0] = c->edge_count++;
            }
            to->edge[k] = edge->side[0];
        }
    }
}

/* Links the two triangles of each quad. Both contain the quad's smallest vertex, so they are close to each other in the
 * sorted list. */
static void link_quad_halves(polyhedron *c)
{
    for (int i = 0; i < c->facet_count; i++)
        for (int j = i + 1; c->facets[i].quad >= 0 && c->facets[i].other_half < 0 && j < c->facet_count; j++)
            if (c->facets[j].quad == c->facets[i].quad) c->facets[i].other_half = j, c->facets[j].other_half = i;
}

static polyhedron *store_polyhedron(polyhedron_store *store, work *w, int64_t cell)
{
    polyhedron shape = {.vertex_count = w->faces.vertex_count, .facet_count = w->faces.triangle_count};
    const size_t head = rounded(sizeof shape);
    char *block = store_alloc(store, head + lay_out_polyhedron(&shape, NULL, w->faces.face_count));
    if (!block) return NULL;
    polyhedron *c = (polyhedron *)(void *)block;
    *c = shape;
    lay_out_polyhedron(c, block + head, w->faces.face_count);
    store_vertices(w, cell, c);
    closed_faces_orient_outward(&w->faces, (const double(*)[3])c->world, c->world[c->vertex_count]);
    store_facets(w, c);
    link_quad_halves(c);
    return c;
}

static polyhedron *decompose_polyhedron(polyhedron_store *store, const grid *g, const grid_field *field, uint32_t index)
{
    work w = {.g = g, .field = field};
    if (!closed_faces_count_entries(&w.faces, g, index)) return NULL;
    char *buffer = ensure_buffer_size(&store->work, &store->work_bytes, lay_out_work_arrays(&w, NULL));
    if (!buffer) return NULL;
    lay_out_work_arrays(&w, buffer);
    read_faces(&w, index);
    closed_faces_orient(&w.faces);
    closed_faces_triangulate(&w.faces, (const double(*)[3])w.positions);
    sort_facets(w.faces.triangles, w.faces.triangle_count);
    return store_polyhedron(store, &w, index);
}

polyhedron *polyhedra_find(polyhedron_store *store, const grid *g, const grid_field *field, int part, int layer,
                           uint32_t index)
{
    const uint32_t key = index + 0x85ebca6bu * (uint32_t)part + 0xc2b2ae35u * (uint32_t)layer;
    const uint32_t slot = (key * 0x9e3779b1u) >> (32 - TABLE_BITS);
    for (polyhedron *c = store->table[slot]; c; c = c->next)
        if (c->index == index && c->part == part && c->layer == layer) return c;
    polyhedron *c = decompose_polyhedron(store, g, field, index);
    if (!c) return NULL;
    c->index = index;
    c->part = part;
    c->layer = layer;
    c->next = store->table[slot];
    store->table[slot] = c;
    return c;
}
