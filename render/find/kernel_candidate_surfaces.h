/* Finds the tets, hexes, wedges and pyramids that isosurfaces cross, SIMD_WIDTH cells at a time (kernel_candidates.h):
 *
 *     cells of one type, one per lane:   do their values straddle an isovalue?
 *     cells that do, one per lane:       the slab that contains the isosurface and its box of pixels; for tets the
 *                                        points where the isovalue crosses their edges
 *
 * Below, the field is the values minus the isovalue, so that the isosurface is where the field is zero. In a tet the
 * isosurface is flat: a triangle or quadrangle whose corners are the points on the edges at which the field is zero.
 * Hits that are computed in float32 lie on it too. The reason: the weights from which depth and value at a crossing of
 * a face are computed all have one sign (kernel_cell.h) and err by a few units in the last place. So depth and value
 * are exact for some point of the face very close to the ray, and the line between two such points with values of
 * opposite signs passes through the isosurface.
 *
 * In other cells, let L be a linear function of the position, and E its largest difference from the field F at a
 * vertex. F - L is the mean of these differences, weighted by the shape functions, which are non-negative in the cell
 * and sum to 1. So |F - L| <= E in the whole cell, however distorted it is; on the cell's faces too, the interpolated
 * values are those of F. A hit is a zero of F, or is interpolated between two values of opposite signs, so that |L| <=
 * E there too: it lies in a slab, the part of the cell's convex hull between the planes L = -E and L = E, which is thin
 * if the field is smooth. This holds for points with reference coordinates in the cell. If the cell's map is folded,
 * points whose reference coordinates are outside by up to 1/4 are accepted as well (kernel_map.h). There the absolute
 * values of the shape functions sum to at most 1.5³. The map is not folded if the derivative of its nonlinear part has
 * a Frobenius norm of less than 1 (kernel_local.h): then no two reference points have the same position, and points
 * between a ray's crossings of the faces are in the cell.
 *
 * Positions are differences from the eye in float32, along the camera's axes. A hit is a mean of the vertices, and the
 * slab is computed from rounded vertices. The computed slab is therefore wrong by at most the error of the vertices, 8
 * roundings of their distance from the eye, which is less than the margins of kernel_add_candidates_of_lanes(). Also
 * the statement that cells whose map is not folded contain their hits holds only up to rounding; cells as small as the
 * rounding error lie within the margins anyway. */
#ifndef RENDER_KERNEL_CANDIDATE_SURFACES_H
#define RENDER_KERNEL_CANDIDATE_SURFACES_H

#include <math.h>
#include <string.h>

#include "kernel_arrays.h"
#include "kernel_cell_values.h"
#include "kernel_cell.h"
#include "kernel_finder.h"
#include "kernel_local.h"
#include "kernel_shapes.h"
#include "kernel_tile.h"
#include "kernel_wide.h"
#include "render.h"
#include "simd.h"

typedef struct kernel_curved_lanes {
    int count; /* number of vertices of each cell */
    /* at: vertex positions relative to the eye, in scaled units along the camera's axes; f: vertex values minus the
     * isovalue, scaled as by kernel_cell_subtract_isovalue() */
    vf at[8][3], f[8];
    /* lanes in which no position or value is NaN, or too large or too small for computations in float32; the cells of
     * other lanes are tested one by one */
    vm fitting_lanes;
    /* level: value at each vertex of the linear function L that approximates f (the top of this file); thickness: the
     * isosurface lies in the slab |L| <= thickness, between two parallel planes; infinite if no slab is known. Not set
     * for tets. */
    vf level[8], thickness;
} kernel_curved_lanes;

/* Returns the lanes in which the cell's map from reference coordinates to positions is certainly one-to-one (not
 * folded). terms: the polynomial coefficients of the three coordinates (kernel_local.h); inverse: the inverse of the
 * matrix of their linear terms. The square of the Frobenius norm (see the top of this file) must be below 0.9 instead
 * of 1, which leaves a margin far larger than all rounding errors. */
SIMD_INLINE vm kernel_find_lanes_with_unfolded_maps(int type, const vf terms[4][8], const vf inverse[3][3])
{
    vf nonlinear_part[KERNEL_NONLINEAR_TERMS][3];
    for (int k = 0; k < kernel_nonlinear_count(type); k++)
        for (int i = 0; i < 3; i++)
            nonlinear_part[k][i] =
                (inverse[i][0] * terms[0][4 + k] + inverse[i][1] * terms[1][4 + k]) + inverse[i][2] * terms[2][4 + k];
    return vf_lt(kernel_local_bound_nonlinearity(type, (const vf(*)[3])nonlinear_part), vf_set(0.9f));
}

/* Computes the members level and thickness, which define the slab (the space between two parallel planes) that contains
 * the isosurface. |f| is at most about 1. Let r be the rounding error of one coordinate. Each coordinate of a vertex
 * has an error of at most r, and each coordinate of the vertices' average (terms[a][0]) an error of at most 8 r. Lanes
 * in which the cell's volume is near float32's minimum are removed from fitting_lanes. */
SIMD_INLINE void kernel_curved_lanes_compute_slab_of(kernel_curved_lanes *l, int type)
{
    const int count = grid_type_vertex_count(type);
    vf terms[4][8], inverse[3][3], g[3], size = vf_set(0), error = size, error_bound = size;
    for (int a = 0; a < 4; a++) {
        vf v[8];
        for (int i = 0; i < count; i++) v[i] = a < 3 ? l->at[i][a] : l->f[i];
        kernel_local_fit_polynomial(type, v, terms[a]);
    }
    const vf volume = kernel_local_invert((const vf(*)[8])terms, inverse);
    l->fitting_lanes = vm_and(l->fitting_lanes, vf_lt(vf_set(1e-30f), vf_abs(volume)));
    for (int a = 0; a < 3; a++)
        g[a] = (terms[3][1] * inverse[0][a] + terms[3][2] * inverse[1][a]) + terms[3][3] * inverse[2][a];
    for (int i = 0; i < count; i++) {
        l->level[i] = terms[3][0];
        for (int a = 0; a < 3; a++) {
            const vf part = g[a] * (l->at[i][a] - terms[a][0]);
            l->level[i] += part;
            size = vf_max(vf_abs(part), size);
        }
        error = vf_max(vf_abs(l->level[i] - l->f[i]), error);
    }
    const vm unfolded = kernel_find_lanes_with_unfolded_maps(type, (const vf(*)[8])terms, (const vf(*)[3])inverse);
    error *= vf_select(unfolded, vf_set(1), vf_set(3.4f));
    for (int a = 0; a < 3; a++) {
        vf reach = vf_set(0);
        for (int i = 0; i < count; i++) reach = vf_max(vf_abs(l->at[i][a]), reach);
        error_bound += vf_abs(g[a]) * reach;
    }
    const vf thickness = error + KERNEL_OUTLINE_PAD * (1 + size) + 16 * 6e-8f * error_bound;
    l->thickness = vf_select(vf_lt(thickness, vf_set(1)), thickness, vf_set(INFINITY));
}

static __attribute__((noinline)) void kernel_curved_lanes_compute_slab(kernel_curved_lanes *l, int type)
{
    KERNEL_OF_TYPE(type, kernel_curved_lanes_compute_slab_of, l);
}

/* Computes the bounds, in the picture and in depth, of that part of the cell's convex hull that lies in the slab |L| <=
 * thickness, which contains the isosurface. The part's corners are among the vertices that lie in the slab and the
 * points at which lines between two vertices cross the slab's two planes. */
static __attribute__((noinline)) void
kernel_curved_lanes_compute_view_bounds(const kernel_finder *s, const kernel_curved_lanes *l, kernel_view_bounds *e)
{
    *e = kernel_view_bounds_empty();
    for (int i = 0; i < l->count; i++) {
        kernel_view_bounds_add(s, e, l->at[i], vf_le(vf_abs(l->level[i]), l->thickness));
        for (int j = 0; j < i; j++) {
            const vf inverse = 1.0f / (l->level[j] - l->level[i]);
            for (int side = 0; side < 2; side++) {
                const vf level = side ? l->thickness : -l->thickness, along = (level - l->level[i]) * inverse;
                const vm crossed = vm_xor(vf_lt(l->level[i], level), vf_lt(l->level[j], level));
                vf point[3];
                if (!vm_any(crossed)) continue;
                for (int a = 0; a < 3; a++) point[a] = l->at[i][a] + along * (l->at[j][a] - l->at[i][a]);
                kernel_view_bounds_add(s, e, point, crossed);
            }
        }
    }
}

/* Computes the bounds, in the picture and in depth, of the points on each tet's edges at which the field is the
 * isovalue. negative: for each vertex the lanes in which its value is below the isovalue, compared exactly. */
SIMD_INLINE void kernel_tet_lanes_compute_view_bounds(const kernel_finder *s, const kernel_curved_lanes *l,
                                                      const vm negative[4], kernel_view_bounds *e)
{
    *e = kernel_view_bounds_empty();
    for (int n = 0; n < KERNEL_TET_EDGES; n++) {
        const int i = kernel_tet_edge[n][0], j = kernel_tet_edge[n][1];
        const vm crossed = vm_xor(negative[i], negative[j]);
        const vf along = vf_max(l->f[i] / (l->f[i] - l->f[j]), vf_set(0)); /* vf_max() replaces the NaN of 0 / 0 by 0 */
        vf point[3];
        for (int a = 0; a < 3; a++) point[a] = l->at[i][a] + along * (l->at[j][a] - l->at[i][a]);
        kernel_view_bounds_add(s, e, point, crossed);
    }
}

/* Computes l->at and l->fitting_lanes for hexes of a uniform or rectilinear grid. The result is bit-identical to that
 * of kernel_curved_lanes_transform(). It is computed faster, because each product is computed once for all vertices
 * that share a coordinate. */
static __attribute__((noinline)) void kernel_lattice_lanes_transform(const kernel_finder *s, const kernel_cells *c,
                                                                     kernel_curved_lanes *l)
{
    const render_camera *camera = &s->frame->job->camera;
    const double *axes[3] = {camera->right, camera->up, camera->forward};
    kernel_f64 cells[2][3][2];
    vf parts[3][3][2];
    kernel_lattice_cells_read(&s->arrays, c->vertex[0], cells);
    l->count = 8;
    l->fitting_lanes = vm_all_lanes();
    for (int end = 0; end < 2; end++) {
        vf place[3];
        for (int k = 0; k < 3; k++) {
            const kernel_raw_numbers world = {.wide = {cells[end][k][0], cells[end][k][1]}};
            place[k] = kernel_subtract_level_from_raw(&s->arrays.coordinates[k], &world, &s->eye[k]) *
                       (float)s->frame->job->space.scale;
            for (int a = 0; a < 3; a++) parts[a][k][end] = place[k] * (float)axes[a][k];
        }
        l->fitting_lanes = kernel_keep_lanes_in_float_range(l->fitting_lanes, place);
    }
    for (int i = 0; i < 8; i++) {
        const float *corner = kernel_cell_shape(c->type)->corners[i];
        const int x = corner[0] > 0, y = corner[1] > 0, z = corner[2] > 0;
        for (int a = 0; a < 3; a++) l->at[i][a] = (parts[a][0][x] + parts[a][1][y]) + parts[a][2][z];
    }
}

/* Computes l->at and l->fitting_lanes: reads the vertices' positions relative to the eye and rotates them into the
 * camera's axes. */
SIMD_INLINE void kernel_curved_lanes_transform(const kernel_finder *s, const kernel_cells *c, int count,
                                               kernel_curved_lanes *l)
{
    if (count == 8 && kernel_arrays_have_axes(&s->arrays)) {
        kernel_lattice_lanes_transform(s, c, l);
        return;
    }
    l->count = count;
    l->fitting_lanes = vm_all_lanes();
    for (int i = 0; i < count; i++) {
        vf from_eye[3];
        kernel_finder_read_vertex_positions(s, kernel_cells_load_vertex_indices(c, i), from_eye);
        l->fitting_lanes = kernel_keep_lanes_in_float_range(l->fitting_lanes, from_eye);
        kernel_rotate_to_camera(s, from_eye, l->at[i]);
    }
}

/* Sets l->f to the values v minus the isovalue, not yet scaled, and removes lanes whose values are too large, too small
 * or NaN from l->fitting_lanes. Returns the largest |f| of each lane. */
SIMD_INLINE vf kernel_curved_lanes_subtract_isovalue(const kernel_finder *s, const kernel_raw_numbers *v, int count,
                                                     const kernel_level *level, kernel_curved_lanes *l)
{
    vf size = vf_set(0);
    for (int i = 0; i < count; i++) {
        l->f[i] = kernel_subtract_level_from_raw(&s->arrays.values, &v[i], level);
        size = vf_max(vf_abs(l->f[i]), size);
        l->fitting_lanes = vm_and(l->fitting_lanes, vf_lt(vf_abs(l->f[i]), vf_set(1e30f)));
    }
    l->fitting_lanes = vm_and(l->fitting_lanes, vf_lt(vf_set(1e-30f), size));
    return size;
}

/* Adds the cells of the lanes in `crossed` (a bit mask), which the isovalue crosses, to the candidates; e has the
 * bounds of the isosurface in them. Cells in lanes that are not in `fitting`, whose numbers are too large, too small or
 * NaN, are tested one by one. */
SIMD_INLINE void kernel_add_crossed(kernel_finder *s, const kernel_cells *c, int value, vm fitting, unsigned crossed,
                                    const kernel_view_bounds *e)
{
    const unsigned good = crossed & vm_bits(vm_and(fitting, vf_le(e->near, e->far)));
    kernel_add_candidates_of_lanes(s, e, kernel_arrays_drawn_lanes(&s->arrays, c->cell, good), c->cell,
                                   s->source + (uint32_t)value);
    for (unsigned odd = crossed & ~vm_bits(fitting); odd; odd &= odd - 1) {
        kernel_cell own;
        kernel_cell_fetch(&own, s->arrays.cells, &s->field->fields[s->part], c->cell[__builtin_ctz(odd)]);
        kernel_add_cell_if_crossed(s, &own, value);
    }
}

/* ---- tets ---- */

/* Adds those tets of the list to the candidates that isovalues of the layer cross. All tets of the list are transformed
 * before they are tested, because if one tet of a leaf is crossed, most of its tets are. */
static __attribute__((noinline)) void kernel_find_tets(kernel_finder *s, const kernel_cells *c)
{
    const unsigned all = (1u << c->count) - 1;
    kernel_curved_lanes l;
    kernel_raw_numbers v[4];
    for (int i = 0; i < 4; i++)
        kernel_arrays_values(&s->arrays, kernel_cells_load_vertex_indices(c, i), c->cell, &v[i]);
    kernel_curved_lanes_transform(s, c, 4, &l);
    const vm fitting = l.fitting_lanes;
    for (int value = 0; value < s->surface->layer->value_count; value++) {
        const kernel_level level = kernel_make_level(s->surface->layer->values[value]);
        vm negative[4], any = vm_none(), every = vm_all_lanes();
        kernel_view_bounds e;
        l.fitting_lanes = fitting;
        kernel_curved_lanes_subtract_isovalue(s, v, 4, &level, &l);
        for (int i = 0; i < 4; i++) {
            negative[i] = kernel_is_raw_number_below(&s->arrays.values, &v[i], &level);
            any = vm_or(any, negative[i]);
            every = vm_and(every, negative[i]);
        }
        const unsigned crossed = all & vm_bits(vm_andnot(any, every));
        if (!crossed) continue;
        kernel_tet_lanes_compute_view_bounds(s, &l, negative, &e);
        kernel_add_crossed(s, c, value, l.fitting_lanes, crossed, &e);
    }
}

/* ---- hexes, wedges and pyramids ---- */

/* Computes the bounds of the isosurface in each cell of the list, and adds the cells to the candidates. The layer's
 * isovalue with the index c->value must cross all of these cells. */
SIMD_INLINE void kernel_bound_and_add_crossed_cells(kernel_finder *s, const kernel_cells *c, int vertices)
{
    const kernel_level level = kernel_make_level(s->surface->layer->values[c->value]);
    kernel_curved_lanes l;
    kernel_view_bounds e;
    kernel_raw_numbers v[8];
    for (int i = 0; i < vertices; i++)
        kernel_arrays_values(&s->arrays, kernel_cells_load_vertex_indices(c, i), c->cell, &v[i]);
    kernel_curved_lanes_transform(s, c, vertices, &l);
    const vf size = kernel_curved_lanes_subtract_isovalue(s, v, vertices, &level, &l);
    /* the bits of a power of two that brings the largest magnitude near 1: its exponent is the negated exponent of that
     * magnitude */
    const vi power = (254 << 23) - (vi_from_bits(size) & vi_set(0x7f800000));
    for (int i = 0; i < vertices; i++) l.f[i] *= vf_from_bits(power);
    kernel_curved_lanes_compute_slab(&l, c->type);
    kernel_curved_lanes_compute_view_bounds(s, &l, &e);
    kernel_add_crossed(s, c, c->value, l.fitting_lanes, (1u << c->count) - 1, &e);
}

static __attribute__((noinline)) void kernel_process_crossed_cells(kernel_finder *s, kernel_cells *c)
{
    if (!c->count) return;
    kernel_cells_pad_lanes(c);
    if (c->vertices == 8)
        kernel_bound_and_add_crossed_cells(s, c, 8);
    else
        kernel_bound_and_add_crossed_cells(s, c, c->vertices);
    c->count = 0;
}

/* Appends the cells of the given lanes (a bit mask), which the layer's isovalue with the index `value` crosses, to the
 * list s->crossed of their type. A list has cells of one isovalue; if it is full or has another isovalue, its cells are
 * processed first. */
SIMD_INLINE void kernel_append_to_crossed_list(kernel_finder *s, const kernel_cells *from, int vertices, int value,
                                               unsigned lanes)
{
    kernel_cells *c = &s->crossed[kernel_lane_type_index(from->type)];
    if (lanes && value != c->value) kernel_process_crossed_cells(s, c);
    for (; lanes; lanes &= lanes - 1) {
        if (c->count == SIMD_WIDTH) kernel_process_crossed_cells(s, c);
        const int n = __builtin_ctz(lanes), to = c->count++;
        c->value = value;
        c->cell[to] = from->cell[n];
        for (int i = 0; i < vertices; i++) c->vertex[i][to] = from->vertex[i][n];
    }
}

/* Finds the cells that have vertex values on both sides of an isovalue, and appends them to the lists s->crossed. */
SIMD_INLINE void kernel_find_cells_crossed_by_isovalues(kernel_finder *s, const kernel_cells *c, int vertices)
{
    const render_surface_layer *layer = s->surface->layer;
    const unsigned all = (1u << c->count) - 1;
    kernel_raw_numbers v[8];
    for (int i = 0; i < vertices; i++)
        kernel_arrays_values(&s->arrays, kernel_cells_load_vertex_indices(c, i), c->cell, &v[i]);
    for (int value = 0; value < layer->value_count; value++) {
        const kernel_level level = kernel_make_level(layer->values[value]);
        vm any = vm_none(), every = vm_all_lanes();
        for (int i = 0; i < vertices; i++) {
            const vm below = kernel_is_raw_number_below(&s->arrays.values, &v[i], &level);
            any = vm_or(any, below);
            every = vm_and(every, below);
        }
        kernel_append_to_crossed_list(s, c, vertices, value, all & vm_bits(vm_andnot(any, every)));
    }
}

static __attribute__((noinline)) void kernel_find_crossed_curved_cells(kernel_finder *s, const kernel_cells *c)
{
    if (c->vertices == 8)
        kernel_find_cells_crossed_by_isovalues(s, c, 8);
    else
        kernel_find_cells_crossed_by_isovalues(s, c, c->vertices);
}

#endif
