/* Computes where rays enter and leave hexes, wedges and pyramids of volumes, one ray-cell pair per lane: each lane has
 * a ray and the index of the lane that holds its cell. The crossed faces are found by the signs of projected edge
 * functions; if a quad's projection is convex for the rays of all of a cell's pixels, its four edges decide
 * (kernel_quad.h). The operations are those of kernel_curved_intervals(), which intersects a packet with one cell, so
 * the results are bit-identical. Callers pass the cell type as a constant. */
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

/* ---- cells ---- */

/* Does one step of a transposition of 16 × 16 floats, after vf_transpose() has transposed the 4 × 4 blocks: exchanges
 * the blocks that are `apart` (4 or 8) vectors and lanes away from each other. */
SIMD_INLINE void kernel_local_exchange_transpose_blocks(vf v[KERNEL_LOCAL_ROW], int apart)
{
    const vi number = vi_lanes(), odd = -(number / apart & 1);
    const vi low = number + (odd & (SIMD_WIDTH - apart)), high = low + apart;
    for (int i = 0; i < KERNEL_LOCAL_ROW / 2; i++) {
        const int n = i / apart * 2 * apart + i % apart;
        const vf one = v[n], other = v[n + apart];
        v[n] = vf_permute_pair(one, other, low);
        v[n + apart] = vf_permute_pair(one, other, high);
    }
}

/* Stores row `row` of out->rows for the cells of all lanes, by transposing two lists of up to 8 vectors each, in which
 * lanes are cells. The first list fills the first half of the row, the second list the other half. */
SIMD_INLINE void kernel_local_store_transposed_row(const float (*first)[SIMD_WIDTH], int first_count,
                                                   const float (*second)[SIMD_WIDTH], int second_count, int row,
                                                   kernel_transformed_curved *out)
{
    vf v[KERNEL_LOCAL_ROW];
    for (int i = 0; i < KERNEL_LOCAL_ROW / 2; i++) {
        v[i] = i < first_count ? vf_load(first[i]) : vf_set(0);
        v[i + KERNEL_LOCAL_ROW / 2] = i < second_count ? vf_load(second[i]) : vf_set(0);
    }
    for (int i = 0; i < KERNEL_LOCAL_ROW; i += 4) vf_transpose(v + i);
    kernel_local_exchange_transpose_blocks(v, 4);
    kernel_local_exchange_transpose_blocks(v, 8);
    for (int lane = 0; lane < SIMD_WIDTH; lane++) vf_store(out->rows[lane][row], v[lane]);
}

/* Reads, per lane, the slopes and origins of the tile's rays in the first and last column and row of the lane's cell.
 * ends: these columns and rows (kernel_local_compute_pixel_bounds()). The first index of the results is 0 for columns
 * and 1 for rows, the second index 0 for the first and 1 for the last. */
SIMD_INLINE void kernel_local_get_boundary_rays(const kernel_tile *tile, int32_t ends[4][SIMD_WIDTH], vf slope[2][2],
                                                vf origin[2][2])
{
    const vf first = vf_set(0), last = vf_set(KERNEL_TILE - 1);
    for (int n = 0; n < 4; n++) {
        const int a = n / 2, end = n % 2;
        vi at;
        memcpy(&at, ends[n], sizeof at);
        at = vi_from_vf(vf_clamp(vf_from_vi(at), first, last));
        slope[a][end] = kernel_gather_from_tile_row_or_column(a ? tile->slope_y : tile->slope_x, at);
        origin[a][end] = kernel_gather_from_tile_row_or_column(a ? tile->origin_y : tile->origin_x, at);
    }
}

/* Computes, for the faces of all lanes' cells, the order of their corners, and which quads may have a projection that
 * is not convex (kernel_quad.h). Positions, ranks and field must be set in *cells. ends: first and last column and row
 * of each cell (kernel_local_compute_pixel_bounds()). */
SIMD_INLINE void kernel_local_prepare_cell_faces(const kernel_tile *tile, kernel_transformed_curved *cells,
                                                 int32_t ends[4][SIMD_WIDTH], int type)
{
    const kernel_shape *shape = kernel_cell_shape(type);
    const int count = grid_type_vertex_count(type);
    vf places[3][8], rank[8], slope[2][2], origin[2][2];
    for (int i = 0; i < count; i++) {
        vi own_rank;
        memcpy(&own_rank, cells->rank[i], sizeof own_rank);
        rank[i] = vf_from_vi(own_rank);
        for (int a = 0; a < 3; a++) places[a][i] = vf_load(cells->at[a][i]);
    }
    kernel_local_get_boundary_rays(tile, ends, slope, origin);
    vf_store(cells->nonconvex, vf_from_bits(kernel_curved_nonconvex_quads(places, slope, origin, type)));
    for (int face = 0; face < shape->face_count; face++) {
        const signed char *loop = shape->faces[face].vertices;
        vm first[3], last[3], falls[3];
        const vi word = shape->faces[face].count == 3
                            ? kernel_pack_sorted_triangle_corners(loop, rank, first, last, falls)
                            : kernel_pack_sorted_quad_corners(loop, rank);
        memcpy(cells->corners + face * SIMD_WIDTH, &word, sizeof word);
    }
    if (SIMD_WIDTH < KERNEL_LOCAL_ROW) return;
    const float(*words)[SIMD_WIDTH] = (const float(*)[SIMD_WIDTH])(const void *)cells->corners;
    for (int n = 0; n < 2; n++)
        kernel_local_store_transposed_row(cells->at[2 * n], count, cells->at[2 * n + 1], count, n, cells);
    kernel_local_store_transposed_row(words, shape->face_count, NULL, 0, 2, cells);
}

/* ---- rays ---- */

static __attribute__((noinline)) void kernel_local_find_crossed_faces_general(const kernel_transformed_curved *cells,
                                                                              const kernel_lane_rays *own,
                                                                              const vi *nonconvex, vm rays, int type,
                                                                              vm *two, vm *alone, vi face[2])
{
    KERNEL_OF_TYPE(type, kernel_curved_find_crossed_faces, (const float(*)[8][SIMD_WIDTH])cells->at, own, nonconvex,
                   rays, two, alone, face);
}

/* Finds the rays that certainly cross exactly two faces of their cells, once each (*two), and the indices of these
 * faces in the cell (face). *alone: rays for which that is uncertain, and which must be processed cell by cell. */
SIMD_INLINE void kernel_local_find_crossed_faces(const kernel_transformed_curved *cells, const kernel_lane_rays *own,
                                                 vm rays, int type, vm *two, vm *alone, vi face[2])
{
    const vi nonconvex = vi_from_bits(kernel_gather_lane(cells->nonconvex, own->lane));
    if (vm_any(vm_and(rays, vm_sign(-nonconvex))))
        kernel_local_find_crossed_faces_general(cells, own, &nonconvex, rays, type, two, alone, face);
    else
        kernel_curved_find_crossed_faces((const float(*)[8][SIMD_WIDTH])cells->at, own, NULL, rays, two, alone, face,
                                         type);
}

/* Reads the corners of the two faces that each ray crosses, if the given rays have at most two different cells. One
 * permutation of the rows of numbers of these two cells (cells->rows) then reads one number of a corner for all rays.
 * Most vectors of 16 rays have at most two cells, because rays are listed cell by cell. Returns false if there are more
 * cells, or if vectors do not have 16 lanes. */
SIMD_INLINE bool kernel_local_read_corners_of_two_cells(const kernel_transformed_curved *cells,
                                                        const kernel_lane_rays *own, vm rays, const vi face[2],
                                                        kernel_curved_corners out[2])
{
    enum { WORDS = 2, HALF = KERNEL_LOCAL_ROW / 2 };
    if (KERNEL_LOCAL_ROW != SIMD_WIDTH || !vm_any(rays)) return false;
    const unsigned bits = vm_bits(rays);
    int32_t lanes[SIMD_WIDTH];
    memcpy(lanes, &own->lane, sizeof lanes);
    const int first = lanes[__builtin_ctz(bits)], last = lanes[31 - __builtin_clz(bits)];
    const vf lane = vf_from_vi(own->lane);
    const vm in_first = vf_eq(lane, vf_set((float)first)), in_last = vf_eq(lane, vf_set((float)last));
    if (vm_any(vm_andnot(rays, vm_or(in_first, in_last)))) return false;
    /* added to the indices of a permutation of two rows: 0 selects the first cell's row, SIMD_WIDTH the second one's */
    const vi second = vi_select(in_first, vi_set(0), vi_set(SIMD_WIDTH));
    const float(*const rows[2])[KERNEL_LOCAL_ROW] = {cells->rows[first], cells->rows[last]};
    for (int k = 0; k < 2; k++) {
        const vi word =
            vi_from_bits(vf_permute_pair(vf_load(rows[0][WORDS]), vf_load(rows[1][WORDS]), face[k] | second));
        for (int i = 0; i < 4; i++) {
            out[k].vertex[i] = word >> (4 * i) & 7;
            for (int n = 0; n < 4; n++)
                out[k].at[i][n] = vf_permute_pair(vf_load(rows[0][n / 2]), vf_load(rows[1][n / 2]),
                                                  (out[k].vertex[i] | second) + n % 2 * HALF);
        }
        kernel_curved_corners_project(&own->rays, &out[k]);
    }
    return true;
}

/* Computes the points at which rays enter and leave their cells, from the indices of the two crossed faces. out[0] is
 * the nearer point. Reference coordinates are those of kernel_local.h. */
SIMD_INLINE void kernel_local_compute_crossing_points(const kernel_transformed_curved *cells,
                                                      const kernel_lane_rays *own, vm rays, int type, const vi face[2],
                                                      kernel_point out[2])
{
    kernel_curved_corners corners[2];
    if (!__builtin_expect(kernel_local_read_corners_of_two_cells(cells, own, rays, face, corners), 1))
        for (int n = 0; n < 2; n++) kernel_curved_corners_gather(cells, own, type, face[n], &corners[n]);
    kernel_curved_cross_corners(NULL, own, rays, type, face, corners, out);
    for (int n = 0; n < 2; n++) kernel_local_shift_reference_origin(type, out[n].r);
}

#endif
