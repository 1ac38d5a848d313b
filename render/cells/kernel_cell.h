/* Intersects a ray with a cell: computes the points at which the ray enters and leaves the cell, and the field there.
 *
 * Terms of the files in cells/:
 *     order of coordinates   lexicographic order of vertices by their world coordinates x, y, z; a vertex's number in
 *                            this order, among the vertices of its cell, is its rank
 *     edge function          a number whose sign states on which side of an edge a ray passes (see below)
 *     line                   an edge's edge function, as an affine function of a ray's slope or origin (u, v)
 *     i, j, k                a triangle's vertices in the order of coordinates; ij, jk, ik: the edge functions of its
 *                            edges on a ray
 *     weights                at the crossing of a triangle: jk for vertex i, -ik for j and ij for k, all of one sign;
 *                            the mean with these weights interpolates depths and values between the vertices
 *     quad, patch            a face with four vertices; the bilinear surface through its four edges
 *     to project             to subtract a ray's position at a vertex's depth from the vertex's position
 *
 * Which faces a ray crosses is decided on triangles: the triangular faces, and the quads split in two by the diagonal
 * from their first vertex in the order of coordinates. The crossing point on a quad is then computed on the quad's
 * bilinear patch, which is the image of the face under the isoparametric maps of both its cells. Everything about a
 * face is computed from its vertices alone, taken in that same order, so that two cells that share a face compute
 * bit-identical crossings, whatever the numbering and orientation of their vertices, and on whatever rank they are.
 *
 * Let x and y be coordinates across the ray, with the ray at the origin. The edge function of the edge from a to b is
 * xa yb - xb ya. It is positive if the ray passes on one side of the edge and negative on the other; its sign is
 * computed exactly (simd.h). If it is zero, the ray is treated as if it were moved by (e, e²) for an e smaller than
 * every number; the same rule holds for all edges and decides every tie. So a ray meets exactly those triangles that
 * contain it, never both or neither of two that share an edge, and it crosses a closed surface an even number of times.
 * (Woop, Benthin and Wald 2013 for the edge functions in the ray's plane; Edelsbrunner and Mücke 1990 for the ties.)
 * Sorted along the ray, the crossings form pairs, which are the intervals inside the cell. The cell's orientation does
 * not matter. */
#ifndef RENDER_KERNEL_CELL_H
#define RENDER_KERNEL_CELL_H

#include <math.h>
#include <string.h>

#include "grid.h"
#include "kernel_shapes.h"
#include "kernel_types.h"
#include "render_polyhedra.h"
#include "simd.h"

/* How the edge function of a cell's edge is computed for all rays of a tile.
 *
 * In the plane of the ray with parameters u, v (its slopes, or its origin if the camera is orthographic) a vertex at X,
 * Y, Z in tile space is at x = X - u D, y = Y - v D, where D is its depth from the eye, or 1 if the camera is
 * orthographic. The edge function is then affine in u and v, because the products u v cancel:
 *     e = xa yb - xb ya = (Xa Yb - Xb Ya) + u (Db Ya - Da Yb) + v (Da Xb - Db Xa)
 * Its coefficients are computed once per cell and tile, from the edge's two vertices in the order of coordinates, so
 * that they are bit-identical in all cells that have the edge; a packet then needs two multiply-adds. For rays for
 * which the sign of that sum is uncertain, which depends on the edge and the ray alone, e is computed from the
 * projected vertices instead, by vf_diff_of_products(), with its exact sign.
 *
 * The error bound below which the sign is uncertain (kernel_line.bound). Let r = 2^-24, W the maximum of |u| and |v|
 * over the tile, reach the eye's distance from the depth origin (0 if orthographic), M = |Z| + reach >= |D| (1 if
 * orthographic), N = 2 max(|X|, |Y|) + 5 W M; so |x|, |y| <= N / 2, |c| <= Na Nb / 2 and |cu| W, |cv| W <= Na Nb / 5.
 * - The affine form errs by r of each coefficient, of u and of v, and, without fused operations, of two products and
 *   two sums: by at most r (3 |c| + 5 |cu| W + 4 |cv| W) <= 3.3 r Na Nb.
 * - The projection, (X - origin) - slope Z, errs by r of the origin, of the first difference, twice of slope Z (the
 *   slope and the product), and of x: by at most r (2 |X| + 3 W M) <= r N. The function with the exact sign is
 *   therefore the edge function of vertices that are displaced by r N: it errs by at most 4 r Na Nb / 2. The sum is 5.3
 *   r Na Nb; a factor of 6 leaves room for products of errors and for the bound's own roundings.
 *
 * The accuracy of weights. The signs of edge functions are exact, their magnitudes are not. At a crossing of a
 * triangle, depth and value are means of the vertices' depths and values, weighted by the opposite edges' functions,
 * whose sum is A (twice the triangle's projected area). An error d of one weight moves the depth t by d |z - t| / A,
 * where z is its vertex's depth. So all three errors move it by no more than D S / A, where D is the sum of the three
 * d, and S the triangle's extent in depth; the point across the ray moves by as much with the extent across. By the
 * count above d is at most r (3 |c| + 4 |cu| W + 3 |cv| W); the rounding of u and v moves the ray equally for all
 * triangles. So if A is at least D S / KERNEL_WEIGHT_ERROR, the weights' roundings move the crossing by no more than
 * KERNEL_WEIGHT_ERROR along the ray: 4 r in the worst case, while t itself is rounded by up to r / 2. Extents across
 * the ray are weighted by a quarter: a crossing may move 4 times as far there, because that changes only the value. If
 * A is less, because the ray lies almost in the triangle's plane or the tile is much wider than the triangle, all three
 * edge functions are computed from the projected vertices: then the vertices are displaced by r N as above, equally for
 * all their triangles, and the weights are exact to a few r each. Which of the two methods is used depends only on the
 * triangle and the ray. (An edge function of uncertain sign is computed from projected vertices in any case: for a ray
 * that crosses the triangle its e errs by no more than r N times the edges next to it, which equals a displacement of
 * the vertices.) */

/* A line: the edge function c + cu u + cv v of an edge, where (u, v) is a ray's slope or, if the camera is
 * orthographic, its origin. The sign of the edge function is certain if its magnitude exceeds `bound`. */
typedef struct kernel_line {
    float c, cu, cv, bound;
} kernel_line;

/* The position of a vertex in tile space. */
typedef struct kernel_tile_position {
    float x, y, z;
} kernel_tile_position;

/* Returns twice an upper bound of |x| and |y| of a vertex, projected along any of the tile's rays: N of the comment
 * above kernel_line. The error bounds of edge functions are computed from this number. */
SIMD_INLINE float kernel_bound_projected_position(const kernel_frame *f, const kernel_tile *tile,
                                                  kernel_tile_position a)
{
    const float depth = f->job->camera.is_orthographic ? 1 : fabsf(a.z) + fabsf((float)f->depth_shift);
    const float x = fabsf(a.x), y = fabsf(a.y);
    return 2 * (x > y ? x : y) + 5 * tile->radius * depth;
}

/* Computes the line (the affine edge function) of the edge from a to b, where a is before b in the order of
 * coordinates. size_a, size_b: kernel_bound_projected_position() of the vertices. */
SIMD_INLINE kernel_line kernel_line_between(const kernel_frame *f, kernel_tile_position a, kernel_tile_position b,
                                            float size_a, float size_b)
{
    const bool flat = f->job->camera.is_orthographic;
    const double da = flat ? 1 : (double)a.z + f->depth_shift, db = flat ? 1 : (double)b.z + f->depth_shift;
    const double ax = (double)a.x, ay = (double)a.y, bx = (double)b.x, by = (double)b.y;
    return (kernel_line){(float)(ax * by - bx * ay), (float)(db * ay - da * by), (float)(da * bx - db * ax),
                         6 * 6e-8f * (size_a * size_b)};
}

/* ---- accuracy of the weights of crossings ---- */

/* Largest error of a crossing's depth, in t, that the rounding of weights may cause. The length of a ray's interval may
 * have an error of 1e-6 (tests/test_chords.c); the weights of its two crossings then cause at most half of this. */
#define KERNEL_WEIGHT_ERROR 2.4e-7f

/* Properties of an edge from which the accuracy of weights is computed. error: upper bound d of the error of its edge
 * function, as derived above kernel_line. extent: the edge's extent in depth plus a quarter of its extents in x and
 * y. */
typedef struct kernel_edge_error {
    float error, extent;
} kernel_edge_error;

SIMD_INLINE kernel_edge_error kernel_compute_edge_error(const kernel_line *l, float radius, kernel_tile_position a,
                                                        kernel_tile_position b)
{
    const float x = fabsf(a.x - b.x), y = fabsf(a.y - b.y), z = fabsf(a.z - b.z);
    return (kernel_edge_error){6e-8f * (3 * fabsf(l->c) + radius * (4 * fabsf(l->cu) + 3 * fabsf(l->cv))),
                               z + 0.25f * (x + y)};
}

/* Returns the least sum of a triangle's weights at which the depth of its crossing has an error of at most
 * KERNEL_WEIGHT_ERROR. The comment above kernel_line derives it, and calls the sum A. errors, extents: sums over the
 * triangle's three edges (kernel_edge_error). Along any axis the edges' extents sum to twice the triangle's extent,
 * hence the factor 1/2. */
SIMD_INLINE float kernel_compute_least_weight_sum(float errors, float extents)
{
    return errors * extents * (0.5f / KERNEL_WEIGHT_ERROR);
}

/* Returns the larger one of two edges' errors, and the larger one of their extents. */
SIMD_INLINE kernel_edge_error kernel_edge_error_max(kernel_edge_error a, kernel_edge_error b)
{
    return (kernel_edge_error){a.error < b.error ? b.error : a.error, a.extent < b.extent ? b.extent : a.extent};
}

/* Returns an upper bound of kernel_compute_least_weight_sum() for all triangles whose edges have at most the error
 * most.error and the extent most.extent. */
SIMD_INLINE float kernel_bound_least_weight_sum(kernel_edge_error most)
{
    return 1.0001f * kernel_compute_least_weight_sum(3 * most.error, 3 * most.extent);
}

enum { KERNEL_MAX_CROSSINGS = 12, KERNEL_MAX_CELL_INTERVALS = KERNEL_MAX_CROSSINGS / 2 };

typedef struct kernel_cell {
    uint32_t serial, index; /* number of the tile and index of the cell, by which the cell cache finds this struct */
    /* index of the mesh part, and of the layer whose field the cell has; also used by the cell cache */
    int part, layer;
    bool is_finite;      /* set if the values at all vertices are finite */
    bool is_transformed; /* set if x, y and z are computed */
    bool is_constant;    /* set if the values at all vertices are equal; computed for volumes only */
    bool has_lines;      /* set if `lines` is computed */
    int type, count;
    int64_t vertices[GRID_MAX_CELL_VERTICES];
    double world[GRID_MAX_CELL_VERTICES][3];
    double values[GRID_MAX_CELL_VERTICES];
    /* coordinates of the vertices in tile space */
    float x[GRID_MAX_CELL_VERTICES], y[GRID_MAX_CELL_VERTICES], z[GRID_MAX_CELL_VERTICES];
    /* vertex values as the layer needs them: minus an isovalue and scaled (kernel_cell_subtract_isovalue()), or in the
     * domain of a volume's transfer function */
    float f[GRID_MAX_CELL_VERTICES];
    /* vertex values of the colour field, in its transfer function's domain; not set for tets */
    float g[GRID_MAX_CELL_VERTICES];
    int rank[GRID_MAX_CELL_VERTICES]; /* rank of each vertex in the lexicographic order of coordinates */
    /* lines (kernel_line) of the edges, then of the quads' diagonals; not computed for tets */
    kernel_line lines[KERNEL_MAX_LINES];
    /* if the sum of a crossing's weights is at least this, the crossing is accurate, whichever of the cell's triangles
     * is crossed (kernel_bound_least_weight_sum()) */
    float least;
} kernel_cell;

/* An interval of each ray inside a cell. The members _in belong to the crossing at which the ray enters the cell, the
 * members _out to the one at which it leaves. t: depth; v: the layer's field (interpolated from kernel_cell.f); w: the
 * colour field (from kernel_cell.g); r: reference coordinates. mask: the rays that have an interval. */
typedef struct kernel_interval {
    vm mask;
    vf t_in, t_out, v_in, v_out;
    vf w_in, w_out;       /* the colour field; set for tets and polyhedra only */
    vf r_in[3], r_out[3]; /* reference coordinates; set for hexes, wedges and pyramids only */
} kernel_interval;

SIMD_INLINE bool kernel_position_before(const double *a, const double *b)
{
    if (a[0] != b[0]) return a[0] < b[0];
    if (a[1] != b[1]) return a[1] < b[1];
    return a[2] < b[2];
}

/* Returns a cell's size: the cube root of its bounding box's volume, or the box's longest side if the box is flat. */
static inline double kernel_cell_size(const double (*world)[3], int count)
{
    double volume = 1, longest = 0;
    for (int a = 0; a < 3; a++) {
        double low = world[0][a], high = low;
        for (int i = 1; i < count; i++) {
            low = world[i][a] < low ? world[i][a] : low;
            high = world[i][a] > high ? world[i][a] : high;
        }
        volume *= high - low;
        longest = high - low > longest ? high - low : longest;
    }
    return volume > 0 ? cbrt(volume) : longest;
}

/* Adds those of a face's vertices that are missing to the list `vertices`. Returns a mask of the indices that the
 * face's vertices have in this list. Returns 0 if the list would exceed four vertices. */
static int kernel_add_face_vertices(const grid *g, int64_t face, int64_t vertices[4], int *count)
{
    int64_t first, end;
    int corners = 0;
    grid_face_vertices(g, face, &first, &end);
    for (int64_t i = first; i < end; i++) {
        const int64_t vertex = grid_read_index(&g->face_connectivity, i);
        int at = 0;
        while (at < *count && vertices[at] != vertex) at++;
        if (at == 4) return 0;
        if (at == *count) vertices[(*count)++] = vertex;
        corners |= 1 << at;
    }
    return corners;
}

/* Returns whether a polyhedron is a tet, and lists its vertices. Such a polyhedron is drawn bit for bit like a tet with
 * these vertices. A polyhedron is a tet if it has four vertices, and if for each of them exactly one face is the
 * triangle of the other three. (Two triangles that each occur twice enclose no volume.) Faces that have collapsed to a
 * point are ignored. */
static bool kernel_is_tet(const grid *g, int64_t cell, int64_t vertices[4])
{
    int64_t first, end;
    int count = 0, lacking = 0;
    grid_cell_faces(g, cell, &first, &end);
    for (int64_t i = first; i < end; i++) {
        const int corners = kernel_add_face_vertices(g, grid_read_index(&g->connectivity, i), vertices, &count);
        if (corners && !(corners & (corners - 1))) continue;
        const int lack = ~corners & 15;
        if (!corners || !lack || (lack & (lack - 1)) || (lacking & lack)) return false;
        lacking |= lack;
    }
    return count == 4 && lacking == 15;
}

/* Reads a cell's type, vertex indices and values, not yet its positions. For a polyhedron only the type is valid
 * (kernel_polyhedron.h). */
static __attribute__((noinline, unused)) void kernel_cell_fetch(kernel_cell *c, const grid *g, const grid_field *field,
                                                                uint32_t index)
{
    c->index = index;
    c->is_transformed = false;
    c->type = grid_cell_type(g, index);
    if (kernel_has_own_faces(c->type) && kernel_is_tet(g, index, c->vertices))
        c->type = GRID_TET, c->count = 4;
    else
        c->count = grid_cell_vertices(g, index, c->vertices);
    c->is_finite = grid_cell_values(field, index, c->vertices, c->count, c->values);
}

SIMD_INLINE bool kernel_rank_before(const kernel_cell *c, int i, int j)
{
    return c->rank[i] < c->rank[j];
}

/* Computes the canonical order of the vertices of a hex, wedge or pyramid. The first vertex is the one of least rank;
 * in a pyramid, the one of least rank in the base. Its neighbours follow in the order of their ranks, as far as the
 * cell's shape allows. from[i]: index, in the present order, of the vertex that becomes vertex i. The order may mirror
 * the cell, because intersections do not depend on orientation. */
SIMD_INLINE void kernel_cell_canonical_order(const kernel_cell *c, int from[GRID_MAX_CELL_VERTICES])
{
    /* corner[i] is b, and corner[b] is i, if bits 0, 1 and 2 of b are the reference coordinates x, y and z, each 0 or
     * 1, of the hex's vertex i */
    static const signed char corner[8] = {0, 1, 3, 2, 4, 5, 7, 6};
    const int begins = kernel_has_apex(c->type) ? 4 : c->count;
    int least = 0, swap;
    for (int i = 1; i < begins; i++)
        if (kernel_rank_before(c, i, least)) least = i;
    if (kernel_is_box(c->type)) {
        int axes[3] = {1, 2, 4};
        for (int k = 0; k < 3; k++) {
            /* sorts the three axes by comparing axes 0 and 1, then 1 and 2, then 0 and 1 again */
            const int at = k == 1;
            if (kernel_rank_before(c, corner[corner[least] ^ axes[at + 1]], corner[corner[least] ^ axes[at]]))
                swap = axes[at], axes[at] = axes[at + 1], axes[at + 1] = swap;
        }
        for (int i = 0; i < 8; i++) {
            int bits = corner[least];
            for (int a = 0; a < 3; a++) bits ^= corner[i] >> a & 1 ? axes[a] : 0;
            from[i] = corner[bits];
        }
    } else if (kernel_is_prism(c->type)) {
        const int base = least < 3 ? 0 : 3;
        int ahead = base + (least + 1) % 3, behind = base + (least + 2) % 3;
        if (kernel_rank_before(c, behind, ahead)) swap = ahead, ahead = behind, behind = swap;
        const int first[3] = {least, ahead, behind};
        for (int i = 0; i < 3; i++) {
            from[i] = first[i];
            from[i + 3] = (first[i] + 3) % 6;
        }
    } else {
        int ahead = (least + 1) & 3, behind = (least + 3) & 3;
        if (kernel_rank_before(c, behind, ahead)) swap = ahead, ahead = behind, behind = swap;
        const int first[5] = {least, ahead, (least + 2) & 3, behind, 4};
        memcpy(from, first, sizeof first);
    }
}

/* Computes each vertex's rank in the lexicographic order of coordinates. The code has no branches, because the
 * processor could not predict them. */
SIMD_INLINE void kernel_rank_positions(double (*const world)[3], const int count, int *rank)
{
    for (int i = 0; i < count; i++) rank[i] = 0;
    for (int i = 0; i < count; i++)
        for (int j = i + 1; j < count; j++) {
            const int after = kernel_position_before(world[j], world[i]);
            rank[i] += after;
            rank[j] += 1 - after;
        }
}

/* Permutes the members that are stored per vertex: vertex from[i] becomes vertex i. The member rank is not permuted,
 * nor is g, which is set later. */
SIMD_INLINE void kernel_cell_permute(kernel_cell *c, const int *from, const int count)
{
    double world[GRID_MAX_CELL_VERTICES][3], values[GRID_MAX_CELL_VERTICES];
    int64_t vertices[GRID_MAX_CELL_VERTICES];
    float *const lists[4] = {c->x, c->y, c->z, c->f};
    float own[4][GRID_MAX_CELL_VERTICES];
    for (int i = 0; i < count; i++) {
        for (int a = 0; a < 3; a++) world[i][a] = c->world[from[i]][a];
        values[i] = c->values[from[i]];
        vertices[i] = c->vertices[from[i]];
        for (int n = 0; n < 4; n++) own[n][i] = lists[n][from[i]];
    }
    for (int i = 0; i < count; i++) {
        for (int a = 0; a < 3; a++) c->world[i][a] = world[i][a];
        c->values[i] = values[i];
        c->vertices[i] = vertices[i];
        for (int n = 0; n < 4; n++) lists[n][i] = own[n][i];
    }
}

/* Puts a cell's vertices in their canonical order. In a tet, whose vertices can be exchanged freely, this is the
 * lexicographic order of coordinates. In other cells, ranks are computed, and the vertices are put in the order of
 * kernel_cell_canonical_order(). So no result depends on how the simulation numbers a cell's vertices, not even if the
 * cell's map is folded, so that a point has several reference coordinates. */
static __attribute__((noinline, unused)) void kernel_cell_sort_vertices(kernel_cell *c)
{
    int from[GRID_MAX_CELL_VERTICES], rank[GRID_MAX_CELL_VERTICES];
    if (kernel_is_linear(c->type)) {
        kernel_rank_positions(c->world, 4, rank);
        for (int i = 0; i < 4; i++) from[rank[i]] = i;
        kernel_cell_permute(c, from, 4);
        return;
    }
    kernel_rank_positions(c->world, c->count, c->rank);
    kernel_cell_canonical_order(c, from);
    kernel_cell_permute(c, from, c->count);
    for (int i = 0; i < c->count; i++) rank[i] = c->rank[from[i]];
    for (int i = 0; i < c->count; i++) c->rank[i] = rank[i];
}

/* Transforms a position in world coordinates into tile space (kernel_types.h), in double. */
SIMD_INLINE void kernel_transform_in_double(const kernel_frame *f, const kernel_tile *tile, const double *world,
                                            double out[3])
{
    const double *eye = f->job->camera.eye;
    const double d0 = world[0] - eye[0], d1 = world[1] - eye[1], d2 = world[2] - eye[2];
    for (int a = 0; a < 3; a++)
        out[a] = f->scaled_axes[a][0] * d0 + f->scaled_axes[a][1] * d1 + f->scaled_axes[a][2] * d2;
    const double depth = f->job->camera.is_orthographic ? f->job->space.scale : out[2];
    out[0] -= tile->centre_x * depth;
    out[1] -= tile->centre_y * depth;
    out[2] -= tile->depth_shift;
}

/* Transforms a position in world coordinates into tile space (kernel_types.h), and rounds the result to float32. */
SIMD_INLINE void kernel_transform_in_tile(const kernel_frame *f, const kernel_tile *tile, const double *world,
                                          float *out_x, float *out_y, float *out_z)
{
    double at[3];
    kernel_transform_in_double(f, tile, world, at);
    *out_x = (float)at[0];
    *out_y = (float)at[1];
    *out_z = (float)at[2];
}

/* Reads the positions of the cell's vertices and transforms them into tile space. The vertices are not put in canonical
 * order, and no edge functions are computed. */
static __attribute__((noinline, unused)) void kernel_cell_move_to_tile_space(kernel_cell *c, const kernel_frame *f,
                                                                             const kernel_tile *tile, const grid *g)
{
    for (int i = 0; i < c->count; i++) grid_read_vertex_position(g, c->vertices[i], c->world[i]);
    for (int i = 0; i < c->count; i++) kernel_transform_in_tile(f, tile, c->world[i], &c->x[i], &c->y[i], &c->z[i]);
    c->is_transformed = true;
    c->has_lines = false;
}

SIMD_INLINE void kernel_cell_transform_in_tile(kernel_cell *c, const kernel_frame *f, const kernel_tile *tile,
                                               const grid *g)
{
    kernel_cell_move_to_tile_space(c, f, tile, g);
    kernel_cell_sort_vertices(c);
}

SIMD_INLINE kernel_tile_position kernel_cell_position(const kernel_cell *c, int i)
{
    return (kernel_tile_position){c->x[i], c->y[i], c->z[i]};
}

/* Lists a quad's corners in cyclic order. The first corner is the vertex of smallest rank. The second corner is the one
 * of its two neighbours that has the smaller rank. loop: the quad's vertices in the cell, in cyclic order. */
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

SIMD_INLINE bool kernel_quad_collapses(const kernel_cell *c, const int corner[4])
{
    const double *const corners[4] = {c->world[corner[0]], c->world[corner[1]], c->world[corner[2]],
                                      c->world[corner[3]]};
    return quad_collapses(corners);
}

/* ---- edge functions of a cell ---- */

/* Computes the lines (kernel_line) of the edges and of the quads' diagonals of a hex, wedge or pyramid, unless
 * c->has_lines is set. */
static __attribute__((unused)) void kernel_cell_compute_lines(kernel_cell *c, const kernel_frame *f,
                                                              const kernel_tile *tile)
{
    const kernel_shape *shape = kernel_cell_shape(c->type);
    signed char ends[KERNEL_MAX_LINES][2];
    float size[GRID_MAX_CELL_VERTICES];
    const int count = shape->edge_count + shape->face_count;
    if (c->has_lines) return;
    c->has_lines = true;
    memset(ends, 0, sizeof ends);
    memcpy(ends, shape->edges, (size_t)shape->edge_count * sizeof ends[0]);
    for (int face = 0; face < shape->face_count; face++) {
        int corner[4];
        if (shape->faces[face].count == 3) continue;
        kernel_quad_corners(c, shape->faces[face].vertices, corner);
        ends[shape->edge_count + face][0] = (signed char)corner[0];
        ends[shape->edge_count + face][1] = (signed char)corner[2];
    }
    for (int i = 0; i < c->count; i++) size[i] = kernel_bound_projected_position(f, tile, kernel_cell_position(c, i));
    kernel_edge_error most = {0, 0};
    for (int n = 0; n < count; n++) {
        const int i = ends[n][0], j = ends[n][1], a = c->rank[i] < c->rank[j] ? i : j, b = a == i ? j : i;
        const kernel_tile_position from = kernel_cell_position(c, a), to = kernel_cell_position(c, b);
        c->lines[n] = kernel_line_between(f, from, to, size[a], size[b]);
        if (kernel_has_triangles(c->type))
            most = kernel_edge_error_max(most, kernel_compute_edge_error(&c->lines[n], tile->radius, from, to));
    }
    /* A hex has triangles only if a quad has collapsed. For such a rare triangle, infinity makes
     * kernel_weights_recompute() always compute the least sum of weights for the triangle itself. */
    c->least = kernel_is_box(c->type) ? (float)INFINITY : kernel_bound_least_weight_sum(most);
}

#endif
