#include "closed_faces.h"

#include <string.h>

#include "memory.h"
#include "polygon.h"

bool closed_faces_count_entries(closed_faces *c, const grid *g, int64_t cell)
{
    int64_t first, end, entries = 0;
    grid_cell_faces(g, cell, &first, &end);
    if (end - first > INT32_MAX / 64) return false;
    c->face_count = (int)(end - first);
    for (int64_t i = first; i < end; i++) {
        int64_t from, to;
        grid_face_vertices(g, grid_read_index(&g->connectivity, i), &from, &to);
        entries += to - from;
    }
    if (entries > INT32_MAX / 64) return false;
    c->entry_count = (int)entries;
    c->table_size = 16;
    while (c->table_size < 2 * c->entry_count) c->table_size *= 2;
    return true;
}

size_t closed_faces_lay_out(closed_faces *c, char *memory)
{
    base_arena at = {memory, 0};
    const size_t faces = (size_t)c->face_count, entries = (size_t)c->entry_count, table = (size_t)c->table_size;
    c->first_entries = base_arena_alloc(&at, (faces + 1) * sizeof(int));
    c->entry_vertices = base_arena_alloc(&at, entries * sizeof(int));
    c->face_of = base_arena_alloc(&at, entries * sizeof(int));
    c->edge_of = base_arena_alloc(&at, entries * sizeof(int));
    c->vertices = base_arena_alloc(&at, entries * sizeof *c->vertices);
    c->piece = base_arena_alloc(&at, faces * sizeof(int));
    c->orientation = base_arena_alloc(&at, faces * sizeof(int));
    c->stack = base_arena_alloc(&at, faces * sizeof(int));
    c->piece_volume = base_arena_alloc(&at, faces * sizeof(double));
    c->seen = base_arena_alloc(&at, table * sizeof *c->seen);
    c->seen_number = base_arena_alloc(&at, table * sizeof(int));
    c->edges = base_arena_alloc(&at, 2 * table * sizeof *c->edges);
    c->triangles = base_arena_alloc(&at, entries * sizeof *c->triangles);
    c->corners = base_arena_alloc(&at, entries * sizeof *c->corners);
    c->cuts = base_arena_alloc(&at, entries * sizeof *c->cuts);
    c->polygon = base_arena_alloc(&at, polygon_work_bytes((int)entries));
    return at.used;
}

/* ---- reading faces and numbering vertices --------------------------------------------------------------------- */

static size_t hash_pair(uint64_t a, uint64_t b)
{
    uint64_t h = (a * 0x9e3779b97f4a7c15u) ^ (b * 0xc2b2ae3d27d4eb4fu);
    h ^= h >> 29;
    return (size_t)((h * 0x9e3779b97f4a7c15u) >> 20);
}

static int find_or_add_vertex_number(closed_faces *c, int64_t vertex)
{
    const size_t last = (size_t)(c->table_size - 1);
    size_t at = hash_pair((uint64_t)vertex, 1) & last;
    while (c->seen[at] >= 0 && c->seen[at] != vertex) at = (at + 1) & last;
    if (c->seen[at] == vertex) return c->seen_number[at];
    c->seen[at] = vertex;
    c->seen_number[at] = c->vertex_count;
    c->vertices[c->vertex_count] = vertex;
    return c->vertex_count++;
}

void closed_faces_read(closed_faces *c, const grid *g, int64_t cell)
{
    int64_t first, end;
    int entry = 0;
    memset(c->seen, 0xff, (size_t)c->table_size * sizeof *c->seen);
    c->vertex_count = 0;
    grid_cell_faces(g, cell, &first, &end);
    for (int face = 0; face < c->face_count; face++) {
        int64_t from, to;
        grid_face_vertices(g, grid_read_index(&g->connectivity, first + face), &from, &to);
        c->first_entries[face] = entry;
        int64_t before = grid_read_index(&g->face_connectivity, to - 1);
        for (int64_t i = from; i < to; i++) {
            const int64_t vertex = grid_read_index(&g->face_connectivity, i);
            if (vertex == before) continue;
            c->face_of[entry] = face;
            c->entry_vertices[entry++] = find_or_add_vertex_number(c, vertex);
            before = vertex;
        }
    }
    c->first_entries[c->face_count] = c->entry_count = entry;
}

/* ---- consistent orientation -------------------------------------------------------------------------------------- */

static int get_end_vertex_of_side(const closed_faces *c, int side)
{
    const int face = c->face_of[side];
    return c->entry_vertices[side + 1 < c->first_entries[face + 1] ? side + 1 : c->first_entries[face]];
}

int closed_edges_find(closed_faces *c, int a, int b)
{
    const int low = a < b ? a : b, high = a < b ? b : a;
    const size_t last = 2 * (size_t)c->table_size - 1;
    size_t at = hash_pair((uint64_t)low, (uint64_t)high) & last;
    while (c->edges[at].low >= 0 && (c->edges[at].low != low || c->edges[at].high != high)) at = (at + 1) & last;
    if (c->edges[at].low < 0) c->edges[at] = (closed_edge){low, high, {-1, -1}};
    return (int)at;
}

void closed_edges_clear(closed_faces *c)
{
    for (int i = 0; i < 2 * c->table_size; i++) c->edges[i].low = -1;
}

/* Orients all faces that are connected with the face `first` by shared edges, so that their orientations are consistent
 * with that of `first`. These faces are one connected piece of the surface. Stores the index of the piece for each of
 * its faces. */
static void orient_piece(closed_faces *c, int first)
{
    int height = 0;
    c->stack[height++] = first;
    c->orientation[first] = 1;
    c->piece[first] = c->piece_count;
    while (height) {
        const int face = c->stack[--height];
        for (int side = c->first_entries[face]; side < c->first_entries[face + 1]; side++) {
            const closed_edge *edge = &c->edges[c->edge_of[side]];
            const int other = edge->side[0] == side ? edge->side[1] : edge->side[0];
            if (other < 0 || edge->low == edge->high || c->orientation[c->face_of[other]]) continue;
            const bool alike = c->entry_vertices[side] == c->entry_vertices[other];
            c->orientation[c->face_of[other]] = alike ? -c->orientation[face] : c->orientation[face];
            c->piece[c->face_of[other]] = c->piece_count;
            c->stack[height++] = c->face_of[other];
        }
    }
    c->piece_count++;
}

void closed_faces_orient(closed_faces *c)
{
    closed_edges_clear(c);
    c->piece_count = 0;
    for (int side = 0; side < c->entry_count; side++) {
        const int at = closed_edges_find(c, c->entry_vertices[side], get_end_vertex_of_side(c, side));
        closed_edge *edge = &c->edges[at];
        c->edge_of[side] = at;
        if (edge->side[0] < 0)
            edge->side[0] = side;
        else if (edge->side[1] < 0)
            edge->side[1] = side;
    }
    memset(c->orientation, 0, (size_t)c->face_count * sizeof(int));
    for (int face = 0; face < c->face_count; face++)
        if (!c->orientation[face]) orient_piece(c, face);
}

static void sort_vertex_pair(closed_triangle *t, int i, int j)
{
    if (t->vertex[i] <= t->vertex[j]) return;
    const int v = t->vertex[i];
    t->vertex[i] = t->vertex[j];
    t->vertex[j] = v;
    t->orientation = -t->orientation;
}

static void add_triangle(closed_faces *c, int face, const int corners[3])
{
    closed_triangle t = {.face = face, .orientation = c->orientation[face]};
    for (int k = 0; k < 3; k++) t.vertex[k] = c->entry_vertices[c->first_entries[face] + corners[k]];
    sort_vertex_pair(&t, 0, 1);
    sort_vertex_pair(&t, 1, 2);
    sort_vertex_pair(&t, 0, 1);
    if (t.vertex[0] != t.vertex[1] && t.vertex[1] != t.vertex[2]) c->triangles[c->triangle_count++] = t;
}

void closed_faces_triangulate(closed_faces *c, const double (*positions)[3])
{
    c->triangle_count = 0;
    for (int face = 0; face < c->face_count; face++) {
        const int first = c->first_entries[face], count = c->first_entries[face + 1] - first;
        if (count < 3) continue;
        for (int i = 0; i < count; i++)
            memcpy(c->corners[i], positions[c->entry_vertices[first + i]], sizeof c->corners[i]);
        polygon_triangulate((const double(*)[3])c->corners, count, c->polygon, c->cuts);
        for (int i = 0; i + 2 < count; i++) add_triangle(c, face, c->cuts[i]);
    }
}

bool closed_face_is_bilinear_patch(const closed_faces *c, int face, const double (*positions)[3])
{
    double corners[4][3];
    const int first = c->first_entries[face];
    if (c->first_entries[face + 1] - first != 4) return false;
    for (int i = 0; i < 4; i++) memcpy(corners[i], positions[c->entry_vertices[first + i]], sizeof corners[i]);
    return !polygon_is_concave_quad((const double(*)[3])corners);
}

/* ---- outward orientation ----------------------------------------------------------------------------------------- */

/* Returns six times the volume of the tet between the triangle v and the centre. The sign depends on the direction in
 * which the three vertices run. */
static double tet_volume(const double (*p)[3], const int *v, const double *centre)
{
    double d[3][3];
    for (int i = 0; i < 3; i++)
        for (int axis = 0; axis < 3; axis++) d[i][axis] = p[v[i]][axis] - centre[axis];
    return d[0][0] * (d[1][1] * d[2][2] - d[1][2] * d[2][1]) + d[0][1] * (d[1][2] * d[2][0] - d[1][0] * d[2][2]) +
           d[0][2] * (d[1][0] * d[2][1] - d[1][1] * d[2][0]);
}

/* Returns whether the ray from p in the negative x direction crosses the triangle. A corner with the same z as p is
 * treated as lying below p. If the projection of the triangle along x is a line, the ray does not cross it. */
static bool ray_crosses_triangle_below(const double *const t[3], const double *p)
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

/* Returns whether a connected piece of the surface is the boundary of a cavity, because it lies inside an odd number of
 * other pieces. The test ray starts at one vertex of the piece, the one with the smallest index. Triangles of the piece
 * itself are not tested. */
static bool is_cavity(const closed_faces *c, const double (*positions)[3], int piece)
{
    int smallest = c->vertex_count;
    bool inside = false;
    for (int i = 0; i < c->triangle_count; i++)
        if (c->piece[c->triangles[i].face] == piece && c->triangles[i].vertex[0] < smallest)
            smallest = c->triangles[i].vertex[0];
    for (int i = 0; i < c->triangle_count; i++) {
        const closed_triangle *t = &c->triangles[i];
        const double *const corners[3] = {positions[t->vertex[0]], positions[t->vertex[1]], positions[t->vertex[2]]};
        if (c->piece[t->face] != piece && ray_crosses_triangle_below(corners, positions[smallest])) inside = !inside;
    }
    return inside;
}

void closed_faces_orient_outward(closed_faces *c, const double (*positions)[3], const double centre[3])
{
    for (int i = 0; i < c->piece_count; i++) c->piece_volume[i] = 0;
    for (int i = 0; i < c->triangle_count; i++) {
        closed_triangle *t = &c->triangles[i];
        t->volume = t->orientation * tet_volume(positions, t->vertex, centre);
        c->piece_volume[c->piece[t->face]] += t->volume;
    }
    for (int piece = 0; piece < c->piece_count; piece++) {
        const bool is_reversed = c->piece_count > 1 && is_cavity(c, positions, piece);
        /* from here on, piece_volume is not a volume, but 1, or -1 if the orientation of the piece's faces must be
         * reversed */
        c->piece_volume[piece] = (c->piece_volume[piece] < 0) != is_reversed ? -1 : 1;
    }
    for (int face = 0; face < c->face_count; face++) c->orientation[face] *= (int)c->piece_volume[c->piece[face]];
    for (int i = 0; i < c->triangle_count; i++)
        c->triangles[i].volume *= c->piece_volume[c->piece[c->triangles[i].face]];
}
