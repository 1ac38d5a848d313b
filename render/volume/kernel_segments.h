/* Integrates emission and absorption of volumes along rays by segments, instead of a sum over samples. Terms:
 *     segment          part of a ray in one cell on which the field is taken as linear: t_in, t_out, v_in, v_out
 *     t, v             depth (z in tile space, scaled units); value of the field in the transfer function's domain
 *     unit distance    length to which the transfer function's opacities refer (render_transfer)
 *     window           interval of depths whose segments are collected and then integrated; each ray has its own
 *     cut              depth at which a ray crosses a transparent surface; segments end there
 *     gap              part of a ray between two segments in which this rank has no cell
 *     fragment         the light of consecutive segments, which is passed to compositing
 *     mixing           compositing of fragments that overlap in depth, of several volumes or overlapping cells
 *
 * If the field is linear on a ray's interval in a cell (in tets and constant cells), the interval is one segment.
 * Otherwise it is divided into segments of equal length. Segments are stored until everything in front of them is
 * known, because cells are visited in the order of the tree, not of the ray. Then the n-th segments of all rays of a
 * packet are integrated together (kernel_integral.h), which fills the lanes far better than cell by cell: few of a
 * packet's rays meet a given cell.
 *
 * Each ray has a list of bounded length. When it is full, the window's end is lowered to the t_in of one of its farther
 * segments, and the segments from there on are dropped; the traversal, whose far limit is that end, visits only nearer
 * cells. The window's segments are integrated front to back, and the next window begins where the last one ended:
 *
 *     window 1: t_end ________________ | window 2: from here on
 *     |--cell--|--cell--|----cell----|-|--cell--|
 *              ^ t_in in window 1      ^ t_in == t_end: window 2
 *
 * A segment belongs to the window that contains its t_in. It is never cut at the window's end, so that a ray's result
 * depends neither on the windows nor on the other rays of its packet. Surfaces do cut segments. A fragment joins
 * consecutive segments if the t_out of one is bit-identical to the t_in of the next, as in neighbouring cells. It ends
 * at a gap, in which another rank may have cells.
 *
 * If several volumes share a ray, or cells overlap, no rank has all segments at a position. With separate_samples
 * (render.h) a window's segments are not integrated here but emitted as fragments, which are short enough for
 * compositing to mix them. */
#ifndef RENDER_KERNEL_SEGMENTS_H
#define RENDER_KERNEL_SEGMENTS_H

#include <math.h>
#include <string.h>

#include "kernel_integral.h"
#include "kernel_packet.h"
#include "kernel_preintegral.h"
#include "kernel_samples.h"
#include "kernel_segment_list.h"
#include "kernel_types.h"
#include "simd.h"

/* ---- blending a ray's segments ---- */

/* Returns the rays whose current fragment must end before the segment from t_in to t_out is added: a surface or a gap
 * lies between, or the segment's cell overlaps the previous one by more than rounding. (Compositing detects overlapping
 * cells by their overlapping fragments, render.h.) */
SIMD_INLINE vm kernel_segment_needs_new_fragment(const kernel_packet *p, const kernel_segments *list, vf t_in, vf t_out)
{
    const vf last = list->blend.t_last, shorter = vf_min(t_out, last);
    vm broken = vm_not(vf_eq(t_in, last));
    if (p->frame->job->is_alone) broken = vf_le(t_in, shorter - kernel_face_depth_error(shorter));
    vf from = last, to = t_in;
    if (!list->cut) return broken;
    if (p->frame->job->reproducible) {
        /* a surface on the face between the two segments has cut neither of them (kernel_local_find_segment_ends()) */
        from -= kernel_face_depth_error(last);
        to += kernel_face_depth_error(t_in);
    }
    return vm_or(broken, vf_le(kernel_find_next_cut(p, list, from, false), to));
}

/* Ends the current fragments of the rays in `mask`. Their last depth, t_last, is reduced by the error bound of
 * crossings, so that compositing does not take touching fragments for overlapping ones. A fragment shorter than the
 * error bound then ends before it begins, and overlaps nothing (comp.h). */
SIMD_INLINE void kernel_segments_close(kernel_packet *p, kernel_blend *b, vm mask)
{
    const vf end = b->t_last;
    b->t_last = end - kernel_face_depth_error(end);
    kernel_blend_close(p, b, mask);
    b->t_last = end;
}

/* Adds the light of one segment per ray, from t_in to t_out, to the fragments of the rays in `has`, behind the light
 * that they have. */
SIMD_INLINE void kernel_blend_light(kernel_blend *b, vm has, vf t_in, vf t_out, const kernel_light *light)
{
    const vm fresh = vm_andnot(has, b->open);
    b->t_first = vf_select(fresh, t_in, b->t_first);
    b->transmittance = vf_select(fresh, vf_set(1), b->transmittance);
    for (int a = 0; a < 3; a++) {
        /* Compensated summation: over hundreds of segments rounding would add up to 1e-6. */
        const vf before = vf_select(fresh, vf_set(0), b->colour[a]),
                 lost = vf_select(fresh, vf_set(0), b->rounding_errors[a]);
        const vf more = b->transmittance * light->colour[a] - lost, sum = before + more;
        b->rounding_errors[a] = vf_select(has, (sum - before) - more, b->rounding_errors[a]);
        b->colour[a] = vf_select(has, sum, b->colour[a]);
    }
    b->depth = vf_select(fresh, light->depth, vf_select(has, b->depth + light->depth, b->depth));
    b->transmittance = vf_select(has, kernel_exp(-b->depth), b->transmittance);
    b->light = vf_select(has, b->light * light->transmittance, b->light);
    b->t_last = vf_select(has, vf_select(fresh, t_out, vf_max(b->t_last, t_out)), b->t_last);
    b->open = vm_or(b->open, has);
}

/* Sorts the window's segments of each ray, integrates them from front to back, and adds their light to the rays'
 * fragments. If several volumes are mixed (list->mixing > 0), emits each segment instead. */
static void kernel_blend_segments(kernel_packet *p, kernel_segments *list)
{
    const kernel_pieces *pieces = list->pieces;
    kernel_blend *b = &list->blend;
    vf begins[KERNEL_WINDOW];
    vi items[KERNEL_WINDOW];
    kernel_preint_end ends[2];
    ends[0].value = vf_set(NAN);
    const int row_count = kernel_segments_sort(list, begins, items);
    for (int n = 0; n < row_count; n++) {
        const vf t_in = begins[n];
        const vm has = vm_and(vf_lt(t_in, vf_set(INFINITY)), vf_lt(vf_set(KERNEL_DARK), b->light));
        if (!vm_any(has)) break;
        int32_t at[SIMD_WIDTH];
        vf segment[4], precise[4];
        vi_store(at, items[n]);
        vf_gather_rows(list->items[0][0], at, segment);
        const vf t_out = segment[1];
        kernel_unit_segment run = kernel_unit_segment_of((t_out - t_in) * list->per_t, segment[2], segment[3]);
        if (list->is_double) {
            vf_gather_rows(list->precise[0][0], at, precise);
            run.length = precise[0];
            run.rest_in = precise[1];
            run.rest_out = precise[2];
        }
        if (list->mixing > 0) {
            kernel_emit_segment(p, list, has, t_in, t_out, &run);
            continue;
        }
        kernel_light light;
        if (pieces->preintegral) {
            kernel_preint_compute_segment_light(pieces, has, &run, &ends[n & 1], &ends[~n & 1], &light);
        } else {
            light = kernel_light_none();
            kernel_integrate_segments(pieces, has, &run, &light);
        }
        kernel_segments_close(p, b, vm_and(has, kernel_segment_needs_new_fragment(p, list, t_in, t_out)));
        if (p->frame->job->reproducible)
            kernel_emit_separate(p, b, has, t_in, t_out, light.colour, light.transmittance);
        else
            kernel_blend_light(b, has, t_in, t_out, &light);
    }
    const vm heaped = kernel_fragment_is_visible(list->unsorted_light.colour, list->unsorted_light.transmittance);
    if (!vm_any(heaped)) return;
    if (p->frame->job->reproducible)
        kernel_emit_separate(p, b, heaped, b->t_last, b->t_last, list->unsorted_light.colour,
                             list->unsorted_light.transmittance);
    else
        kernel_blend_light(b, heaped, b->t_last, b->t_last, &list->unsorted_light);
}

/* Begins a new window with empty lists, at the depth list->t_begin. t_end: depth at which each ray's window ends. */
SIMD_INLINE void kernel_segments_begin(kernel_segments *list, vf t_end)
{
    memset(list->count, 0, sizeof list->count);
    list->unsorted_light = kernel_light_none();
    list->t_end = t_end;
    list->is_shortened = false;
}

#endif
