/* What a ray keeps of its segments until all that lies in front of them is known: a list a ray, as they come, with room
 * for so many; and where surfaces cut them. How windows make do with that room: kernel_segments.h. */
#ifndef RENDER_KERNEL_SEGMENT_LIST_H
#define RENDER_KERNEL_SEGMENT_LIST_H

#include <math.h>
#include <string.h>

#include "fragment.h"
#include "kernel_cell.h"
#include "kernel_double.h"
#include "kernel_integral.h"
#include "kernel_packet.h"
#include "kernel_pieces.h"
#include "simd.h"

enum { KERNEL_WINDOW = 128, KERNEL_LANE_CUTS = 32 };

typedef struct kernel_segment {
    float t_in, t_out, v_in, v_out;
} kernel_segment;

/* What a segment has beside that where no error is allowed: a lane of kernel_double; as large, so that one index finds
 * both. */
typedef struct kernel_segment_double {
    float length, rest_in, rest_out, unused;
} kernel_segment_double;

/* Crossings of transparent surfaces: the first of each ray in rows, sorted, +inf where there are no more. */
typedef struct kernel_cuts {
    int row_count;
    bool is_whole;       /* else the rest is looked for in the fragments */
    int64_t first, last; /* the packet's fragments of surfaces */
    float row[KERNEL_LANE_CUTS][SIMD_WIDTH];
} kernel_cuts;

typedef struct kernel_segments {
    int count[SIMD_WIDTH];
    kernel_segment items[SIMD_WIDTH][KERNEL_WINDOW]; /* each ray's, as they come */
    kernel_segment_double precise[SIMD_WIDTH][KERNEL_WINDOW];
    bool is_double; /* ends are known in double; */
    int room;       /* for half as many segments then, so that a tile's lists stay in the cache */
    kernel_double_rays rays;
    /* Meshes that overlap to no end: of segments that begin at one place, where no order is meant, those for which
     * there is no room are integrated at once, and blended behind the window's. */
    kernel_light heap;
    vf t_begin, t_end; /* the window */
    bool is_shortened; /* t_end has been lowered since this was last made false */
    vf per_t;          /* unit distances per t */
    kernel_cuts cuts;
} kernel_segments;

SIMD_INLINE int kernel_lane_of(const kernel_packet *p, uint32_t pixel)
{
    int lane = 0;
    while (lane < SIMD_WIDTH - 1 && p->pixel[lane] != pixel) lane++;
    return lane;
}

SIMD_INLINE void kernel_cuts_find(const kernel_packet *p, int64_t first, kernel_cuts *cuts)
{
    int count[SIMD_WIDTH] = {0};
    cuts->row_count = 0;
    cuts->is_whole = true;
    cuts->first = first;
    cuts->last = p->thread->out->count;
    for (int64_t i = first; p->frame->has_transparent && i < cuts->last; i++) {
        const fragment *hit = &p->thread->out->items[i];
        const int lane = kernel_lane_of(p, hit->pixel);
        int at = count[lane];
        if (at == KERNEL_LANE_CUTS) {
            cuts->is_whole = false;
            continue;
        }
        if (at == cuts->row_count) {
            vf_store(cuts->row[at], vf_set(INFINITY));
            cuts->row_count++;
        }
        for (; at > 0 && cuts->row[at - 1][lane] > hit->t_in; at--) cuts->row[at][lane] = cuts->row[at - 1][lane];
        cuts->row[at][lane] = hit->t_in;
        count[lane]++;
    }
}

/* A ray of more cuts than there are rows: its fragments are looked through. */
static vf kernel_next_cut_slowly(const kernel_packet *p, const kernel_cuts *cuts, vf from, bool beyond)
{
    float start[SIMD_WIDTH], next[SIMD_WIDTH];
    vf_store(start, from);
    vf_store(next, vf_set(INFINITY));
    for (int64_t i = cuts->first; i < cuts->last; i++) {
        const fragment *hit = &p->thread->out->items[i];
        const int lane = kernel_lane_of(p, hit->pixel);
        if ((beyond ? hit->t_in > start[lane] : hit->t_in >= start[lane]) && hit->t_in < next[lane])
            next[lane] = hit->t_in;
    }
    return vf_load(next);
}

/* The first cut at or, if asked, beyond t. */
SIMD_INLINE vf kernel_next_cut(const kernel_packet *p, const kernel_cuts *cuts, vf t, bool beyond)
{
    vf next = vf_set(INFINITY);
    if (!cuts->is_whole) return kernel_next_cut_slowly(p, cuts, t, beyond);
    for (int i = cuts->row_count; i-- > 0;) {
        const vf cut = vf_load(cuts->row[i]);
        next = vf_select(beyond ? vf_lt(t, cut) : vf_le(t, cut), cut, next);
    }
    return next;
}

/* ---- a ray's segments ---- */

SIMD_INLINE void kernel_segments_set_double(const kernel_packet *p, kernel_segments *list, bool is_double)
{
    list->is_double = is_double;
    list->room = is_double ? KERNEL_WINDOW / 2 : KERNEL_WINDOW;
    if (is_double) kernel_double_rays_of(p, &list->rays);
}

static void kernel_items_sort(kernel_segments *list, int lane)
{
    kernel_segment *items = list->items[lane];
    kernel_segment_double *precise = list->precise[lane];
    for (int n = 1; n < list->room; n++) {
        const kernel_segment s = items[n];
        const kernel_segment_double its = precise[n];
        int at = n;
        for (; at > 0 && items[at - 1].t_in > s.t_in; at--) {
            items[at] = items[at - 1];
            precise[at] = precise[at - 1];
        }
        items[at] = s;
        precise[at] = its;
    }
}

SIMD_INLINE void kernel_heap_clear(kernel_light *heap, int lane)
{
    for (int a = 0; a < 3; a++) heap->colour[a][lane] = 0;
    heap->depth[lane] = 0;
    heap->transmittance[lane] = 1;
}

/* Make room in a full ray for the segment, where it is of the window: that now ends at the begin of one of its farther
 * segments, which go. False where there is no room: all begin where it does. */
static __attribute__((noinline, cold)) bool kernel_segments_shorten(kernel_segments *list, int lane,
                                                                    const kernel_segment *s)
{
    kernel_segment *items = list->items[lane];
    kernel_items_sort(list, lane);
    int count = list->room * 3 / 4;
    const float first = items[0].t_in, last = items[list->room - 1].t_in;
    if (first == last) {
        if (s->t_in == first) return false;
        list->t_end[lane] = simd_max(s->t_in, first);
        if (s->t_in < first) {
            list->count[lane] = 0;
            kernel_heap_clear(&list->heap, lane);
        }
    } else {
        while (items[count].t_in == first) count++;
        while (items[count - 1].t_in == items[count].t_in) count--;
        list->count[lane] = count;
        list->t_end[lane] = items[count].t_in;
    }
    list->is_shortened = true;
    return true;
}

/* False where there is no room: more segments begin at one place than a window holds. */
SIMD_INLINE bool kernel_segments_put(kernel_segments *list, int lane, const kernel_segment *s,
                                     const kernel_segment_double *precise)
{
    if (__builtin_expect(list->count[lane] == list->room, 0)) {
        if (!kernel_segments_shorten(list, lane, s)) return false;
        if (!(s->t_in < list->t_end[lane])) return true;
    }
    if (list->is_double) list->precise[lane][list->count[lane]] = *precise;
    list->items[lane][list->count[lane]++] = *s;
    return true;
}

/* Of rays whose window they are of. precise: NULL unless the list is in double. */
SIMD_INLINE void kernel_segments_add(const kernel_pieces *pieces, kernel_segments *list, vm rays,
                                     const kernel_interval *i, const kernel_double *precise)
{
    kernel_segment all[SIMD_WIDTH];
    kernel_segment_double doubles[SIMD_WIDTH];
    float a[4][SIMD_WIDTH];
    unsigned bits = vm_bits(rays), left = 0;
    if (!bits) return;
    vf_store(a[0], i->t_in);
    vf_store(a[1], i->t_out);
    vf_store(a[2], i->v_in);
    vf_store(a[3], i->v_out);
    for (int n = 0; n < SIMD_WIDTH; n++) all[n] = (kernel_segment){a[0][n], a[1][n], a[2][n], a[3][n]};
    if (precise) {
        vf_store(a[0], precise->length);
        vf_store(a[1], precise->rest_in);
        vf_store(a[2], precise->rest_out);
        for (int n = 0; n < SIMD_WIDTH; n++) doubles[n] = (kernel_segment_double){a[0][n], a[1][n], a[2][n], 0};
    }
    for (; bits; bits &= bits - 1) {
        const int lane = __builtin_ctz(bits);
        if (!kernel_segments_put(list, lane, &all[lane], &doubles[lane])) left |= bits & -bits;
    }
    if (__builtin_expect(left != 0, 0)) {
        kernel_run run = kernel_run_of((i->t_out - i->t_in) * list->per_t, i->v_in, i->v_out);
        if (precise)
            run = (kernel_run){precise->length * list->per_t, i->v_in, i->v_out, precise->rest_in, precise->rest_out};
        kernel_integrate(pieces, vm_from_bits(left), &run, &list->heap);
    }
}

/* The packet's segments by t_in: rows of the n-th of each ray. */
typedef struct kernel_sorted {
    int row_count;
    vf t_in[KERNEL_WINDOW]; /* +inf where there are no more */
    vi item[KERNEL_WINDOW]; /* where it is among the ray's, in floats from list->items on */
} kernel_sorted;

SIMD_INLINE vf kernel_items_gather(const kernel_segments *list, int member, vi item)
{
    return vf_gather(&list->items[0][0].t_in + member, item);
}

SIMD_INLINE vf kernel_doubles_gather(const kernel_segments *list, int member, vi item)
{
    return vf_gather(&list->precise[0][0].length + member, item);
}

/* Rays whose two segments begin at one place, and the first of them, of no length in float32, ends there. */
static __attribute__((noinline, cold)) vm kernel_segments_tied(const kernel_segments *list, vm same, vi item,
                                                               vi earlier)
{
    return vm_and(same, vf_lt(kernel_items_gather(list, 1, item), kernel_items_gather(list, 1, earlier)));
}

/* By insertion, all rays at once: cells come nearly in order, for the traversal is front to back. */
static void kernel_segments_sort(const kernel_segments *list, kernel_sorted *out)
{
    enum { FLOATS = sizeof(kernel_segment) / sizeof(float) };
    int32_t first[SIMD_WIDTH];
    vi firsts, counts;
    out->row_count = 0;
    for (int lane = 0; lane < SIMD_WIDTH; lane++) {
        first[lane] = lane * KERNEL_WINDOW * FLOATS;
        out->row_count = list->count[lane] > out->row_count ? list->count[lane] : out->row_count;
    }
    memcpy(&firsts, first, sizeof firsts);
    memcpy(&counts, list->count, sizeof counts);
    const vf count = vf_from_vi(counts);
    for (int n = 0; n < out->row_count; n++) {
        const vm has = vf_lt(vf_set((float)n), count);
        vi item = (vi)vf_select(has, (vf)(firsts + n * FLOATS), (vf)firsts);
        vf t_in = vf_select(has, kernel_items_gather(list, 0, item), vf_set(INFINITY));
        int at = n;
        for (; at > 0; at--) {
            const vf before = out->t_in[at - 1];
            const vi earlier = out->item[at - 1];
            vm moves = vf_lt(t_in, before);
            if (list->is_double) {
                const vm same = vm_and(vf_eq(t_in, before), vf_lt(t_in, vf_set(INFINITY)));
                if (__builtin_expect(vm_any(same), 0))
                    moves = vm_or(moves, kernel_segments_tied(list, same, item, earlier));
            }
            if (!vm_any(moves)) break;
            out->t_in[at] = vf_select(moves, before, t_in);
            out->item[at] = (vi)vf_select(moves, (vf)earlier, (vf)item);
            t_in = vf_select(moves, t_in, before);
            item = (vi)vf_select(moves, (vf)item, (vf)earlier);
        }
        out->t_in[at] = t_in;
        out->item[at] = item;
    }
}

#endif
