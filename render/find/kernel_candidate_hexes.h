/* Isosurfaces of hexes of packed meshes, found as many at once as there are lanes (kernel_candidates.h):
 *
 *     lanes are cells that come out of leaves:  do their values straddle an isovalue?
 *     lanes are cells that do:                  kernel_linearize(), kernel_slab_outline() and the box of pixels
 *
 * Places are float32 differences from the eye, along the camera's axes. A hit is the mean of the vertices with weights
 * that are not negative, and its value is that of theirs (kernel_outline.h), so that |L| <= E there for whatever places
 * the vertices are given, if L and E are made of these same places: a hit is off its place in that slab by no more than
 * the vertices are, 8 roundings of their distance from the eye, which is within the pads of kernel_add_lanes(). What
 * is said of cells that are not folded holds but for rounding as well, and those whose size is near that are within
 * the pads anywhere. */
#ifndef RENDER_KERNEL_CANDIDATE_HEXES_H
#define RENDER_KERNEL_CANDIDATE_HEXES_H

#include <math.h>
#include <string.h>

#include "kernel_cell.h"
#include "kernel_finder.h"
#include "kernel_outline.h"
#include "kernel_tile.h"
#include "render.h"
#include "simd.h"

typedef struct kernel_hex_lanes {
    vf at[8][3], f[8]; /* along the camera's axes; values less the isovalue, scaled as kernel_cell_relative() does */
    vm usual;          /* numbers are of usual sizes: others are for the cell alone */
} kernel_hex_lanes;

/* L of kernel_outline.h at the vertices; the slab is |L| <= thickness, which is infinite where there is none. */
typedef struct kernel_hex_slab {
    vf at[8], thickness;
} kernel_hex_slab;

SIMD_INLINE vf kernel_mean(vf a, vf b, vf c, vf d)
{
    return 0.25f * ((a + b) + (c + d));
}

/* A number's differences along the hex's axes, at its middle. */
SIMD_INLINE void kernel_hex_differences(const vf v[8], vf out[3])
{
    out[0] = kernel_mean(v[1], v[2], v[5], v[6]) - kernel_mean(v[0], v[3], v[4], v[7]);
    out[1] = kernel_mean(v[2], v[3], v[6], v[7]) - kernel_mean(v[0], v[1], v[4], v[5]);
    out[2] = kernel_mean(v[4], v[5], v[6], v[7]) - kernel_mean(v[0], v[1], v[2], v[3]);
}

/* kernel_is_unfolded(). */
SIMD_INLINE vm kernel_hex_lanes_unfolded(const kernel_hex_lanes *l, vf inverse[3][3])
{
    const kernel_differential *d = &kernel_differentials[0];
    vf y[8][3], off[12];
    vm unfolded = vm_all_lanes();
    for (int i = 1; i < 8; i++) {
        vf move[3];
        for (int a = 0; a < 3; a++) move[a] = l->at[i][a] - l->at[0][a];
        for (int a = 0; a < 3; a++)
            y[i][a] = (inverse[a][0] * move[0] + inverse[a][1] * move[1]) + inverse[a][2] * move[2];
    }
    for (int a = 0; a < 3; a++) y[0][a] = vf_set(0);
    for (int n = 0; n < 12; n++) {
        const signed char *v = d->columns[n].vertex;
        off[n] = vf_set(0);
        for (int a = 0; a < 3; a++) {
            const vf part = (y[v[1]][a] - y[v[0]][a]) - (a == d->columns[n].along ? 1.0f : 0);
            off[n] += part * part;
        }
    }
    for (int n = 0; n < 8; n++) {
        const signed char *columns = d->corners[n];
        unfolded = vm_and(unfolded, vf_lt(off[columns[0]] + off[columns[1]] + off[columns[2]], vf_set(0.9f)));
    }
    return unfolded;
}

/* kernel_linearize(). Lanes whose volume is near float32's least are not usual. */
static __attribute__((noinline)) void kernel_hex_lanes_slab(kernel_hex_lanes *l, kernel_hex_slab *out)
{
    vf d[4][3], n[3][3], middle[4], g[3], size = vf_set(0), error = size, blur = size;
    for (int a = 0; a < 4; a++) {
        vf v[8];
        for (int i = 0; i < 8; i++) v[i] = a < 3 ? l->at[i][a] : l->f[i];
        kernel_hex_differences(v, d[a]);
        middle[a] = 0.125f * (((v[0] + v[1]) + (v[2] + v[3])) + ((v[4] + v[5]) + (v[6] + v[7])));
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
    for (int i = 0; i < 8; i++) {
        out->at[i] = middle[3];
        for (int a = 0; a < 3; a++) {
            const vf part = g[a] * (l->at[i][a] - middle[a]);
            out->at[i] += part;
            size = vf_max(vf_abs(part), size);
        }
        error = vf_max(vf_abs(out->at[i] - l->f[i]), error);
    }
    error *= vf_select(kernel_hex_lanes_unfolded(l, n), vf_set(1), vf_set(3.4f));
    for (int a = 0; a < 3; a++) {
        vf reach = vf_set(0);
        for (int i = 0; i < 8; i++) reach = vf_max(vf_abs(l->at[i][a]), reach);
        blur += vf_abs(g[a]) * reach;
    }
    const vf thickness = error + KERNEL_OUTLINE_PAD * (1 + size) + 16 * 6e-8f * blur;
    out->thickness = vf_select(vf_lt(thickness, vf_set(1)), thickness, vf_set(INFINITY));
}

/* kernel_slab_outline()'s points: vertices in the slab, and where lines between two vertices meet its sides. */
static __attribute__((noinline)) void kernel_hex_lanes_ends(const kernel_finder *s, const kernel_hex_lanes *l,
                                                            const kernel_hex_slab *slab, kernel_tet_ends *e)
{
    *e = kernel_tet_no_ends();
    for (int i = 0; i < 8; i++) {
        kernel_tet_ends_add(s, e, l->at[i], vf_le(vf_abs(slab->at[i]), slab->thickness));
        for (int j = 0; j < i; j++) {
            const vf inverse = 1.0f / (slab->at[j] - slab->at[i]);
            for (int side = 0; side < 2; side++) {
                const vf level = side ? slab->thickness : -slab->thickness, along = (level - slab->at[i]) * inverse;
                const vm crossed = vm_xor(vf_lt(slab->at[i], level), vf_lt(slab->at[j], level));
                vf point[3];
                if (!vm_any(crossed)) continue;
                for (int a = 0; a < 3; a++) point[a] = l->at[i][a] + along * (l->at[j][a] - l->at[i][a]);
                kernel_tet_ends_add(s, e, point, crossed);
            }
        }
    }
}

/* The vertices along the camera's axes, and the values, of the crossed cells. */
SIMD_INLINE void kernel_hex_lanes_fetch(const kernel_finder *s, kernel_hex_lanes *l)
{
    const kernel_packed *p = &s->packed;
    const render_camera *camera = &s->frame->job->camera;
    const double isovalue = s->surface->layer->values[s->hexes.value],
                 *axes[3] = {camera->right, camera->up, camera->forward};
    const float middle = (float)isovalue, rest = (float)(isovalue - (double)middle);
    vf size = vf_set(0);
    l->usual = vm_all_lanes();
    for (int i = 0; i < 8; i++) {
        vi vertex;
        vf from_eye[3];
        memcpy(&vertex, s->hexes.vertex[i], sizeof vertex);
        l->f[i] = (vf_gather(p->values, vertex * p->value_stride) - middle) - rest;
        size = vf_max(vf_abs(l->f[i]), size);
        l->usual = vm_and(l->usual, vf_lt(vf_abs(l->f[i]), vf_set(1e30f)));
        vertex *= p->stride;
        for (int a = 0; a < 3; a++) {
            from_eye[a] = ((vf_gather(p->coordinates[a], vertex) - p->eye[a][0]) - p->eye[a][1]) * p->scale;
            l->usual = vm_and(l->usual, vf_lt(vf_abs(from_eye[a]), vf_set(1e15f)));
        }
        for (int a = 0; a < 3; a++)
            l->at[i][a] =
                (from_eye[0] * (float)axes[a][0] + from_eye[1] * (float)axes[a][1]) + from_eye[2] * (float)axes[a][2];
    }
    l->usual = vm_and(l->usual, vf_lt(vf_set(1e-30f), size));
    /* The power of two that brings the largest near 1: its exponent, mirrored. */
    const vi power = (254 << 23) - (vi_from_bits(size) & vi_set(0x7f800000));
    for (int i = 0; i < 8; i++) l->f[i] *= vf_from_bits(power);
}

/* Fetches a pending hex, from the mesh or from its active record; a record's number is not the mesh's. */
static void kernel_hex_fetch(kernel_finder *s, int n)
{
    const kernel_packed *p = &s->packed;
    kernel_cell *c = &s->cell;
    if (p->connectivity) {
        kernel_cell_fetch(c, s->frame->job->parts[s->part].cells, &s->field->fields[s->part], s->hexes.cell[n]);
        return;
    }
    kernel_packed_fetch(c, p, s->hexes.cell[n], 8);
    for (int i = 0; i < 8; i++) kernel_place_in(s->frame, &s->picture, c->world[i], &c->x[i], &c->y[i], &c->z[i]);
}

/* Finds where the pending hexes may be seen. */
static __attribute__((noinline)) void kernel_find_crossed_hexes(kernel_finder *s)
{
    kernel_crossed_hexes *h = &s->hexes;
    kernel_hex_lanes l;
    kernel_hex_slab slab;
    kernel_tet_ends e;
    if (!h->count) return;
    for (int n = h->count; n < SIMD_WIDTH; n++)
        for (int i = 0; i < 8; i++) h->vertex[i][n] = h->vertex[i][0];
    kernel_hex_lanes_fetch(s, &l);
    kernel_hex_lanes_slab(&l, &slab);
    kernel_hex_lanes_ends(s, &l, &slab, &e);
    const unsigned all = (1u << h->count) - 1, usual = all & vm_bits(l.usual);
    kernel_add_lanes(s, &e, usual & vm_bits(vf_le(e.near, e.far)), h->cell, s->source + (uint32_t)h->value);
    for (unsigned odd = all & ~usual; odd; odd &= odd - 1) {
        kernel_hex_fetch(s, __builtin_ctz(odd));
        if (s->cell.is_finite) kernel_find_value(s, h->value);
    }
    h->count = 0;
}

/* Makes the hexes of these lanes, which the isovalue crosses, pending. */
SIMD_INLINE void kernel_crossed_hexes_add(kernel_finder *s, int value, unsigned lanes)
{
    kernel_crossed_hexes *h = &s->hexes;
    if (lanes && value != h->value) kernel_find_crossed_hexes(s);
    for (; lanes; lanes &= lanes - 1) {
        const int n = __builtin_ctz(lanes), to = h->count++;
        h->value = value;
        h->cell[to] = s->tets.cell[n];
        for (int i = 0; i < 8; i++) h->vertex[i][to] = s->tets.packed[i][n];
        if (h->count == SIMD_WIDTH) kernel_find_crossed_hexes(s);
    }
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
