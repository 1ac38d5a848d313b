/* Tets: four triangles, of which a ray crosses two or none (kernel_cell.h). */
#ifndef RENDER_KERNEL_TET_H
#define RENDER_KERNEL_TET_H

#include <string.h>

#include "kernel_cell.h"
#include "kernel_line.h"
#include "kernel_packet.h"
#include "kernel_types.h"
#include "simd.h"

/* Edges 01, 02, 03, 12, 13, 23, and the faces without vertex 3, 2, 1, 0: their edges ij, jk and ik. */
enum { KERNEL_TET_EDGES = 6 };
static const signed char kernel_tet_edge[KERNEL_TET_EDGES][2] = {{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 3}, {2, 3}};

/* Over the edges of each face, in kernel_triangle_least()'s order. */
SIMD_INLINE kernel_four kernel_tet_face_sums(const kernel_four e[2])
{
    return (__builtin_shufflevector(e[0], e[1], 0, 0, 1, 3) + __builtin_shufflevector(e[0], e[1], 3, 4, 5, 5)) +
           __builtin_shufflevector(e[0], e[1], 1, 2, 2, 4);
}

SIMD_INLINE void kernel_tet_lines(kernel_cell *c, const kernel_frame *f, const kernel_tile *tile)
{
    kernel_four at[3], size, errors[2], extents[2];
    kernel_line lines[8];
    float doubt = 0;
    for (int i = 0; i < 4; i++) size[i] = kernel_spot_size(f, tile, kernel_cell_spot(c, i));
    at[0] = kernel_four_load(c->x);
    at[1] = kernel_four_load(c->y);
    at[2] = kernel_four_load(c->z);
    /* Edges 0 to 3, 4 and 5. */
    kernel_four_lines(f, tile->radius, KERNEL_PICK(at, 0, 0, 0, 1), KERNEL_PICK(at, 1, 2, 3, 2),
                      KERNEL_PICKED(size, 0, 0, 0, 1), KERNEL_PICKED(size, 1, 2, 3, 2), lines, &errors[0], &extents[0]);
    kernel_four_lines(f, tile->radius, KERNEL_PICK(at, 1, 2, 2, 2), KERNEL_PICK(at, 3, 3, 3, 3),
                      KERNEL_PICKED(size, 1, 2, 2, 2), KERNEL_PICKED(size, 3, 3, 3, 3), lines + 4, &errors[1],
                      &extents[1]);
    for (int n = 0; n < KERNEL_TET_EDGES; n++) {
        c->lines[n] = lines[n];
        doubt = doubt < lines[n].bound ? lines[n].bound : doubt;
    }
    c->doubt = doubt;
    const kernel_four error = kernel_tet_face_sums(errors), extent = kernel_tet_face_sums(extents);
    const kernel_four least = error * extent * (0.5f / KERNEL_WEIGHT_ERROR);
    memcpy(c->least, &least, sizeof least);
}

SIMD_INLINE void kernel_tet_project(const kernel_packet *p, const kernel_cell *c, vf x[4], vf y[4])
{
    for (int i = 0; i < 4; i++) {
        x[i] = kernel_project_x(p, kernel_cell_spot(c, i));
        y[i] = kernel_project_y(p, kernel_cell_spot(c, i));
    }
}

/* What kernel_edge() gives of each, from vertices that are projected once. */
static __attribute__((noinline)) void kernel_tet_edges_exactly(const kernel_packet *p, const kernel_cell *c,
                                                               vf e[KERNEL_TET_EDGES])
{
    vf x[4], y[4];
    kernel_tet_project(p, c, x, y);
    for (int n = 0; n < KERNEL_TET_EDGES; n++) {
        const int a = kernel_tet_edge[n][0], b = kernel_tet_edge[n][1];
        const vf line = kernel_line_at(p, &c->lines[n]);
        const vm doubt = vm_not(vf_lt(vf_set(c->lines[n].bound), vf_abs(line)));
        e[n] = vm_any(doubt) ? vf_select(doubt, kernel_edge_between(x[a], y[a], x[b], y[b]), line) : line;
    }
}

SIMD_INLINE void kernel_tet_edges_projected(const kernel_packet *p, const kernel_cell *c, vf e[KERNEL_TET_EDGES])
{
    vf x[4], y[4];
    kernel_tet_project(p, c, x, y);
    for (int n = 0; n < KERNEL_TET_EDGES; n++) {
        const int a = kernel_tet_edge[n][0], b = kernel_tet_edge[n][1];
        e[n] = kernel_edge_between(x[a], y[a], x[b], y[b]);
    }
}

/* All edge functions at once; one by one only where one of them is in doubt. */
SIMD_INLINE void kernel_tet_edges(const kernel_packet *p, const kernel_cell *c, vf e[KERNEL_TET_EDGES])
{
    if (!p->is_pencil) {
        kernel_tet_edges_projected(p, c, e);
        return;
    }
    for (int n = 0; n < KERNEL_TET_EDGES; n++) e[n] = kernel_line_at(p, &c->lines[n]);
    const vf low = vf_min(vf_min(vf_abs(e[0]), vf_abs(e[1])), vf_abs(e[2]));
    const vf least = vf_min(vf_min(low, vf_min(vf_abs(e[3]), vf_abs(e[4]))), vf_abs(e[5]));
    if (__builtin_expect(vm_any(vm_not(vf_lt(vf_set(c->doubt), least))), 0)) kernel_tet_edges_exactly(p, c, e);
}

/* The faces' vertices and edges. */
static const signed char kernel_tet_face[4][6] = {
    {0, 1, 2, 0, 3, 1}, {0, 1, 3, 0, 4, 2}, {0, 2, 3, 1, 5, 2}, {1, 2, 3, 3, 5, 4}};

/* A crossed triangle's sums (kernel_line.h). */
typedef struct kernel_sums {
    vf depth, value, colour, weight;
} kernel_sums;

/* face: a row of kernel_tet_face. */
SIMD_INLINE kernel_sums kernel_tet_sums(const kernel_cell *c, const signed char *face, vf ij, vf jk, vf ik,
                                        bool has_colour)
{
    const int i = face[0], j = face[1], k = face[2];
    return (kernel_sums){kernel_weigh_value(ij, jk, ik, c->z[i], c->z[j], c->z[k]),
                         kernel_weigh_value(ij, jk, ik, c->f[i], c->f[j], c->f[k]),
                         has_colour ? kernel_weigh_value(ij, jk, ik, c->g[i], c->g[j], c->g[k]) : vf_set(0),
                         kernel_weight(ij, jk, ik)};
}

SIMD_INLINE kernel_sums kernel_sums_select(vm m, const kernel_sums *a, const kernel_sums *b)
{
    return (kernel_sums){vf_select(m, a->depth, b->depth), vf_select(m, a->value, b->value),
                         vf_select(m, a->colour, b->colour), vf_select(m, a->weight, b->weight)};
}

/* Where a ray goes in and out, in whichever order. */
typedef struct kernel_ends {
    kernel_sums a, b;
} kernel_ends;

/* Takes the first and the last of the faces that each ray crosses. */
SIMD_INLINE kernel_ends kernel_tet_choose(const vm hit[4], const kernel_sums sums[4])
{
    const kernel_sums a = kernel_sums_select(hit[1], &sums[1], &sums[2]);
    const kernel_sums b = kernel_sums_select(hit[2], &sums[2], &sums[1]);
    return (kernel_ends){kernel_sums_select(hit[0], &sums[0], &a), kernel_sums_select(hit[3], &sums[3], &b)};
}

/* With the edges of faces projected on rays where their weights are not good enough. */
static __attribute__((noinline, cold)) kernel_ends
kernel_tet_mend(const kernel_packet *p, const kernel_cell *c, vm rays, const vf e[KERNEL_TET_EDGES], bool has_colour)
{
    kernel_sums sums[4];
    vm hit[4];
    for (int n = 0; n < 4; n++) {
        const signed char *f = kernel_tet_face[n];
        vf ij = e[f[3]], jk = e[f[4]], ik = e[f[5]];
        hit[n] = kernel_inside(rays, ij, jk, ik);
        const vm weak = kernel_weak(hit[n], kernel_weight(ij, jk, ik), c->least[n]);
        if (vm_any(weak)) {
            const kernel_spot ijk[3] = {kernel_cell_spot(c, f[0]), kernel_cell_spot(c, f[1]),
                                        kernel_cell_spot(c, f[2])};
            kernel_triangle_mend(p, ijk, weak, &ij, &jk, &ik);
        }
        sums[n] = kernel_tet_sums(c, f, ij, jk, ik, has_colour);
    }
    return kernel_tet_choose(hit, sums);
}

/* Which rays cross which of the faces, in kernel_tet_face's order. */
SIMD_INLINE void kernel_tet_faces(const kernel_packet *p, const kernel_cell *c, vm rays, vm hit[4])
{
    vf e[KERNEL_TET_EDGES];
    kernel_tet_edges(p, c, e);
    for (int n = 0; n < 4; n++) {
        const signed char *f = kernel_tet_face[n];
        hit[n] = kernel_inside(rays, e[f[3]], e[f[4]], e[f[5]]);
    }
}

/* Without branches: all four faces' sums, of which each ray takes its first and its last crossed face's. */
SIMD_INLINE void kernel_tet_interval(const kernel_packet *p, const kernel_cell *c, vm rays, bool has_colour,
                                     kernel_interval *out)
{
    vf e[KERNEL_TET_EDGES];
    kernel_tet_edges(p, c, e);
    const vm hit[4] = {kernel_inside(rays, e[0], e[3], e[1]), kernel_inside(rays, e[0], e[4], e[2]),
                       kernel_inside(rays, e[1], e[5], e[2]), kernel_inside(rays, e[3], e[5], e[4])};
    out->mask = vm_or(vm_or(hit[0], hit[1]), vm_or(hit[2], hit[3]));
    out->t_in = out->t_out = out->v_in = out->v_out = out->w_in = out->w_out = vf_set(0);
    if (!vm_any(out->mask)) return;
    const kernel_sums sums[4] = {kernel_tet_sums(c, kernel_tet_face[0], e[0], e[3], e[1], has_colour),
                                 kernel_tet_sums(c, kernel_tet_face[1], e[0], e[4], e[2], has_colour),
                                 kernel_tet_sums(c, kernel_tet_face[2], e[1], e[5], e[2], has_colour),
                                 kernel_tet_sums(c, kernel_tet_face[3], e[3], e[5], e[4], has_colour)};
    kernel_ends ends = kernel_tet_choose(hit, sums);
    if (p->is_pencil) {
        const float *least = c->least;
        const vm weak =
            vm_or(vm_or(kernel_weak(hit[0], sums[0].weight, least[0]), kernel_weak(hit[1], sums[1].weight, least[1])),
                  vm_or(kernel_weak(hit[2], sums[2].weight, least[2]), kernel_weak(hit[3], sums[3].weight, least[3])));
        if (__builtin_expect(vm_any(weak), 0)) ends = kernel_tet_mend(p, c, rays, e, has_colour);
    }
    const vf scale_a = 1.0f / ends.a.weight, scale_b = 1.0f / ends.b.weight;
    const vf t_a = ends.a.depth * scale_a, t_b = ends.b.depth * scale_b;
    const vf v_a = ends.a.value * scale_a, v_b = ends.b.value * scale_b;
    const vm swap = vf_lt(t_b, t_a);
    out->t_in = vf_select(swap, t_b, t_a);
    out->t_out = vf_select(swap, t_a, t_b);
    out->v_in = vf_select(swap, v_b, v_a);
    out->v_out = vf_select(swap, v_a, v_b);
    if (!has_colour) return;
    const vf w_a = ends.a.colour * scale_a, w_b = ends.b.colour * scale_b;
    out->w_in = vf_select(swap, w_b, w_a);
    out->w_out = vf_select(swap, w_a, w_b);
}

#endif
