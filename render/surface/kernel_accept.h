/* Processes the hits of rays on isosurfaces: discards hits that clips remove, computes normals and colours, and keeps
 * each ray's nearest hit (thesis, sections 4.3.4 and 4.3.5). Terms of this file and of those that include it:
 *     hit           crossing of a ray with an isosurface; it is accepted if clips keep it and no nearer hit hides it
 *     depth t       a hit's position on its ray: z in tile space, in scaled units (render_space); 0 at depth_origin
 *     kind          number that a fragment has for its isovalue: the surface's first_kind plus the isovalue's index
 *     tied hit      hit of an opaque surface with exactly the same depth as the nearest hit of its ray
 *     reach         distance from a hit to the points at which central differences sample the field, in scaled units
 *     pending hit   hit whose normal needs samples of the field in other ranks' cells; it is lit after tracing
 */
#ifndef RENDER_KERNEL_ACCEPT_H
#define RENDER_KERNEL_ACCEPT_H

#include <math.h>

#include "grid.h"
#include "kernel_cell.h"
#include "kernel_clip.h"
#include "kernel_colour.h"
#include "kernel_hits.h"
#include "kernel_lines.h"
#include "kernel_map.h"
#include "kernel_packet.h"
#include "kernel_types.h"
#include "render.h"
#include "simd.h"

/* Normals from gradients at the vertices (RENDER_VERTEX). The gradient's three components are interpolated in the hit's
 * cell like values. The interpolated gradient is continuous from cell to cell, and so is the surface's lighting.
 *
 * Normals from vertices are computed for visible hits only. While a nearer hit may still be found, a hit stores its
 * cell and, in place of the normal, its reference coordinates in that cell. When all cells have been traced, the rays
 * are processed one by one, and consecutive rays that hit the same cell share the coefficients by which gradients are
 * interpolated in it. */

/* Reads the gradient that the job gives at a vertex (render_vertex_gradients), and rotates it into camera axes. It is 0
 * if the job gives none there. */
SIMD_INLINE void kernel_vertex_gradient(const kernel_frame *f, const render_vertex_gradients *gradients, int64_t vertex,
                                        double out[3])
{
    const double *axes[3] = {f->job->camera.right, f->job->camera.up, f->job->camera.forward};
    const int32_t entry = gradients->entries ? gradients->entries[vertex] : -1;
    for (int k = 0; k < 3; k++) {
        const float *g = gradients->gradients[entry < 0 ? 0 : entry];
        out[k] = entry < 0 ? 0 : ((double)g[0] * axes[k][0] + (double)g[1] * axes[k][1]) + (double)g[2] * axes[k][2];
    }
}

/* Reads a cell and transforms it into tile space. Stores component k of the gradient, in camera axes, in gradient[k]:
 * in a tet the component's values at the vertices, in other cells the coefficients of the polynomial that interpolates
 * these values in reference coordinates. */
static void kernel_fetch_gradient_polynomials(const kernel_packet *p, const render_surface_layer *layer, int part,
                                              uint32_t index, kernel_cell *c,
                                              double gradient[3][GRID_MAX_CELL_VERTICES])
{
    const grid *g = p->frame->job->parts[part].cells;
    c->part = part;
    kernel_cell_fetch(c, g, &layer->field.fields[part], index);
    kernel_cell_transform_in_tile(c, p->frame, p->tile, g);
    for (int i = 0; i < c->count; i++) {
        double own[3];
        kernel_vertex_gradient(p->frame, &layer->gradients[part], c->vertices[i], own);
        for (int k = 0; k < 3; k++) gradient[k][i] = own[k];
    }
    for (int k = 0; k < 3 && !kernel_is_linear(c->type); k++) {
        double polynomial[8];
        kernel_polynomial_fit(polynomial, c->type, gradient[k]);
        memcpy(gradient[k], polynomial, sizeof polynomial);
    }
}

/* Computes a point's barycentric coordinates in a tet. Each of the four that is outside [-1, 2], which occurs only if
 * the point is far outside the tet or the tet has no volume, is replaced by 1/4. */
SIMD_INLINE void kernel_compute_barycentric(const double corner[4][3], const double point[3], double out[4])
{
    double d[4][3], sum = 0;
    for (int i = 0; i < 4; i++)
        for (int a = 0; a < 3; a++) d[i][a] = corner[i][a] - point[a];
    for (int i = 0; i < 4; i++) {
        const double *u = d[(i + 1) & 3], *v = d[(i + 2) & 3], *w = d[(i + 3) & 3];
        const double volume = (u[0] * (v[1] * w[2] - v[2] * w[1]) + u[1] * (v[2] * w[0] - v[0] * w[2])) +
                              u[2] * (v[0] * w[1] - v[1] * w[0]);
        /* rotating four corners by one position is an odd permutation, which changes the sign of the volume */
        out[i] = i & 1 ? -volume : volume;
        sum += out[i];
    }
    for (int i = 0; i < 4; i++) {
        const double share = out[i] / sum;
        out[i] = share >= -1 && share <= 2 ? share : 0.25;
    }
}

/* Returns the value of the polynomial with the coefficients c at the reference coordinates r, for one point in double;
 * kernel_polynomial_value() does the same for vectors. */
SIMD_INLINE double kernel_evaluate_polynomial_in_double(const double c[8], bool is_pyramid, const double r[3])
{
    double m = r[0] * r[1];
    if (is_pyramid) {
        const double share = r[0] / (r[2] > 1e-6 ? r[2] : 1e-6);
        m = (share < -1 ? -1 : share > 2 ? 2 : share) * r[1];
    }
    const double v = ((c[0] + r[0] * c[1]) + (r[1] * c[2] + r[2] * c[3])) + m * c[4];
    return is_pyramid ? v : v + r[2] * ((r[0] * c[5] + r[1] * c[6]) + m * c[7]);
}

/* Computes the gradient at a point by interpolation, in camera axes. gradient: computed by
 * kernel_fetch_gradient_polynomials(); place: the point's reference coordinates or, in a tet, its position in tile
 * space. */
SIMD_INLINE void kernel_interpolate_gradient(const kernel_cell *c, double (*const gradient)[GRID_MAX_CELL_VERTICES],
                                             const double place[3], float out[3])
{
    if (!kernel_is_linear(c->type)) {
        for (int k = 0; k < 3; k++)
            out[k] = (float)kernel_evaluate_polynomial_in_double(gradient[k], kernel_has_apex(c->type), place);
        return;
    }
    double corner[4][3], share[4];
    for (int i = 0; i < 4; i++) {
        corner[i][0] = (double)c->x[i];
        corner[i][1] = (double)c->y[i];
        corner[i][2] = (double)c->z[i];
    }
    kernel_compute_barycentric(corner, place, share);
    for (int k = 0; k < 3; k++) {
        const double *g = gradient[k];
        out[k] = (float)((share[0] * g[0] + share[1] * g[1]) + (share[2] * g[2] + share[3] * g[3]));
    }
}

/* Computes the point at depth t on the ray in lane `ray` of the packet, in tile space. */
SIMD_INLINE void kernel_ray_point(const kernel_packet *p, int ray, float t, double out[3])
{
    out[0] = (double)p->origin_x[ray] + (double)p->slope_x[ray] * (double)t;
    out[1] = (double)p->origin_y[ray] + (double)p->slope_y[ray] * (double)t;
    out[2] = (double)t;
}

/* Computes the normals of the given rays' hits, in camera axes, and stores them in `normal`, which holds the hits'
 * reference coordinates before. t, parts, cells: depth, mesh part and cell of each hit. A hit whose mesh part is -1 (a
 * hit in a polyhedron) already has its normal. */
static __attribute__((noinline)) void kernel_vertex_normals(const kernel_packet *p, const kernel_surface *s, vm rays,
                                                            vf t, vi parts, vi cells, vf normal[3])
{
    kernel_cell known;
    double gradient[3][GRID_MAX_CELL_VERTICES];
    known.part = -1;
    for (unsigned left = vm_bits(rays); left; left &= left - 1) {
        const int ray = __builtin_ctz(left);
        const int part = parts[ray];
        const uint32_t index = (uint32_t)cells[ray];
        double place[3];
        float out[3];
        if (part < 0) continue;
        if (known.part != part || known.index != index)
            kernel_fetch_gradient_polynomials(p, s->layer, part, index, &known, gradient);
        if (kernel_is_linear(known.type))
            kernel_ray_point(p, ray, t[ray], place);
        else
            for (int a = 0; a < 3; a++) place[a] = (double)normal[a][ray];
        kernel_interpolate_gradient(&known, gradient, place, out);
        for (int a = 0; a < 3; a++) normal[a][ray] = out[a];
    }
}

/* Returns whether the surface is opaque: the opaque ones come first in kernel_frame.surfaces. */
SIMD_INLINE bool kernel_is_opaque(const kernel_packet *p, const kernel_surface *s)
{
    return s < p->frame->surfaces + p->frame->opaque_count;
}

/* Transforms a gradient from tile space, which is sheared along the tile's middle ray, to camera axes. */
SIMD_INLINE void kernel_gradient_to_camera_axes(const kernel_tile *tile, vf g[3])
{
    g[2] -= g[0] * tile->shear_x + g[1] * tile->shear_y;
}

/* Computes the unit normals of hits in world axes. Like those that kernel_shade() uses, they point to the eye's side of
 * the surface. normal: vectors of any length along the normals, in camera axes. */
SIMD_INLINE void kernel_world_normal(const kernel_packet *p, const vf normal[3], vf out[3])
{
    const render_camera *c = &p->frame->job->camera;
    vf unit[3];
    kernel_facing_normal(p, normal, unit);
    for (int a = 0; a < 3; a++)
        out[a] = (unit[0] * (float)c->right[a] + unit[1] * (float)c->up[a]) + unit[2] * (float)c->forward[a];
}

/* Stores numbers in place of the hits' colours. RENDER_NORMALS: the unit normal in world axes. RENDER_VALUES: the first
 * component already holds the hit's value; the second becomes the index of the isovalue among all isovalues of the
 * frame. */
static __attribute__((noinline, cold)) void kernel_store_numbers_as_colours(const kernel_packet *p, const vf normal[3],
                                                                            vf kind, vf colour[3])
{
    if (p->frame->job->paint == RENDER_VALUES) {
        colour[1] = kind - (float)FRAGMENT_SURFACE;
        colour[2] = vf_set(0);
        return;
    }
    kernel_world_normal(p, normal, colour);
}

/* For hits that are lit later (RENDER_UNLIT), stores the unit normals in the fragments' members t_out and
 * transmittance. For that, a normal is projected to the octahedron |x| + |y| + |z| = 1, whose lower half is folded over
 * the upper one (Meyer et al. 2010). */
static __attribute__((noinline)) void kernel_store_normals_of_unlit_hits(const kernel_packet *p, const vf normal[3],
                                                                         kernel_fragments *f)
{
    vf n[3];
    kernel_world_normal(p, normal, n);
    const vf one = vf_set(1), zero = vf_set(0), inverse = 1.0f / ((vf_abs(n[0]) + vf_abs(n[1])) + vf_abs(n[2]));
    const vf u = n[0] * inverse, v = n[1] * inverse;
    const vf side_u = vf_select(vf_lt(u, zero), -one, one), side_v = vf_select(vf_lt(v, zero), -one, one);
    const vm is_below = vf_lt(n[2], zero);
    f->t_out = vf_select(is_below, (1.0f - vf_abs(v)) * side_u, u);
    f->transmittance = vf_select(is_below, (1.0f - vf_abs(u)) * side_v, v);
}

/* Computes the fragments' colours as the job's `paint` requests: lit, unlit together with the normal, or numbers in
 * place of colours. kind: the fragments' kind, as a float. A surface whose material takes no light gets its final
 * colour here even if the job's surfaces are lit later (RENDER_UNLIT). */
SIMD_INLINE void kernel_compute_fragment_colours(kernel_packet *p, const kernel_surface *s, const vf normal[3], vf kind,
                                                 kernel_fragments *f)
{
    const render_paint paint = p->frame->job->paint;
    kernel_packet_set_view(p);
    if (__builtin_expect(paint == RENDER_LIGHT, 1) ||
        (paint == RENDER_UNLIT && !render_takes_light(&s->layer->material)))
        kernel_shade(p, &s->layer->material, normal, f->colour);
    else if (paint == RENDER_UNLIT)
        kernel_store_normals_of_unlit_hits(p, normal, f);
    else
        kernel_store_numbers_as_colours(p, normal, kind, f->colour);
}

/* Hits on a surface, one ray per lane. All cells that are hit are of one mesh part. */
typedef struct kernel_surface_hits {
    vi value; /* index of each hit's isovalue in the layer */
    vf t;     /* depth of each hit, in scaled units */
    /* a vector of any length along the normal, in camera axes; or, until kernel_vertex_normals() replaces them, the
     * reference coordinates of the hits */
    vf normal[3];
    vf colour[3];                   /* colour before lighting, linear RGB */
    vf w;                           /* value of the colour field, in its transfer function's domain */
    const kernel_line_field *along; /* the field of contour lines at the hits; NULL if the surface has no such lines */
    /* distance to the samples of central differences, in scaled units; 0: the hit needs no samples */
    vf reach;
    vf opacity;    /* opacity, used only by transparent surfaces */
    vi part, cell; /* the cells that are hit, as in kernel_hits */
    /* The vertices of the cells that are hit. vertices: x, y and z in tile space (elements 0 to 2), and the field minus
     * the isovalue, times a power of two (element 3), each by vertex and lane. lane: the lane that holds each ray's
     * cell. vertex_count: number of vertices of a cell; 0 for polyhedra, for which `vertices` is not set. */
    int vertex_count;
    vi lane;
    const float (*vertices[4])[SIMD_WIDTH];
} kernel_surface_hits;

/* Returns the hits' fragment kinds (numbers that stand for isovalues, fragment.h) as floats. */
SIMD_INLINE vf kernel_hit_kinds(const kernel_surface *s, const kernel_surface_hits *h)
{
    return vf_from_vi(h->value + (int)s->first_kind);
}

/* Emits each tied hit (a hit with the same depth as its ray's nearest hit) as a fragment of its own. Tied hits occur if
 * a cell's map from reference coordinates is folded (not one-to-one). Compositing compares the bits of fragments of
 * equal depth to select one of them, so that the order of cells does not matter. */
static __attribute__((noinline, cold)) void kernel_emit_hits_of_equal_depth(kernel_packet *p, const kernel_surface *s,
                                                                            vm tied, const kernel_surface_hits *h)
{
    const vf kind = kernel_hit_kinds(s, h);
    kernel_fragments lit = {h->t, h->t, {h->colour[0], h->colour[1], h->colour[2]}, vf_set(0), kind};
    kernel_compute_fragment_colours(p, s, h->normal, kind, &lit);
    kernel_append_fragments(p, tied, 0, &lit);
}

/* Adds the hits with a reach above 0, whose normals need samples of other ranks' cells, to the thread's list of pending
 * hits, and emits a placeholder fragment for each, so that volumes end there. Returns the remaining hits: those with a
 * reach of 0, which need no samples. */
static __attribute__((noinline, cold)) vm kernel_defer_hits(kernel_packet *p, const kernel_surface *s, vm hit,
                                                            const kernel_surface_hits *h)
{
    const vf *normal = h->normal, *colour = h->colour, kind = kernel_hit_kinds(s, h);
    render_pending_list *list = &p->thread->waiting;
    const vm waits = vm_and(hit, vf_lt(vf_set(0), h->reach));
    if (list->capacity - list->count < SIMD_WIDTH && !render_grow_pending(list)) {
        p->thread->out_of_memory = true;
        return vm_none();
    }
    const kernel_fragments place = {
        h->t, h->t, {colour[0], colour[1], colour[2]}, vf_set(RENDER_PENDING_TRANSMITTANCE), kind};
    kernel_append_fragments(p, waits, 0, &place);
    for (unsigned left = vm_bits(waits); left; left &= left - 1) {
        const int i = __builtin_ctz(left);
        list->items[list->count] = (render_pending_hit){p->pixel[i], (uint32_t)kind[i], h->t[i], h->reach[i]};
        for (int a = 0; a < 3; a++) {
            list->shadings[list->count][0][a] = normal[a][i];
            list->shadings[list->count][1][a] = colour[a][i];
        }
        list->count++;
    }
    return vm_andnot(hit, waits);
}

/* Returns the value of the field that colours the surface, in that field's units. If there is no colour field, returns
 * the isovalue. w: the value in the domain of the colour field's transfer function; value: index of the isovalue. */
SIMD_INLINE vf kernel_compute_displayed_value(const kernel_surface *s, vi value, vf w)
{
    vf isovalue;
    if (s->layer->colour_map) return w * (float)(1 / s->colour.inverse_width) + (float)s->colour.low;
    for (int i = 0; i < SIMD_WIDTH; i++) isovalue[i] = (float)s->layer->values[value[i]];
    return isovalue;
}

/* Returns the rays on which the field minus the isovalue has different signs at the two ends of the interval. */
SIMD_INLINE vm kernel_interval_changes_sign(const kernel_interval *i)
{
    return vm_xor(vf_lt(i->v_in, vf_set(0)), vf_lt(i->v_out, vf_set(0)));
}

/* Returns the rays whose interval in the cell may have visible hits: it begins in front of the ray's nearest hit and
 * ends in front of the eye. */
SIMD_INLINE vm kernel_interval_overlaps_ray(const kernel_packet *p, const kernel_interval *i)
{
    return vm_and(i->mask, vm_and(vf_le(i->t_in, p->t_far), vf_le(p->t_near, i->t_out)));
}

/* Returns those of the hits at depth t that all of the given clips keep. clips: one bit per clip of the job. */
static __attribute__((noinline, cold)) vm kernel_hits_kept_by_clips(const kernel_packet *p, uint32_t clips, vm hit,
                                                                    vf t)
{
    double px[SIMD_WIDTH], py[SIMD_WIDTH];
    unsigned kept = 0;
    kernel_packet_compute_pixel_slopes(p, px, py);
    for (unsigned left = vm_bits(hit); left; left &= left - 1) {
        const int i = __builtin_ctz(left);
        kernel_clip_ray ray;
        kernel_compute_scaled_world_ray(p->frame, px[i], py[i], ray.base, ray.direction);
        kept |= (unsigned)kernel_clips_keep_ray_point(p->frame->job, clips, &ray, (double)t[i]) << i;
    }
    return vm_from_bits(kept);
}

/* Returns those of the hits at depth t that are in front of the eye and that the surface's own clips keep. */
SIMD_INLINE vm kernel_unclipped_hits(const kernel_packet *p, const kernel_surface *s, vm hit, vf t)
{
    const vm in_front = vm_and(hit, vf_le(p->t_near, t));
    if (__builtin_expect(s->own_clips == 0, 1)) return in_front;
    return kernel_hits_kept_by_clips(p, s->own_clips, in_front, t);
}

/* Returns those of the hits at depth t that are in front of the eye and not behind the rays' nearest hits, and that the
 * surface's own clips keep. */
SIMD_INLINE vm kernel_visible_hits(const kernel_packet *p, const kernel_surface *s, vm hit, vf t)
{
    return kernel_unclipped_hits(p, s, vm_and(hit, vf_le(t, p->t_far)), t);
}

#endif
