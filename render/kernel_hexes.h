/* Hexes, as many at once as there are lanes, in a tile that traces what is binned there. A cell of a few pixels leaves
 * most of a block's packet without anything to do, and of the rays in it a half has no crossing to look for. So rays
 * of several cells are put side by side, and what goes on of them is put side by side again:
 *
 *     pixels of boxes       which faces does the ray cross?         signs of edge functions
 *     rays in two faces     where, and what is the field there?     patches
 *     rays with a root      where is it, and its normal?            Newton's method
 *     other rays            what roots are there?                   kernel_roots.h, cell by cell
 *
 * A lane takes its cell's numbers out of the batch's vectors. Where the field is known to be monotone along all of the
 * tile's rays (kernel_roots.h), the signs at the faces tell of the root; rays of other cells are searched for roots,
 * all of one cell at once. Rays of which an edge function is in doubt, or which cross not just two of a cell's faces
 * once each, are for the cell alone (kernel_surface.h). Every operation is that of a cell alone in the same order, so
 * that a hit has the same bits however it came to be found. */
#ifndef RENDER_KERNEL_HEXES_H
#define RENDER_KERNEL_HEXES_H

#include "kernel_batch.h"

enum {
    KERNEL_HEX_EDGES = 12,
    KERNEL_HEX_FACES = 6,
    KERNEL_HEX_LINES = KERNEL_HEX_EDGES + KERNEL_HEX_FACES,
    KERNEL_HEX_PIXELS = 64, /* of a cell's box: with more of them, the cell is traced block by block */
    KERNEL_HEX_RAYS = 512,
    KERNEL_HEX_ROOM = KERNEL_HEX_RAYS + KERNEL_TILE * KERNEL_TILE + SIMD_WIDTH
};

/* Rays between two faces of their cells. */
typedef struct kernel_hex_ends {
    float t[2][KERNEL_HEX_ROOM], v[2][KERNEL_HEX_ROOM], r[2][3][KERNEL_HEX_ROOM];
} kernel_hex_ends;

/* A ray: its pixel in the tile, row by row, and its cell's lane. */
typedef struct kernel_hex_rays {
    int count;
    uint8_t pixel[KERNEL_HEX_ROOM], lane[KERNEL_HEX_ROOM];
} kernel_hex_rays;

typedef struct kernel_hexes {
    int count, layer, part;
    kernel_cell cells[SIMD_WIDTH];
    kernel_poly polys[SIMD_WIDTH];
    int value[SIMD_WIDTH];
    float near[SIMD_WIDTH];
    /* cells in lanes */
    float at[3][8][SIMD_WIDTH], f[8][SIMD_WIDTH];
    float c[KERNEL_HEX_LINES][SIMD_WIDTH], cu[KERNEL_HEX_LINES][SIMD_WIDTH], cv[KERNEL_HEX_LINES][SIMD_WIDTH];
    float doubt[SIMD_WIDTH], jump[SIMD_WIDTH];    /* jump: less than nothing where the field is not monotone */
    float turned[SIMD_WIDTH];                     /* bits of faces whose diagonal is from the loop's vertex 1 to 3 */
    float corners[KERNEL_HEX_FACES * SIMD_WIDTH]; /* bits, face by face: the quad's corners, four each */
    kernel_hex_rays rays, met, found, others;
    uint8_t faces[KERNEL_HEX_ROOM]; /* of those met: the first, and 8 times the second */
    kernel_hex_ends found_ends, other_ends;
} kernel_hexes;

/* A face's edges around, and whether they are the other way. */
static const signed char kernel_hex_around[KERNEL_HEX_FACES][4][2] = {
    {{8, 0}, {7, 1}, {11, 1}, {3, 0}},  {{1, 0}, {10, 0}, {5, 1}, {9, 1}}, {{0, 0}, {9, 0}, {4, 1}, {8, 1}},
    {{11, 0}, {6, 1}, {10, 1}, {2, 0}}, {{3, 1}, {2, 1}, {1, 1}, {0, 1}},  {{4, 0}, {5, 0}, {6, 0}, {7, 0}}};

/* ---- lanes are cells ---- */

static void kernel_hexes_begin(kernel_hexes *h)
{
    h->count = h->rays.count = 0;
    h->layer = h->part = -1;
}

SIMD_INLINE void kernel_hex_line(kernel_hexes *h, int n, int lane, const kernel_line *line, bool is_turned)
{
    h->c[n][lane] = is_turned ? -line->c : line->c;
    h->cu[n][lane] = is_turned ? -line->cu : line->cu;
    h->cv[n][lane] = is_turned ? -line->cv : line->cv;
    h->doubt[lane] = simd_max(line->bound, h->doubt[lane]);
}

/* The cell, placed and with its lines, into a lane. */
static void kernel_hex_put(kernel_hexes *h, int lane, const kernel_cell *c, const kernel_bounds *bounds)
{
    const kernel_shape *shape = &kernel_shapes[0];
    int32_t turned = 0;
    h->doubt[lane] = 0;
    h->jump[lane] = bounds->is_monotone ? bounds->jump : -1;
    for (int i = 0; i < 8; i++) {
        h->at[0][i][lane] = c->x[i];
        h->at[1][i][lane] = c->y[i];
        h->at[2][i][lane] = c->z[i];
        h->f[i][lane] = c->f[i];
    }
    for (int n = 0; n < KERNEL_HEX_EDGES; n++)
        kernel_hex_line(h, n, lane, &c->lines[n], c->rank[shape->edges[n][1]] < c->rank[shape->edges[n][0]]);
    for (int face = 0; face < KERNEL_HEX_FACES; face++) {
        const signed char *loop = shape->faces[face].vertices;
        int corner[4], first = 0;
        kernel_quad_corners(c, loop, corner);
        while (loop[first] != corner[0]) first++;
        turned |= (first & 1) << face;
        kernel_hex_line(h, KERNEL_HEX_EDGES + face, lane, &c->lines[KERNEL_HEX_EDGES + face], first > 1);
        const int32_t word = corner[0] | corner[1] << 4 | corner[2] << 8 | corner[3] << 12;
        memcpy(&h->corners[face * SIMD_WIDTH + lane], &word, sizeof word);
    }
    memcpy(&h->turned[lane], &turned, sizeof turned);
}

/* ---- lanes are rays ---- */

typedef struct kernel_hex_packet {
    vm active;
    vi lane, at;
    vf far, u, v;
    kernel_rays rays;
} kernel_hex_packet;

SIMD_INLINE void kernel_hex_packet_begin(kernel_hex_packet *p, const kernel_tile_trace *t, const kernel_hex_rays *rays,
                                         int first)
{
    const kernel_tile *tile = &t->tile;
    const bool flat = t->frame->job->camera.is_orthographic;
    const int left = rays->count - first;
    const vi pixel = kernel_bytes(rays->pixel + first), column = pixel & (KERNEL_TILE - 1), row = pixel >> 4;
    p->active = left < SIMD_WIDTH ? vm_from_bits((1u << left) - 1) : vm_all_lanes();
    p->lane = kernel_bytes(rays->lane + first) & (SIMD_WIDTH - 1);
    p->at = kernel_batch_at(column & (KERNEL_TILE - 1), row & (KERNEL_TILE - 1));
    p->far = kernel_batch_far(t, p->at);
    p->rays = (kernel_rays){kernel_batch_of_tile(tile->origin_x, column), kernel_batch_of_tile(tile->origin_y, row),
                            kernel_batch_of_tile(tile->slope_x, column), kernel_batch_of_tile(tile->slope_y, row)};
    p->u = flat ? p->rays.origin_x : p->rays.slope_x;
    p->v = flat ? p->rays.origin_y : p->rays.slope_y;
}

SIMD_INLINE vf kernel_hex_take(const float *of, vi lane)
{
    return vf_permute(vf_load(of), lane);
}

SIMD_INLINE void kernel_hex_ray_add(kernel_hex_rays *to, const kernel_hex_rays *from, int i)
{
    to->pixel[to->count] = from->pixel[i];
    to->lane[to->count] = from->lane[i];
    to->count++;
}

/* So that whole vectors may be read. */
SIMD_INLINE void kernel_hex_rays_close(kernel_hex_rays *rays)
{
    memset(rays->pixel + rays->count, 0, SIMD_WIDTH);
    memset(rays->lane + rays->count, 0, SIMD_WIDTH);
}

/* Rays that are for the cell alone. */
static __attribute__((noinline)) unsigned kernel_hexes_alone(kernel_tile_trace *t, kernel_hexes *h,
                                                             const kernel_hex_rays *rays, int first, vi at_lanes,
                                                             unsigned wanted)
{
    unsigned blocks = 0;
    int32_t at[SIMD_WIDTH];
    memcpy(at, &at_lanes, sizeof at);
    for (; wanted; wanted &= wanted - 1) {
        const int i = __builtin_ctz(wanted), n = rays->lane[first + i];
        unsigned same = 0;
        for (unsigned more = wanted; more; more &= more - 1) {
            const int k = __builtin_ctz(more);
            if (rays->lane[first + k] == n && at[k] / SIMD_WIDTH == at[i] / SIMD_WIDTH) {
                same |= 1u << at[k] % SIMD_WIDTH;
                if (k != i) wanted &= ~(1u << k);
            }
        }
        kernel_packet *p = &t->packets[at[i] / SIMD_WIDTH];
        kernel_surface_state state = {
            .surface = t->surface, .layer = t->layer, .hits = &t->hits[at[i] / SIMD_WIDTH], .is_opaque = true};
        p->is_nearer = false;
        kernel_cell_surface(p, &state, &h->cells[n], &h->polys[n], h->value[n], vm_and(p->active, vm_from_bits(same)));
        if (p->is_nearer) blocks |= 1u << at[i] / (KERNEL_BLOCK * KERNEL_BLOCK);
    }
    return blocks;
}

/* Of rays on the same sides of a quad's opposite sides, those that may meet its patch twice: kernel_quad_bends(), and
 * a little more. Corners 0 to 3 around, and the signs of its sides from 0 to 1 and from 3 to 0. */
SIMD_INLINE vm kernel_hex_bends(const vf x[8], const vf y[8], const signed char *loop, vm rays, vm side01, vm side30)
{
    const int a = loop[0], b = loop[1], c = loop[2], d = loop[3];
    const vf across = vf_diff_of_products(x[a], y[c], x[c], y[a]), other = vf_diff_of_products(x[d], y[b], x[b], y[d]);
    const vf slack = 2e-6f * (vf_abs(across) + vf_abs(other)), sum = across + other, difference = across - other;
    const vm bent = vf_le(vf_select(side01, -sum, sum), slack);
    return vm_and(rays, vm_and(bent, vf_le(vf_select(side30, difference, -difference), slack)));
}

/* Which faces are crossed once, the first and the last of them; and who is for the cell alone. */
typedef struct kernel_hex_crossed {
    vm two, alone;
    vi first, last;
} kernel_hex_crossed;

SIMD_INLINE void kernel_hex_faces(const kernel_hexes *h, const kernel_hex_packet *p, kernel_hex_crossed *out)
{
    vm negative[KERNEL_HEX_LINES], one = vm_none(), two = one, bends = one;
    vf least = vf_set(INFINITY), x[8], y[8];
    for (int n = 0; n < KERNEL_HEX_LINES; n++) {
        const vf e = vf_muladd(kernel_hex_take(h->cv[n], p->lane), p->v,
                               vf_muladd(kernel_hex_take(h->cu[n], p->lane), p->u, kernel_hex_take(h->c[n], p->lane)));
        least = vf_min(vf_abs(e), least);
        negative[n] = vm_sign(vi_from_bits(e));
    }
    out->alone = vm_not(vf_lt(kernel_hex_take(h->doubt, p->lane), least));
    for (int i = 0; i < 8; i++) {
        const vf z = kernel_hex_take(h->at[2][i], p->lane);
        x[i] = (kernel_hex_take(h->at[0][i], p->lane) - p->rays.origin_x) - p->rays.slope_x * z;
        y[i] = (kernel_hex_take(h->at[1][i], p->lane) - p->rays.origin_y) - p->rays.slope_y * z;
    }
    const vi turned = vi_from_bits(kernel_hex_take(h->turned, p->lane));
    vf first = vf_set(0), last = first;
    for (int face = 0; face < KERNEL_HEX_FACES; face++) {
        vm around[4];
        for (int i = 0; i < 4; i++) {
            const signed char *edge = kernel_hex_around[face][i];
            around[i] = edge[1] ? vm_not(negative[edge[0]]) : negative[edge[0]];
        }
        /* From the diagonal's begin. */
        const vm turn = vm_sign(turned << (31 - face)), side = negative[KERNEL_HEX_EDGES + face];
        vm from[4];
        for (int i = 0; i < 4; i++) from[i] = vm_or(vm_and(turn, around[(i + 1) & 3]), vm_andnot(around[i], turn));
        const vm half0 = vm_andnot(vm_xor(from[1], side), vm_xor(from[0], from[1]));
        const vm half1 = vm_not(vm_or(vm_xor(side, from[2]), vm_xor(from[2], from[3])));
        const vm once = vm_and(p->active, vm_xor(half0, half1));
        const vm outside = vm_and(p->active, vm_and(vm_xor(around[0], around[2]), vm_xor(around[1], around[3])));
        bends =
            vm_or(bends, kernel_hex_bends(x, y, kernel_shapes[0].faces[face].vertices, outside, around[0], around[3]));
        out->alone = vm_or(out->alone, vm_and(two, once));
        two = vm_or(two, vm_and(one, once));
        first = vf_select(vm_andnot(once, one), vf_set((float)face), first);
        last = vf_select(once, vf_set((float)face), last);
        one = vm_or(one, once);
    }
    out->alone = vm_and(p->active, vm_or(out->alone, bends));
    out->two = vm_andnot(two, out->alone);
    out->first = vi_from_vf(first);
    out->last = vi_from_vf(last);
}

/* The rays that cross two faces of their cells go on. Returns the blocks in which something is nearer. */
static __attribute__((noinline)) unsigned kernel_hexes_meet(kernel_tile_trace *t, kernel_hexes *h)
{
    unsigned nearer = 0;
    h->met.count = 0;
    for (int n = 0; n < h->rays.count; n += SIMD_WIDTH) {
        kernel_hex_packet p;
        kernel_hex_crossed crossed;
        uint8_t faces[SIMD_WIDTH];
        kernel_hex_packet_begin(&p, t, &h->rays, n);
        p.active = vm_and(p.active, vf_le(kernel_hex_take(h->near, p.lane), p.far));
        if (!vm_any(p.active)) continue;
        kernel_hex_faces(h, &p, &crossed);
        const vi both = crossed.first | crossed.last << 3;
        for (int i = 0; i < SIMD_WIDTH; i++) faces[i] = (uint8_t)both[i];
        for (unsigned bits = vm_bits(crossed.two); bits; bits &= bits - 1) {
            const int i = __builtin_ctz(bits);
            h->faces[h->met.count] = faces[i];
            kernel_hex_ray_add(&h->met, &h->rays, n + i);
        }
        if (__builtin_expect(vm_any(crossed.alone), 0))
            nearer |= kernel_hexes_alone(t, h, &h->rays, n, p.at, vm_bits(crossed.alone));
    }
    kernel_hex_rays_close(&h->met);
    memset(h->faces + h->met.count, 0, SIMD_WIDTH);
    return nearer;
}

/* Where rays cross the face: kernel_quad_crossings(). */
typedef struct kernel_hex_place {
    vf t, v, r[3];
} kernel_hex_place;

SIMD_INLINE void kernel_hex_cross(const kernel_hexes *h, const kernel_hex_packet *p, vi face, kernel_hex_place *out)
{
    kernel_quad q;
    kernel_quad_place place;
    vf f[4];
    vi corner[4];
    const vi word = vi_from_bits(vf_gather(h->corners, face * SIMD_WIDTH + p->lane));
    for (int i = 0; i < 4; i++) {
        corner[i] = word >> (4 * i) & 7;
        const vi index = corner[i] * SIMD_WIDTH + p->lane;
        q.z[i] = vf_gather(h->at[2][0], index);
        q.x[i] = (vf_gather(h->at[0][0], index) - p->rays.origin_x) - p->rays.slope_x * q.z[i];
        q.y[i] = (vf_gather(h->at[1][0], index) - p->rays.origin_y) - p->rays.slope_y * q.z[i];
        f[i] = vf_gather(h->f[0], index);
    }
    /* Not in doubt, so these have the lines' signs. */
    q.e01 = vf_diff_of_products(q.x[0], q.y[1], q.x[1], q.y[0]);
    q.e03 = vf_diff_of_products(q.x[0], q.y[3], q.x[3], q.y[0]);
    q.e12 = vf_diff_of_products(q.x[1], q.y[2], q.x[2], q.y[1]);
    q.e32 = vf_diff_of_products(q.x[3], q.y[2], q.x[2], q.y[3]);
    kernel_quad_meet(&q, p->active, &place);
    out->t = place.t;
    out->v = kernel_bilinear(f, place.s, place.r);
    for (int a = 0; a < 3; a++) {
        vf at[4];
        for (int i = 0; i < 4; i++) {
            const vi bits = corner[i] ^ (corner[i] >> 1 & 1);
            at[i] = vf_from_vi(bits >> a & 1);
        }
        out->r[a] = (at[0] + place.s * (at[1] - at[0])) + place.r * (at[3] - at[0]);
    }
}

SIMD_INLINE void kernel_hex_place_select(vm m, const kernel_hex_place *a, const kernel_hex_place *b,
                                         kernel_hex_place *out)
{
    out->t = vf_select(m, a->t, b->t);
    out->v = vf_select(m, a->v, b->v);
    for (int i = 0; i < 3; i++) out->r[i] = vf_select(m, a->r[i], b->r[i]);
}

SIMD_INLINE void kernel_hex_ends_add(const kernel_hex_rays *met, int n, const kernel_hex_place ends[2], unsigned bits,
                                     kernel_hex_rays *rays, kernel_hex_ends *out)
{
    if (!bits) return;
    float lanes[2][5][SIMD_WIDTH];
    for (int e = 0; e < 2; e++) {
        vf_store(lanes[e][0], ends[e].t);
        vf_store(lanes[e][1], ends[e].v);
        for (int a = 0; a < 3; a++) vf_store(lanes[e][2 + a], ends[e].r[a]);
    }
    for (; bits; bits &= bits - 1) {
        const int i = __builtin_ctz(bits), to = rays->count;
        for (int e = 0; e < 2; e++) {
            out->t[e][to] = lanes[e][0][i];
            out->v[e][to] = lanes[e][1][i];
            for (int a = 0; a < 3; a++) out->r[e][a][to] = lanes[e][2 + a][i];
        }
        kernel_hex_ray_add(rays, met, n + i);
    }
}

/* kernel_poly_intervals() and the begin of kernel_poly_surface() and kernel_search_begin(). */
static __attribute__((noinline)) void kernel_hexes_cross(const kernel_tile_trace *t, kernel_hexes *h)
{
    h->found.count = h->others.count = 0;
    for (int n = 0; n < h->met.count; n += SIMD_WIDTH) {
        kernel_hex_packet p;
        kernel_hex_place face[2], ends[2];
        const vf zero = vf_set(0), endless = vf_set(INFINITY);
        const vi faces = kernel_bytes(h->faces + n);
        kernel_hex_packet_begin(&p, t, &h->met, n);
        kernel_hex_cross(h, &p, faces & 7, &face[0]);
        kernel_hex_cross(h, &p, faces >> 3 & 7, &face[1]);
        const vm swap = vf_lt(face[1].t, face[0].t);
        kernel_hex_place_select(swap, &face[1], &face[0], &ends[0]);
        kernel_hex_place_select(swap, &face[0], &face[1], &ends[1]);
        vm near = vm_and(vf_le(ends[0].t, p.far), vf_le(vf_set(t->t_near), ends[1].t));
        near = vm_and(vm_and(p.active, near), vm_and(vf_lt(ends[0].t, endless), vf_lt(ends[1].t, endless)));
        const vm change = vm_xor(vf_lt(ends[0].v, zero), vf_lt(ends[1].v, zero));
        const vf jump = kernel_hex_take(h->jump, p.lane);
        const vm far = vf_lt(jump, vf_min(vf_abs(ends[0].v), vf_abs(ends[1].v))), other = vf_lt(jump, zero);
        const vm room = vm_and(near, vm_or(change, vf_lt(ends[0].t, ends[1].t)));
        const vm close = vm_andnot(room, vm_or(change, far)), found = vm_andnot(vm_and(near, change), other);
        kernel_hex_ends_add(&h->met, n, ends, vm_bits(found), &h->found, &h->found_ends);
        kernel_hex_ends_add(&h->met, n, ends, vm_bits(vm_or(close, vm_and(room, other))), &h->others, &h->other_ends);
    }
}

/* kernel_map_setup() of a hex a lane. */
SIMD_INLINE void kernel_hex_maps(const kernel_hexes *h, vi lane, kernel_map_lanes *out)
{
    out->is_pyramid = false;
    out->tolerance = KERNEL_MAP_TOLERANCE;
    for (int n = 0; n < 4; n++) {
        vf v[8], *const c = n < 3 ? out->position[n] : out->field;
        for (int i = 0; i < 8; i++) v[i] = kernel_hex_take(n < 3 ? h->at[n][i] : h->f[i], lane);
        if (n < 3) out->origin[n] = v[0];
        for (int half = 0; half < 2; half++) {
            kernel_half d[8], *const e = out->exact[half][n];
            for (int i = 0; i < 8; i++) d[i] = kernel_half_of(&v[i], half);
            if (n < 3)
                for (int i = 7; i >= 0; i--) d[i] -= d[0];
            KERNEL_HEX_FIT(e, d);
            for (int i = 0; i < 8; i++) kernel_half_put(&c[i], half, e[i]);
        }
    }
}

/* Returns the blocks in which something is nearer. */
static __attribute__((noinline)) unsigned kernel_hexes_accept(kernel_tile_trace *t, const kernel_hexes *h,
                                                              const kernel_hex_rays *rays, int first, vi at_lanes,
                                                              unsigned hit, vf depth, const vf normals[3])
{
    unsigned blocks = 0;
    int32_t at[SIMD_WIDTH];
    memcpy(at, &at_lanes, sizeof at);
    for (; hit; hit &= hit - 1) {
        const int i = __builtin_ctz(hit);
        const float normal[3] = {normals[0][i], normals[1][i], normals[2][i]};
        blocks |= kernel_ray_accept(t, at[i], h->value[rays->lane[first + i]], depth[i], normal);
    }
    return blocks;
}

/* kernel_polish() and kernel_poly_accept(). */
static __attribute__((noinline)) unsigned kernel_hexes_hit(kernel_tile_trace *t, kernel_hexes *h)
{
    unsigned nearer = 0;
    for (int n = 0; n < h->found.count; n += SIMD_WIDTH) {
        kernel_hex_packet p;
        kernel_map_lanes map;
        kernel_point ends[2], at;
        vf normal[3];
        kernel_hex_packet_begin(&p, t, &h->found, n);
        for (int e = 0; e < 2; e++) {
            ends[e].t = vf_load(h->found_ends.t[e] + n);
            ends[e].value = vf_load(h->found_ends.v[e] + n);
            for (int a = 0; a < 3; a++) ends[e].r[a] = vf_load(h->found_ends.r[e][a] + n);
        }
        kernel_hex_maps(h, p.lane, &map);
        const vm open = kernel_polish_lanes(&p.rays, &map, p.active, &ends[0], &ends[1], &at);
        const vm hit = vm_and(vm_andnot(p.active, open), vm_and(vf_le(vf_set(t->t_near), at.t), vf_le(at.t, p.far)));
        if (__builtin_expect(vm_any(open), 0)) nearer |= kernel_hexes_alone(t, h, &h->found, n, p.at, vm_bits(open));
        if (!vm_any(hit)) continue;
        kernel_lanes_normal(&map, at.r, normal);
        normal[2] -= normal[0] * t->tile.shear_x + normal[1] * t->tile.shear_y; /* kernel_unshear() */
        nearer |= kernel_hexes_accept(t, h, &h->found, n, p.at, vm_bits(hit), at.t, normal);
    }
    return nearer;
}

/* So many of the others from n on, all of one cell: as a packet's. */
static __attribute__((noinline)) unsigned kernel_hexes_search(kernel_tile_trace *t, const kernel_hexes *h, int n,
                                                              int count)
{
    const kernel_hex_ends *ends = &h->other_ends;
    const int lane = h->others.lane[n];
    const vm wanted = count < SIMD_WIDTH ? vm_from_bits((1u << count) - 1) : vm_all_lanes();
    kernel_hex_packet p;
    kernel_packet q = {0};
    kernel_hits hits;
    kernel_surface_state state = {.surface = t->surface, .layer = t->layer, .hits = &hits, .is_opaque = true};
    kernel_interval i = {.mask = wanted, .w_in = vf_set(0), .w_out = vf_set(0)};
    kernel_hex_packet_begin(&p, t, &h->others, n);
    q.frame = t->frame;
    q.tile = &t->tile;
    q.thread = t->thread;
    q.active = wanted;
    q.is_nearer = q.has_view = false;
    q.is_pencil = true;
    q.origin_x = p.rays.origin_x;
    q.origin_y = p.rays.origin_y;
    q.slope_x = p.rays.slope_x;
    q.slope_y = p.rays.slope_y;
    q.u = p.u;
    q.v = p.v;
    q.t_near = vf_set(t->t_near);
    q.t_far = p.far;
    kernel_hits_begin(&hits);
    i.t_in = vf_load(ends->t[0] + n);
    i.t_out = vf_load(ends->t[1] + n);
    i.v_in = vf_load(ends->v[0] + n);
    i.v_out = vf_load(ends->v[1] + n);
    for (int a = 0; a < 3; a++) {
        i.r_in[a] = vf_load(ends->r[0][a] + n);
        i.r_out[a] = vf_load(ends->r[1][a] + n);
    }
    kernel_poly_robust(&q, &state, &h->cells[lane], &h->polys[lane], &i, wanted);
    const unsigned found = vm_bits(vm_and(wanted, hits.found));
    return found ? kernel_hexes_accept(t, h, &h->others, n, p.at, found, q.t_far, hits.normal) : 0;
}

static unsigned kernel_hexes_others(kernel_tile_trace *t, const kernel_hexes *h)
{
    unsigned nearer = 0;
    for (int n = 0, count; n < h->others.count; n += count) {
        count = 1;
        while (count < SIMD_WIDTH && n + count < h->others.count && h->others.lane[n + count] == h->others.lane[n])
            count++;
        nearer |= kernel_hexes_search(t, h, n, count);
    }
    return nearer;
}

/* ---- batches ---- */

static __attribute__((noinline)) void kernel_hexes_run(kernel_tile_trace *t, kernel_hexes *h)
{
    kernel_hex_rays_close(&h->rays);
    unsigned nearer = kernel_hexes_meet(t, h);
    kernel_hexes_cross(t, h);
    kernel_hex_rays_close(&h->found);
    kernel_hex_rays_close(&h->others);
    nearer |= kernel_hexes_hit(t, h);
    nearer |= kernel_hexes_others(t, h);
    for (; nearer; nearer &= nearer - 1) {
        const int block = __builtin_ctz(nearer);
        t->far[block / SIMD_WIDTH][block % SIMD_WIDTH] = kernel_block_far(t, block);
    }
    h->count = h->rays.count = 0;
}

/* What waits is traced. */
SIMD_INLINE void kernel_hexes_end(kernel_tile_trace *t, kernel_hexes *h)
{
    const int layer = t->layer;
    if (!h->count) return;
    kernel_tile_set_layer(t, h->layer);
    kernel_hexes_run(t, h);
    kernel_tile_set_layer(t, layer);
}

/* Is the tile's cell, with all that it takes to meet rays, one for a batch? */
SIMD_INLINE bool kernel_hexes_take(const kernel_tile_trace *t, const kernel_cell *c, unsigned box)
{
    const unsigned columns = (box >> 4 & 15) - (box & 15) + 1, rows = (box >> 12) - (box >> 8 & 15) + 1;
    if (columns * rows > KERNEL_HEX_PIXELS || c->type != GRID_HEX || t->surface->layer->root != RENDER_ROBUST ||
        !kernel_tile_layer_batches(t))
        return false;
    for (int face = 0; face < KERNEL_HEX_FACES; face++) {
        int corner[4];
        kernel_quad_corners(c, kernel_shapes[0].faces[face].vertices, corner);
        if (kernel_quad_collapses(c, corner)) return false;
    }
    return true;
}

/* The tile's cell is put to the others. */
SIMD_INLINE void kernel_hexes_add(kernel_tile_trace *t, kernel_hexes *h, const kernel_tile_shown *shown, int part,
                                  int value)
{
    const unsigned box = shown->box;
    const unsigned first = box & 15, last = box >> 4 & 15;
    if (h->layer != t->layer || h->part != part) kernel_hexes_end(t, h);
    h->layer = t->layer;
    h->part = part;
    const int lane = h->count++;
    h->cells[lane] = t->cell;
    h->polys[lane] = t->poly;
    h->value[lane] = value;
    h->near[lane] = shown->near;
    kernel_hex_put(h, lane, &t->cell, &t->poly.bounds);
    for (unsigned y = box >> 8 & 15; y <= box >> 12; y++)
        for (unsigned x = first; x <= last; x++) {
            h->rays.pixel[h->rays.count] = (uint8_t)(y << 4 | x);
            h->rays.lane[h->rays.count++] = (uint8_t)lane;
        }
    for (unsigned blocks = shown->blocks & ~t->begun; blocks; blocks &= blocks - 1)
        kernel_block_begin(t, __builtin_ctz(blocks));
    if (h->count == SIMD_WIDTH || h->rays.count >= KERNEL_HEX_RAYS) kernel_hexes_run(t, h);
}

#endif
