/* Computes colours and opacities from transfer functions, and shades surfaces. */
#ifndef RENDER_KERNEL_COLOUR_H
#define RENDER_KERNEL_COLOUR_H

#include <math.h>
#include <stddef.h>
#include <string.h>

#include "fragment.h"
#include "kernel_exponentials.h"
#include "kernel_packet.h"
#include "kernel_types.h"
#include "render.h"
#include "simd.h"

/* Returns the transmittance of a sample, (1 - opacity)^exponent. opacity: opacity per unit distance; exponent: the
 * sample's length in unit distances (kernel_transfer.exponent). *absorbed becomes 1 minus the transmittance, computed
 * without cancellation. */
SIMD_INLINE vf kernel_transmittance(vf opacity, float exponent, vf *absorbed)
{
    const vf clear = 1.0f - opacity;
    /* `clear` has a rounding error of at most half a unit in the last place. `rest` is this error; the logarithm is
     * corrected by it to first order. */
    const vf rest = (1.0f - clear) - opacity;
    const vf safe = vf_max(clear, vf_set(1.2e-38f));
    const vf log = vf_select(vf_le(clear, vf_set(0)), vf_set(-1e30f), vf_log2(safe) + rest / safe * 1.4426950f);
    const vf x = log * exponent;
    /* 1 - 2^x near 0 is computed by its series: 7 terms at |x ln 2| < 0.35 leave a relative error of 0.35^7 / 8!. */
    const vf y = x * 0.69314718f;
    vf p = y * 1.9841270e-4f + 1.3888889e-3f;
    p = p * y + 8.3333333e-3f;
    p = p * y + 4.1666667e-2f;
    p = p * y + 1.6666667e-1f;
    p = p * y + 0.5f;
    p = p * y + 1.0f;
    const vf series = -(y * p);
    const vm small = vf_lt(vf_set(-0.5f), x);
    if (!vm_any(vm_not(small))) {
        *absorbed = series;
        return 1.0f - series;
    }
    const vf power = vf_exp2(x);
    *absorbed = vf_select(small, series, 1.0f - power);
    return vf_select(small, 1.0f - series, power);
}

/* Returns the position in the colour table of a value on a logarithmic or symmetric logarithmic scale: 0 at the table's
 * first colour, 1 at its last. x: the value in the transfer function's domain. The scale's function (render_scaled())
 * is computed with a relative error of 3e-7. */
static __attribute__((noinline)) vf kernel_scaled_position(const kernel_transfer *t, vf x)
{
    const vf threshold = vf_set(t->threshold), size = vf_max(vf_abs(x), threshold);
    const vf above = vf_log2(size * t->inverse_threshold) * 0.69314718f;
    if (t->scale == RENDER_LOG)
        return vf_select(vf_lt(threshold, x), above, vf_set(0)) * t->scale_slope + t->scale_shift;
    const vf beyond = vf_select(vf_lt(x, vf_set(0)), -1.0f - above, 1.0f + above);
    const vf position = vf_select(vf_lt(threshold, vf_abs(x)), beyond, x * t->inverse_threshold);
    return position * t->scale_slope + t->scale_shift;
}

SIMD_INLINE vf kernel_find_colour_table_position(const kernel_transfer *t, vf x)
{
    return t->scale == RENDER_LINEAR ? x : kernel_scaled_position(t, x);
}

/* Computes the colour at a position in the colour table. along: 0 at the table's first entry, 1 at its last; NaN gives
 * the first colour. */
SIMD_INLINE void kernel_look_up_colour(const kernel_transfer *t, vf along, vf out[3])
{
    const vf place = vf_clamp(along, vf_set(0), vf_set(1)) * (float)(t->colour_count - 1);
    const vf whole = vf_min(vf_floor(place), vf_set((float)(t->colour_count - 2)));
    const vf part = place - whole;
    const vi index = vi_from_vf(whole) * 3;
    int32_t at[SIMD_WIDTH];
    vf first[4], last[4]; /* red, green and blue of each of two neighbouring table entries */
    vi_store(at, index);
    vf_gather_rows(t->colours, at, first);
    vf_gather_rows(t->colours + 2, at, last);
    out[0] = first[0] + part * (first[3] - first[0]);
    out[1] = first[1] + part * (last[2] - first[1]);
    out[2] = first[2] + part * (last[3] - first[2]);
}

/* Computes the colour of a value x, which is given in the transfer function's domain; NaN gives the table's first
 * colour. */
SIMD_INLINE void kernel_table_colour(const kernel_transfer *t, vf x, vf out[3])
{
    kernel_look_up_colour(t, kernel_find_colour_table_position(t, x), out);
}

/* Returns the opacity at a position in the colour table (kernel_find_colour_table_position()). */
SIMD_INLINE vf kernel_opacity_at(const kernel_transfer *t, vf place)
{
    vf a = vf_set(t->base_opacity);
    for (int i = 0; i < t->ramp_count; i++) {
        const vf along = vf_clamp((place - t->ramp_start[i]) * t->ramp_inverse[i], vf_set(0), vf_set(1));
        a += along * t->ramp_rise[i];
    }
    return vf_clamp(a, vf_set(0), vf_set(1));
}

SIMD_INLINE vf kernel_opacity(const kernel_transfer *t, vf x)
{
    return kernel_opacity_at(t, kernel_find_colour_table_position(t, x));
}

SIMD_INLINE vf kernel_inverse_length(const vf v[3], vm *is_zero)
{
    /* the vector is divided by its largest component first, because the squares of components of 1e30 would overflow,
     * and those of 1e-30 underflow */
    const vf largest = vf_max(vf_abs(v[0]), vf_max(vf_abs(v[1]), vf_abs(v[2])));
    *is_zero = vm_not(vf_lt(vf_set(0), largest));
    const vf scale = 1.0f / vf_select(*is_zero, vf_set(1), largest);
    const vf a = v[0] * scale, b = v[1] * scale, c = v[2] * scale;
    return scale / vf_sqrt((a * a + b * b) + c * c);
}

/* Computes the unit vector parallel to n that points towards the eye. n: a vector of any length and either sign, in
 * camera axes; if it is zero, the result is the direction to the eye. */
SIMD_INLINE void kernel_facing_normal(const kernel_packet *p, const vf n[3], vf unit[3])
{
    vm flat;
    const vf inverse = kernel_inverse_length(n, &flat);
    vf facing = vf_set(0);
    for (int a = 0; a < 3; a++) {
        unit[a] = vf_select(flat, p->view[a], n[a] * inverse);
        facing += unit[a] * p->view[a];
    }
    const vf sign = vf_select(vf_lt(facing, vf_set(0)), vf_set(-1), vf_set(1));
    for (int a = 0; a < 3; a++) unit[a] *= sign;
}

/* Shades a colour by the Blinn-Phong model (render.h). n: the gradient of the field at the hit, of any length and
 * either sign, in camera axes. */
SIMD_INLINE void kernel_shade(const kernel_packet *p, const render_material *m, const vf n[3], vf colour[3])
{
    const render_job *job = p->frame->job;
    if (m->diffuse == 0 && m->specular == 0) {
        for (int a = 0; a < 3; a++) colour[a] *= m->ambient;
        return;
    }
    vf unit[3], diffuse[3], specular[3];
    kernel_facing_normal(p, n, unit);
    for (int a = 0; a < 3; a++) diffuse[a] = vf_set(m->ambient), specular[a] = vf_set(0);
    for (int i = 0; i < job->light_count; i++) {
        const float *l = p->frame->light_direction[i], *c = job->lights[i].colour;
        const vf nl = vf_max((unit[0] * l[0] + unit[1] * l[1]) + unit[2] * l[2], vf_set(0));
        const vf half[3] = {p->view[0] + l[0], p->view[1] + l[1], p->view[2] + l[2]};
        vm opposite;
        const vf scale = kernel_inverse_length(half, &opposite);
        vf nh = ((unit[0] * half[0] + unit[1] * half[1]) + unit[2] * half[2]) * scale;
        nh = vf_select(opposite, vf_set(0), vf_max(nh, vf_set(0)));
        vf shine = vf_exp2(vf_log2(vf_max(nh, vf_set(1e-20f))) * m->shininess);
        shine = vf_select(vm_and(vf_lt(vf_set(0), nh), vf_lt(vf_set(0), nl)), shine, vf_set(0));
        for (int a = 0; a < 3; a++) {
            diffuse[a] += nl * (m->diffuse * c[a]);
            specular[a] += shine * (m->specular * c[a]);
        }
    }
    for (int a = 0; a < 3; a++) colour[a] = colour[a] * diffuse[a] + specular[a];
}

/* One fragment per lane (fragment.h). A fragment's kind is the sum of the member `kind` and of the parameter `kind` of
 * kernel_append_fragments(). */
typedef struct kernel_fragments {
    vf t_in, t_out, colour[3], transmittance, kind;
} kernel_fragments;

/* Returns the rays whose fragment is visible: it absorbs light or its colour is not black (fragment_changes_picture()).
 */
SIMD_INLINE vm kernel_fragment_is_visible(const vf colour[3], vf transmittance)
{
    const vf zero = vf_set(0);
    const vm black = vm_and(vf_eq(colour[0], zero), vm_and(vf_eq(colour[1], zero), vf_eq(colour[2], zero)));
    return vm_or(vf_lt(transmittance, vf_set(1)), vm_not(black));
}

/* Appends the fragments of the rays in mask to the thread's list. */
static __attribute__((noinline, unused)) void kernel_append_fragments(kernel_packet *p, vm mask, uint32_t kind,
                                                                      const kernel_fragments *f)
{
    unsigned bits = vm_bits(mask);
    fragment_list *list = &p->thread->out;
    if (!bits) return;
    if (list->capacity - list->count < SIMD_WIDTH && !render_reserve_fragments(list, SIMD_WIDTH)) {
        p->thread->out_of_memory = true;
        return;
    }
    _Static_assert(offsetof(fragment, colour) == 12 && offsetof(fragment, kind) == 28 && sizeof(fragment) == 32,
                   "a fragment has the members of `first`, then those of `second`");
    const vi kinds = vi_from_vf(f->kind) + (int32_t)kind;
    vf first[4] = {vf_load((const float *)(const void *)p->pixel), f->t_in, f->t_out, f->colour[0]};
    vf second[4] = {f->colour[1], f->colour[2], f->transmittance, vf_from_bits(kinds)};
    vf_transpose(first);
    vf_transpose(second);
    /* The two transpositions have collected the members of each fragment: vector i % 4 of `first` has four members of
     * ray i's fragment, in the lanes from i / 4 * 4 on, and that of `second` the other four. */
    for (; bits; bits &= bits - 1) {
        const int i = __builtin_ctz(bits);
        char *item = (char *)&list->items[list->count++];
        memcpy(item, (const float *)&first[i % 4] + i / 4 * 4, 4 * sizeof(float));
        memcpy(item + 4 * sizeof(float), (const float *)&second[i % 4] + i / 4 * 4, 4 * sizeof(float));
    }
}

/* Computes colours from a table that has bands of constant colour, or separate colours for NaN and for values outside
 * the table's range. w: the values, in the transfer function's domain. */
static __attribute__((noinline)) void kernel_compute_banded_or_outside_colour(const kernel_transfer *t, vf w, vf out[3])
{
    const vf place = kernel_find_colour_table_position(t, w), one = vf_set(1), zero = vf_set(0);
    if (t->is_banded) {
        const vf band = vf_floor(vf_clamp(place, zero, one) * (float)t->colour_count);
        const vi index = vi_from_vf(vf_min(band, vf_set((float)(t->colour_count - 1)))) * 3;
        vf_gather_pair(t->colours, index, &out[0], &out[1]);
        out[2] = vf_gather(t->colours + 2, index);
    } else {
        kernel_table_colour(t, w, out);
    }
    const vm below = vf_lt(place, vf_set(-RENDER_END)), above = vf_lt(vf_set(1 + RENDER_END), place), is = vf_eq(w, w);
    for (int a = 0; a < 3; a++) {
        if (t->outside) out[a] = vf_select(below, vf_set(t->outside[a]), out[a]);
        if (t->outside) out[a] = vf_select(above, vf_set(t->outside[3 + a]), out[a]);
        out[a] = vf_select(is, out[a], vf_set(t->outside ? t->outside[6 + a] : RENDER_NO_COLOUR));
    }
}

/* Computes the colours of a surface's hits before lighting. value: index of each hit's isovalue in the layer; w: the
 * value of the colour field, if there is one, in the domain of its transfer function. */
SIMD_INLINE void kernel_unlit_surface_colour(const kernel_surface *s, vi value, vf w, vf out[3])
{
    if (s->layer->colour_map && (s->colour.is_banded || s->colour.outside)) {
        kernel_compute_banded_or_outside_colour(&s->colour, w, out);
        return;
    }
    if (s->layer->colour_map) {
        kernel_table_colour(&s->colour, w, out);
        for (int a = 0; a < 3; a++) out[a] = vf_select(vf_eq(w, w), out[a], vf_set(RENDER_NO_COLOUR));
        return;
    }
    for (int a = 0; a < 3; a++) {
        const float *colour = s->layer->colours + a;
        out[a] = s->layer->value_count == 1 ? vf_set(*colour) : vf_gather(colour, value * 3);
    }
}

#endif
