/* Reads, sorts and transforms hexes, wedges or pyramids of one type, one per lane, and computes the edge functions of
 * their triangular faces. The operations are those of the functions for single cells, kernel_cell_subtract_isovalue(),
 * kernel_transform_in_tile(), kernel_cell_sort_vertices() and kernel_cell_compute_lines(), so the results are
 * bit-identical. Vertices are put in canonical order first (kernel_cell_canonical_order()), so that all data are stored
 * in that order. Computations in double are done for one half of the lanes (kernel_wide.h) after the other. Callers
 * pass the type as a constant, so that loops have constant lengths. */
#ifndef RENDER_KERNEL_TRANSFORMED_CURVED_H
#define RENDER_KERNEL_TRANSFORMED_CURVED_H

#include <math.h>
#include <string.h>

#include "grid.h"
#include "kernel_arrays.h"
#include "kernel_cell.h"
#include "kernel_lanes_cell.h"
#include "kernel_shapes.h"
#include "kernel_types.h"
#include "kernel_wide.h"
#include "simd.h"

enum {
    KERNEL_CURVED_EDGES = 12,
    KERNEL_CURVED_FACES = 6,
    KERNEL_MAX_TRIANGLES = 4, /* maximum number of triangular faces of a cell */
    KERNEL_LOCAL_ROW = 16,
    KERNEL_LOCAL_ROWS = 3
};

/* Transformed cells of one type, one per lane. */
typedef struct kernel_transformed_curved {
    /* at[n][vertex][lane]: x, y, z in tile space (n = 0, 1, 2), and the field minus the isovalue, scaled (n = 3,
     * kernel_cell_subtract_isovalue()) */
    float at[4][8][SIMD_WIDTH];
    /* corners[face * SIMD_WIDTH + lane]: a word with the indices, in the cell, of the vertices at the face's corners,
     * four bits each, from bit 0 on. Quads are in the order of kernel_quad_corners(), triangles in the order of
     * coordinates (kernel_sort_triangle_vertices()). */
    int32_t corners[KERNEL_CURVED_FACES * SIMD_WIDTH];
    /* The lines (kernel_line) of the edges of triangular faces. triangles[n] belongs to the n-th triangular face in the
     * list of faces of kernel_shape: the members c, cu, cv and bound, each for the edges ij, jk and ik, where i, j, k
     * are the triangle's corners in the order of coordinates. */
    float triangles[KERNEL_MAX_TRIANGLES][4][3][SIMD_WIDTH];
    /* for each triangular face, the least sum of a crossing's weights at which the crossing is accurate
     * (kernel_compute_triangle_least_weight()) */
    float least[KERNEL_MAX_TRIANGLES][SIMD_WIDTH];
    unsigned cuboids; /* mask of the lanes with a hex whose edges are parallel to the world axes */
    /* The following two members are used only for segments of volumes (kernel_local_crossings.h). nonconvex: per cell,
     * a mask of its faces, stored as the bits of a float; a bit is set if the face is a quad that may be nonconvex in
     * the projection along some ray through the cell's pixels (kernel_curved_nonconvex_quads()). */
    float nonconvex[SIMD_WIDTH];
    /* for vectors of 16 lanes: a copy of `at` and `corners` in which the numbers of a cell are contiguous, in three
     * rows of 16 numbers per cell: x and y by vertex; z and the field by vertex; `corners` by face */
    float rows[SIMD_WIDTH < KERNEL_LOCAL_ROW ? 1 : SIMD_WIDTH][KERNEL_LOCAL_ROWS][KERNEL_LOCAL_ROW];
    /* The following members are used only by kernel_copy_transformed_curved_cell(), which copies one lane's cell.
     * world: coordinates by vertex and axis, in two halves of the lanes; rank: rank of each vertex in the order of
     * coordinates; vertex: index of each vertex in the mesh. */
    kernel_f64 world[8][3][2];
    int32_t rank[8][SIMD_WIDTH], vertex[8][SIMD_WIDTH];
} kernel_transformed_curved;

/* Returns the index of the first triangular face in the list of faces of a cell type's kernel_shape; the other
 * triangular faces follow it. */
SIMD_INLINE int kernel_first_triangle(int type)
{
    return kernel_has_apex(type) ? 1 : 0;
}

/* ---- gathering numbers of each ray's cell ---- */

/* Returns of[corner][lane] for each ray: a number that belongs to the vertex (or face) with the index `corner` of the
 * cell in `lane`. Cells have `count` vertices (or faces). With 16 lanes, permutations of all rows are faster than a
 * gather; with 8 they are slower. */
SIMD_INLINE vf kernel_curved_gather_vertex(const float (*of)[SIMD_WIDTH], int count, vi lane, vi corner)
{
    if (SIMD_WIDTH < 16) return vf_gather(of[0], corner * SIMD_WIDTH + lane);
    const vi in_two = lane | (corner & 1) * SIMD_WIDTH;
    const vm second = vm_sign(corner << 30), upper = vm_sign(corner << 29);
    vf four[4], two[2];
    for (int i = 0; 2 * i < count; i++)
        four[i] = 2 * i + 1 < count ? vf_permute_pair(vf_load(of[2 * i]), vf_load(of[2 * i + 1]), in_two)
                                    : kernel_gather_lane(of[2 * i], lane);
    for (int i = 0; 4 * i < count; i++)
        two[i] = 4 * i + 2 < count ? vf_select(second, four[2 * i + 1], four[2 * i]) : four[2 * i];
    return count > 4 ? vf_select(upper, two[1], two[0]) : two[0];
}

/* ---- canonical order of vertices ---- */

SIMD_INLINE void kernel_sorted_curved_swap(kernel_sorted_vertices *h, bool is_narrow, vm lanes, int i, int j)
{
    const vf was = h->rank[i];
    kernel_sorted_swap(h, is_narrow, lanes, i, j);
    h->rank[i] = vf_select(lanes, h->rank[j], was);
    h->rank[j] = vf_select(lanes, was, h->rank[j]);
}

/* Computes each vertex's rank in the lexicographic order of coordinates. Vertices with equal coordinates are ranked in
 * their given order. */
SIMD_INLINE void kernel_sorted_curved_rank(kernel_sorted_vertices *h, bool is_narrow, int count)
{
    const vf zero = vf_set(0), one = vf_set(1);
    for (int i = 0; i < count; i++) h->rank[i] = vf_set((float)i);
    for (int i = 0; i < count; i++)
        for (int j = i + 1; j < count; j++) {
            const vf after = vf_select(kernel_is_raw_position_before(is_narrow, h->at[j], h->at[i]), one, zero);
            h->rank[i] += after;
            h->rank[j] -= after;
        }
}

/* Puts a hex's vertices in canonical order. First the hex is mirrored along its reference coordinates such that the
 * vertex of smallest rank becomes vertex 0. Then its three reference coordinates are exchanged such that the ranks of
 * the neighbours of vertex 0 increase along x, y, z. */
SIMD_INLINE void kernel_sort_hex_vertices(kernel_sorted_vertices *h, bool is_narrow)
{
    /* vertex[b]: index of the hex's vertex whose reference coordinates x, y and z, each 0 or 1, are bits 0, 1 and 2 of
     * b */
    static const signed char vertex[8] = {0, 1, 3, 2, 4, 5, 7, 6};
    vm is_mirrored[3] = {vm_none(), vm_none(), vm_none()};
    for (int b = 1; b < 8; b++) {
        const vm least = vf_eq(h->rank[(int)vertex[b]], vf_set(0));
        for (int a = 0; a < 3; a++)
            if (b >> a & 1) is_mirrored[a] = vm_or(is_mirrored[a], least);
    }
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 8; b++)
            if (!(b >> a & 1)) kernel_sorted_curved_swap(h, is_narrow, is_mirrored[a], vertex[b], vertex[b | 1 << a]);
    for (int k = 0; k < 3; k++) {
        /* sorting network of three: compares axes 0 and 1, 1 and 2, 0 and 1 */
        const int at = k == 1, low = 1 << at, high = 2 << at, other = 7 & ~(low | high);
        const vm swap = vf_lt(h->rank[(int)vertex[high]], h->rank[(int)vertex[low]]);
        kernel_sorted_curved_swap(h, is_narrow, swap, vertex[low], vertex[high]);
        kernel_sorted_curved_swap(h, is_narrow, swap, vertex[low | other], vertex[high | other]);
    }
}

/* Puts a wedge's vertices in canonical order. Vertex 0 is the vertex of smallest rank. Vertex 1 is that one of the two
 * other vertices of its triangle that has the smaller rank. */
SIMD_INLINE void kernel_sort_wedge_vertices(kernel_sorted_vertices *h, bool is_narrow)
{
    vm over = vm_none();
    for (int i = 3; i < 6; i++) over = vm_or(over, vf_eq(h->rank[i], vf_set(0)));
    for (int i = 0; i < 3; i++) kernel_sorted_curved_swap(h, is_narrow, over, i, i + 3);
    for (int i = 1; i < 3; i++) {
        const vm first = vf_eq(h->rank[i], vf_set(0));
        kernel_sorted_curved_swap(h, is_narrow, first, 0, i);
        kernel_sorted_curved_swap(h, is_narrow, first, 3, i + 3);
    }
    const vm swap = vf_lt(h->rank[2], h->rank[1]);
    kernel_sorted_curved_swap(h, is_narrow, swap, 1, 2);
    kernel_sorted_curved_swap(h, is_narrow, swap, 4, 5);
}

/* Puts a pyramid's vertices in canonical order. Vertex 0 is the vertex of the base with the smallest rank. Vertex 1 is
 * that one of its two neighbours in the base that has the smaller rank. The apex stays last. */
SIMD_INLINE void kernel_sort_pyramid_vertices(kernel_sorted_vertices *h, bool is_narrow)
{
    const vf least = vf_min(vf_min(h->rank[0], h->rank[1]), vf_min(h->rank[2], h->rank[3]));
    const vm second = vf_eq(h->rank[1], least), third = vf_eq(h->rank[2], least), fourth = vf_eq(h->rank[3], least);
    kernel_sorted_curved_swap(h, is_narrow, second, 0, 1);
    kernel_sorted_curved_swap(h, is_narrow, second, 2, 3);
    kernel_sorted_curved_swap(h, is_narrow, third, 0, 2);
    kernel_sorted_curved_swap(h, is_narrow, fourth, 0, 3);
    kernel_sorted_curved_swap(h, is_narrow, fourth, 1, 2);
    kernel_sorted_curved_swap(h, is_narrow, vf_lt(h->rank[3], h->rank[1]), 1, 3);
}

SIMD_INLINE void kernel_sorted_curved_sort(kernel_sorted_vertices *h, bool is_narrow, int type)
{
    if (kernel_is_box(type))
        kernel_sort_hex_vertices(h, is_narrow);
    else if (kernel_is_prism(type))
        kernel_sort_wedge_vertices(h, is_narrow);
    else
        kernel_sort_pyramid_vertices(h, is_narrow);
}

/* Returns the lanes whose cell has an edge of length zero, so that a quad has collapsed to a triangle
 * (kernel_quad_collapses()) or a triangle to a line. */
SIMD_INLINE vm kernel_find_cells_with_collapsed_edges(const kernel_sorted_vertices *h, bool is_narrow, int type)
{
    const kernel_shape *shape = kernel_cell_shape(type);
    vm out = vm_none();
    for (int n = 0; n < shape->edge_count; n++) {
        const int a = shape->edges[n][0], b = shape->edges[n][1];
        vm same = vm_all_lanes();
        for (int axis = 0; axis < 3; axis++)
            same = vm_and(same, kernel_raw_eq(is_narrow, &h->at[a][axis], &h->at[b][axis]));
        out = vm_or(out, same);
    }
    return out;
}

/* Returns the lanes whose hex has edges parallel to the world axes. In canonical order, the first, second and third
 * reference coordinate of such a hex increase along the world's z, y and x axis. Each world coordinate of a vertex then
 * equals that of vertex 0 or that of the neighbour of vertex 0 along this axis. */
SIMD_INLINE vm kernel_find_axis_parallel_hexes(const kernel_sorted_vertices *h, bool is_narrow, int type)
{
    static const int neighbours[3] = {4, 3, 1};
    vm out = vm_all_lanes();
    for (int axis = 0; axis < 3; axis++)
        for (int i = 1; i < 8; i++) {
            const int like = kernel_cell_shape(type)->corners[i][2 - axis] > 0 ? neighbours[axis] : 0;
            if (i != like) out = vm_and(out, kernel_raw_eq(is_narrow, &h->at[i][axis], &h->at[like][axis]));
        }
    return out;
}

/* Reads the vertices, permutes them into canonical order, and stores their indices, coordinates and ranks. Returns the
 * lanes whose cell has an edge of length zero. */
SIMD_INLINE vm kernel_sorted_curved_fetch(kernel_transformed_curved *out, const kernel_arrays *p, bool is_narrow,
                                          int type, int32_t (*const vertices)[SIMD_WIDTH])
{
    const int count = grid_type_vertex_count(type);
    kernel_sorted_vertices h;
    for (int i = 0; i < count; i++) {
        memcpy(&h.vertex[i], vertices[i], sizeof h.vertex[i]);
        kernel_arrays_positions(p, is_narrow, h.vertex[i], h.at[i]);
    }
    kernel_sorted_curved_rank(&h, is_narrow, count);
    kernel_sorted_curved_sort(&h, is_narrow, type);
    for (int i = 0; i < count; i++) {
        const vi own_rank = vi_from_vf(h.rank[i]);
        for (int a = 0; a < 3; a++) kernel_raw_widen(is_narrow, &h.at[i][a], out->world[i][a]);
        memcpy(out->rank[i], &own_rank, sizeof own_rank);
        memcpy(out->vertex[i], &h.vertex[i], sizeof h.vertex[i]);
    }
    out->cuboids = kernel_is_box(type) ? vm_bits(kernel_find_axis_parallel_hexes(&h, is_narrow, type)) : 0;
    return kernel_find_cells_with_collapsed_edges(&h, is_narrow, type);
}

/* ---- edge functions ---- */

/* Returns a word with the indices, in the cell, of the vertices at a quad's corners, four bits each, from bit 0 on. The
 * corners are listed in cyclic order: first the corner of smallest rank, then that one of its two neighbours which has
 * the smaller rank. loop: the quad's vertices in cyclic order. */
SIMD_INLINE vi kernel_pack_sorted_quad_corners(const signed char *loop, const vf rank[8])
{
    const vf r[4] = {rank[loop[0]], rank[loop[1]], rank[loop[2]], rank[loop[3]]};
    /* lanes in which corner 2 has a smaller rank than corner 0 (second), corner 3 a smaller rank than corner 1
     * (fourth), and corner 1 or 3 has the smallest of all ranks (odd) */
    const vm second = vf_lt(r[2], r[0]), fourth = vf_lt(r[3], r[1]),
             odd = vf_lt(vf_min(r[1], r[3]), vf_min(r[0], r[2]));
    /* lanes in which corner 2 or 3 has the smallest rank */
    const vm far = vm_or(vm_and(odd, fourth), vm_andnot(second, odd));
    /* lanes in which the next corner in the loop has a smaller rank than the previous one; the neighbours of corners 0
     * and 2 are 1 and 3, those of corners 1 and 3 are 2 and 0 */
    const vm ahead = vm_xor(far, vm_or(vm_and(odd, second), vm_andnot(vm_not(fourth), odd)));
    const vi one = vi_set(1), none = vi_set(0);
    const vi first = vi_select(odd, one, none) + (vi_select(far, one, none) << 1);
    const vi step = vi_select(ahead, one, vi_set(-1));
    const int loops = loop[0] | loop[1] << 4 | loop[2] << 8 | loop[3] << 12;
    vi word = none;
    for (int i = 0; i < 4; i++) word |= (vi_set(loops) >> (((first + i * step) & 3) << 2) & 15) << (4 * i);
    return word;
}

/* Returns a word with the indices, in the cell, of the vertices at a triangle's corners, sorted by rank, four bits
 * each, from bit 0 on. first[n], last[n]: the lanes in which vertex n of the loop has the smallest and the largest
 * rank; falls[n]: the lanes in which the rank decreases from vertex n of the loop to the next. */
SIMD_INLINE vi kernel_pack_sorted_triangle_corners(const signed char *loop, const vf rank[8], vm first[3], vm last[3],
                                                   vm falls[3])
{
    const vf r[3] = {rank[(int)loop[0]], rank[(int)loop[1]], rank[(int)loop[2]]};
    vi word = vi_set(0);
    for (int i = 0; i < 3; i++) falls[i] = vf_lt(r[(i + 1) % 3], r[i]);
    for (int i = 0; i < 3; i++) {
        const vm before = falls[(i + 2) % 3], behind = falls[i];
        first[i] = vm_andnot(before, behind);
        last[i] = vm_andnot(behind, before);
        word |= vi_select(first[i], vi_set(loop[i]), vi_select(last[i], vi_set(loop[i] << 8), vi_set(loop[i] << 4)));
    }
    return word;
}

/* Permutes three numbers, one per side of a triangle, into the order of the sides ij, jk, ik, where i, j, k are the
 * corners sorted by rank. opposite[n]: the number of the side opposite to corner n of the loop. first, last: from
 * kernel_pack_sorted_triangle_corners(). The sides ij, jk and ik are opposite to the corners k, i and j. */
SIMD_INLINE void kernel_permute_triangle_sides(const vm first[3], const vm last[3], const vf opposite[3], vf out[3])
{
    out[0] = vf_select(last[0], opposite[0], vf_select(last[1], opposite[1], opposite[2]));
    out[1] = vf_select(first[0], opposite[0], vf_select(first[1], opposite[1], opposite[2]));
    out[2] = opposite[2];
    for (int i = 0; i < 2; i++) out[2] = vf_select(vm_not(vm_or(first[i], last[i])), opposite[i], out[2]);
}

/* Computes six numbers for each of the cell's edges, directed from its first vertex to its second: c, cu, cv and bound
 * of kernel_line, then error and extent of kernel_edge_error. */
SIMD_INLINE void kernel_lanes_edge_functions(const kernel_transformed_curved *transformed, const kernel_frame *f,
                                             const kernel_tile *tile, int type, vf out[KERNEL_CURVED_EDGES][6])
{
    const kernel_shape *shape = kernel_cell_shape(type);
    vf at[8][3], size[8];
    for (int i = 0; i < grid_type_vertex_count(type); i++) {
        for (int a = 0; a < 3; a++) at[i][a] = vf_load(transformed->at[a][i]);
        size[i] = kernel_lanes_bound_projected_position(f, tile, at[i]);
    }
    for (int n = 0; n < shape->edge_count; n++) {
        const int i = shape->edges[n][0], j = shape->edges[n][1];
        kernel_lanes_edge_function(f, at[i], at[j], out[n]);
        kernel_lanes_compute_error_and_extent(out[n], tile->radius, at[i], at[j], &out[n][4], &out[n][5]);
        out[n][3] = kernel_lanes_bound_edge_function_error(size[i], size[j]);
    }
}

/* Stores the data of a triangular face: its corners sorted by rank, the lines of its edges, and the least sum of
 * weights at which its crossings are accurate. face: index of the face in the shape; lines: from
 * kernel_lanes_edge_functions(). */
SIMD_INLINE void kernel_store_triangular_face(kernel_transformed_curved *out, int type, int face, const vf rank[8],
                                              vf (*const lines)[6])
{
    const signed char *loop = kernel_cell_shape(type)->faces[face].vertices;
    const signed char(*sides)[2] = kernel_cell_shape(type)->faces[face].sides;
    const int number = face - kernel_first_triangle(type);
    vm first[3], last[3], falls[3];
    vf opposite[3], in_order[6][3];
    const vi word = kernel_pack_sorted_triangle_corners(loop, rank, first, last, falls);
    memcpy(out->corners + face * SIMD_WIDTH, &word, sizeof word);
    for (int n = 0; n < 6; n++) {
        for (int i = 0; i < 3; i++) {
            const int side = (i + 1) % 3;
            const vf v = lines[(int)sides[side][0]][n], turned = -v;
            const vm falling = sides[side][1] ? vm_not(falls[side]) : falls[side];
            opposite[i] = n < 3 ? vf_select(falling, turned, v) : v;
        }
        kernel_permute_triangle_sides(first, last, opposite, in_order[n]);
        for (int i = 0; i < 3 && n < 4; i++) vf_store(out->triangles[number][n][i], in_order[n][i]);
    }
    const vf error = (in_order[4][0] + in_order[4][1]) + in_order[4][2];
    const vf extent = (in_order[5][0] + in_order[5][1]) + in_order[5][2];
    vf_store(out->least[number], error * extent * (0.5f / KERNEL_WEIGHT_ERROR));
}

SIMD_INLINE void kernel_compute_face_data_of_type(kernel_transformed_curved *out, const kernel_frame *f,
                                                  const kernel_tile *tile, int type)
{
    const kernel_shape *shape = kernel_cell_shape(type);
    vf lines[KERNEL_CURVED_EDGES][6], rank[8];
    for (int i = 0; i < grid_type_vertex_count(type); i++) {
        vi own_rank;
        memcpy(&own_rank, out->rank[i], sizeof own_rank);
        rank[i] = vf_from_vi(own_rank);
    }
    if (kernel_has_triangles(type)) kernel_lanes_edge_functions(out, f, tile, type, lines);
    for (int face = 0; face < shape->face_count; face++) {
        if (kernel_has_triangles(type) && shape->faces[face].count == 3) {
            kernel_store_triangular_face(out, type, face, rank, lines);
            continue;
        }
        const vi word = kernel_pack_sorted_quad_corners(shape->faces[face].vertices, rank);
        memcpy(out->corners + face * SIMD_WIDTH, &word, sizeof word);
    }
}

/* Computes, for all faces, the words that list their corners (the member `corners`), and, for triangular faces, the
 * lines of their edges and the least sums of weights (`triangles` and `least`). */
static __attribute__((noinline)) void kernel_compute_face_data(kernel_transformed_curved *out, const kernel_frame *f,
                                                               const kernel_tile *tile, int type)
{
    KERNEL_OF_TYPE(type, kernel_compute_face_data_of_type, out, f, tile);
}

/* ---- cells of uniform and rectilinear grids ---- */

/* Returns whether in all lanes the coordinates increase along all axes of the grid, so that the lexicographic order of
 * a cell's vertices is known without sorting. cells: from kernel_lattice_cells_read(). */
SIMD_INLINE bool kernel_lattice_cells_are_sorted(const kernel_f64 (*cells)[3][2])
{
    vm sorted = vm_all_lanes();
    for (int axis = 0; axis < 3; axis++) sorted = vm_and(sorted, vd_lt(cells[0][axis], cells[1][axis]));
    return vm_bits(sorted) == vm_bits(vm_all_lanes());
}

/* Transforms the vertices of cuboids into tile space. The results are bit-identical to those of
 * kernel_lanes_transform() for single vertices, but each product is computed once for all vertices that share it. In
 * canonical order, the first, second and third reference coordinate of a vertex belong to z, y and x. */
SIMD_INLINE void kernel_lattice_cells_transform(const kernel_f64 (*cells)[3][2], const kernel_frame *f,
                                                const kernel_tile *tile, int half, kernel_transformed_curved *out,
                                                int type)
{
    const double *eye = f->job->camera.eye;
    kernel_f64 parts[3][3][2];
    for (int axis = 0; axis < 3; axis++)
        for (int end = 0; end < 2; end++) {
            const kernel_f64 d = cells[end][axis][half] - eye[axis];
            for (int a = 0; a < 3; a++) parts[a][axis][end] = f->scaled_axes[a][axis] * d;
        }
    for (int i = 0; i < 8; i++) {
        const float *corner = kernel_cell_shape(type)->corners[i];
        const int z = corner[0] > 0, y = corner[1] > 0, x = corner[2] > 0;
        kernel_f64 at[3];
        for (int a = 0; a < 3; a++) at[a] = parts[a][0][x] + parts[a][1][y] + parts[a][2][z];
        const kernel_f64 depth = f->job->camera.is_orthographic ? f->job->space.scale + 0 * at[2] : at[2];
        kernel_f64_store_half(out->at[0][i], half, at[0] - tile->centre_x * depth);
        kernel_f64_store_half(out->at[1][i], half, at[1] - tile->centre_y * depth);
        kernel_f64_store_half(out->at[2][i], half, at[2] - tile->depth_shift);
    }
}

/* Stores cells of a uniform or rectilinear grid in canonical order, and transforms them into tile space. The result is
 * bit-identical to that of the functions for general hexes. */
SIMD_INLINE void kernel_lattice_cells_store(const kernel_f64 (*cells)[3][2], int32_t (*const vertices)[SIMD_WIDTH],
                                            const kernel_frame *f, const kernel_tile *tile,
                                            kernel_transformed_curved *out, int type)
{
    /* for each vertex in canonical order: its index in VTK's order of a hex's vertices, and its rank */
    static const signed char given[8] = {0, 4, 7, 3, 1, 5, 6, 2}, rank[8] = {0, 1, 3, 2, 4, 5, 7, 6};
    for (int i = 0; i < 8; i++) {
        const vi own_rank = vi_set(rank[i]);
        memcpy(out->vertex[i], vertices[(int)given[i]], sizeof out->vertex[i]);
        memcpy(out->rank[i], &own_rank, sizeof own_rank);
        for (int axis = 0; axis < 3; axis++)
            memcpy(out->world[i][axis], cells[rank[i] >> (2 - axis) & 1][axis], sizeof out->world[i][axis]);
    }
    for (int half = 0; half < 2; half++) kernel_lattice_cells_transform(cells, f, tile, half, out, type);
    out->cuboids = vm_bits(vm_all_lanes());
}

/* ---- reading and transforming cells ---- */

/* Reads the vertices, puts them in canonical order and transforms them. Returns the lanes whose cell has an edge of
 * length zero. */
SIMD_INLINE vm kernel_transform_curved_vertices(kernel_transformed_curved *out, const kernel_arrays *p,
                                                const kernel_frame *f, const kernel_tile *tile,
                                                int32_t vertices[8][SIMD_WIDTH], int type)
{
    if (kernel_is_box(type) && kernel_arrays_have_axes(p)) {
        kernel_f64 lattice[2][3][2];
        kernel_lattice_cells_read(p, vertices[0], lattice);
        if (kernel_lattice_cells_are_sorted((const kernel_f64(*)[3][2])lattice)) {
            kernel_lattice_cells_store((const kernel_f64(*)[3][2])lattice, vertices, f, tile, out, type);
            return vm_none();
        }
    }
    const vm collapsed = p->has_narrow_positions ? kernel_sorted_curved_fetch(out, p, true, type, vertices)
                                                 : kernel_sorted_curved_fetch(out, p, false, type, vertices);
    for (int i = 0; i < grid_type_vertex_count(type); i++) {
        vf at[3];
        kernel_lanes_transform(f, tile, (const kernel_f64(*)[2])out->world[i], at);
        for (int a = 0; a < 3; a++) vf_store(out->at[a][i], at[a]);
    }
    return collapsed;
}

SIMD_INLINE vm kernel_transform_curved_of_type(kernel_transformed_curved *out, const kernel_arrays *p,
                                               const kernel_frame *f, const kernel_tile *tile,
                                               int32_t vertices[8][SIMD_WIDTH], const double isovalues[SIMD_WIDTH],
                                               int type)
{
    const int count = grid_type_vertex_count(type);
    kernel_f64 values[8][2];
    vf relative[8];
    const vm collapsed = kernel_transform_curved_vertices(out, p, f, tile, vertices, type);
    for (int i = 0; i < count; i++) {
        vi vertex;
        memcpy(&vertex, out->vertex[i], sizeof vertex);
        kernel_numbers_gather(&p->values, vertex, values[i]);
    }
    kernel_lanes_subtract_isovalues((const kernel_f64(*)[2])values, count, isovalues, relative);
    for (int i = 0; i < count; i++) vf_store(out->at[3][i], relative[i]);
    return collapsed;
}

/* Fetches cells of one type, puts their vertices in canonical order, and transforms them. vertices: indices in the
 * mesh, by vertex and lane. Returns the lanes whose cell has an edge of length zero. The data of faces are not set;
 * kernel_compute_face_data() computes them. */
static __attribute__((noinline)) vm kernel_transform_curved(kernel_transformed_curved *out, const kernel_arrays *p,
                                                            const kernel_frame *f, const kernel_tile *tile,
                                                            int32_t vertices[8][SIMD_WIDTH],
                                                            const double isovalues[SIMD_WIDTH], int type)
{
    return KERNEL_OF_TYPE(type, kernel_transform_curved_of_type, out, p, f, tile, vertices, isovalues);
}

/* ---- copying one lane's cell ---- */

/* Copies the cell in lane n to a kernel_cell. The lines of the cell's edges are not copied. */
static __attribute__((noinline)) void kernel_copy_transformed_curved_cell(const kernel_transformed_curved *h, int type,
                                                                          int n, kernel_cell *c)
{
    c->type = type;
    c->count = grid_type_vertex_count(type);
    c->is_finite = c->is_transformed = true;
    c->has_lines = false;
    for (int i = 0; i < c->count; i++) {
        c->x[i] = h->at[0][i][n];
        c->y[i] = h->at[1][i][n];
        c->z[i] = h->at[2][i][n];
        c->f[i] = h->at[3][i][n];
        c->rank[i] = h->rank[i][n];
        for (int a = 0; a < 3; a++) c->world[i][a] = kernel_halves_lane(h->world[i][a], n);
    }
}

/* Returns the index of the lowest bit that is set, per lane; the result is meaningless for 0. */
SIMD_INLINE vi kernel_least_bit(vi bits)
{
    return ((vi_from_bits(vf_from_vi(bits & -bits)) >> 23) - 127) & 7;
}

/* Finds those of the rays that cross exactly two faces (*two), and the indices of these faces in the cell (face), the
 * smaller one first. faces: per ray, one bit for each face that the ray crosses once. *alone: on entry, rays that must
 * be traced cell by cell for other reasons; on return, only those in `rays`, and also the rays that cross more than two
 * faces. */
SIMD_INLINE void kernel_curved_find_two_faces(vi faces, vm rays, vm *two, vm *alone, vi face[2])
{
    const vi others = faces & (faces - 1), more = others & (others - 1);
    *alone = vm_and(rays, vm_or(*alone, vm_sign(-more)));
    *two = vm_andnot(vm_and(rays, vm_sign(-others)), *alone);
    face[0] = kernel_least_bit(faces);
    face[1] = kernel_least_bit(others);
}

#endif
