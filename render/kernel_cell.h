/* A ray and a cell: where it goes in and out, and the field's value there.
 *
 * A cell is the polyhedron bounded by its triangular faces and by its quads, each split in two triangles by the
 * diagonal from the quad's smallest vertex, in the order of coordinates. Everything about a face is computed from its
 * vertices alone, taken in that same order, so that two cells that share a face find the same bits on it, whatever
 * their numbering, orientation or rank.
 *
 * In the ray's own plane (x, y with the ray at the origin) the edge function of edge ab is xa yb - xb ya: positive on
 * one side. It is computed so that its sign is exact (simd.h); where it is zero, the ray is taken as moved by (e, e²)
 * for an e smaller than every number, which the same for all edges decides every tie. So a ray meets exactly those
 * triangles that contain it, never both or neither of two that share an edge, and a closed surface an even number of
 * times. (Woop, Benthin and Wald 2013 for the edge functions in the ray's plane; Edelsbrunner and Mücke 1990 for the
 * ties.) Sorted along the ray the crossings pair up into the intervals inside; no orientation is asked of the cell. */
#ifndef RENDER_KERNEL_CELL_H
#define RENDER_KERNEL_CELL_H

#include "kernel_packet.h"

enum { KERNEL_MAX_CROSSINGS = 12, KERNEL_MAX_CELL_INTERVALS = KERNEL_MAX_CROSSINGS / 2 };

typedef struct kernel_cell {
    uint32_t serial, index; /* the cache's key: tile, cell, */
    int part, layer;        /* mesh, and whose values these are */
    bool is_finite, is_placed, is_constant;
    int type, count;
    int64_t vertices[GRID_MAX_CELL_VERTICES];
    double world[GRID_MAX_CELL_VERTICES][3];
    double values[GRID_MAX_CELL_VERTICES];
    float x[GRID_MAX_CELL_VERTICES], y[GRID_MAX_CELL_VERTICES], z[GRID_MAX_CELL_VERTICES]; /* tile space */
    float f[GRID_MAX_CELL_VERTICES];  /* values as the caller wants them */
    float g[GRID_MAX_CELL_VERTICES];  /* the same of the colour field */
    int rank[GRID_MAX_CELL_VERTICES]; /* place in the order of coordinates */
} kernel_cell;

/* Where rays go through a face: v of f, w of g, at the cell's own coordinates r (for tets not set). */
typedef struct kernel_crossing {
    vm mask;
    vf t, v, w;
    vf r[3];
} kernel_crossing;

/* Between two crossings, inside the cell. */
typedef struct kernel_interval {
    vm mask;
    vf t_in, t_out, v_in, v_out, w_in, w_out;
    vf r_in[3], r_out[3];
} kernel_interval;

/* A ray's place relative to vertices: x, y in the ray's plane. */
typedef struct kernel_projected {
    vf x[GRID_MAX_CELL_VERTICES], y[GRID_MAX_CELL_VERTICES];
} kernel_projected;

SIMD_INLINE bool kernel_position_before(const double *a, const double *b)
{
    if (a[0] != b[0]) return a[0] < b[0];
    if (a[1] != b[1]) return a[1] < b[1];
    return a[2] < b[2];
}

/* Cells that rays of the tile have met, by hash: a cell is fetched, ordered and moved into tile space once for all the
 * tile's packets, and for all of a volume's windows, as long as it is not pushed out. */
enum { KERNEL_CACHE_BITS = 8, KERNEL_CACHE_CELLS = 1 << KERNEL_CACHE_BITS };

typedef struct kernel_cache {
    kernel_cell cells[KERNEL_CACHE_CELLS];
} kernel_cache;

/* The cell with its values; a new one is not placed yet. layer tells apart the fields that cells are asked for. */
SIMD_INLINE kernel_cell *kernel_cell_find(const kernel_packet *p, int layer, int part, const grid_field *field,
                                          uint32_t index)
{
    const uint32_t key = index + 0x85ebca6bu * (uint32_t)part + 0xc2b2ae35u * (uint32_t)layer;
    kernel_cell *c = &((kernel_cache *)p->thread->cache)->cells[(key * 0x9e3779b1u) >> (32 - KERNEL_CACHE_BITS)];
    if (c->serial == p->thread->serial && c->index == index && c->part == part && c->layer == layer) return c;
    const grid *g = p->frame->job->parts[part].cells;
    c->serial = p->thread->serial;
    c->index = index;
    c->part = part;
    c->layer = layer;
    c->is_placed = false;
    c->type = grid_cell_type(g, index);
    c->count = grid_cell_vertices(g, index, c->vertices);
    c->is_finite = grid_cell_values(field, index, c->vertices, c->count, c->values);
    return c;
}

SIMD_INLINE void kernel_cell_swap(kernel_cell *c, int i, int j)
{
    for (int a = 0; a < 3; a++) {
        const double w = c->world[i][a];
        c->world[i][a] = c->world[j][a];
        c->world[j][a] = w;
    }
    const double v = c->values[i];
    c->values[i] = c->values[j];
    c->values[j] = v;
    const int64_t n = c->vertices[i];
    c->vertices[i] = c->vertices[j];
    c->vertices[j] = n;
}

/* The order of coordinates: a tet, symmetric in its vertices, is put in that order; other cells get ranks. */
SIMD_INLINE void kernel_cell_order(kernel_cell *c)
{
    if (c->type == GRID_TET) {
        static const int network[5][2] = {{0, 1}, {2, 3}, {0, 2}, {1, 3}, {1, 2}};
        for (int k = 0; k < 5; k++)
            if (kernel_position_before(c->world[network[k][1]], c->world[network[k][0]]))
                kernel_cell_swap(c, network[k][0], network[k][1]);
        return;
    }
    for (int i = 0; i < c->count; i++) c->rank[i] = 0;
    for (int i = 0; i < c->count; i++)
        for (int j = i + 1; j < c->count; j++) {
            const bool after = kernel_position_before(c->world[j], c->world[i]);
            c->rank[i] += after;
            c->rank[j] += !after;
        }
}

/* Vertices into tile space (kernel_packet.h), in order. */
SIMD_INLINE void kernel_cell_place(kernel_cell *c, const kernel_packet *p, const grid *g)
{
    const kernel_frame *f = p->frame;
    const double *eye = f->job->camera.eye;
    const bool flat = f->job->camera.is_orthographic;
    for (int i = 0; i < c->count; i++) grid_vertex(g, c->vertices[i], c->world[i]);
    kernel_cell_order(c);
    const double cx = p->tile->centre_x, cy = p->tile->centre_y;
    for (int i = 0; i < c->count; i++) {
        const double d0 = c->world[i][0] - eye[0], d1 = c->world[i][1] - eye[1], d2 = c->world[i][2] - eye[2];
        const double x = f->scaled_axes[0][0] * d0 + f->scaled_axes[0][1] * d1 + f->scaled_axes[0][2] * d2;
        const double y = f->scaled_axes[1][0] * d0 + f->scaled_axes[1][1] * d1 + f->scaled_axes[1][2] * d2;
        const double z = f->scaled_axes[2][0] * d0 + f->scaled_axes[2][1] * d1 + f->scaled_axes[2][2] * d2;
        const double depth = flat ? f->job->space.scale : z;
        c->x[i] = (float)(x - cx * depth);
        c->y[i] = (float)(y - cy * depth);
        c->z[i] = (float)(z - f->depth_shift);
    }
    c->is_placed = true;
}

SIMD_INLINE void kernel_project(const kernel_packet *p, const kernel_cell *c, int i, kernel_projected *out)
{
    out->x[i] = (vf_set(c->x[i]) - p->origin_x) - p->slope_x * c->z[i];
    out->y[i] = (vf_set(c->y[i]) - p->origin_y) - p->slope_y * c->z[i];
}

/* The edge function of a, b (a before b in the order) and its sign, ties decided. */
SIMD_INLINE vf kernel_edge(const kernel_projected *q, int a, int b, vm *positive)
{
    const vf e = vf_diff_of_products(q->x[a], q->y[b], q->x[b], q->y[a]);
    const vf zero = vf_set(0);
    vm above = vf_lt(zero, e);
    const vm tie = vf_eq(e, zero);
    if (__builtin_expect(vm_any(tie), 0)) {
        const vm level = vm_and(vf_eq(q->y[a], q->y[b]), vf_lt(q->x[a], q->x[b]));
        above = vm_or(above, vm_and(tie, vm_or(vf_lt(q->y[b], q->y[a]), level)));
    }
    *positive = above;
    return e;
}

/* The triangle i, j, k (in the order) with its three edges: who crosses it. */
SIMD_INLINE vm kernel_inside(vm rays, vm ij, vm jk, vm ik)
{
    return vm_and(vm_andnot(rays, vm_xor(ij, jk)), vm_xor(ij, ik));
}

/* ---- Tets: four triangles, two crossings or none. ---- */

SIMD_INLINE void kernel_tet_face(const kernel_cell *c, vm hit, vf e_ij, vf e_jk, vf e_ik, int i, int j, int k,
                                 bool has_colour, kernel_interval *out)
{
    if (!vm_any(hit)) return;
    const vf inverse = 1.0f / ((e_jk - e_ik) + e_ij);
    const vf t = ((e_jk * c->z[i] - e_ik * c->z[j]) + e_ij * c->z[k]) * inverse;
    const vf v = ((e_jk * c->f[i] - e_ik * c->f[j]) + e_ij * c->f[k]) * inverse;
    const vm first = vm_and(hit, vf_lt(t, out->t_in));
    const vm last = vm_andnot(hit, vf_lt(t, out->t_out));
    out->t_in = vf_select(first, t, out->t_in);
    out->v_in = vf_select(first, v, out->v_in);
    out->t_out = vf_select(last, t, out->t_out);
    out->v_out = vf_select(last, v, out->v_out);
    if (has_colour) {
        const vf w = ((e_jk * c->g[i] - e_ik * c->g[j]) + e_ij * c->g[k]) * inverse;
        out->w_in = vf_select(first, w, out->w_in);
        out->w_out = vf_select(last, w, out->w_out);
    }
    out->mask = vm_or(out->mask, hit);
}

SIMD_INLINE void kernel_tet_interval(const kernel_packet *p, const kernel_cell *c, vm rays, bool has_colour,
                                     kernel_interval *out)
{
    kernel_projected q;
    for (int i = 0; i < 4; i++) kernel_project(p, c, i, &q);
    vm p01, p02, p03, p12, p13, p23;
    const vf e01 = kernel_edge(&q, 0, 1, &p01), e02 = kernel_edge(&q, 0, 2, &p02), e03 = kernel_edge(&q, 0, 3, &p03);
    const vf e12 = kernel_edge(&q, 1, 2, &p12), e13 = kernel_edge(&q, 1, 3, &p13), e23 = kernel_edge(&q, 2, 3, &p23);
    out->mask = vm_none();
    out->t_in = vf_set(INFINITY);
    out->t_out = vf_set(-INFINITY);
    out->v_in = out->v_out = out->w_in = out->w_out = vf_set(0);
    kernel_tet_face(c, kernel_inside(rays, p01, p12, p02), e01, e12, e02, 0, 1, 2, has_colour, out);
    kernel_tet_face(c, kernel_inside(rays, p01, p13, p03), e01, e13, e03, 0, 1, 3, has_colour, out);
    kernel_tet_face(c, kernel_inside(rays, p02, p23, p03), e02, e23, e03, 0, 2, 3, has_colour, out);
    kernel_tet_face(c, kernel_inside(rays, p12, p23, p13), e12, e23, e13, 1, 2, 3, has_colour, out);
}

/* ---- Cells with quads. ---- */

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
    vm positive[GRID_MAX_CELL_VERTICES][GRID_MAX_CELL_VERTICES];
} kernel_edges;

SIMD_INLINE void kernel_poly_edge(const kernel_cell *c, const kernel_projected *q, int i, int j, kernel_edges *out)
{
    const int a = c->rank[i] < c->rank[j] ? i : j, b = a == i ? j : i;
    out->e[a][b] = kernel_edge(q, a, b, &out->positive[a][b]);
}

/* A quad on its own: its corners around from the smallest vertex, towards the smaller neighbour, in a plane of two
 * world axes (the third is the one nearest the normal), relative to the first. Shared by all rays. */
typedef struct kernel_quad {
    int corner[4];
    float u[4], v[4];       /* in the plane; of corner 0: 0 */
    float twist_u, twist_v; /* corner 0 - 1 + 2 - 3; 0 for a parallelogram */
} kernel_quad;

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

/* A quad with two neighbouring corners in one place is a triangle, and its neighbour may have it as such. */
SIMD_INLINE bool kernel_quad_collapses(const kernel_cell *c, const int corner[4])
{
    for (int i = 0; i < 4; i++) {
        const double *a = c->world[corner[i]], *b = c->world[corner[(i + 1) & 3]];
        if (a[0] == b[0] && a[1] == b[1] && a[2] == b[2]) return true;
    }
    return false;
}

static inline void kernel_quad_plane(const kernel_cell *c, kernel_quad *q)
{
    const double *p[4];
    for (int i = 0; i < 4; i++) p[i] = c->world[q->corner[i]];
    double d[3], e[3], n[3];
    for (int a = 0; a < 3; a++) {
        d[a] = p[2][a] - p[0][a];
        e[a] = p[3][a] - p[1][a];
    }
    for (int a = 0; a < 3; a++) n[a] = fabs(d[(a + 1) % 3] * e[(a + 2) % 3] - d[(a + 2) % 3] * e[(a + 1) % 3]);
    const int drop = n[0] >= n[1] && n[0] >= n[2] ? 0 : n[1] >= n[2] ? 1 : 2;
    const int a = (drop + 1) % 3, b = (drop + 2) % 3;
    double size = 0;
    for (int i = 1; i < 4; i++) size = fmax(size, fmax(fabs(p[i][a] - p[0][a]), fabs(p[i][b] - p[0][b])));
    const double unit = size > 0 ? 1 / size : 0;
    for (int i = 0; i < 4; i++) {
        q->u[i] = (float)((p[i][a] - p[0][a]) * unit);
        q->v[i] = (float)((p[i][b] - p[0][b]) * unit);
    }
    q->twist_u = (float)((p[0][a] - p[1][a] + p[2][a] - p[3][a]) * unit);
    q->twist_v = (float)((p[0][b] - p[1][b] + p[2][b] - p[3][b]) * unit);
}

/* Solve bilinear(s, r) = point (pu, pv) from the start given by Newton's method, 4 steps: from an affine guess the
 * error goes as its square in each, 0.1 to 1e-8 and less in three. Rays that would leave the quad are held at its
 * border. */
SIMD_INLINE void kernel_quad_solve(const kernel_quad *q, vf pu, vf pv, vf *s, vf *r)
{
    if (q->twist_u == 0 && q->twist_v == 0) return;
    for (int step = 0; step < 4; step++) {
        const vf su = q->u[1] + *r * q->twist_u, sv = q->v[1] + *r * q->twist_v;
        const vf ru = q->u[3] + *s * q->twist_u, rv = q->v[3] + *s * q->twist_v;
        const vf du = pu - (*s * su + *r * q->u[3]), dv = pv - (*s * sv + *r * q->v[3]);
        const vf det = su * rv - sv * ru;
        const vf inverse = vf_select(vf_eq(det, vf_set(0)), vf_set(0), 1.0f / det);
        *s = vf_clamp(*s + (du * rv - dv * ru) * inverse, vf_set(0), vf_set(1));
        *r = vf_clamp(*r + (su * dv - sv * du) * inverse, vf_set(0), vf_set(1));
    }
}

SIMD_INLINE vf kernel_bilinear(const float *f, const int corner[4], vf s, vf r)
{
    const vf low = f[corner[0]] + s * (f[corner[1]] - f[corner[0]]);
    const vf high = f[corner[3]] + s * (f[corner[2]] - f[corner[3]]);
    return low + r * (high - low);
}

/* Barycentric weights of a crossed triangle: of i, j, k in the order. */
typedef struct kernel_weights {
    int i, j, k;
    vf a, b, c;
} kernel_weights;

SIMD_INLINE vf kernel_weigh(const kernel_weights *w, float fi, float fj, float fk)
{
    return (w->a * fi + w->b * fj) + w->c * fk;
}

SIMD_INLINE void kernel_triangle_values(const kernel_cell *c, const kernel_shape *shape, const kernel_weights *w,
                                        bool has_colour, kernel_crossing *out)
{
    out->v = kernel_weigh(w, c->f[w->i], c->f[w->j], c->f[w->k]);
    out->w = has_colour ? kernel_weigh(w, c->g[w->i], c->g[w->j], c->g[w->k]) : vf_set(0);
    for (int a = 0; a < 3; a++)
        out->r[a] = kernel_weigh(w, shape->corners[w->i][a], shape->corners[w->j][a], shape->corners[w->k][a]);
}

SIMD_INLINE void kernel_quad_values(const kernel_cell *c, const kernel_shape *shape, const kernel_quad *q,
                                    const kernel_weights *w, bool has_colour, kernel_crossing *out)
{
    static const float unit_s[4] = {0, 1, 1, 0}, unit_r[4] = {0, 0, 1, 1};
    int at[3] = {0, 0, 0};
    for (int n = 0; n < 4; n++) {
        if (q->corner[n] == w->i) at[0] = n;
        if (q->corner[n] == w->j) at[1] = n;
        if (q->corner[n] == w->k) at[2] = n;
    }
    const vf pu = kernel_weigh(w, q->u[at[0]], q->u[at[1]], q->u[at[2]]);
    const vf pv = kernel_weigh(w, q->v[at[0]], q->v[at[1]], q->v[at[2]]);
    vf s = kernel_weigh(w, unit_s[at[0]], unit_s[at[1]], unit_s[at[2]]);
    vf r = kernel_weigh(w, unit_r[at[0]], unit_r[at[1]], unit_r[at[2]]);
    kernel_quad_solve(q, pu, pv, &s, &r);
    out->v = kernel_bilinear(c->f, q->corner, s, r);
    out->w = has_colour ? kernel_bilinear(c->g, q->corner, s, r) : vf_set(0);
    for (int a = 0; a < 3; a++) {
        const float base = shape->corners[q->corner[0]][a];
        out->r[a] =
            (base + s * (shape->corners[q->corner[1]][a] - base)) + r * (shape->corners[q->corner[3]][a] - base);
    }
}

/* Weights of triangle a, b, c of the cell, depth, and who crosses it. */
SIMD_INLINE vm kernel_triangle(const kernel_cell *c, const kernel_edges *edges, vm rays, int i, int j, int k,
                               kernel_weights *w, vf *t)
{
    int swap;
    if (c->rank[j] < c->rank[i]) swap = i, i = j, j = swap;
    if (c->rank[k] < c->rank[j]) swap = j, j = k, k = swap;
    if (c->rank[j] < c->rank[i]) swap = i, i = j, j = swap;
    const vm hit = kernel_inside(rays, edges->positive[i][j], edges->positive[j][k], edges->positive[i][k]);
    if (!vm_any(hit)) return hit;
    const vf e_ij = edges->e[i][j], e_jk = edges->e[j][k], e_ik = edges->e[i][k];
    const vf inverse = 1.0f / ((e_jk - e_ik) + e_ij);
    *w = (kernel_weights){i, j, k, e_jk * inverse, -(e_ik * inverse), e_ij * inverse};
    *t = ((e_jk * c->z[i] - e_ik * c->z[j]) + e_ij * c->z[k]) * inverse;
    return hit;
}

/* All crossings of a cell with quads; returns how many triangles are crossed by some ray. */
SIMD_INLINE int kernel_poly_crossings(const kernel_packet *p, const kernel_cell *c, vm rays, bool has_colour,
                                      kernel_crossing out[KERNEL_MAX_CROSSINGS])
{
    const kernel_shape *shape = kernel_cell_shape(c->type);
    kernel_projected q;
    kernel_edges edges;
    for (int i = 0; i < c->count; i++) kernel_project(p, c, i, &q);
    for (int e = 0; e < shape->edge_count; e++) kernel_poly_edge(c, &q, shape->edges[e][0], shape->edges[e][1], &edges);
    int n = 0;
    for (int face = 0; face < shape->face_count; face++) {
        const signed char *loop = shape->faces[face].vertices;
        kernel_weights w;
        if (shape->faces[face].count == 3) {
            out[n].mask = kernel_triangle(c, &edges, rays, loop[0], loop[1], loop[2], &w, &out[n].t);
            if (vm_any(out[n].mask)) kernel_triangle_values(c, shape, &w, has_colour, &out[n++]);
            continue;
        }
        kernel_quad quad;
        bool planed = false;
        kernel_quad_corners(c, loop, quad.corner);
        kernel_poly_edge(c, &q, quad.corner[0], quad.corner[2], &edges);
        for (int half = 0; half < 2; half++) {
            out[n].mask = kernel_triangle(c, &edges, rays, quad.corner[0], quad.corner[half + 1], quad.corner[half + 2],
                                          &w, &out[n].t);
            if (!vm_any(out[n].mask)) continue;
            if (kernel_quad_collapses(c, quad.corner)) {
                kernel_triangle_values(c, shape, &w, has_colour, &out[n++]);
                continue;
            }
            if (!planed) kernel_quad_plane(c, &quad);
            planed = true;
            kernel_quad_values(c, shape, &quad, &w, has_colour, &out[n++]);
        }
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
