/* Computes the intervals of cells on rays with the kernels of one instruction set (chord_trace.h). */
#include <math.h>

#include "chord_trace.h"
#include "kernel_cell.h"
#include "kernel_cell_cache.h"
#include "kernel_crossings.h"
#include "kernel_packet.h"
#include "kernel_polyhedron.h"
#include "kernel_tile.h"
#include "kernel_tets.h"
#include "kernel_tile_trace.h"
#include "kernel_transformed_tets.h"
#include "kernel_types.h"

typedef struct chord_state {
    chord_rays *rays;
    int first; /* index of the ray in lane 0 */
} chord_state;

static void chord_store_intervals(const chord_state *state, vm mask, vf t_in, vf t_out)
{
    float in[SIMD_WIDTH], out[SIMD_WIDTH];
    vf_store(in, t_in);
    vf_store(out, t_out);
    for (unsigned bits = vm_bits(mask); bits; bits &= bits - 1) {
        const int lane = __builtin_ctz(bits), ray = state->first + lane;
        const int at = state->rays->interval_count[ray]++;
        if (at < CHORD_MAX_INTERVALS) state->rays->ray_intervals[ray][at] = (chord_interval){in[lane], out[lane]};
    }
}

static void chord_trace_polyhedron(kernel_packet *p, const chord_state *state, const grid_field *field, int part,
                                   uint32_t index, vm rays)
{
    polyhedron *c = polyhedra_find(p->thread->polyhedra, p->frame->job->parts[part].cells, field, part, 0, index);
    kernel_poly_crossings r;
    if (!c) p->thread->out_of_memory = true;
    if (!c) return;
    if (!c->is_transformed) {
        kernel_polyhedron_transform(c, p);
        for (int i = 0; i <= c->vertex_count; i++) c->f[i] = 0;
    }
    if (!kernel_poly_allocate(p, c, &r) || !kernel_poly_cross(&r, rays, false)) return;
    while (kernel_poly_find_next_interval(&r))
        chord_store_intervals(state, r.interval.mask, r.interval.t_in, r.interval.t_out);
}

/* Computes the interval of the rays in a tet, which has been read and sorted. */
static void chord_tet_interval(const kernel_packet *p, const kernel_cell *c, vm rays, kernel_interval *out)
{
    const kernel_lane_rays r = {.rays = kernel_packet_rays(p), .active = rays, .u = p->u, .v = p->v};
    kernel_transformed_tets tet;
    kernel_transform_single_tet(&tet, c, p->frame, p->tile);
    for (int i = 0; i < 4; i++) tet.f[i] = vf_set(0);
    kernel_tet_rays_interval_in_one(&tet, &r, 0, p->is_pencil, false, out);
}

static void chord_trace_cell(kernel_packet *p, const chord_state *state, const grid_field *field, int part,
                             uint32_t index, vm rays)
{
    kernel_cell *c = kernel_cell_cache_find(p, 0, part, field, index);
    kernel_interval list[KERNEL_MAX_CELL_INTERVALS];
    int intervals = 1;
    if (c->type == GRID_POLYHEDRON) {
        chord_trace_polyhedron(p, state, field, part, index, rays);
        return;
    }
    if (!c->is_transformed) {
        kernel_cell_transform_in_tile(c, p->frame, p->tile, p->frame->job->parts[part].cells);
        if (p->is_pencil && c->type != GRID_TET) kernel_cell_compute_lines(c, p->frame, p->tile);
        for (int i = 0; i < c->count; i++) c->f[i] = 0;
    }
    if (c->type == GRID_TET)
        chord_tet_interval(p, c, rays, &list[0]);
    else
        intervals = kernel_curved_intervals(p, c, rays, list);
    for (int n = 0; n < intervals; n++) chord_store_intervals(state, list[n].mask, list[n].t_in, list[n].t_out);
}

/* Returns whether a ray may meet a node's box. The box is enlarged by more than all rounding errors. */
static bool chord_meets_box(const double base[3], const double direction[3], const float lower[4], const float upper[4])
{
    double from = -1e30, to = 1e30;
    for (int a = 0; a < 3; a++) {
        const double low = (double)lower[a] - 1e-4 - base[a], high = (double)upper[a] + 1e-4 - base[a];
        if (fabs(direction[a]) < 1e-9) {
            if (low > 0 || high < 0) return false;
            continue;
        }
        from = fmax(from, fmin(low / direction[a], high / direction[a]));
        to = fmin(to, fmax(low / direction[a], high / direction[a]));
    }
    return from <= to;
}

static unsigned chord_find_rays_in_box(const kernel_packet *p, const double px[SIMD_WIDTH], const double py[SIMD_WIDTH],
                                       const mmbvh *tree, int64_t node)
{
    float lower[4], upper[4];
    unsigned met = 0;
    mmbvh_node_box(tree, node, lower, upper);
    for (int i = 0; i < SIMD_WIDTH; i++) {
        double base[3], direction[3];
        kernel_compute_scaled_world_ray(p->frame, px[i], py[i], base, direction);
        met |= (unsigned)chord_meets_box(base, direction, lower, upper) << i;
    }
    return met & vm_bits(p->active);
}

static void chord_trace_part(kernel_packet *p, const double px[SIMD_WIDTH], const double py[SIMD_WIDTH],
                             const chord_state *state, int part)
{
    const mmbvh *tree = p->frame->job->parts[part].tree;
    const grid_field *field = &p->frame->job->surfaces[0].field.fields[part];
    int64_t stack[MMBVH_MAX_DEPTH];
    int top = 0;
    if (tree->node_count) stack[top++] = 0;
    while (top) {
        const int64_t node = stack[--top], ref = mmbvh_node_ref(tree, node);
        const int count = mmbvh_node_count(tree, node);
        const unsigned met = chord_find_rays_in_box(p, px, py, tree, node);
        if (!met) continue;
        for (int n = 0; n < count; n++)
            chord_trace_cell(p, state, field, part, tree->cells[ref + n], vm_from_bits(met));
        if (count) continue;
        stack[top++] = ref;
        stack[top++] = ref + 1;
    }
}

static void chord_set_tile_rays(kernel_packet *p, const double px[SIMD_WIDTH], const double py[SIMD_WIDTH])
{
    const bool flat = p->frame->job->camera.is_orthographic;
    const double reach = kernel_slope_to_origin(p->frame);
    float lanes[4][SIMD_WIDTH];
    for (int i = 0; i < SIMD_WIDTH; i++) {
        const double dx = px[i] - p->tile->centre_x, dy = py[i] - p->tile->centre_y;
        lanes[0][i] = (float)(dx * reach);
        lanes[1][i] = flat ? 0 : (float)dx;
        lanes[2][i] = (float)(dy * reach);
        lanes[3][i] = flat ? 0 : (float)dy;
    }
    p->origin_x = vf_load(lanes[0]);
    p->slope_x = vf_load(lanes[1]);
    p->origin_y = vf_load(lanes[2]);
    p->slope_y = vf_load(lanes[3]);
}

/* Sets up a packet as kernel_packet_begin() does, but for any rays, not only those of pixels. */
static void chord_set_up_packet(kernel_packet *p, const kernel_frame *f, const kernel_tile *tile, kernel_thread *thread,
                                const chord_rays *rays, int first, double px[SIMD_WIDTH], double py[SIMD_WIDTH])
{
    const int count = rays->count - first < SIMD_WIDTH ? rays->count - first : SIMD_WIDTH;
    p->frame = f;
    p->tile = tile;
    p->thread = thread;
    p->active = vm_from_bits((1u << count) - 1u);
    for (int lane = 0; lane < SIMD_WIDTH; lane++) {
        const int ray = first + (lane < count ? lane : 0);
        px[lane] = rays->x[ray];
        py[lane] = rays->y[ray];
    }
    chord_set_tile_rays(p, px, py);
    p->is_pencil = rays->is_pencil;
    p->u = f->job->camera.is_orthographic ? p->origin_x : p->slope_x;
    p->v = f->job->camera.is_orthographic ? p->origin_y : p->slope_y;
    p->t_near = vf_set((float)-f->depth_shift);
    p->t_far = vf_set(INFINITY);
}

static double chord_compute_radius(const kernel_frame *f, const chord_rays *rays)
{
    double most = 0;
    for (int i = 0; i < rays->count; i++)
        most = fmax(most, fmax(fabs(rays->x[i] - rays->centre_x), fabs(rays->y[i] - rays->centre_y)));
    return most * (f->job->camera.is_orthographic ? f->job->space.scale : 1) * (1 + 1e-6);
}

static void chord_trace(const kernel_frame *f, kernel_thread *thread, chord_rays *rays)
{
    const bool flat = f->job->camera.is_orthographic;
    const kernel_tile tile = {.depth_shift = f->depth_shift,
                              .centre_x = rays->centre_x,
                              .centre_y = rays->centre_y,
                              .shear_x = flat ? 0 : (float)rays->centre_x,
                              .shear_y = flat ? 0 : (float)rays->centre_y,
                              .radius = (float)chord_compute_radius(f, rays)};
    thread->serial++;
    for (int i = 0; i < rays->count; i++) rays->interval_count[i] = 0;
    for (int first = 0; first < rays->count; first += SIMD_WIDTH) {
        kernel_packet p;
        double px[SIMD_WIDTH], py[SIMD_WIDTH];
        const chord_state state = {rays, first};
        chord_set_up_packet(&p, f, &tile, thread, rays, first, px, py);
        for (int part = 0; part < f->job->part_count; part++) chord_trace_part(&p, px, py, &state, part);
    }
}

const chord_table CHORD_TABLE = {SIMD_WIDTH, KERNEL_CACHE_CELLS * sizeof(kernel_cell), chord_trace};
