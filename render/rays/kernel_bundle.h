/* Rays that begin at hits: towards lights, and into the hemisphere above a surface.
 *
 * The cells that such a ray meets must not depend on the partition of the mesh among ranks. The rays are traced by the
 * functions for primary rays. These functions decide only from the positions of a face's vertices in tile space whether
 * and where a ray crosses the face. So the tile space must depend only on the ray; then the result depends only on the
 * ray and the cell. For the rays of a hit's hemisphere, the eye of the tile space is the hit, and depth is measured
 * along the hit's normal. For rays to a light, depth is measured along the light's direction. The plane perpendicular
 * to this direction is divided into square tiles, and a ray belongs to the tile in which it crosses the plane. A bundle
 * is a set of rays with the same tile space. The result does not depend on how rays are divided into bundles. */
#ifndef RENDER_KERNEL_BUNDLE_H
#define RENDER_KERNEL_BUNDLE_H

#include <math.h>

#include "kernel_packet.h"
#include "kernel_types.h"
#include "simd.h"

enum { KERNEL_BUNDLE_RAYS = 64 };

typedef struct kernel_bundle {
    /* Defines the tile space in which the rays are given (kernel_types.h). Only the tile's centre and radius are set;
     * its other members are 0. */
    kernel_tile tile;
    int count;
    /* One bit per ray: set as long as no opaque surface has been found that blocks the ray. Only rays whose bit is set
     * are traced. */
    uint64_t open;
    /* The rays in this tile space: at depth Z they are at origin + slope * Z. Each ray is traced from depth t_near to
     * t_far. */
    float origin_x[KERNEL_BUNDLE_RAYS], origin_y[KERNEL_BUNDLE_RAYS];
    float slope_x[KERNEL_BUNDLE_RAYS], slope_y[KERNEL_BUNDLE_RAYS];
    float t_near[KERNEL_BUNDLE_RAYS], t_far[KERNEL_BUNDLE_RAYS];
    /* the same rays in scaled world coordinates (tree space of kernel_types.h), used to test clips */
    kernel_clip_ray rays[KERNEL_BUNDLE_RAYS];
} kernel_bundle;

SIMD_INLINE vf kernel_bundle_load(const float *list, int count)
{
    float lanes[SIMD_WIDTH];
    for (int i = 0; i < SIMD_WIDTH; i++) lanes[i] = list[i < count ? i : 0];
    return vf_load(lanes);
}

/* Sets up a packet of the bundle's rays `first` to `first` + SIMD_WIDTH - 1. Only rays whose bit in b->open is set are
 * active. */
static inline void kernel_packet_set_up_from_bundle(kernel_packet *p, const kernel_frame *f, kernel_thread *thread,
                                                    const kernel_bundle *b, int first)
{
    const int left = b->count - first, count = left < SIMD_WIDTH ? left : SIMD_WIDTH;
    p->frame = f;
    p->tile = &b->tile;
    p->thread = thread;
    p->is_nearer = p->has_view = p->is_pencil = false;
    p->active = vm_from_bits((unsigned)(b->open >> first) & ((1u << count) - 1));
    p->origin_x = kernel_bundle_load(b->origin_x + first, count);
    p->origin_y = kernel_bundle_load(b->origin_y + first, count);
    p->slope_x = kernel_bundle_load(b->slope_x + first, count);
    p->slope_y = kernel_bundle_load(b->slope_y + first, count);
    p->t_near = kernel_bundle_load(b->t_near + first, count);
    p->t_far = kernel_bundle_load(b->t_far + first, count);
    p->u = p->v = vf_set(0);
}

#endif
