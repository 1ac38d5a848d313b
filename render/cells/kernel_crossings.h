/* Computes the crossings of a packet's rays with the faces of one cell. The first functions compute the rays' edge
 * functions from the lines of the cell's edges (kernel_cell.h defines these terms). The others compute from these the
 * crossings with hexes, wedges and pyramids. kernel_tets.h computes those with tets. */
#ifndef RENDER_KERNEL_CROSSINGS_H
#define RENDER_KERNEL_CROSSINGS_H

#include <math.h>
#include <string.h>

#include "grid.h"
#include "kernel_cell.h"
#include "kernel_packet.h"
#include "kernel_quad.h"
#include "kernel_shapes.h"
#include "simd.h"

SIMD_INLINE kernel_line kernel_line_in_packet(const kernel_packet *p, kernel_tile_position a, kernel_tile_position b)
{
    return kernel_line_between(p->frame, a, b, kernel_bound_projected_position(p->frame, p->tile, a),
                               kernel_bound_projected_position(p->frame, p->tile, b));
}

SIMD_INLINE vf kernel_project_x(const kernel_packet *p, kernel_tile_position a)
{
    return (vf_set(a.x) - p->origin_x) - p->slope_x * a.z;
}

SIMD_INLINE vf kernel_project_y(const kernel_packet *p, kernel_tile_position a)
{
    return (vf_set(a.y) - p->origin_y) - p->slope_y * a.z;
}

/* Decides the sign of the edge function on rays on which the function is almost zero. The sign is computed in double,
 * in which products of float32 are exact. The magnitude of such an edge function is negligible compared with those of
 * other edges. It is set to KERNEL_EDGE_LEAST, because the weights of a triangle must not all be zero. If the function
 * is exactly zero, the tie is decided by the rule of kernel_cell.h, and stored as the sign of the zero. */
static __attribute__((noinline, cold)) vf kernel_decide_edge_ties(vf ax, vf ay, vf bx, vf by, vf e)
{
    for (int lane = 0; lane < SIMD_WIDTH; lane++) {
        const double x0 = (double)ax[lane], y0 = (double)ay[lane], x1 = (double)bx[lane], y1 = (double)by[lane];
        const double exact = x0 * y1 - x1 * y0;
        if (!(fabsf(e[lane]) <= KERNEL_EDGE_LEAST)) continue;
        if (exact == 0)
            e[lane] = y1 < y0 || (y0 == y1 && x0 < x1) ? 0.0f : -0.0f;
        else
            e[lane] = exact > 0 ? KERNEL_EDGE_LEAST : -KERNEL_EDGE_LEAST;
    }
    return e;
}

/* Returns v_out, except for rays that meet a surface only in an edge of its faces. v_in, v_out: values minus the
 * isovalue where the ray enters and leaves a cell. If the surface consists of faces of cells (is_of_faces of render.h)
 * and a ray meets such a face only in an edge, v_in and v_out are both 0. For such a ray, a number slightly below 0 is
 * returned, as inside the cell, so that the ray crosses the surface. */
SIMD_INLINE vf kernel_move_end_value_into_cell(vf v_in, vf v_out, bool is_of_faces)
{
    if (!is_of_faces) return v_out;
    const vm is_edge = vm_and(vf_eq(v_in, vf_set(0)), vf_eq(v_out, vf_set(0)));
    return vf_select(is_edge, vf_set(-KERNEL_EDGE_LEAST), v_out);
}

/* Returns the edge function of the edge from a to b, given by x and y of the two projected points; its sign is exact
 * for these points. */
SIMD_INLINE vf kernel_compute_exact_edge_function(vf ax, vf ay, vf bx, vf by)
{
    const vf e = vf_diff_of_products(ax, by, bx, ay);
    const vm tie = vf_le(vf_abs(e), vf_set(KERNEL_EDGE_LEAST));
    return __builtin_expect(vm_any(tie), 0) ? kernel_decide_edge_ties(ax, ay, bx, by, e) : e;
}

SIMD_INLINE vf kernel_compute_projected_edge_function(const kernel_packet *p, kernel_tile_position a,
                                                      kernel_tile_position b)
{
    return kernel_compute_exact_edge_function(kernel_project_x(p, a), kernel_project_y(p, a), kernel_project_x(p, b),
                                              kernel_project_y(p, b));
}

static __attribute__((noinline, cold)) vf kernel_recompute_uncertain_edge_function(const kernel_packet *p,
                                                                                   kernel_tile_position a,
                                                                                   kernel_tile_position b, vm doubt,
                                                                                   vf e)
{
    return vf_select(doubt, kernel_compute_projected_edge_function(p, a, b), e);
}

SIMD_INLINE vf kernel_evaluate_line_on_rays(const kernel_packet *p, const kernel_line *l)
{
    return vf_muladd(vf_set(l->cv), p->v, vf_muladd(vf_set(l->cu), p->u, vf_set(l->c)));
}

/* Returns the edge function of the edge from a to b on the packet's rays, with exact signs and ties decided: the sign
 * bit states the side, even of a zero. a must be before b in the order of coordinates; l: the edge's line
 * (kernel_line). */
SIMD_INLINE vf kernel_edge_function_on_rays(const kernel_packet *p, const kernel_line *l, kernel_tile_position a,
                                            kernel_tile_position b)
{
    if (!p->is_pencil) return kernel_compute_projected_edge_function(p, a, b);
    const vf e = kernel_evaluate_line_on_rays(p, l);
    const vm doubt = vm_not(vf_lt(vf_set(l->bound), vf_abs(e)));
    return __builtin_expect(vm_any(doubt), 0) ? kernel_recompute_uncertain_edge_function(p, a, b, doubt, e) : e;
}

/* Returns those of the given rays that cross the triangle with the vertices i, j, k. ij, jk, ik: the rays' edge
 * functions of the triangle's edges. */
SIMD_INLINE vm kernel_rays_inside_triangle(vm rays, vf ij, vf jk, vf ik)
{
    const vi a = vi_from_bits(ij), b = vi_from_bits(jk), c = vi_from_bits(ik);
    return vm_and(rays, vm_sign(~(a ^ b) & (a ^ c)));
}

/* Returns the weighted sum of a quantity (depth or field) over the vertices of a crossed triangle. i, j, k: the
 * quantity at the vertices; ij, jk, ik: the edge functions, which give the weights (kernel_cell.h). Divided by
 * kernel_sum_weights() it is the quantity at the crossing. */
SIMD_INLINE vf kernel_sum_weighted_vertex_values(vf ij, vf jk, vf ik, float i, float j, float k)
{
    return vf_muladd(ij, vf_set(k), vf_muladd(-ik, vf_set(j), jk * i));
}

SIMD_INLINE vf kernel_sum_weights(vf ij, vf jk, vf ik)
{
    return (jk - ik) + ij;
}

SIMD_INLINE kernel_edge_error kernel_edge_error_between(const kernel_packet *p, kernel_tile_position a,
                                                        kernel_tile_position b)
{
    const kernel_line l = kernel_line_in_packet(p, a, b);
    return kernel_compute_edge_error(&l, p->tile->radius, a, b);
}

/* Returns the least sum of weights at which crossings of the triangle i, j, k are accurate
 * (kernel_compute_least_weight_sum()). The vertices must be in the order of coordinates. */
static __attribute__((noinline, cold)) float kernel_compute_triangle_least_weight(const kernel_packet *p,
                                                                                  kernel_tile_position i,
                                                                                  kernel_tile_position j,
                                                                                  kernel_tile_position k)
{
    const kernel_edge_error ij = kernel_edge_error_between(p, i, j), jk = kernel_edge_error_between(p, j, k),
                            ik = kernel_edge_error_between(p, i, k);
    return kernel_compute_least_weight_sum((ij.error + jk.error) + ik.error, (ij.extent + jk.extent) + ik.extent);
}

/* Returns the rays whose crossing of a triangle is not accurate enough, because the sum of its weights (`weight`) has a
 * magnitude below `least`. hit: the rays that cross the triangle. */
SIMD_INLINE vm kernel_find_inaccurate_crossings(vm hit, vf weight, float least)
{
    return vm_and(hit, vf_lt(vf_abs(weight), vf_set(least)));
}

/* Replaces the triangle's edge functions on the rays in `weak` by those computed from its projected vertices. ijk: the
 * vertices in the order of coordinates. */
static __attribute__((noinline, cold)) void kernel_recompute_triangle_edge_functions(const kernel_packet *p,
                                                                                     const kernel_tile_position ijk[3],
                                                                                     vm weak, vf *ij, vf *jk, vf *ik)
{
    const vf ax = kernel_project_x(p, ijk[0]), ay = kernel_project_y(p, ijk[0]);
    const vf bx = kernel_project_x(p, ijk[1]), by = kernel_project_y(p, ijk[1]);
    const vf cx = kernel_project_x(p, ijk[2]), cy = kernel_project_y(p, ijk[2]);
    *ij = vf_select(weak, kernel_compute_exact_edge_function(ax, ay, bx, by), *ij);
    *jk = vf_select(weak, kernel_compute_exact_edge_function(bx, by, cx, cy), *jk);
    *ik = vf_select(weak, kernel_compute_exact_edge_function(ax, ay, cx, cy), *ik);
}

SIMD_INLINE void kernel_transform(const kernel_packet *p, const double *world, float *out_x, float *out_y, float *out_z)
{
    kernel_transform_in_tile(p->frame, p->tile, world, out_x, out_y, out_z);
}

/* The following functions intersect rays with hexes, wedges and pyramids. Their quadrilateral faces may be warped, so
 * that a ray may enter such a cell more than once. */

/* The weights of crossings of a triangle. i, j, k: indices of its vertices in the cell, in the order of coordinates;
 * ij, jk, ik: its edge functions; inverse: 1 divided by the sum of the weights. Tets use the same weights, so that
 * depth and value of a crossing are bit-identical in both cells of a face. */
typedef struct kernel_weights {
    int i, j, k;
    vf ij, jk, ik, inverse;
} kernel_weights;

SIMD_INLINE kernel_weights kernel_weights_of(int i, int j, int k, vf ij, vf jk, vf ik)
{
    return (kernel_weights){i, j, k, ij, jk, ik, 1.0f / kernel_sum_weights(ij, jk, ik)};
}

/* Replaces the weights of crossings of the triangle i, j, k on those of the rays in `hit` on which they are not
 * accurate enough: the new weights are computed from the triangle's projected vertices. least: an upper bound of
 * kernel_compute_triangle_least_weight() for the triangle, with which most calls return early. */
SIMD_INLINE void kernel_weights_recompute(const kernel_packet *p, float least, vm hit, kernel_tile_position i,
                                          kernel_tile_position j, kernel_tile_position k, kernel_weights *w)
{
    if (!p->is_pencil) return;
    const vf weight = kernel_sum_weights(w->ij, w->jk, w->ik);
    if (__builtin_expect(!vm_any(kernel_find_inaccurate_crossings(hit, weight, least)), 1)) return;
    const vm weak = kernel_find_inaccurate_crossings(hit, weight, kernel_compute_triangle_least_weight(p, i, j, k));
    vf ij = w->ij, jk = w->jk, ik = w->ik;
    if (!vm_any(weak)) return;
    kernel_recompute_triangle_edge_functions(p, (const kernel_tile_position[3]){i, j, k}, weak, &ij, &jk, &ik);
    *w = kernel_weights_of(w->i, w->j, w->k, ij, jk, ik);
}

SIMD_INLINE vf kernel_weighted_sum(const kernel_weights *w, float fi, float fj, float fk)
{
    return kernel_sum_weighted_vertex_values(w->ij, w->jk, w->ik, fi, fj, fk) * w->inverse;
}

SIMD_INLINE vf kernel_weighted_depth(const kernel_weights *w, const float *z)
{
    return kernel_weighted_sum(w, z[w->i], z[w->j], z[w->k]);
}

/* The rays and the cell of a search for crossings, with the data that are computed once for all of the cell's faces. */
typedef struct kernel_face_search {
    const kernel_packet *packet;
    const kernel_cell *cell;
    const kernel_shape *shape;
    vm rays;
    vf x[GRID_MAX_CELL_VERTICES], y[GRID_MAX_CELL_VERTICES]; /* the cell's vertices, projected along each ray */
    /* Edge functions of the cell's edges and of its quads' diagonals. edge[a][b] is that of the edge from vertex a to
     * vertex b, set only if a is before b in the order of coordinates. */
    vf edge[GRID_MAX_CELL_VERTICES][GRID_MAX_CELL_VERTICES];
} kernel_face_search;

/* Computes the rays' edge function of the edge between the vertices i and j, and stores it in s->edge. n: index of the
 * edge in cell->lines. i and j may be given in any order. */
SIMD_INLINE void kernel_store_edge_function(kernel_face_search *s, int n, int i, int j)
{
    const kernel_cell *c = s->cell;
    const int a = c->rank[i] < c->rank[j] ? i : j, b = a == i ? j : i;
    s->edge[a][b] =
        kernel_edge_function_on_rays(s->packet, &c->lines[n], kernel_cell_position(c, a), kernel_cell_position(c, b));
}

SIMD_INLINE void kernel_set_values_at_triangle_crossing(const kernel_face_search *s, const kernel_weights *w,
                                                        kernel_point *out)
{
    const kernel_cell *c = s->cell;
    const kernel_shape *shape = s->shape;
    out->value = kernel_weighted_sum(w, c->f[w->i], c->f[w->j], c->f[w->k]);
    for (int a = 0; a < 3; a++)
        out->r[a] = kernel_weighted_sum(w, shape->corners[w->i][a], shape->corners[w->j][a], shape->corners[w->k][a]);
}

/* Returns the edge function of the edge from one vertex to another. The function is stored for the direction in which
 * coordinates increase, and is negated for the other direction. */
SIMD_INLINE vf kernel_get_directed_edge_function(const kernel_face_search *s, int from, int to)
{
    return s->cell->rank[from] < s->cell->rank[to] ? s->edge[from][to] : -s->edge[to][from];
}

/* Computes the field and the cell's reference coordinates at a crossing of a quad's bilinear patch. corner: the quad's
 * vertices; at->r[0], at->r[1]: the patch's parameters at the crossing (kernel_quad.h). The isoparametric maps of both
 * cells that share the quad map their faces to this patch, so the field is continuous across the face. */
SIMD_INLINE void kernel_set_values_at_quad_crossing(const kernel_face_search *s, const int corner[4],
                                                    const kernel_point *at, kernel_point *out)
{
    const kernel_cell *c = s->cell;
    const kernel_shape *shape = s->shape;
    vf f[4];
    for (int i = 0; i < 4; i++) f[i] = vf_set(c->f[corner[i]]);
    out->mask = at->mask;
    out->t = at->t;
    out->value = kernel_bilinear(f, at->r[0], at->r[1]);
    for (int a = 0; a < 3; a++) {
        const float base = shape->corners[corner[0]][a];
        out->r[a] = (base + at->r[0] * (shape->corners[corner[1]][a] - base)) +
                    at->r[1] * (shape->corners[corner[3]][a] - base);
    }
}

/* Sorts three of the cell's vertices by their ranks in the lexicographic order of coordinates. */
SIMD_INLINE void kernel_sort_triangle_vertices(const kernel_cell *c, const int corners[3], int out[3])
{
    int i = corners[0], j = corners[1], k = corners[2], swap;
    if (c->rank[j] < c->rank[i]) swap = i, i = j, j = swap;
    if (c->rank[k] < c->rank[j]) swap = j, j = k, k = swap;
    if (c->rank[j] < c->rank[i]) swap = i, i = j, j = swap;
    out[0] = i;
    out[1] = j;
    out[2] = k;
}

/* Returns the rays that cross the triangle, whose vertices are in the order of coordinates. */
SIMD_INLINE vm kernel_rays_crossing_triangle(const kernel_face_search *s, const int ijk[3])
{
    return kernel_rays_inside_triangle(s->rays, s->edge[ijk[0]][ijk[1]], s->edge[ijk[1]][ijk[2]],
                                       s->edge[ijk[0]][ijk[2]]);
}

/* Computes the crossings of rays with a triangle. corners: indices of its vertices in the cell. Returns false if no ray
 * crosses the triangle. */
SIMD_INLINE bool kernel_triangle_crossing(const kernel_face_search *s, const int corners[3], kernel_point *out)
{
    const kernel_cell *c = s->cell;
    int ijk[3];
    kernel_sort_triangle_vertices(c, corners, ijk);
    const vm hit = kernel_rays_crossing_triangle(s, ijk);
    if (!vm_any(hit)) return false;
    kernel_weights w = kernel_weights_of(ijk[0], ijk[1], ijk[2], s->edge[ijk[0]][ijk[1]], s->edge[ijk[1]][ijk[2]],
                                         s->edge[ijk[0]][ijk[2]]);
    kernel_weights_recompute(s->packet, c->least, hit, kernel_cell_position(c, w.i), kernel_cell_position(c, w.j),
                             kernel_cell_position(c, w.k), &w);
    out->mask = hit;
    out->t = kernel_weighted_depth(&w, c->z);
    kernel_set_values_at_triangle_crossing(s, &w, out);
    return true;
}

/* Computes the crossings of a quad that has collapsed to a triangle, as crossings of the two triangles into which its
 * diagonal splits it. Returns how many entries of `out` are set. */
static __attribute__((noinline, cold)) int kernel_cross_collapsed_quad(const kernel_face_search *s, const int corner[4],
                                                                       kernel_point *out)
{
    int n = 0;
    for (int half = 0; half < 2; half++) {
        const int corners[3] = {corner[0], corner[half + 1], corner[half + 2]};
        n += kernel_triangle_crossing(s, corners, &out[n]);
    }
    return n;
}

/* Computes the crossings of rays with a quad. corner: its vertices, from kernel_quad_corners(). Returns how many
 * entries of `out` are set (0 to 2). A ray that crosses the patch twice has a crossing in both entries. */
SIMD_INLINE int kernel_quad_crossings(const kernel_face_search *s, const int corner[4], kernel_point *out)
{
    const kernel_cell *c = s->cell;
    kernel_quad quad;
    kernel_point places[2];
    vm once = vm_none();
    for (int half = 0; half < 2; half++) {
        const int corners[3] = {corner[0], corner[half + 1], corner[half + 2]};
        int ijk[3];
        kernel_sort_triangle_vertices(c, corners, ijk);
        once = vm_xor(once, kernel_rays_crossing_triangle(s, ijk));
    }
    quad.e01 = s->edge[corner[0]][corner[1]];
    quad.e03 = s->edge[corner[0]][corner[3]];
    quad.e12 = kernel_get_directed_edge_function(s, corner[1], corner[2]);
    quad.e32 = kernel_get_directed_edge_function(s, corner[3], corner[2]);
    const vm twice = kernel_quad_sides_allow_two_points(s->rays, quad.e01, quad.e32, quad.e03, quad.e12);
    if (!vm_any(vm_or(once, twice))) return 0;
    if (kernel_quad_collapses(c, corner)) return kernel_cross_collapsed_quad(s, corner, out);
    for (int i = 0; i < 4; i++) {
        quad.x[i] = s->x[corner[i]];
        quad.y[i] = s->y[corner[i]];
        quad.z[i] = vf_set(c->z[corner[i]]);
    }
    const int n = kernel_compute_quad_points(&quad, once, twice, places);
    for (int i = 0; i < n; i++) kernel_set_values_at_quad_crossing(s, corner, &places[i], &out[i]);
    return n;
}

/* Computes all crossings of rays with the faces of a hex, wedge or pyramid. Returns how many entries of `out` are set;
 * out[n].mask has the rays that have crossing n. */
SIMD_INLINE int kernel_curved_crossings(const kernel_packet *p, const kernel_cell *c, vm rays,
                                        kernel_point out[KERNEL_MAX_CROSSINGS])
{
    const kernel_shape *shape = kernel_cell_shape(c->type);
    kernel_face_search s;
    s.packet = p;
    s.cell = c;
    s.shape = shape;
    s.rays = rays;
    for (int i = 0; i < c->count; i++) {
        s.x[i] = kernel_project_x(p, kernel_cell_position(c, i));
        s.y[i] = kernel_project_y(p, kernel_cell_position(c, i));
    }
    for (int n = 0; n < shape->edge_count; n++)
        kernel_store_edge_function(&s, n, shape->edges[n][0], shape->edges[n][1]);
    int n = 0;
    for (int face = 0; face < shape->face_count; face++) {
        const signed char *loop = shape->faces[face].vertices;
        if (shape->faces[face].count == 3) {
            const int corners[3] = {loop[0], loop[1], loop[2]};
            n += kernel_triangle_crossing(&s, corners, &out[n]);
            continue;
        }
        int corner[4];
        kernel_quad_corners(c, loop, corner);
        kernel_store_edge_function(&s, shape->edge_count + face, corner[0], corner[2]);
        n += kernel_quad_crossings(&s, corner, &out[n]);
    }
    return n;
}

/* Removes the nearest crossing of each ray from the list and stores it in *out. Returns false if the list has no
 * crossing of any ray. */
SIMD_INLINE bool kernel_take_nearest_crossing(kernel_point *list, int count, kernel_point *out)
{
    vi taken = vi_set(-1);
    out->mask = vm_none();
    out->t = vf_set(INFINITY);
    out->value = out->r[0] = out->r[1] = out->r[2] = vf_set(0);
    for (int n = 0; n < count; n++) {
        const vm nearer = vm_and(list[n].mask, vf_lt(list[n].t, out->t));
        out->mask = vm_or(out->mask, nearer);
        kernel_point_copy_lanes(nearer, &list[n], out);
        taken = (vi)vf_select(nearer, (vf)vi_set(n), (vf)taken);
    }
    for (int n = 0; n < count; n++) list[n].mask = vm_andnot(list[n].mask, vf_eq(vf_from_vi(taken), vf_set((float)n)));
    return vm_any(out->mask);
}

/* Sets all members of the interval except w_in and w_out from the crossings at its two ends. */
SIMD_INLINE void kernel_interval_from_points(vm mask, const kernel_point *in, const kernel_point *out,
                                             kernel_interval *i)
{
    i->mask = mask;
    i->t_in = in->t;
    i->t_out = out->t;
    i->v_in = in->value;
    i->v_out = out->value;
    memcpy(i->r_in, in->r, sizeof in->r);
    memcpy(i->r_out, out->r, sizeof out->r);
}

/* Computes the intervals of rays inside a hex, wedge or pyramid: each ray's crossings are sorted by depth; the first
 * and the second are the ends of an interval, then the third and the fourth, and so on. Returns how many entries of
 * `out` are set; entry n has the n-th interval of each ray. */
static __attribute__((noinline, unused)) int kernel_curved_intervals(const kernel_packet *p, const kernel_cell *c,
                                                                     vm rays,
                                                                     kernel_interval out[KERNEL_MAX_CELL_INTERVALS])
{
    kernel_point list[KERNEL_MAX_CROSSINGS], in, next;
    const int crossings = kernel_curved_crossings(p, c, rays, list);
    int n = 0;
    while (n < KERNEL_MAX_CELL_INTERVALS && kernel_take_nearest_crossing(list, crossings, &in) &&
           kernel_take_nearest_crossing(list, crossings, &next)) {
        kernel_interval_from_points(vm_and(in.mask, next.mask), &in, &next, &out[n]);
        n++;
    }
    return n;
}

#endif
