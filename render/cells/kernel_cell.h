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

#include <string.h>

#include "grid.h"
#include "kernel_line.h"
#include "kernel_packet.h"
#include "kernel_types.h"
#include "simd.h"

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

/* Which of the vertices, bit by bit, the face has; those not yet known are added. 0: it needs more than four. */
static int kernel_face_corners(const grid *g, int64_t face, int64_t vertices[4], int *count)
{
    int64_t first, end;
    int corners = 0;
    grid_face_vertices(g, face, &first, &end);
    for (int64_t i = first; i < end; i++) {
        const int64_t vertex = grid_array_index(&g->face_connectivity, i);
        int at = 0;
        while (at < *count && vertices[at] != vertex) at++;
        if (at == 4) return 0;
        if (at == *count) vertices[(*count)++] = vertex;
        corners |= 1 << at;
    }
    return corners;
}

/* Is the polyhedron a tet, on which its field is linear as a tet's is? Then it is drawn as one, to the same bits. Each
 * triangle is to lack another vertex: two of them, each twice, bound nothing. Faces in one place are none. */
static bool kernel_is_tet(const grid *g, int64_t cell, int64_t vertices[4])
{
    int64_t first, end;
    int count = 0, lacking = 0;
    grid_cell_faces(g, cell, &first, &end);
    for (int64_t i = first; i < end; i++) {
        const int corners = kernel_face_corners(g, grid_array_index(&g->connectivity, i), vertices, &count);
        if (corners && !(corners & (corners - 1))) continue;
        const int lack = ~corners & 15;
        if (!corners || !lack || (lack & (lack - 1)) || (lacking & lack)) return false;
        lacking |= lack;
    }
    return count == 4 && lacking == 15;
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

SIMD_INLINE kernel_spot kernel_cell_spot(const kernel_cell *c, int i)
{
    return (kernel_spot){c->x[i], c->y[i], c->z[i]};
}

#endif
