/* Normals by central differences (thesis, section 4.3.4): the field half an offset before and behind the hit along each
 * axis. Which cell holds a point is asked of the tree, as a ray of no length: with inverse directions of 1 the box test
 * of kernel_packet.h tells whether the point is in the box. In a leaf, the line through the point along the tile's
 * depth axis meets the cells as any ray does, by the same exact decisions, and the point belongs to the one whose
 * interval [t_in, t_out) holds its depth: to one cell of a mesh or none.
 *
 * The samples are the field less the isovalue, so that the hit's own value is 0. */
#ifndef RENDER_KERNEL_NORMALS_H
#define RENDER_KERNEL_NORMALS_H

#include <math.h>

#include "grid.h"
#include "kernel_cell.h"
#include "kernel_cell_cache.h"
#include "kernel_field.h"
#include "kernel_map.h"
#include "kernel_packet.h"
#include "kernel_poly.h"
#include "kernel_tet.h"
#include "kernel_traverse.h"
#include "kernel_types.h"
#include "render.h"
#include "simd.h"

/* The field at one point of each ray. */
typedef struct kernel_probe {
    const kernel_surface *surface;
    int layer; /* for the cache */
    double isovalue;
    vf z; /* of the points */
    vm found;
    vf sample;
} kernel_probe;

/* f: the values less the isovalue, of one scale in all cells. */
SIMD_INLINE void kernel_probe_values(const kernel_probe *probe, kernel_cell *c)
{
    for (int i = 0; i < c->count; i++) {
        const double v = (c->values[i] - probe->isovalue) * probe->surface->value_scale;
        c->f[i] = (float)(v < -1e18 ? -1e18 : v > 1e18 ? 1e18 : v);
    }
}

SIMD_INLINE void kernel_probe_cell(kernel_packet *p, kernel_probe *probe, const kernel_cell *c, vm rays)
{
    kernel_interval list[KERNEL_MAX_CELL_INTERVALS];
    const bool is_tet = c->type == GRID_TET;
    int count = 1;
    if (is_tet)
        kernel_tet_interval(p, c, rays, false, &list[0]);
    else
        count = kernel_poly_intervals(p, c, rays, false, list);
    for (int n = 0; n < count; n++) {
        const kernel_interval *i = &list[n];
        const vm own = vm_andnot(vm_and(i->mask, vf_lt(probe->z, i->t_out)), vf_lt(probe->z, i->t_in));
        if (!vm_any(own)) continue;
        const vf along = (probe->z - i->t_in) / (i->t_out - i->t_in);
        vf value = i->v_in + along * (i->v_out - i->v_in);
        if (!is_tet) {
            kernel_map map;
            kernel_map_setup(&map, c);
            value = kernel_value_at(p, &map, i, own, probe->z);
        }
        probe->sample = vf_select(own, value, probe->sample);
        probe->found = vm_or(probe->found, own);
    }
}

static void kernel_probe_leaf(kernel_packet *p, void *state, int part, const uint32_t *cells, int count, vm rays)
{
    kernel_probe *probe = state;
    const render_field *field = &probe->surface->layer->field;
    for (int n = 0; n < count; n++) {
        const vm open = vm_andnot(rays, probe->found);
        if (!vm_any(open)) return;
        kernel_cell *c = kernel_cell_find(p, probe->layer, part, &field->fields[part], cells[n]);
        if (!c->is_finite || c->type == GRID_POLYHEDRON) continue;
        const bool is_fresh = !c->is_placed;
        if (is_fresh) kernel_cell_place(c, p, p->frame->job->parts[part].cells);
        if (is_fresh || probe->surface->layer->value_count > 1) kernel_probe_values(probe, c);
        kernel_probe_cell(p, probe, c, open);
    }
}

/* Sample at the rays' points t moved by offset along a world axis (scaled units). Returns the rays whose point is in a
 * cell. */
SIMD_INLINE vm kernel_probe_at(const kernel_packet *p, kernel_probe *probe, vm rays, vf t, int axis, vf offset)
{
    const render_camera *c = &p->frame->job->camera;
    const float right = (float)c->right[axis], up = (float)c->up[axis], forward = (float)c->forward[axis];
    const vf zero = vf_set(0);
    kernel_packet points = *p;
    points.active = rays;
    points.is_pencil = false;
    points.origin_x = (p->origin_x + p->slope_x * t) + offset * (right - p->tile->shear_x * forward);
    points.origin_y = (p->origin_y + p->slope_y * t) + offset * (up - p->tile->shear_y * forward);
    points.slope_x = points.slope_y = zero;
    for (int a = 0; a < 3; a++) {
        points.inverse[a] = vf_set(1);
        points.shift[a] = (t + p->shift[a]) / p->inverse[a];
    }
    points.shift[axis] += offset;
    probe->z = t + offset * forward;
    probe->found = vm_none();
    probe->sample = zero;
    const kernel_descent descent = {NULL, zero, &zero, kernel_probe_leaf, probe};
    kernel_trace_parts(&points, &probe->surface->layer->field, &descent);
    return probe->found;
}

/* Replace the cells' gradients in normal (camera axes) on the rays of hit by differences over reach before and behind:
 * one-sided where one sample is in no cell; not where both of an axis are, nor where there is no reach. s: one of
 * the frame's. */
SIMD_INLINE void kernel_differences(const kernel_packet *p, const kernel_surface *s, int value, vm hit, vf t, vf reach,
                                    vf normal[3])
{
    const kernel_frame *f = p->frame;
    kernel_probe probe = {.surface = s,
                          .layer = f->surface_count + f->volume_count + (int)(s - f->surfaces),
                          .isovalue = s->layer->values[value]};
    vf g[3];
    hit = vm_and(hit, vf_lt(vf_set(0), reach));
    vm whole = hit;
    for (int a = 0; a < 3; a++) {
        const vm before = kernel_probe_at(p, &probe, hit, t, a, -reach);
        const vf low = vf_select(before, probe.sample, vf_set(0));
        const vm behind = kernel_probe_at(p, &probe, hit, t, a, reach);
        const vf high = vf_select(behind, probe.sample, vf_set(0));
        g[a] = (high - low) * vf_select(vm_and(before, behind), vf_set(1), vf_set(2));
        whole = vm_and(whole, vm_or(before, behind));
    }
    const double *axes[3] = {f->job->camera.right, f->job->camera.up, f->job->camera.forward};
    for (int k = 0; k < 3; k++) {
        const vf sum = (g[0] * (float)axes[k][0] + g[1] * (float)axes[k][1]) + g[2] * (float)axes[k][2];
        normal[k] = vf_select(whole, sum, normal[k]);
    }
}

/* Half the offset of differences in scaled units: by the cell's size, the cube root of its box's volume, or of its
 * longest side where that is flat. */
SIMD_INLINE float kernel_difference_reach(const kernel_packet *p, const render_surface_layer *layer,
                                          const kernel_cell *c)
{
    double volume = 1, longest = 0;
    for (int a = 0; a < 3; a++) {
        double low = c->world[0][a], high = low;
        for (int i = 1; i < c->count; i++) {
            low = c->world[i][a] < low ? c->world[i][a] : low;
            high = c->world[i][a] > high ? c->world[i][a] : high;
        }
        volume *= high - low;
        longest = high - low > longest ? high - low : longest;
    }
    const double size = volume > 0 ? cbrt(volume) : longest;
    return (float)(0.5 * layer->difference * size * p->frame->job->space.scale);
}

#endif
