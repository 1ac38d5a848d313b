/* Traces tets in a tile by batches. A batch is the vector of up to SIMD_WIDTH cells, one per lane, that a queue
 * (kernel_surface_cells) has collected. It is processed in two stages:
 *     lanes are cells:     fetched, sorted, transformed; edge functions computed    (once per batch)
 *     lanes are pixels:    each pixel's ray is tested by the edge functions of its cell    (once per vector of rays)
 * The box of a cell is the rectangle of the tile's pixels that may see the cell. The pixels of the cells' boxes are
 * listed one after the other, and SIMD_WIDTH of these rays are traced at once. Each lane then has a ray and the index
 * of the lane that holds its cell, and reads the cell's numbers from the batch's vectors by a permutation.
 *
 * If a box fills at least half of its blocks (squares of 4 × 4 pixels), all pixels of the blocks are listed instead.
 * Vectors of such rays are whole packets of the tile. Their hits are accepted with all lanes at once. */
#ifndef RENDER_KERNEL_BATCH_H
#define RENDER_KERNEL_BATCH_H

#include <math.h>
#include <string.h>

#include "grid.h"
#include "kernel_accept.h"
#include "kernel_cell.h"
#include "kernel_crossings.h"
#include "kernel_lane_hits.h"
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

typedef struct kernel_batch {
    const kernel_surface_cells *queued; /* the cells that are being traced */
    /* the cells in tile space; f is the field minus the isovalue, times a power of two */
    kernel_transformed_tets tets;
    bool is_of_faces; /* copy of render_surface_layer.is_of_faces */
    bool is_plain;    /* set if hits only need the colours of their isovalues (kernel_tile_hits_are_plain()) */
    bool has_normals; /* set if `normal` has been computed */
    vf normal[3];     /* a vector along the gradient in each cell, of any length, in camera axes */
    /* the contour lines' field in each lane's cell (members of kernel_tet_line); valid in the lanes whose bits are set
     * in line_lanes */
    unsigned line_lanes;
    float line_value[SIMD_WIDTH], line_gradient[3][SIMD_WIDTH], line_along[SIMD_WIDTH];
    /* rays to be traced: the pixel of each, and the lane that holds its cell. The first whole_count rays are whole
     * packets, each with one cell. */
    kernel_pixel_list rays;
    int whole_count;
} kernel_batch;

/* ---- transforming cells, one per lane ---- */

/* Stores the indices, in the mesh part, of the vertices of lane n's cell, sorted by the vertices' coordinates
 * (kernel_cell.h). */
SIMD_INLINE void kernel_batch_get_vertex_indices(const kernel_batch *b, int n, int64_t out[4])
{
    for (int i = 0; i < 4; i++) out[i] = kernel_surface_cells_get_mesh_index(b->queued, b->tets.vertex[i][n]);
}

/* Begins a batch with the queued cells: transforms them into tile space, and reads their values, minus the isovalues,
 * and colours. */
static __attribute__((noinline)) void kernel_batch_begin(const kernel_tile_trace *t, kernel_batch *b,
                                                         kernel_surface_cells *queued)
{
    const render_surface_layer *layer = t->surface->layer;
    kernel_surface_cells_fill_lanes(t, queued);
    kernel_transform_tets(&b->tets, &queued->arrays, t->frame, &t->tile, queued->vertex, queued->count);
    kernel_lanes_subtract_isovalues(b->tets.values, 4, queued->isovalue, b->tets.f);
    kernel_surface_cells_set_reach(t, queued, (const kernel_f64(*)[3][2])b->tets.world, 4);
    b->queued = queued;
    b->is_of_faces = layer->is_of_faces;
    b->is_plain = kernel_tile_hits_are_plain(t);
    b->has_normals = false;
    b->line_lanes = 0;
    b->rays.count = b->whole_count = 0;
    if (layer->colour_map)
        kernel_surface_cells_read_colours(t->surface, queued, (const int32_t(*)[SIMD_WIDTH])b->tets.vertex,
                                          (float(*)[SIMD_WIDTH])b->tets.colours);
}

/* Computes a vector along the gradient of the field in each cell of the batch, by Cramer's rule in double. The vector's
 * length and sign are arbitrary. It is called when one of the cells is hit for the first time. */
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

/* ---- tracing rays, one per lane ---- */

/* Returns the rays that have a visible hit on the surface in their cells, and stores the depths of the hits in *depth.
 * is_whole: set if the rays are a whole packet with one cell; has_colour: set if the values of the colour field at the
 * hits are to be stored in *w. */
SIMD_INLINE vm kernel_batch_find_hits(const kernel_tile_trace *t, const kernel_batch *b, const kernel_lane_rays *r,
                                      bool is_whole, bool has_colour, vf *depth, vf *w)
{
    kernel_interval i;
    if (is_whole)
        kernel_tet_rays_interval_in_one(&b->tets, r, r->lane[0], true, has_colour, &i);
    else
        kernel_tet_rays_interval(&b->tets, r, has_colour, &i);
    if (!vm_any(i.mask)) return i.mask;
    const vf v_out = kernel_move_end_value_into_cell(i.v_in, i.v_out, b->is_of_faces);
    const vm near =
        vm_and(i.mask, vm_and(vf_le(i.t_in, r->far), vf_le(kernel_lane_rays_get_begin_depths(t, r), i.t_out)));
    const vm change = vm_and(near, vm_xor(vf_lt(i.v_in, vf_set(0)), vf_lt(v_out, vf_set(0))));
    if (!vm_any(change)) return change;
    *depth = kernel_secant(i.t_in, i.v_in, i.t_out, v_out);
    if (has_colour) {
        const vf length = i.t_out - i.t_in;
        const vf along = vf_select(vf_lt(vf_set(0), length), (*depth - i.t_in) / length, vf_set(0));
        *w = i.w_in + along * (i.w_out - i.w_in);
    }
    return kernel_visible_lane_hits(t, r, change, *depth);
}

/* Computes the contour lines' field in lane n's cell: element n of line_value, line_gradient and line_along. */
static __attribute__((noinline)) void kernel_batch_compute_cell_line_field(const kernel_tile_trace *t, kernel_batch *b,
                                                                           int n)
{
    double world[4][3];
    int64_t vertices[4];
    kernel_tet_line line;
    kernel_batch_get_vertex_indices(b, n, vertices);
    for (int i = 0; i < 4; i++)
        for (int a = 0; a < 3; a++) world[i][a] = kernel_halves_lane(b->tets.world[i][a], n);
    kernel_compute_tet_line_field(t->frame, &t->tile, t->surface, b->queued->part, (const double(*)[3])world, vertices,
                                  &line);
    b->line_value[n] = line.value;
    b->line_along[n] = line.along;
    for (int a = 0; a < 3; a++) b->line_gradient[a][n] = line.gradient[a];
    b->line_lanes |= 1U << n;
}

/* Computes the contour lines' field, its gradient and the surface's normal at the hits. */
static __attribute__((noinline)) void kernel_batch_compute_line_field(const kernel_tile_trace *t, kernel_batch *b,
                                                                      const kernel_lane_rays *r, unsigned hit, vf depth,
                                                                      kernel_line_field *out)
{
    vf last[3];
    if (!b->line_lanes) {
        memset(b->line_value, 0, sizeof b->line_value);
        memset(b->line_along, 0, sizeof b->line_along);
        memset(b->line_gradient, 0, sizeof b->line_gradient);
    }
    for (; hit; hit &= hit - 1) {
        const int n = r->lane[__builtin_ctz(hit)];
        if (!(b->line_lanes >> n & 1)) kernel_batch_compute_cell_line_field(t, b, n);
    }
    out->value = kernel_gather_lane(b->line_value, r->lane);
    for (int a = 0; a < 3; a++) {
        out->gradient[a] = kernel_gather_lane(b->line_gradient[a], r->lane);
        out->normal[a] = vf_permute(b->normal[a], r->lane);
        last[a] = vf_permute(b->tets.at[a][3], r->lane);
    }
    kernel_line_field_add_change_to_hit(out, &r->rays, depth, last, kernel_gather_lane(b->line_along, r->lane));
}

/* Computes a vector along the normal at the hit of each ray, in camera axes. */
SIMD_INLINE void kernel_batch_gather_normals(const kernel_tile_trace *t, kernel_batch *b, vi lane, vf normal[3])
{
    if (!b->has_normals) kernel_batch_compute_normals(b, t->frame);
    for (int a = 0; a < 3; a++) normal[a] = vf_permute(b->normal[a], lane);
}

/* Accepts hits of one vector of rays that need only the colours of their isovalues (kernel_tile_hits_are_plain()).
 * Returns a mask of the blocks that contain a ray whose hit is nearer than its previous one. */
static __attribute__((noinline)) unsigned kernel_batch_accept_plain(kernel_tile_trace *t, kernel_batch *b,
                                                                    const kernel_lane_rays *r, vm hit, vf depth)
{
    vf normal[3];
    kernel_batch_gather_normals(t, b, r->lane, normal);
    return kernel_lane_hits_accept_opaque(t, b->queued, r, hit, depth, normal, NULL);
}

/* Accepts the hits of one vector of rays on any layer. is_whole: set if the rays are a whole packet; w: values of the
 * colour field at the hits. Returns a mask of the blocks that contain a ray whose hit is nearer than its previous
 * one. */
static __attribute__((noinline)) unsigned kernel_batch_accept_hits(kernel_tile_trace *t, kernel_batch *b,
                                                                   const kernel_lane_rays *r, bool is_whole, vm hit,
                                                                   vf depth, vf w)
{
    kernel_line_field along;
    /* members are set one by one, because an initializer would clear all members of the struct */
    kernel_surface_hits h;
    h.t = depth;
    h.w = w;
    h.vertex_count = 4;
    h.along = NULL;
    kernel_batch_gather_normals(t, b, r->lane, h.normal);
    for (int a = 0; a < 3; a++) h.vertices[a] = (const float(*)[SIMD_WIDTH])b->tets.at[a];
    h.vertices[3] = (const float(*)[SIMD_WIDTH])b->tets.f;
    if (t->surface->layer->lines) {
        kernel_batch_compute_line_field(t, b, r, vm_bits(hit), depth, &along);
        h.along = &along;
    }
    if (!is_whole) return kernel_lane_hits_accept(t, b->queued, r, hit, &h);
    kernel_packet *p = &t->packets[r->at[0] / SIMD_WIDTH];
    kernel_lane_hits_set_cells(t, b->queued, r->lane, &h);
    kernel_accept(p, t->surface, hit, &h);
    return kernel_tile_layer_is_opaque(t) ? 1u << r->at[0] / (KERNEL_BLOCK * KERNEL_BLOCK) : 0;
}

/* Loads the vector of rays that begins at index `first` of the list. Rays whose cells lie behind their nearest hits are
 * inactive. */
SIMD_INLINE void kernel_batch_load(const kernel_tile_trace *t, const kernel_batch *b, int first, kernel_lane_rays *out)
{
    if (first < b->whole_count) {
        kernel_lane_rays_of_packet(out, t, kernel_packet_of_pixel(b->rays.pixel[first]), b->rays.lane[first]);
    } else {
        kernel_lane_rays_begin(out, t, &b->rays, first);
        kernel_lane_rays_set_far(out, t);
    }
    out->active = vm_and(out->active, vf_le(kernel_gather_lane(b->queued->near, out->lane), out->far));
}

SIMD_INLINE void kernel_batch_trace_rays(kernel_tile_trace *t, kernel_batch *b, bool has_colour)
{
    unsigned nearer = 0;
    kernel_pixel_list_pad(&b->rays);
    for (int first = 0; first < b->rays.count; first += SIMD_WIDTH) {
        kernel_lane_rays r;
        vf depth, w = vf_set(0);
        kernel_batch_load(t, b, first, &r);
        if (!vm_any(r.active)) continue;
        const bool is_whole = first < b->whole_count;
        const vm hit = kernel_batch_find_hits(t, b, &r, is_whole, has_colour, &depth, &w);
        if (!vm_any(hit)) continue;
        /* a copy to be passed on, because taking the address of r itself would keep r in memory instead of registers */
        const kernel_lane_rays own = r;
        if (!has_colour && b->is_plain && !is_whole)
            nearer |= kernel_batch_accept_plain(t, b, &own, hit, depth);
        else
            nearer |= kernel_batch_accept_hits(t, b, &own, is_whole, hit, depth, w);
    }
    for (; nearer; nearer &= nearer - 1) kernel_block_update_far(t, __builtin_ctz(nearer));
    b->rays.count = b->whole_count = 0;
}

/* Traces all rays in the batch's list, and empties the list. */
static __attribute__((noinline)) void kernel_batch_trace(kernel_tile_trace *t, kernel_batch *b)
{
    if (t->surface->layer->colour_map)
        kernel_batch_trace_rays(t, b, true);
    else
        kernel_batch_trace_rays(t, b, false);
}

/* ---- batches ---- */

/* Sets up the packets of the blocks in which the n-th cell may be visible, and appends rays to the batch's list: if
 * is_whole is set, all rays of the blocks in the mask `blocks`, and otherwise those of the pixels in the cell's box.
 * Traces the list if it is full. */
SIMD_INLINE void kernel_batch_list_rays(kernel_tile_trace *t, kernel_batch *b, int n, unsigned blocks, bool is_whole)
{
    for (unsigned left = b->queued->blocks[n] & ~t->begun; left; left &= left - 1)
        kernel_block_set_up_packets(t, __builtin_ctz(left));
    if (is_whole)
        kernel_pixel_list_add_blocks(&b->rays, blocks, n);
    else
        kernel_pixel_list_add_box(&b->rays, b->queued->box[n], n);
    if (is_whole) b->whole_count = b->rays.count;
    if (b->rays.count >= KERNEL_LIST_PIXELS) kernel_batch_trace(t, b);
}

/* Traces the queue's cells, which become the current batch, and empties the queue. */
static __attribute__((noinline)) void kernel_batch_trace_queued_cells(kernel_tile_trace *t, kernel_batch *b,
                                                                      kernel_surface_cells *queued)
{
    unsigned small = 0;
    kernel_batch_begin(t, b, queued);
    for (int n = 0; n < queued->count; n++) {
        const unsigned blocks = kernel_surface_cells_visible_blocks(t, queued, n);
        if (!blocks) continue;
        if (KERNEL_BLOCK * KERNEL_BLOCK * __builtin_popcount(blocks) <= 2 * kernel_count_pixels_in_box(queued->box[n]))
            kernel_batch_list_rays(t, b, n, blocks, true);
        else
            small |= 1u << n;
    }
    for (; small; small &= small - 1) kernel_batch_list_rays(t, b, __builtin_ctz(small), 0, false);
    if (b->rays.count) kernel_batch_trace(t, b);
    queued->count = 0;
}

#endif
