/* Makes hexagonal prisms (test_mesh_honeycomb.h).
 *
 * A layer of prisms is a wall of bricks. Every second row of bricks is shifted by half a brick, so that a corner of a
 * brick is in the middle of an edge in the neighbouring row. The corner is moved towards that row, which makes the
 * bricks hexagons:
 *
 *      |     |     |                \   / \   /
 *      +--+--+--+--+                 \ /   \ /
 *         |     |                     |     |
 *      +--+--+--+--+                 / \   / \
 */
#include "test_mesh_honeycomb.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MAX_CORNERS = 6 };

/* The corners of a brick in cyclic order, as indices of vertices in one level (defined below). */
typedef struct brick {
    int count;
    int64_t corners[MAX_CORNERS];
} brick;

typedef struct wall {
    int n;
    /* columns: number of vertices on the line between two rows of bricks; level: number of vertices in the plane
     * between two layers of bricks */
    int64_t columns, level;
    brick *bricks;
    int64_t brick_count;
} wall;

static void *allocate_array(int64_t count, size_t size)
{
    void *p = calloc((size_t)(count > 0 ? count : 1), size);
    if (!p) {
        fprintf(stderr, "test_mesh_honeycomb: out of memory\n");
        exit(1);
    }
    return p;
}

/* Makes the brick between the columns low and high of a row. The corners in the middle of its edges belong to bricks of
 * the neighbouring rows; lines on the hull have none. */
static brick make_brick(const wall *w, int row, int64_t low, int64_t high)
{
    brick b = {.count = 0};
    for (int64_t k = low; k <= high; k++)
        if (k == low || k == high || row > 0) b.corners[b.count++] = row * w->columns + k;
    for (int64_t k = high; k >= low; k--)
        if (k == low || k == high || row + 1 < w->n) b.corners[b.count++] = (row + 1) * w->columns + k;
    return b;
}

static wall make_wall(int n)
{
    wall w = {.n = n, .columns = 2 * n + 1, .level = (int64_t)(n + 1) * (2 * n + 1)};
    w.bricks = allocate_array((int64_t)n * (n + 1), sizeof *w.bricks);
    for (int row = 0; row < n; row++)
        for (int64_t low = row % 2 ? -1 : 0; low < 2 * n; low += 2)
            w.bricks[w.brick_count++] = make_brick(&w, row, low < 0 ? 0 : low, low + 2 > 2 * n ? 2 * n : low + 2);
    return w;
}

static void place_vertex(const wall *w, int layer, int line, int64_t column, double jitter, double *p)
{
    const double side = 2.0 / w->n;
    const bool inner_row = line > 0 && line<w->n, inner_column = column> 0 && column < 2 * w->n;
    const uint64_t index = (uint64_t)((layer * w->level + line * w->columns + column) * 3);
    p[0] = (double)column * side / 2 - 1;
    p[1] = line * side - 1;
    p[2] = layer * side - 1;
    /* Moves a vertex up if the row above has a corner there (line + column is even), else down. */
    if (inner_row && inner_column) p[1] += (line + column) % 2 ? -0.15 * side : 0.15 * side;
    if (inner_row && inner_column && layer > 0 && layer < w->n)
        for (uint64_t a = 0; a < 3; a++) p[a] += jitter * side * (2 * test_uniform(index + a, 9) - 1);
}

static void place_vertices(const wall *w, double jitter, test_mesh *out)
{
    for (int layer = 0; layer <= w->n; layer++)
        for (int line = 0; line <= w->n; line++)
            for (int64_t column = 0; column < w->columns; column++)
                place_vertex(w, layer, line, column, jitter, out->coordinates + 3 * out->vertex_count++);
}

static int64_t add_face(test_mesh *mesh, const int64_t *vertices, int count)
{
    memcpy(mesh->face_connectivity + mesh->face_connectivity_count, vertices, (size_t)count * sizeof *vertices);
    mesh->face_connectivity_count += count;
    mesh->face_offsets[++mesh->face_count] = mesh->face_connectivity_count;
    return mesh->face_count - 1;
}

/* Returns the quad above an edge of a brick. If no brick of this layer has added the quad yet, adds it. first: index of
 * the layer's first quad. */
static int64_t find_or_add_side_face(const wall *w, int layer, int64_t a, int64_t b, int64_t first, test_mesh *out)
{
    const int64_t low = layer * w->level + (a < b ? a : b), high = layer * w->level + (a < b ? b : a);
    for (int64_t face = first; face < out->face_count; face++) {
        const int64_t *v = out->face_connectivity + out->face_offsets[face];
        if (v[0] == low && v[1] == high) return face;
    }
    return add_face(out, (const int64_t[]){low, high, high + w->level, low + w->level}, 4);
}

static void add_layer(const wall *w, int layer, test_mesh *out)
{
    const int64_t first = out->face_count;
    for (int64_t i = 0; i < w->brick_count; i++) {
        const brick *b = &w->bricks[i];
        for (int k = 0; k < b->count; k++)
            out->connectivity[out->connectivity_count++] =
                find_or_add_side_face(w, layer, b->corners[k], b->corners[(k + 1) % b->count], first, out);
        /* The horizontal faces have the lowest indices, level by level. */
        out->connectivity[out->connectivity_count++] = layer * w->brick_count + i;
        out->connectivity[out->connectivity_count++] = (layer + 1) * w->brick_count + i;
        out->types[out->cell_count++] = GRID_POLYHEDRON;
        out->offsets[out->cell_count] = out->connectivity_count;
    }
}

static void add_lids(const wall *w, test_mesh *out)
{
    for (int level = 0; level <= w->n; level++)
        for (int64_t i = 0; i < w->brick_count; i++) {
            int64_t loop[MAX_CORNERS];
            for (int k = 0; k < w->bricks[i].count; k++) loop[k] = level * w->level + w->bricks[i].corners[k];
            add_face(out, loop, w->bricks[i].count);
        }
}

void test_mesh_make_honeycomb(int n, double jitter, test_function *f, test_mesh *out)
{
    const wall w = make_wall(n);
    const int64_t cells = n * w.brick_count, faces = (MAX_CORNERS + 2) * (cells + w.brick_count);
    memset(out, 0, sizeof *out);
    out->coordinates = allocate_array(3 * (n + 1) * w.level, sizeof(double));
    out->values = allocate_array((n + 1) * w.level, sizeof(double));
    out->offsets = allocate_array(cells + 1, sizeof(int64_t));
    out->connectivity = allocate_array((MAX_CORNERS + 2) * cells, sizeof(int64_t));
    out->types = allocate_array(cells, 1);
    out->ghosts = allocate_array(cells, 1);
    out->face_offsets = allocate_array(faces + 1, sizeof(int64_t));
    out->face_connectivity = allocate_array(MAX_CORNERS * faces, sizeof(int64_t));
    place_vertices(&w, jitter, out);
    add_lids(&w, out);
    for (int layer = 0; layer < n; layer++) add_layer(&w, layer, out);
    free(w.bricks);
    test_mesh_set_values(out, f);
}
