/* Traverses the trees of occluders with rays from hits, one ray at a time. kernel_occluders.h defines the terms. */
#ifndef RENDER_KERNEL_OCCLUSION_RAYS_H
#define RENDER_KERNEL_OCCLUSION_RAYS_H

#include "kernel_clip.h"
#include "kernel_occluders.h"
#include "kernel_occlusion_hexes.h"
#include "kernel_types.h"
#include "mmbvh.h"
#include "render.h"
#include "simd.h"

/* Size of the stack of nodes and leaves that a ray has not visited yet; a leaf is stored as the complement of its
 * index, ~index. On each level of the tree all children of a node but one may be left on the stack, and the tree is at
 * most one level deeper than the binary tree from which it was built. */
enum { KERNEL_PATH_STACK = (MMBVH_MAX_DEPTH + 1) * (SIMD_WIDTH - 1) + 1 };

/* Returns the index of the next leaf that the ray may meet; -1 if there is none. *top: number of nodes on the stack,
 * which at first has only the root. */
SIMD_INLINE int32_t kernel_find_next_leaf(const kernel_occluder_tree *tree, int32_t *stack, int *top,
                                          const kernel_prepared_ray *p)
{
    while (*top) {
        const int64_t at = stack[--*top];
        if (at < 0) return (int32_t)~at;
        const int32_t *children = tree->children + at * SIMD_WIDTH;
        vf low, high;
        unsigned met =
            vm_bits(kernel_prepared_ray_intersect_boxes(p, tree->boxes + at * (6 * SIMD_WIDTH), &low, &high));
        for (; met; met &= met - 1) stack[(*top)++] = children[__builtin_ctz(met)];
    }
    return -1;
}

/* Returns whether the clips keep at least one of the ray's crossings with triangles. met: mask of the lanes with
 * crossed triangles; surfaces: per lane, index of the triangle's surface; t: distances of the crossings. */
static __attribute__((noinline, cold)) bool kernel_has_unclipped_triangle_hit(const kernel_frame *f,
                                                                              const kernel_secondary_ray *ray,
                                                                              const int32_t *surfaces, unsigned met,
                                                                              vf t)
{
    kernel_clip_ray line;
    for (int a = 0; a < 3; a++) {
        line.base[a] = (double)ray->origin[a];
        line.direction[a] = (double)ray->direction[a];
    }
    for (; met; met &= met - 1) {
        const int i = __builtin_ctz(met);
        const uint32_t clips = f->surfaces[surfaces[i]].layer->clips;
        if (kernel_clips_keep_ray_point(f->job, clips, &line, (double)t[i])) return true;
    }
    return false;
}

/* Returns whether a triangle of the tree blocks the ray. */
static bool kernel_meets_triangles(const kernel_frame *f, const kernel_occluder_tree *tree,
                                   const kernel_secondary_ray *ray)
{
    int32_t stack[KERNEL_PATH_STACK];
    int top = 1;
    kernel_prepared_ray p;
    stack[0] = 0;
    kernel_prepared_ray_begin(ray, tree->size, &p);
    for (int64_t leaf; (leaf = kernel_find_next_leaf(tree, stack, &top, &p)) >= 0;) {
        vf t;
        const unsigned met = vm_bits(
            kernel_prepared_ray_intersect_triangles(&p, tree->leaves + leaf * (KERNEL_TRIANGLE_ROWS * SIMD_WIDTH), &t));
        if (!met) continue;
        if (!f->job->clip_count || kernel_has_unclipped_triangle_hit(f, ray, tree->sources + leaf * SIMD_WIDTH, met, t))
            return true;
    }
    return false;
}

/* ---- rays that meet slabs, which contain the surfaces in cells ------------------------------------------------ */

/* Finds the cells whose slabs a ray meets, and adds the pair of the ray and each of these cells to a list: to the
 * ray-hex pairs if the cell is a hex with a record, and otherwise to the undecided pairs. ray: index of the ray.
 * Returns false if memory ran out. */
static bool kernel_list_met_slabs(const kernel_occluders *o, kernel_secondary_rays *s, kernel_curved_pairs *pairs,
                                  int ray)
{
    const kernel_occluder_tree *tree = &o->slabs;
    int32_t stack[KERNEL_PATH_STACK];
    int top = 1;
    kernel_prepared_ray p;
    bool is_well = true;
    stack[0] = 0;
    kernel_prepared_ray_begin(&s->rays[ray], tree->size, &p);
    for (int64_t leaf; s->rays[ray].is_open && (leaf = kernel_find_next_leaf(tree, stack, &top, &p)) >= 0;) {
        const float *rows = tree->leaves + leaf * (KERNEL_SLAB_ROWS * SIMD_WIDTH);
        vf level, rise, thickness; /* L along the ray is level + rise * t */
        for (unsigned met = vm_bits(kernel_prepared_ray_intersect_slabs(&p, rows, &level, &rise, &thickness)); met;
             met &= met - 1) {
            const int i = __builtin_ctz(met), n = pairs->count;
            const int32_t occluder = tree->sources[leaf * SIMD_WIDTH + i];
            if (o->cells[occluder].record < 0) {
                is_well = kernel_undecided_add(s, ray, occluder) && is_well;
                continue;
            }
            pairs->ray[n] = ray;
            pairs->occluder[n] = occluder;
            pairs->level[n] = level[i];
            pairs->rise[n] = rise[i];
            pairs->thickness[n] = thickness[i];
            pairs->reach[n] = rows[KERNEL_SLAB_REACH * SIMD_WIDTH + i];
            if (++pairs->count == SIMD_WIDTH) is_well = kernel_pairs_process(o, s, pairs) && is_well;
        }
    }
    return is_well;
}

/* Clears is_open of the rays that opaque surfaces certainly block. For the rays that stay open, lists the undecided
 * pairs: the cells in which they must be traced. */
static void kernel_occlude(const kernel_frame *f, kernel_thread *thread, const kernel_occluders *o,
                           kernel_secondary_rays *s)
{
    kernel_curved_pairs pairs;
    bool is_well = true;
    pairs.count = 0;
    for (int i = 0; i < s->count; i++)
        if (o->triangles.node_count && kernel_meets_triangles(f, &o->triangles, &s->rays[i]))
            s->rays[i].is_open = false;
    for (int i = 0; i < s->count && o->slabs.node_count; i++)
        if (s->rays[i].is_open) is_well = kernel_list_met_slabs(o, s, &pairs, i) && is_well;
    is_well = kernel_pairs_process(o, s, &pairs) && is_well;
    if (!is_well) thread->out_of_memory = true;
}

#endif
