/* Samples of volumes, one a lane, whatever their cells and rays. A cell of a few pixels leaves most of a packet without
 * anything to do, and a sample's value takes an inverse map; so samples of several cells are put side by side:
 *
 *     cells of one type       where are they, and what map have they?     kernel_local.h
 *     pixels of their boxes   which samples may be in the cell?           by planes about it
 *     samples                 where in the cell, and what is the field?   Newton's method
 *
 * A sample belongs to the cell that has it inside by the cell's own coordinates. Faces are where one of these is at its
 * end, and so that is what the crossings of faces say, but for rounding: samples near a face are decided by these
 * (kernel_crossings.h), which neighbours have in common to the bit. Cells that are bent too much go that way whole. */
#ifndef RENDER_KERNEL_LOCAL_SAMPLES_H
#define RENDER_KERNEL_LOCAL_SAMPLES_H

#include <math.h>
#include <string.h>

#include "grid.h"
#include "kernel_cell.h"
#include "kernel_crossings.h"
#include "kernel_interest.h"
#include "kernel_local.h"
#include "kernel_map.h"
#include "kernel_packet.h"
#include "kernel_placed_hexes.h"
#include "kernel_samples.h"
#include "kernel_tile.h"
#include "kernel_tile_cells.h"
#include "kernel_tile_trace.h"
#include "kernel_types.h"
#include "kernel_wide.h"
#include "render.h"
#include "simd.h"

typedef struct kernel_tile_ray_samples {
    kernel_samples samples;
    kernel_blend blend;
    vm active; /* of the packet, whose own is narrowed to the rays that are lit */
} kernel_tile_ray_samples;

enum {
    KERNEL_LOCAL_TYPES = 3, /* hexes, wedges, pyramids */
    KERNEL_LOCAL_SAMPLES = 1024,
    KERNEL_TILE_PIXELS = KERNEL_TILE * KERNEL_TILE,
    KERNEL_LOCAL_LANE = 8,   /* a sample's bits: its pixel in the tile from the first on, its cell's lane from here, */
    KERNEL_LOCAL_NUMBER = 16 /* and its number in the window from here */
};

/* Cells of one type that wait. */
typedef struct kernel_local_queue {
    int count;
    uint32_t cell[SIMD_WIDTH];
    uint16_t blocks[SIMD_WIDTH], box[SIMD_WIDTH];
} kernel_local_queue;

typedef struct kernel_local_batch {
    kernel_tile_ray_samples *packets; /* the tile's */
    kernel_tile_take *take;           /* what is done with cells that are not for lanes */
    int volume, part, first, count;   /* of the window's samples */
    kernel_local_queue queues[KERNEL_LOCAL_TYPES];
    double world[3][8][SIMD_WIDTH], scalars[8][SIMD_WIDTH]; /* as the caller has them */
    kernel_local_cells cells;
    int32_t ends[4][SIMD_WIDTH]; /* kernel_local_pixels() */
    kernel_hex_rays rays;
    int sample_count;
    float t[KERNEL_LOCAL_SAMPLES + SIMD_WIDTH], bits[KERNEL_LOCAL_SAMPLES + SIMD_WIDTH];
    /* By packet and lane: the first sample of all and the step side by side, and where the window ends the ray. */
    float steps[2 * KERNEL_TILE_PIXELS], far[KERNEL_TILE_PIXELS];
    float pad; /* kernel_samples.pad */
    int alone; /* the lane whose cell is the tile's cell, ready to be crossed; -1: none */
} kernel_local_batch;

SIMD_INLINE int kernel_local_queue_of(int type)
{
    return type == GRID_HEX ? 0 : type == GRID_WEDGE ? 1 : type == GRID_PYRAMID ? 2 : -1;
}

/* Are cells of this type for lanes in this frame? Not beside surfaces, where ranks ask which cells touch and so for the
 * ends of intervals (kernel_blend_breaks()), nor where samples are kept apart. */
SIMD_INLINE bool kernel_local_fits(const kernel_frame *f, int type)
{
    return !f->surface_count && !f->job->separate_samples && kernel_local_queue_of(type) >= 0;
}

/* The window's samples, of packets that are ready for it, of the volume. */
SIMD_INLINE void kernel_local_begin(const kernel_tile_trace *t, kernel_local_batch *b,
                                    kernel_tile_ray_samples *packets, unsigned blocks, int volume,
                                    kernel_tile_take *take)
{
    b->packets = packets;
    b->take = take;
    b->volume = volume;
    b->pad = 0;
    b->part = -1;
    for (int i = 0; i < KERNEL_LOCAL_TYPES; i++) b->queues[i].count = 0;
    for (int i = 0; i < KERNEL_TILE_PIXELS; i++) b->far[i] = -INFINITY;
    for (; blocks; blocks &= blocks - 1) {
        const int begin = __builtin_ctz(blocks) * KERNEL_BLOCK_PACKETS;
        for (int i = begin; i < begin + KERNEL_BLOCK_PACKETS; i++) {
            const kernel_packet *p = &t->packets[i];
            const kernel_samples *s = &packets[i].samples;
            vf_store(b->far + i * SIMD_WIDTH, vf_select(p->active, p->t_far, vf_set(-INFINITY)));
            for (int n = 0; n < SIMD_WIDTH; n++) {
                b->steps[2 * (i * SIMD_WIDTH + n)] = p->sample_base[n];
                b->steps[2 * (i * SIMD_WIDTH + n) + 1] = p->sample_step[n];
            }
            b->pad = simd_max(s->pad, b->pad);
            b->first = s->first;
            b->count = s->count;
        }
    }
}

/* ---- samples ---- */

/* The tile's cell is the lane's; false where it shows nowhere. */
static __attribute__((noinline, cold)) bool kernel_local_ready_alone(kernel_tile_trace *t, kernel_local_batch *b,
                                                                     const kernel_local_queue *q, int lane)
{
    kernel_tile_cells *cells = t->thread->tile_cells;
    const grid *g = t->frame->job->parts[b->part].cells;
    if (b->alone == lane) return true;
    b->alone = -1;
    kernel_cell_fetch(&cells->cell, g, &t->frame->job->volumes[b->volume].field.fields[b->part], q->cell[lane]);
    if (!kernel_tile_ready_cell(t, cells, g, &t->frame->volumes[b->volume], true, KERNEL_ALL_BLOCKS)) return false;
    b->alone = lane;
    return true;
}

/* A sample near the border is the cell's or not by the crossings of its faces. */
static __attribute__((noinline, cold)) void kernel_local_decide(kernel_tile_trace *t, kernel_local_batch *b,
                                                                const kernel_local_queue *q, int lane, int at,
                                                                int number)
{
    kernel_tile_cells *cells = t->thread->tile_cells;
    kernel_packet *p = &t->packets[at / SIMD_WIDTH];
    kernel_volume_state state = {b->volume, &b->packets[at / SIMD_WIDTH].samples};
    kernel_interval list[KERNEL_MAX_CELL_INTERVALS];
    if (!kernel_local_ready_alone(t, b, q, lane)) return;
    const vm ray = vm_and(p->active, vm_from_bits(1u << at % SIMD_WIDTH));
    const int intervals = kernel_poly_intervals(p, &cells->cell, ray, false, list);
    for (int k = 0; k < intervals; k++)
        kernel_fill_some(p, &state, cells->cell.is_constant ? NULL : &cells->map, &list[k], number, number + 1);
}

/* Rays of the samples' pixels in tile space, and where these are in packets. */
typedef struct kernel_local_rays {
    vi lane, at;
    vf origin[2], slope[2];
} kernel_local_rays;

SIMD_INLINE void kernel_local_rays_of(kernel_local_rays *rays, const kernel_tile *tile, vi pixel, vi lane)
{
    const vi column = pixel & (KERNEL_TILE - 1), row = pixel >> 4 & (KERNEL_TILE - 1);
    rays->lane = lane & (SIMD_WIDTH - 1);
    rays->at = kernel_batch_at(column, row);
    rays->origin[0] = kernel_batch_of_tile(tile->origin_x, column);
    rays->origin[1] = kernel_batch_of_tile(tile->origin_y, row);
    rays->slope[0] = kernel_batch_of_tile(tile->slope_x, column);
    rays->slope[1] = kernel_batch_of_tile(tile->slope_y, row);
}

/* Of a vector of samples from n on, those inside get their values. */
SIMD_INLINE void kernel_local_fill_lanes(kernel_tile_trace *t, kernel_local_batch *b, const kernel_local_queue *q,
                                         int type, int n)
{
    const int left = b->sample_count - n;
    const vm active = left < SIMD_WIDTH ? vm_from_bits((1u << left) - 1) : vm_all_lanes();
    const vi bits = vi_from_bits(vf_load(b->bits + n));
    const vf depth = vf_load(b->t + n);
    kernel_local_rays rays;
    kernel_local_points points;
    int32_t at[SIMD_WIDTH], number[SIMD_WIDTH], lane[SIMD_WIDTH];
    float values[SIMD_WIDTH];
    kernel_local_rays_of(&rays, &t->tile, bits & (KERNEL_TILE_PIXELS - 1), bits >> KERNEL_LOCAL_LANE);
    const vf place[3] = {rays.origin[0] + rays.slope[0] * depth, rays.origin[1] + rays.slope[1] * depth, depth};
    const vm known = kernel_local_find(type, &b->cells, rays.lane, place, &points);
    const vf inside = kernel_local_inside(type, points.r), blur = kernel_local_take(b->cells.blur, rays.lane);
    const vm own = vm_and(vm_and(active, known), vf_lt(blur, inside));
    const vm doubt = vm_andnot(vm_andnot(active, own), vm_and(known, vf_lt(inside, -blur)));
    vf_store(values, kernel_local_value(type, &b->cells, rays.lane, &points));
    const vi numbers = bits >> KERNEL_LOCAL_NUMBER;
    memcpy(at, &rays.at, sizeof at);
    memcpy(number, &numbers, sizeof number);
    memcpy(lane, &rays.lane, sizeof lane);
    unsigned undecided = vm_bits(doubt);
    for (unsigned more = vm_bits(own); more; more &= more - 1) {
        const int i = __builtin_ctz(more);
        float *value = (float *)(void *)&b->packets[at[i] / SIMD_WIDTH].samples.value[b->volume][number[i]];
        const bool is_taken = value[at[i] % SIMD_WIDTH] == value[at[i] % SIMD_WIDTH];
        undecided |= (unsigned)is_taken << i;
        if (!is_taken) value[at[i] % SIMD_WIDTH] = values[i];
    }
    for (; __builtin_expect(undecided, 0); undecided &= undecided - 1) {
        const int i = __builtin_ctz(undecided);
        kernel_local_decide(t, b, q, lane[i], at[i], number[i]);
    }
}

static __attribute__((noinline)) void kernel_local_fill_hexes(kernel_tile_trace *t, kernel_local_batch *b)
{
    for (int n = 0; n < b->sample_count; n += SIMD_WIDTH) kernel_local_fill_lanes(t, b, &b->queues[0], GRID_HEX, n);
}

static __attribute__((noinline)) void kernel_local_fill_wedges(kernel_tile_trace *t, kernel_local_batch *b)
{
    for (int n = 0; n < b->sample_count; n += SIMD_WIDTH) kernel_local_fill_lanes(t, b, &b->queues[1], GRID_WEDGE, n);
}

static __attribute__((noinline)) void kernel_local_fill_pyramids(kernel_tile_trace *t, kernel_local_batch *b)
{
    for (int n = 0; n < b->sample_count; n += SIMD_WIDTH) kernel_local_fill_lanes(t, b, &b->queues[2], GRID_PYRAMID, n);
}

SIMD_INLINE void kernel_local_fill(kernel_tile_trace *t, kernel_local_batch *b, int type)
{
    vf_store(b->bits + b->sample_count, vf_set(0));
    vf_store(b->t + b->sample_count, vf_set(0));
    if (type == GRID_HEX)
        kernel_local_fill_hexes(t, b);
    else if (type == GRID_WEDGE)
        kernel_local_fill_wedges(t, b);
    else
        kernel_local_fill_pyramids(t, b);
    b->sample_count = 0;
}

/* ---- pixels ---- */

/* From where to where the rays may be inside of their cells, after depth. */
SIMD_INLINE void kernel_local_stretch(const kernel_local_cells *cells, const kernel_local_rays *rays, vf depth,
                                      vf *near, vf *far)
{
    vf d[2];
    *near = vf_set(-INFINITY);
    *far = vf_set(INFINITY);
    for (int a = 0; a < 2; a++)
        d[a] = (rays->origin[a] + rays->slope[a] * depth) - kernel_local_take(cells->origin[a], rays->lane);
    for (int i = 0; i < 3; i++) {
        vf row[3];
        for (int a = 0; a < 3; a++) row[a] = kernel_local_take(cells->inverse[i][a], rays->lane);
        const vf offset = kernel_local_take(cells->offset[i], rays->lane);
        const vf at = vf_muladd(row[0], d[0], vf_muladd(row[1], d[1], offset));
        const vf inverse = 1.0f / vf_muladd(row[0], rays->slope[0], vf_muladd(row[1], rays->slope[1], row[2]));
        const vf low = (kernel_local_take(cells->low[i], rays->lane) - at) * inverse;
        const vf high = (kernel_local_take(cells->high[i], rays->lane) - at) * inverse;
        /* A product that is not a number is of a ray along a plane: the others tell. */
        *near = vf_max(vf_min(low, high), *near);
        *far = vf_min(vf_max(low, high), *far);
    }
}

/* The samples that rays from n on may have in their cells. */
SIMD_INLINE void kernel_local_cast_lanes(kernel_tile_trace *t, kernel_local_batch *b, int type, int n)
{
    const int left = b->rays.count - n;
    const vm active = left < SIMD_WIDTH ? vm_from_bits((1u << left) - 1) : vm_all_lanes();
    const vi pixel = kernel_bytes(b->rays.pixel + n);
    kernel_local_rays rays;
    vf base, step, near, far;
    kernel_local_rays_of(&rays, &t->tile, pixel, kernel_bytes(b->rays.lane + n));
    const vf depth = kernel_local_take(b->cells.origin[2], rays.lane);
    kernel_local_stretch(&b->cells, &rays, depth, &near, &far);
    vf_gather_pair(b->steps, 2 * rays.at, &base, &step);
    const vf inverse = 1.0f / step, begin = depth - base, end = vf_min(depth + far, vf_gather(b->far, rays.at)) - base;
    const float zero = (float)b->first;
    vf number = vf_max(-vf_floor(b->pad - ((begin + near) * inverse - zero)), vf_set(0));
    const vf last = vf_min(vf_floor((end * inverse - zero) + b->pad), vf_set((float)(b->count - 1)));
    const vi key = pixel | rays.lane << KERNEL_LOCAL_LANE;
    for (vm more = vm_and(active, vf_le(number, last)); vm_any(more); more = vm_and(more, vf_le(number, last))) {
        if (b->sample_count > KERNEL_LOCAL_SAMPLES - SIMD_WIDTH) kernel_local_fill(t, b, type);
        const vi whole = vi_from_vf(number);
        const vf place = base + step * vf_from_vi(whole + b->first);
        vf_compress(b->bits + b->sample_count, more, vf_from_bits(key | whole << KERNEL_LOCAL_NUMBER));
        b->sample_count += vf_compress(b->t + b->sample_count, more, place);
        number += 1.0f;
    }
}

static __attribute__((noinline)) void kernel_local_cast(kernel_tile_trace *t, kernel_local_batch *b, int type)
{
    kernel_hex_rays_close(&b->rays);
    for (int n = 0; n < b->rays.count; n += SIMD_WIDTH) kernel_local_cast_lanes(t, b, type, n);
    b->rays.count = 0;
}

/* ---- cells ---- */

/* An array's numbers at the vertices, into a lane. */
SIMD_INLINE void kernel_local_column(const grid_array *a, const int64_t *vertices, int count,
                                     double (*out)[SIMD_WIDTH], int lane)
{
    const char *data = a->data;
    if (a->is_integer)
        for (int i = 0; i < count; i++) out[i][lane] = grid_array_number(a, vertices[i]);
    else if (a->is_wide)
        for (int i = 0; i < count; i++) out[i][lane] = *(const double *)(const void *)(data + vertices[i] * a->stride);
    else
        for (int i = 0; i < count; i++)
            out[i][lane] = (double)*(const float *)(const void *)(data + vertices[i] * a->stride);
}

/* The field at them; NaN where the cell is not drawn. */
SIMD_INLINE void kernel_local_scalars(const grid_field *field, uint32_t cell, const int64_t *vertices, int count,
                                      double (*out)[SIMD_WIDTH], int lane)
{
    double values[GRID_MAX_CELL_VERTICES] = {0};
    if (field->component >= 0 && !field->is_cell_centred && !field->own) {
        grid_array a = field->values;
        a.data += field->component * field->component_stride;
        kernel_local_column(&a, vertices, count, out, lane);
        return;
    }
    const bool is_finite = grid_cell_values(field, cell, vertices, count, values);
    for (int i = 0; i < count; i++) out[i][lane] = is_finite ? values[i] : (double)NAN;
}

/* A cell into the lane, from arrays of any layout. */
SIMD_INLINE void kernel_local_fetch(const kernel_tile_trace *t, kernel_local_batch *b, uint32_t cell, int lane)
{
    const grid *g = t->frame->job->parts[b->part].cells;
    const grid_field *field = &t->frame->job->volumes[b->volume].field.fields[b->part];
    int64_t vertices[GRID_MAX_CELL_VERTICES] = {0};
    const int count = grid_cell_vertices(g, cell, vertices);
    for (int a = 0; a < 3; a++) kernel_local_column(&g->coordinates[a], vertices, count, b->world[a], lane);
    kernel_local_scalars(field, cell, vertices, count, b->scalars, lane);
}

/* The field in the transfer function's domain, as kernel_cell_domain() has it; returns the lanes that show. */
SIMD_INLINE vm kernel_local_domain(const kernel_transfer *t, double (*const scalars)[SIMD_WIDTH], int count,
                                   vf values[8])
{
    vf plain[8], odd = vf_set(0);
    vm finite = vm_all_lanes();
    for (int i = 0; i < count; i++) {
        for (int half = 0; half < 2; half++) {
            kernel_half v;
            memcpy(&v, scalars[i] + half * KERNEL_HALF, sizeof v);
            kernel_half_put(&odd, half, v - v);
            kernel_half_put(&plain[i], half, kernel_half_hold(v, 3e38));
            kernel_half_put(&values[i], half, kernel_half_hold((v - t->low) * t->inverse_width, 1e18));
        }
        finite = vm_and(finite, vf_eq(odd, odd));
    }
    return vm_and(finite, kernel_interest_meets_values(&t->interest, plain, count));
}

/* The tile's first and last columns and rows in which cells may be seen. A hundredth of a pixel is more than the
 * roundings of vertices that lie a thousandth of the scene's distance or more before the eye. */
SIMD_INLINE void kernel_local_pixels(const kernel_tile_trace *t, int count, const vf places[3][8],
                                     int32_t ends[4][SIMD_WIDTH])
{
    const bool flat = t->frame->job->camera.is_orthographic;
    const kernel_tile *tile = &t->tile;
    const float *rays[2] = {flat ? tile->origin_x : tile->slope_x, flat ? tile->origin_y : tile->slope_y};
    const float shift = (float)t->frame->depth_shift, pad = 0.01f;
    vf low[2] = {vf_set(INFINITY), vf_set(INFINITY)}, high[2] = {vf_set(-INFINITY), vf_set(-INFINITY)};
    vm anywhere = vm_none();
    for (int n = 0; n < count; n++) {
        vf depth = vf_set(1);
        if (!flat) depth = places[2][n] + shift;
        anywhere = vm_or(anywhere, vm_not(vf_lt(vf_set(flat ? 0 : 1e-3f * fabsf(shift)), depth)));
        for (int a = 0; a < 2; a++) {
            const vf at = (places[a][n] / depth - rays[a][0]) * (1 / (rays[a][1] - rays[a][0]));
            low[a] = vf_min(at, low[a]);
            high[a] = vf_max(at, high[a]);
        }
    }
    for (int a = 0; a < 2; a++) {
        const vf first = vf_clamp(-vf_floor(pad - low[a]), vf_set(0), vf_set(KERNEL_TILE));
        const vf last = vf_clamp(vf_floor(high[a] + pad), vf_set(-1), vf_set(KERNEL_TILE - 1));
        const vi from = vi_from_vf(vf_select(anywhere, vf_set(0), first));
        const vi to = vi_from_vf(vf_select(anywhere, vf_set(KERNEL_TILE - 1), last));
        memcpy(ends[2 * a], &from, sizeof from);
        memcpy(ends[2 * a + 1], &to, sizeof to);
    }
}

/* What of a box of pixels (kernel_types.h) lies between the lane's ends; false where nothing does. */
SIMD_INLINE bool kernel_local_cut(int32_t ends[4][SIMD_WIDTH], int lane, unsigned *box)
{
    int end[4];
    for (int a = 0; a < 2; a++) {
        const int from = (int)(*box >> 8 * a & 15), to = (int)(*box >> (8 * a + 4) & 15);
        end[2 * a] = from > ends[2 * a][lane] ? from : ends[2 * a][lane];
        end[2 * a + 1] = to < ends[2 * a + 1][lane] ? to : ends[2 * a + 1][lane];
    }
    *box = (unsigned)(end[0] | end[1] << 4 | end[2] << 8 | end[3] << 12);
    return end[0] <= end[1] && end[2] <= end[3];
}

/* Places the cells that are fetched; returns those that show, and in lanes those of them that are for lanes. */
SIMD_INLINE unsigned kernel_local_place(kernel_tile_trace *t, kernel_local_batch *b, int type, unsigned *lanes)
{
    const int count = grid_type_vertices(type);
    vf places[3][8], values[8];
    const vm shows = kernel_local_domain(&t->frame->volumes[b->volume], b->scalars, count, values);
    for (int i = 0; i < count; i++) {
        vf at[3];
        for (int half = 0; half < 2; half++) {
            kernel_half world[3];
            for (int a = 0; a < 3; a++) memcpy(&world[a], b->world[a][i] + half * KERNEL_HALF, sizeof world[a]);
            kernel_half_place(t->frame, &t->tile, world, half, at);
        }
        for (int a = 0; a < 3; a++) places[a][i] = at[a];
    }
    kernel_local_turn(type, places, values);
    kernel_local_pixels(t, count, (const vf(*)[8])places, b->ends);
    *lanes = vm_bits(vm_and(shows, kernel_local_setup(type, (const vf(*)[8])places, values, &b->cells)));
    return vm_bits(shows);
}

static __attribute__((noinline)) unsigned kernel_local_place_any(kernel_tile_trace *t, kernel_local_batch *b, int type,
                                                                 unsigned *lanes)
{
    if (type == GRID_HEX) return kernel_local_place(t, b, GRID_HEX, lanes);
    if (type == GRID_WEDGE) return kernel_local_place(t, b, GRID_WEDGE, lanes);
    return kernel_local_place(t, b, GRID_PYRAMID, lanes);
}

/* The cells that wait in a queue. */
static __attribute__((noinline)) void kernel_local_run(kernel_tile_trace *t, kernel_local_batch *b, int queue)
{
    static const int types[KERNEL_LOCAL_TYPES] = {GRID_HEX, GRID_WEDGE, GRID_PYRAMID};
    kernel_local_queue *q = &b->queues[queue];
    unsigned placed;
    if (!q->count) return;
    for (int n = 0; n < q->count; n++) kernel_local_fetch(t, b, q->cell[n], n);
    const unsigned all = (1u << q->count) - 1, showing = kernel_local_place_any(t, b, types[queue], &placed) & all;
    placed &= all;
    b->alone = -1;
    b->sample_count = b->rays.count = 0;
    for (unsigned lanes = placed; lanes; lanes &= lanes - 1) {
        const int n = __builtin_ctz(lanes);
        unsigned box = q->box[n];
        if (!kernel_local_cut(b->ends, n, &box)) continue;
        kernel_hex_rays_of(&b->rays, box, n);
        if (b->rays.count >= KERNEL_HEX_RAYS) kernel_local_cast(t, b, types[queue]);
    }
    kernel_local_cast(t, b, types[queue]);
    if (b->sample_count) kernel_local_fill(t, b, types[queue]);
    for (unsigned lanes = showing & ~placed; lanes; lanes &= lanes - 1) {
        const int n = __builtin_ctz(lanes);
        kernel_tile_meet_cell(t, b->volume, b->part, q->cell[n], true, q->blocks[n], b->take);
    }
    q->count = 0;
}

SIMD_INLINE void kernel_local_end(kernel_tile_trace *t, kernel_local_batch *b)
{
    for (int i = 0; i < KERNEL_LOCAL_TYPES; i++) kernel_local_run(t, b, i);
}

/* The pixels of blocks, ends included, as a candidate has them (kernel_types.h). */
SIMD_INLINE unsigned kernel_local_box(unsigned blocks)
{
    int x0 = KERNEL_BLOCKS_ACROSS, x1 = 0, y0 = KERNEL_BLOCKS_ACROSS, y1 = 0;
    for (; blocks; blocks &= blocks - 1) {
        const int x = __builtin_ctz(blocks) % KERNEL_BLOCKS_ACROSS, y = __builtin_ctz(blocks) / KERNEL_BLOCKS_ACROSS;
        x0 = x < x0 ? x : x0;
        x1 = x > x1 ? x : x1;
        y0 = y < y0 ? y : y0;
        y1 = y > y1 ? y : y1;
    }
    return (unsigned)(x0 * KERNEL_BLOCK) | (unsigned)(x1 * KERNEL_BLOCK + KERNEL_BLOCK - 1) << 4 |
           (unsigned)(y0 * KERNEL_BLOCK) << 8 | (unsigned)(y1 * KERNEL_BLOCK + KERNEL_BLOCK - 1) << 12;
}

/* A cell of a type that fits waits. */
SIMD_INLINE void kernel_local_wait(kernel_tile_trace *t, kernel_local_batch *b, int part, int type, uint32_t cell,
                                   unsigned blocks, unsigned box)
{
    const int queue = kernel_local_queue_of(type);
    kernel_local_queue *q = &b->queues[queue];
    if (part != b->part) {
        kernel_local_end(t, b);
        b->part = part;
    }
    const int n = q->count++;
    q->cell[n] = cell;
    q->blocks[n] = (uint16_t)blocks;
    q->box[n] = (uint16_t)box;
    if (q->count == SIMD_WIDTH) kernel_local_run(t, b, queue);
}

#endif
