/* Traces tets in a tile by batches. A batch is the vector of up to SIMD_WIDTH cells, one per lane, that a queue
 * (kernel_surface_cells) has collected:
 *     lanes are cells:     fetched, sorted, transformed; edge functions computed    (once per batch)
 *     lanes are pixels:    each uses the edge functions of its own cell             (cells of few pixels)
 *                          or a packet of a block's rays, all with one cell         (other cells)
 * A block is a square of 4 × 4 pixels of the tile; the box of a cell is the rectangle of the tile's pixels that may see
 * the cell. If cells are small, most rays of a block's packet miss the cell. So the pixels of several cells' boxes are
 * listed one after the other, and SIMD_WIDTH of these rays are traced at once. Each lane then has a ray and the index
 * of the lane that holds its cell, and reads the cell's numbers from the batch's vectors by a permutation. All
 * operations are those for a single cell (kernel_crossings.h, kernel_surface.h) in the same order, so the two methods
 * compute bit-identical hits. */
#ifndef RENDER_KERNEL_BATCH_H
#define RENDER_KERNEL_BATCH_H

#include <math.h>
#include <string.h>

#include "kernel_accept.h"
#include "kernel_cell.h"
#include "kernel_cell_values.h"
#include "kernel_crossings.h"
#include "kernel_lines.h"
#include "kernel_map.h"
#include "kernel_transformed_tets.h"
#include "kernel_shapes.h"
#include "kernel_surface.h"
#include "kernel_surface_cells.h"
#include "kernel_tets.h"
#include "kernel_tile_trace.h"
#include "kernel_types.h"
#include "kernel_wide.h"
#include "simd.h"

enum {
    /* maximum number of pixels in a cell's box; a cell with more pixels is traced block by block */
    KERNEL_BATCH_PIXELS = 32
};

_Static_assert(SIMD_WIDTH *KERNEL_BATCH_PIXELS <= KERNEL_LIST_PIXELS, "a batch's rays have room in a list");

typedef struct kernel_batch {
    const kernel_surface_cells *queued; /* the cells that are being traced */
    /* the cells in tile space; f is the field minus the isovalue, times a power of two */
    kernel_transformed_tets tets;
    bool is_of_faces; /* copy of the layer's is_of_faces */
    bool has_normals; /* set if `normal` is computed */
    vf normal[3];     /* a vector along the gradient in each cell, of any length, in camera axes */
    /* the contour lines' field in each lane's cell (members of kernel_tet_line); valid in the lanes whose bits are set
     * in line_lanes */
    unsigned line_lanes;
    float line_value[SIMD_WIDTH], line_gradient[3][SIMD_WIDTH], line_along[SIMD_WIDTH];
    kernel_pixel_list rays; /* rays to be traced: pixel, and lane of the cell */
} kernel_batch;

/* ---- lanes are cells ---- */

/* Computes a vector along the gradient in each cell of the batch, by the operations of kernel_tet_normal(). It is
 * called when one of the cells is hit for the first time. */
static __attribute__((noinline)) void kernel_batch_compute_normals(kernel_batch *b, const kernel_frame *f)
{
    const double scale = f->job->space.scale;
    for (int half = 0; half < 2; half++) {
        kernel_f64 d[3][3], df[3], g[3], largest = {0};
        for (int i = 0; i < 3; i++) {
            df[i] = kernel_f64_widen_half(&b->tets.f[i + 1], half) - kernel_f64_widen_half(&b->tets.f[0], half);
            for (int a = 0; a < 3; a++) d[i][a] = (b->tets.world[i + 1][a][half] - b->tets.world[0][a][half]) * scale;
        }
        for (int a = 0; a < 3; a++) {
            const int p = (a + 1) % 3, q = (a + 2) % 3;
            g[a] = df[0] * (d[1][p] * d[2][q] - d[1][q] * d[2][p]) + df[1] * (d[2][p] * d[0][q] - d[2][q] * d[0][p]) +
                   df[2] * (d[0][p] * d[1][q] - d[0][q] * d[1][p]);
            largest = kernel_f64_max(kernel_f64_abs(g[a]), largest);
        }
        const kernel_f64 inverse =
            kernel_f64_select((kernel_f64_mask)(largest > 0), 1 / (largest * scale), (kernel_f64){0});
        for (int a = 0; a < 3; a++) {
            const double *axis = f->scaled_axes[a];
            kernel_f64_store_half_of_vector(&b->normal[a], half,
                                            (axis[0] * g[0] + axis[1] * g[1] + axis[2] * g[2]) * inverse);
        }
    }
    b->has_normals = true;
}

/* ---- a cell of the batch that is traced by blocks ---- */

/* Copies the cell in lane n of the batch to *c, with all that kernel_blocks_trace() needs. */
static __attribute__((noinline)) void kernel_batch_copy_cell(const kernel_tile_trace *t, const kernel_batch *b, int n,
                                                             kernel_cell *c)
{
    const render_surface_layer *layer = t->surface->layer;
    kernel_transformed_tets_cell(&b->tets, n, c);
    c->part = b->queued->part;
    c->index = b->queued->cell[n];
    c->has_normal = true;
    for (int a = 0; a < 3; a++) c->normal[a] = b->normal[a][n];
    if (layer->normal == RENDER_DIFFERENCES || layer->lines) kernel_transformed_tets_double(&b->tets, n, c);
    c->has_line_field = layer->lines != NULL;
    if (!layer->colour_map && !layer->lines) return;
    for (int i = 0; i < 4; i++) c->vertices[i] = b->tets.vertex[i][n];
    if (layer->colour_map) kernel_read_colour_values(t->surface, c->part, c->index, c->vertices, 4, c->g);
    if (layer->lines) kernel_compute_tet_line_field(t->frame, &t->tile, t->surface, c, &c->line);
}

/* ---- lanes are pixels ---- */

/* Returns the rays that hit the surface in their cells between t_near, the depth at which rays begin, and their
 * previous nearest hits (r->far). *out: depths of the hits. */
SIMD_INLINE vm kernel_batch_find_hits(const kernel_batch *b, float t_near, const kernel_lane_rays *r, vf *out)
{
    const vf far = r->far;
    kernel_interval i;
    kernel_tet_rays_interval(&b->tets, r, &i);
    if (!vm_any(i.mask)) return i.mask;
    const vf v_out = kernel_end_in_cell(i.v_in, i.v_out, b->is_of_faces);
    const vm near = vm_and(i.mask, vm_and(vf_le(i.t_in, far), vf_le(vf_set(t_near), i.t_out)));
    const vm change = vm_and(near, vm_xor(vf_lt(i.v_in, vf_set(0)), vf_lt(v_out, vf_set(0))));
    if (!vm_any(change)) return change;
    *out = kernel_secant(i.t_in, i.v_in, i.t_out, v_out);
    return vm_and(change, vm_and(vf_le(vf_set(t_near), *out), vf_le(*out, far)));
}

/* Computes the field of the contour lines in lane n's cell. */
static __attribute__((noinline)) void kernel_batch_set_line_field(const kernel_tile_trace *t, kernel_batch *b, int n)
{
    kernel_cell c;
    kernel_tet_line line;
    c.part = b->queued->part;
    for (int i = 0; i < 4; i++) c.vertices[i] = b->tets.vertex[i][n];
    kernel_transformed_tets_double(&b->tets, n, &c);
    kernel_compute_tet_line_field(t->frame, &t->tile, t->surface, &c, &line);
    b->line_value[n] = line.value;
    b->line_along[n] = line.along;
    for (int a = 0; a < 3; a++) b->line_gradient[a][n] = line.gradient[a];
    b->line_lanes |= 1U << n;
}

/* Computes the colours of hits: those of their isovalues, with contour lines drawn over them. lanes[i]: the lane that
 * holds the cell of hit i, below SIMD_WIDTH; hit: mask of the lanes with a hit. */
static __attribute__((noinline)) void kernel_batch_draw_lines(const kernel_tile_trace *t, kernel_batch *b,
                                                              const kernel_lane_rays *r, const uint8_t *lanes,
                                                              unsigned hit, vf depth, float colour[3][SIMD_WIDTH])
{
    vf last[3], drawn[3];
    kernel_line_field field;
    memset(colour, 0, 3 * sizeof *colour);
    if (!b->line_lanes) {
        memset(b->line_value, 0, sizeof b->line_value);
        memset(b->line_along, 0, sizeof b->line_along);
        memset(b->line_gradient, 0, sizeof b->line_gradient);
    }
    for (; hit; hit &= hit - 1) {
        const int i = __builtin_ctz(hit), n = lanes[i];
        const float *own = t->surface->layer->colours + 3 * b->queued->value[n];
        if (!(b->line_lanes >> n & 1)) kernel_batch_set_line_field(t, b, n);
        for (int a = 0; a < 3; a++) colour[a][i] = own[a];
    }
    field.value = vf_permute(vf_load(b->line_value), r->lane);
    for (int a = 0; a < 3; a++) {
        field.gradient[a] = vf_permute(vf_load(b->line_gradient[a]), r->lane);
        field.normal[a] = vf_permute(b->normal[a], r->lane);
        last[a] = vf_permute(b->tets.at[a][3], r->lane);
        drawn[a] = vf_load(colour[a]);
    }
    kernel_line_field_move(&field, &r->rays, depth, last, vf_permute(vf_load(b->line_along), r->lane));
    kernel_draw_lines(t->frame, &t->tile, t->surface, &r->rays, depth, &field, drawn);
    for (int a = 0; a < 3; a++) vf_store(colour[a], drawn[a]);
}

/* Accepts the hits of one vector of rays (kernel_ray_accept()). places: position of each ray among the tile's packets;
 * lanes[i]: the lane that holds the cell of ray i; hit: mask of the rays that hit; colours: the hits' colours, or NULL
 * for those of their isovalues. Returns a mask of the blocks that contain a ray whose hit is nearer than its previous
 * one. */
SIMD_INLINE unsigned kernel_batch_accept_coloured(kernel_tile_trace *t, kernel_batch *b, vi places,
                                                  const uint8_t *lanes, unsigned hit, vf depth,
                                                  const float (*colours)[SIMD_WIDTH])
{
    unsigned blocks = 0;
    int32_t at[SIMD_WIDTH];
    memcpy(at, &places, sizeof at);
    for (; hit; hit &= hit - 1) {
        const int i = __builtin_ctz(hit), n = lanes[i];
        const float *plain = t->surface->layer->colours + 3 * b->queued->value[n];
        const float normal[3] = {b->normal[0][n], b->normal[1][n], b->normal[2][n]};
        float colour[3];
        for (int a = 0; a < 3; a++) colour[a] = colours ? colours[a][i] : plain[a];
        blocks |= kernel_ray_accept(t, at[i], b->queued, n, depth[i], normal, colour);
    }
    return blocks;
}

/* Accepts the hits of one vector of rays with the colours of their isovalues (kernel_batch_accept_coloured()). */
static unsigned kernel_batch_accept(kernel_tile_trace *t, kernel_batch *b, vi places, const uint8_t *lanes,
                                    unsigned hit, vf depth)
{
    if (!b->has_normals) kernel_batch_compute_normals(b, t->frame);
    return kernel_batch_accept_coloured(t, b, places, lanes, hit, depth, NULL);
}

/* Accepts the hits of one vector of rays as kernel_batch_accept() does, with contour lines drawn over their colours. */
static __attribute__((noinline)) unsigned kernel_batch_accept_lined(kernel_tile_trace *t, kernel_batch *b,
                                                                    const kernel_lane_rays *r, const uint8_t *lanes,
                                                                    unsigned hit, vf depth)
{
    float drawn[3][SIMD_WIDTH];
    if (!b->has_normals) kernel_batch_compute_normals(b, t->frame);
    kernel_batch_draw_lines(t, b, r, lanes, hit, depth, drawn);
    return kernel_batch_accept_coloured(t, b, r->at, lanes, hit, depth, (const float(*)[SIMD_WIDTH])drawn);
}

/* Traces all rays in the batch's list, and empties the list. */
SIMD_INLINE void kernel_batch_trace(kernel_tile_trace *t, kernel_batch *b)
{
    unsigned nearer = 0;
    kernel_pixel_list_pad(&b->rays);
    for (int first = 0; first < b->rays.count; first += SIMD_WIDTH) {
        kernel_lane_rays r;
        vf depth;
        kernel_lane_rays_begin(&r, t, &b->rays, first);
        r.far = kernel_pixel_far(t, r.at);
        r.active = vm_and(r.active, vf_le(vf_permute(vf_load(b->queued->near), r.lane), r.far));
        if (!vm_any(r.active)) continue;
        const vm hit = kernel_batch_find_hits(b, t->t_near, &r, &depth);
        if (!vm_any(hit)) continue;
        if (__builtin_expect(t->surface->layer->lines != NULL, 0)) {
            const kernel_lane_rays own = r; /* a copy, because taking the address of r would keep r in memory */
            nearer |= kernel_batch_accept_lined(t, b, &own, b->rays.lane + first, vm_bits(hit), depth);
        } else {
            nearer |= kernel_batch_accept(t, b, r.at, b->rays.lane + first, vm_bits(hit), depth);
        }
    }
    for (; nearer; nearer &= nearer - 1) kernel_block_update_far(t, __builtin_ctz(nearer));
    b->rays.count = 0;
}

/* ---- batches ---- */

/* Traces the queue's cells, and empties the queue: lists the rays of small cells, traces larger cells block by block,
 * and then traces the listed rays. */
static __attribute__((noinline)) void kernel_batch_process(kernel_tile_trace *t, kernel_batch *b,
                                                           kernel_surface_cells *queued)
{
    const render_surface_layer *layer = t->surface->layer;
    /* layers with a colour field are traced cell by cell, because the batch does not store the field's values */
    const bool by_ray = kernel_tile_layer_allows_lanes(t) && !layer->colour_map;
    const int most = by_ray ? KERNEL_BATCH_PIXELS : 0;
    kernel_surface_cells_close(queued);
    kernel_transform_tets(&b->tets, &queued->arrays, t->frame, &t->tile, queued->vertex, queued->count);
    kernel_lanes_subtract_isovalues(b->tets.values, 4, queued->isovalue, b->tets.f);
    b->queued = queued;
    b->is_of_faces = layer->is_of_faces;
    b->has_normals = false;
    b->line_lanes = 0;
    b->rays.count = 0;
    for (int n = 0; n < queued->count; n++) {
        unsigned blocks = queued->blocks[n] & kernel_blocks_not_hidden_at(t, queued->near[n]);
        if (!blocks) continue;
        if (kernel_box_pixels(queued->box[n]) <= most) {
            kernel_pixel_list_add_box(&b->rays, queued->box[n], n);
            for (blocks = queued->blocks[n] & ~t->begun; blocks; blocks &= blocks - 1)
                kernel_block_begin(t, __builtin_ctz(blocks));
            continue;
        }
        if (!b->has_normals) kernel_batch_compute_normals(b, t->frame);
        kernel_batch_copy_cell(t, b, n, t->cell);
        kernel_blocks_trace(t, blocks, queued->part, t->cell->index, t->cell, queued->value[n]);
    }
    kernel_batch_trace(t, b);
    queued->count = 0;
}

#endif
