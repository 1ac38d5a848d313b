/* A ray and a cell: where it goes in and out, and the field's value there.
 *
 * Which faces a ray crosses is decided on triangles: the triangular faces, and the quads split in two by the diagonal
 * from their smallest vertex, in the order of coordinates. Where it crosses a quad is then found on the quad's bilinear
 * patch, which the isoparametric maps of both its cells have there. Everything about a face is computed from its
 * vertices alone, taken in that same order, so that two cells that share a face find the same bits on it, whatever
 * their numbering, orientation or rank.
 *
 * In the ray's own plane (x, y with the ray at the origin) the edge function of edge ab is xa yb - xb ya: positive on
 * one side. It is computed so that its sign is exact (simd.h); where it is zero, the ray is taken as moved by (e, e²)
 * for an e smaller than every number, which the same for all edges decides every tie. So a ray meets exactly those
 * triangles that contain it, never both or neither of two that share an edge, and a closed surface an even number of
 * times. (Woop, Benthin and Wald 2013 for the edge functions in the ray's plane; Edelsbrunner and Mücke 1990 for the
 * ties.) Sorted along the ray the crossings pair up into the intervals inside; no orientation is asked of the cell. */
#ifndef RENDER_KERNEL_CELL_H
#define RENDER_KERNEL_CELL_H

#include "kernel_quad.h"

enum { KERNEL_MAX_CROSSINGS = 12, KERNEL_MAX_CELL_INTERVALS = KERNEL_MAX_CROSSINGS / 2, KERNEL_MAX_LINES = 18 };

typedef struct kernel_cell {
    uint32_t serial, index; /* the cache's key: tile, cell, */
    int part, layer;        /* mesh, and whose values these are */
    bool is_finite, is_placed, is_constant, has_lines, has_normal;
    int type, count;
    int64_t vertices[GRID_MAX_CELL_VERTICES];
    double world[GRID_MAX_CELL_VERTICES][3];
    double values[GRID_MAX_CELL_VERTICES];
    float x[GRID_MAX_CELL_VERTICES], y[GRID_MAX_CELL_VERTICES], z[GRID_MAX_CELL_VERTICES]; /* tile space */
    float f[GRID_MAX_CELL_VERTICES];     /* values as the caller wants them */
    float g[GRID_MAX_CELL_VERTICES];     /* the same of the colour field */
    int rank[GRID_MAX_CELL_VERTICES];    /* place in the order of coordinates */
    kernel_line lines[KERNEL_MAX_LINES]; /* of the edges, then of the quads' diagonals */
    float doubt;                         /* of a tet: the largest of its lines' bounds */
    float least[4];                      /* kernel_least_weight() of a tet's faces; [0]: no less than of any triangle */
    float normal[3];                     /* of a tet: kernel_tet_normal(), where has_normal */
} kernel_cell;

/* Where rays go through a face: v of f, w of g, at the cell's own coordinates r (for tets not set). */
typedef struct kernel_crossing {
    vm mask;
    vf t, v, w;
    vf r[3];
} kernel_crossing;

/* Between two crossings, inside the cell. */
typedef struct kernel_interval {
    vm mask;
    vf t_in, t_out, v_in, v_out, w_in, w_out;
    vf r_in[3], r_out[3];
} kernel_interval;

/* A ray's place relative to vertices: x, y in the ray's plane. */
typedef struct kernel_projected {
    vf x[GRID_MAX_CELL_VERTICES], y[GRID_MAX_CELL_VERTICES];
} kernel_projected;

SIMD_INLINE bool kernel_position_before(const double *a, const double *b)
{
    if (a[0] != b[0]) return a[0] < b[0];
    if (a[1] != b[1]) return a[1] < b[1];
    return a[2] < b[2];
}

/* Cells that rays of the tile have met, by hash: a cell is fetched, ordered and moved into tile space once for all the
 * tile's packets, and for all of a volume's windows, as long as it is not pushed out. */
enum { KERNEL_CACHE_BITS = 8, KERNEL_CACHE_CELLS = 1 << KERNEL_CACHE_BITS };

typedef struct kernel_cache {
    kernel_cell cells[KERNEL_CACHE_CELLS];
} kernel_cache;

/* Is the polyhedron a tet, on which its field is linear as a tet's is? Then it is drawn as one, to the same bits. */
static bool kernel_is_tet(const grid *g, int64_t cell, int64_t vertices[4])
{
    int64_t first, end, vertex;
    grid_cell_faces(g, cell, &first, &end);
    if (end - first != 4) return false;
    int count = 0, entries = 0;
    grid_walk walk = grid_walk_cell(g, cell);
    while (grid_walk_next(&walk, &vertex)) {
        int at = 0;
        while (at < count && vertices[at] != vertex) at++;
        if (++entries > 12 || at == 4) return false;
        if (at == count) vertices[count++] = vertex;
    }
    return count == 4;
}

/* The cell with its values; not placed yet. Of a polyhedron only the type: see kernel_polyhedron.h. */
SIMD_INLINE void kernel_cell_fetch(kernel_cell *c, const grid *g, const grid_field *field, uint32_t index)
{
    c->index = index;
    c->is_placed = false;
    c->type = grid_cell_type(g, index);
    if (c->type == GRID_POLYHEDRON && kernel_is_tet(g, index, c->vertices))
        c->type = GRID_TET, c->count = 4;
    else
        c->count = grid_cell_vertices(g, index, c->vertices);
    c->is_finite = grid_cell_values(field, index, c->vertices, c->count, c->values);
}

/* The same from the cache, where it may have been placed. layer tells apart the fields that cells are asked for. */
SIMD_INLINE kernel_cell *kernel_cell_find(const kernel_packet *p, int layer, int part, const grid_field *field,
                                          uint32_t index)
{
    const uint32_t key = index + 0x85ebca6bu * (uint32_t)part + 0xc2b2ae35u * (uint32_t)layer;
    kernel_cell *c = &((kernel_cache *)p->thread->cache)->cells[(key * 0x9e3779b1u) >> (32 - KERNEL_CACHE_BITS)];
    if (c->serial == p->thread->serial && c->index == index && c->part == part && c->layer == layer) return c;
    c->serial = p->thread->serial;
    c->part = part;
    c->layer = layer;
    kernel_cell_fetch(c, p->frame->job->parts[part].cells, field, index);
    return c;
}

SIMD_INLINE bool kernel_rank_before(const kernel_cell *c, int i, int j)
{
    return c->rank[i] < c->rank[j];
}

/* A cell's vertices begun at the one of least rank, and along its edges in the order of ranks: from[i] is the vertex
 * that takes place i. Mirrored, where that is so: orientation means nothing here. */
SIMD_INLINE void kernel_cell_turn(const kernel_cell *c, int from[GRID_MAX_CELL_VERTICES])
{
    static const signed char corner[8] = {0, 1, 3, 2, 4, 5, 7, 6}; /* a hex's vertices as bits of x, y, z; and back */
    const int begins = c->type == GRID_PYRAMID ? 4 : c->count;
    int least = 0, swap;
    for (int i = 1; i < begins; i++)
        if (kernel_rank_before(c, i, least)) least = i;
    if (c->type == GRID_HEX) {
        int axes[3] = {1, 2, 4};
        for (int k = 0; k < 3; k++) {
            const int at = k == 1; /* 0 and 1, 1 and 2, 0 and 1 */
            if (kernel_rank_before(c, corner[corner[least] ^ axes[at + 1]], corner[corner[least] ^ axes[at]]))
                swap = axes[at], axes[at] = axes[at + 1], axes[at + 1] = swap;
        }
        for (int i = 0; i < 8; i++) {
            int bits = corner[least];
            for (int a = 0; a < 3; a++) bits ^= corner[i] >> a & 1 ? axes[a] : 0;
            from[i] = corner[bits];
        }
    } else if (c->type == GRID_WEDGE) {
        const int base = least < 3 ? 0 : 3;
        int ahead = base + (least + 1) % 3, behind = base + (least + 2) % 3;
        if (kernel_rank_before(c, behind, ahead)) swap = ahead, ahead = behind, behind = swap;
        const int first[3] = {least, ahead, behind};
        for (int i = 0; i < 3; i++) {
            from[i] = first[i];
            from[i + 3] = (first[i] + 3) % 6;
        }
    } else {
        int ahead = (least + 1) & 3, behind = (least + 3) & 3;
        if (kernel_rank_before(c, behind, ahead)) swap = ahead, ahead = behind, behind = swap;
        const int first[5] = {least, ahead, (least + 2) & 3, behind, 4};
        memcpy(from, first, sizeof first);
    }
}

/* Each vertex's place in the order of coordinates, without a branch on it, which none could foresee. */
SIMD_INLINE void kernel_rank_positions(double (*const world)[3], const int count, int *rank)
{
    for (int i = 0; i < count; i++) rank[i] = 0;
    for (int i = 0; i < count; i++)
        for (int j = i + 1; j < count; j++) {
            const int after = kernel_position_before(world[j], world[i]);
            rank[i] += after;
            rank[j] += 1 - after;
        }
}

/* All that a cell has of its vertices (but the colours, which come later), from vertex from[i] to place i. */
SIMD_INLINE void kernel_cell_permute(kernel_cell *c, const int *from, const int count)
{
    double world[GRID_MAX_CELL_VERTICES][3], values[GRID_MAX_CELL_VERTICES];
    int64_t vertices[GRID_MAX_CELL_VERTICES];
    float *const lists[4] = {c->x, c->y, c->z, c->f};
    float own[4][GRID_MAX_CELL_VERTICES];
    for (int i = 0; i < count; i++) {
        for (int a = 0; a < 3; a++) world[i][a] = c->world[from[i]][a];
        values[i] = c->values[from[i]];
        vertices[i] = c->vertices[from[i]];
        for (int n = 0; n < 4; n++) own[n][i] = lists[n][from[i]];
    }
    for (int i = 0; i < count; i++) {
        for (int a = 0; a < 3; a++) c->world[i][a] = world[i][a];
        c->values[i] = values[i];
        c->vertices[i] = vertices[i];
        for (int n = 0; n < 4; n++) lists[n][i] = own[n][i];
    }
}

/* The order of coordinates: a tet, symmetric in its vertices, is put in that order; other cells get ranks, and are
 * turned to begin by them, with all that a cell has of its vertices (but the colours, which come later). Nothing in a
 * cell then depends on how the simulation numbers its vertices, not even where its map is folded and has several
 * solutions. */
SIMD_INLINE void kernel_cell_order(kernel_cell *c)
{
    int from[GRID_MAX_CELL_VERTICES], rank[GRID_MAX_CELL_VERTICES];
    if (c->type == GRID_TET) {
        kernel_rank_positions(c->world, 4, rank);
        for (int i = 0; i < 4; i++) from[rank[i]] = i;
        kernel_cell_permute(c, from, 4);
        return;
    }
    kernel_rank_positions(c->world, c->count, c->rank);
    kernel_cell_turn(c, from);
    kernel_cell_permute(c, from, c->count);
    for (int i = 0; i < c->count; i++) rank[i] = c->rank[from[i]];
    for (int i = 0; i < c->count; i++) c->rank[i] = rank[i];
}

/* A position into tile space (kernel_packet.h). */
SIMD_INLINE void kernel_place_in(const kernel_frame *f, const kernel_tile *tile, const double *world, float *out_x,
                                 float *out_y, float *out_z)
{
    const double *eye = f->job->camera.eye;
    const double d0 = world[0] - eye[0], d1 = world[1] - eye[1], d2 = world[2] - eye[2];
    const double x = f->scaled_axes[0][0] * d0 + f->scaled_axes[0][1] * d1 + f->scaled_axes[0][2] * d2;
    const double y = f->scaled_axes[1][0] * d0 + f->scaled_axes[1][1] * d1 + f->scaled_axes[1][2] * d2;
    const double z = f->scaled_axes[2][0] * d0 + f->scaled_axes[2][1] * d1 + f->scaled_axes[2][2] * d2;
    const double depth = f->job->camera.is_orthographic ? f->job->space.scale : z;
    *out_x = (float)(x - tile->centre_x * depth);
    *out_y = (float)(y - tile->centre_y * depth);
    *out_z = (float)(z - tile->depth_shift);
}

SIMD_INLINE void kernel_place(const kernel_packet *p, const double *world, float *out_x, float *out_y, float *out_z)
{
    kernel_place_in(p->frame, p->tile, world, out_x, out_y, out_z);
}

/* kernel_place_in() of a tet's vertices at once: the same operations, and so the same bits. */
SIMD_INLINE void kernel_tet_place(kernel_cell *c, const kernel_frame *f, const kernel_tile *tile)
{
    kernel_doubles d[3], place[3];
    for (int a = 0; a < 3; a++)
        d[a] = (kernel_doubles){c->world[0][a], c->world[1][a], c->world[2][a], c->world[3][a]} - f->job->camera.eye[a];
    for (int a = 0; a < 3; a++)
        place[a] = f->scaled_axes[a][0] * d[0] + f->scaled_axes[a][1] * d[1] + f->scaled_axes[a][2] * d[2];
    const kernel_doubles depth = f->job->camera.is_orthographic ? f->job->space.scale + 0 * place[2] : place[2];
    const kernel_four x = __builtin_convertvector(place[0] - tile->centre_x * depth, kernel_four);
    const kernel_four y = __builtin_convertvector(place[1] - tile->centre_y * depth, kernel_four);
    const kernel_four z = __builtin_convertvector(place[2] - tile->depth_shift, kernel_four);
    memcpy(c->x, &x, sizeof x);
    memcpy(c->y, &y, sizeof y);
    memcpy(c->z, &z, sizeof z);
}

/* Into tile space, but not in order yet, and without lines. */
SIMD_INLINE void kernel_cell_move(kernel_cell *c, const kernel_frame *f, const kernel_tile *tile, const grid *g)
{
    for (int i = 0; i < c->count; i++) grid_vertex(g, c->vertices[i], c->world[i]);
    if (c->type == GRID_TET)
        kernel_tet_place(c, f, tile);
    else
        for (int i = 0; i < c->count; i++) kernel_place_in(f, tile, c->world[i], &c->x[i], &c->y[i], &c->z[i]);
    c->is_placed = true;
    c->has_lines = c->has_normal = false;
}

SIMD_INLINE void kernel_cell_place_in(kernel_cell *c, const kernel_frame *f, const kernel_tile *tile, const grid *g)
{
    kernel_cell_move(c, f, tile, g);
    kernel_cell_order(c);
}

/* Of a placed cell, before rays of the tile are to meet it. */
static void kernel_cell_lines(kernel_cell *c, const kernel_frame *f, const kernel_tile *tile);

SIMD_INLINE void kernel_cell_place(kernel_cell *c, const kernel_packet *p, const grid *g)
{
    kernel_cell_place_in(c, p->frame, p->tile, g);
    if (p->is_pencil) kernel_cell_lines(c, p->frame, p->tile);
}

SIMD_INLINE kernel_spot kernel_cell_spot(const kernel_cell *c, int i)
{
    return (kernel_spot){c->x[i], c->y[i], c->z[i]};
}

/* ---- Tets: four triangles, two crossings or none. ---- */

/* Edges 01, 02, 03, 12, 13, 23, and the faces without vertex 3, 2, 1, 0: their edges ij, jk and ik. */
enum { KERNEL_TET_EDGES = 6 };
static const signed char kernel_tet_edge[KERNEL_TET_EDGES][2] = {{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 3}, {2, 3}};

/* Over the edges of each face, in kernel_triangle_least()'s order. */
SIMD_INLINE kernel_four kernel_tet_face_sums(const kernel_four e[2])
{
    return (__builtin_shufflevector(e[0], e[1], 0, 0, 1, 3) + __builtin_shufflevector(e[0], e[1], 3, 4, 5, 5)) +
           __builtin_shufflevector(e[0], e[1], 1, 2, 2, 4);
}

SIMD_INLINE void kernel_tet_lines(kernel_cell *c, const kernel_frame *f, const kernel_tile *tile)
{
    kernel_four at[3], size, errors[2], extents[2];
    kernel_line lines[8];
    float doubt = 0;
    for (int i = 0; i < 4; i++) size[i] = kernel_spot_size(f, tile, kernel_cell_spot(c, i));
    at[0] = kernel_four_load(c->x);
    at[1] = kernel_four_load(c->y);
    at[2] = kernel_four_load(c->z);
    /* Edges 0 to 3, 4 and 5. */
    kernel_four_lines(f, tile->radius, KERNEL_PICK(at, 0, 0, 0, 1), KERNEL_PICK(at, 1, 2, 3, 2),
                      KERNEL_PICKED(size, 0, 0, 0, 1), KERNEL_PICKED(size, 1, 2, 3, 2), lines, &errors[0], &extents[0]);
    kernel_four_lines(f, tile->radius, KERNEL_PICK(at, 1, 2, 2, 2), KERNEL_PICK(at, 3, 3, 3, 3),
                      KERNEL_PICKED(size, 1, 2, 2, 2), KERNEL_PICKED(size, 3, 3, 3, 3), lines + 4, &errors[1],
                      &extents[1]);
    for (int n = 0; n < KERNEL_TET_EDGES; n++) {
        c->lines[n] = lines[n];
        doubt = doubt < lines[n].bound ? lines[n].bound : doubt;
    }
    c->doubt = doubt;
    const kernel_four error = kernel_tet_face_sums(errors), extent = kernel_tet_face_sums(extents);
    const kernel_four least = error * extent * (0.5f / KERNEL_WEIGHT_ERROR);
    memcpy(c->least, &least, sizeof least);
}

SIMD_INLINE void kernel_tet_project(const kernel_packet *p, const kernel_cell *c, vf x[4], vf y[4])
{
    for (int i = 0; i < 4; i++) {
        x[i] = kernel_project_x(p, kernel_cell_spot(c, i));
        y[i] = kernel_project_y(p, kernel_cell_spot(c, i));
    }
}

/* What kernel_edge() gives of each, from vertices that are projected once. */
static __attribute__((noinline)) void kernel_tet_edges_exactly(const kernel_packet *p, const kernel_cell *c,
                                                               vf e[KERNEL_TET_EDGES])
{
    vf x[4], y[4];
    kernel_tet_project(p, c, x, y);
    for (int n = 0; n < KERNEL_TET_EDGES; n++) {
        const int a = kernel_tet_edge[n][0], b = kernel_tet_edge[n][1];
        const vf line = kernel_line_at(p, &c->lines[n]);
        const vm doubt = vm_not(vf_lt(vf_set(c->lines[n].bound), vf_abs(line)));
        e[n] = vm_any(doubt) ? vf_select(doubt, kernel_edge_between(x[a], y[a], x[b], y[b]), line) : line;
    }
}

SIMD_INLINE void kernel_tet_edges_projected(const kernel_packet *p, const kernel_cell *c, vf e[KERNEL_TET_EDGES])
{
    vf x[4], y[4];
    kernel_tet_project(p, c, x, y);
    for (int n = 0; n < KERNEL_TET_EDGES; n++) {
        const int a = kernel_tet_edge[n][0], b = kernel_tet_edge[n][1];
        e[n] = kernel_edge_between(x[a], y[a], x[b], y[b]);
    }
}

/* All edge functions at once; one by one only where one of them is in doubt. */
SIMD_INLINE void kernel_tet_edges(const kernel_packet *p, const kernel_cell *c, vf e[KERNEL_TET_EDGES])
{
    if (!p->is_pencil) {
        kernel_tet_edges_projected(p, c, e);
        return;
    }
    for (int n = 0; n < KERNEL_TET_EDGES; n++) e[n] = kernel_line_at(p, &c->lines[n]);
    const vf low = vf_min(vf_min(vf_abs(e[0]), vf_abs(e[1])), vf_abs(e[2]));
    const vf least = vf_min(vf_min(low, vf_min(vf_abs(e[3]), vf_abs(e[4]))), vf_abs(e[5]));
    if (__builtin_expect(vm_any(vm_not(vf_lt(vf_set(c->doubt), least))), 0)) kernel_tet_edges_exactly(p, c, e);
}

/* A crossed triangle's sums (kernel_line.h). */
typedef struct kernel_sums {
    vf depth, value, colour, weight;
} kernel_sums;

SIMD_INLINE kernel_sums kernel_tet_sums(const kernel_cell *c, int i, int j, int k, vf ij, vf jk, vf ik, bool has_colour)
{
    return (kernel_sums){kernel_weigh_value(ij, jk, ik, c->z[i], c->z[j], c->z[k]),
                         kernel_weigh_value(ij, jk, ik, c->f[i], c->f[j], c->f[k]),
                         has_colour ? kernel_weigh_value(ij, jk, ik, c->g[i], c->g[j], c->g[k]) : vf_set(0),
                         kernel_weight(ij, jk, ik)};
}

SIMD_INLINE kernel_sums kernel_sums_select(vm m, const kernel_sums *a, const kernel_sums *b)
{
    return (kernel_sums){vf_select(m, a->depth, b->depth), vf_select(m, a->value, b->value),
                         vf_select(m, a->colour, b->colour), vf_select(m, a->weight, b->weight)};
}

/* The faces' vertices and edges. */
static const signed char kernel_tet_face[4][6] = {
    {0, 1, 2, 0, 3, 1}, {0, 1, 3, 0, 4, 2}, {0, 2, 3, 1, 5, 2}, {1, 2, 3, 3, 5, 4}};

/* Where a ray goes in and out, in whichever order. */
typedef struct kernel_ends {
    kernel_sums a, b;
} kernel_ends;

/* Of the faces that each ray crosses (which of them, but the last), the first and the last. */
SIMD_INLINE kernel_ends kernel_tet_choose(vm m012, vm m013, vm m023, vm m123, const kernel_sums *s012,
                                          const kernel_sums *s013, const kernel_sums *s023, const kernel_sums *s123)
{
    const kernel_sums a = kernel_sums_select(m013, s013, s023), b = kernel_sums_select(m023, s023, s013);
    return (kernel_ends){kernel_sums_select(m012, s012, &a), kernel_sums_select(m123, s123, &b)};
}

/* With the edges of faces projected on rays where their weights are not good enough. */
static __attribute__((noinline, cold)) kernel_ends
kernel_tet_mend(const kernel_packet *p, const kernel_cell *c, vm rays, const vf e[KERNEL_TET_EDGES], bool has_colour)
{
    kernel_sums sums[4];
    vm hit[4];
    for (int n = 0; n < 4; n++) {
        const signed char *f = kernel_tet_face[n];
        vf ij = e[f[3]], jk = e[f[4]], ik = e[f[5]];
        hit[n] = kernel_inside(rays, ij, jk, ik);
        const vm weak = kernel_weak(hit[n], kernel_weight(ij, jk, ik), c->least[n]);
        if (vm_any(weak))
            kernel_triangle_mend(p, kernel_cell_spot(c, f[0]), kernel_cell_spot(c, f[1]), kernel_cell_spot(c, f[2]),
                                 weak, &ij, &jk, &ik);
        sums[n] = kernel_tet_sums(c, f[0], f[1], f[2], ij, jk, ik, has_colour);
    }
    return kernel_tet_choose(hit[0], hit[1], hit[2], hit[3], &sums[0], &sums[1], &sums[2], &sums[3]);
}

/* Which rays cross which of the faces, in kernel_tet_face's order. */
SIMD_INLINE void kernel_tet_faces(const kernel_packet *p, const kernel_cell *c, vm rays, vm hit[4])
{
    vf e[KERNEL_TET_EDGES];
    kernel_tet_edges(p, c, e);
    for (int n = 0; n < 4; n++) {
        const signed char *f = kernel_tet_face[n];
        hit[n] = kernel_inside(rays, e[f[3]], e[f[4]], e[f[5]]);
    }
}

/* Without branches: all four faces' sums, of which each ray takes its first and its last crossed face's. */
SIMD_INLINE void kernel_tet_interval(const kernel_packet *p, const kernel_cell *c, vm rays, bool has_colour,
                                     kernel_interval *out)
{
    vf e[KERNEL_TET_EDGES];
    kernel_tet_edges(p, c, e);
    const vm m012 = kernel_inside(rays, e[0], e[3], e[1]), m013 = kernel_inside(rays, e[0], e[4], e[2]);
    const vm m023 = kernel_inside(rays, e[1], e[5], e[2]), m123 = kernel_inside(rays, e[3], e[5], e[4]);
    out->mask = vm_or(vm_or(m012, m013), vm_or(m023, m123));
    out->t_in = out->t_out = out->v_in = out->v_out = out->w_in = out->w_out = vf_set(0);
    if (!vm_any(out->mask)) return;
    const kernel_sums s012 = kernel_tet_sums(c, 0, 1, 2, e[0], e[3], e[1], has_colour);
    const kernel_sums s013 = kernel_tet_sums(c, 0, 1, 3, e[0], e[4], e[2], has_colour);
    const kernel_sums s023 = kernel_tet_sums(c, 0, 2, 3, e[1], e[5], e[2], has_colour);
    const kernel_sums s123 = kernel_tet_sums(c, 1, 2, 3, e[3], e[5], e[4], has_colour);
    kernel_ends ends = kernel_tet_choose(m012, m013, m023, m123, &s012, &s013, &s023, &s123);
    if (p->is_pencil) {
        const vm weak =
            vm_or(vm_or(kernel_weak(m012, s012.weight, c->least[0]), kernel_weak(m013, s013.weight, c->least[1])),
                  vm_or(kernel_weak(m023, s023.weight, c->least[2]), kernel_weak(m123, s123.weight, c->least[3])));
        if (__builtin_expect(vm_any(weak), 0)) ends = kernel_tet_mend(p, c, rays, e, has_colour);
    }
    const vf scale_a = 1.0f / ends.a.weight, scale_b = 1.0f / ends.b.weight;
    const vf t_a = ends.a.depth * scale_a, t_b = ends.b.depth * scale_b;
    const vf v_a = ends.a.value * scale_a, v_b = ends.b.value * scale_b;
    const vm swap = vf_lt(t_b, t_a);
    out->t_in = vf_select(swap, t_b, t_a);
    out->t_out = vf_select(swap, t_a, t_b);
    out->v_in = vf_select(swap, v_b, v_a);
    out->v_out = vf_select(swap, v_a, v_b);
    if (!has_colour) return;
    const vf w_a = ends.a.colour * scale_a, w_b = ends.b.colour * scale_b;
    out->w_in = vf_select(swap, w_b, w_a);
    out->w_out = vf_select(swap, w_a, w_b);
}

/* ---- Cells with quads. ---- */

typedef struct kernel_shape {
    int edge_count;
    signed char edges[12][2];
    int face_count;
    struct {
        int count;
        signed char vertices[4];
    } faces[6];
    float corners[GRID_MAX_CELL_VERTICES][3]; /* the cell's own coordinates of its vertices */
} kernel_shape;

/* Corners of the pyramid are in the coordinates a = (1-q) r, b = (1-q) s, k = 1-q (see kernel_map.h). */
static const kernel_shape kernel_shapes[3] = {
    {12,
     {{0, 1}, {1, 2}, {2, 3}, {3, 0}, {4, 5}, {5, 6}, {6, 7}, {7, 4}, {0, 4}, {1, 5}, {2, 6}, {3, 7}},
     6,
     {{4, {0, 4, 7, 3}}, {4, {1, 2, 6, 5}}, {4, {0, 1, 5, 4}}, {4, {3, 7, 6, 2}}, {4, {0, 3, 2, 1}}, {4, {4, 5, 6, 7}}},
     {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}}},
    {9,
     {{0, 1}, {1, 2}, {2, 0}, {3, 4}, {4, 5}, {5, 3}, {0, 3}, {1, 4}, {2, 5}},
     5,
     {{3, {0, 1, 2, 0}}, {3, {3, 5, 4, 0}}, {4, {0, 3, 4, 1}}, {4, {1, 4, 5, 2}}, {4, {2, 5, 3, 0}}},
     {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {0, 1, 1}}},
    {8,
     {{0, 1}, {1, 2}, {2, 3}, {3, 0}, {0, 4}, {1, 4}, {2, 4}, {3, 4}},
     5,
     {{4, {0, 3, 2, 1}}, {3, {0, 1, 4, 0}}, {3, {1, 2, 4, 0}}, {3, {2, 3, 4, 0}}, {3, {3, 0, 4, 0}}},
     {{0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}, {0, 0, 0}}},
};

SIMD_INLINE const kernel_shape *kernel_cell_shape(int type)
{
    return &kernel_shapes[type == GRID_HEX ? 0 : type == GRID_WEDGE ? 1 : 2];
}

/* Edge functions by vertex pair: those of the shape and of the quads' diagonals. */
typedef struct kernel_edges {
    vf e[GRID_MAX_CELL_VERTICES][GRID_MAX_CELL_VERTICES]; /* [a][b] with a before b in the order */
} kernel_edges;

/* Number n of the cell's lines. */
SIMD_INLINE void kernel_poly_edge(const kernel_packet *p, const kernel_cell *c, int n, int i, int j, kernel_edges *out)
{
    const int a = c->rank[i] < c->rank[j] ? i : j, b = a == i ? j : i;
    out->e[a][b] = kernel_edge(p, &c->lines[n], kernel_cell_spot(c, a), kernel_cell_spot(c, b));
}

/* A quad's corners around, from the smallest vertex towards its smaller neighbour. */
SIMD_INLINE void kernel_quad_corners(const kernel_cell *c, const signed char *loop, int corner[4])
{
    int first = 0;
    for (int i = 1; i < 4; i++)
        if (c->rank[loop[i]] < c->rank[loop[first]]) first = i;
    const int ahead = loop[(first + 1) & 3], behind = loop[(first + 3) & 3];
    const bool forward = c->rank[ahead] < c->rank[behind];
    corner[0] = loop[first];
    corner[1] = forward ? ahead : behind;
    corner[2] = loop[(first + 2) & 3];
    corner[3] = forward ? behind : ahead;
}

SIMD_INLINE void kernel_poly_lines(kernel_cell *c, const kernel_frame *f, const kernel_tile *tile)
{
    const kernel_shape *shape = kernel_cell_shape(c->type);
    signed char ends[KERNEL_MAX_LINES][2];
    float size[GRID_MAX_CELL_VERTICES];
    const int count = shape->edge_count + shape->face_count;
    memset(ends, 0, sizeof ends);
    memcpy(ends, shape->edges, (size_t)shape->edge_count * sizeof ends[0]);
    for (int face = 0; face < shape->face_count; face++) {
        int corner[4];
        if (shape->faces[face].count == 3) continue;
        kernel_quad_corners(c, shape->faces[face].vertices, corner);
        ends[shape->edge_count + face][0] = (signed char)corner[0];
        ends[shape->edge_count + face][1] = (signed char)corner[2];
    }
    for (int i = 0; i < c->count; i++) size[i] = kernel_spot_size(f, tile, kernel_cell_spot(c, i));
    kernel_blur most = {0, 0};
    for (int n = 0; n < count; n++) {
        const int i = ends[n][0], j = ends[n][1], a = c->rank[i] < c->rank[j] ? i : j, b = a == i ? j : i;
        const kernel_spot from = kernel_cell_spot(c, a), to = kernel_cell_spot(c, b);
        c->lines[n] = kernel_line_between(f, from, to, size[a], size[b]);
        if (c->type != GRID_HEX) most = kernel_blur_more(most, kernel_line_blur(&c->lines[n], tile->radius, from, to));
    }
    c->least[0] = c->type == GRID_HEX ? (float)INFINITY : kernel_blur_least(most); /* hexes hardly have triangles */
}

static void kernel_cell_lines(kernel_cell *c, const kernel_frame *f, const kernel_tile *tile)
{
    if (c->has_lines) return;
    c->has_lines = true;
    if (c->type == GRID_TET)
        kernel_tet_lines(c, f, tile);
    else
        kernel_poly_lines(c, f, tile);
}

SIMD_INLINE bool kernel_quad_collapses(const kernel_cell *c, const int corner[4])
{
    const double *const corners[4] = {c->world[corner[0]], c->world[corner[1]], c->world[corner[2]],
                                      c->world[corner[3]]};
    return quad_collapses(corners);
}

/* Edge functions of a crossed triangle i, j, k in the order, the weights, and one over their sum. Tets weigh in the
 * same way: a face's depth and value have the same bits from both its cells. */
typedef struct kernel_weights {
    int i, j, k;
    vf ij, jk, ik, inverse;
} kernel_weights;

SIMD_INLINE kernel_weights kernel_weights_of(int i, int j, int k, vf ij, vf jk, vf ik)
{
    return (kernel_weights){i, j, k, ij, jk, ik, 1.0f / kernel_weight(ij, jk, ik)};
}

/* Those of a triangle of these spots, made good enough on rays that cross it; least is no less than its own. */
SIMD_INLINE void kernel_weights_mend(const kernel_packet *p, float least, vm hit, kernel_spot i, kernel_spot j,
                                     kernel_spot k, kernel_weights *w)
{
    if (!p->is_pencil) return;
    const vf weight = kernel_weight(w->ij, w->jk, w->ik);
    if (__builtin_expect(!vm_any(kernel_weak(hit, weight, least)), 1)) return;
    const vm weak = kernel_weak(hit, weight, kernel_triangle_least(p, i, j, k));
    vf ij = w->ij, jk = w->jk, ik = w->ik;
    if (!vm_any(weak)) return;
    kernel_triangle_mend(p, i, j, k, weak, &ij, &jk, &ik);
    *w = kernel_weights_of(w->i, w->j, w->k, ij, jk, ik);
}

SIMD_INLINE vf kernel_weigh(const kernel_weights *w, float fi, float fj, float fk)
{
    return kernel_weigh_value(w->ij, w->jk, w->ik, fi, fj, fk) * w->inverse;
}

SIMD_INLINE vf kernel_weigh_depth(const kernel_weights *w, const float *z)
{
    return kernel_weigh(w, z[w->i], z[w->j], z[w->k]);
}

SIMD_INLINE void kernel_triangle_values(const kernel_cell *c, const kernel_shape *shape, const kernel_weights *w,
                                        bool has_colour, kernel_crossing *out)
{
    out->v = kernel_weigh(w, c->f[w->i], c->f[w->j], c->f[w->k]);
    out->w = has_colour ? kernel_weigh(w, c->g[w->i], c->g[w->j], c->g[w->k]) : vf_set(0);
    for (int a = 0; a < 3; a++)
        out->r[a] = kernel_weigh(w, shape->corners[w->i][a], shape->corners[w->j][a], shape->corners[w->k][a]);
}

/* The edge function from one corner to another. */
SIMD_INLINE vf kernel_corner_edge(const kernel_cell *c, const kernel_edges *edges, int from, int to)
{
    return c->rank[from] < c->rank[to] ? edges->e[from][to] : -edges->e[to][from];
}

SIMD_INLINE void kernel_quad_take(const kernel_projected *q, const float *z, const int corner[4], kernel_quad *out)
{
    for (int i = 0; i < 4; i++) {
        out->x[i] = q->x[corner[i]];
        out->y[i] = q->y[corner[i]];
        out->z[i] = vf_set(z[corner[i]]);
    }
}

/* The crossing of a quad's patch. The isoparametric map has the same patch there, so that the field inside the cells on
 * both sides goes on to the same value. */
SIMD_INLINE void kernel_quad_values(const kernel_cell *c, const kernel_shape *shape, const int corner[4],
                                    const kernel_quad_place *at, bool has_colour, kernel_crossing *out)
{
    vf f[4], g[4];
    for (int i = 0; i < 4; i++) f[i] = vf_set(c->f[corner[i]]), g[i] = vf_set(has_colour ? c->g[corner[i]] : 0);
    out->mask = at->mask;
    out->t = at->t;
    out->v = kernel_bilinear(f, at->s, at->r);
    out->w = has_colour ? kernel_bilinear(g, at->s, at->r) : vf_set(0);
    for (int a = 0; a < 3; a++) {
        const float base = shape->corners[corner[0]][a];
        out->r[a] =
            (base + at->s * (shape->corners[corner[1]][a] - base)) + at->r * (shape->corners[corner[3]][a] - base);
    }
}

/* Three of the cell's vertices in the order. */
SIMD_INLINE void kernel_triangle_order(const kernel_cell *c, const int corners[3], int out[3])
{
    int i = corners[0], j = corners[1], k = corners[2], swap;
    if (c->rank[j] < c->rank[i]) swap = i, i = j, j = swap;
    if (c->rank[k] < c->rank[j]) swap = j, j = k, k = swap;
    if (c->rank[j] < c->rank[i]) swap = i, i = j, j = swap;
    out[0] = i;
    out[1] = j;
    out[2] = k;
}

/* Who crosses the triangle. */
SIMD_INLINE vm kernel_triangle(const kernel_edges *edges, vm rays, const int ijk[3])
{
    return kernel_inside(rays, edges->e[ijk[0]][ijk[1]], edges->e[ijk[1]][ijk[2]], edges->e[ijk[0]][ijk[2]]);
}

/* The crossing of such a triangle; false where no ray has any. */
SIMD_INLINE bool kernel_triangle_crossing(const kernel_packet *p, const kernel_cell *c, const kernel_shape *shape,
                                          const kernel_edges *edges, vm rays, const int corners[3], bool has_colour,
                                          kernel_crossing *out)
{
    int ijk[3];
    kernel_triangle_order(c, corners, ijk);
    const vm hit = kernel_triangle(edges, rays, ijk);
    if (!vm_any(hit)) return false;
    kernel_weights w = kernel_weights_of(ijk[0], ijk[1], ijk[2], edges->e[ijk[0]][ijk[1]], edges->e[ijk[1]][ijk[2]],
                                         edges->e[ijk[0]][ijk[2]]);
    kernel_weights_mend(p, c->least[0], hit, kernel_cell_spot(c, w.i), kernel_cell_spot(c, w.j),
                        kernel_cell_spot(c, w.k), &w);
    out->mask = hit;
    out->t = kernel_weigh_depth(&w, c->z);
    kernel_triangle_values(c, shape, &w, has_colour, out);
    return true;
}

/* Of a quad that is a triangle. */
static __attribute__((noinline, cold)) int kernel_collapsed_crossings(const kernel_packet *p, const kernel_cell *c,
                                                                      const kernel_shape *shape,
                                                                      const kernel_edges *edges, vm rays,
                                                                      const int corner[4], bool has_colour,
                                                                      kernel_crossing *out)
{
    int n = 0;
    for (int half = 0; half < 2; half++) {
        const int corners[3] = {corner[0], corner[half + 1], corner[half + 2]};
        n += kernel_triangle_crossing(p, c, shape, edges, rays, corners, has_colour, &out[n]);
    }
    return n;
}

/* How many crossings there are, 0 to 2; each ray's are in one of them or in both. */
SIMD_INLINE int kernel_quad_crossings(const kernel_packet *p, const kernel_cell *c, const kernel_shape *shape,
                                      const kernel_projected *q, const kernel_edges *edges, vm rays,
                                      const int corner[4], bool has_colour, kernel_crossing *out)
{
    kernel_quad quad;
    kernel_quad_place places[2];
    vm once = vm_none();
    for (int half = 0; half < 2; half++) {
        const int corners[3] = {corner[0], corner[half + 1], corner[half + 2]};
        int ijk[3];
        kernel_triangle_order(c, corners, ijk);
        once = vm_xor(once, kernel_triangle(edges, rays, ijk));
    }
    quad.e01 = edges->e[corner[0]][corner[1]];
    quad.e03 = edges->e[corner[0]][corner[3]];
    quad.e12 = kernel_corner_edge(c, edges, corner[1], corner[2]);
    quad.e32 = kernel_corner_edge(c, edges, corner[3], corner[2]);
    const vm twice = kernel_quad_sides(rays, quad.e01, quad.e32, quad.e03, quad.e12);
    if (!vm_any(vm_or(once, twice))) return 0;
    if (kernel_quad_collapses(c, corner))
        return kernel_collapsed_crossings(p, c, shape, edges, rays, corner, has_colour, out);
    kernel_quad_take(q, c->z, corner, &quad);
    const int n = kernel_quad_places(&quad, once, twice, places);
    for (int i = 0; i < n; i++) kernel_quad_values(c, shape, corner, &places[i], has_colour, &out[i]);
    return n;
}

/* All crossings of a cell with quads; returns how many triangles are crossed by some ray. */
SIMD_INLINE int kernel_poly_crossings(const kernel_packet *p, const kernel_cell *c, vm rays, bool has_colour,
                                      kernel_crossing out[KERNEL_MAX_CROSSINGS])
{
    const kernel_shape *shape = kernel_cell_shape(c->type);
    kernel_projected q;
    kernel_edges edges;
    for (int i = 0; i < c->count; i++) {
        q.x[i] = kernel_project_x(p, kernel_cell_spot(c, i));
        q.y[i] = kernel_project_y(p, kernel_cell_spot(c, i));
    }
    for (int n = 0; n < shape->edge_count; n++)
        kernel_poly_edge(p, c, n, shape->edges[n][0], shape->edges[n][1], &edges);
    int n = 0;
    for (int face = 0; face < shape->face_count; face++) {
        const signed char *loop = shape->faces[face].vertices;
        if (shape->faces[face].count == 3) {
            const int corners[3] = {loop[0], loop[1], loop[2]};
            n += kernel_triangle_crossing(p, c, shape, &edges, rays, corners, has_colour, &out[n]);
            continue;
        }
        int corner[4];
        kernel_quad_corners(c, loop, corner);
        kernel_poly_edge(p, c, shape->edge_count + face, corner[0], corner[2], &edges);
        n += kernel_quad_crossings(p, c, shape, &q, &edges, rays, corner, has_colour, &out[n]);
    }
    return n;
}

/* Take the nearest crossing of each ray out of the list: false where no ray has one left. */
SIMD_INLINE bool kernel_take_nearest(kernel_crossing *list, int count, kernel_crossing *out)
{
    vi taken = vi_set(-1);
    out->mask = vm_none();
    out->t = vf_set(INFINITY);
    out->v = out->w = out->r[0] = out->r[1] = out->r[2] = vf_set(0);
    for (int n = 0; n < count; n++) {
        const vm nearer = vm_and(list[n].mask, vf_lt(list[n].t, out->t));
        out->mask = vm_or(out->mask, nearer);
        out->t = vf_select(nearer, list[n].t, out->t);
        out->v = vf_select(nearer, list[n].v, out->v);
        out->w = vf_select(nearer, list[n].w, out->w);
        for (int a = 0; a < 3; a++) out->r[a] = vf_select(nearer, list[n].r[a], out->r[a]);
        taken = (vi)vf_select(nearer, (vf)vi_set(n), (vf)taken);
    }
    for (int n = 0; n < count; n++) list[n].mask = vm_andnot(list[n].mask, vf_eq(vf_from_vi(taken), vf_set((float)n)));
    return vm_any(out->mask);
}

SIMD_INLINE int kernel_poly_intervals(const kernel_packet *p, const kernel_cell *c, vm rays, bool has_colour,
                                      kernel_interval out[KERNEL_MAX_CELL_INTERVALS])
{
    kernel_crossing list[KERNEL_MAX_CROSSINGS], in, next;
    const int crossings = kernel_poly_crossings(p, c, rays, has_colour, list);
    int n = 0;
    while (n < KERNEL_MAX_CELL_INTERVALS && kernel_take_nearest(list, crossings, &in) &&
           kernel_take_nearest(list, crossings, &next)) {
        out[n].mask = vm_and(in.mask, next.mask);
        out[n].t_in = in.t;
        out[n].t_out = next.t;
        out[n].v_in = in.v;
        out[n].v_out = next.v;
        out[n].w_in = in.w;
        out[n].w_out = next.w;
        memcpy(out[n].r_in, in.r, sizeof in.r);
        memcpy(out[n].r_out, next.r, sizeof next.r);
        n++;
    }
    return n;
}

#endif
