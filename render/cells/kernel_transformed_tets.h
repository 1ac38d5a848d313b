/* Reads, sorts and transforms tets, one per lane, and computes their edge functions. The operations are those of the
 * functions for single cells, kernel_cell_move_to_tile_space() and kernel_cell_sort_vertices(), so the results are
 * bit-identical. Vertices are sorted by coordinates first, so that all data are stored in that order. Computations in
 * double are done for one half of the lanes (kernel_wide.h) after the other. */
#ifndef RENDER_KERNEL_TRANSFORMED_TETS_H
#define RENDER_KERNEL_TRANSFORMED_TETS_H

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

/* The data of kernel_cell for one tet per lane. at: x, y and z in tile space, by vertex; c, cu, cv and bound: the
 * members of kernel_line, by edge; doubt: the largest one of the six entries of `bound`; least: for each face, the
 * least sum of weights at which a crossing is accurate (kernel_compute_least_weight_sum()); vertex: indices of the
 * vertices in the mesh. The caller sets f, the vertex values as the layer needs them (kernel_cell.f), and, if the layer
 * has a colour field, `colours`, the values of that field. */
typedef struct kernel_transformed_tets {
    /* world coordinates by vertex and axis, and values by vertex, as the caller of the library passed them; in two
     * halves of the lanes */
    kernel_f64 world[4][3][2], values[4][2];
    vf at[3][4], f[4], colours[4];
    vf c[KERNEL_TET_EDGES], cu[KERNEL_TET_EDGES], cv[KERNEL_TET_EDGES], bound[KERNEL_TET_EDGES];
    vf doubt, least[4];
    vi vertex[4];
} kernel_transformed_tets;

/* Reads the vertices, and their values unless the field is cell-centred, and sorts the vertices by coordinates. A
 * bubble sort is used, because it keeps the order of vertices with equal coordinates. */
SIMD_INLINE void kernel_transformed_sort(kernel_transformed_tets *out, const kernel_arrays *p, bool is_narrow,
                                         int32_t (*const vertices)[SIMD_WIDTH])
{
    kernel_sorted_vertices h;
    for (int i = 0; i < 4; i++) {
        memcpy(&h.vertex[i], vertices[i], sizeof h.vertex[i]);
        kernel_arrays_positions(p, is_narrow, h.vertex[i], h.at[i]);
    }
    for (int last = 3; last > 0; last--)
        for (int i = 0; i < last; i++)
            kernel_sorted_swap(&h, is_narrow, kernel_is_raw_position_before(is_narrow, h.at[i + 1], h.at[i]), i, i + 1);
    for (int i = 0; i < 4; i++) {
        out->vertex[i] = h.vertex[i];
        if (!p->is_by_cell) kernel_numbers_gather(&p->values, h.vertex[i], out->values[i]);
        for (int a = 0; a < 3; a++) kernel_raw_widen(is_narrow, &h.at[i][a], out->world[i][a]);
    }
}

SIMD_INLINE void kernel_transformed_positions(kernel_transformed_tets *out, const kernel_frame *f,
                                              const kernel_tile *tile)
{
    for (int i = 0; i < 4; i++) {
        vf at[3];
        kernel_lanes_transform(f, tile, (const kernel_f64(*)[2])out->world[i], at);
        for (int a = 0; a < 3; a++) out->at[a][i] = at[a];
    }
}

/* Computes the lines of the tets' edges (c, cu, cv and bound). Also computes, for each face, the least sum of weights
 * at which a crossing of the face is accurate enough (kernel_compute_least_weight_sum()). */
SIMD_INLINE void kernel_compute_tet_edge_lines(kernel_transformed_tets *out, const kernel_frame *f,
                                               const kernel_tile *tile)
{
    vf size[4], at[4][3], error[KERNEL_TET_EDGES], extent[KERNEL_TET_EDGES];
    for (int i = 0; i < 4; i++) {
        for (int a = 0; a < 3; a++) at[i][a] = out->at[a][i];
        size[i] = kernel_lanes_bound_projected_position(f, tile, at[i]);
    }
    out->doubt = vf_set(0);
    for (int n = 0; n < KERNEL_TET_EDGES; n++) {
        const int i = kernel_tet_edge[n][0], j = kernel_tet_edge[n][1];
        vf line[3];
        kernel_lanes_edge_function(f, at[i], at[j], line);
        kernel_lanes_compute_error_and_extent(line, tile->radius, at[i], at[j], &error[n], &extent[n]);
        out->c[n] = line[0];
        out->cu[n] = line[1];
        out->cv[n] = line[2];
        out->bound[n] = kernel_lanes_bound_edge_function_error(size[i], size[j]);
        out->doubt = vf_max(out->doubt, out->bound[n]);
    }
    for (int n = 0; n < 4; n++) {
        const signed char *edge = kernel_tet_face[n] + 3;
        out->least[n] = ((error[edge[0]] + error[edge[1]]) + error[edge[2]]) *
                        ((extent[edge[0]] + extent[edge[1]]) + extent[edge[2]]) * (0.5f / KERNEL_WEIGHT_ERROR);
    }
}

/* Transforms tets whose vertices are sorted by coordinates, and computes the lines of their edges. */
static __attribute__((noinline)) void kernel_transform_sorted_tets(kernel_transformed_tets *out, const kernel_frame *f,
                                                                   const kernel_tile *tile)
{
    kernel_transformed_positions(out, f, tile);
    kernel_compute_tet_edge_lines(out, f, tile);
}

/* Fetches, sorts and transforms `count` tets. vertices: their indices in the mesh, by vertex and lane. The remaining
 * lanes get the vertices of the first tet. Values of a cell-centred field are not read. */
static __attribute__((noinline)) void kernel_transform_tets(kernel_transformed_tets *out, const kernel_arrays *p,
                                                            const kernel_frame *f, const kernel_tile *tile,
                                                            int32_t vertices[4][SIMD_WIDTH], int count)
{
    for (int i = 0; i < 4; i++)
        for (int n = count; n < SIMD_WIDTH; n++) vertices[i][n] = vertices[i][0];
    if (p->has_narrow_positions)
        kernel_transformed_sort(out, p, true, vertices);
    else
        kernel_transformed_sort(out, p, false, vertices);
    kernel_transform_sorted_tets(out, f, tile);
}

/* Sets all lanes to a tet in tile space, without edge functions. */
SIMD_INLINE void kernel_set_all_lanes_to_tet(kernel_transformed_tets *out, const kernel_cell *c)
{
    const float *const at[3] = {c->x, c->y, c->z};
    for (int i = 0; i < 4; i++) {
        for (int a = 0; a < 3; a++) out->at[a][i] = vf_set(at[a][i]);
        out->f[i] = vf_set(c->f[i]);
    }
}

/* Sets all lanes to a tet that has been read and sorted (kernel_cell_sort_vertices()), and transforms it. */
static __attribute__((noinline, unused)) void kernel_transform_single_tet(kernel_transformed_tets *out,
                                                                          const kernel_cell *c, const kernel_frame *f,
                                                                          const kernel_tile *tile)
{
    for (int i = 0; i < 4; i++)
        for (int half = 0; half < 2; half++) {
            out->values[i][half] = c->values[i] - (kernel_f64){0};
            for (int a = 0; a < 3; a++) out->world[i][a][half] = c->world[i][a] - (kernel_f64){0};
        }
    kernel_transform_sorted_tets(out, f, tile);
}

#endif
