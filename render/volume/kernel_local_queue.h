/* Cells that wait for lanes: hexes, wedges and pyramids of arrays of any layout, of one type in a queue each, until a
 * vector is full and they are placed together. For samples (kernel_local_samples.h) and segments
 * (kernel_local_segments.h). */
#ifndef RENDER_KERNEL_LOCAL_QUEUE_H
#define RENDER_KERNEL_LOCAL_QUEUE_H

#include <math.h>
#include <string.h>

#include "grid.h"
#include "kernel_cell.h"
#include "kernel_interest.h"
#include "kernel_local.h"
#include "kernel_placed_hexes.h"
#include "kernel_prefetch.h"
#include "kernel_tile.h"
#include "kernel_tile_trace.h"
#include "kernel_types.h"
#include "kernel_wide.h"
#include "simd.h"

enum {
    KERNEL_LOCAL_TYPES = 3, /* hexes, wedges, pyramids */
    KERNEL_LOCAL_AHEAD = 6  /* so many cells queue between a cell's indices and its vertices on their way from memory */
};

/* Cells of one type that wait. */
typedef struct kernel_local_queue {
    int count;
    uint32_t cell[SIMD_WIDTH];
    uint16_t blocks[SIMD_WIDTH], box[SIMD_WIDTH];
} kernel_local_queue;

typedef struct kernel_local_lanes {
    kernel_tile_take *take; /* what is done with cells that are not for lanes */
    int volume, part;
    kernel_local_queue queues[KERNEL_LOCAL_TYPES];
    double world[3][8][SIMD_WIDTH], scalars[8][SIMD_WIDTH]; /* as the caller has them */
    kernel_local_cells cells;
    int32_t ends[4][SIMD_WIDTH]; /* kernel_local_pixels() */
    int alone;                   /* the lane whose cell is the tile's cell, ready to be crossed; -1: none */
} kernel_local_lanes;

SIMD_INLINE void kernel_local_lanes_begin(kernel_local_lanes *l, int volume, kernel_tile_take *take)
{
    l->take = take;
    l->volume = volume;
    l->part = -1;
    for (int i = 0; i < KERNEL_LOCAL_TYPES; i++) l->queues[i].count = 0;
}

SIMD_INLINE int kernel_local_queue_of(int type)
{
    return type == GRID_HEX ? 0 : type == GRID_WEDGE ? 1 : type == GRID_PYRAMID ? 2 : -1;
}

/* ---- cells ---- */

/* An array's numbers at the vertices, into a lane. */
SIMD_INLINE void kernel_local_column(const grid_array *a, const int64_t *vertices, int count, double (*out)[SIMD_WIDTH],
                                     int lane)
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
SIMD_INLINE void kernel_local_fetch(const kernel_tile_trace *t, kernel_local_lanes *l, uint32_t cell, int lane)
{
    const grid *g = t->frame->job->parts[l->part].cells;
    const grid_field *field = &t->frame->job->volumes[l->volume].field.fields[l->part];
    int64_t vertices[GRID_MAX_CELL_VERTICES] = {0};
    const int count = grid_cell_vertices(g, cell, vertices);
    for (int a = 0; a < 3; a++) kernel_local_column(&g->coordinates[a], vertices, count, l->world[a], lane);
    kernel_local_scalars(field, cell, vertices, count, l->scalars, lane);
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
    if (end[0] > end[1] || end[2] > end[3]) return false;
    *box = (unsigned)(end[0] | end[1] << 4 | end[2] << 8 | end[3] << 12);
    return true;
}

/* Places the cells that are fetched: lists gets the vertices' places and the field there, and whatever else it has of
 * the vertices is turned with these. Returns the cells that show, and in lanes those of them that are for lanes. */
SIMD_INLINE unsigned kernel_local_place(const kernel_tile_trace *t, kernel_local_lanes *l, int type, vf (*lists)[8],
                                        int list_count, float most_bent, unsigned *lanes)
{
    const int count = grid_type_vertices(type);
    const vm shows = kernel_local_domain(&t->frame->volumes[l->volume], l->scalars, count, lists[3]);
    for (int i = 0; i < count; i++) {
        vf at[3];
        for (int half = 0; half < 2; half++) {
            kernel_half world[3];
            for (int a = 0; a < 3; a++) memcpy(&world[a], l->world[a][i] + half * KERNEL_HALF, sizeof world[a]);
            kernel_half_place(t->frame, &t->tile, world, half, at);
        }
        for (int a = 0; a < 3; a++) lists[a][i] = at[a];
    }
    kernel_local_turn(type, lists, list_count);
    kernel_local_pixels(t, count, (const vf(*)[8])lists, l->ends);
    *lanes = vm_bits(vm_and(shows, kernel_local_setup(type, (const vf(*)[8])lists, lists[3], most_bent, &l->cells)));
    return vm_bits(shows);
}

/* Asks memory for the vertices of queued cells first .. end - 1, whose indices have been asked for before. */
SIMD_INLINE void kernel_local_prefetch(const kernel_tile_trace *t, const kernel_local_lanes *l,
                                       const kernel_local_queue *q, int first, int end)
{
    const grid *g = t->frame->job->parts[l->part].cells;
    const grid_field *field = &t->frame->job->volumes[l->volume].field.fields[l->part];
    for (int n = first < 0 ? 0 : first; n < end; n++) kernel_prefetch_vertices(g, field, q->cell[n]);
}

/* The queue's cells are fetched; returns their lanes. */
SIMD_INLINE unsigned kernel_local_fetch_all(const kernel_tile_trace *t, kernel_local_lanes *l,
                                            const kernel_local_queue *q)
{
    kernel_local_prefetch(t, l, q, q->count - KERNEL_LOCAL_AHEAD, q->count);
    for (int n = 0; n < q->count; n++) kernel_local_fetch(t, l, q->cell[n], n);
    l->alone = -1;
    return (1u << q->count) - 1;
}

/* Queues a cell; returns whether the queue is full. */
SIMD_INLINE bool kernel_local_push(const kernel_tile_trace *t, const kernel_local_lanes *l, kernel_local_queue *q,
                                   uint32_t cell, unsigned blocks, unsigned box)
{
    const int n = q->count++;
    q->cell[n] = cell;
    q->blocks[n] = (uint16_t)blocks;
    q->box[n] = (uint16_t)box;
    kernel_local_prefetch(t, l, q, n - KERNEL_LOCAL_AHEAD, n - KERNEL_LOCAL_AHEAD + 1);
    return q->count == SIMD_WIDTH;
}

/* ---- pixels ---- */

/* Returns the box of pixels, ends included, as a candidate has it (kernel_types.h); that of the blocks where box is
 * negative. */
SIMD_INLINE unsigned kernel_local_box(unsigned blocks, int box)
{
    if (box >= 0) return (unsigned)box;
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

#endif
