/* Computes samples of volumes in one cell (thesis, section 4.4). The rays' intervals in the cell are computed once, and
 * each sample in an interval, t_in <= t < t_out, gets its value.
 *
 * A sample's position depends only on its number and its ray, so that all ranks use the same samples. Each sample
 * belongs to one cell, because the depth t of a face's crossing is bit-identical in both of its cells; only if cells
 * overlap, a sample belongs to several. Samples are computed window by window: a window is a range of consecutive
 * sample numbers. Values are in the transfer function's domain. */
#ifndef RENDER_KERNEL_SAMPLES_H
#define RENDER_KERNEL_SAMPLES_H

#include <math.h>

#include "fragment.h"
#include "fragment_fold.h"
#include "kernel_cell.h"
#include "kernel_colour.h"
#include "kernel_hits.h"
#include "kernel_map.h"
#include "kernel_packet.h"
#include "kernel_types.h"
#include "render.h"
#include "render_face_error.h"
#include "simd.h"

/* Share of light below which a ray is dark: a rank drops the sample at which less light is left, and everything behind
 * it. With colours of at most 1, a channel changes by at most this much: a tenth of the 1e-6 by which the pictures of
 * different partitions may differ. (Rounding takes most of the 1e-6.) A rank counts only its own cells. Other ranks'
 * cells absorb more light, so a rank drops less than one rank with all cells would, and the bound holds for all ranks
 * together: at the first sample that any rank drops, its own cells already leave no more light than this. */
#define KERNEL_DARK FRAGMENT_DARK_OF_RANK

/* The fragment to which the samples or segments of a ray are being added from front to back, one ray per lane. */
typedef struct kernel_blend {
    vm open; /* rays that have such a fragment */
    /* t_first, t_last: depths at which the fragment begins and ends; contact_in, contact_out: depths at which the ray
     * enters and leaves the cell of the last sample (set only if kernel_frame.needs_contact is) */
    vf t_first, t_last, contact_in, contact_out;
    vf colour[3], transmittance;
    /* used for segments: the fragment's optical depth, -ln(transmittance), and the accumulated rounding errors of its
     * colour */
    vf depth, rounding_errors[3];
    vf light; /* share of the light that passes all of this rank's samples so far */
    /* Used if all samples and segments of a ray are folded into few fragments (render_fold.h). interval_number: index
     * of the interval of depths, of length 1 / FRAGMENT_INTERVALS, that contains the last sample; within: share of the
     * light that passes all samples so far. `light` is then that share at the begin of this interval. */
    vf interval_number, within;
} kernel_blend;

SIMD_INLINE kernel_blend kernel_blend_begin(void)
{
    return (kernel_blend){.open = vm_none(), .light = vf_set(1), .transmittance = vf_set(1), .within = vf_set(1)};
}

/* Returns the error bound of the depth t at which a ray crosses a face. render_fold.c and comp_merge.c use the same
 * bound. */
SIMD_INLINE vf kernel_face_depth_error(vf t)
{
    return vf_max(vf_abs(t), vf_set(1)) * RENDER_FACE_ERROR;
}

/* The samples of a packet's rays in a window. A value is NaN as long as no cell of this rank has been found that
 * contains the sample. */
typedef struct kernel_samples {
    int volume;       /* index of the volume whose samples are being computed */
    int first, count; /* number of the window's first sample, and number of samples in the window */
    float pad;        /* error bound of sample numbers that are computed from depths */
    vf value[RENDER_MAX_VOLUMES][KERNEL_MAX_GROUP];
    /* depths at which the ray enters and leaves the cell that contains the sample; set only if
     * kernel_frame.needs_contact is */
    vf t_in[KERNEL_MAX_GROUP], t_out[KERNEL_MAX_GROUP];
    vf overlap_depth; /* depth of the ray's nearest sample that lies in two cells, in this window and earlier ones */
    kernel_blend blend;
    /* rays of the packet that were active before the first window; saved here because p->active is reduced to rays that
     * still receive light */
    vm active;
} kernel_samples;

/* Returns the depth of sample number m on each ray. */
SIMD_INLINE vf kernel_get_sample_depth(const kernel_packet *p, int m)
{
    return p->sample_base + p->sample_step * (float)m;
}

/* Sets the window to the samples with numbers first .. first + count - 1, and computes the error bound s->pad. A number
 * computed from a depth t has three rounding errors; a depth computed from a number m has two, of step * m and of t. So
 * the number computed from the depth of sample m differs from m by at most 6e-8 (4 m + t / step), and t / step is at
 * most m + base / step. */
SIMD_INLINE void kernel_samples_set_window(const kernel_packet *p, kernel_samples *s, int first, int count)
{
    const float base = vf_reduce_max(vf_select(p->active, vf_abs(p->sample_base * p->sample_inverse), vf_set(0)));
    s->first = first;
    s->count = count;
    s->pad = 1e-4f + 4e-7f * ((float)((first < 0 ? -first : first) + count) + base);
}

/* Finds the window's samples that may lie in the interval i of at least one ray: those with the indices *begin .. *end
 * - 1 in the window. */
SIMD_INLINE void kernel_find_samples_in_interval(const kernel_packet *p, const kernel_samples *s,
                                                 const kernel_interval *i, int *begin, int *end)
{
    const vf from = (i->t_in - p->sample_base) * p->sample_inverse;
    const vf to = (i->t_out - p->sample_base) * p->sample_inverse;
    const float low = vf_reduce_min(vf_select(i->mask, from, vf_set(INFINITY)));
    const float high = vf_reduce_max(vf_select(i->mask, to, vf_set(-INFINITY)));
    const float first = simd_min(simd_max((low - (float)s->first) - s->pad, 0), KERNEL_MAX_GROUP);
    const float last = simd_min(simd_max((high - (float)s->first) + s->pad + 1, 0), (float)s->count);
    *begin = (int)first;
    *begin += (float)*begin < first;
    *end = (int)last;
}

/* Emits one sample per ray of `mask` as a fragment of its own, if it lies in front of opaque surfaces. t, value: depth
 * and value of the sample; cell: the ray's interval in the sample's cell. With separate_samples (render.h) all samples
 * are emitted in this way. Without it, only a sample that another cell contains, too, is emitted, to mark the ray as
 * one on which cells overlap. A clear fragment at the same depth is then emitted with it, so that the two fragments
 * overlap. Only the nearest such sample of a ray is emitted, because others may be behind another rank's opaque
 * surface. */
static __attribute__((noinline, cold)) void kernel_emit_sample(kernel_packet *p, kernel_samples *s,
                                                               const kernel_interval *cell, vm mask, vf t, vf value)
{
    const kernel_transfer *transfer = &p->frame->volumes[s->volume];
    const vf zero = vf_set(0);
    vf absorbed, colour[3];
    const vf left = kernel_transmittance(kernel_opacity(transfer, value), transfer->exponent, &absorbed);
    kernel_table_colour(transfer, value, colour);
    for (int a = 0; a < 3; a++) colour[a] *= absorbed;
    mask = vm_and(mask, vm_and(vf_lt(t, p->t_far), vf_lt(zero, absorbed)));
    mask = vm_and(mask, vf_le(p->clip_in, t));
    if (!p->frame->job->separate_samples) {
        mask = vm_and(mask, vf_lt(t, s->overlap_depth));
        s->overlap_depth = vf_select(mask, t, s->overlap_depth);
        /* render_fold() treats fragments of the kind FRAGMENT_LATE as marks of overlapping cells */
        const vf sign = p->frame->job->reproducible ? vf_set(FRAGMENT_LATE) : zero;
        const kernel_fragments clear = {t, t, {zero, zero, zero}, vf_set(1), sign};
        const kernel_fragments sample = {t, t, {colour[0], colour[1], colour[2]}, left, sign};
        kernel_append_fragments(p, mask, FRAGMENT_VOLUME, &clear);
        kernel_append_fragments(p, mask, FRAGMENT_VOLUME, &sample);
        return;
    }
    const vf error = kernel_face_depth_error(t);
    const vf early = vf_select(vf_lt(t - cell->t_in, error), vf_set(FRAGMENT_EARLY), zero);
    const vf late = vf_select(vf_lt(cell->t_out - t, error), vf_set(FRAGMENT_LATE), zero);
    const uint32_t kind = FRAGMENT_VOLUME + FRAGMENT_LAYER * (uint32_t)s->volume;
    const kernel_fragments sample = {t, t, {colour[0], colour[1], colour[2]}, left, early + late};
    kernel_append_fragments(p, mask, kind, &sample);
}

/* Sets the values of those of the window's samples begin .. end - 1 that lie in the interval i. A sample keeps the
 * value of the first cell that contains it. map: the cell's inverse map, NULL if the field is linear along i; cell: the
 * rays' intervals in the whole cell, of which i is all or, in a polyhedron, a part. */
SIMD_INLINE void kernel_fill_sample_range(kernel_packet *p, kernel_samples *s, const kernel_map *map,
                                          const kernel_interval *i, const kernel_interval *cell, int begin, int end)
{
    const vf length = i->t_out - i->t_in;
    const vf slope = vf_select(vf_lt(vf_set(0), length), (i->v_out - i->v_in) / length, vf_set(0));
    const vf base = p->sample_base, step = p->sample_step;
    const bool needs_contact = p->frame->needs_contact;
    vf *values = s->value[s->volume];
    for (int n = begin; n < end; n++) {
        const vf t = base + step * (float)(s->first + n);
        vm own = vm_and(i->mask, vm_andnot(vf_lt(t, i->t_out), vf_lt(t, i->t_in)));
        vf value = i->v_in + slope * (t - i->t_in);
        if (map) {
            if (!vm_any(own)) continue;
            value = kernel_evaluate_field_in_one_cell(p, map, i, own, t);
        }
        const vf active = values[n];
        const vm apart = vm_and(own, vf_eq(active, active));
        if (__builtin_expect(vm_any(apart), 0)) {
            kernel_emit_sample(p, s, cell, apart, t, value);
            own = vm_andnot(own, apart);
        }
        values[n] = vf_select(own, value, active);
        if (needs_contact) {
            s->t_in[n] = vf_select(own, cell->t_in, s->t_in[n]);
            s->t_out[n] = vf_select(own, cell->t_out, s->t_out[n]);
        }
    }
}

/* Sets the values of the window's samples that lie in the interval i (kernel_fill_sample_range()). */
SIMD_INLINE void kernel_fill_interval_samples(kernel_packet *p, kernel_samples *s, const kernel_map *map,
                                              const kernel_interval *i, const kernel_interval *cell)
{
    int begin, end;
    kernel_find_samples_in_interval(p, s, i, &begin, &end);
    if (begin < end) kernel_fill_sample_range(p, s, map, i, cell, begin, end);
}

/* Ends the current fragments of the rays in `mask`, and emits those that are visible. */
SIMD_INLINE void kernel_blend_close(kernel_packet *p, kernel_blend *b, vm mask)
{
    const vm closing = vm_and(b->open, mask);
    if (!vm_any(closing)) return;
    const kernel_fragments ended = {
        b->t_first, b->t_last, {b->colour[0], b->colour[1], b->colour[2]}, b->transmittance, vf_set(0)};
    kernel_append_fragments(p, vm_and(closing, kernel_fragment_is_visible(b->colour, b->transmittance)),
                            FRAGMENT_VOLUME, &ended);
    b->open = vm_andnot(b->open, closing);
}

/* Emits one sample or segment per ray in `has` as a fragment of its own; render_fold.c later joins it with others. If
 * it is the first after the begin of the ray or after a surface or gap, it is marked FRAGMENT_EARLY, because another
 * rank may have fragments in front of it. The light is not added to *b, so that nothing is emitted when the ray's
 * current fragment ends. */
SIMD_INLINE void kernel_emit_separate(kernel_packet *p, kernel_blend *b, vm has, vf t_in, vf t_out, const vf colour[3],
                                      vf clear)
{
    const vm fresh = vm_andnot(has, b->open);
    const kernel_fragments own = {
        t_in, t_out, {colour[0], colour[1], colour[2]}, clear, vf_select(fresh, vf_set(FRAGMENT_EARLY), vf_set(0))};
    kernel_append_fragments(p, vm_and(has, vm_or(fresh, kernel_fragment_is_visible(colour, clear))), FRAGMENT_VOLUME,
                            &own);
    const vf interval_number = vf_floor(t_in * (float)FRAGMENT_INTERVALS);
    const vm next = vm_andnot(has, vf_eq(interval_number, b->interval_number));
    b->light = vf_select(next, b->within, b->light);
    b->interval_number = vf_select(has, interval_number, b->interval_number);
    b->within = vf_select(has, b->within * clear, b->within);
    b->t_first = vf_select(fresh, t_in, b->t_first);
    b->t_last = vf_select(has, vf_select(fresh, t_out, vf_max(b->t_last, t_out)), b->t_last);
    b->open = vm_or(b->open, has);
}

/* Returns the rays whose current fragment must end before sample n of the window, at depth t, is added. These are rays
 * with a transparent surface between the previous sample and sample n, and rays on which another rank's surface may lie
 * there, because the cells of the two samples do not touch. */
SIMD_INLINE vm kernel_blend_must_end_before_sample(const kernel_packet *p, const kernel_samples *s, int n,
                                                   const kernel_hits *hits, vf t)
{
    const kernel_blend *b = &s->blend;
    vm broken = hits->overflowed;
    for (int i = 0; i < hits->cut_count; i++)
        broken = vm_or(broken, vm_and(vf_lt(b->t_last, hits->cut[i]), vf_le(hits->cut[i], t)));
    if (p->frame->needs_contact) {
        const vm touch = vm_or(vf_eq(s->t_in[n], b->contact_out), vf_eq(s->t_in[n], b->contact_in));
        broken = vm_or(broken, vm_not(touch));
    }
    return broken;
}

/* Computes the premultiplied colour and the transmittance (*clear) of sample n of the window, from the samples of all
 * volumes at its position. */
SIMD_INLINE void kernel_sample_colour(const kernel_packet *p, const kernel_samples *s, int n, vf colour[3], vf *clear)
{
    const kernel_frame *f = p->frame;
    vf sum[3] = {vf_set(0), vf_set(0), vf_set(0)}, weight = vf_set(0), through = vf_set(1), all = vf_set(0);
    for (int v = 0; v < f->volume_count; v++) {
        const vf value = s->value[v][n];
        const vm has = vf_eq(value, value);
        vf absorbed, c[3];
        const vf place = kernel_find_colour_table_position(&f->volumes[v], value);
        const vf opacity = vf_select(has, kernel_opacity_at(&f->volumes[v], place), vf_set(0));
        if (!vm_any(vf_lt(vf_set(0), opacity))) continue;
        const vf left = kernel_transmittance(opacity, f->volumes[v].exponent, &absorbed);
        kernel_look_up_colour(&f->volumes[v], place, c);
        for (int a = 0; a < 3; a++) sum[a] += absorbed * c[a];
        weight += absorbed;
        all += through * absorbed;
        through *= left;
    }
    /* several media at one position together absorb a share of the light, which is divided among them in proportion to
     * what each would absorb alone */
    const vf share = f->volume_count == 1 ? vf_set(1) : vf_select(vf_lt(vf_set(0), weight), all / weight, vf_set(0));
    for (int a = 0; a < 3; a++) colour[a] = sum[a] * share;
    *clear = through;
}

/* Adds the light of the window's samples to the rays' fragments, from front to back. */
SIMD_INLINE void kernel_blend_window(kernel_packet *p, kernel_samples *s, const kernel_hits *hits)
{
    kernel_blend *b = &s->blend;
    const bool is_alone = p->frame->job->is_alone, is_folded = p->frame->job->reproducible;
    for (int n = 0; n < s->count; n++) {
        const vf t = kernel_get_sample_depth(p, s->first + n);
        vm has = vm_none();
        for (int v = 0; v < p->frame->volume_count; v++) has = vm_or(has, vf_eq(s->value[v][n], s->value[v][n]));
        has = vm_and(has, vm_and(vf_lt(t, p->t_far), vf_lt(vf_set(KERNEL_DARK), b->light)));
        has = vm_and(has, vf_le(p->clip_in, t));
        if (!is_alone) kernel_blend_close(p, b, vm_not(has));
        if (!vm_any(has)) continue;
        kernel_blend_close(p, b, vm_and(has, kernel_blend_must_end_before_sample(p, s, n, hits, t)));
        const vm fresh = vm_andnot(has, b->open);
        vf colour[3], clear;
        kernel_sample_colour(p, s, n, colour, &clear);
        if (p->frame->needs_contact) {
            b->contact_in = vf_select(has, s->t_in[n], b->contact_in);
            b->contact_out = vf_select(has, s->t_out[n], b->contact_out);
        }
        if (is_folded) {
            kernel_emit_separate(p, b, has, t, t, colour, clear);
            continue;
        }
        b->t_first = vf_select(fresh, t, b->t_first);
        b->transmittance = vf_select(fresh, vf_set(1), b->transmittance);
        for (int a = 0; a < 3; a++) {
            b->colour[a] = vf_select(fresh, vf_set(0), b->colour[a]);
            b->colour[a] = vf_select(has, b->colour[a] + b->transmittance * colour[a], b->colour[a]);
        }
        b->transmittance = vf_select(has, b->transmittance * clear, b->transmittance);
        b->light = vf_select(has, b->light * clear, b->light);
        b->t_last = vf_select(has, t, b->t_last);
        b->open = vm_or(b->open, has);
    }
}

#endif
