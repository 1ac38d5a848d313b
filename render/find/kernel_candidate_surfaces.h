/* Finds the tets, hexes, wedges and pyramids that isosurfaces cross, SIMD_WIDTH cells at a time (kernel_candidates.h):
 *
 *     cells of one type, one per lane:   do their values straddle an isovalue?
 *     cells that do, one per lane:       the slab of kernel_outline.h and its box of pixels; for tets the points where
 *                                        the isovalue crosses their edges
 *
 * Positions are differences from the eye in float32, along the camera's axes. A hit is the mean of the vertices with
 * non-negative weights, and its value is the mean of their values with the same weights (kernel_outline.h). So the hit
 * lies in the slab |L| <= E of kernel_outline.h, computed from the same rounded positions. The hit's error is then at
 * most that of the vertices, 8 roundings of their distance from the eye, which is less than the margins of
 * kernel_add_lanes(). That cells whose map is not folded contain their hits also holds only up to rounding; cells whose
 * size is near the rounding error lie within the margins anyway. */
#ifndef RENDER_KERNEL_CANDIDATE_SURFACES_H
#define RENDER_KERNEL_CANDIDATE_SURFACES_H

#include <math.h>
#include <string.h>

#include "kernel_arrays.h"
#include "kernel_cell_values.h"
#include "kernel_cell.h"
#include "kernel_finder.h"
#include "kernel_outline.h"
#include "kernel_shapes.h"
#include "kernel_tile.h"
#include "kernel_wide.h"
#include "render.h"
#include "simd.h"

typedef struct kernel_curved_lanes {
    int count; /* number of vertices of each cell */
    /* at: vertex positions relative to the eye, along the camera's axes; f: vertex values minus the isovalue, scaled as
     * by kernel_cell_relative() */
    vf at[8][3], f[8];
    /* lanes whose numbers are in float32's range and not NaN; the cells of other lanes are tested one by one */
    vm fitting_lanes;
} kernel_curved_lanes;

/* at: the linear function L of kernel_outline.h at the vertices. The isosurface lies in the slab |L| <= thickness; the
 * thickness is infinite if no such slab is known. */
typedef struct kernel_curved_slab {
    vf at[8], thickness;
} kernel_curved_slab;

/* Returns the lanes whose cells are not folded, so that their map is invertible. inverse: the inverse of the Jacobian
 * at the cell's middle. The limit 0.9, instead of the exact 1, leaves a margin far larger than all rounding. */
SIMD_INLINE vm kernel_curved_lanes_unfolded(const kernel_curved_lanes *l, const kernel_differential *d, int count,
                                            vf inverse[3][3])
{
    vf y[8][3], off[12];
    vm unfolded = vm_all_lanes();
    for (int i = 1; i < count; i++) {
        vf move[3];
        for (int a = 0; a < 3; a++) move[a] = l->at[i][a] - l->at[0][a];
        for (int a = 0; a < 3; a++)
            y[i][a] = (inverse[a][0] * move[0] + inverse[a][1] * move[1]) + inverse[a][2] * move[2];
    }
    for (int a = 0; a < 3; a++) y[0][a] = vf_set(0);
    for (int n = 0; n < d->column_count; n++) {
        const signed char *v = d->columns[n].vertex;
        off[n] = vf_set(0);
        for (int a = 0; a < 3; a++) {
            vf part = (y[v[1]][a] - y[v[0]][a]) - (a == d->columns[n].along ? 1.0f : 0);
            if (v[2] != v[3]) part += y[v[3]][a] - y[v[2]][a];
            off[n] += part * part;
        }
    }
    for (int n = 0; n < d->corner_count; n++) {
        const signed char *columns = d->corners[n];
        unfolded = vm_and(unfolded, vf_lt(off[columns[0]] + off[columns[1]] + off[columns[2]], vf_set(0.9f)));
    }
    return unfolded;
}

/* Computes the linear function L (kernel_outline.h) at the vertices, and the thickness of the slab that contains the
 * isosurface. |f| is at most about 1. With r the rounding error of one coordinate, positions have an error of at most
 * r, and their mean has one of at most 8 r. Lanes whose volume is near float32's minimum are removed from
 * fitting_lanes. */
SIMD_INLINE void kernel_curved_lanes_slab_of(kernel_curved_lanes *l, int type, kernel_curved_slab *out)
{
    const kernel_differential *differential = kernel_cell_differential(type);
    const int count = grid_type_vertices(type);
    vf d[4][3], n[3][3], middle[4], g[3], size = vf_set(0), error = size, error_bound = size;
    for (int a = 0; a < 4; a++) {
        middle[a] = d[a][0] = d[a][1] = d[a][2] = vf_set(0);
        for (int i = 0; i < count; i++) {
            const vf v = a < 3 ? l->at[i][a] : l->f[i];
            middle[a] += v * (1 / (float)count);
            for (int k = 0; k < 3; k++) d[a][k] += v * differential->middle[k][i];
        }
    }
    for (int i = 0; i < 3; i++) {
        const int u = (i + 1) % 3, v = (i + 2) % 3;
        for (int a = 0; a < 3; a++) {
            const int b = (a + 1) % 3, c = (a + 2) % 3;
            n[i][a] = d[b][u] * d[c][v] - d[c][u] * d[b][v];
        }
    }
    const vf volume = (d[0][0] * n[0][0] + d[1][0] * n[0][1]) + d[2][0] * n[0][2];
    l->fitting_lanes = vm_and(l->fitting_lanes, vf_lt(vf_set(1e-30f), vf_abs(volume)));
    const vf inverse = 1.0f / volume;
    for (int i = 0; i < 3; i++)
        for (int a = 0; a < 3; a++) n[i][a] *= inverse;
    for (int a = 0; a < 3; a++) g[a] = (d[3][0] * n[0][a] + d[3][1] * n[1][a]) + d[3][2] * n[2][a];
    for (int i = 0; i < count; i++) {
        out->at[i] = middle[3];
        for (int a = 0; a < 3; a++) {
            const vf part = g[a] * (l->at[i][a] - middle[a]);
            out->at[i] += part;
            size = vf_max(vf_abs(part), size);
        }
        error = vf_max(vf_abs(out->at[i] - l->f[i]), error);
    }
    error *= vf_select(kernel_curved_lanes_unfolded(l, differential, count, n), vf_set(1), vf_set(3.4f));
    for (int a = 0; a < 3; a++) {
        vf reach = vf_set(0);
        for (int i = 0; i < count; i++) reach = vf_max(vf_abs(l->at[i][a]), reach);
        error_bound += vf_abs(g[a]) * reach;
    }
    const vf thickness = error + KERNEL_OUTLINE_PAD * (1 + size) + 16 * 6e-8f * error_bound;
    out->thickness = vf_select(vf_lt(thickness, vf_set(1)), thickness, vf_set(INFINITY));
}

static __attribute__((noinline)) void kernel_curved_lanes_slab(kernel_curved_lanes *l, int type,
                                                               kernel_curved_slab *out)
{
    if (kernel_is_box(type)) /* the type is a constant, so that loops have constant lengths and compilers unroll them */
        kernel_curved_lanes_slab_of(l, kernel_curved_types[KERNEL_SHAPE_HEX], out);
    else
        kernel_curved_lanes_slab_of(l, type, out);
}

/* Computes the bounds of the slab's polytope: of the vertices that lie in the slab, and of the points where lines
 * between two vertices cross the slab's sides. */
static __attribute__((noinline)) void kernel_curved_lanes_view_bounds(const kernel_finder *s,
                                                                      const kernel_curved_lanes *l,
                                                                      const kernel_curved_slab *slab,
                                                                      kernel_view_bounds *e)
{
    *e = kernel_view_bounds_empty();
    for (int i = 0; i < l->count; i++) {
        kernel_view_bounds_add(s, e, l->at[i], vf_le(vf_abs(slab->at[i]), slab->thickness));
        for (int j = 0; j < i; j++) {
            const vf inverse = 1.0f / (slab->at[j] - slab->at[i]);
            for (int side = 0; side < 2; side++) {
                const vf level = side ? slab->thickness : -slab->thickness, along = (level - slab->at[i]) * inverse;
                const vm crossed = vm_xor(vf_lt(slab->at[i], level), vf_lt(slab->at[j], level));
                vf point[3];
                if (!vm_any(crossed)) continue;
                for (int a = 0; a < 3; a++) point[a] = l->at[i][a] + along * (l->at[j][a] - l->at[i][a]);
                kernel_view_bounds_add(s, e, point, crossed);
            }
        }
    }
}

/* Computes the bounds of the points where the isovalue crosses the edges of tets. negative: the vertices whose values
 * are below the isovalue, compared exactly. */
SIMD_INLINE void kernel_tet_lanes_view_bounds(const kernel_finder *s, const kernel_curved_lanes *l,
                                              const vm negative[4], kernel_view_bounds *e)
{
    *e = kernel_view_bounds_empty();
    for (int n = 0; n < KERNEL_TET_EDGES; n++) {
        const int i = kernel_tet_edge[n][0], j = kernel_tet_edge[n][1];
        const vm crossed = vm_xor(negative[i], negative[j]);
        const vf along = vf_max(l->f[i] / (l->f[i] - l->f[j]), vf_set(0)); /* max() replaces the NaN of 0 / 0 by 0 */
        vf point[3];
        for (int a = 0; a < 3; a++) point[a] = l->at[i][a] + along * (l->at[j][a] - l->at[i][a]);
        kernel_view_bounds_add(s, e, point, crossed);
    }
}

/* Computes the positions of hexes of a uniform or rectilinear lattice in the camera's axes. The result has the same
 * bits as that of kernel_curved_lanes_transform(), but each product is computed once for all vertices that share a
 * coordinate. */
static __attribute__((noinline)) void kernel_lattice_lanes_transform(const kernel_finder *s, const kernel_cells *c,
                                                                     kernel_curved_lanes *l)
{
    const render_camera *camera = &s->frame->job->camera;
    const double *axes[3] = {camera->right, camera->up, camera->forward};
    kernel_lattice_cells cells;
    vf parts[3][3][2];
    kernel_lattice_cells_read(&s->arrays, c->vertex[0], &cells);
    l->count = 8;
    l->fitting_lanes = vm_all_lanes();
    for (int end = 0; end < 2; end++) {
        vf place[3];
        for (int k = 0; k < 3; k++) {
            const kernel_raw_numbers world = {.wide = cells.ends[end][k]};
            place[k] =
                kernel_raw_minus(&s->arrays.coordinates[k], &world, &s->eye[k]) * (float)s->frame->job->space.scale;
            for (int a = 0; a < 3; a++) parts[a][k][end] = place[k] * (float)axes[a][k];
        }
        l->fitting_lanes = kernel_positions_fit_lanes(l->fitting_lanes, place);
    }
    for (int i = 0; i < 8; i++) {
        const float *corner = kernel_cell_shape(c->type)->corners[i];
        const int x = corner[0] > 0, y = corner[1] > 0, z = corner[2] > 0;
        for (int a = 0; a < 3; a++) l->at[i][a] = (parts[a][0][x] + parts[a][1][y]) + parts[a][2][z];
    }
}

/* Reads the vertices' positions and rotates them into the camera's axes. */
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
        kernel_finder_positions(s, kernel_cells_vertex(c, i), from_eye);
        l->fitting_lanes = kernel_positions_fit_lanes(l->fitting_lanes, from_eye);
        kernel_rotate_to_camera(s, from_eye, l->at[i]);
    }
}

/* Sets f to the values minus the isovalue, and removes lanes whose values are too large, too small or NaN from
 * fitting_lanes. Returns the largest |f| of each lane. */
SIMD_INLINE vf kernel_curved_lanes_values(const kernel_finder *s, const kernel_raw_numbers *v, int count,
                                          const kernel_level *level, kernel_curved_lanes *l)
{
    vf size = vf_set(0);
    for (int i = 0; i < count; i++) {
        l->f[i] = kernel_raw_minus(&s->arrays.values, &v[i], level);
        size = vf_max(vf_abs(l->f[i]), size);
        l->fitting_lanes = vm_and(l->fitting_lanes, vf_lt(vf_abs(l->f[i]), vf_set(1e30f)));
    }
    l->fitting_lanes = vm_and(l->fitting_lanes, vf_lt(vf_set(1e-30f), size));
    return size;
}

/* Adds the cells of the lanes in `crossed`, which the isovalue crosses, to the candidates. Cells in lanes that are not
 * in `fitting`, whose numbers are outside the range of float32 or NaN, are tested one by one. */
SIMD_INLINE void kernel_add_crossed(kernel_finder *s, const kernel_cells *c, int value, vm fitting, unsigned crossed,
                                    const kernel_view_bounds *e)
{
    const unsigned good = crossed & vm_bits(vm_and(fitting, vf_le(e->near, e->far)));
    kernel_add_lanes(s, e, kernel_arrays_drawn(&s->arrays, c->cell, good), c->cell, s->source + (uint32_t)value);
    for (unsigned odd = crossed & ~vm_bits(fitting); odd; odd &= odd - 1) {
        kernel_cell own;
        kernel_cell_fetch(&own, s->arrays.cells, &s->field->fields[s->part], c->cell[__builtin_ctz(odd)]);
        kernel_find_surface(s, &own, value);
    }
}

/* ---- tets ---- */

/* Finds the tets that isovalues cross. All tets of a leaf are transformed at once, because if one of them is crossed,
 * most are. */
static __attribute__((noinline)) void kernel_find_tets(kernel_finder *s, const kernel_cells *c)
{
    const unsigned all = (1u << c->count) - 1;
    kernel_curved_lanes l;
    kernel_raw_numbers v[4];
    for (int i = 0; i < 4; i++) kernel_arrays_values(&s->arrays, kernel_cells_vertex(c, i), c->cell, &v[i]);
    kernel_curved_lanes_transform(s, c, 4, &l);
    const vm fitting = l.fitting_lanes;
    for (int value = 0; value < s->surface->layer->value_count; value++) {
        const kernel_level level = kernel_level_of(s->surface->layer->values[value]);
        vm negative[4], any = vm_none(), every = vm_all_lanes();
        kernel_view_bounds e;
        l.fitting_lanes = fitting;
        kernel_curved_lanes_values(s, v, 4, &level, &l);
        for (int i = 0; i < 4; i++) {
            negative[i] = kernel_raw_below(&s->arrays.values, &v[i], &level);
            any = vm_or(any, negative[i]);
            every = vm_and(every, negative[i]);
        }
        const unsigned crossed = all & vm_bits(vm_andnot(any, every));
        if (!crossed) continue;
        kernel_tet_lanes_view_bounds(s, &l, negative, &e);
        kernel_add_crossed(s, c, value, l.fitting_lanes, crossed, &e);
    }
}

/* ---- hexes, wedges and pyramids ---- */

/* Adds the queue's cells to the candidates, with the bounds of the isosurface in them. */
SIMD_INLINE void kernel_crossed_queue_process(kernel_finder *s, kernel_crossed_queue *h, int vertices)
{
    const kernel_level level = kernel_level_of(s->surface->layer->values[h->value]);
    const kernel_cells *c = &h->cells;
    kernel_curved_lanes l;
    kernel_curved_slab slab;
    kernel_view_bounds e;
    kernel_raw_numbers v[8];
    for (int i = 0; i < vertices; i++) kernel_arrays_values(&s->arrays, kernel_cells_vertex(c, i), c->cell, &v[i]);
    kernel_curved_lanes_transform(s, c, vertices, &l);
    const vf size = kernel_curved_lanes_values(s, v, vertices, &level, &l);
    /* the bits of a power of two that scales the largest value to near 1: the exponent is that of the value, negated */
    const vi power = (254 << 23) - (vi_from_bits(size) & vi_set(0x7f800000));
    for (int i = 0; i < vertices; i++) l.f[i] *= vf_from_bits(power);
    kernel_curved_lanes_slab(&l, c->type, &slab);
    kernel_curved_lanes_view_bounds(s, &l, &slab, &e);
    kernel_add_crossed(s, c, h->value, l.fitting_lanes, (1u << c->count) - 1, &e);
}

static __attribute__((noinline)) void kernel_find_crossed(kernel_finder *s, kernel_crossed_queue *h)
{
    if (!h->cells.count) return;
    kernel_cells_fill(&h->cells);
    if (h->cells.vertices == 8)
        kernel_crossed_queue_process(s, h, 8);
    else
        kernel_crossed_queue_process(s, h, h->cells.vertices);
    h->cells.count = 0;
}

static void kernel_find_all_crossed(kernel_finder *s)
{
    for (int i = 0; i < KERNEL_CURVED_TYPES; i++) kernel_find_crossed(s, &s->crossed[i]);
}

/* Queues the cells of the given lanes, which the isovalue crosses. A queue holds cells of one isovalue; if the isovalue
 * changes, the queue is processed first. */
SIMD_INLINE void kernel_crossed_queue_add(kernel_finder *s, const kernel_cells *from, int vertices, int value,
                                          unsigned lanes)
{
    kernel_crossed_queue *h = &s->crossed[kernel_lane_type_index(from->type)];
    if (lanes && value != h->value) kernel_find_crossed(s, h);
    for (; lanes; lanes &= lanes - 1) {
        if (h->cells.count == SIMD_WIDTH) kernel_find_crossed(s, h);
        const int n = __builtin_ctz(lanes), to = h->cells.count++;
        h->value = value;
        h->cells.cell[to] = from->cell[n];
        for (int i = 0; i < vertices; i++) h->cells.vertex[i][to] = from->vertex[i][n];
    }
}

/* Queues the cells that have vertex values on both sides of an isovalue. */
SIMD_INLINE void kernel_find_straddling(kernel_finder *s, const kernel_cells *c, int vertices)
{
    const render_surface_layer *layer = s->surface->layer;
    const unsigned all = (1u << c->count) - 1;
    kernel_raw_numbers v[8];
    for (int i = 0; i < vertices; i++) kernel_arrays_values(&s->arrays, kernel_cells_vertex(c, i), c->cell, &v[i]);
    for (int value = 0; value < layer->value_count; value++) {
        const kernel_level level = kernel_level_of(layer->values[value]);
        vm any = vm_none(), every = vm_all_lanes();
        for (int i = 0; i < vertices; i++) {
            const vm below = kernel_raw_below(&s->arrays.values, &v[i], &level);
            any = vm_or(any, below);
            every = vm_and(every, below);
        }
        kernel_crossed_queue_add(s, c, vertices, value, all & vm_bits(vm_andnot(any, every)));
    }
}

static __attribute__((noinline)) void kernel_find_curved(kernel_finder *s, const kernel_cells *c)
{
    if (c->vertices == 8)
        kernel_find_straddling(s, c, 8);
    else
        kernel_find_straddling(s, c, c->vertices);
}

#endif
