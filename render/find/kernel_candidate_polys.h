/* Isosurfaces of hexes, wedges and pyramids, found as many at once as there are lanes (kernel_candidates.h):
 *
 *     lanes are hexes of a packed mesh:  do their values straddle an isovalue? Of others each is asked alone.
 *     lanes are cells that do:           kernel_linearize(), kernel_slab_outline() and the box of pixels
 *
 * Places are float32 differences from the eye, along the camera's axes. A hit is the mean of the vertices with weights
 * that are not negative, and its value is that of theirs (kernel_outline.h), so that |L| <= E there for whatever places
 * the vertices are given, if L and E are made of these same places: a hit is off its place in that slab by no more than
 * the vertices are, 8 roundings of their distance from the eye, which is within the pads of kernel_add_lanes(). What
 * is said of cells that are not folded holds but for rounding as well, and those whose size is near that are within
 * the pads anywhere. */
#ifndef RENDER_KERNEL_CANDIDATE_POLYS_H
#define RENDER_KERNEL_CANDIDATE_POLYS_H

#include <math.h>
#include <string.h>

#include "kernel_cell.h"
#include "kernel_finder.h"
#include "kernel_outline.h"
#include "kernel_tile.h"
#include "render.h"
#include "simd.h"

typedef struct kernel_poly_lanes {
    int count;         /* of a cell's vertices */
    vf at[8][3], f[8]; /* along the camera's axes; values less the isovalue, scaled as kernel_cell_relative() does */
    vm usual;          /* numbers are of usual sizes: others are for the cell alone */
} kernel_poly_lanes;

/* L of kernel_outline.h at the vertices; the slab is |L| <= thickness, which is infinite where there is none. */
typedef struct kernel_poly_slab {
    vf at[8], thickness;
} kernel_poly_slab;

/* kernel_is_unfolded(). */
SIMD_INLINE vm kernel_poly_lanes_unfolded(const kernel_poly_lanes *l, const kernel_differential *d, int count,
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

/* kernel_linearize(). Lanes whose volume is near float32's least are not usual. */
SIMD_INLINE void kernel_poly_lanes_slab_of(kernel_poly_lanes *l, int type, kernel_poly_slab *out)
{
    const kernel_differential *differential = kernel_cell_differential(type);
    const int count = grid_type_vertices(type);
    vf d[4][3], n[3][3], middle[4], g[3], size = vf_set(0), error = size, blur = size;
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
    l->usual = vm_and(l->usual, vf_lt(vf_set(1e-30f), vf_abs(volume)));
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
    error *= vf_select(kernel_poly_lanes_unfolded(l, differential, count, n), vf_set(1), vf_set(3.4f));
    for (int a = 0; a < 3; a++) {
        vf reach = vf_set(0);
        for (int i = 0; i < count; i++) reach = vf_max(vf_abs(l->at[i][a]), reach);
        blur += vf_abs(g[a]) * reach;
    }
    const vf thickness = error + KERNEL_OUTLINE_PAD * (1 + size) + 16 * 6e-8f * blur;
    out->thickness = vf_select(vf_lt(thickness, vf_set(1)), thickness, vf_set(INFINITY));
}

static __attribute__((noinline)) void kernel_poly_lanes_slab(kernel_poly_lanes *l, int type, kernel_poly_slab *out)
{
    if (type == GRID_HEX)
        kernel_poly_lanes_slab_of(l, GRID_HEX, out); /* loops of known length */
    else
        kernel_poly_lanes_slab_of(l, type, out);
}

/* kernel_slab_outline()'s points: vertices in the slab, and where lines between two vertices meet its sides. */
static __attribute__((noinline)) void kernel_poly_lanes_ends(const kernel_finder *s, const kernel_poly_lanes *l,
                                                            const kernel_poly_slab *slab, kernel_ends_lanes *e)
{
    *e = kernel_no_ends();
    for (int i = 0; i < l->count; i++) {
        kernel_ends_add(s, e, l->at[i], vf_le(vf_abs(slab->at[i]), slab->thickness));
        for (int j = 0; j < i; j++) {
            const vf inverse = 1.0f / (slab->at[j] - slab->at[i]);
            for (int side = 0; side < 2; side++) {
                const vf level = side ? slab->thickness : -slab->thickness, along = (level - slab->at[i]) * inverse;
                const vm crossed = vm_xor(vf_lt(slab->at[i], level), vf_lt(slab->at[j], level));
                vf point[3];
                if (!vm_any(crossed)) continue;
                for (int a = 0; a < 3; a++) point[a] = l->at[i][a] + along * (l->at[j][a] - l->at[i][a]);
                kernel_ends_add(s, e, point, crossed);
            }
        }
    }
}

/* Gathers the vertices along the camera's axes, and the values, of a packed mesh's hexes. */
SIMD_INLINE void kernel_packed_lanes_fetch(const kernel_finder *s, const kernel_crossed *h, kernel_poly_lanes *l)
{
    const kernel_packed *p = &s->packed;
    const double isovalue = s->surface->layer->values[h->value];
    const float middle = (float)isovalue, rest = (float)(isovalue - (double)middle);
    vf size = vf_set(0);
    l->usual = vm_all_lanes();
    for (int i = 0; i < 8; i++) {
        vi vertex;
        vf from_eye[3];
        memcpy(&vertex, h->vertex[i], sizeof vertex);
        l->f[i] = (vf_gather(p->values, vertex * p->value_stride) - middle) - rest;
        size = vf_max(vf_abs(l->f[i]), size);
        l->usual = vm_and(l->usual, vf_lt(vf_abs(l->f[i]), vf_set(1e30f)));
        kernel_packed_place(p, vertex, from_eye);
        for (int a = 0; a < 3; a++) l->usual = vm_and(l->usual, vf_lt(vf_abs(from_eye[a]), vf_set(1e15f)));
        kernel_place_turn(s, from_eye, l->at[i]);
    }
    l->usual = vm_and(l->usual, vf_lt(vf_set(1e-30f), size));
    /* The power of two that brings the largest near 1: its exponent, mirrored. */
    const vi power = (254 << 23) - (vi_from_bits(size) & vi_set(0x7f800000));
    for (int i = 0; i < 8; i++) l->f[i] *= vf_from_bits(power);
}

SIMD_INLINE void kernel_crossed_lanes_load(const kernel_crossed *h, kernel_poly_lanes *l)
{
    l->usual = vm_all_lanes();
    for (int i = 0; i < l->count; i++) {
        l->f[i] = vf_load(h->place[3][i]);
        for (int a = 0; a < 3; a++) {
            l->at[i][a] = vf_load(h->place[a][i]);
            l->usual = vm_and(l->usual, vf_lt(vf_abs(l->at[i][a]), vf_set(1e15f)));
        }
    }
}

/* Fetches a cell of odd numbers, from the mesh or from its active record; a record's number is not the mesh's. */
static void kernel_odd_fetch(const kernel_finder *s, uint32_t cell, kernel_cell *c)
{
    const kernel_packed *p = &s->packed;
    if (!p->is_hexes || p->connectivity) {
        kernel_cell_fetch(c, s->frame->job->parts[s->part].cells, &s->field->fields[s->part], cell);
        return;
    }
    kernel_packed_fetch(c, p, cell, 8);
    for (int i = 0; i < 8; i++) kernel_place_in(s->frame, &s->picture, c->world[i], &c->x[i], &c->y[i], &c->z[i]);
}

/* Finds where the surface in the crossed cells may be seen. */
static __attribute__((noinline)) void kernel_find_crossed(kernel_finder *s, kernel_crossed *h)
{
    kernel_poly_lanes l = {.count = grid_type_vertices(h->type)};
    kernel_poly_slab slab;
    kernel_ends_lanes e;
    if (!h->count) return;
    if (s->packed.is_hexes)
        kernel_packed_lanes_fetch(s, h, &l);
    else
        kernel_crossed_lanes_load(h, &l);
    kernel_poly_lanes_slab(&l, h->type, &slab);
    kernel_poly_lanes_ends(s, &l, &slab, &e);
    const unsigned all = (1u << h->count) - 1, usual = all & vm_bits(l.usual);
    kernel_add_lanes(s, &e, usual & vm_bits(vf_le(e.near, e.far)), h->cell, h->source);
    for (unsigned odd = all & ~usual; odd; odd &= odd - 1) {
        const int n = __builtin_ctz(odd);
        kernel_cell own;
        kernel_odd_fetch(s, h->cell[n], &own);
        kernel_find_alone(s, &own, (int)(h->source[n] - s->source));
    }
    h->count = 0;
}

static void kernel_find_all_crossed(kernel_finder *s)
{
    for (int i = 0; i < 3; i++) kernel_find_crossed(s, &s->crossed[i]);
}

/* A lane for another crossed cell. The first one's numbers stand in all lanes that are still free. */
SIMD_INLINE int kernel_crossed_lane(kernel_finder *s, kernel_crossed *h, uint32_t cell, int value)
{
    if (h->count == SIMD_WIDTH) kernel_find_crossed(s, h);
    h->cell[h->count] = cell;
    h->source[h->count] = s->source + (uint32_t)value;
    return h->count++;
}

/* Puts the hexes of these lanes, which the isovalue crosses, to the crossed ones. */
SIMD_INLINE void kernel_crossed_hexes_add(kernel_finder *s, int value, unsigned lanes)
{
    kernel_crossed *h = &s->crossed[kernel_shape_number(GRID_HEX)];
    if (lanes && value != h->value) kernel_find_crossed(s, h);
    for (; lanes; lanes &= lanes - 1) {
        const int n = __builtin_ctz(lanes), to = kernel_crossed_lane(s, h, s->tets.cell[n], value);
        h->value = value;
        for (int i = 0; i < 8; i++)
            for (int at = to; at < (to ? to + 1 : SIMD_WIDTH); at++) h->vertex[i][at] = s->tets.packed[i][n];
    }
}

/* Looks for one isovalue in the fetched cell: in lanes, but for tets. */
static void kernel_find_value(kernel_finder *s, int value)
{
    kernel_cell *c = &s->cell;
    if (c->type == GRID_TET) {
        kernel_find_alone(s, c, value);
        return;
    }
    if (!kernel_find_place(s, c, value)) return;
    kernel_crossed *h = &s->crossed[kernel_shape_number(c->type)];
    const int to = kernel_crossed_lane(s, h, c->index, value);
    for (int i = 0; i < c->count; i++)
        for (int n = to; n < (to ? to + 1 : SIMD_WIDTH); n++) {
            h->place[0][i][n] = c->x[i];
            h->place[1][i][n] = c->y[i];
            h->place[2][i][n] = c->z[i] - s->t_near;
            h->place[3][i][n] = c->f[i];
        }
}

/* Adds the parts of the fetched cell that may be seen. */
static void kernel_find_cell(kernel_finder *s)
{
    if (!s->surface) kernel_find_volume(s);
    for (int value = 0; s->surface && value < s->surface->layer->value_count; value++) kernel_find_value(s, value);
}

/* Hexes whose vertices have come. v < value is v < the least float not below it. */
static void kernel_find_packed_hexes(kernel_finder *s)
{
    kernel_tets *t = &s->tets;
    const render_surface_layer *layer = s->surface->layer;
    vf low = vf_set(INFINITY), high = vf_set(-INFINITY);
    if (!t->count) return;
    kernel_tets_fill(t, 8);
    for (int i = 0; i < 8; i++) {
        vi vertex;
        memcpy(&vertex, t->packed[i], sizeof vertex);
        const vf v = vf_gather(s->packed.values, vertex * s->packed.value_stride);
        low = vf_min(v, low); /* one that is not a number passes neither */
        high = vf_max(v, high);
    }
    const unsigned all = (1u << t->count) - 1;
    for (int value = 0; value < layer->value_count; value++) {
        const vf least = vf_set(kernel_not_below(layer->values[value]));
        kernel_crossed_hexes_add(s, value, all & vm_bits(vm_and(vf_lt(low, least), vf_le(least, high))));
    }
    t->count = 0;
}

#endif
