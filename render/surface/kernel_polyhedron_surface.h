/* Intersects rays with isosurfaces in polyhedra, and accepts the hits (kernel_surface.h).
 *
 * A ray's profile is the piecewise linear field along the ray in a polyhedron (kernel_polyhedron.h). Hits on
 * isosurfaces are the points of the profile at which the sign changes. They are exact, because a linear piece has at
 * most one root. All hits are computed, even on rays whose field is on the same side of the isovalue at both faces.
 *
 * On most such rays the field stays on that side, so that their profiles need not be followed. A bound identifies many
 * of them from the values at the faces' triangles alone. Values are relative to the isovalue:
 *
 *      v |                               along the tile's rays no tet's field falls faster than `fall` or rises faster
 *        | in                . out       than `rise`. So between the faces' triangles the field is above both lines,
 *        |   '.           .'             which meet below the isovalue if
 *        |      '.     .'  rise
 *        |   fall  '.'                       rise v_in + fall v_out < fall rise (t_out - t_in),
 *        +-----------------------> t
 *                                        and likewise for rays below the isovalue.
 *
 * Isovalues outside the range of the vertices' values are not searched for. If tets overlap, the field, which is the
 * signed sum of the tets' fields, may exceed that range, but trees and the session's plan assume that a cell has
 * surfaces only for isovalues between its vertices' values. */
#ifndef RENDER_KERNEL_POLYHEDRON_SURFACE_H
#define RENDER_KERNEL_POLYHEDRON_SURFACE_H

#include <math.h>
#include <string.h>

#include "kernel_accept.h"
#include "kernel_cell_values.h"
#include "kernel_crossings.h"
#include "kernel_lines.h"
#include "kernel_packet.h"
#include "kernel_polyhedron.h"
#include "kernel_roots.h"
#include "kernel_surface.h"
#include "kernel_types.h"
#include "render.h"
#include "render_polyhedra.h"
#include "simd.h"

/* ---- normals from the field's gradient in the polyhedron's tets ---- */

/* Computes the gradient of the field in the tet between a surface triangle (index `facet`) and the polyhedron's centre,
 * in camera axes and in double. */
static void kernel_polyhedron_gradient(const kernel_packet *p, const polyhedron *c, int facet, double out[3])
{
    const double *corner[4];
    double value[4];
    for (int i = 0; i < 4; i++) {
        const int v = i < 3 ? c->facets[facet].vertex[i] : c->vertex_count;
        corner[i] = c->world[v];
        value[i] = (double)c->f[v];
    }
    kernel_tet_gradient(p->frame, corner, value, out);
    for (int a = 0; a < 3; a++) out[a] = out[a] > 1e18 ? 1e18 : out[a] >= -1e18 ? out[a] : -1e18;
}

/* A polyhedron is divided into tets, each between a surface triangle and the centre; the sign of an inverted tet is -1.
 * Computes, for each hit, the sum of the field's gradients in all tets that contain the hit, each times the tet's sign.
 * Returns the hits for which these signs sum to 1, so that the sum is valid. */
static vm kernel_polyhedron_sum_tet_gradients(const kernel_packet *p, const kernel_poly_crossings *r, vm hit, vf t,
                                              vf out[3])
{
    vf cover = vf_set(0);
    for (int n = 0; n < r->cell->facet_count; n++) {
        if (!vm_any(r->tets[n].mask)) continue;
        const vm in = vm_and(hit, kernel_subtet_contains(&r->tets[n], t, false));
        if (!vm_any(in)) continue;
        const float sign = r->cell->facets[n].sign;
        double g[3];
        kernel_polyhedron_gradient(p, r->cell, n, g);
        cover = vf_select(in, cover + sign, cover);
        for (int a = 0; a < 3; a++) out[a] = vf_select(in, out[a] + sign * (float)g[a], out[a]);
    }
    return vm_and(hit, vf_eq(cover, vf_set(1)));
}

/* Finds, for each hit at depth t, the tet of the polyhedron's decomposition that contains the hit or is nearest to it
 * along the ray. Inverted tets are skipped. out[ray] becomes the index of the tet's surface triangle; -1 if there is no
 * tet. */
static void kernel_polyhedron_find_facets(const kernel_poly_crossings *r, vm hit, vf t, int32_t out[SIMD_WIDTH])
{
    vf nearest = vf_set(INFINITY);
    vi facet = vi_set(-1);
    for (int n = 0; n < r->cell->facet_count; n++) {
        const kernel_interval *s = &r->tets[n];
        if (r->cell->facets[n].sign < 0 || !vm_any(s->mask)) continue;
        const vf away = vf_max(vf_max(s->t_in - t, t - s->t_out), vf_set(0));
        const vm nearer = vm_and(vm_and(hit, s->mask), vf_lt(away, nearest));
        nearest = vf_select(nearer, away, nearest);
        facet = vi_select(nearer, vi_set(n), facet);
    }
    memcpy(out, &facet, sizeof facet);
}

/* Computes the field's gradient at the hits, in camera axes: the gradient in the tet that
 * kernel_polyhedron_find_facets() finds. If tets overlap, it is instead the signed sum of the gradients in the tets
 * that contain the hit, where that sum is valid. */
static void kernel_polyhedron_normal(const kernel_packet *p, const kernel_poly_crossings *r, vm hit, vf t, vf out[3])
{
    int32_t facets[SIMD_WIDTH];
    for (int a = 0; a < 3; a++) out[a] = vf_set(0);
    if (!r->cell->is_star_shaped) hit = vm_andnot(hit, kernel_polyhedron_sum_tet_gradients(p, r, hit, t, out));
    kernel_polyhedron_find_facets(r, hit, t, facets);
    for (unsigned left = vm_bits(hit); left; left &= left - 1) {
        const int ray = __builtin_ctz(left);
        double g[3];
        if (facets[ray] < 0) continue;
        kernel_polyhedron_gradient(p, r->cell, facets[ray], g);
        for (int a = 0; a < 3; a++) out[a][ray] = (float)g[a];
    }
}

/* ---- normals interpolated from gradients at the vertices ---- */

/* Computes the mean of the vertices' gradients, in camera axes. It is used as the gradient at the polyhedron's centre,
 * just as the centre's value is the mean of the vertices' values. */
static void kernel_polyhedron_mean_gradient(const kernel_frame *f, const polyhedron *c,
                                            const render_vertex_gradients *gradients, double out[3])
{
    out[0] = out[1] = out[2] = 0;
    for (int i = 0; i < c->vertex_count; i++) {
        double g[3];
        kernel_vertex_gradient(f, gradients, c->vertices[i], g);
        for (int a = 0; a < 3; a++) out[a] += g[a] / c->vertex_count;
    }
}

/* Computes the barycentric coordinates (share) of a ray's point at depth t in the tet between the surface triangle with
 * index `facet` and the centre. corners: receives the indices of the tet's corners in the polyhedron's arrays, the last
 * for the centre. ray: lane of the packet. */
static void kernel_polyhedron_barycentric(const kernel_packet *p, const polyhedron *c, int facet, int ray, float t,
                                          int corners[4], double share[4])
{
    double place[4][3], point[3];
    for (int i = 0; i < 4; i++) {
        const int v = corners[i] = i < 3 ? c->facets[facet].vertex[i] : c->vertex_count;
        place[i][0] = (double)c->x[v];
        place[i][1] = (double)c->y[v];
        place[i][2] = (double)c->z[v];
    }
    kernel_ray_point(p, ray, t, point);
    kernel_compute_barycentric((const double(*)[3])place, point, share);
}

/* Computes the hits' normals, in camera axes, by interpolating the vertices' gradients in the tets that contain the
 * hits (RENDER_VERTEX). */
static __attribute__((noinline)) void kernel_polyhedron_vertex_normals(const kernel_packet *p, const polyhedron *c,
                                                                       const render_surface_layer *layer,
                                                                       const kernel_poly_crossings *r, vm hit, vf t,
                                                                       vf out[3])
{
    const render_vertex_gradients *gradients = &layer->gradients[c->part];
    int32_t facets[SIMD_WIDTH];
    double of_centre[3];
    kernel_polyhedron_find_facets(r, hit, t, facets);
    kernel_polyhedron_mean_gradient(p->frame, c, gradients, of_centre);
    for (int a = 0; a < 3; a++) out[a] = vf_set((float)of_centre[a]);
    for (unsigned left = vm_bits(hit); left; left &= left - 1) {
        const int ray = __builtin_ctz(left);
        if (facets[ray] < 0) continue;
        int corners[4];
        double g[4][3], share[4];
        kernel_polyhedron_barycentric(p, c, facets[ray], ray, t[ray], corners, share);
        for (int i = 0; i < 3; i++) kernel_vertex_gradient(p->frame, gradients, c->vertices[corners[i]], g[i]);
        memcpy(g[3], of_centre, sizeof g[3]);
        for (int a = 0; a < 3; a++)
            out[a][ray] =
                (float)((share[0] * g[0][a] + share[1] * g[1][a]) + (share[2] * g[2][a] + share[3] * g[3][a]));
    }
}

/* ---- bounds that prove that a ray does not cross the isovalue ---- */

/* Computes upper bounds of how fast the field in a tet falls and rises along any of the tile's rays, per unit of depth.
 * spread: upper bound of the rays' |slope_x| and |slope_y|. */
static void kernel_bound_tet_slopes(const polyhedron *c, const polyhedron_facet *facet, double spread, double *fall,
                                    double *rise)
{
    const int centre = c->vertex_count;
    double d[3][3], df[3], g[3];
    for (int i = 0; i < 3; i++) {
        const int v = facet->vertex[i];
        d[i][0] = (double)c->x[v] - (double)c->x[centre];
        d[i][1] = (double)c->y[v] - (double)c->y[centre];
        d[i][2] = (double)c->z[v] - (double)c->z[centre];
        df[i] = c->values[v] - c->values[centre];
    }
    kernel_solve_for_gradient((const double(*)[3])d, df, g);
    const double aside = spread * (fabs(g[0]) + fabs(g[1]));
    *fall = aside - g[2];
    *rise = aside + g[2];
}

/* Computes c->fall and c->rise: upper bounds of how fast the field falls and rises, per unit of depth, along any of the
 * tile's rays in any of the tets into which the polyhedron is divided. They are infinite if a tet has no volume. */
static __attribute__((noinline)) void kernel_polyhedron_bound_slopes(polyhedron *c, const kernel_packet *p)
{
    const double spread = p->frame->job->camera.is_orthographic ? 0 : (double)p->tile->radius;
    c->has_slopes = true;
    c->fall = c->rise = 0;
    for (int i = 0; i < c->facet_count; i++) {
        double fall = (double)INFINITY, rise = (double)INFINITY;
        if (c->facets[i].sign != 0) kernel_bound_tet_slopes(c, &c->facets[i], spread, &fall, &rise);
        if (!(fall <= c->fall)) c->fall = fall <= 1e300 ? fall : (double)INFINITY;
        if (!(rise <= c->rise)) c->rise = rise <= 1e300 ? rise : (double)INFINITY;
    }
}

/* Converts a bound of the field's slope (c->fall or c->rise) to one for the values c->f, which are the field times
 * c->scale. The result is limited, so that the product of two such bounds is finite. */
SIMD_INLINE vf kernel_scale_slope_bound(const polyhedron *c, double slope)
{
    const double scaled = slope * c->scale;
    return vf_set(scaled <= 1e15 ? (float)scaled : 1e15f);
}

/* Returns the rays on which the field may cross the isovalue although it is on the same side of the isovalue at both
 * ends of the interval. The bounds c->fall and c->rise exclude such crossings on other rays. They are not valid if tets
 * overlap, or if a ray crosses a quad's triangles but not its bilinear patch or the reverse; such rays are always
 * returned. */
SIMD_INLINE vm kernel_polyhedron_may_cross(const kernel_packet *p, polyhedron *c, const kernel_poly_crossings *r)
{
    const kernel_interval *i = &r->interval;
    const vm longer = vm_and(i->mask, vf_lt(i->t_in, i->t_out));
    if (!c->is_star_shaped || !p->is_pencil) return longer;
    if (!c->has_slopes) kernel_polyhedron_bound_slopes(c, p);
    const vf zero = vf_set(0), fall = kernel_scale_slope_bound(c, c->fall), rise = kernel_scale_slope_bound(c, c->rise);
    const vf in = r->in.v, out = r->out.v;
    const vm below = vf_lt(i->v_in, zero);
    const vm differs = vm_or(vm_xor(vf_lt(in, zero), below), vm_xor(vf_lt(out, zero), below));
    const vf away = vf_select(below, fall, rise) * vf_abs(in) + vf_select(below, rise, fall) * vf_abs(out);
    const vm turns = vf_lt(away, fall * rise * (r->out.t - r->in.t));
    return vm_and(longer, vm_or(turns, vm_or(differs, r->uneven)));
}

/* ---- crossings of the isovalue by the piecewise linear field on a ray ---- */

/* The state of a search along the rays' profiles (the piecewise linear field on each ray), from crossing to crossing of
 * the isovalue. At a face, the value interpolated on the face decides on which side of the isovalue the field is. If
 * tets overlap at the face, the profile just behind it may be on the other side. The field then jumps at the face, and
 * the jump is a crossing. */
typedef struct kernel_profile_walk {
    vm open;  /* rays on which more crossings may follow */
    vm below; /* rays on which the field is below the isovalue at the end of the current piece */
    /* rays on which the value on the face and the profile next to it are on different sides of the isovalue: at the
     * face where the ray enters (jump_in) and leaves (jump_out) */
    vm jump_in, jump_out;
    kernel_interval piece; /* current linear piece of each ray's profile */
    vf t, w;               /* depth of the crossing that was found last; value of the colour field there */
} kernel_profile_walk;

/* Begins the search for crossings of the isovalue at the faces where the rays enter their current interval
 * (r->interval). */
static void kernel_profile_walk_begin(const kernel_poly_crossings *r, vm rays, kernel_profile_walk *walk)
{
    const kernel_interval *i = &r->interval;
    const vf zero = vf_set(0);
    const vm below = vf_lt(i->v_in, zero);
    walk->open = rays;
    walk->below = vf_lt(r->u_in, zero);
    walk->jump_in = vm_and(rays, vm_xor(walk->below, below));
    walk->jump_out = vm_and(rays, vm_xor(vf_lt(r->u_out, zero), vf_lt(i->v_out, zero)));
    kernel_begin_linear_pieces(r, &walk->piece);
}

/* Copies depths, values and colour values at both ends of a piece, on the given rays only. */
SIMD_INLINE void kernel_copy_piece_ends(vm rays, const kernel_interval *from, kernel_interval *to)
{
    to->t_in = vf_select(rays, from->t_in, to->t_in);
    to->t_out = vf_select(rays, from->t_out, to->t_out);
    to->v_in = vf_select(rays, from->v_in, to->v_in);
    to->v_out = vf_select(rays, from->v_out, to->v_out);
    to->w_in = vf_select(rays, from->w_in, to->w_in);
    to->w_out = vf_select(rays, from->w_out, to->w_out);
}

/* Advances the rays in `left` to the next piece of their profiles, on which the field is linear. Returns the rays whose
 * profile continues behind that piece; a jump at the last face counts as a piece. A value inside the cell that equals
 * the isovalue up to rounding is replaced by one on the side of the isovalue from which the ray comes. The reason: at
 * one point a ray may meet several faces between tets, whose values are rounded differently, so that their signs would
 * alternate. The values at the cell's faces are not changed. */
SIMD_INLINE vm kernel_profile_walk_advance(const kernel_poly_crossings *r, vm left, kernel_profile_walk *walk)
{
    kernel_interval next = walk->piece;
    const vf zero = vf_set(0);
    const vm inside = kernel_has_next_linear_piece(r, &next, left);
    kernel_find_next_linear_piece(r, vf_select(inside, r->u_out, r->interval.v_out), &next);
    const vm rounding =
        vm_and(kernel_has_next_linear_piece(r, &next, inside), vf_le(vf_abs(next.v_out), vf_set(KERNEL_ROOT_BAND)));
    next.v_out = vf_select(rounding, vf_select(walk->below, vf_set(-1e-30f), zero), next.v_out);
    kernel_copy_piece_ends(left, &next, &walk->piece);
    return vm_and(inside, vm_or(walk->jump_out, kernel_has_next_linear_piece(r, &next, inside)));
}

/* Returns a number that is larger than t by one or two units in the last place. */
SIMD_INLINE vf kernel_next_float(vf t)
{
    return t + (vf_abs(t) * 2.4e-7f + 1e-30f);
}

/* Finds the next crossing of each ray in walk->open, and returns the rays that have one. */
static vm kernel_profile_walk_find_crossing(const kernel_poly_crossings *r, kernel_profile_walk *walk)
{
    const vm jump = walk->jump_in;
    vm found = jump, left = vm_andnot(walk->open, jump);
    walk->jump_in = vm_none();
    while (vm_any(left)) {
        const vm on = kernel_profile_walk_advance(r, left, walk);
        const vm cross = vm_and(left, vm_xor(vf_lt(walk->piece.v_out, vf_set(0)), walk->below));
        walk->below = vm_xor(walk->below, cross);
        walk->open = vm_andnot(walk->open, vm_andnot(left, on));
        found = vm_or(found, cross);
        left = vm_andnot(on, cross);
    }
    const kernel_interval *piece = &walk->piece;
    const vf t0 = piece->t_in, t = kernel_secant(t0, piece->v_in, piece->t_out, piece->v_out);
    walk->t = vf_select(vf_lt(t0, piece->t_out), t, vf_select(jump, kernel_next_float(t0), t0));
    walk->w = piece->w_in + kernel_interval_fraction(piece, t) * (piece->w_out - piece->w_in);
    return found;
}

/* Computes the contour lines' field, its gradient and the surface's normal at the hits, in the tet that contains the
 * hit or is nearest to it. */
static __attribute__((noinline)) void kernel_polyhedron_line_field(const kernel_packet *p, const kernel_surface *s,
                                                                   const kernel_poly_crossings *r, vm hit, vf t,
                                                                   kernel_line_field *out)
{
    const polyhedron *c = r->cell;
    const grid_field *field = &s->layer->lines->field.fields[c->part];
    int32_t facets[SIMD_WIDTH];
    double mean = 0;
    kernel_polyhedron_find_facets(r, hit, t, facets);
    for (int i = 0; i < c->vertex_count; i++)
        mean += kernel_lines_read_vertex_value(s, field, c->vertices[i]) / c->vertex_count;
    *out = (kernel_line_field){.value = vf_set(NAN)};
    for (unsigned left = vm_bits(hit); left; left &= left - 1) {
        const int ray = __builtin_ctz(left);
        if (facets[ray] < 0) continue;
        int corners[4];
        const double *corner[4];
        double value[4], share[4], g[3], n[3];
        kernel_polyhedron_barycentric(p, c, facets[ray], ray, t[ray], corners, share);
        for (int i = 0; i < 4; i++) {
            corner[i] = c->world[corners[i]];
            value[i] = i < 3 ? kernel_lines_read_vertex_value(s, field, c->vertices[corners[i]]) : mean;
        }
        kernel_tet_gradient(p->frame, corner, value, g);
        kernel_polyhedron_gradient(p, c, facets[ray], n);
        out->value[ray] =
            (float)((share[0] * value[0] + share[1] * value[1]) + (share[2] * value[2] + share[3] * value[3]));
        for (int a = 0; a < 3; a++) {
            out->gradient[a][ray] = (float)g[a];
            out->normal[a][ray] = (float)n[a];
        }
    }
}

/* Computes the normals of hits in a polyhedron, and accepts the hits. */
static void kernel_polyhedron_accept(kernel_packet *p, const kernel_surface *s, int value, kernel_poly_crossings *r,
                                     vm hit, const kernel_profile_walk *walk)
{
    /* in polyhedra normals are gradients in the cell or from the vertices, never central differences */
    kernel_surface_hits at = {
        .value = vi_set(value), .t = walk->t, .w = walk->w, .part = vi_set(-1), .cell = vi_set(-1)};
    if (!vm_any(hit)) return;
    kernel_poly_intersect_tets(r);
    if (s->layer->normal == RENDER_VERTEX)
        kernel_polyhedron_vertex_normals(p, r->cell, s->layer, r, hit, walk->t, at.normal);
    else
        kernel_polyhedron_normal(p, r, hit, walk->t, at.normal);
    kernel_line_field along;
    if (s->layer->lines) {
        kernel_polyhedron_line_field(p, s, r, hit, walk->t, &along);
        at.along = &along;
    }
    kernel_accept(p, s, hit, &at);
}

/* Finds the crossings of the isovalue in the current interval of the rays in `wanted`, and accepts them. A ray ends at
 * the first crossing of an opaque surface that is in front of the eye and that clips keep. */
static void kernel_polyhedron_accept_crossings(kernel_packet *p, const kernel_surface *s, int value, vm wanted,
                                               kernel_poly_crossings *r)
{
    kernel_profile_walk walk;
    kernel_poly_prepare_piecewise_field(r);
    kernel_profile_walk_begin(r, wanted, &walk);
    do {
        const vm found = kernel_profile_walk_find_crossing(r, &walk);
        const vm kept = kernel_unclipped_hits(p, s, found, walk.t);
        kernel_polyhedron_accept(p, s, value, r, vm_and(kept, vf_le(walk.t, p->t_far)), &walk);
        if (kernel_is_opaque(p, s)) walk.open = vm_andnot(walk.open, kept);
    } while (vm_any(walk.open));
}

/* Traces the surface of one isovalue in a polyhedron, in all intervals of the rays. */
static void kernel_polyhedron_surface(kernel_packet *p, const kernel_surface *s, polyhedron *c, int value, vm rays)
{
    const render_surface_layer *layer = s->layer;
    kernel_poly_crossings r;
    if (!kernel_poly_allocate(p, c, &r) || !kernel_poly_cross(&r, rays, layer->colour_map != NULL)) return;
    while (kernel_poly_find_next_interval(&r)) {
        const vm near = kernel_interval_overlaps_ray(p, &r.interval);
        if (!vm_any(near)) continue;
        const vm wanted =
            vm_and(near, vm_or(kernel_interval_changes_sign(&r.interval), kernel_polyhedron_may_cross(p, c, &r)));
        if (vm_any(wanted)) kernel_polyhedron_accept_crossings(p, s, value, wanted, &r);
    }
}

/* Traces the surfaces of all isovalues of a layer in a polyhedron. part, index: mesh part, and index of the polyhedron
 * in it. */
static void kernel_polyhedron_trace_layer(kernel_packet *p, const kernel_surface *s, int part, uint32_t index, vm rays)
{
    const render_surface_layer *layer = s->layer;
    polyhedron *c = kernel_polyhedron_find(p, &layer->field.fields[part], part, (int)(s - p->frame->surfaces), index);
    if (!c) return;
    for (int value = 0; value < layer->value_count; value++) {
        if (!kernel_values_straddle(c->values, c->vertex_count, layer->values[value])) continue;
        const bool is_fresh = !c->is_transformed;
        if (is_fresh) {
            kernel_polyhedron_transform(c, p);
            if (layer->colour_map)
                c->g[c->vertex_count] =
                    (float)kernel_read_colour_values(s, part, c->index, c->vertices, c->vertex_count, c->g);
        }
        if (is_fresh || layer->value_count > 1)
            c->scale = kernel_values_subtract_isovalue(c->values, c->vertex_count + 1, layer->values[value], c->f);
        kernel_polyhedron_surface(p, s, c, value, rays);
    }
}

#endif
