/* Intersects rays with a polyhedron (render_polyhedra.h): computes its intervals inside, and the field along them.
 *
 * The polyhedron's surface consists of triangles, called facets. Rays are intersected with them as with the faces of
 * other cells (kernel_cell.h): edge functions are computed once per edge, and from these the crossings of triangles.
 * The sorted crossings form pairs, between which the ray is inside. The number of intervals is not limited.
 *
 * The cell is divided into tets, each of which connects a surface triangle to the centre, the mean of the vertices. The
 * field is linear in each tet. Neighbouring tets share a triangle that connects an edge to the centre, called a sheet.
 * Along the ray the field is continuous and piecewise linear, and its slope changes only at sheets. So the field in an
 * interval is given by its values at the interval's ends and at the crossed sheets between them, sorted by depth.
 * Functions call this piecewise linear function of t a profile:
 *
 *      v |        .sheet
 *        |      .'      '.        .exit
 *        |   .'           sheet.'
 *        | in
 *        +---t_in--------------------t_out---> t
 *
 * If the cell is star-shaped from its centre, the tets fill it exactly once, and the field at a sheet is the sheet's
 * own value. Otherwise tets overlap, and extend out of the cell. The field at a point is then the sum of the fields of
 * all tets that contain the point, each multiplied by the tet's sign (render_polyhedra.h). (A point inside the cell is
 * contained in one more positive than negative tet. If the two tets of a sheet are on different sides of it, the ray
 * leaves one and enters the other, and the sum does not jump. If both are on one side, they have opposite signs, and
 * the ray enters or leaves both: the sum changes by f - f = 0.) The sum is computed at the crossings of sheets; a tet
 * contains such a point if its t is in the ray's interval [t_in, t_out) inside the tet.
 *
 * On which side of an isovalue a ray enters and leaves is decided by the values on the faces themselves
 * (kernel_surface.h). These are linear on triangles, bilinear on quads, as in a hex on the other side, and linear on
 * the triangles of larger faces. In a cell that is not star-shaped, the field just inside may be on the other side of
 * the isovalue than the value on the face. The field then jumps at the face, and the isosurface lies in the face. */
#ifndef RENDER_KERNEL_POLYHEDRON_H
#define RENDER_KERNEL_POLYHEDRON_H

#include <math.h>
#include <string.h>

#include "kernel_cell.h"
#include "kernel_crossings.h"
#include "kernel_packet.h"
#include "kernel_quad.h"
#include "render_polyhedra.h"
#include "simd.h"

/* Crossings of rays with a triangle of a polyhedron. t: depth; v: value of the field; w: value of the colour field; all
 * three are interpolated linearly on the triangle. If the triangle is on the polyhedron's surface, t_face, v_face and
 * w_face are the same quantities on the face of which it is a part; if this face is a quad, its surface is a bilinear
 * patch. If the triangle is a sheet (between an edge and the centre), v_face and w_face are the values of the cell's
 * field and colour field at the crossing. */
typedef struct kernel_triangle_crossings {
    vm mask;
    vf t, v, w;
    vf t_face, v_face, w_face;
} kernel_triangle_crossings;

/* The crossings of a packet's rays with one polyhedron. The arrays are in the thread's scratch memory
 * (polyhedra_scratch()). */
typedef struct kernel_poly_crossings {
    const kernel_packet *packet;
    const polyhedron *cell;
    vm rays;         /* rays for which crossings are computed */
    bool has_colour; /* whether colour values w are computed too */
    vf *x, *y;       /* x and y, relative to the rays, of the vertices, then of the centre, projected along the rays */
    vf *edge;        /* edge functions of the edges, then of the edges from each vertex to the centre */
    /* crossings of surface triangles, by the index of the triangle; only those of triangles that are listed in `met`
     * are set */
    kernel_triangle_crossings *facets;
    vm *unassigned; /* for each surface triangle, the rays whose crossing has not been assigned to an interval yet */
    /* rays that cross both triangles of a quad but do not cross its bilinear patch, or cross the patch twice but
     * neither triangle */
    vm uneven;
    int *met; /* indices of the surface triangles that some ray crosses, or whose quad's patch it crosses */
    int met_count;
    /* crossings of sheets (the triangles between an edge and the centre), by the index of the edge; only those listed
     * in met_sheets are set */
    kernel_triangle_crossings *sheets;
    int *met_sheets;
    int sheet_count;
    /* for each surface triangle, the intervals of the rays in the tet between it and the centre */
    kernel_interval *tets;
    bool has_sheets, has_tets;
    /* interval: the current interval of each ray inside the cell (kernel_poly_find_next_interval()), with the values on
     * the faces; in, out: the crossings at its ends; u_in, u_out: the field just inside the ends */
    kernel_interval interval;
    kernel_triangle_crossings in, out;
    vf u_in, u_out;
} kernel_poly_crossings;

SIMD_INLINE void *kernel_scratch_alloc(char **at, size_t bytes)
{
    void *p = *at;
    *at += (bytes + 63) & ~(size_t)63;
    return p;
}

/* Allocates the arrays for the cell's crossings in the thread's scratch memory. Returns false if there is no memory. */
static bool kernel_poly_allocate(const kernel_packet *p, const polyhedron *c, kernel_poly_crossings *out)
{
    const size_t points = (size_t)c->vertex_count + 1, edges = (size_t)c->edge_count, facets = (size_t)c->facet_count;
    const size_t pieces = 11, spare = 64 * pieces;
    const size_t bytes =
        points * 2 * sizeof(vf) + (edges + points) * (sizeof(vf) + sizeof(int)) +
        facets * (sizeof(kernel_triangle_crossings) + sizeof(vm) + sizeof(int) + sizeof(kernel_interval)) +
        edges * sizeof(kernel_triangle_crossings) + spare;
    char *at = polyhedra_scratch(p->thread->polyhedra, bytes);
    if (!at) {
        p->thread->out_of_memory = true;
        return false;
    }
    out->packet = p;
    out->cell = c;
    out->x = kernel_scratch_alloc(&at, points * sizeof(vf));
    out->y = kernel_scratch_alloc(&at, points * sizeof(vf));
    out->edge = kernel_scratch_alloc(&at, (edges + points) * sizeof(vf));
    out->facets = kernel_scratch_alloc(&at, facets * sizeof(kernel_triangle_crossings));
    out->unassigned = kernel_scratch_alloc(&at, facets * sizeof(vm));
    out->met = kernel_scratch_alloc(&at, facets * sizeof(int));
    out->sheets = kernel_scratch_alloc(&at, edges * sizeof(kernel_triangle_crossings));
    out->met_sheets = kernel_scratch_alloc(&at, edges * sizeof(int));
    out->tets = kernel_scratch_alloc(&at, facets * sizeof(kernel_interval));
    out->met_count = out->sheet_count = 0;
    out->has_sheets = out->has_tets = false;
    out->uneven = vm_none();
    return true;
}

SIMD_INLINE kernel_tile_position kernel_polyhedron_position(const polyhedron *c, int i)
{
    return (kernel_tile_position){c->x[i], c->y[i], c->z[i]};
}

SIMD_INLINE kernel_edge_error kernel_polyhedron_compute_line(polyhedron *c, const kernel_packet *p, int n, int a, int b)
{
    const kernel_line line =
        kernel_line_in_packet(p, kernel_polyhedron_position(c, a), kernel_polyhedron_position(c, b));
    memcpy(c->lines[n], &line, sizeof line);
    return kernel_compute_edge_error(&line, p->tile->radius, kernel_polyhedron_position(c, a),
                                     kernel_polyhedron_position(c, b));
}

/* Returns the polyhedron with the values of a layer's field; NULL if a value is not finite, or if memory ran out. */
SIMD_INLINE polyhedron *kernel_polyhedron_find(kernel_packet *p, const grid_field *field, int part, int layer,
                                               uint32_t index)
{
    kernel_thread *thread = p->thread;
    polyhedron *c = polyhedra_find(thread->polyhedra, p->frame->job->parts[part].cells, field, part, layer, index);
    if (!c) thread->out_of_memory = true;
    return c && c->is_finite ? c : NULL;
}

SIMD_INLINE void kernel_polyhedron_transform(polyhedron *c, const kernel_packet *p)
{
    for (int i = 0; i <= c->vertex_count; i++) kernel_transform(p, c->world[i], &c->x[i], &c->y[i], &c->z[i]);
    c->is_transformed = true;
    if (!p->is_pencil) return;
    kernel_edge_error most = {0, 0};
    for (int i = 0; i < c->edge_count; i++)
        most = kernel_edge_error_max(most, kernel_polyhedron_compute_line(c, p, i, c->edges[i][0], c->edges[i][1]));
    for (int i = 0; i < c->vertex_count; i++)
        most = kernel_edge_error_max(most, kernel_polyhedron_compute_line(c, p, c->edge_count + i, i, c->vertex_count));
    c->least = kernel_bound_least_weight_sum(most);
}

/* ---- crossings of the surface ---- */

SIMD_INLINE void kernel_triangle_values_at(const polyhedron *c, const kernel_weights *w, bool has_colour,
                                           kernel_triangle_crossings *out)
{
    out->t = kernel_weighted_depth(w, c->z);
    out->v = kernel_weighted_sum(w, c->f[w->i], c->f[w->j], c->f[w->k]);
    out->w = has_colour ? kernel_weighted_sum(w, c->g[w->i], c->g[w->j], c->g[w->k]) : vf_set(0);
    out->t_face = out->t;
    out->v_face = out->v;
    out->w_face = out->w;
}

SIMD_INLINE void kernel_poly_compute_edge_function(kernel_poly_crossings *r, int number, int a, int b)
{
    const polyhedron *c = r->cell;
    kernel_line line;
    memcpy(&line, c->lines[number], sizeof line);
    r->edge[number] = kernel_edge_function_on_rays(r->packet, &line, kernel_polyhedron_position(c, a),
                                                   kernel_polyhedron_position(c, b));
}

SIMD_INLINE void kernel_poly_recompute_weights(const kernel_poly_crossings *r, vm hit, kernel_weights *w)
{
    const polyhedron *c = r->cell;
    kernel_weights_recompute(r->packet, c->least, hit, kernel_polyhedron_position(c, w->i),
                             kernel_polyhedron_position(c, w->j), kernel_polyhedron_position(c, w->k), w);
}

/* Computes the crossings of a surface triangle and returns the rays that have one. *w becomes the weights that are
 * computed from the stored edge functions (r->edge). On rays on which these weights are not accurate enough, the
 * crossings are computed with weights from the projected vertices, but *w is not changed. */
static vm kernel_poly_cross_facet(const kernel_poly_crossings *r, const polyhedron_facet *t, kernel_weights *w,
                                  kernel_triangle_crossings *out)
{
    const vf ij = r->edge[t->edge[0]], jk = r->edge[t->edge[1]], ik = r->edge[t->edge[2]];
    out->mask = kernel_rays_inside_triangle(r->rays, ij, jk, ik);
    if (!vm_any(out->mask)) return out->mask;
    *w = kernel_weights_of(t->vertex[0], t->vertex[1], t->vertex[2], ij, jk, ik);
    kernel_weights mended = *w;
    kernel_poly_recompute_weights(r, out->mask, &mended);
    kernel_triangle_values_at(r->cell, &mended, r->has_colour, out);
    return out->mask;
}

/* Returns the edge function of the triangle's edge from vertex `from` to vertex `to`. Edge functions are stored for the
 * direction from the lower to the higher vertex index. For the opposite direction the stored one is negated. */
SIMD_INLINE vf kernel_facet_edge_function(const polyhedron_facet *t, const kernel_poly_crossings *r, int from, int to)
{
    const int low = from < to ? from : to, high = from < to ? to : from;
    const int n = low != t->vertex[0] ? 1 : high == t->vertex[1] ? 0 : 2;
    return from < to ? r->edge[t->edge[n]] : -r->edge[t->edge[n]];
}

SIMD_INLINE bool kernel_facet_has(const polyhedron_facet *t, int vertex)
{
    return t->vertex[0] == vertex || t->vertex[1] == vertex || t->vertex[2] == vertex;
}

SIMD_INLINE void kernel_quad_of_facets(const kernel_poly_crossings *r, const polyhedron_facet *const t[2],
                                       const int corner[4], kernel_quad *out)
{
    for (int i = 0; i < 4; i++) {
        out->x[i] = r->x[corner[i]];
        out->y[i] = r->y[corner[i]];
        out->z[i] = vf_set(r->cell->z[corner[i]]);
    }
    out->e01 = kernel_facet_edge_function(t[0], r, corner[0], corner[1]);
    out->e12 = kernel_facet_edge_function(t[0], r, corner[1], corner[2]);
    out->e03 = kernel_facet_edge_function(t[1], r, corner[0], corner[3]);
    out->e32 = kernel_facet_edge_function(t[1], r, corner[3], corner[2]);
}

/* Sets t_face, v_face and w_face of the crossings *m of a surface triangle, for the rays in `mine`. at: the crossings
 * of these rays with the bilinear patch of the quad of which the triangle is one half. For those of the rays that do
 * not cross the triangle itself, t, v and w are set to the same numbers. */
SIMD_INLINE void kernel_facet_set_point_of_face(const polyhedron *c, const int corner[4], const kernel_point *at,
                                                vm mine, bool has_colour, kernel_triangle_crossings *m)
{
    vf f[4], g[4];
    for (int i = 0; i < 4; i++) f[i] = vf_set(c->f[corner[i]]), g[i] = vf_set(has_colour ? c->g[corner[i]] : 0);
    m->t_face = vf_select(mine, at->t, m->t_face);
    m->v_face = vf_select(mine, kernel_bilinear(f, at->r[0], at->r[1]), m->v_face);
    m->w_face = has_colour ? vf_select(mine, kernel_bilinear(g, at->r[0], at->r[1]), m->w_face) : vf_set(0);
    const vm apart = vm_andnot(mine, m->mask);
    m->t = vf_select(apart, m->t_face, m->t);
    m->v = vf_select(apart, m->v_face, m->v);
    m->w = vf_select(apart, m->w_face, m->w);
}

/* Orders the two points of rays that cross a quad's patch twice and also both of its triangles m[0] and m[1]: places[n]
 * becomes the point that belongs to m[n], which is the nearer point for the triangle that is crossed first. */
static __attribute__((noinline, cold)) void kernel_match_quad_points_to_triangles(kernel_triangle_crossings *const m[2],
                                                                                  kernel_point places[2])
{
    const vm both = vm_and(places[1].mask, vm_and(m[0]->mask, m[1]->mask));
    const vm swap = vm_and(both, vm_xor(vf_lt(places[0].t, places[1].t), vf_lt(m[0]->t, m[1]->t)));
    const kernel_point own = places[0];
    kernel_point_copy_lanes(swap, &places[1], &places[0]);
    kernel_point_copy_lanes(swap, &own, &places[1]);
}

/* Computes the crossings of a quad's bilinear patch and of its two triangles; those of the patch are bit-identical to
 * the crossings in a hex that shares the quad. first: index of the first of the two triangles. */
static void kernel_poly_cross_quad(kernel_poly_crossings *r, int first)
{
    static const signed char loop[4] = {0, 1, 2, 3};
    const polyhedron *c = r->cell;
    const int *around = c->quads[c->facets[first].quad];
    kernel_cell ranks;
    kernel_weights w;
    kernel_quad quad;
    kernel_point places[2];
    int corner[4];
    /* the polyhedron's vertices are numbered in the order of coordinates, so that a vertex's number is its rank */
    for (int i = 0; i < 4; i++) ranks.rank[i] = around[i];
    kernel_quad_corners(&ranks, loop, corner);
    for (int i = 0; i < 4; i++) corner[i] = around[corner[i]];
    const bool has_corner = kernel_facet_has(&c->facets[first], corner[1]);
    const int other_half = c->facets[first].other_half,
              half_of[2] = {has_corner ? first : other_half, has_corner ? other_half : first};
    const polyhedron_facet *t[2] = {&c->facets[half_of[0]], &c->facets[half_of[1]]};
    kernel_triangle_crossings *m[2] = {&r->facets[half_of[0]], &r->facets[half_of[1]]};
    for (int half = 0; half < 2; half++) kernel_poly_cross_facet(r, t[half], &w, m[half]);
    kernel_quad_of_facets(r, t, corner, &quad);
    const vm once = vm_xor(m[0]->mask, m[1]->mask);
    const vm twice = kernel_quad_sides_allow_two_points(r->rays, quad.e01, quad.e32, quad.e03, quad.e12);
    const int count = kernel_compute_quad_points(&quad, once, twice, places);
    if (count == 2) kernel_match_quad_points_to_triangles(m, places);
    r->uneven = vm_or(r->uneven, vm_xor(vm_and(m[0]->mask, m[1]->mask), count == 2 ? places[1].mask : vm_none()));
    for (int half = 0; half < 2; half++) {
        vm left = count ? vm_and(once, m[half]->mask) : vm_none();
        if (vm_any(left)) kernel_facet_set_point_of_face(c, corner, &places[0], left, r->has_colour, m[half]);
        if (count == 2) {
            kernel_facet_set_point_of_face(c, corner, &places[half], places[1].mask, r->has_colour, m[half]);
            left = vm_or(left, places[1].mask);
        }
        r->unassigned[half_of[half]] = left;
        if (vm_any(left)) r->met[r->met_count++] = half_of[half];
    }
}

/* Computes all crossings of the rays with the polyhedron's surface. Returns false if there are none. */
static bool kernel_poly_cross(kernel_poly_crossings *r, vm rays, bool has_colour)
{
    const polyhedron *c = r->cell;
    r->rays = rays;
    r->has_colour = has_colour;
    for (int i = 0; i <= c->vertex_count; i++) {
        r->x[i] = kernel_project_x(r->packet, kernel_polyhedron_position(c, i));
        r->y[i] = kernel_project_y(r->packet, kernel_polyhedron_position(c, i));
    }
    for (int i = 0; i < c->edge_count; i++) kernel_poly_compute_edge_function(r, i, c->edges[i][0], c->edges[i][1]);
    for (int i = 0; i < c->facet_count; i++) {
        kernel_weights w;
        if (c->facets[i].quad >= 0) {
            if (i < c->facets[i].other_half) kernel_poly_cross_quad(r, i);
            continue;
        }
        r->unassigned[i] = kernel_poly_cross_facet(r, &c->facets[i], &w, &r->facets[i]);
        if (vm_any(r->unassigned[i])) r->met[r->met_count++] = i;
    }
    return r->met_count > 0;
}

/* Removes each ray's nearest crossing, that with the least t_face, from the list of crossings that belong to no
 * interval yet, and stores it in *out. Returns false if this list has no crossing of any ray. */
SIMD_INLINE bool kernel_poly_take_nearest(kernel_poly_crossings *r, kernel_triangle_crossings *out)
{
    const vf zero = vf_set(0);
    vf taken = vf_set(-1);
    *out = (kernel_triangle_crossings){vm_none(), zero, zero, zero, vf_set(INFINITY), zero, zero};
    for (int n = 0; n < r->met_count; n++) {
        const kernel_triangle_crossings *m = &r->facets[r->met[n]];
        const vm nearer = vm_and(r->unassigned[r->met[n]], vf_lt(m->t_face, out->t_face));
        out->mask = vm_or(out->mask, nearer);
        out->t = vf_select(nearer, m->t, out->t);
        out->v = vf_select(nearer, m->v, out->v);
        out->w = vf_select(nearer, m->w, out->w);
        out->t_face = vf_select(nearer, m->t_face, out->t_face);
        out->v_face = vf_select(nearer, m->v_face, out->v_face);
        out->w_face = vf_select(nearer, m->w_face, out->w_face);
        taken = vf_select(nearer, vf_set((float)n), taken);
    }
    for (int n = 0; n < r->met_count; n++)
        r->unassigned[r->met[n]] = vm_andnot(r->unassigned[r->met[n]], vf_eq(taken, vf_set((float)n)));
    return vm_any(out->mask);
}

/* Computes the next interval of each ray inside the cell. Returns false after the last one. */
static bool kernel_poly_find_next_interval(kernel_poly_crossings *r)
{
    kernel_interval *i = &r->interval;
    if (!kernel_poly_take_nearest(r, &r->in) || !kernel_poly_take_nearest(r, &r->out)) return false;
    i->mask = vm_and(r->in.mask, r->out.mask);
    i->t_in = r->in.t_face;
    i->t_out = r->out.t_face;
    i->v_in = r->u_in = r->in.v_face;
    i->v_out = r->u_out = r->out.v_face;
    i->w_in = r->in.w_face;
    i->w_out = r->out.w_face;
    return true;
}

/* ---- the field inside the polyhedron ---- */

static void kernel_poly_cross_sheets(kernel_poly_crossings *r)
{
    const polyhedron *c = r->cell;
    const int centre = c->vertex_count, spokes = c->edge_count;
    if (r->has_sheets) return;
    r->has_sheets = true;
    for (int i = 0; i < centre; i++) kernel_poly_compute_edge_function(r, spokes + i, i, centre);
    for (int i = 0; i < c->edge_count; i++) {
        const int a = c->edges[i][0], b = c->edges[i][1];
        kernel_triangle_crossings *m = &r->sheets[i];
        m->mask = kernel_rays_inside_triangle(r->rays, r->edge[i], r->edge[spokes + b], r->edge[spokes + a]);
        if (!vm_any(m->mask)) continue;
        kernel_weights w = kernel_weights_of(a, b, centre, r->edge[i], r->edge[spokes + b], r->edge[spokes + a]);
        kernel_poly_recompute_weights(r, m->mask, &w);
        kernel_triangle_values_at(c, &w, r->has_colour, m);
        r->met_sheets[r->sheet_count++] = i;
    }
}

/* Extends the intervals *s of rays inside a tet, so that they contain the crossings *m of one of the tet's faces. hit:
 * the rays that cross this face. */
SIMD_INLINE void kernel_extend_tet_interval(kernel_interval *s, const kernel_triangle_crossings *m, vm hit)
{
    const vm first = vm_and(hit, vf_lt(m->t, s->t_in)), last = vm_andnot(hit, vf_lt(m->t, s->t_out));
    s->t_in = vf_select(first, m->t, s->t_in);
    s->v_in = vf_select(first, m->v, s->v_in);
    s->w_in = vf_select(first, m->w, s->w_in);
    s->t_out = vf_select(last, m->t, s->t_out);
    s->v_out = vf_select(last, m->v, s->v_out);
    s->w_out = vf_select(last, m->w, s->w_out);
    s->mask = vm_or(s->mask, hit);
}

/* Computes the intervals of the rays in all tets of the cell (r->tets). For tets without volume, no ray gets an
 * interval. */
static void kernel_poly_intersect_tets(kernel_poly_crossings *r)
{
    const polyhedron *c = r->cell;
    if (r->has_tets) return;
    r->has_tets = true;
    for (int i = 0; i < c->facet_count; i++) {
        const polyhedron_facet *t = &c->facets[i];
        kernel_interval *s = &r->tets[i];
        s->mask = vm_none();
        if (t->sign == 0) continue;
        s->t_in = vf_set(INFINITY);
        s->t_out = vf_set(-INFINITY);
        s->v_in = s->v_out = s->w_in = s->w_out = vf_set(0);
        for (int k = 0; k < 3; k++)
            if (vm_any(r->sheets[t->edge[k]].mask))
                kernel_extend_tet_interval(s, &r->sheets[t->edge[k]], r->sheets[t->edge[k]].mask);
        /* a ray through the tet crosses at least one of the tet's three sheets; it may also cross the tet's fourth
         * face, the surface triangle */
        const vm hit =
            kernel_rays_inside_triangle(r->rays, r->edge[t->edge[0]], r->edge[t->edge[1]], r->edge[t->edge[2]]);
        if (vm_any(hit)) kernel_extend_tet_interval(s, &r->facets[i], hit);
    }
}

/* Returns the rays for which t is in the ray's interval inside the tet. The interval is [t_in, t_out), or (t_in, t_out]
 * if `before` is set. Callers set `before` if they need the limit of the field for depths that approach t from
 * below. */
SIMD_INLINE vm kernel_subtet_contains(const kernel_interval *s, vf t, bool before)
{
    if (before) return vm_and(s->mask, vm_and(vf_lt(s->t_in, t), vf_le(t, s->t_out)));
    return vm_and(s->mask, vm_and(vf_le(s->t_in, t), vf_lt(t, s->t_out)));
}

SIMD_INLINE vf kernel_subtet_interpolate_value(const kernel_interval *s, vf t, vf v_in, vf v_out)
{
    return v_in + (t - s->t_in) * ((v_out - v_in) / (s->t_out - s->t_in));
}

/* Computes the field *v and the colour field *w at depth t: sums over the tets that contain the ray's point of the
 * tet's field times its sign. The signs of these tets should sum to 1. By rounding they may not, because the ends of
 * neighbouring tets' intervals, which should be equal, are in the wrong order. Then the sum is computed at slightly
 * smaller and larger t; if that fails too, *v and *w are left unchanged. */
static void kernel_poly_sum_tet_fields(const kernel_poly_crossings *r, vm rays, vf t, bool before, vf *v, vf *w)
{
    static const float shifts[7] = {0, 1, -1, 4, -4, 16, -16};
    vm open = rays;
    for (int k = 0; k < 7 && vm_any(open); k++) {
        const vf at = t + (vf_abs(t) + 1.0f) * (shifts[k] * 2.4e-7f);
        vf cover = vf_set(0), sum = vf_set(0), colour = vf_set(0);
        for (int n = 0; n < r->cell->facet_count; n++) {
            const kernel_interval *s = &r->tets[n];
            if (!vm_any(s->mask)) continue;
            const vm in = vm_and(open, kernel_subtet_contains(s, at, before));
            if (!vm_any(in)) continue;
            const float sign = r->cell->facets[n].sign;
            cover = vf_select(in, cover + sign, cover);
            sum = vf_select(in, sum + sign * kernel_subtet_interpolate_value(s, at, s->v_in, s->v_out), sum);
            colour = vf_select(in, colour + sign * kernel_subtet_interpolate_value(s, at, s->w_in, s->w_out), colour);
        }
        const vm good = vm_and(open, vf_eq(cover, vf_set(1)));
        *v = vf_select(good, sum, *v);
        *w = vf_select(good, colour, *w);
        open = vm_andnot(open, good);
    }
}

/* Returns the rays whose crossing of a sheet lies in the current interval. The crossing must lie between the ray's
 * crossings of the two surface triangles at the interval's ends, and also between its crossings of the two faces of
 * which these triangles are parts. A sheet beyond the triangles belongs to a tet that extends out of the cell, and does
 * not affect the cell's field. */
SIMD_INLINE vm kernel_poly_is_sheet_in_interval(const kernel_poly_crossings *r, const kernel_triangle_crossings *sheet)
{
    const vm inside = vm_and(vf_lt(r->interval.t_in, sheet->t), vf_lt(sheet->t, r->interval.t_out));
    const vm within = vm_and(vf_lt(r->in.t, sheet->t), vf_lt(sheet->t, r->out.t));
    return vm_and(vm_and(r->interval.mask, sheet->mask), vm_and(inside, within));
}

/* Computes the field *u and the colour field *w just inside an end of the interval: the value on the face, plus the
 * signed sum of the fields of all tets other than the one whose surface triangle is crossed (end). before: set for the
 * far end. */
SIMD_INLINE void kernel_poly_compute_value_inside_end(const kernel_poly_crossings *r, vm rays,
                                                      const kernel_triangle_crossings *end, bool before, vf *u, vf *w)
{
    vf v_sum = end->v, w_sum = end->w;
    kernel_poly_sum_tet_fields(r, rays, end->t, before, &v_sum, &w_sum);
    *u = end->v_face + (v_sum - end->v);
    *w = end->w_face + (w_sum - end->w);
}

/* Computes the data from which kernel_find_next_linear_piece() returns the piecewise linear field along each ray in the
 * current interval: the field at the crossed sheets and just inside both ends. */
static void kernel_poly_prepare_piecewise_field(kernel_poly_crossings *r)
{
    kernel_interval *i = &r->interval;
    kernel_poly_cross_sheets(r);
    if (r->cell->is_star_shaped) return;
    kernel_poly_intersect_tets(r);
    kernel_poly_compute_value_inside_end(r, i->mask, &r->in, false, &r->u_in, &i->w_in);
    kernel_poly_compute_value_inside_end(r, i->mask, &r->out, true, &r->u_out, &i->w_out);
    for (int n = 0; n < r->sheet_count; n++) {
        kernel_triangle_crossings *sheet = &r->sheets[r->met_sheets[n]];
        const vm held = kernel_poly_is_sheet_in_interval(r, sheet);
        vf v = sheet->v, w = sheet->w;
        if (!vm_any(held)) continue;
        kernel_poly_sum_tet_fields(r, held, sheet->t, false, &v, &w);
        sheet->v_face = vf_select(held, v, sheet->v_face);
        sheet->w_face = vf_select(held, w, sheet->w_face);
    }
}

/* Sets *piece to an interval of length zero at the begin of each ray's current interval.
 * kernel_find_next_linear_piece() then returns the first linear piece of the field. */
SIMD_INLINE void kernel_begin_linear_pieces(const kernel_poly_crossings *r, kernel_interval *piece)
{
    const kernel_interval *i = &r->interval;
    piece->mask = i->mask;
    piece->t_in = piece->t_out = i->t_in;
    piece->v_in = piece->v_out = r->u_in;
    piece->w_in = piece->w_out = i->w_in;
}

/* Replaces *piece by the next linear piece of the field along each ray. v_out is the value at the end of the ray's
 * interval. */
SIMD_INLINE void kernel_find_next_linear_piece(const kernel_poly_crossings *r, vf v_out, kernel_interval *piece)
{
    vf t = r->interval.t_out, v = v_out, w = r->interval.w_out;
    for (int n = 0; n < r->sheet_count; n++) {
        const kernel_triangle_crossings *sheet = &r->sheets[r->met_sheets[n]];
        const vm nearer = vm_and(kernel_poly_is_sheet_in_interval(r, sheet),
                                 vm_and(vf_lt(piece->t_out, sheet->t), vf_lt(sheet->t, t)));
        t = vf_select(nearer, sheet->t, t);
        v = vf_select(nearer, sheet->v_face, v);
        w = vf_select(nearer, sheet->w_face, w);
    }
    piece->t_in = piece->t_out;
    piece->v_in = piece->v_out;
    piece->w_in = piece->w_out;
    piece->t_out = t;
    piece->v_out = v;
    piece->w_out = w;
}

/* Returns those of the given rays on which the field has further linear pieces behind the given one. */
SIMD_INLINE vm kernel_has_next_linear_piece(const kernel_poly_crossings *r, const kernel_interval *piece, vm mask)
{
    return vm_and(mask, vf_lt(piece->t_out, r->interval.t_out));
}

#endif
