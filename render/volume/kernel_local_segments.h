/* Computes segments of hexes, wedges and pyramids with one ray-cell pair per lane (kernel_segments.h explains
 * segments). */
#ifndef RENDER_KERNEL_LOCAL_SEGMENTS_H
#define RENDER_KERNEL_LOCAL_SEGMENTS_H

#include <math.h>
#include <string.h>

#include "grid.h"
#include "kernel_cell.h"
#include "kernel_cell_segments.h"
#include "kernel_exact.h"
#include "kernel_integral.h"
#include "kernel_local.h"
#include "kernel_local_budget.h"
#include "kernel_local_deviation.h"
#include "kernel_local_crossings.h"
#include "kernel_local_queue.h"
#include "kernel_map.h"
#include "kernel_packet.h"
#include "kernel_preintegral.h"
#include "kernel_samples.h"
#include "kernel_segment_list.h"
#include "kernel_shapes.h"
#include "kernel_tile.h"
#include "kernel_tile_cells.h"
#include "kernel_tile_trace.h"
#include "kernel_types.h"
#include "simd.h"

/* A list of rays that have passed a stage, one word per ray: the pixel in the tile from bit 0 on, the lane of the cell
 * from KERNEL_LOCAL_CELL on, and the numbers of the two crossed faces from KERNEL_LOCAL_FACES on, three bits each. */
typedef struct kernel_local_list {
    int count;
    float words[KERNEL_LIST_ROOM];
} kernel_local_list;

enum { KERNEL_LOCAL_CELL = 8, KERNEL_LOCAL_FACES = 16 };

/* The segments of a tile's rays in a window, and the state of the vector of cells that is being processed. */
typedef struct kernel_tile_segments {
    kernel_segments packets[KERNEL_TILE_PACKETS];
    kernel_double_face precise[4]; /* the current tet in double; set only if the frame is in double */
    float depth;                   /* depth of the next window; 0 if it has not been determined yet */
    unsigned blocks;               /* blocks of the current window */
    kernel_local_faces faces;
    kernel_local_budget budget;
    kernel_local_list met, crossed[2];
    /* For each packet and lane: begin and end of the window, side by side; likewise begin and end of the ray. */
    float window[2 * KERNEL_LOCAL_PIXELS], reach[2 * KERNEL_LOCAL_PIXELS];
} kernel_tile_segments;

/* Adds a segment to a ray's list if it begins before the end of the ray's window; it must not begin before the window.
 * at: position of the ray's pixel among the packets. */
SIMD_INLINE void kernel_local_store_segment(kernel_tile_segments *b, int at, const kernel_segment *s)
{
    kernel_segments *list = &b->packets[at / SIMD_WIDTH];
    const int lane = at % SIMD_WIDTH;
    if (!(s->t_in < list->t_end[lane])) return;
    const kernel_segment_double precise = {(s->t_out - s->t_in) * list->per_t[lane], 0, 0, 0};
    if (__builtin_expect(kernel_segments_insert(list, lane, s, &precise), 1)) return;
    const kernel_unit_segment run = kernel_unit_segment_of(vf_set(precise.length), vf_set(s->v_in), vf_set(s->v_out));
    kernel_integrate(list->pieces, vm_from_bits(1u << lane), &run, &list->unsorted_light);
}

/* Coefficients of a polynomial that is zero at u = -1/2 and 1/2. kernel_local_deviation() returns its value at u,
 * kernel_local_primitive() its integral from 0 to u. */
typedef struct kernel_local_polynomial {
    vf a, b, c;
} kernel_local_polynomial;

SIMD_INLINE vf kernel_local_deviation(const kernel_local_polynomial *p, vf u)
{
    return (0.25f - u * u) * vf_muladd(vf_muladd(p->c, u, p->b), u, p->a);
}

SIMD_INLINE vf kernel_local_primitive(const kernel_local_polynomial *p, vf u)
{
    const vf square = u * u;
    const vf odd = p->a * (0.25f - square * (1.0f / 3)) + p->c * square * (1.0f / 12 - square * 0.2f);
    return u * odd + p->b * square * (0.125f - 0.25f * square);
}

/* Adds one segment per lane to the lists of the given rays. ends: t_in, t_out, v_in, v_out; places: position of each
 * ray's pixel among the packets. */
SIMD_INLINE void kernel_local_store_segments(kernel_tile_segments *b, vi places, vm rays, const vf ends[4])
{
    kernel_segment all[SIMD_WIDTH];
    int32_t at[SIMD_WIDTH];
    memcpy(at, &places, sizeof at);
    vf_store_rows(&all[0].t_in, ends);
    for (unsigned bits = vm_bits(rays); bits; bits &= bits - 1) {
        const int i = __builtin_ctz(bits);
        kernel_local_store_segment(b, at[i], &all[i]);
    }
}

/* Adds the segments of rays for which one segment is enough. */
SIMD_INLINE void kernel_local_emit_one(kernel_tile_segments *b, const kernel_local_pairs *p, vm rays)
{
    const vf t0 = p->ends[0].t, t1 = p->ends[1].t, lift = kernel_local_chord_offset(p);
    const vf ends[4] = {t0, t1, p->ends[0].value + lift, p->ends[1].value + lift};
    kernel_local_store_segments(b, p->rays.at, vm_and(rays, vm_and(vf_le(p->begin, t0), vf_lt(t0, t1))), ends);
}

/* Adds the segments of rays that need several: equal subintervals of the interval, with chords that have the mean of
 * the polynomial through the sampled values. */
static __attribute__((noinline)) void kernel_local_emit_several(kernel_tile_segments *b, const kernel_local_pairs *p,
                                                                vm rays)
{
    const vf *d = p->off_chord.field, t0 = p->ends[0].t, t1 = p->ends[1].t, v0 = p->ends[0].value,
             v1 = p->ends[1].value;
    const vf share = 1.0f / p->count, cell_interval = t1 - t0, rise = v1 - v0;
    kernel_local_polynomial f = {.a = 4.0f * d[1], .b = (32.0f / 3) * (d[2] - d[0])};
    f.c = 16.0f * ((8.0f / 3) * (d[0] + d[2]) - f.a);
    vf from = t0, u0 = vf_set(-0.5f), off0 = vf_set(0), sum0 = kernel_local_primitive(&f, u0);
    vm open = rays;
    for (int n = 1; vm_any(open); n++) {
        const vf number = vf_set((float)n), along = number * share;
        const vm inner = vm_and(open, vf_lt(number, p->count));
        const vf u1 = vf_select(inner, along - 0.5f, vf_set(0.5f)), sum1 = kernel_local_primitive(&f, u1);
        const vf to = vf_select(inner, t0 + cell_interval * along, t1), off1 = kernel_local_deviation(&f, u1);
        const vf lift = (sum1 - sum0) * p->count - 0.5f * (off0 + off1);
        const vf in = (v0 + (u0 + 0.5f) * rise) + (off0 + lift), out = (v1 - (0.5f - u1) * rise) + (off1 + lift);
        const vf ends[4] = {from, to, in, out};
        kernel_local_store_segments(b, p->rays.at, vm_and(open, vm_and(vf_le(p->begin, from), vf_lt(from, to))), ends);
        from = to;
        u0 = u1;
        off0 = off1;
        sum0 = sum1;
        open = inner;
    }
}

SIMD_INLINE void kernel_local_emit(kernel_tile_segments *b, const kernel_local_pairs *p, vm rays)
{
    const vm single = vm_and(rays, vf_le(p->count, vf_set(1))), more = vm_andnot(rays, single);
    kernel_local_emit_one(b, p, single);
    if (vm_any(more)) kernel_local_emit_several(b, p, more);
}

/* ---- parts of an interval ---- */

enum { KERNEL_LOCAL_PARTS = 8 };

/* Computes part `number` of `count` equal parts of the rays' intervals. at: end of the part before it. In the ends of
 * each part, depth and value are those of the part, but the reference coordinates are those of the whole interval. */
SIMD_INLINE void kernel_local_divide(const kernel_local_chord *chord, const kernel_local_pairs *whole, vm rays,
                                     int number, int count, kernel_local_part *at, kernel_local_pairs *parts, int type)
{
    const kernel_point *first = &whole->ends[0], *last = &whole->ends[1];
    const float share = 1.0f / (float)count;
    kernel_local_pairs *part = &parts[number];
    *part = *whole;
    part->active = rays;
    part->unsampled = 2 * (share * share) * (share * share);
    kernel_local_part_next(chord, share, rays, type, at, &part->off_chord);
    if (number > 0) part->ends[0] = parts[number - 1].ends[1];
    if (number + 1 < count) {
        const vf along = vf_set((float)(number + 1) * share);
        part->ends[1].t = first->t + (last->t - first->t) * along;
        part->ends[1].value = (first->value + (last->value - first->value) * along) + at->deviation;
    }
}

/* Adds the segments of rays for which one polynomial is not accurate enough: their intervals are divided into halves,
 * quarters or eighths, with a polynomial for each part. Returns the rays for which even eighths are not accurate
 * enough. */
SIMD_INLINE vm kernel_local_divide_intervals(const kernel_tile_trace *t, kernel_tile_segments *b,
                                             const kernel_local_pairs *whole, vm rays, int type)
{
    kernel_local_chord chord;
    kernel_local_part at;
    kernel_local_pairs parts[KERNEL_LOCAL_PARTS];
    kernel_local_chord_of(&t->thread->tile_cells->lanes.cells, &b->budget.nonlinear, whole->rays.lane, whole->ends,
                          type, &chord);
    for (int count = 2; count <= KERNEL_LOCAL_PARTS && vm_any(rays); count *= 2) {
        vm good = rays;
        kernel_local_part_begin(&whole->ends[0], &at);
        for (int i = 0; i < count && vm_any(good); i++) {
            kernel_local_divide(&chord, whole, good, i, count, &at, parts, type);
            const vm fails = kernel_local_count(t, &b->budget, &parts[i]);
            good = vm_andnot(good, vm_or(fails, parts[i].off_chord.has_diverged));
        }
        for (int i = 0; i < count && vm_any(good); i++) kernel_local_emit(b, &parts[i], good);
        rays = vm_andnot(rays, good);
    }
    return rays;
}

static __attribute__((noinline)) vm kernel_local_segments_parts(const kernel_tile_trace *t, kernel_tile_segments *b,
                                                                const kernel_local_pairs *whole, vm rays, int type)
{
    return KERNEL_OF_TYPE(type, kernel_local_divide_intervals, t, b, whole, rays);
}

/* ---- rays ---- */

/* Processes the rays in `wanted` cell by cell; rays with the same cell and packet are processed together. */
static __attribute__((noinline)) void kernel_local_segments_process_singly(kernel_tile_trace *t, vi places, vi lanes,
                                                                           unsigned wanted)
{
    const kernel_tile_cells *cells = t->thread->tile_cells;
    int32_t at[SIMD_WIDTH], lane[SIMD_WIDTH];
    memcpy(at, &places, sizeof at);
    memcpy(lane, &lanes, sizeof lane);
    while (wanted) {
        const int first = __builtin_ctz(wanted), packet = at[first] / SIMD_WIDTH;
        unsigned same = 0;
        for (unsigned more = wanted; more; more &= more - 1) {
            const int i = __builtin_ctz(more);
            if (lane[i] != lane[first] || at[i] / SIMD_WIDTH != packet) continue;
            same |= 1u << at[i] % SIMD_WIDTH;
            wanted &= ~(1u << i);
        }
        if (!kernel_tile_make_current(t, lane[first])) continue;
        kernel_packet *p = &t->packets[packet];
        kernel_curved_segments(p, &t->thread->tile_segments->packets[packet], &cells->cell,
                               cells->cell.is_constant ? NULL : &cells->map, vm_and(p->active, vm_from_bits(same)));
    }
}

SIMD_INLINE void kernel_local_list_add(kernel_local_list *list, vm rays, vi words)
{
    list->count += vf_compress(list->words + list->count, rays, vf_from_bits(words));
}

/* Loads a vector of rays of a list, from index n on. Returns the lanes that contain a ray. */
SIMD_INLINE vm kernel_local_list_load(const kernel_local_list *list, const kernel_tile *tile, int n, vi *words,
                                      kernel_lane_rays *rays)
{
    const int left = list->count - n;
    const vm all = left < SIMD_WIDTH ? vm_from_bits((1u << left) - 1) : vm_all_lanes();
    *words = vi_select(all, vi_from_bits(vf_load(list->words + n)), vi_set(0));
    kernel_lane_rays_of(rays, tile, *words, *words >> KERNEL_LOCAL_CELL);
    return all;
}

/* Finds, for a vector of rays from index n on, the faces of their cells that they cross. Rays that cross two faces are
 * listed in `crossed`; rays for which this is uncertain are processed cell by cell. */
SIMD_INLINE void kernel_local_segments_faces(kernel_tile_trace *t, kernel_tile_segments *b, int type, int n)
{
    kernel_lane_rays rays;
    kernel_curved_crossed crossed;
    vi words;
    const vm all = kernel_local_list_load(&b->met, &t->tile, n, &words, &rays);
    kernel_local_find_faces(&t->thread->tile_cells->lanes.transformed, &b->faces, &rays, all, type, &crossed);
    const vm on_quad = kernel_curved_on_quad(type, 0, crossed.first);
    words = words | crossed.first << KERNEL_LOCAL_FACES | crossed.last << (KERNEL_LOCAL_FACES + 3);
    kernel_local_list_add(&b->crossed[0], vm_and(crossed.two, on_quad), words);
    if (kernel_has_triangles(type)) kernel_local_list_add(&b->crossed[1], vm_andnot(crossed.two, on_quad), words);
    if (__builtin_expect(vm_any(crossed.alone), 0))
        kernel_local_segments_process_singly(t, rays.at, rays.lane, vm_bits(crossed.alone));
}

/* Adds the segments of a vector of rays, from index n on, each of which crosses two faces of its cell. */
SIMD_INLINE void kernel_local_segments_lanes(kernel_tile_trace *t, kernel_tile_segments *b,
                                             const kernel_local_list *list, int type, int n)
{
    const kernel_local_lanes *l = &t->thread->tile_cells->lanes;
    kernel_local_pairs p;
    vi words;
    vf end, near, far;
    p.unsampled = 1;
    p.active = kernel_local_list_load(list, &t->tile, n, &words, &p.rays);
    const vi face[2] = {words >> KERNEL_LOCAL_FACES & 7, words >> (KERNEL_LOCAL_FACES + 3) & 7};
    kernel_local_cross(&l->transformed, &b->faces, &p.rays, p.active, type, face, p.ends);
    vf_gather_pair(b->window, 2 * p.rays.at, &p.begin, &end);
    vf_gather_pair(b->reach, 2 * p.rays.at, &near, &far);
    p.active = vm_and(p.active, vm_and(vf_lt(p.begin, p.ends[1].t), vf_lt(p.ends[0].t, end)));
    const vm cut = vm_or(vf_lt(p.ends[0].t, near), vf_lt(far, p.ends[1].t));
    kernel_local_deviations_of(&l->cells, &b->budget.nonlinear, p.rays.lane, p.active, p.ends, type, &p.off_chord);
    vm alone = vm_and(p.active, vm_or(cut, p.off_chord.has_diverged));
    p.active = vm_andnot(p.active, alone);
    const vm coarse = vm_and(p.active, kernel_local_count(t, &b->budget, &p));
    kernel_local_emit(b, &p, vm_andnot(p.active, coarse));
    if (__builtin_expect(vm_any(coarse), 0)) alone = vm_or(alone, kernel_local_segments_parts(t, b, &p, coarse, type));
    if (__builtin_expect(vm_any(alone), 0))
        kernel_local_segments_process_singly(t, p.rays.at, p.rays.lane, vm_bits(alone));
}

/* Lists those of the rays from index n on that may meet their cells within the window. */
SIMD_INLINE void kernel_local_segments_overlap(const kernel_tile_trace *t, const kernel_local_lanes *l,
                                               kernel_tile_segments *b, int n)
{
    const int left = l->rays.count - n;
    const vm active = left < SIMD_WIDTH ? vm_from_bits((1u << left) - 1) : vm_all_lanes();
    const vi pixel = kernel_load_bytes(l->rays.pixel + n), lane = kernel_load_bytes(l->rays.lane + n);
    kernel_lane_rays rays;
    vf near, far, begin, end;
    kernel_lane_rays_of(&rays, &t->tile, pixel, lane);
    const vf depth = kernel_gather_lane(l->cells.origin[2], rays.lane);
    kernel_local_slab_interval(&l->cells, &rays, depth, &near, &far);
    vf_gather_pair(b->window, 2 * rays.at, &begin, &end);
    const vm meets = vm_and(vf_le(near, far), vm_and(vf_le(begin, depth + far), vf_le(depth + near, end)));
    kernel_local_list_add(&b->met, vm_and(active, meets), pixel | lane << KERNEL_LOCAL_CELL);
}

SIMD_INLINE void kernel_local_segments_met(kernel_tile_trace *t, kernel_tile_segments *b, int type)
{
    for (int i = 0; i < 2; i++) b->crossed[i].count = 0;
    for (int n = 0; n < b->met.count; n += SIMD_WIDTH) kernel_local_segments_faces(t, b, type, n);
    for (int i = 0; i < 2; i++)
        for (int n = 0; n < b->crossed[i].count; n += SIMD_WIDTH)
            kernel_local_segments_lanes(t, b, &b->crossed[i], type, n);
}

static __attribute__((noinline)) void kernel_local_segments_cast(kernel_tile_trace *t, kernel_local_lanes *l, int type)
{
    kernel_tile_segments *b = t->thread->tile_segments;
    kernel_pixel_list_close(&l->rays);
    b->met.count = 0;
    for (int n = 0; n < l->rays.count; n += SIMD_WIDTH) kernel_local_segments_overlap(t, l, b, n);
    KERNEL_OF_TYPE(type, kernel_local_segments_met, t, b);
    l->rays.count = 0;
}

/* ---- cells ---- */

/* Computes what segments need of the vector of cells: their faces and error budget. */
SIMD_INLINE void kernel_local_segments_prepare(const kernel_tile_trace *t, kernel_local_lanes *l,
                                               kernel_tile_segments *s, int type)
{
    kernel_local_faces_of(&t->tile, &l->transformed, l->ends, type, &s->faces);
    kernel_local_nonlinear_of(&l->cells, type, &s->budget.nonlinear);
    kernel_local_bound(&s->budget, (const float(*)[SIMD_WIDTH])l->transformed.at[3], type);
}

/* Transforms the queue's cells into tile space; returns the visible ones, and stores in *lanes those that can be
 * processed in lanes. */
static __attribute__((noinline)) unsigned kernel_local_segments_transform(kernel_tile_trace *t, kernel_local_lanes *l,
                                                                          int type, unsigned *lanes)
{
    kernel_tile_segments *s = t->thread->tile_segments;
    const kernel_pieces *pieces = s->budget.pieces;
    const unsigned showing = kernel_local_transform(t, l, KERNEL_LOCAL_BENT_MOST, lanes, type);
    KERNEL_OF_TYPE(type, kernel_local_segments_prepare, t, l, s);
    /* cells with values at a step of the opacity or on a steep ramp are not processed in lanes */
    const vf low = vf_load(s->budget.low), high = vf_load(s->budget.high);
    *lanes &= ~vm_bits(vm_or(kernel_values_are_steep(pieces, low, high, false),
                             kernel_values_have_step(pieces, 0, pieces->step_count, low, high)));
    return showing;
}

/* Stores the farthest depth at which the window of one of the block's active rays ends. */
SIMD_INLINE void kernel_block_set_window_end(kernel_tile_trace *t, const kernel_segments *packets, int block)
{
    vf end = vf_set(-INFINITY);
    for (int i = block * KERNEL_BLOCK_PACKETS; i < (block + 1) * KERNEL_BLOCK_PACKETS; i++)
        end = vf_max(end, vf_select(t->packets[i].active, packets[i].t_end, vf_set(-INFINITY)));
    t->far[block / SIMD_WIDTH][block % SIMD_WIDTH] = vf_reduce_max(end);
}

/* Lowers the farthest depth of those of the blocks in which the window of a ray has been shortened. */
SIMD_INLINE void kernel_blocks_shorten(kernel_tile_trace *t, unsigned blocks)
{
    kernel_segments *packets = t->thread->tile_segments->packets;
    for (; blocks; blocks &= blocks - 1) {
        const int block = __builtin_ctz(blocks);
        bool is_shortened = false;
        for (int i = block * KERNEL_BLOCK_PACKETS; i < (block + 1) * KERNEL_BLOCK_PACKETS; i++) {
            is_shortened = is_shortened || packets[i].is_shortened;
            packets[i].is_shortened = false;
        }
        if (is_shortened) kernel_block_set_window_end(t, packets, block);
    }
}

static void kernel_local_segments_finish(kernel_tile_trace *t, int unused)
{
    (void)unused;
    kernel_blocks_shorten(t, t->thread->tile_segments->blocks);
}

/* Copies, for each pixel, the window and the ends of the ray from the packets into arrays. */
static void kernel_local_segments_begin(const kernel_tile_trace *t, kernel_tile_segments *b, unsigned blocks)
{
    b->budget.pieces = &t->frame->pieces[0];
    b->budget.allowance = t->frame->allowance;
    b->budget.reach = t->frame->reach[0];
    b->blocks = blocks;
    for (int i = 0; i < KERNEL_LOCAL_PIXELS; i++) b->window[2 * i] = INFINITY, b->window[2 * i + 1] = -INFINITY;
    for (; blocks; blocks &= blocks - 1) {
        const int begin = __builtin_ctz(blocks) * KERNEL_BLOCK_PACKETS;
        for (int i = begin; i < begin + KERNEL_BLOCK_PACKETS; i++) {
            const kernel_packet *p = &t->packets[i];
            const kernel_segments *list = &b->packets[i];
            const vf from = vf_select(p->active, list->t_begin, vf_set(INFINITY));
            vf_store(b->budget.per_t + i * SIMD_WIDTH, list->per_t);
            for (int n = 0; n < SIMD_WIDTH; n++) {
                const int at = 2 * (i * SIMD_WIDTH + n);
                b->window[at] = from[n];
                b->window[at + 1] = list->t_end[n];
                b->reach[at] = p->t_near[n];
                b->reach[at + 1] = p->t_far[n];
            }
        }
    }
}

#endif
