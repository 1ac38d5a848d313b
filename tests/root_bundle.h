/* One cell and one packet of rays, for the tests of the root finder. These tests compile the kernels' headers. */
#ifndef ROOT_BUNDLE_H
#define ROOT_BUNDLE_H

#include "kernel_bounds.h"
#include "kernel_cell.h"
#include "kernel_crossings.h"
#include "kernel_map.h"
#include "kernel_packet.h"
#include "kernel_roots.h"
#include "kernel_types.h"

typedef struct bundle {
    double values[8]; /* in the order in which the test numbers vertices */
    kernel_frame frame;
    kernel_tile tile;
    kernel_thread thread;
    kernel_packet packet;
    kernel_cell cell;
} bundle;

static inline void bundle_aim_ray(bundle *b, int lane, const double from[3], const double to[3])
{
    const double rise = to[2] - from[2];
    for (int a = 0; a < 2; a++) {
        const double slope = (to[a] - from[a]) / rise, origin = from[a] - slope * from[2];
        (a ? &b->packet.slope_y : &b->packet.slope_x)[0][lane] = (float)slope;
        (a ? &b->packet.origin_y : &b->packet.origin_x)[0][lane] = (float)origin;
    }
}

static inline void bundle_initialize(bundle *b)
{
    b->packet.frame = &b->frame;
    b->packet.tile = &b->tile;
    b->packet.thread = &b->thread;
    b->packet.active = vm_all_lanes();
    b->packet.t_near = vf_set(-100);
    b->packet.t_far = vf_set(INFINITY);
}

/* Transforms a cell whose type, count, world and values are set. Tile space equals world space here. */
static inline void bundle_transform_cell(bundle *b)
{
    kernel_cell_sort_vertices(&b->cell);
    for (int i = 0; i < b->cell.count; i++) {
        b->cell.x[i] = (float)b->cell.world[i][0];
        b->cell.y[i] = (float)b->cell.world[i][1];
        b->cell.z[i] = (float)b->cell.world[i][2];
        b->cell.f[i] = (float)b->cell.values[i];
    }
}

/* Returns a beam that contains the directions of all rays of the packet. */
static inline kernel_beam bundle_compute_beam(const kernel_packet *p)
{
    const vf most = vf_max(vf_abs(p->slope_x), vf_abs(p->slope_y));
    return (kernel_beam){.spread = vf_reduce_max(most)};
}

/* Computes the packet's intervals in the cell and the bounds of the cell. Returns the number of intervals. */
static inline int bundle_find_intervals(bundle *b, kernel_interval list[KERNEL_MAX_CELL_INTERVALS],
                                        kernel_curved *curved)
{
    const kernel_beam beam = bundle_compute_beam(&b->packet);
    kernel_curved_single_bounds(&b->cell, &beam, curved);
    return kernel_curved_intervals(&b->packet, &b->cell, b->packet.active, list);
}

/* Finds the first hit on each ray and the number of hits on each ray. Returns the mask of rays with a hit. */
static inline vm bundle_find_hits(bundle *b, const kernel_curved *curved, const kernel_interval *i, vf *t, vf *hits)
{
    const kernel_rays rays = kernel_packet_rays(&b->packet);
    kernel_search s;
    vm hit = vm_none();
    *t = *hits = vf_set(0);
    if (!kernel_search_cells(&s, curved, &rays, vi_set(0), i, i->mask, &b->thread.map_failures)) return hit;
    do {
        kernel_point place;
        if (!vm_any(s.found)) continue;
        kernel_refine_roots(&s, &place);
        *t = vf_select(vm_andnot(s.found, hit), place.t, *t);
        *hits += vf_select(s.found, vf_set(1), vf_set(0));
        hit = vm_or(hit, s.found);
    } while (kernel_search_continue(&s));
    return hit;
}

#endif
