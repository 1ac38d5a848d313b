/* Tests whether the surfaces in hexes block rays from hits, one ray-hex pair per lane (kernel_occluders.h defines the
 * terms). If the ray crosses exactly two faces of the hex, the field there decides in most cases: a change of sign
 * between the faces means that the ray crosses the surface. The remaining pairs are undecided, and their rays are
 * traced in the cell like primary rays. Crossings of faces are computed by the operations of kernel_curved_rays.h, from
 * positions that depend on the ray and the vertex alone. So if two hexes share a face, on whichever ranks, the ray
 * leaves one exactly where it enters the other. */
#ifndef RENDER_KERNEL_OCCLUSION_HEXES_H
#define RENDER_KERNEL_OCCLUSION_HEXES_H

#include <string.h>

#include "kernel_bounds.h"
#include "kernel_curved_rays.h"
#include "kernel_map.h"
#include "kernel_occluders.h"
#include "kernel_transformed_curved.h"
#include "kernel_shapes.h"
#include "kernel_wide.h"
#include "simd.h"

/* Ray-hex pairs, one per lane: index of the ray, and index of the hex among the occluders. The hex's slab has the
 * linear function L = level + rise * t at the distance t along the ray. thickness, reach: copies of the slab's rows
 * KERNEL_SLAB_THICKNESS and KERNEL_SLAB_REACH. */
typedef struct kernel_curved_pairs {
    int count;
    int32_t ray[SIMD_WIDTH], occluder[SIMD_WIDTH];
    float level[SIMD_WIDTH], rise[SIMD_WIDTH], thickness[SIMD_WIDTH], reach[SIMD_WIDTH];
    /* The following members, except `record`, describe the pairs' rays, as in kernel_prepared_ray. Components of
     * origins and shears are in the order of the axes kx, ky and kz, which are chosen for each ray. */
    int32_t record[SIMD_WIDTH]; /* index in kernel_occluders.hexes of the first float of the hex's record */
    float axis[SIMD_WIDTH];     /* number of the axis kz, as a float; kx and ky follow it cyclically */
    float origin[3][SIMD_WIDTH], shear[2][SIMD_WIDTH], stretch[SIMD_WIDTH], far[SIMD_WIDTH];
    kernel_transformed_curved transformed;
} kernel_curved_pairs;

/* Adds a pair to the list of undecided pairs; returns false if memory ran out. */
SIMD_INLINE bool kernel_undecided_add(kernel_secondary_rays *s, int32_t ray, int32_t occluder)
{
    if (s->undecided_count == s->capacity && !render_grow_undecided(s)) return false;
    s->undecided[s->undecided_count++] = (kernel_undecided_pair){ray, occluder};
    return true;
}

/* Sets the members of a pair that describe its ray, and the member `record`. lane: the pair's lane; record: index of
 * the hex's record among those in kernel_occluders.hexes. */
SIMD_INLINE void kernel_pairs_set_ray(const kernel_secondary_ray *ray, int32_t record, int lane,
                                      kernel_curved_pairs *out)
{
    kernel_prepared_ray p;
    kernel_prepared_ray_set_axes(ray, &p);
    const int axes[3] = {p.kx, p.ky, p.kz};
    out->record[lane] = record * KERNEL_CURVED_RECORD_WORDS;
    out->axis[lane] = (float)p.kz;
    for (int a = 0; a < 3; a++) out->origin[a][lane] = ray->origin[axes[a]];
    out->shear[0][lane] = p.shear_x;
    out->shear[1][lane] = p.shear_y;
    out->stretch[lane] = p.stretch;
    out->far[lane] = ray->far;
}

SIMD_INLINE vi kernel_load_ints(const int32_t *from)
{
    vi out;
    memcpy(&out, from, sizeof out);
    return out;
}

/* Reads the record of each pair's hex, and transforms the vertices to the space of the pair's ray: x and y are measured
 * across the ray, which is at their origin; z is the distance along the ray. */
SIMD_INLINE void kernel_pairs_transform(kernel_curved_pairs *pairs, const float *hexes)
{
    kernel_transformed_curved *h = &pairs->transformed;
    const vm along_x = vf_eq(vf_load(pairs->axis), vf_set(0)), along_y = vf_eq(vf_load(pairs->axis), vf_set(1));
    vf words[2][4];
    for (int i = 0; i < 8; i++) {
        vf row[4], at[3];
        vf_gather_rows(hexes + 4 * i, pairs->record, row);
        for (int a = 0; a < 3; a++) {
            const vf turned = vf_select(along_x, row[(a + 1) % 3], vf_select(along_y, row[(a + 2) % 3], row[a]));
            at[a] = turned - vf_load(pairs->origin[a]);
        }
        vf_store(h->at[0][i], at[0] - at[2] * vf_load(pairs->shear[0]));
        vf_store(h->at[1][i], at[1] - at[2] * vf_load(pairs->shear[1]));
        vf_store(h->at[2][i], at[2] * vf_load(pairs->stretch));
        vf_store(h->at[3][i], row[3]);
    }
    for (int i = 0; i < 2; i++) vf_gather_rows(hexes + KERNEL_CURVED_RECORD_QUADS + 4 * i, pairs->record, words[i]);
    for (int face = 0; face < KERNEL_CURVED_FACES; face++)
        vf_store((float *)(void *)(h->corners + face * SIMD_WIDTH), words[face / 4][face % 4]);
}

/* Returns L, the linear function of each pair's slab, at the distance t along the ray. */
SIMD_INLINE vf kernel_pairs_evaluate_slab_function(const kernel_curved_pairs *pairs, vf t)
{
    return vf_load(pairs->level) + vf_load(pairs->rise) * t;
}

/* Returns the pairs whose ray does not meet the surface between the distances `from` and `to`: at both, |L| exceeds the
 * slab's thickness, with the same sign. */
SIMD_INLINE vm kernel_pairs_miss_slab(const kernel_curved_pairs *pairs, vf from, vf to)
{
    const vf first = kernel_pairs_evaluate_slab_function(pairs, from),
             last = kernel_pairs_evaluate_slab_function(pairs, to);
    const vf thick = vf_load(pairs->thickness);
    return vm_or(vf_lt(thick, vf_min(first, last)), vf_lt(vf_max(first, last), -thick));
}

/* Returns the pairs for which the field is monotone along the ray in the hex, and at both ends farther from 0 than the
 * bound of the jump at a face (the difference between the face's value and the field next to it). For these pairs, the
 * signs at the ends decide whether the ray crosses the surface. */
static __attribute__((noinline)) vm kernel_pairs_are_monotone(const kernel_curved_pairs *pairs,
                                                              const kernel_point ends[2])
{
    static const kernel_beam beam = {.spread = 0};
    kernel_bounds bounds;
    kernel_compute_bounds_of_cells(GRID_HEX, (const float(*)[8][SIMD_WIDTH])pairs->transformed.at, &beam, &bounds);
    const vf jump = vf_load(bounds.jump);
    return vm_and(vf_le(vf_set(0), jump), vf_lt(jump, vf_min(vf_abs(ends[0].value), vf_abs(ends[1].value))));
}

/* Returns the pairs in which the hex's surface certainly blocks the ray. *undecided becomes the pairs whose ray must be
 * traced in the cell. In all other pairs the surface does not block the ray. */
SIMD_INLINE vm kernel_pairs_classify(const kernel_curved_pairs *pairs, vm active, vm *undecided)
{
    const vf zero = vf_set(0), reach = vf_load(pairs->reach), far = vf_load(pairs->far);
    kernel_lane_rays p = {
        .lane = vi_lanes(), .active = active, .u = zero, .v = zero, .far = far, .rays = {zero, zero, zero, zero}};
    vm two;
    vi face[2];
    kernel_point ends[2];
    kernel_curved_find_faces_of_active_rays(&pairs->transformed, &p, GRID_HEX, &two, undecided, face);
    if (!vm_any(two)) return vm_none();
    p.active = two;
    kernel_curved_compute_crossings(&pairs->transformed, &p, GRID_HEX, face[0] | face[1] << 3, ends);
    const vf from = vf_max(ends[0].t, reach), to = vf_min(ends[1].t, far);
    const vm near = vm_and(two, vf_le(from, to));
    const vm change = vm_xor(vf_lt(ends[0].value, zero), vf_lt(ends[1].value, zero));
    /* If the sign changes, the ray's interval in the hex has a root. The root blocks the ray only if it lies between
     * `from` and `to`. So the parts of the interval in front of `from` and behind `to` must be known to have no root.
     */
    const vm before = vm_or(vf_eq(from, ends[0].t), kernel_pairs_miss_slab(pairs, ends[0].t, from));
    const vm behind = vm_or(vm_and(vf_eq(to, ends[1].t), vf_lt(to, far)), kernel_pairs_miss_slab(pairs, to, ends[1].t));
    const vm blocked = vm_and(near, vm_and(change, vm_and(before, behind)));
    const vm whole = vm_and(vf_eq(from, ends[0].t), vf_eq(to, ends[1].t));
    const vm clear = vm_andnot(kernel_pairs_miss_slab(pairs, from, to), vm_and(change, whole));
    vm left = vm_andnot(vm_andnot(near, blocked), clear);
    if (vm_any(left)) left = vm_andnot(left, vm_andnot(kernel_pairs_are_monotone(pairs, ends), change));
    *undecided = vm_or(*undecided, left);
    return blocked;
}

/* Decides, for the collected pairs of a ray and a hex, whether the hex blocks the ray: clears is_open of blocked rays,
 * and adds undecided pairs to the list s->undecided. Empties *pairs. Returns false if memory ran out. */
static __attribute__((noinline)) bool kernel_pairs_process(const kernel_occluders *o, kernel_secondary_rays *s,
                                                           kernel_curved_pairs *pairs)
{
    vm undecided;
    bool is_well = true;
    if (!pairs->count) return true;
    for (int i = 0; i < SIMD_WIDTH; i++) {
        const int from = i < pairs->count ? i : 0;
        kernel_pairs_set_ray(&s->rays[pairs->ray[from]], o->cells[pairs->occluder[from]].record, i, pairs);
    }
    kernel_pairs_transform(pairs, o->hexes);
    const vm active = vm_from_bits((1u << pairs->count) - 1);
    const vm blocked = kernel_pairs_classify(pairs, active, &undecided);
    for (unsigned bits = vm_bits(blocked); bits; bits &= bits - 1)
        s->rays[pairs->ray[__builtin_ctz(bits)]].is_open = false;
    for (unsigned bits = vm_bits(vm_and(undecided, active)); bits; bits &= bits - 1) {
        const int i = __builtin_ctz(bits);
        if (s->rays[pairs->ray[i]].is_open)
            is_well = kernel_undecided_add(s, pairs->ray[i], pairs->occluder[i]) && is_well;
    }
    pairs->count = 0;
    return is_well;
}

#endif
