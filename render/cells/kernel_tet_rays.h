/* Intersects rays with tets, one ray-tet pair per lane; the tets are in lanes too (kernel_placed.h). All operations are
 * those for a packet and a single cell (kernel_crossings.h), in the same order, so that a crossing has the same bits
 * however it is computed. */
#ifndef RENDER_KERNEL_TET_RAYS_H
#define RENDER_KERNEL_TET_RAYS_H

#include <math.h>

#include "kernel_cell.h"
#include "kernel_crossings.h"
#include "kernel_placed.h"
#include "kernel_shapes.h"
#include "kernel_tile_trace.h"
#include "kernel_types.h"
#include "simd.h"

SIMD_INLINE void kernel_tet_rays_project(const kernel_placed *tets, const kernel_lane_rays *r, vf x[4], vf y[4])
{
    for (int i = 0; i < 4; i++) {
        const vf z = vf_permute(tets->at[2][i], r->lane);
        x[i] = (vf_permute(tets->at[0][i], r->lane) - r->rays.origin_x) - r->rays.slope_x * z;
        y[i] = (vf_permute(tets->at[1][i], r->lane) - r->rays.origin_y) - r->rays.slope_y * z;
    }
}

/* Computes edge functions whose signs are uncertain again from projected vertices, with exact signs. */
static __attribute__((noinline)) void kernel_tet_rays_exactly(const kernel_placed *tets, const kernel_lane_rays *r,
                                                              vf e[KERNEL_TET_EDGES])
{
    vf x[4], y[4];
    kernel_tet_rays_project(tets, r, x, y);
    for (int n = 0; n < KERNEL_TET_EDGES; n++) {
        const int i = kernel_tet_edge[n][0], j = kernel_tet_edge[n][1];
        const vm doubt = vm_and(r->active, vm_not(vf_lt(vf_permute(tets->bound[n], r->lane), vf_abs(e[n]))));
        if (vm_any(doubt)) e[n] = vf_select(doubt, kernel_edge_between(x[i], y[i], x[j], y[j]), e[n]);
    }
}

/* Depths and field values of the four vertices of each ray's tet. */
typedef struct kernel_tet_vertices {
    vf z[4], f[4];
} kernel_tet_vertices;

SIMD_INLINE kernel_sums kernel_tet_rays_sums(const kernel_tet_vertices *v, const signed char face[3], vf ij, vf jk,
                                             vf ik)
{
    const vf *z = v->z, *f = v->f;
    const int i = face[0], j = face[1], k = face[2];
    return (kernel_sums){.depth = vf_muladd(ij, z[k], vf_muladd(-ik, z[j], jk * z[i])),
                         .value = vf_muladd(ij, f[k], vf_muladd(-ik, f[j], jk * f[i])),
                         .weight = kernel_weight(ij, jk, ik)};
}

/* Computes the sums of triangles whose weights are not accurate enough again, from projected vertices. */
static __attribute__((noinline)) void kernel_tet_rays_mend(const kernel_placed *tets, const kernel_lane_rays *r,
                                                           const kernel_tet_vertices *v, const vf e[KERNEL_TET_EDGES],
                                                           const vm weak[4], kernel_sums sums[4])
{
    vf x[4], y[4];
    kernel_tet_rays_project(tets, r, x, y);
    for (int n = 0; n < 4; n++) {
        if (!vm_any(weak[n])) continue;
        const signed char *face = kernel_tet_face[n];
        const int i = face[0], j = face[1], k = face[2];
        const vf ij = vf_select(weak[n], kernel_edge_between(x[i], y[i], x[j], y[j]), e[face[3]]);
        const vf jk = vf_select(weak[n], kernel_edge_between(x[j], y[j], x[k], y[k]), e[face[4]]);
        const vf ik = vf_select(weak[n], kernel_edge_between(x[i], y[i], x[k], y[k]), e[face[5]]);
        sums[n] = kernel_tet_rays_sums(v, face, ij, jk, ik);
    }
}

/* Computes the edge functions of each ray's tet on the ray. */
SIMD_INLINE void kernel_tet_rays_edges(const kernel_placed *tets, const kernel_lane_rays *r, vf e[KERNEL_TET_EDGES])
{
    vf least = vf_set(INFINITY);
    for (int n = 0; n < KERNEL_TET_EDGES; n++) {
        e[n] = vf_muladd(vf_permute(tets->cv[n], r->lane), r->v,
                         vf_muladd(vf_permute(tets->cu[n], r->lane), r->u, vf_permute(tets->c[n], r->lane)));
        least = vf_min(vf_abs(e[n]), least);
    }
    const vm sure = vf_lt(vf_permute(tets->doubt, r->lane), least);
    if (__builtin_expect(vm_any(vm_andnot(r->active, sure)), 0)) kernel_tet_rays_exactly(tets, r, e);
}

/* Computes the depths at which each ray enters and leaves its tet, and the field there. */
SIMD_INLINE void kernel_tet_rays_interval(const kernel_placed *tets, const kernel_lane_rays *r, kernel_interval *out)
{
    vf e[KERNEL_TET_EDGES];
    vm hit[4], weak[4], any_weak = vm_none();
    kernel_tet_vertices v;
    kernel_sums sums[4];
    kernel_tet_rays_edges(tets, r, e);
    out->mask = vm_none();
    for (int n = 0; n < 4; n++) {
        const signed char *face = kernel_tet_face[n];
        hit[n] = kernel_inside(r->active, e[face[3]], e[face[4]], e[face[5]]);
        out->mask = vm_or(out->mask, hit[n]);
    }
    if (!vm_any(out->mask)) return;
    for (int i = 0; i < 4; i++) {
        v.z[i] = vf_permute(tets->at[2][i], r->lane);
        v.f[i] = vf_permute(tets->f[i], r->lane);
    }
    for (int n = 0; n < 4; n++) {
        const signed char *face = kernel_tet_face[n];
        sums[n] = kernel_tet_rays_sums(&v, face, e[face[3]], e[face[4]], e[face[5]]);
        weak[n] = vm_and(hit[n], vf_lt(vf_abs(sums[n].weight), vf_permute(tets->least[n], r->lane)));
        any_weak = vm_or(any_weak, weak[n]);
    }
    if (__builtin_expect(vm_any(any_weak), 0)) kernel_tet_rays_mend(tets, r, &v, e, weak, sums);
    const kernel_ends ends = kernel_tet_choose(hit, sums);
    kernel_ends_order(&ends, false, out);
}

#endif
