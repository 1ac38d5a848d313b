/* A cell and the rays of a packet, for the tests of the root finder: the kernels' headers are compiled into them. */
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
    double values[8]; /* as the test numbers vertices */
    kernel_frame frame;
    kernel_tile tile;
    kernel_thread thread;
    kernel_packet packet;
    kernel_cell cell;
} bundle;

static inline void bundle_aim(bundle *b, int lane, const double from[3], const double to[3])
{
    const double rise = to[2] - from[2];
    for (int a = 0; a < 2; a++) {
        const double slope = (to[a] - from[a]) / rise, origin = from[a] - slope * from[2];
        (a ? &b->packet.slope_y : &b->packet.slope_x)[0][lane] = (float)slope;
        (a ? &b->packet.origin_y : &b->packet.origin_x)[0][lane] = (float)origin;
    }
}

static inline void bundle_open(bundle *b)
{
    b->packet.frame = &b->frame;
    b->packet.tile = &b->tile;
    b->packet.thread = &b->thread;
    b->packet.active = vm_all_lanes();
    b->packet.t_near = vf_set(-100);
    b->packet.t_far = vf_set(INFINITY);
}

/* A cell whose type, count, world and values are set: tile space is the world. */
static inline void bundle_place(bundle *b)
{
    kernel_cell_order(&b->cell);
    for (int i = 0; i < b->cell.count; i++) {
        b->cell.x[i] = (float)b->cell.world[i][0];
        b->cell.y[i] = (float)b->cell.world[i][1];
        b->cell.z[i] = (float)b->cell.world[i][2];
        b->cell.f[i] = (float)b->cell.values[i];
    }
}

/* All of the packet's directions. */
static inline kernel_beam bundle_beam(const kernel_packet *p)
{
    kernel_beam beam = {.spread = 0};
    float *const middle[2] = {&beam.x, &beam.y};
    const vf slopes[2] = {p->slope_x, p->slope_y};
    for (int a = 0; a < 2; a++) {
        const float low = vf_reduce_min(slopes[a]), high = vf_reduce_max(slopes[a]);
        *middle[a] = 0.5f * (low + high);
        beam.spread = fmaxf(beam.spread, fmaxf(high - *middle[a], *middle[a] - low) * 1.000001f);
    }
    return beam;
}

/* The packet's intervals in the cell, with its map and bounds; returns how many they are. */
static inline int bundle_intervals(bundle *b, kernel_interval list[KERNEL_MAX_CELL_INTERVALS], kernel_map *map,
                                   kernel_bounds *bounds)
{
    const kernel_beam beam = bundle_beam(&b->packet);
    kernel_map_setup(map, &b->cell);
    kernel_bounds_setup(bounds, map, b->cell.type, &beam);
    return kernel_curved_intervals(&b->packet, &b->cell, b->packet.active, false, list);
}

/* First hits on all rays, and how many hits there are. */
static inline vm bundle_hits(bundle *b, const kernel_map *map, const kernel_bounds *bounds, const kernel_interval *i,
                             vf *t, vf *hits)
{
    kernel_search_cell cell;
    kernel_search s;
    vm hit = vm_none();
    *t = *hits = vf_set(0);
    if (!kernel_search_in(&s, &cell, &b->packet, map, bounds, i, i->mask)) return hit;
    do {
        kernel_point place;
        if (!vm_any(s.found)) continue;
        kernel_polish(&s, &place);
        *t = vf_select(vm_andnot(s.found, hit), place.t, *t);
        *hits += vf_select(s.found, vf_set(1), vf_set(0));
        hit = vm_or(hit, s.found);
    } while (kernel_search_on(&s));
    return hit;
}

#endif
