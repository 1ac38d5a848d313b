/* Defines the packet: SIMD_WIDTH rays of one tile, one per lane, in tile space (kernel_types.h), with the interval of
 * depths in which each ray is traced. */
#ifndef RENDER_KERNEL_PACKET_H
#define RENDER_KERNEL_PACKET_H

#include <math.h>
#include <string.h>

#include "kernel_clip.h"
#include "kernel_hits.h"
#include "kernel_types.h"
#include "mmbvh.h"
#include "pixel_set.h"
#include "render.h"
#include "simd.h"

typedef struct kernel_packet {
    const kernel_frame *frame;
    const kernel_tile *tile;
    kernel_thread *thread;
    kernel_hits *hits; /* hits on surfaces; set only for packets of a tile that is being traced */
    vi column, row;    /* column and row of each ray's pixel */
    vm active;
    bool is_nearer; /* set when a nearer hit has decreased t_far of some ray; callers clear it */
    bool has_view;
    /* the rays in tile space: at depth Z they are at origin + slope * Z */
    vf origin_x, origin_y, slope_x, slope_y;
    /* Set if the edge functions of rays are computed from lines (kernel_cell.h). The line of a cell's edge is its edge
     * function as an affine function of (u, v), which is a camera ray's slope or, if the camera is orthographic, its
     * origin. Lines are used for camera rays through the tile's pixels, except for segments of volumes. For all other
     * rays, edge functions are computed from projected vertices. */
    bool is_pencil;
    vf u, v;
    vf t_near; /* t at which the rays begin: that of the eye's plane, or clip_in if that is farther */
    vf t_far;  /* t at which the rays end: that of the nearest opaque hit so far; initially +inf or clip_out */
    uint32_t pixel[SIMD_WIDTH];
    /* unit vector from the scene to the eye in camera axes, for shading; valid if has_view is set */
    vf view[3];
    /* samples of volumes are at t = sample_base + m * sample_step for integers m >= sample_first; sample_inverse is 1 /
     * sample_step */
    vf sample_base, sample_step, sample_inverse;
    int sample_first;
    /* The interval of t that clips leave of each ray: the clips of volumes, while volumes with clips of their own are
     * traced; otherwise the clips that all layers share (kernel_frame.common_clips). Without clips the interval is from
     * -inf to +inf. Set only if the frame has volumes or common clips. */
    vf clip_in, clip_out;
    /* Exact length of the interval from clip_in to clip_out, divided by the difference of these two rounded numbers.
     * The ratio is far from 1 only if the interval is very short, for example because the ray grazes a sphere. */
    vf clip_length_ratio;
    /* Saved values of active, t_near and t_far after the surfaces have been traced. They are restored for each of the
     * intervals that the clips of volumes leave (kernel_packet_clip_volumes()). */
    vm all_active;
    vf surface_near, surface_far;
} kernel_packet;

/* A packet covers a rectangle of 4 × 4, 4 × 2 or 2 × 2 pixels, for vectors of 16, 8 or 4 lanes. */
enum { KERNEL_PACKET_COLUMNS = SIMD_WIDTH == 4 ? 2 : 4, KERNEL_PACKET_ROWS = SIMD_WIDTH / KERNEL_PACKET_COLUMNS };

/* Computes a ray in the scaled world coordinates that kernel_types.h calls tree space: its point at t is base + t *
 * direction. px, py: slope (perspective) or offset (orthographic) of the ray's column and row of pixels
 * (kernel_column_slope(), kernel_row_slope()). */
static inline void kernel_compute_scaled_world_ray(const kernel_frame *f, double px, double py, double base[3],
                                                   double direction[3])
{
    const render_camera *c = &f->job->camera;
    const render_space *s = &f->job->space;
    for (int a = 0; a < 3; a++) {
        const double sideways = px * c->right[a] + py * c->up[a];
        const double along = c->forward[a] + (c->is_orthographic ? 0.0 : sideways);
        const double start = (c->eye[a] - s->origin[a]) * s->scale + (c->is_orthographic ? sideways * s->scale : 0.0);
        direction[a] = along;
        base[a] = start + f->depth_shift * along;
    }
}

/* Computes, for each ray of a packet, the slope (perspective) or offset (orthographic) of its column (px) and of its
 * row (py) of pixels. */
static inline void kernel_packet_compute_pixel_slopes(const kernel_packet *p, double px[SIMD_WIDTH],
                                                      double py[SIMD_WIDTH])
{
    for (int i = 0; i < SIMD_WIDTH; i++) {
        px[i] = kernel_column_slope(p->frame, p->column[i]);
        py[i] = kernel_row_slope(p->frame, p->row[i]);
    }
}

/* Returns entries[index] for each lane. entries: one number for each column, or for each row, of the tile. */
SIMD_INLINE vf kernel_gather_from_tile_row_or_column(const float entries[KERNEL_TILE], vi index)
{
    return SIMD_WIDTH == KERNEL_TILE ? vf_permute(vf_load(entries), index) : vf_gather(entries, index);
}

/* Sets the rays of the packet whose upper left pixel is (x0, y0), and their pixels' columns and rows. */
static inline void kernel_packet_set_rays_of_tile(kernel_packet *p, int x0, int y0)
{
    const kernel_tile *tile = p->tile;
    const vi column = vi_lanes() & (KERNEL_PACKET_COLUMNS - 1), row = vi_lanes() / KERNEL_PACKET_COLUMNS;
    const vi tile_column = column + (x0 - tile->x0), tile_row = row + (y0 - tile->y0);
    p->column = column + x0;
    p->row = row + y0;
    p->origin_x = kernel_gather_from_tile_row_or_column(tile->origin_x, tile_column);
    p->slope_x = kernel_gather_from_tile_row_or_column(tile->slope_x, tile_column);
    p->origin_y = kernel_gather_from_tile_row_or_column(tile->origin_y, tile_row);
    p->slope_y = kernel_gather_from_tile_row_or_column(tile->slope_y, tile_row);
}

/* Sets the indices of the packet's pixels in the image from their columns and rows, and makes those rays active whose
 * pixels lie in the image and are traced. */
static inline void kernel_packet_set_pixels(kernel_packet *p, int x0, int y0)
{
    typedef uint32_t kernel_lane_pixels __attribute__((vector_size(SIMD_WIDTH * 4)));
    const render_job *job = p->frame->job;
    const int columns = job->camera.width - x0, rows = job->camera.height - y0;
    const int inside = columns < 0 ? 0 : columns < KERNEL_PACKET_COLUMNS ? columns : KERNEL_PACKET_COLUMNS;
    const kernel_lane_pixels pixels =
        (kernel_lane_pixels)p->row * (uint32_t)job->camera.width + (kernel_lane_pixels)p->column;
    unsigned bits = 0;
    memcpy(p->pixel, &pixels, sizeof pixels);
    for (int y = 0; y < KERNEL_PACKET_ROWS && y < rows; y++) bits |= ((1u << inside) - 1) << y * KERNEL_PACKET_COLUMNS;
    for (int lane = 0; job->pixels && lane < SIMD_WIDTH; lane++)
        if (bits >> lane & 1 && !pixel_set_has(job->pixels, p->pixel[lane])) bits &= ~(1u << lane);
    p->active = vm_from_bits(bits);
}

/* Computes the directions from the scene to the eye (p->view) unless they are already set; kernel_shade() needs
 * them. */
static inline void kernel_packet_set_view(kernel_packet *p)
{
    if (p->has_view) return;
    double px[SIMD_WIDTH], py[SIMD_WIDTH];
    float square[SIMD_WIDTH], x[SIMD_WIDTH], y[SIMD_WIDTH];
    p->has_view = true;
    if (p->frame->job->camera.is_orthographic) {
        p->view[0] = p->view[1] = vf_set(0);
        p->view[2] = vf_set(-1);
        return;
    }
    kernel_packet_compute_pixel_slopes(p, px, py);
    for (int i = 0; i < SIMD_WIDTH; i++) {
        square[i] = (float)(1 + px[i] * px[i] + py[i] * py[i]);
        x[i] = (float)px[i];
        y[i] = (float)py[i];
    }
    p->view[2] = -1.0f / vf_sqrt(vf_load(square));
    p->view[0] = vf_load(x) * p->view[2];
    p->view[1] = vf_load(y) * p->view[2];
}

/* Returns the index of the first sample on a ray, the one next to the eye. The index is 0 or negative. Sample 0 is near
 * the depth origin, in the scene, so that products of an index and the step have small rounding errors in the scene.
 * The indices depend only on the camera and the step. */
static inline int kernel_first_sample_number(const kernel_frame *f)
{
    const double count = floor(f->depth_shift / f->scaled_step);
    return count > 0 && count < 1e9 ? -(int)count : 0;
}

static inline void kernel_packet_set_samples(kernel_packet *p)
{
    const kernel_frame *f = p->frame;
    double px[SIMD_WIDTH], py[SIMD_WIDTH];
    float base[SIMD_WIDTH], step[SIMD_WIDTH];
    kernel_packet_compute_pixel_slopes(p, px, py);
    p->sample_first = kernel_first_sample_number(f);
    for (int i = 0; i < SIMD_WIDTH; i++) {
        const bool flat = f->job->camera.is_orthographic;
        const double length = flat ? 1 : sqrt(1 + px[i] * px[i] + py[i] * py[i]);
        const double dt = f->scaled_step / length;
        const double jitter = f->job->jitter ? render_jitter(p->pixel[i], (uint32_t)f->job->frame) : 0.5;
        base[i] = (float)((-p->sample_first + jitter) * dt - f->depth_shift);
        step[i] = (float)dt;
    }
    p->sample_base = vf_load(base);
    p->sample_step = vf_load(step);
    p->sample_inverse = 1.0f / p->sample_step;
}

/* Sets clip_in and clip_out of each ray. The clips in the mask `clips` may divide the part of the ray in front of the
 * eye into several intervals; the one with the index `number` is chosen, counted from 0. */
static __attribute__((noinline, cold)) void kernel_packet_set_clip_interval(kernel_packet *p, uint32_t clips,
                                                                            int number)
{
    const kernel_frame *f = p->frame;
    double px[SIMD_WIDTH], py[SIMD_WIDTH];
    float from[SIMD_WIDTH], to[SIMD_WIDTH], stretch[SIMD_WIDTH];
    kernel_packet_compute_pixel_slopes(p, px, py);
    for (int i = 0; i < SIMD_WIDTH; i++) {
        kernel_clip_ray ray;
        kernel_compute_scaled_world_ray(f, px[i], py[i], ray.base, ray.direction);
        const kernel_ray_part part = kernel_clip_find_interval(f->job, clips, &ray, -f->depth_shift, number);
        const double length = part.end - part.begin;
        from[i] = (float)part.begin;
        to[i] = (float)part.end;
        if (length > 0 && to[i] <= from[i]) to[i] = nextafterf(from[i], INFINITY);
        stretch[i] = length > 0 && length < 1 ? (float)(length / ((double)to[i] - (double)from[i])) : 1;
    }
    p->clip_in = vf_load(from);
    p->clip_out = vf_load(to);
    p->clip_length_ratio = vf_load(stretch);
}

/* Restricts the packet's rays to the interval that the clips of all layers (kernel_frame.common_clips) leave, and
 * deactivates rays of which nothing is left. */
static inline void kernel_packet_clip(kernel_packet *p)
{
    kernel_packet_set_clip_interval(p, p->frame->common_clips, 0);
    p->t_near = vf_max(p->t_near, p->clip_in);
    p->t_far = p->clip_out;
    p->active = vm_and(p->active, vf_le(p->t_near, p->t_far));
}

/* Restricts each of the packet's rays to the interval with the index `number`, counted from 0, among the intervals that
 * the clips of volumes leave of the ray. All surfaces must have been traced before. */
static inline void kernel_packet_clip_volumes(kernel_packet *p, int number)
{
    if (number == 0) {
        p->all_active = p->active;
        p->surface_near = p->t_near;
        p->surface_far = p->t_far;
    }
    kernel_packet_set_clip_interval(p, p->frame->job->volume_clips, number);
    p->t_near = vf_max(p->surface_near, p->clip_in);
    p->t_far = vf_min(p->surface_far, p->clip_out);
    p->active = vm_and(p->all_active, vf_le(p->t_near, p->t_far));
}

/* Sets up the packet whose upper left pixel is (x0, y0). kernel_tile_compute_rays() must have been called for the tile.
 * Members for shading and samples are not set. */
static inline void kernel_packet_begin(kernel_packet *p, const kernel_frame *f, const kernel_tile *tile,
                                       kernel_thread *thread, int x0, int y0)
{
    const bool is_orthographic = f->job->camera.is_orthographic;
    p->frame = f;
    p->tile = tile;
    p->thread = thread;
    p->has_view = p->is_nearer = false;
    kernel_packet_set_rays_of_tile(p, x0, y0);
    kernel_packet_set_pixels(p, x0, y0);
    p->is_pencil = true;
    p->u = is_orthographic ? p->origin_x : p->slope_x;
    p->v = is_orthographic ? p->origin_y : p->slope_y;
    p->t_near = vf_set((float)-f->depth_shift);
    p->t_far = vf_set(INFINITY);
    if (f->volume_count) {
        p->clip_in = vf_set(-INFINITY);
        p->clip_out = vf_set(INFINITY);
        p->clip_length_ratio = vf_set(1);
    }
    if (f->common_clips) kernel_packet_clip(p);
}

/* One ray per lane in tile space: x = origin_x + slope_x * Z, and likewise y. */
typedef struct kernel_rays {
    vf origin_x, origin_y, slope_x, slope_y;
} kernel_rays;

/* A point of each ray inside a cell. t: depth; value: the field there; r: reference coordinates in the cell. mask: the
 * rays that have such a point; functions that compute crossings of faces set the mask, others only if their comment
 * says so. */
typedef struct kernel_point {
    vf t, value, r[3];
    vm mask;
} kernel_point;

/* Copies the points of the rays in `mask`, except their member `mask`; other lanes of *to are unchanged. */
SIMD_INLINE void kernel_point_copy_lanes(vm mask, const kernel_point *from, kernel_point *to)
{
    to->t = vf_select(mask, from->t, to->t);
    to->value = vf_select(mask, from->value, to->value);
    for (int a = 0; a < 3; a++) to->r[a] = vf_select(mask, from->r[a], to->r[a]);
}

/* Exchanges the two points on rays whose second point is nearer than the first. */
SIMD_INLINE void kernel_points_sort_by_depth(kernel_point ends[2])
{
    const vm swap = vf_lt(ends[1].t, ends[0].t);
    const kernel_point first = ends[0];
    kernel_point_copy_lanes(swap, &ends[1], &ends[0]);
    kernel_point_copy_lanes(swap, &first, &ends[1]);
}

SIMD_INLINE kernel_rays kernel_packet_rays(const kernel_packet *p)
{
    return (kernel_rays){p->origin_x, p->origin_y, p->slope_x, p->slope_y};
}

#endif
