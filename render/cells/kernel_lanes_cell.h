/* Operations on one vertex or one edge per lane, each lane with a cell of its own: positions in tile space, values
 * relative to an isovalue, and edge functions (kernel_cell.h). Computations in double are done for one half of the
 * lanes (kernel_wide.h) after the other. The operations and their order are those of the functions for a single cell,
 * so the results are bit-identical to theirs. */
#ifndef RENDER_KERNEL_LANES_CELL_H
#define RENDER_KERNEL_LANES_CELL_H

#include <math.h>
#include <string.h>

#include "kernel_arrays.h"
#include "kernel_cell.h"
#include "kernel_types.h"
#include "kernel_wide.h"
#include "simd.h"

/* The vertices of one cell per lane while they are being sorted. at: coordinates by vertex and axis; vertex: index of
 * each vertex in the mesh; rank: rank of each vertex in the lexicographic order of coordinates, not set for tets. */
typedef struct kernel_sorted_vertices {
    kernel_raw_numbers at[8][3];
    vi vertex[8];
    vf rank[8];
} kernel_sorted_vertices;

/* Exchanges vertices i and j, except for their ranks, in the given lanes. */
SIMD_INLINE void kernel_sorted_swap(kernel_sorted_vertices *h, bool is_narrow, vm lanes, int i, int j)
{
    const vi was = h->vertex[i];
    for (int a = 0; a < 3; a++) kernel_raw_swap(is_narrow, lanes, &h->at[i][a], &h->at[j][a]);
    h->vertex[i] = vi_select(lanes, h->vertex[j], was);
    h->vertex[j] = vi_select(lanes, was, h->vertex[j]);
}

/* Transforms one vertex per lane, for one half of the lanes, from world coordinates into tile space, in double. Returns
 * the vertices' depths from the eye's plane in scaled units or, if the camera is orthographic, the scale of the job's
 * space. */
SIMD_INLINE kernel_f64 kernel_lanes_transform_half(const kernel_frame *f, const kernel_tile *tile,
                                                   const kernel_f64 (*world)[2], int half, kernel_f64 out[3])
{
    const double *eye = f->job->camera.eye;
    kernel_f64 d[3], at[3];
    for (int a = 0; a < 3; a++) d[a] = world[a][half] - eye[a];
    for (int a = 0; a < 3; a++)
        at[a] = f->scaled_axes[a][0] * d[0] + f->scaled_axes[a][1] * d[1] + f->scaled_axes[a][2] * d[2];
    const kernel_f64 depth = f->job->camera.is_orthographic ? f->job->space.scale + 0 * at[2] : at[2];
    out[0] = at[0] - tile->centre_x * depth;
    out[1] = at[1] - tile->centre_y * depth;
    out[2] = at[2] - tile->depth_shift;
    return depth;
}

/* Transforms one vertex per lane from world coordinates into tile space. */
SIMD_INLINE void kernel_lanes_transform(const kernel_frame *f, const kernel_tile *tile, const kernel_f64 (*world)[2],
                                        vf out[3])
{
    for (int half = 0; half < 2; half++) {
        kernel_f64 at[3];
        kernel_lanes_transform_half(f, tile, world, half, at);
        for (int a = 0; a < 3; a++) kernel_f64_store_half_of_vector(&out[a], half, at[a]);
    }
}

/* Subtracts each lane's isovalue from `count` values in double, and multiplies the differences of each lane by a power
 * of two that brings the largest magnitude near 1. */
SIMD_INLINE void kernel_lanes_subtract_isovalues(const kernel_f64 (*values)[2], int count,
                                                 const double isovalues[SIMD_WIDTH], vf *out)
{
    for (int half = 0; half < 2; half++) {
        kernel_f64 isovalue, v[8], largest = {0};
        memcpy(&isovalue, isovalues + half * KERNEL_HALF, sizeof isovalue);
        for (int i = 0; i < count; i++) {
            v[i] = values[i][half] - isovalue;
            largest = kernel_f64_max(kernel_f64_abs(v[i]), largest);
        }
        /* exponent of the largest magnitude in each lane, limited so that a number with the negated exponent is a
         * normal number */
        kernel_f64_mask exponent = (kernel_f64_mask)largest >> 52;
        const kernel_f64_mask low = exponent < 23;
        const kernel_f64_mask high = exponent > 2023;
        exponent = (low & 23) | (high & 2023) | (exponent & ~(low | high));
        const kernel_f64 scale = (kernel_f64)((2046 - exponent) << 52);
        for (int i = 0; i < count; i++) kernel_f64_store_half_of_vector(&out[i], half, v[i] * scale);
    }
}

/* Returns, for one vertex per lane, twice an upper bound of |x| and |y| of the vertex, projected along any of the
 * tile's rays (N of kernel_cell.h). */
SIMD_INLINE vf kernel_lanes_bound_projected_position(const kernel_frame *f, const kernel_tile *tile, const vf at[3])
{
    vf depth = vf_set(1);
    if (!f->job->camera.is_orthographic) depth = vf_abs(at[2]) + fabsf((float)f->depth_shift);
    return 2 * vf_max(vf_abs(at[0]), vf_abs(at[1])) + 5 * tile->radius * depth;
}

/* Returns the magnitude above which the sign of an edge's affine edge function is certain (kernel_line.bound). size_a,
 * size_b: kernel_lanes_bound_projected_position() of the vertices. */
SIMD_INLINE vf kernel_lanes_bound_edge_function_error(vf size_a, vf size_b)
{
    return 6 * 6e-8f * (size_a * size_b);
}

/* Computes the coefficients c, cu and cv of the edge function from a to b. */
SIMD_INLINE void kernel_lanes_edge_function(const kernel_frame *f, const vf a[3], const vf b[3], vf line[3])
{
    const bool flat = f->job->camera.is_orthographic;
    for (int half = 0; half < 2; half++) {
        const kernel_f64 ax = kernel_f64_widen_half(&a[0], half), ay = kernel_f64_widen_half(&a[1], half);
        const kernel_f64 bx = kernel_f64_widen_half(&b[0], half), by = kernel_f64_widen_half(&b[1], half);
        kernel_f64 da = kernel_f64_widen_half(&a[2], half) + f->depth_shift;
        kernel_f64 db = kernel_f64_widen_half(&b[2], half) + f->depth_shift;
        if (flat) da = db = (kernel_f64){0} + 1;
        kernel_f64_store_half_of_vector(&line[0], half, ax * by - bx * ay);
        kernel_f64_store_half_of_vector(&line[1], half, db * ay - da * by);
        kernel_f64_store_half_of_vector(&line[2], half, da * bx - db * ax);
    }
}

/* Computes the largest error of the edge function and the edge's extent (kernel_edge_error). line: c, cu and cv of the
 * edge function; radius: kernel_tile.radius. */
SIMD_INLINE void kernel_lanes_compute_error_and_extent(const vf line[3], float radius, const vf a[3], const vf b[3],
                                                       vf *error, vf *extent)
{
    vf apart[3];
    for (int i = 0; i < 3; i++) apart[i] = vf_abs(a[i] - b[i]);
    *error = 6e-8f * (3 * vf_abs(line[0]) + radius * (4 * vf_abs(line[1]) + 3 * vf_abs(line[2])));
    *extent = apart[2] + 0.25f * (apart[0] + apart[1]);
}

#endif
