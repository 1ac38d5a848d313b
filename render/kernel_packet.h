/* A packet: SIMD_WIDTH rays of one tile, and the two frames of coordinates they live in.
 *
 * Tree space: (position - origin) * scale, in which boxes are tested.
 *
 * Tile space: camera axes, scaled, sheared so that the ray through the tile's centre is the depth axis:
 *     X = x - centre_x (z + shift),  Y likewise,  Z = z          (perspective)
 *     X = x - centre_x,              Y likewise,  Z = z          (orthographic)
 * A cell's vertices are taken there in double and then rounded to float: near the tile's rays X and Y are as small as
 * the cell, so that their rounding is relative to the cell and not to the distance from the eye. A vertex has the
 * same X, Y, Z in every cell and on every rank: the tile, not the cell, decides the frame. Within the tile, a ray
 * is the point (origin_x + slope_x Z, origin_y + slope_y Z, Z), with slope and origin tiny. */
#ifndef RENDER_KERNEL_PACKET_H
#define RENDER_KERNEL_PACKET_H

#include "kernel_types.h"
#include "simd.h"

typedef struct kernel_tile {
    double centre_x, centre_y; /* slope (perspective) or offset (orthographic) of the centre */
    float shear_x, shear_y;    /* the centre's slope; 0 where orthographic */
} kernel_tile;

typedef struct kernel_packet {
    const kernel_frame *frame;
    const kernel_tile *tile;
    kernel_thread *thread;
    vm active;
    uint32_t pixel[SIMD_WIDTH];
    /* tile space */
    vf origin_x, origin_y, slope_x, slope_y;
    /* tree space: planes are met at t = plane * inverse - shift */
    vf inverse[3], shift[3];
    float pad; /* boxes are widened by it: more than all rounding in the box test */
    float centre_direction[3];
    vf t_near; /* the eye's plane */
    vf t_far;  /* nearest opaque hit so far, +inf at first */
    /* camera space direction to the eye, for shading: unit length */
    vf view[3];
    /* samples: at t = sample_base + m * sample_step for whole numbers m >= sample_first */
    vf sample_base, sample_step;
    int sample_first;
} kernel_packet;

/* Packets cover rectangles: 4 × 4, 4 × 2 or 2 × 2 pixels. */
enum { KERNEL_PACKET_COLUMNS = SIMD_WIDTH == 4 ? 2 : 4, KERNEL_PACKET_ROWS = SIMD_WIDTH / KERNEL_PACKET_COLUMNS };

static inline double kernel_column(const kernel_frame *f, double x)
{
    return f->slope_x0 + x * f->slope_dx;
}
static inline double kernel_row(const kernel_frame *f, double y)
{
    return f->slope_y0 + y * f->slope_dy;
}

static inline void kernel_tile_setup(kernel_tile *tile, const kernel_frame *f, int x0, int y0)
{
    tile->centre_x = kernel_column(f, x0 + 0.5 * (KERNEL_TILE - 1));
    tile->centre_y = kernel_row(f, y0 + 0.5 * (KERNEL_TILE - 1));
    const bool flat = f->job->camera.is_orthographic;
    tile->shear_x = flat ? 0 : (float)tile->centre_x;
    tile->shear_y = flat ? 0 : (float)tile->centre_y;
}

/* Base point at t = 0 and direction per t of the ray with column and row parameters (px, py), in tree space. */
static inline void kernel_tree_ray(const kernel_frame *f, double px, double py, double base[3], double direction[3])
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

static inline void kernel_packet_lane(kernel_packet *p, int lane, int x, int y, float *lanes[])
{
    const kernel_frame *f = p->frame;
    const render_job *job = f->job;
    const double px = kernel_column(f, x), py = kernel_row(f, y);
    const double dx = px - p->tile->centre_x, dy = py - p->tile->centre_y;
    const bool flat = job->camera.is_orthographic;
    lanes[0][lane] = (float)(flat ? dx * job->space.scale : dx * f->depth_shift);
    lanes[1][lane] = (float)(flat ? dy * job->space.scale : dy * f->depth_shift);
    lanes[2][lane] = flat ? 0 : (float)dx;
    lanes[3][lane] = flat ? 0 : (float)dy;
    double base[3], direction[3];
    kernel_tree_ray(f, px, py, base, direction);
    for (int a = 0; a < 3; a++) {
        double d = direction[a];
        if (fabs(d) < 1e-12) d = d < 0 ? -1e-12 : 1e-12;
        lanes[4 + a][lane] = (float)(1 / d);
        lanes[7 + a][lane] = (float)(base[a] * (double)(float)(1 / d));
        const float size = (float)fabs(base[a]);
        if (size > p->pad) p->pad = size;
    }
    const double length = flat ? 1 : sqrt(1 + px * px + py * py);
    lanes[10][lane] = flat ? 0 : (float)(-px / length);
    lanes[11][lane] = flat ? 0 : (float)(-py / length);
    lanes[12][lane] = (float)(-1 / length);
    p->pixel[lane] = (uint32_t)y * (uint32_t)job->camera.width + (uint32_t)x;
    if (f->volume_count) {
        const double dt = f->scaled_step / length;
        const double jitter = job->jitter ? render_jitter(p->pixel[lane], (uint32_t)job->frame) : 0.5;
        lanes[13][lane] = (float)((-p->sample_first + jitter) * dt - f->depth_shift);
        lanes[14][lane] = (float)dt;
    }
}

/* Number the samples from one near the depth origin, so that float32 holds their places well; the number depends on
 * the camera alone. sample_first <= 0 is the sample at the eye. */
static inline int kernel_sample_first(const kernel_frame *f)
{
    const double count = floor(f->depth_shift / f->scaled_step);
    return count > 0 && count < 1e9 ? -(int)count : 0;
}

static inline void kernel_packet_setup(kernel_packet *p, const kernel_frame *f, const kernel_tile *tile,
                                       kernel_thread *thread, int x0, int y0)
{
    float store[15][SIMD_WIDTH] = {{0}};
    float *lanes[15];
    for (int i = 0; i < 15; i++) lanes[i] = store[i];
    p->frame = f;
    p->tile = tile;
    p->thread = thread;
    p->pad = 1;
    p->sample_first = f->volume_count ? kernel_sample_first(f) : 0;
    unsigned bits = 0;
    for (int lane = 0; lane < SIMD_WIDTH; lane++) {
        const int x = x0 + lane % KERNEL_PACKET_COLUMNS, y = y0 + lane / KERNEL_PACKET_COLUMNS;
        const bool inside = x < f->job->camera.width && y < f->job->camera.height;
        if (inside) bits |= 1u << lane;
        kernel_packet_lane(p, lane, inside ? x : x0, inside ? y : y0, lanes);
    }
    p->active = vm_from_bits(bits);
    p->origin_x = vf_load(store[0]);
    p->origin_y = vf_load(store[1]);
    p->slope_x = vf_load(store[2]);
    p->slope_y = vf_load(store[3]);
    for (int a = 0; a < 3; a++) {
        p->inverse[a] = vf_load(store[4 + a]);
        p->shift[a] = vf_load(store[7 + a]);
        p->view[a] = vf_load(store[10 + a]);
    }
    /* Positions near the scene and the base are at most of size pad + 1; plane * inverse - shift errs by 2 roundings of
     * that, the base by 1, the direction by 1 over the scene's size: 16 units leave a margin of 2. */
    p->pad = 16 * 6e-8f * (p->pad + 1);
    double base[3], direction[3];
    kernel_tree_ray(f, tile->centre_x, tile->centre_y, base, direction);
    for (int a = 0; a < 3; a++) p->centre_direction[a] = (float)direction[a];
    p->t_near = vf_set((float)-f->depth_shift);
    p->t_far = vf_set(INFINITY);
    p->sample_base = vf_load(store[13]);
    p->sample_step = vf_load(store[14]);
}

/* Where the packet's rays are in the node's box, between low and high. */
SIMD_INLINE vm kernel_box(const kernel_packet *p, const mmbvh_node *node, vf *t_in, vf *t_out)
{
    vf low = *t_in, high = *t_out;
    for (int a = 0; a < 3; a++) {
        const vf t1 = vf_set(node->lower[a] - p->pad) * p->inverse[a] - p->shift[a];
        const vf t2 = vf_set(node->upper[a] + p->pad) * p->inverse[a] - p->shift[a];
        low = vf_max(low, vf_min(t1, t2));
        high = vf_min(high, vf_max(t1, t2));
    }
    *t_in = low;
    *t_out = high;
    return vf_le(low, high);
}

#endif
