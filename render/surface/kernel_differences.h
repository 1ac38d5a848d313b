/* Computes normals by central differences of the field. Terms:
 *     sample     value of the field at a point near a hit; there are six per hit, two along each world axis
 *     reach      distance from a hit to each of its six sample points, in scaled units; at 0 the hit has no samples
 *     probe      the state of taking one sample per ray of a packet
 *     pending    a hit is pending until the samples of all ranks' cells have been merged (render_differences.h) */
#ifndef RENDER_KERNEL_DIFFERENCES_H
#define RENDER_KERNEL_DIFFERENCES_H

#include <math.h>

#include "grid.h"
#include "kernel_cell.h"
#include "kernel_cell_cache.h"
#include "kernel_cell_values.h"
#include "kernel_crossings.h"
#include "kernel_map.h"
#include "kernel_packet.h"
#include "kernel_tets.h"
#include "kernel_tile.h"
#include "kernel_tile_trace.h"
#include "kernel_transformed_tets.h"
#include "kernel_types.h"
#include "render.h"
#include "simd.h"

/* Normals by central differences (thesis, section 4.3.4). The field is sampled at the distance `reach` before and
 * behind the hit along each world axis. The trees are traversed to the leaves whose boxes contain one of the packet's
 * points. In a leaf, the line through the point along the tile's depth axis is intersected with the cells like any ray,
 * by the same exact decisions, and the point belongs to the cell whose interval [t_in, t_out) contains its depth: to
 * one cell of a mesh or none.
 *
 * Samples are the field minus the isovalue, so that the hit's own value is 0. If cells overlap, several contain a
 * point: the sample is the least of their values, whichever is tested first and on whichever rank.
 *
 * If other ranks may have cells around the hits (job->waiting is set), their samples are needed too, and hits become
 * pending. The second half of this file samples the field around pending hits, in the tiles and packets of their rays;
 * kernel_packet_surface.h then lights these hits. */

/* One point per ray at which the field is sampled, for normals by central differences, and the field there. */
typedef struct kernel_probe {
    const kernel_surface *surface;
    int layer; /* number that stands for the layer in the cache of cells (kernel_cell_cache_find()) */
    double isovalue;
    vf z;     /* depth in tile space of each ray's sample point */
    vf at[3]; /* the sample points in tree space */
    /* margin by which the trees' boxes are extended, in scaled units; larger than the rounding errors of the sample
     * points */
    float pad;
    vm found;  /* rays whose sample point is in a cell visited so far */
    vf sample; /* least value of the field at the point over the cells that contain it */
} kernel_probe;

/* Sets c->f to the values at the vertices minus the isovalue, times a factor that is the same for all cells that the
 * surface crosses. */
SIMD_INLINE void kernel_probe_subtract_isovalue(const kernel_probe *probe, kernel_cell *c)
{
    for (int i = 0; i < c->count; i++)
        c->f[i] = kernel_clamp((c->values[i] - probe->isovalue) * probe->surface->value_scale, 1e18);
}

/* Computes the rays' intervals in the tet c, whose vertices must have been transformed into tile space. */
SIMD_INLINE void kernel_probe_intersect_tet(const kernel_packet *p, const kernel_cell *c, vm rays, kernel_interval *out)
{
    const kernel_lane_rays r = {.rays = kernel_packet_rays(p), .active = rays};
    kernel_transformed_tets tet;
    kernel_set_all_lanes_to_tet(&tet, c);
    kernel_tet_rays_interval_in_one(&tet, &r, 0, false, false, out);
}

/* Takes the sample in the cell c on those of the given rays whose sample point lies in it. A ray that already has a
 * sample keeps the lesser of the two values. */
SIMD_INLINE void kernel_probe_sample_cell(kernel_packet *p, kernel_probe *probe, const kernel_cell *c, vm rays)
{
    kernel_interval list[KERNEL_MAX_CELL_INTERVALS];
    const bool is_tet = kernel_is_linear(c->type);
    int count = 1;
    if (is_tet)
        kernel_probe_intersect_tet(p, c, rays, &list[0]);
    else
        count = kernel_curved_intervals(p, c, rays, list);
    for (int n = 0; n < count; n++) {
        const kernel_interval *i = &list[n];
        const vm own = vm_andnot(vm_and(i->mask, vf_lt(probe->z, i->t_out)), vf_lt(probe->z, i->t_in));
        if (!vm_any(own)) continue;
        const vf along = (probe->z - i->t_in) / (i->t_out - i->t_in);
        vf value = i->v_in + along * (i->v_out - i->v_in);
        if (!is_tet) {
            kernel_map map;
            kernel_map_setup(&map, c);
            value = kernel_evaluate_field_in_one_cell(p, &map, i, own, probe->z);
        }
        const vm is_number = vm_and(own, vf_eq(value, value));
        const vm taken = vm_and(is_number, vm_or(vm_not(probe->found), vf_lt(value, probe->sample)));
        probe->sample = vf_select(taken, value, probe->sample);
        probe->found = vm_or(probe->found, taken);
    }
}

/* Returns the rays whose sample point may be in the cell, because it lies in the cell's bounding box in tile space,
 * extended by a margin that is larger than all rounding errors. */
SIMD_INLINE vm kernel_probe_in_box(const kernel_packet *p, const kernel_probe *probe, const kernel_cell *c, vm rays)
{
    const float *const places[3] = {c->x, c->y, c->z};
    const vf points[3] = {p->origin_x, p->origin_y, probe->z};
    for (int a = 0; a < 3; a++) {
        float low = places[a][0], high = low;
        for (int i = 1; i < c->count; i++) {
            low = places[a][i] < low ? places[a][i] : low;
            high = places[a][i] > high ? places[a][i] : high;
        }
        const float pad = 1e-5f * ((fabsf(low) + fabsf(high)) + (high - low));
        rays = vm_and(rays, vm_and(vf_le(vf_set(low - pad), points[a]), vf_le(points[a], vf_set(high + pad))));
    }
    return rays;
}

/* Takes samples in the cells of a leaf of the tree of mesh part `part`. Cells with values that are not finite, and
 * polyhedra, are skipped. */
static void kernel_probe_sample_leaf(kernel_packet *p, kernel_probe *probe, int part, const uint32_t *cells, int count,
                                     vm rays)
{
    const render_field *field = &probe->surface->layer->field;
    for (int n = 0; n < count; n++) {
        kernel_cell *c = kernel_cell_cache_find(p, probe->layer, part, &field->fields[part], cells[n]);
        if (!c->is_finite || kernel_has_own_faces(c->type)) continue;
        const bool is_fresh = !c->is_transformed;
        if (is_fresh) kernel_cell_transform_in_tile(c, p->frame, p->tile, p->frame->job->parts[part].cells);
        if (is_fresh || probe->surface->layer->value_count > 1) kernel_probe_subtract_isovalue(probe, c);
        const vm near = kernel_probe_in_box(p, probe, c, rays);
        if (vm_any(near)) kernel_probe_sample_cell(p, probe, c, near);
    }
}

/* Returns the active rays whose sample points may be in the node's box. */
SIMD_INLINE vm kernel_probe_in_node(const kernel_packet *p, const kernel_probe *probe, const mmbvh *tree, int64_t node)
{
    float lower[4], upper[4];
    vm inside = p->active;
    mmbvh_node_box(tree, node, lower, upper);
    for (int a = 0; a < 3; a++) {
        const vm above = vf_le(vf_set(lower[a] - probe->pad), probe->at[a]);
        inside = vm_and(inside, vm_and(above, vf_le(probe->at[a], vf_set(upper[a] + probe->pad))));
    }
    return inside;
}

/* Takes samples in the cells of a tree. part: the mesh part whose cells the tree holds; -1 for the tree over all parts,
 * whose leaves list parts. */
static void kernel_probe_sample_tree(kernel_packet *p, kernel_probe *probe, const mmbvh *tree, int part)
{
    const render_part *parts = p->frame->job->parts;
    const mmbvh_ranges *ranges = probe->surface->layer->field.ranges;
    int64_t stack[MMBVH_MAX_DEPTH];
    int top = 0;
    if (tree->node_count) stack[top++] = 0;
    while (top) {
        const int64_t node = stack[--top], ref = mmbvh_node_ref(tree, node);
        const int count = mmbvh_node_count(tree, node);
        const vm inside = kernel_probe_in_node(p, probe, tree, node);
        if (!vm_any(inside)) continue;
        if (!count) {
            stack[top++] = ref;
            stack[top++] = ref + 1;
        } else if (part >= 0) {
            kernel_probe_sample_leaf(p, probe, part, tree->cells + ref, count, inside);
        } else {
            for (const uint32_t *own = tree->cells + ref; own < tree->cells + ref + count; own++)
                if (ranges[*own].low) kernel_probe_sample_tree(p, probe, parts[*own].tree, (int)*own);
        }
    }
}

/* Computes probe->at, the points at depth t on the rays in tree space, and probe->pad, the margin of boxes. The
 * rounding errors of the points are at most 16 * 6e-8 times the magnitude of positions near the scene and the eye,
 * which is the margin. */
static void kernel_probe_compute_points(const kernel_packet *p, vf t, kernel_probe *probe)
{
    double px[SIMD_WIDTH], py[SIMD_WIDTH];
    double size = 0;
    kernel_packet_compute_pixel_slopes(p, px, py);
    for (int i = 0; i < SIMD_WIDTH; i++) {
        double base[3], direction[3];
        kernel_compute_scaled_world_ray(p->frame, px[i], py[i], base, direction);
        for (int a = 0; a < 3; a++) {
            probe->at[a][i] = (float)(base[a] + (double)t[i] * direction[a]);
            size = fmax(size, fabs(base[a]));
        }
    }
    probe->pad = 16 * 6e-8f * ((float)size + 2);
}

/* Takes one sample per ray: at the ray's point at depth t, moved by `offset` scaled units along world axis number
 * `axis`. Returns the rays whose sample point is in a cell. */
SIMD_INLINE vm kernel_probe_sample_at(const kernel_packet *p, kernel_probe *probe, vm rays, vf t, int axis, vf offset)
{
    const render_job *job = p->frame->job;
    const render_camera *c = &job->camera;
    const float right = (float)c->right[axis], up = (float)c->up[axis], forward = (float)c->forward[axis];
    kernel_packet points = *p;
    points.active = rays;
    points.is_pencil = false;
    points.origin_x = (p->origin_x + p->slope_x * t) + offset * (right - p->tile->shear_x * forward);
    points.origin_y = (p->origin_y + p->slope_y * t) + offset * (up - p->tile->shear_y * forward);
    points.slope_x = points.slope_y = vf_set(0);
    kernel_probe_compute_points(p, t, probe);
    probe->at[axis] += offset;
    probe->z = t + offset * forward;
    probe->found = vm_none();
    probe->sample = vf_set(0);
    if (job->parent) kernel_probe_sample_tree(&points, probe, job->parent, -1);
    for (int part = 0; part < job->part_count && !job->parent; part++)
        if (probe->surface->layer->field.ranges[part].low)
            kernel_probe_sample_tree(&points, probe, job->parts[part].tree, part);
    return probe->found;
}

/* Takes six samples of the field around each hit at depth t, at the distance `reach` (scaled units) from it: before and
 * behind the hit along the first world axis, then along the second and the third. value: index of the isovalue in the
 * layer. values[i]: the rays' samples number i, minus the isovalue; found[i]: the rays whose sample number i lies in a
 * cell. s must be one of the frame's surfaces. */
static __attribute__((noinline)) void kernel_sample_field_around_hits(const kernel_packet *p, const kernel_surface *s,
                                                                      int value, vm hit, vf t, vf reach,
                                                                      vm found[RENDER_DIFFERENCE_SAMPLES],
                                                                      vf values[RENDER_DIFFERENCE_SAMPLES])
{
    const kernel_frame *f = p->frame;
    kernel_probe probe = {.surface = s,
                          .layer = f->surface_count + f->volume_count + (int)(s - f->surfaces),
                          .isovalue = s->layer->values[value]};
    for (int i = 0; i < RENDER_DIFFERENCE_SAMPLES; i++) {
        found[i] = kernel_probe_sample_at(p, &probe, hit, t, i / 2, i % 2 ? reach : -reach);
        /* adding 0 turns -0 into 0, because the sign of a zero sample must not depend on the order of cells */
        values[i] = probe.sample + 0.0f;
    }
}

/* Replaces the normals of the rays in `hit`, which are gradients in the hits' cells (camera axes), by differences of
 * the samples. If one of the two samples along an axis is in no cell, that difference is one-sided. If neither is in a
 * cell, the ray keeps its cell's gradient. */
SIMD_INLINE void kernel_normals_from_samples(const kernel_packet *p, const vm found[RENDER_DIFFERENCE_SAMPLES],
                                             const vf values[RENDER_DIFFERENCE_SAMPLES], vm hit, vf normal[3])
{
    const render_camera *c = &p->frame->job->camera;
    const double *axes[3] = {c->right, c->up, c->forward};
    vf g[3];
    for (int a = 0; a < 3; a++) {
        const vm before = found[2 * a], behind = found[2 * a + 1];
        const vf low = vf_select(before, values[2 * a], vf_set(0));
        const vf high = vf_select(behind, values[2 * a + 1], vf_set(0));
        g[a] = (high - low) * vf_select(vm_and(before, behind), vf_set(1), vf_set(2));
        hit = vm_and(hit, vm_or(before, behind));
    }
    for (int k = 0; k < 3; k++) {
        const vf sum = (g[0] * (float)axes[k][0] + g[1] * (float)axes[k][1]) + g[2] * (float)axes[k][2];
        normal[k] = vf_select(hit, sum, normal[k]);
    }
}

/* Computes the normals of the hits whose reach is above 0 from samples around them, which are taken in this rank's
 * cells. Other hits keep their normals. */
SIMD_INLINE void kernel_normals_by_differences(const kernel_packet *p, const kernel_surface *s, int value, vm hit, vf t,
                                               vf reach, vf normal[3])
{
    vm found[RENDER_DIFFERENCE_SAMPLES];
    vf values[RENDER_DIFFERENCE_SAMPLES];
    hit = vm_and(hit, vf_lt(vf_set(0), reach));
    kernel_sample_field_around_hits(p, s, value, hit, t, reach, found, values);
    kernel_normals_from_samples(p, found, values, hit, normal);
}

/* Returns the reach of hits in a cell: half the distance between the two samples of a difference, in scaled units. It
 * is 0 if the layer's normals do not come from differences. world: the cell's `count` vertices. */
SIMD_INLINE float kernel_difference_sample_distance(const kernel_frame *f, const render_surface_layer *layer,
                                                    const double (*world)[3], int count)
{
    if (layer->normal != RENDER_DIFFERENCES) return 0;
    return (float)(0.5 * layer->difference * kernel_cell_size(world, count) * f->job->space.scale);
}

/* ---- pending hits, which need samples of other ranks ---- */

/* A group of consecutive pending hits of a list that belong to one packet and one isovalue, each in its own lane. */
typedef struct kernel_pending_group {
    kernel_tile tile; /* the tile of the group's hits; set up anew only if the next group lies in another tile */
    kernel_packet packet;
    const kernel_surface *surface;
    int value, count;
    int lanes[SIMD_WIDTH]; /* lane of each hit of the group */
    vm rays;               /* lanes that have a hit */
    vf t, reach;           /* the members t and reach of the hits (render_pending_hit), by lane */
} kernel_pending_group;

/* Prepares *group for the first group of a list: marks its tile as not set up. */
SIMD_INLINE void kernel_pending_group_reset(kernel_pending_group *group)
{
    group->tile.x0 = group->tile.y0 = -1;
}

/* Sets the group's surface and the index of its isovalue to those of hits of the given kind. */
SIMD_INLINE void kernel_pending_find_surface(kernel_pending_group *group, const kernel_frame *f, uint32_t kind)
{
    for (int n = 0; n < f->surface_count; n++) {
        const kernel_surface *s = &f->surfaces[n];
        if (kind < s->first_kind || kind - s->first_kind >= (uint32_t)s->layer->value_count) continue;
        group->surface = s;
        group->value = (int)(kind - s->first_kind);
    }
}

/* Forms the group that begins with hits[0]: as many of the following hits as have the same packet and isovalue, each in
 * another lane. Sets the group's tile, packet, surface and isovalue, and its number of hits, group->count. count:
 * number of hits that remain in the list. */
static void kernel_pending_group_begin(kernel_pending_group *group, const kernel_frame *f, kernel_thread *thread,
                                       const render_pending_hit *hits, int64_t count)
{
    const uint32_t width = (uint32_t)f->job->camera.width, kind = hits->kind;
    const int x = (int)(hits->pixel % width), y = (int)(hits->pixel / width);
    const int x0 = x - x % KERNEL_PACKET_COLUMNS, y0 = y - y % KERNEL_PACKET_ROWS;
    float t[SIMD_WIDTH] = {0}, reach[SIMD_WIDTH] = {0};
    unsigned bits = 0;
    if (x - x % KERNEL_TILE != group->tile.x0 || y - y % KERNEL_TILE != group->tile.y0) {
        kernel_tile_setup(&group->tile, f, x - x % KERNEL_TILE, y - y % KERNEL_TILE);
        kernel_tile_compute_rays(&group->tile, f);
        thread->serial++;
    }
    kernel_pending_find_surface(group, f, kind);
    for (group->count = 0; group->count < count; group->count++) {
        const render_pending_hit *hit = &hits[group->count];
        const int column = (int)(hit->pixel % width) - x0, row = (int)(hit->pixel / width) - y0;
        if (hit->kind != kind || column < 0 || column >= KERNEL_PACKET_COLUMNS || row < 0 || row >= KERNEL_PACKET_ROWS)
            break;
        const int lane = row * KERNEL_PACKET_COLUMNS + column;
        if (bits >> lane & 1) break;
        bits |= 1u << lane;
        group->lanes[group->count] = lane;
        t[lane] = hit->t;
        reach[lane] = hit->reach;
    }
    group->rays = vm_from_bits(bits);
    group->t = vf_load(t);
    group->reach = vf_load(reach);
    kernel_packet_begin(&group->packet, f, &group->tile, thread, x0, y0);
}

/* Samples this rank's cells around all hits of the list; out[i] gets the samples of hits[i]. */
static void kernel_sample_pending(const kernel_frame *f, kernel_thread *thread, const render_pending_hit *hits,
                                  render_difference_samples *out, int64_t count)
{
    kernel_pending_group group;
    kernel_pending_group_reset(&group);
    for (int64_t i = 0; i < count; i += group.count) {
        vm found[RENDER_DIFFERENCE_SAMPLES];
        vf values[RENDER_DIFFERENCE_SAMPLES];
        kernel_pending_group_begin(&group, f, thread, hits + i, count - i);
        kernel_sample_field_around_hits(&group.packet, group.surface, group.value, group.rays, group.t, group.reach,
                                        found, values);
        for (int n = 0; n < group.count; n++) {
            render_difference_samples *own = &out[i + n];
            *own = (render_difference_samples){0, 0, {0}};
            for (int k = 0; k < RENDER_DIFFERENCE_SAMPLES; k++) {
                const bool is_found = vm_bits(found[k]) >> group.lanes[n] & 1;
                own->found |= (uint32_t)is_found << k;
                own->values[k] = is_found ? values[k][group.lanes[n]] : 0;
            }
        }
    }
}

/* Loads the samples of a group's hits into vectors by lane; samples[n] belongs to the group's n-th hit. */
SIMD_INLINE void kernel_load_difference_samples(const kernel_pending_group *group,
                                                const render_difference_samples *samples,
                                                vm found[RENDER_DIFFERENCE_SAMPLES],
                                                vf values[RENDER_DIFFERENCE_SAMPLES])
{
    for (int k = 0; k < RENDER_DIFFERENCE_SAMPLES; k++) {
        float own[SIMD_WIDTH] = {0};
        unsigned bits = 0;
        for (int n = 0; n < group->count; n++) {
            own[group->lanes[n]] = samples[n].values[k];
            bits |= (samples[n].found >> k & 1) << group->lanes[n];
        }
        found[k] = vm_from_bits(bits);
        values[k] = vf_load(own);
    }
}

#endif
