/* Hexes, one a lane, placed for a tile and given their lines: the operations of
 * kernel_cell_relative(), kernel_place_in(), kernel_cell_order() and kernel_poly_lines(), and so the same bits, for as
 * many hexes at once as a vector has lanes. Vertices are turned into the order of coordinates first, so that all else
 * comes in order. What is computed in double is computed in two halves. */
#ifndef RENDER_KERNEL_PLACED_HEXES_H
#define RENDER_KERNEL_PLACED_HEXES_H

#include <math.h>
#include <string.h>

#include "grid.h"
#include "kernel_arrays.h"
#include "kernel_cell.h"
#include "kernel_shapes.h"
#include "kernel_types.h"
#include "kernel_wide.h"
#include "simd.h"

enum {
    KERNEL_HEX_EDGES = 12,
    KERNEL_HEX_FACES = 6,
    KERNEL_HEX_LINES = KERNEL_HEX_EDGES + KERNEL_HEX_FACES,
};

/* Cells in lanes. A line's direction is the shape's: from an edge's first vertex to its second, and on a face from its
 * loop's vertex 0 to 2, or 1 to 3 where it is turned. */
typedef struct kernel_placed_hexes {
    float at[4][8][SIMD_WIDTH]; /* places in tile space, and the field less the isovalue, scaled */
    float c[KERNEL_HEX_LINES][SIMD_WIDTH], cu[KERNEL_HEX_LINES][SIMD_WIDTH], cv[KERNEL_HEX_LINES][SIMD_WIDTH];
    float doubt[SIMD_WIDTH];                      /* the largest of the bounds */
    int32_t turned[SIMD_WIDTH];                   /* bits of faces whose diagonal is from the loop's vertex 1 to 3 */
    int32_t quads[KERNEL_HEX_FACES * SIMD_WIDTH]; /* face by face: kernel_quad_corners(), four bits each */
    /* for kernel_placed_hex_cell() */
    float bound[KERNEL_HEX_LINES][SIMD_WIDTH];
    kernel_whole world[3][8];
    int32_t rank[8][SIMD_WIDTH], vertex[8][SIMD_WIDTH];
} kernel_placed_hexes;

/* ---- order ---- */

/* Vertices on their way into order, by the bits of x, y, z that kernel_cell_turn() has for them. */
typedef struct kernel_turned_hexes {
    kernel_taken at[8][3];
    vf rank[8];
    vi vertex[8];
} kernel_turned_hexes;

static const signed char kernel_hex_bits[8] = {0, 1, 3, 2, 4, 5, 7, 6}; /* of a vertex; and back */

SIMD_INLINE void kernel_vf_swap(vm lanes, vf *a, vf *b)
{
    const vf was = *a;
    *a = vf_select(lanes, *b, was);
    *b = vf_select(lanes, was, *b);
}

SIMD_INLINE void kernel_turned_swap(kernel_turned_hexes *h, bool is_narrow, vm lanes, int i, int j)
{
    const vi was = h->vertex[i];
    for (int a = 0; a < 3; a++) kernel_taken_swap(is_narrow, lanes, &h->at[i][a], &h->at[j][a]);
    kernel_vf_swap(lanes, &h->rank[i], &h->rank[j]);
    h->vertex[i] = vi_select(lanes, h->vertex[j], was);
    h->vertex[j] = vi_select(lanes, was, h->vertex[j]);
}

/* kernel_rank_positions(), of vertices as they came. */
SIMD_INLINE void kernel_turned_rank(kernel_turned_hexes *h, bool is_narrow)
{
    const vf zero = vf_set(0), one = vf_set(1);
    for (int i = 0; i < 8; i++) h->rank[kernel_hex_bits[i]] = vf_set((float)i);
    for (int i = 0; i < 8; i++)
        for (int j = i + 1; j < 8; j++) {
            const int k = kernel_hex_bits[i], l = kernel_hex_bits[j];
            const vf after = vf_select(kernel_taken_before(is_narrow, h->at[l], h->at[k]), one, zero);
            h->rank[k] += after;
            h->rank[l] -= after;
        }
}

/* kernel_cell_turn(): the least vertex to bits 0, then the axes in the order of its neighbours. */
SIMD_INLINE void kernel_turned_turn(kernel_turned_hexes *h, bool is_narrow)
{
    vm turn[3] = {vm_none(), vm_none(), vm_none()};
    for (int b = 1; b < 8; b++) {
        const vm least = vf_eq(h->rank[b], vf_set(0));
        for (int a = 0; a < 3; a++)
            if (b >> a & 1) turn[a] = vm_or(turn[a], least);
    }
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 8; b++)
            if (!(b >> a & 1)) kernel_turned_swap(h, is_narrow, turn[a], b, b | 1 << a);
    for (int k = 0; k < 3; k++) {
        const int at = k == 1, low = 1 << at, high = 2 << at, other = 7 & ~(low | high); /* 0 and 1, 1 and 2, 0 and 1 */
        const vm swap = vf_lt(h->rank[high], h->rank[low]);
        kernel_turned_swap(h, is_narrow, swap, low, high);
        kernel_turned_swap(h, is_narrow, swap, low | other, high | other);
    }
}

/* Lanes with two neighbouring vertices in one place: kernel_quad_collapses() of some face. */
SIMD_INLINE vm kernel_turned_collapsed(const kernel_turned_hexes *h, bool is_narrow)
{
    vm out = vm_none();
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 8; b++) {
            const int c = b | 1 << a;
            vm same = vm_all_lanes();
            if (b == c) continue;
            for (int axis = 0; axis < 3; axis++)
                same = vm_and(same, kernel_taken_eq(is_narrow, &h->at[b][axis], &h->at[c][axis]));
            out = vm_or(out, same);
        }
    return out;
}

/* Sets the vertices, their places and ranks; returns the lanes of which some face is a triangle. */
SIMD_INLINE vm kernel_turned_fetch(kernel_placed_hexes *out, const kernel_arrays *p, bool is_narrow,
                                   int32_t (*const vertices)[SIMD_WIDTH], vf rank[8])
{
    kernel_turned_hexes h;
    for (int i = 0; i < 8; i++) {
        const int b = kernel_hex_bits[i];
        memcpy(&h.vertex[b], vertices[i], sizeof h.vertex[b]);
        kernel_arrays_place(p, is_narrow, h.vertex[b], h.at[b]);
    }
    kernel_turned_rank(&h, is_narrow);
    kernel_turned_turn(&h, is_narrow);
    for (int i = 0; i < 8; i++) {
        const int b = kernel_hex_bits[i];
        const vi own_rank = vi_from_vf(h.rank[b]);
        for (int a = 0; a < 3; a++) out->world[a][i] = kernel_taken_whole(is_narrow, &h.at[b][a]);
        rank[i] = h.rank[b];
        memcpy(out->rank[i], &own_rank, sizeof own_rank);
        memcpy(out->vertex[i], &h.vertex[b], sizeof h.vertex[b]);
    }
    return kernel_turned_collapsed(&h, is_narrow);
}

/* ---- places and values ---- */

/* kernel_place_in() of a vertex: half of the lanes. */
SIMD_INLINE void kernel_half_place(const kernel_frame *f, const kernel_tile *tile, const kernel_half world[3], int half,
                                   vf out[3])
{
    const double *eye = f->job->camera.eye;
    kernel_half d[3], at[3];
    for (int a = 0; a < 3; a++) d[a] = world[a] - eye[a];
    for (int a = 0; a < 3; a++)
        at[a] = f->scaled_axes[a][0] * d[0] + f->scaled_axes[a][1] * d[1] + f->scaled_axes[a][2] * d[2];
    const kernel_half depth = f->job->camera.is_orthographic ? f->job->space.scale + 0 * at[2] : at[2];
    kernel_half_put(&out[0], half, at[0] - tile->centre_x * depth);
    kernel_half_put(&out[1], half, at[1] - tile->centre_y * depth);
    kernel_half_put(&out[2], half, at[2] - tile->depth_shift);
}

/* kernel_cell_relative() of eight values. */
SIMD_INLINE void kernel_lanes_relative(const kernel_whole values[8], const double isovalues[SIMD_WIDTH], vf out[8])
{
    for (int half = 0; half < 2; half++) {
        kernel_half isovalue, v[8], largest = {0};
        memcpy(&isovalue, isovalues + half * KERNEL_HALF, sizeof isovalue);
        for (int i = 0; i < 8; i++) {
            v[i] = values[i].half[half] - isovalue;
            largest = kernel_half_max(kernel_half_abs(v[i]), largest);
        }
        /* kernel_mirrored_power() */
        kernel_half_mask exponent = (kernel_half_mask)largest >> 52;
        const kernel_half_mask low = exponent < 23;
        const kernel_half_mask high = exponent > 2023;
        exponent = (low & 23) | (high & 2023) | (exponent & ~(low | high));
        const kernel_half scale = (kernel_half)((2046 - exponent) << 52);
        for (int i = 0; i < 8; i++) kernel_half_put(&out[i], half, v[i] * scale);
    }
}

/* ---- lines ---- */

/* A vertex as lines take it. */
typedef struct kernel_lanes_spot {
    vf at[3], size;
} kernel_lanes_spot;

/* kernel_spot_size(). */
SIMD_INLINE vf kernel_lanes_size(const kernel_frame *f, const kernel_tile *tile, const vf at[3])
{
    vf depth = vf_set(1);
    if (!f->job->camera.is_orthographic) depth = vf_abs(at[2]) + fabsf((float)f->depth_shift);
    return 2 * vf_max(vf_abs(at[0]), vf_abs(at[1])) + 5 * tile->radius * depth;
}

/* kernel_line_between(); which of the two is the first decides signs alone. */
SIMD_INLINE void kernel_placed_hex_line(kernel_placed_hexes *out, const kernel_frame *f, int n,
                                        const kernel_lanes_spot *a, const kernel_lanes_spot *b, vf *doubt)
{
    const bool flat = f->job->camera.is_orthographic;
    vf line[3];
    for (int half = 0; half < 2; half++) {
        const kernel_half ax = kernel_half_of(&a->at[0], half), ay = kernel_half_of(&a->at[1], half);
        const kernel_half bx = kernel_half_of(&b->at[0], half), by = kernel_half_of(&b->at[1], half);
        kernel_half da = kernel_half_of(&a->at[2], half) + f->depth_shift;
        kernel_half db = kernel_half_of(&b->at[2], half) + f->depth_shift;
        if (flat) da = db = (kernel_half){0} + 1;
        kernel_half_put(&line[0], half, ax * by - bx * ay);
        kernel_half_put(&line[1], half, db * ay - da * by);
        kernel_half_put(&line[2], half, da * bx - db * ax);
    }
    const vf bound = 6 * 6e-8f * (a->size * b->size);
    *doubt = vf_max(bound, *doubt);
    vf_store(out->c[n], line[0]);
    vf_store(out->cu[n], line[1]);
    vf_store(out->cv[n], line[2]);
    vf_store(out->bound[n], bound);
}

/* kernel_quad_corners() of the loop, four bits a corner; odd_lanes: where that begins at the loop's vertex 1 or 3. */
SIMD_INLINE vi kernel_hex_quad_word(const signed char *loop, const vf rank[8], vm *odd_lanes)
{
    const vf r[4] = {rank[loop[0]], rank[loop[1]], rank[loop[2]], rank[loop[3]]};
    /* The least of 0 and 2, of 1 and 3, and of all. */
    const vm second = vf_lt(r[2], r[0]), fourth = vf_lt(r[3], r[1]),
             odd = vf_lt(vf_min(r[1], r[3]), vf_min(r[0], r[2]));
    const vm far = vm_or(vm_and(odd, fourth), vm_andnot(second, odd)); /* it is 2 or 3 */
    /* From 0 or 2 the neighbours ahead are 1 or 3, from 1 or 3 they are 2 or 0. */
    const vm ahead = vm_xor(far, vm_or(vm_and(odd, second), vm_andnot(vm_not(fourth), odd)));
    const vi one = vi_set(1), none = vi_set(0);
    const vi first = vi_select(odd, one, none) + (vi_select(far, one, none) << 1);
    const vi step = vi_select(ahead, one, vi_set(-1));
    const int loops = loop[0] | loop[1] << 4 | loop[2] << 8 | loop[3] << 12;
    vi word = none;
    for (int i = 0; i < 4; i++) word |= (vi_set(loops) >> (((first + i * step) & 3) << 2) & 15) << (4 * i);
    *odd_lanes = odd;
    return word;
}

/* Of all faces the corners, and the diagonals. */
SIMD_INLINE void kernel_placed_hex_face(kernel_placed_hexes *out, const kernel_frame *f, int face, const vf rank[8],
                                        const kernel_lanes_spot spots[8], vi *turned, vf *doubt)
{
    const signed char *loop = kernel_shapes[0].faces[face].vertices;
    vm odd;
    const vi word = kernel_hex_quad_word(loop, rank, &odd);
    memcpy(out->quads + face * SIMD_WIDTH, &word, sizeof word);
    *turned |= vi_select(odd, vi_set(1 << face), vi_set(0));
    kernel_lanes_spot from, to;
    for (int a = 0; a < 3; a++) {
        from.at[a] = vf_select(odd, spots[loop[1]].at[a], spots[loop[0]].at[a]);
        to.at[a] = vf_select(odd, spots[loop[3]].at[a], spots[loop[2]].at[a]);
    }
    from.size = vf_select(odd, spots[loop[1]].size, spots[loop[0]].size);
    to.size = vf_select(odd, spots[loop[3]].size, spots[loop[2]].size);
    kernel_placed_hex_line(out, f, KERNEL_HEX_EDGES + face, &from, &to, doubt);
}

/* kernel_poly_lines(). */
SIMD_INLINE void kernel_placed_hex_lines(kernel_placed_hexes *out, const kernel_frame *f, const kernel_tile *tile,
                                         const vf rank[8])
{
    kernel_lanes_spot spots[8];
    vi turned = vi_set(0);
    vf doubt = vf_set(0);
    for (int i = 0; i < 8; i++) {
        for (int a = 0; a < 3; a++) spots[i].at[a] = vf_load(out->at[a][i]);
        spots[i].size = kernel_lanes_size(f, tile, spots[i].at);
    }
    for (int n = 0; n < KERNEL_HEX_EDGES; n++) {
        const signed char *edge = kernel_shapes[0].edges[n];
        kernel_placed_hex_line(out, f, n, &spots[edge[0]], &spots[edge[1]], &doubt);
    }
    for (int face = 0; face < KERNEL_HEX_FACES; face++)
        kernel_placed_hex_face(out, f, face, rank, spots, &turned, &doubt);
    vf_store(out->doubt, doubt);
    memcpy(out->turned, &turned, sizeof turned);
}

/* ---- all of it ---- */

/* The eight vertices of hexes, lane by lane. Returns the lanes of which some face is a triangle. */
static __attribute__((noinline)) vm kernel_place_hexes(kernel_placed_hexes *out, const kernel_arrays *p,
                                                       const kernel_frame *f, const kernel_tile *tile,
                                                       int32_t vertices[8][SIMD_WIDTH],
                                                       const double isovalues[SIMD_WIDTH])
{
    kernel_whole values[8];
    vf relative[8], rank[8];
    const vm collapsed = p->has_narrow_places ? kernel_turned_fetch(out, p, true, vertices, rank)
                                              : kernel_turned_fetch(out, p, false, vertices, rank);
    for (int i = 0; i < 8; i++) {
        vi vertex;
        vf at[3];
        memcpy(&vertex, out->vertex[i], sizeof vertex);
        values[i] = kernel_numbers_take(&p->values, vertex);
        for (int half = 0; half < 2; half++) {
            const kernel_half world[3] = {out->world[0][i].half[half], out->world[1][i].half[half],
                                          out->world[2][i].half[half]};
            kernel_half_place(f, tile, world, half, at);
        }
        for (int a = 0; a < 3; a++) vf_store(out->at[a][i], at[a]);
    }
    kernel_lanes_relative(values, isovalues, relative);
    for (int i = 0; i < 8; i++) vf_store(out->at[3][i], relative[i]);
    kernel_placed_hex_lines(out, f, tile, rank);
    return collapsed;
}

/* ---- one cell ---- */

SIMD_INLINE void kernel_placed_hex_flip(kernel_line *line)
{
    line->c = -line->c;
    line->cu = -line->cu;
    line->cv = -line->cv;
}

/* Lane n as a cell, with all that surfaces ask of it; its lines from the vertex of less rank. */
static __attribute__((noinline)) void kernel_placed_hex_cell(const kernel_placed_hexes *h, int n, kernel_cell *c)
{
    const kernel_shape *shape = &kernel_shapes[0];
    c->type = GRID_HEX;
    c->count = 8;
    c->is_finite = c->is_placed = c->has_lines = true;
    c->has_normal = false;
    for (int i = 0; i < 8; i++) {
        c->x[i] = h->at[0][i][n];
        c->y[i] = h->at[1][i][n];
        c->z[i] = h->at[2][i][n];
        c->f[i] = h->at[3][i][n];
        c->rank[i] = h->rank[i][n];
        for (int a = 0; a < 3; a++) c->world[i][a] = kernel_whole_lane(&h->world[a][i], n);
    }
    for (int i = 0; i < KERNEL_HEX_LINES; i++) {
        const bool is_edge = i < KERNEL_HEX_EDGES;
        const int face = is_edge ? 0 : i - KERNEL_HEX_EDGES, turn = h->turned[n] >> face & 1;
        const signed char *ends = is_edge ? shape->edges[i] : shape->faces[face].vertices + turn;
        c->lines[i] = (kernel_line){h->c[i][n], h->cu[i][n], h->cv[i][n], h->bound[i][n]};
        if (c->rank[ends[is_edge ? 1 : 2]] < c->rank[ends[0]]) kernel_placed_hex_flip(&c->lines[i]);
    }
    c->least[0] = (float)INFINITY;
}

/* A face's edges around, and whether they are the other way. */
static const signed char kernel_hex_around[KERNEL_HEX_FACES][4][2] = {
    {{8, 0}, {7, 1}, {11, 1}, {3, 0}},  {{1, 0}, {10, 0}, {5, 1}, {9, 1}}, {{0, 0}, {9, 0}, {4, 1}, {8, 1}},
    {{11, 0}, {6, 1}, {10, 1}, {2, 0}}, {{3, 1}, {2, 1}, {1, 1}, {0, 1}},  {{4, 0}, {5, 0}, {6, 0}, {7, 0}}};

/* The first and the last of the faces that are crossed once, and the rays that must be traced in the cell alone. */
typedef struct kernel_hex_crossed {
    vm two, alone;
    vi first, last;
} kernel_hex_crossed;

#endif
