/* Defines how fragments are merged: how one pixel's fragments, from any ranks and in any order, become one colour.
 *
 * The order is total, down to the last bit of a fragment: fragments that compare equal are identical. The rounding of
 * blending depends on the order. Because the order is total, the result depends only on the set of fragments. Of two
 * fragments, the one with the smaller t_in is in front. If a surface and a volume have the same t_in, the surface is in
 * front, because it lies at the near end of the volume's interval.
 *
 * Samples at the same position have no order: their media are mixed there. Together they absorb 1 - T1 T2 ... Tn, which
 * is less than the sum of their separate absorptions. Each sample contributes in proportion to its own absorption. This
 * is computed in double, so that the contributions are as exact as the samples.
 *
 * Where intervals overlap, their media are mixed. The ray is cut at the start and at the end of every interval. Between
 * two neighbouring cuts, each interval that spans both is treated as a homogeneous medium, and the optical depths and
 * the light of these media are added:
 *
 *     |-- a ------------|            -ln T  = sum of the parts of -ln Ta, -ln Tb ... between the cuts
 *            |-- b -------------|    colour = (1 - T) times the mean of their colours, weighted by these parts
 *     |  a   |  a and b |   b   |
 *
 * The renderer makes intervals short enough for this approximation (render/volume/kernel_segments.h). */
#include "comp_merge.h"

#include "comp.h"
#include "fragment_fold.h"
#include "fragment_order.h"

#include <math.h>
#include <string.h>

enum { insertion_limit = 24 };

static void insertion_sort(fragment *items, int64_t count)
{
    for (int64_t i = 1; i < count; i++) {
        const fragment moving = items[i];
        int64_t to = i;
        for (; to > 0 && fragment_compare(&moving, &items[to - 1]) < 0; to--) items[to] = items[to - 1];
        items[to] = moving;
    }
}

static void sift_down(fragment *items, int64_t root, int64_t count)
{
    const fragment moving = items[root];
    for (int64_t child; (child = 2 * root + 1) < count; root = child) {
        if (child + 1 < count && fragment_compare(&items[child], &items[child + 1]) < 0) child++;
        if (fragment_compare(&moving, &items[child]) >= 0) break;
        items[root] = items[child];
    }
    items[root] = moving;
}

/* Sorts by heap sort, which needs no memory and no recursion and takes O(n log n) in the worst case too. The worst case
 * matters, because with some partitions of the mesh a pixel has thousands of fragments. */
static void heap_sort(fragment *items, int64_t count)
{
    if (count <= insertion_limit) {
        insertion_sort(items, count);
        return;
    }
    for (int64_t root = count / 2; root-- > 0;) sift_down(items, root, count);
    for (int64_t last = count - 1; last > 0; last--) {
        const fragment behind_all = items[0];
        items[0] = items[last];
        items[last] = behind_all;
        sift_down(items, 0, last);
    }
}

static float find_depth_of_nearest_surface(const fragment *sorted, int64_t count)
{
    for (int64_t i = 0; i < count; i++)
        if (sorted[i].kind >= FRAGMENT_SURFACE) return sorted[i].t_in;
    return INFINITY;
}

static bool is_sample(const fragment *f)
{
    return f->kind < FRAGMENT_SURFACE && f->t_in == f->t_out;
}

/* Returns the number of leading samples that have the same position; 1 if the first fragment is not a sample. */
static int64_t count_coincident_samples(const fragment *sorted, int64_t count)
{
    int64_t n = 1;
    while (n < count && is_sample(&sorted[0]) && is_sample(&sorted[n]) && sorted[n].t_in == sorted[0].t_in) n++;
    return n;
}

/* The state of a pass over the sorted samples at one position of the ray, which determines the samples that are
 * blended. If a volume has one sample at the end of a cell and another at the start of a cell, the two cells are
 * neighbours, and rounding has placed their common face at two positions; only one of the two samples is then
 * blended. */
typedef struct sample_pass {
    uint32_t layer; /* index of the volume layer to which the most recent sample belongs */
    /* number of samples at the start of their cell that no sample at a cell's end has matched yet */
    int64_t unmatched_begins;
    int64_t counted; /* number of samples of this volume that are blended, so far */
} sample_pass;

static bool select_sample_for_blending(sample_pass *pass, const fragment *sample)
{
    const uint32_t layer = sample->kind / FRAGMENT_LAYER, ends = sample->kind % FRAGMENT_LAYER;
    if (layer != pass->layer) *pass = (sample_pass){.layer = layer};
    if (ends == FRAGMENT_LATE && pass->unmatched_begins > 0) {
        pass->unmatched_begins--;
        return false;
    }
    pass->unmatched_begins += ends == FRAGMENT_EARLY;
    pass->counted++;
    return true;
}

/* Returns whether two of the samples belong to the same volume. */
static bool have_two_samples_of_one_volume(const fragment *samples, int64_t count)
{
    sample_pass pass = {0};
    for (int64_t i = 0; i < count; i++)
        if (select_sample_for_blending(&pass, &samples[i]) && pass.counted > 1) return true;
    return false;
}

/* Tolerance between the values of t that two cells compute for a ray's crossing of their common face. It is relative to
 * t or to 1, whichever is larger. The value is RENDER_FACE_ERROR of render/rays/render_face_error.h; compositing may
 * not include that header. */
static const float face_error = 4e-6f;

/* Returns the least t that a crossing may have with the face that a ray crosses at t. */
static float subtract_face_error(float t)
{
    return t - face_error * fmaxf(fabsf(t), 1);
}

/* Advances *next past all fragments that begin before t by more than the rounding error of the t at which a ray crosses
 * a face. Returns the largest t_out of the volume fragments that were passed, or `reach` if it is larger. */
static float find_furthest_end_before(const fragment *sorted, int64_t *next, float t, float reach)
{
    const float begin = subtract_face_error(t);
    for (; sorted[*next].t_in < begin; ++*next)
        if (sorted[*next].kind < FRAGMENT_SURFACE) reach = fmaxf(reach, sorted[*next].t_out);
    return reach;
}

bool comp_pixel_overlaps(const fragment *sorted, int64_t count)
{
    float reach = -INFINITY, before = -INFINITY;
    int64_t next = 0;
    for (int64_t i = 0, n; i < count; i += n) {
        const fragment *f = &sorted[i];
        n = count_coincident_samples(f, count - i);
        const bool is_surface = f->kind >= FRAGMENT_SURFACE;
        if (is_surface) before = find_furthest_end_before(sorted, &next, f->t_in, before);
        if (f->t_in <= (is_surface ? before : reach) && f->t_out >= f->t_in) return true;
        if (f->transmittance == 0) return false;
        if (n > 1 && have_two_samples_of_one_volume(f, n)) return true;
        if (!is_surface && f->t_out > reach) reach = f->t_out;
    }
    return false;
}

static fragment mix_samples(const fragment *samples, int64_t count)
{
    fragment mixed = samples[0];
    double colour[3] = {0, 0, 0}, weight = 0, absorbed = 0;
    sample_pass pass = {0};
    for (int64_t i = 0; i < count; i++) {
        if (!select_sample_for_blending(&pass, &samples[i])) continue;
        const double own = 1 - (double)samples[i].transmittance;
        for (int c = 0; c < 3; c++) colour[c] += (double)samples[i].colour[c];
        weight += own;
        absorbed += own * (1 - absorbed);
    }
    const double share = weight > 0 ? absorbed / weight : 1;
    for (int c = 0; c < 3; c++) mixed.colour[c] = (float)(colour[c] * share);
    mixed.transmittance = (float)(1 - absorbed);
    return mixed;
}

/* The colour and transmittance accumulated so far along a ray. */
typedef struct blend {
    double colour[3], transmittance;
} blend;

static void blend_over(blend *b, const fragment *f)
{
    for (int c = 0; c < 3; c++) b->colour[c] += b->transmittance * (double)f->colour[c];
    b->transmittance *= (double)f->transmittance;
}

static bool is_volume_of_positive_length(const fragment *f)
{
    return f->kind < FRAGMENT_SURFACE && f->t_out > f->t_in;
}

/* Finite value that is used as the optical depth of an opaque medium; the true value is infinite. */
static const double opaque_depth = 1e6;

/* Blends a homogeneous mixture of media behind what *b contains. The mixture reaches from t = `from` to t = `to`. Each
 * of its media is a volume fragment whose interval contains both of these points. */
static void blend_mixture(blend *b, const fragment *items, int64_t count, float from, float to)
{
    double colour[3] = {0, 0, 0}, depth = 0;
    for (int64_t i = 0; i < count; i++) {
        const fragment *f = &items[i];
        const double absorbed = 1 - (double)f->transmittance;
        const double share = ((double)to - (double)from) / ((double)f->t_out - (double)f->t_in);
        const double own = share * (absorbed < 1 ? -log((double)f->transmittance) : opaque_depth);
        const double emitted =
            /* the optical depth divided by the opacity, or the limit of this quotient if transmittance is so close to 1
             * that the opacity is 0 */
            absorbed > 0 ? own / absorbed : share;
        for (int c = 0; c < 3; c++) colour[c] += (double)f->colour[c] * emitted;
        depth += own;
    }
    const double light = depth > 0 ? -expm1(-depth) / depth : 1;
    for (int c = 0; c < 3; c++) b->colour[c] += b->transmittance * light * colour[c];
    b->transmittance *= exp(-depth);
}

static void swap_fragments(fragment *items, int64_t a, int64_t b)
{
    const fragment kept = items[a];
    items[a] = items[b];
    items[b] = kept;
}

/* Moves the fragments whose intervals end behind t = `depth` to the front of the list, without changing their order.
 * Returns the number of these fragments. */
static int64_t move_unfinished_intervals_to_front(fragment *items, int64_t count, float depth)
{
    int64_t open = 0;
    for (int64_t i = 0; i < count; i++)
        if (items[i].t_out > depth) swap_fragments(items, open++, i);
    return open;
}

static float find_next_interval_end(const fragment *items, int64_t count)
{
    float to = INFINITY;
    for (int64_t i = 0; i < count; i++)
        if (items[i].t_out < to) to = items[i].t_out;
    return to;
}

/* Returns whether the second fragment of the sorted list begins before the first one ends. `count` is the length of the
 * list. */
static bool overlaps_next_fragment(const fragment *sorted, int64_t count)
{
    return count > 1 && is_volume_of_positive_length(&sorted[0]) && sorted[1].t_in < sorted[0].t_out;
}

/* The callback that receives the blended intervals, and its state. callback may be NULL. */
typedef struct interval_sink {
    comp_interval_callback *callback;
    void *state;
} interval_sink;

static void emit_interval(const interval_sink *sink, const blend *b, const fragment *of, float from, float to)
{
    fragment interval = *of;
    interval.t_in = from;
    interval.t_out = to;
    for (int c = 0; c < 3; c++) interval.colour[c] = (float)b->colour[c];
    interval.transmittance = (float)b->transmittance;
    sink->callback(sink->state, &interval);
}

/* Blends the mixture of the given volume fragments between t = `from` and t = `to` behind what *b contains
 * (blend_mixture()), and passes the mixture to the sink's callback. */
static void blend_interval(blend *b, const fragment *items, int64_t count, float from, float to,
                           const interval_sink *sink)
{
    blend own = {{0, 0, 0}, 1};
    if (sink->callback) {
        blend_mixture(&own, items, count, from, to);
        emit_interval(sink, &own, items, from, to);
    }
    blend_mixture(b, items, count, from, to);
}

/* Blends fragments from the first one on until no interval is open; returns the number of blended fragments. An
 * interval is open at a point of the ray if it begins at or before this point and ends behind it. Fragments with open
 * intervals are kept at the front of the list, so that the cost between two cuts depends only on the number of
 * intervals mixed there: a long interval beside a thousand consecutive short ones costs a thousand mixtures of two
 * media. At the end the fragments are in their original order. */
static int64_t blend_overlapping(blend *b, fragment *sorted, int64_t count, const interval_sink *sink)
{
    float at = sorted[0].t_in;
    int64_t open = 0, end = 0;
    for (;;) {
        for (; end < count && sorted[end].t_in <= at; end++) {
            if (is_volume_of_positive_length(&sorted[end])) {
                swap_fragments(sorted, open++, end);
            } else {
                blend_over(b, &sorted[end]);
                if (sink->callback) sink->callback(sink->state, &sorted[end]);
            }
        }
        open = move_unfinished_intervals_to_front(sorted, open, at);
        if (open == 0 || b->transmittance == 0) break;
        float to = find_next_interval_end(sorted, open);
        if (end < count && sorted[end].t_in < to) to = sorted[end].t_in;
        blend_interval(b, sorted, open, at, to, sink);
        at = to;
    }
    heap_sort(sorted, end);
    return end;
}

/* Blends a pixel's only fragment over the background. Most pixels have only one fragment. */
static void blend_single(const fragment *f, const float background[4], float out_rgba[4], float *out_depth)
{
    for (int c = 0; c < 3; c++) out_rgba[c] = 0 + f->colour[c] + f->transmittance * background[c];
    out_rgba[3] = 1 - f->transmittance + f->transmittance * background[3];
    *out_depth = find_depth_of_nearest_surface(f, 1);
}

/* Blends the fragments of a pixel, sorted front to back, over the background. Not inlined, because inlining would slow
 * down pixels with a single fragment, which are frequent and do not need this function. */
static __attribute__((noinline)) void
sort_and_blend_fragments(fragment *items, int64_t count, const float background[4], float out_rgba[4], float *out_depth)
{
    static const interval_sink no_sink = {NULL, NULL};
    heap_sort(items, count);
    float colour[3] = {0, 0, 0};
    float transmittance = 1;
    for (int64_t i = 0, n; i < count && transmittance != 0; i += n) {
        if (overlaps_next_fragment(items + i, count - i)) {
            blend run = {{0, 0, 0}, 1};
            n = blend_overlapping(&run, items + i, count - i, &no_sink);
            for (int c = 0; c < 3; c++) colour[c] += transmittance * (float)run.colour[c];
            transmittance *= (float)run.transmittance;
            continue;
        }
        n = count_coincident_samples(items + i, count - i);
        const fragment f = n == 1 ? items[i] : mix_samples(items + i, n);
        for (int c = 0; c < 3; c++) colour[c] += transmittance * f.colour[c];
        transmittance *= f.transmittance;
    }
    for (int c = 0; c < 3; c++) out_rgba[c] = colour[c] + transmittance * background[c];
    out_rgba[3] = 1 - transmittance + transmittance * background[3];
    *out_depth = find_depth_of_nearest_surface(items, count);
}

/* Returns the number of leading fragments that are blended into one (folded, fragment_fold.h): volume fragments that
 * begin in the same one of the intervals of fixed length into which folding divides the ray. */
static int64_t count_fragments_to_fold(const fragment *sorted, int64_t count)
{
    const int32_t interval = fragment_interval_number(sorted[0].t_in);
    int64_t n = 1;
    if (sorted[0].kind >= FRAGMENT_SURFACE) return n;
    while (n < count && sorted[n].kind < FRAGMENT_SURFACE && fragment_interval_number(sorted[n].t_in) == interval) n++;
    return n;
}

/* Returns whether the fragments blended so far hide the fragment `next`; `before` is the last blended fragment, and the
 * transmittance is that of all of them. Folding divides the ray into intervals of fixed length. If `next` is in a later
 * one of these intervals than `before`, a transmittance of at most FRAGMENT_DARK counts as 0, because ranks may have
 * omitted fragments of later intervals (fragment_fold.h). */
static bool is_hidden_behind(float transmittance, const fragment *before, const fragment *next)
{
    return transmittance == 0 || (transmittance <= FRAGMENT_DARK &&
                                  fragment_interval_number(before->t_in) != fragment_interval_number(next->t_in));
}

/* Returns whether the segment begins at the face on which the surface lies, and ends behind it, although rounding may
 * place the surface slightly behind the segment's begin. Samples are not segments: their t_in and t_out are equal. */
static bool begins_at_surface(const fragment *segment, const fragment *surface)
{
    return segment->kind < FRAGMENT_SURFACE && segment->t_in >= subtract_face_error(surface->t_in) &&
           segment->t_out > surface->t_in;
}

/* Sorts fragments by depth, and moves surfaces in front of the segments that begin at them. */
static void sort_with_surfaces_at_faces(fragment *items, int64_t count)
{
    heap_sort(items, count);
    for (int64_t i = 1; i < count; i++)
        for (int64_t to = i;
             items[to].kind >= FRAGMENT_SURFACE && to > 0 && begins_at_surface(&items[to - 1], &items[to]); to--)
            swap_fragments(items, to - 1, to);
}

/* The order is that of sort_with_surfaces_at_faces(), which does not depend on which rank has the surface and which the
 * segment. */
void comp_merge_folded_pixel(fragment *items, int64_t count, const float background[4], float out_rgba[4],
                             float *out_depth)
{
    sort_with_surfaces_at_faces(items, count);
    float colour[3] = {0, 0, 0};
    float transmittance = 1;
    for (int64_t i = 0, n; i < count && !(i > 0 && is_hidden_behind(transmittance, &items[i - 1], &items[i])); i += n) {
        n = count_fragments_to_fold(items + i, count - i);
        const fragment f = fragment_fold(items + i, n);
        for (int c = 0; c < 3; c++) colour[c] += transmittance * f.colour[c];
        transmittance *= f.transmittance;
    }
    for (int c = 0; c < 3; c++) out_rgba[c] = colour[c] + transmittance * background[c];
    out_rgba[3] = 1 - transmittance + transmittance * background[3];
    *out_depth = find_depth_of_nearest_surface(items, count);
}

void comp_merge_pixel(fragment *items, int64_t count, const float background[4], float out_rgba[4], float *out_depth)
{
    if (count == 1)
        blend_single(items, background, out_rgba, out_depth);
    else
        sort_and_blend_fragments(items, count, background, out_rgba, out_depth);
}

void comp_merge_intervals(fragment *sorted, int64_t count, comp_interval_callback *callback, void *state)
{
    const interval_sink sink = {callback, state};
    float transmittance = 1;
    for (int64_t i = 0, n; i < count && transmittance != 0; i += n) {
        if (overlaps_next_fragment(sorted + i, count - i)) {
            blend run = {{0, 0, 0}, 1};
            n = blend_overlapping(&run, sorted + i, count - i, &sink);
            transmittance *= (float)run.transmittance;
            continue;
        }
        n = count_coincident_samples(sorted + i, count - i);
        const fragment f = n == 1 ? sorted[i] : mix_samples(sorted + i, n);
        callback(state, &f);
        transmittance *= f.transmittance;
    }
}

void comp_merge_folded_intervals(const fragment *sorted, int64_t count, comp_interval_callback *callback, void *state)
{
    float transmittance = 1;
    for (int64_t i = 0, n; i < count && !(i > 0 && is_hidden_behind(transmittance, &sorted[i - 1], &sorted[i]));
         i += n) {
        n = count_fragments_to_fold(sorted + i, count - i);
        const fragment f = fragment_fold(sorted + i, n);
        callback(state, &f);
        transmittance *= f.transmittance;
    }
}

/* Fragments behind the point of the ray at which blending stops are not tested for overlaps. Ranks may omit such
 * fragments, so that their number depends on the partition. */
bool comp_folded_pixel_overlaps(const fragment *sorted, int64_t count)
{
    float transmittance = 1;
    int64_t visible = 0;
    for (int64_t n;
         visible < count && !(visible > 0 && is_hidden_behind(transmittance, &sorted[visible - 1], &sorted[visible]));
         visible += n) {
        n = count_fragments_to_fold(sorted + visible, count - visible);
        transmittance *= fragment_fold(sorted + visible, n).transmittance;
    }
    return comp_pixel_overlaps(sorted, visible);
}
