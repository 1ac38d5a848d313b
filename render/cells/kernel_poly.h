/* Hexes, wedges and pyramids: cells with quads, which a ray may go into more than once (kernel_cell.h). */
#ifndef RENDER_KERNEL_POLY_H
#define RENDER_KERNEL_POLY_H

#include <math.h>
#include <string.h>

#include "grid.h"
#include "kernel_cell.h"
#include "kernel_line.h"
#include "kernel_packet.h"
#include "kernel_quad.h"
#include "kernel_tet.h"
#include "kernel_types.h"
#include "render_polyhedra.h"
#include "simd.h"

typedef struct kernel_shape {
    int edge_count;
    signed char edges[12][2];
    int face_count;
    struct {
        int count;
        signed char vertices[4];
    } faces[6];
    float corners[GRID_MAX_CELL_VERTICES][3]; /* the cell's own coordinates of its vertices */
} kernel_shape;

/* Corners of the pyramid are in the coordinates a = (1-q) r, b = (1-q) s, k = 1-q (see kernel_map.h). */
static const kernel_shape kernel_shapes[3] = {
    {12,
     {{0, 1}, {1, 2}, {2, 3}, {3, 0}, {4, 5}, {5, 6}, {6, 7}, {7, 4}, {0, 4}, {1, 5}, {2, 6}, {3, 7}},
     6,
     {{4, {0, 4, 7, 3}}, {4, {1, 2, 6, 5}}, {4, {0, 1, 5, 4}}, {4, {3, 7, 6, 2}}, {4, {0, 3, 2, 1}}, {4, {4, 5, 6, 7}}},
     {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}}},
    {9,
     {{0, 1}, {1, 2}, {2, 0}, {3, 4}, {4, 5}, {5, 3}, {0, 3}, {1, 4}, {2, 5}},
     5,
     {{3, {0, 1, 2, 0}}, {3, {3, 5, 4, 0}}, {4, {0, 3, 4, 1}}, {4, {1, 4, 5, 2}}, {4, {2, 5, 3, 0}}},
     {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {0, 1, 1}}},
    {8,
     {{0, 1}, {1, 2}, {2, 3}, {3, 0}, {0, 4}, {1, 4}, {2, 4}, {3, 4}},
     5,
     {{4, {0, 3, 2, 1}}, {3, {0, 1, 4, 0}}, {3, {1, 2, 4, 0}}, {3, {2, 3, 4, 0}}, {3, {3, 0, 4, 0}}},
     {{0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}, {0, 0, 0}}},
};

SIMD_INLINE const kernel_shape *kernel_cell_shape(int type)
{
    return &kernel_shapes[type == GRID_HEX ? 0 : type == GRID_WEDGE ? 1 : 2];
}

/* Edge functions by vertex pair: those of the shape and of the quads' diagonals. */
typedef struct kernel_edges {
    vf e[GRID_MAX_CELL_VERTICES][GRID_MAX_CELL_VERTICES]; /* [a][b] with a before b in the order */
} kernel_edges;

/* Number n of the cell's lines. */
SIMD_INLINE void kernel_poly_edge(const kernel_packet *p, const kernel_cell *c, int n, int i, int j, kernel_edges *out)
{
    const int a = c->rank[i] < c->rank[j] ? i : j, b = a == i ? j : i;
    out->e[a][b] = kernel_edge(p, &c->lines[n], kernel_cell_spot(c, a), kernel_cell_spot(c, b));
}

/* A quad's corners around, from the smallest vertex towards its smaller neighbour. */
SIMD_INLINE void kernel_quad_corners(const kernel_cell *c, const signed char *loop, int corner[4])
{
    int first = 0;
    for (int i = 1; i < 4; i++)
        if (c->rank[loop[i]] < c->rank[loop[first]]) first = i;
    const int ahead = loop[(first + 1) & 3], behind = loop[(first + 3) & 3];
    const bool forward = c->rank[ahead] < c->rank[behind];
    corner[0] = loop[first];
    corner[1] = forward ? ahead : behind;
    corner[2] = loop[(first + 2) & 3];
    corner[3] = forward ? behind : ahead;
}

SIMD_INLINE void kernel_poly_lines(kernel_cell *c, const kernel_frame *f, const kernel_tile *tile)
{
    const kernel_shape *shape = kernel_cell_shape(c->type);
    signed char ends[KERNEL_MAX_LINES][2];
    float size[GRID_MAX_CELL_VERTICES];
    const int count = shape->edge_count + shape->face_count;
    memset(ends, 0, sizeof ends);
    memcpy(ends, shape->edges, (size_t)shape->edge_count * sizeof ends[0]);
    for (int face = 0; face < shape->face_count; face++) {
        int corner[4];
        if (shape->faces[face].count == 3) continue;
        kernel_quad_corners(c, shape->faces[face].vertices, corner);
        ends[shape->edge_count + face][0] = (signed char)corner[0];
        ends[shape->edge_count + face][1] = (signed char)corner[2];
    }
    for (int i = 0; i < c->count; i++) size[i] = kernel_spot_size(f, tile, kernel_cell_spot(c, i));
    kernel_blur most = {0, 0};
    for (int n = 0; n < count; n++) {
        const int i = ends[n][0], j = ends[n][1], a = c->rank[i] < c->rank[j] ? i : j, b = a == i ? j : i;
        const kernel_spot from = kernel_cell_spot(c, a), to = kernel_cell_spot(c, b);
        c->lines[n] = kernel_line_between(f, from, to, size[a], size[b]);
        if (c->type != GRID_HEX) most = kernel_blur_more(most, kernel_line_blur(&c->lines[n], tile->radius, from, to));
    }
    c->least[0] = c->type == GRID_HEX ? (float)INFINITY : kernel_blur_least(most); /* hexes hardly have triangles */
}

static void kernel_cell_lines(kernel_cell *c, const kernel_frame *f, const kernel_tile *tile)
{
    if (c->has_lines) return;
    c->has_lines = true;
    if (c->type == GRID_TET)
        kernel_tet_lines(c, f, tile);
    else
        kernel_poly_lines(c, f, tile);
}

SIMD_INLINE void kernel_cell_place(kernel_cell *c, const kernel_packet *p, const grid *g)
{
    kernel_cell_place_in(c, p->frame, p->tile, g);
    if (p->is_pencil) kernel_cell_lines(c, p->frame, p->tile);
}

SIMD_INLINE bool kernel_quad_collapses(const kernel_cell *c, const int corner[4])
{
    const double *const corners[4] = {c->world[corner[0]], c->world[corner[1]], c->world[corner[2]],
                                      c->world[corner[3]]};
    return quad_collapses(corners);
}

/* Edge functions of a crossed triangle i, j, k in the order, the weights, and one over their sum. Tets weigh in the
 * same way: a face's depth and value have the same bits from both its cells. */
typedef struct kernel_weights {
    int i, j, k;
    vf ij, jk, ik, inverse;
} kernel_weights;

SIMD_INLINE kernel_weights kernel_weights_of(int i, int j, int k, vf ij, vf jk, vf ik)
{
    return (kernel_weights){i, j, k, ij, jk, ik, 1.0f / kernel_weight(ij, jk, ik)};
}

/* Those of a triangle of these spots, made good enough on rays that cross it; least is no less than its own. */
SIMD_INLINE void kernel_weights_mend(const kernel_packet *p, float least, vm hit, kernel_spot i, kernel_spot j,
                                     kernel_spot k, kernel_weights *w)
{
    if (!p->is_pencil) return;
    const vf weight = kernel_weight(w->ij, w->jk, w->ik);
    if (__builtin_expect(!vm_any(kernel_weak(hit, weight, least)), 1)) return;
    const vm weak = kernel_weak(hit, weight, kernel_triangle_least(p, i, j, k));
    vf ij = w->ij, jk = w->jk, ik = w->ik;
    if (!vm_any(weak)) return;
    kernel_triangle_mend(p, (const kernel_spot[3]){i, j, k}, weak, &ij, &jk, &ik);
    *w = kernel_weights_of(w->i, w->j, w->k, ij, jk, ik);
}

SIMD_INLINE vf kernel_weigh(const kernel_weights *w, float fi, float fj, float fk)
{
    return kernel_weigh_value(w->ij, w->jk, w->ik, fi, fj, fk) * w->inverse;
}

SIMD_INLINE vf kernel_weigh_depth(const kernel_weights *w, const float *z)
{
    return kernel_weigh(w, z[w->i], z[w->j], z[w->k]);
}

/* A search for the crossings of a cell's faces: whose rays, and what all of the faces share. */
typedef struct kernel_face_search {
    const kernel_packet *packet;
    const kernel_cell *cell;
    const kernel_shape *shape;
    const kernel_projected *projected;
    const kernel_edges *edges;
    vm rays;
    bool has_colour;
} kernel_face_search;

SIMD_INLINE void kernel_triangle_values(const kernel_face_search *s, const kernel_weights *w, kernel_crossing *out)
{
    const kernel_cell *c = s->cell;
    const kernel_shape *shape = s->shape;
    out->v = kernel_weigh(w, c->f[w->i], c->f[w->j], c->f[w->k]);
    out->w = s->has_colour ? kernel_weigh(w, c->g[w->i], c->g[w->j], c->g[w->k]) : vf_set(0);
    for (int a = 0; a < 3; a++)
        out->r[a] = kernel_weigh(w, shape->corners[w->i][a], shape->corners[w->j][a], shape->corners[w->k][a]);
}

/* The edge function from one corner to another. */
SIMD_INLINE vf kernel_corner_edge(const kernel_cell *c, const kernel_edges *edges, int from, int to)
{
    return c->rank[from] < c->rank[to] ? edges->e[from][to] : -edges->e[to][from];
}

SIMD_INLINE void kernel_quad_take(const kernel_projected *q, const float *z, const int corner[4], kernel_quad *out)
{
    for (int i = 0; i < 4; i++) {
        out->x[i] = q->x[corner[i]];
        out->y[i] = q->y[corner[i]];
        out->z[i] = vf_set(z[corner[i]]);
    }
}

/* The crossing of a quad's patch. The isoparametric map has the same patch there, so that the field inside the cells on
 * both sides goes on to the same value. */
SIMD_INLINE void kernel_quad_values(const kernel_face_search *s, const int corner[4], const kernel_quad_place *at,
                                    kernel_crossing *out)
{
    const kernel_cell *c = s->cell;
    const kernel_shape *shape = s->shape;
    vf f[4], g[4];
    for (int i = 0; i < 4; i++) f[i] = vf_set(c->f[corner[i]]), g[i] = vf_set(s->has_colour ? c->g[corner[i]] : 0);
    out->mask = at->mask;
    out->t = at->t;
    out->v = kernel_bilinear(f, at->s, at->r);
    out->w = s->has_colour ? kernel_bilinear(g, at->s, at->r) : vf_set(0);
    for (int a = 0; a < 3; a++) {
        const float base = shape->corners[corner[0]][a];
        out->r[a] =
            (base + at->s * (shape->corners[corner[1]][a] - base)) + at->r * (shape->corners[corner[3]][a] - base);
    }
}

/* Three of the cell's vertices in the order. */
SIMD_INLINE void kernel_triangle_order(const kernel_cell *c, const int corners[3], int out[3])
{
    int i = corners[0], j = corners[1], k = corners[2], swap;
    if (c->rank[j] < c->rank[i]) swap = i, i = j, j = swap;
    if (c->rank[k] < c->rank[j]) swap = j, j = k, k = swap;
    if (c->rank[j] < c->rank[i]) swap = i, i = j, j = swap;
    out[0] = i;
    out[1] = j;
    out[2] = k;
}

/* Who crosses the triangle. */
SIMD_INLINE vm kernel_triangle(const kernel_edges *edges, vm rays, const int ijk[3])
{
    return kernel_inside(rays, edges->e[ijk[0]][ijk[1]], edges->e[ijk[1]][ijk[2]], edges->e[ijk[0]][ijk[2]]);
}

/* Finds the crossing of three of the cell's vertices; false where no ray has any. */
SIMD_INLINE bool kernel_triangle_crossing(const kernel_face_search *s, const int corners[3], kernel_crossing *out)
{
    const kernel_cell *c = s->cell;
    const kernel_edges *edges = s->edges;
    int ijk[3];
    kernel_triangle_order(c, corners, ijk);
    const vm hit = kernel_triangle(edges, s->rays, ijk);
    if (!vm_any(hit)) return false;
    kernel_weights w = kernel_weights_of(ijk[0], ijk[1], ijk[2], edges->e[ijk[0]][ijk[1]], edges->e[ijk[1]][ijk[2]],
                                         edges->e[ijk[0]][ijk[2]]);
    kernel_weights_mend(s->packet, c->least[0], hit, kernel_cell_spot(c, w.i), kernel_cell_spot(c, w.j),
                        kernel_cell_spot(c, w.k), &w);
    out->mask = hit;
    out->t = kernel_weigh_depth(&w, c->z);
    kernel_triangle_values(s, &w, out);
    return true;
}

/* As below, for a quad that has collapsed to a triangle. */
static __attribute__((noinline, cold)) int kernel_collapsed_crossings(const kernel_face_search *s, const int corner[4],
                                                                      kernel_crossing *out)
{
    int n = 0;
    for (int half = 0; half < 2; half++) {
        const int corners[3] = {corner[0], corner[half + 1], corner[half + 2]};
        n += kernel_triangle_crossing(s, corners, &out[n]);
    }
    return n;
}

/* Finds the crossings of a quad and returns how many there are, 0 to 2; each ray's are in one of them or in both. */
SIMD_INLINE int kernel_quad_crossings(const kernel_face_search *s, const int corner[4], kernel_crossing *out)
{
    const kernel_cell *c = s->cell;
    const kernel_edges *edges = s->edges;
    const vm rays = s->rays;
    kernel_quad quad;
    kernel_quad_place places[2];
    vm once = vm_none();
    for (int half = 0; half < 2; half++) {
        const int corners[3] = {corner[0], corner[half + 1], corner[half + 2]};
        int ijk[3];
        kernel_triangle_order(c, corners, ijk);
        once = vm_xor(once, kernel_triangle(edges, rays, ijk));
    }
    quad.e01 = edges->e[corner[0]][corner[1]];
    quad.e03 = edges->e[corner[0]][corner[3]];
    quad.e12 = kernel_corner_edge(c, edges, corner[1], corner[2]);
    quad.e32 = kernel_corner_edge(c, edges, corner[3], corner[2]);
    const vm twice = kernel_quad_sides(rays, quad.e01, quad.e32, quad.e03, quad.e12);
    if (!vm_any(vm_or(once, twice))) return 0;
    if (kernel_quad_collapses(c, corner)) return kernel_collapsed_crossings(s, corner, out);
    kernel_quad_take(s->projected, c->z, corner, &quad);
    const int n = kernel_quad_places(&quad, once, twice, places);
    for (int i = 0; i < n; i++) kernel_quad_values(s, corner, &places[i], &out[i]);
    return n;
}

/* All crossings of a cell with quads; returns how many triangles are crossed by some ray. */
SIMD_INLINE int kernel_poly_crossings(const kernel_packet *p, const kernel_cell *c, vm rays, bool has_colour,
                                      kernel_crossing out[KERNEL_MAX_CROSSINGS])
{
    const kernel_shape *shape = kernel_cell_shape(c->type);
    kernel_projected q;
    kernel_edges edges;
    const kernel_face_search s = {p, c, shape, &q, &edges, rays, has_colour};
    for (int i = 0; i < c->count; i++) {
        q.x[i] = kernel_project_x(p, kernel_cell_spot(c, i));
        q.y[i] = kernel_project_y(p, kernel_cell_spot(c, i));
    }
    for (int n = 0; n < shape->edge_count; n++)
        kernel_poly_edge(p, c, n, shape->edges[n][0], shape->edges[n][1], &edges);
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
        kernel_poly_edge(p, c, shape->edge_count + face, corner[0], corner[2], &edges);
        n += kernel_quad_crossings(&s, corner, &out[n]);
    }
    return n;
}

/* Take the nearest crossing of each ray out of the list: false where no ray has one left. */
SIMD_INLINE bool kernel_take_nearest(kernel_crossing *list, int count, kernel_crossing *out)
{
    vi taken = vi_set(-1);
    out->mask = vm_none();
    out->t = vf_set(INFINITY);
    out->v = out->w = out->r[0] = out->r[1] = out->r[2] = vf_set(0);
    for (int n = 0; n < count; n++) {
        const vm nearer = vm_and(list[n].mask, vf_lt(list[n].t, out->t));
        out->mask = vm_or(out->mask, nearer);
        out->t = vf_select(nearer, list[n].t, out->t);
        out->v = vf_select(nearer, list[n].v, out->v);
        out->w = vf_select(nearer, list[n].w, out->w);
        for (int a = 0; a < 3; a++) out->r[a] = vf_select(nearer, list[n].r[a], out->r[a]);
        taken = (vi)vf_select(nearer, (vf)vi_set(n), (vf)taken);
    }
    for (int n = 0; n < count; n++) list[n].mask = vm_andnot(list[n].mask, vf_eq(vf_from_vi(taken), vf_set((float)n)));
    return vm_any(out->mask);
}

SIMD_INLINE int kernel_poly_intervals(const kernel_packet *p, const kernel_cell *c, vm rays, bool has_colour,
                                      kernel_interval out[KERNEL_MAX_CELL_INTERVALS])
{
    kernel_crossing list[KERNEL_MAX_CROSSINGS], in, next;
    const int crossings = kernel_poly_crossings(p, c, rays, has_colour, list);
    int n = 0;
    while (n < KERNEL_MAX_CELL_INTERVALS && kernel_take_nearest(list, crossings, &in) &&
           kernel_take_nearest(list, crossings, &next)) {
        out[n].mask = vm_and(in.mask, next.mask);
        out[n].t_in = in.t;
        out[n].t_out = next.t;
        out[n].v_in = in.v;
        out[n].v_out = next.v;
        out[n].w_in = in.w;
        out[n].w_out = next.w;
        memcpy(out[n].r_in, in.r, sizeof in.r);
        memcpy(out[n].r_out, next.r, sizeof next.r);
        n++;
    }
    return n;
}

#endif
