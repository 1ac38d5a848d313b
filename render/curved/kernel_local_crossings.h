/* Computes the crossings of rays with the faces of hexes, wedges and pyramids, one ray-cell pair per lane. The crossed
 * faces are found by the signs of projected edge functions, the crossing points on quads by kernel_quad.h and on
 * triangles by weights. The operations are those of kernel_curved_intervals(), which intersects a packet with one cell,
 * so the results are the same to the bit. Callers pass the cell type as a constant. */
#ifndef RENDER_KERNEL_LOCAL_CROSSINGS_H
#define RENDER_KERNEL_LOCAL_CROSSINGS_H

#include <math.h>
#include <string.h>

#include "grid.h"
#include "kernel_crossings.h"
#include "kernel_curved_rays.h"
#include "kernel_local.h"
#include "kernel_transformed_curved.h"
#include "kernel_quad.h"
#include "kernel_shapes.h"
#include "kernel_tile_trace.h"
#include "kernel_wide.h"
#include "simd.h"

enum { KERNEL_LOCAL_ROW = 16, KERNEL_LOCAL_ROWS = 3 };

/* The faces of one cell per lane. at: x, y, z and the field by vertex. words: per face a word of kernel_quad_corners()
 * or kernel_triangle_order() that lists its corners, four bits each. For vectors of 16 lanes `rows` holds the same data
 * per cell, in three rows of 16 numbers: x and y by vertex; z and the field by vertex; the words by face. */
typedef struct kernel_local_faces {
    float at[4][8][SIMD_WIDTH];
    float words[KERNEL_CURVED_FACES][SIMD_WIDTH];
    /* per cell, a bit for each quad that may not look convex on some of the cell's pixels
     * (kernel_curved_nonconvex_quads()) */
    float nonconvex[SIMD_WIDTH];
    float rows[SIMD_WIDTH < KERNEL_LOCAL_ROW ? 1 : SIMD_WIDTH][KERNEL_LOCAL_ROWS][KERNEL_LOCAL_ROW];
} kernel_local_faces;

/* ---- cells ---- */

/* Computes the rank of each vertex in the lexicographic order of coordinates; vertices with equal coordinates keep
 * their order. Coordinates are compared in double. */
SIMD_INLINE void kernel_local_rank(double (*const world)[8][SIMD_WIDTH], int count, vf rank[8])
{
    kernel_f64 sum[2][8] = {0};
    for (int half = 0; half < 2; half++) {
        kernel_f64 at[3][8];
        for (int a = 0; a < 3; a++)
            for (int i = 0; i < count; i++) memcpy(&at[a][i], world[a][i] + half * KERNEL_HALF, sizeof at[a][i]);
        for (int i = 0; i < count; i++)
            for (int j = i + 1; j < count; j++) {
                kernel_f64_mask after = (kernel_f64_mask)(at[2][j] < at[2][i]);
                for (int a = 1; a >= 0; a--)
                    after = (kernel_f64_mask)(at[a][j] < at[a][i]) | ((kernel_f64_mask)(at[a][j] == at[a][i]) & after);
                const kernel_f64 one = kernel_f64_select(after, (kernel_f64){0} + 1, (kernel_f64){0});
                sum[half][i] += one;
                sum[half][j] += 1 - one;
            }
    }
    for (int i = 0; i < count; i++)
        for (int half = 0; half < 2; half++) kernel_f64_store_lanes(&rank[i], half, sum[half][i]);
}

/* Does one step of a transposition of 16 × 16 floats, after vf_transpose() has transposed the 4 × 4 blocks: exchanges
 * blocks whose distance from each other is `apart` (4 or 8) vectors and lanes. number: 0 .. 15, one per lane. */
SIMD_INLINE void kernel_local_transpose(vf v[KERNEL_LOCAL_ROW], vi number, int apart)
{
    const vi odd = -(number / apart & 1), low = number + (odd & (SIMD_WIDTH - apart)), high = low + apart;
    for (int i = 0; i < KERNEL_LOCAL_ROW / 2; i++) {
        const int n = i / apart * 2 * apart + i % apart;
        const vf one = v[n], other = v[n + apart];
        v[n] = vf_permute_pair(one, other, low);
        v[n + apart] = vf_permute_pair(one, other, high);
    }
}

/* Stores row number `row` of every cell, by transposing two lists of up to 8 vectors each, whose lanes are cells. */
SIMD_INLINE void kernel_local_row_of(const float (*first)[SIMD_WIDTH], int first_count,
                                     const float (*second)[SIMD_WIDTH], int second_count, int row,
                                     kernel_local_faces *out)
{
    static const int32_t numbers[KERNEL_LOCAL_ROW] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
    vf v[KERNEL_LOCAL_ROW];
    vi number;
    memcpy(&number, numbers, sizeof number);
    for (int i = 0; i < KERNEL_LOCAL_ROW / 2; i++) {
        v[i] = i < first_count ? vf_load(first[i]) : vf_set(0);
        v[i + KERNEL_LOCAL_ROW / 2] = i < second_count ? vf_load(second[i]) : vf_set(0);
    }
    for (int i = 0; i < KERNEL_LOCAL_ROW; i += 4) vf_transpose(v + i);
    kernel_local_transpose(v, number, 4);
    kernel_local_transpose(v, number, 8);
    for (int lane = 0; lane < SIMD_WIDTH; lane++) vf_store(out->rows[lane][row], v[lane]);
}

/* Reads, per lane, the slopes and origins of the tile's rays at the cell's first and last column and row. */
SIMD_INLINE void kernel_local_ray_box(const kernel_tile *tile, int32_t ends[4][SIMD_WIDTH], kernel_ray_box *out)
{
    const vf first = vf_set(0), last = vf_set(KERNEL_TILE - 1);
    for (int n = 0; n < 4; n++) {
        const int a = n / 2, end = n % 2;
        vi at;
        memcpy(&at, ends[n], sizeof at);
        at = vi_from_vf(vf_clamp(vf_from_vi(at), first, last));
        out->slope[a][end] = kernel_gather_tile_numbers(a ? tile->slope_y : tile->slope_x, at);
        out->origin[a][end] = kernel_gather_tile_numbers(a ? tile->origin_y : tile->origin_x, at);
    }
}

/* Computes the faces of all lanes' cells. lists: x, y, z, the field and the rank, each by vertex. ends: first and last
 * column and row of each cell (kernel_local_pixels()). */
SIMD_INLINE void kernel_local_faces_of(const kernel_tile *tile, vf (*const lists)[8], int32_t ends[4][SIMD_WIDTH],
                                       int type, kernel_local_faces *out)
{
    const kernel_shape *shape = kernel_cell_shape(type);
    kernel_ray_box box;
    kernel_local_ray_box(tile, ends, &box);
    vf_store(out->nonconvex, vf_from_bits(kernel_curved_nonconvex_quads(lists, &box, type)));
    for (int n = 0; n < 4; n++)
        for (int i = 0; i < grid_type_vertices(type); i++) vf_store(out->at[n][i], lists[n][i]);
    for (int face = 0; face < shape->face_count; face++) {
        const signed char *loop = shape->faces[face].vertices;
        kernel_lanes_order unused;
        vm falls[3];
        const vi word = shape->faces[face].count == 3 ? kernel_triangle_word(loop, lists[4], &unused, falls)
                                                      : kernel_curved_quad_word(loop, lists[4]);
        vf_store(out->words[face], vf_from_bits(word));
    }
    if (SIMD_WIDTH < KERNEL_LOCAL_ROW) return;
    const int count = grid_type_vertices(type);
    for (int n = 0; n < 2; n++) kernel_local_row_of(out->at[2 * n], count, out->at[2 * n + 1], count, n, out);
    kernel_local_row_of(out->words, shape->face_count, NULL, 0, 2, out);
}

/* ---- rays ---- */

static __attribute__((noinline)) void kernel_local_find_faces_nonconvex(const kernel_local_faces *f,
                                                                        const kernel_lane_rays *own,
                                                                        const vi *nonconvex, vm rays, int type,
                                                                        kernel_curved_crossed *out)
{
    KERNEL_OF_TYPE(type, kernel_curved_find, (const float(*)[8][SIMD_WIDTH])f->at, own, nonconvex, rays, out);
}

/* Finds the two faces that each ray crosses once. All other rays are added to out->alone, to be traced one by one. */
SIMD_INLINE void kernel_local_find_faces(const kernel_local_faces *f, const kernel_lane_rays *own, vm rays, int type,
                                         kernel_curved_crossed *out)
{
    const vi nonconvex = vi_from_bits(kernel_gather_lane(f->nonconvex, own->lane));
    if (vm_any(vm_and(rays, vm_sign(-nonconvex))))
        kernel_local_find_faces_nonconvex(f, own, &nonconvex, rays, type, out);
    else
        kernel_curved_find((const float(*)[8][SIMD_WIDTH])f->at, own, NULL, rays, out, type);
}

/* ---- corners ---- */

/* The corners of one face of each ray's cell, in the order of the face's word: position in the ray's plane (x and y),
 * depth, and field. */
typedef struct kernel_local_corners {
    vi vertex[4];
    vf at[4][4];
} kernel_local_corners;

/* The one or two cells to which the rays of a vector of 16 mostly belong, because rays are listed cell by cell. One
 * permutation of the two cells' rows then reads a number of a vertex for each ray. */
typedef struct kernel_local_pair {
    const float (*rows[2])[KERNEL_LOCAL_ROW]; /* the rows of data of the two cells */
    /* added to the index of a permutation: SIMD_WIDTH for rays whose cell is the second one, and 0 for all others */
    vi second;
} kernel_local_pair;

SIMD_INLINE bool kernel_local_pair_of(const kernel_local_faces *f, vm rays, vi lane, kernel_local_pair *out)
{
    if (KERNEL_LOCAL_ROW != SIMD_WIDTH) return false;
    const unsigned bits = vm_bits(rays);
    if (!bits) return false;
    int32_t lanes[SIMD_WIDTH];
    memcpy(lanes, &lane, sizeof lanes);
    const int first = lanes[__builtin_ctz(bits)], last = lanes[31 - __builtin_clz(bits)];
    const vf own = vf_from_vi(lane);
    const vm in_first = vf_eq(own, vf_set((float)first)), in_last = vf_eq(own, vf_set((float)last));
    out->rows[0] = f->rows[first];
    out->rows[1] = f->rows[last];
    out->second = vi_select(in_first, vi_set(0), vi_set(SIMD_WIDTH));
    return !vm_any(vm_andnot(rays, vm_or(in_first, in_last)));
}

/* Gathers the corners of each ray's face. pair: NULL if the rays have more than two different cells. */
SIMD_INLINE void kernel_local_corners_gather(const kernel_local_faces *f, const kernel_local_pair *pair, int type,
                                             vi lane, vi face, kernel_local_corners *out)
{
    enum { WORDS = 2, HALF = KERNEL_LOCAL_ROW / 2 };
    const float *const first = pair ? pair->rows[0][0] : NULL, *const last = pair ? pair->rows[1][0] : NULL;
    const vi word =
        pair ? vi_from_bits(vf_permute_pair(vf_load(first + WORDS * KERNEL_LOCAL_ROW),
                                            vf_load(last + WORDS * KERNEL_LOCAL_ROW), face | pair->second))
             : vi_from_bits(kernel_curved_gather_vertex(f->words, kernel_cell_shape(type)->face_count, lane, face));
    for (int i = 0; i < 4; i++) {
        out->vertex[i] = word >> (4 * i) & 7;
        for (int n = 0; n < 4; n++) {
            const int row = n / 2 * KERNEL_LOCAL_ROW;
            out->at[i][n] = pair
                                ? vf_permute_pair(vf_load(first + row), vf_load(last + row),
                                                  (out->vertex[i] | pair->second) + n % 2 * HALF)
                                : kernel_curved_gather_vertex(f->at[n], grid_type_vertices(type), lane, out->vertex[i]);
        }
    }
}

SIMD_INLINE void kernel_local_corners_of(const kernel_local_faces *f, const kernel_lane_rays *rays, vm active, int type,
                                         const vi face[2], kernel_local_corners out[2])
{
    kernel_local_pair pair;
    if (__builtin_expect(kernel_local_pair_of(f, active, rays->lane, &pair), 1))
        for (int n = 0; n < 2; n++) kernel_local_corners_gather(f, &pair, type, rays->lane, face[n], &out[n]);
    else
        for (int n = 0; n < 2; n++) kernel_local_corners_gather(f, NULL, type, rays->lane, face[n], &out[n]);
    for (int n = 0; n < 2; n++)
        for (int i = 0; i < 4; i++) {
            vf *at = out[n].at[i];
            at[0] = (at[0] - rays->rays.origin_x) - rays->rays.slope_x * at[2];
            at[1] = (at[1] - rays->rays.origin_y) - rays->rays.slope_y * at[2];
        }
}

/* Returns a vertex's reference coordinate on an axis, relative to the middle of the cell. */
SIMD_INLINE vf kernel_local_vertex_coordinate(int type, int axis, vi vertex)
{
    static const float own[3][3][KERNEL_LOCAL_ROW] = {
        {{-0.5f, 0.5f, 0.5f, -0.5f, -0.5f, 0.5f, 0.5f, -0.5f},
         {-0.5f, -0.5f, 0.5f, 0.5f, -0.5f, -0.5f, 0.5f, 0.5f},
         {-0.5f, -0.5f, -0.5f, -0.5f, 0.5f, 0.5f, 0.5f, 0.5f}},
        {{0 - 1.0f / 3, 1 - 1.0f / 3, 0 - 1.0f / 3, 0 - 1.0f / 3, 1 - 1.0f / 3, 0 - 1.0f / 3},
         {0 - 1.0f / 3, 0 - 1.0f / 3, 1 - 1.0f / 3, 0 - 1.0f / 3, 0 - 1.0f / 3, 1 - 1.0f / 3},
         {-0.5f, -0.5f, -0.5f, 0.5f, 0.5f, 0.5f}},
        {{-0.5f, 0.5f, 0.5f, -0.5f, 0}, {-0.5f, -0.5f, 0.5f, 0.5f, 0}, {1, 1, 1, 1, 0}}};
    const float *of = own[kernel_shape_number(type)][axis];
    return SIMD_WIDTH < 8 ? vf_gather(of, vertex) : vf_permute(vf_load(of), vertex);
}

/* ---- crossing points ---- */

SIMD_INLINE void kernel_local_quad_of(const kernel_local_corners *c, kernel_quad *q)
{
    for (int i = 0; i < 4; i++) {
        q->x[i] = c->at[i][0];
        q->y[i] = c->at[i][1];
        q->z[i] = c->at[i][2];
    }
}

SIMD_INLINE void kernel_local_quad_end(const kernel_local_corners *c, int type, const kernel_quad_point *place,
                                       kernel_point *out)
{
    const vf f[4] = {c->at[0][3], c->at[1][3], c->at[2][3], c->at[3][3]};
    out->t = place->t;
    out->value = kernel_bilinear(f, place->s, place->r);
    for (int a = 0; a < 3; a++) {
        const vf base = kernel_local_vertex_coordinate(type, a, c->vertex[0]);
        const vf along = kernel_local_vertex_coordinate(type, a, c->vertex[1]) - base;
        const vf across = kernel_local_vertex_coordinate(type, a, c->vertex[3]) - base;
        out->r[a] = (base + place->s * along) + place->r * across;
    }
}

SIMD_INLINE vf kernel_local_weighted_mean(const vf e[3], vf inverse, vf i, vf j, vf k)
{
    return vf_muladd(e[0], k, vf_muladd(-e[2], j, e[1] * i)) * inverse;
}

/* Computes the rays' crossings of triangles, whose corners are in the order of their coordinates, so that all cells of
 * a face get the same bits. */
SIMD_INLINE void kernel_local_triangle_end(const kernel_local_corners *c, int type, kernel_point *out)
{
    const vf *i = c->at[0], *j = c->at[1], *k = c->at[2];
    const vf e[3] = {vf_diff_of_products(i[0], j[1], j[0], i[1]), vf_diff_of_products(j[0], k[1], k[0], j[1]),
                     vf_diff_of_products(i[0], k[1], k[0], i[1])};
    const vf inverse = 1.0f / kernel_weight(e[0], e[1], e[2]);
    out->t = kernel_local_weighted_mean(e, inverse, i[2], j[2], k[2]);
    out->value = kernel_local_weighted_mean(e, inverse, i[3], j[3], k[3]);
    for (int a = 0; a < 3; a++)
        out->r[a] = kernel_local_weighted_mean(e, inverse, kernel_local_vertex_coordinate(type, a, c->vertex[0]),
                                               kernel_local_vertex_coordinate(type, a, c->vertex[1]),
                                               kernel_local_vertex_coordinate(type, a, c->vertex[2]));
}

/* Computes the crossings of the rays in on_quad[n] with quads; the points of other rays are undefined. */
SIMD_INLINE void kernel_local_cross_quads(const kernel_local_corners corners[2], int type, const vm on_quad[2],
                                          kernel_point ends[2])
{
    const int count = kernel_has_apex(type) ? 1 : 2;
    kernel_quad quads[2];
    kernel_quad_point places[2];
    for (int n = 0; n < count; n++) kernel_local_quad_of(&corners[n], &quads[n]);
    kernel_quads_cross(quads, count, on_quad, true, places);
    for (int n = 0; n < count; n++) kernel_local_quad_end(&corners[n], type, &places[n], &ends[n]);
}

/* Computes entry and exit of the rays that cross two faces; the nearer point comes first. */
SIMD_INLINE void kernel_local_cross(const kernel_local_faces *f, const kernel_lane_rays *rays,
                                    const kernel_curved_crossed *crossed, int type, kernel_point out[2])
{
    const vi face[2] = {crossed->first, crossed->last};
    vm on_quad[2];
    kernel_local_corners corners[2];
    kernel_local_corners_of(f, rays, crossed->two, type, face, corners);
    for (int n = 0; n < 2; n++) on_quad[n] = vm_and(crossed->two, kernel_curved_on_quad(type, n, face[n]));
    if (kernel_has_triangles(type)) memset(out, 0, 2 * sizeof *out);
    if (kernel_is_box(type) || vm_any(vm_or(on_quad[0], on_quad[1])))
        kernel_local_cross_quads(corners, type, on_quad, out);
    for (int n = 0; n < 2 && kernel_has_triangles(type); n++) {
        const vm on_triangle = vm_andnot(crossed->two, on_quad[n]);
        kernel_point end;
        if (!vm_any(on_triangle)) continue;
        kernel_local_triangle_end(&corners[n], type, &end);
        kernel_point_move(on_triangle, &end, &out[n]);
    }
    kernel_points_order(out);
}

#endif
