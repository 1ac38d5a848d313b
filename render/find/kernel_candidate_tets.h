/* Tets, found as many at once as there are lanes (kernel_candidates.h).
 *
 * In float32 from the eye on: positions err by 8 roundings of their distance from it, and so do X, Y and depth; all of
 * it is within the pads of kernel_pixel_range(), which take this of the picture's scale too. */
#ifndef RENDER_KERNEL_CANDIDATES_TETS_H
#define RENDER_KERNEL_CANDIDATES_TETS_H

#include <math.h>
#include <string.h>

#include "grid.h"
#include "kernel_cell.h"
#include "kernel_cell_values.h"
#include "kernel_finder.h"
#include "kernel_interest.h"
#include "kernel_packed.h"
#include "kernel_tet.h"
#include "kernel_tile.h"
#include "kernel_types.h"
#include "render.h"
#include "simd.h"

/* Where the surface of one isovalue is in each: ends over the edges that it crosses. */
typedef struct kernel_tet_ends {
    vf near, far, left, right, top, bottom;
} kernel_tet_ends;

typedef struct kernel_tet_lanes {
    vf f[4], at[3][4]; /* values less the isovalue; from the eye, in the space's scale */
    vm negative[4];
} kernel_tet_lanes;

/* The vertices along the camera's axes. */
SIMD_INLINE void kernel_tet_lanes_turn(const kernel_finder *s, const kernel_tet_lanes *l, vf at[4][3])
{
    const render_camera *camera = &s->frame->job->camera;
    const double *axes[3] = {camera->right, camera->up, camera->forward};
    for (int i = 0; i < 4; i++)
        for (int a = 0; a < 3; a++)
            at[i][a] =
                (l->at[0][i] * (float)axes[a][0] + l->at[1][i] * (float)axes[a][1]) + l->at[2][i] * (float)axes[a][2];
}

/* Ends that take in the point, in the lanes that are meant. */
SIMD_INLINE void kernel_tet_ends_add(const kernel_finder *s, kernel_tet_ends *e, const vf point[3], vm lanes)
{
    const vf most = vf_set(INFINITY);
    vf inverse = vf_set(1);
    if (!s->frame->job->camera.is_orthographic) inverse = 1.0f / point[2];
    const vf x = (point[0] * inverse) * s->column_scale, y = (point[1] * inverse) * s->row_scale;
    e->near = vf_min(e->near, vf_select(lanes, point[2], most));
    e->far = vf_max(e->far, vf_select(lanes, point[2], -most));
    e->left = vf_min(e->left, vf_select(lanes, x, most));
    e->right = vf_max(e->right, vf_select(lanes, x, -most));
    e->top = vf_min(e->top, vf_select(lanes, y, most));
    e->bottom = vf_max(e->bottom, vf_select(lanes, y, -most));
}

SIMD_INLINE kernel_tet_ends kernel_tet_no_ends(void)
{
    const vf most = vf_set(INFINITY);
    return (kernel_tet_ends){most, -most, most, -most, most, -most};
}

SIMD_INLINE void kernel_tet_lanes_ends(const kernel_finder *s, const kernel_tet_lanes *l, kernel_tet_ends *e)
{
    vf at[4][3];
    kernel_tet_lanes_turn(s, l, at);
    *e = kernel_tet_no_ends();
    for (int n = 0; n < KERNEL_TET_EDGES; n++) {
        const int i = kernel_tet_edge[n][0], j = kernel_tet_edge[n][1];
        const vm crossed = vm_xor(l->negative[i], l->negative[j]);
        const vf along = vf_max(l->f[i] / (l->f[i] - l->f[j]), vf_set(0)); /* not 0 / 0 */
        vf point[3];
        for (int a = 0; a < 3; a++) point[a] = at[i][a] + along * (at[j][a] - at[i][a]);
        kernel_tet_ends_add(s, e, point, crossed);
    }
}

/* kernel_extent_range() lane by lane: the first and last pixels. Returns the lanes that have any. */
SIMD_INLINE vm kernel_pixel_range(vf low, vf high, float zero, float blur, int pixels, vf *first, vf *last)
{
    const vf pad = (0.01f + blur + 3e-5f * fabsf(zero)) + 3e-5f * vf_max(vf_abs(low), vf_abs(high));
    *first = vf_max(-vf_floor(pad - (low + zero)), vf_set(0));
    *last = vf_min(vf_floor((high + zero) + pad), vf_set((float)(pixels - 1)));
    return vf_le(*first, *last);
}

/* kernel_extents_candidate() lane by lane, of so many lanes those whose bits are set. */
static void kernel_add_lanes(kernel_finder *s, const kernel_tet_ends *e, unsigned lanes, const uint32_t *cells,
                             uint32_t source)
{
    const render_camera *camera = &s->frame->job->camera;
    const bool flat = camera->is_orthographic;
    kernel_candidate_list *list = s->list;
    vf first[2], last[2];
    float near[SIMD_WIDTH], far[SIMD_WIDTH];
    int32_t ends[4][SIMD_WIDTH];
    const vf size = vf_abs(e->far) + fabsf(s->t_near), pad = KERNEL_OUTLINE_PAD * size;
    /* The largest blur of any lane stands for all. */
    const float blur = 2e-6f * (flat ? vf_reduce_max(vf_select(vm_from_bits(lanes), size, vf_set(0))) + 1 : 1);
    vm candidates = kernel_pixel_range(e->left, e->right, s->column_0, blur * fabsf(s->column_scale), camera->width,
                                       &first[0], &last[0]);
    candidates = vm_and(candidates, kernel_pixel_range(e->top, e->bottom, s->row_0, blur * fabsf(s->row_scale),
                                                       camera->height, &first[1], &last[1]));
    const vm anywhere = flat ? vm_none() : vm_not(vf_lt(0.01f * size, e->near));
    const vm behind = vf_lt((e->far + s->t_near) + pad, vf_set(s->t_near));
    lanes &= vm_bits(vm_andnot(vm_or(candidates, anywhere), behind));
    const int most[2] = {camera->width - 1, camera->height - 1};
    for (int a = 0; a < 2; a++) {
        const vi from = vi_from_vf(vf_select(anywhere, vf_set(0), first[a]));
        const vi to = vi_from_vf(vf_select(anywhere, vf_set((float)most[a]), last[a]));
        memcpy(ends[2 * a], &from, sizeof from);
        memcpy(ends[2 * a + 1], &to, sizeof to);
    }
    vf_store(near, vf_max((e->near + s->t_near) - pad, vf_set(-INFINITY))); /* not a number: that */
    vf_store(far, -vf_max(-((e->far + s->t_near) + pad), vf_set(-INFINITY)));
    if (list->capacity - list->count < SIMD_WIDTH && !s->grow(list)) return;
    for (; lanes; lanes &= lanes - 1) {
        const int n = __builtin_ctz(lanes);
        list->items[list->count++] = (kernel_candidate){.cell = cells[n],
                                                        .source = source,
                                                        .near = near[n],
                                                        .far = far[n],
                                                        .x0 = (uint16_t)ends[0][n],
                                                        .x1 = (uint16_t)ends[1][n],
                                                        .y0 = (uint16_t)ends[2][n],
                                                        .y1 = (uint16_t)ends[3][n]};
        kernel_count_tiles(list, ends[0][n], ends[1][n], ends[2][n], ends[3][n]);
    }
}

/* Tets of a packed mesh. v < value is v < the least float not below it. The differences' signs are right but where they
 * vanish in float32, and then along an edge that is as good as a point. */
SIMD_INLINE void kernel_packed_value(kernel_finder *s, const vf v[4], kernel_tet_lanes *l, int value)
{
    const double isovalue = s->surface->layer->values[value];
    const float middle = (float)isovalue, rest = (float)(isovalue - (double)middle);
    const vf least = vf_set(kernel_not_below(isovalue));
    vf size = vf_set(0);
    vm usual = vm_all_lanes(), negative = vm_none(), positive = vm_none();
    for (int i = 0; i < 4; i++) {
        l->f[i] = (v[i] - middle) - rest;
        l->negative[i] = vf_lt(v[i], least);
        negative = vm_or(negative, l->negative[i]);
        positive = vm_or(positive, vf_le(least, v[i]));
        size = vf_max(vf_abs(l->f[i]), size);
        usual = vm_and(usual, vf_lt(vf_abs(l->f[i]), vf_set(1e30f)));
        for (int a = 0; a < 3; a++) usual = vm_and(usual, vf_lt(vf_abs(l->at[a][i]), vf_set(1e15f)));
    }
    usual = vm_and(usual, vf_lt(vf_set(1e-30f), size));
    const unsigned all = (1u << s->tets.count) - 1, crossed = vm_bits(vm_and(negative, positive)) & all;
    /* Values too large, too small or NaN for lanes are handled one by one. */
    const unsigned good = crossed & vm_bits(usual);
    if (good) {
        kernel_tet_ends e;
        kernel_tet_lanes_ends(s, l, &e);
        kernel_add_lanes(s, &e, good, s->tets.cell, s->source + (uint32_t)value);
    }
    for (unsigned odd = crossed & ~good; odd; odd &= odd - 1) {
        kernel_cell_fetch(&s->cell, s->frame->job->parts[s->part].cells, &s->field->fields[s->part],
                          s->tets.cell[__builtin_ctz(odd)]);
        if (s->cell.is_finite) kernel_find_value(s, value);
    }
}

/* As above, for all that a volume shows of them. */
SIMD_INLINE void kernel_packed_volume(kernel_finder *s, const vf v[4], const kernel_tet_lanes *l)
{
    vm usual = vm_all_lanes();
    for (int i = 0; i < 4; i++) {
        usual = vm_and(usual, vf_lt(vf_abs(v[i]), vf_set(1e30f)));
        for (int a = 0; a < 3; a++) usual = vm_and(usual, vf_lt(vf_abs(l->at[a][i]), vf_set(1e15f)));
    }
    const vm shows = kernel_interest_meets_values(s->interest, v);
    const unsigned all = (1u << s->tets.count) - 1, good = all & vm_bits(vm_and(usual, shows));
    if (good) {
        kernel_tet_ends e = kernel_tet_no_ends();
        vf at[4][3];
        kernel_tet_lanes_turn(s, l, at);
        for (int i = 0; i < 4; i++) kernel_tet_ends_add(s, &e, at[i], vm_all_lanes());
        kernel_add_lanes(s, &e, good, s->tets.cell, s->source);
    }
    for (unsigned odd = all & ~vm_bits(usual); odd; odd &= odd - 1) {
        kernel_cell_fetch(&s->cell, s->frame->job->parts[s->part].cells, &s->field->fields[s->part],
                          s->tets.cell[__builtin_ctz(odd)]);
        kernel_find_cell(s);
    }
}

static void kernel_find_packed_tets(kernel_finder *s)
{
    const kernel_packed *p = &s->packed;
    kernel_tets *t = &s->tets;
    kernel_tet_lanes l;
    vf v[4];
    if (!t->count) return;
    kernel_tets_fill(t, 4);
    for (int i = 0; i < 4; i++) {
        vi vertex;
        memcpy(&vertex, t->packed[i], sizeof vertex);
        v[i] = vf_gather(p->values, vertex * p->value_stride);
        vertex *= p->stride;
        for (int a = 0; a < 3; a++)
            l.at[a][i] = ((vf_gather(p->coordinates[a], vertex) - p->eye[a][0]) - p->eye[a][1]) * p->scale;
    }
    if (!s->surface) kernel_packed_volume(s, v, &l);
    for (int value = 0; s->surface && value < s->surface->layer->value_count; value++)
        kernel_packed_value(s, v, &l, value);
    t->count = 0;
}

/* Tets of any other mesh, one by one until they are in lanes. */
static void kernel_find_any_tets(kernel_finder *s)
{
    if (!s->tets.count) return;
    const render_surface_layer *layer = s->surface->layer;
    const grid_field *field = &layer->field.fields[s->part];
    const grid *g = s->frame->job->parts[s->part].cells;
    const double *eye = s->frame->job->camera.eye, scale = s->frame->job->space.scale;
    kernel_cell *c = &s->cell;
    for (int value = 0; value < layer->value_count; value++) {
        float f[4][SIMD_WIDTH] = {{0}}, at[3][4][SIMD_WIDTH] = {{{0}}};
        uint32_t cells[SIMD_WIDTH];
        int count = 0;
        for (int n = 0; n < s->tets.count; n++) {
            c->count = 4;
            if (!grid_cell_values(field, s->tets.cell[n], s->tets.vertices[n], 4, c->values)) continue;
            if (!kernel_cell_straddles(c, layer->values[value])) continue;
            kernel_cell_relative(c, layer->values[value]);
            for (int i = 0; i < 4; i++) {
                double world[3];
                grid_vertex(g, s->tets.vertices[n][i], world);
                for (int a = 0; a < 3; a++) at[a][i][count] = (float)((world[a] - eye[a]) * scale);
                f[i][count] = c->f[i];
            }
            cells[count++] = s->tets.cell[n];
        }
        if (!count) continue;
        kernel_tet_lanes l;
        kernel_tet_ends e;
        for (int i = 0; i < 4; i++) {
            l.f[i] = vf_load(f[i]);
            l.negative[i] = vf_lt(l.f[i], vf_set(0));
            for (int a = 0; a < 3; a++) l.at[a][i] = vf_load(at[a][i]);
        }
        kernel_tet_lanes_ends(s, &l, &e);
        kernel_add_lanes(s, &e, (1u << count) - 1, cells, s->source + (uint32_t)value);
    }
    s->tets.count = 0;
}

#endif
