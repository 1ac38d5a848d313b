/* To fold fragments means to blend them into one, in the fixed order of fragment_fold.h: a pixel's ray is cut into
 * intervals of t, which are halved repeatedly, and fragments are folded half by half. A run is a sequence of a pixel's
 * samples or segments that follow each other without a gap and without a surface in between. No other rank has
 * fragments between the begin and the end of a run. So if an interval, or a half of one, lies within a run, its
 * fragments can be folded. If only this rank has cells (job->is_alone), all fragments between two surfaces can be
 * folded. */
#include "render_fold.h"

#include <math.h>
#include <string.h>

#include "fragment_fold.h"
#include "fragment_order.h"
#include "kernel_types.h"
#include "memory.h"
#include "render_face_error.h"

static int64_t pixel_index_in_area(const render_folding *folding, const pixel_area *area, uint32_t pixel)
{
    const uint32_t width = (uint32_t)folding->job->camera.width;
    const int y = (int)(pixel / width) - area->y, x = (int)(pixel % width) - area->x;
    return (int64_t)y * area->width + x;
}

static bool reserve_folding(render_folding *folding, int64_t count)
{
    enum { PIXELS = KERNEL_TILE * KERNEL_TILE };
    if (!folding->starts) folding->starts = base_alloc((PIXELS + 1) * sizeof *folding->starts);
    if (folding->capacity < count) {
        base_free(folding->items);
        folding->capacity = count + count / 2;
        folding->items = base_alloc((size_t)folding->capacity * sizeof *folding->items);
        if (!folding->items) folding->capacity = 0;
    }
    return folding->starts && folding->items;
}

/* Sorts the tile's fragments by pixel, keeping the order within a pixel. The fragments of pixel k begin at
 * items[starts[k]]. */
static void sort_fragments_by_pixel(render_folding *folding, const pixel_area *area, const fragment *items,
                                    int64_t count)
{
    const int64_t pixels = (int64_t)area->width * area->height;
    int64_t *starts = folding->starts;
    memset(starts, 0, (size_t)(pixels + 1) * sizeof *starts);
    for (int64_t i = 0; i < count; i++) starts[pixel_index_in_area(folding, area, items[i].pixel)]++;
    for (int64_t k = 1; k < pixels; k++) starts[k] += starts[k - 1];
    for (int64_t i = count; i-- > 0;)
        folding->items[--starts[pixel_index_in_area(folding, area, items[i].pixel)]] = items[i];
    starts[pixels] = count;
}

/* Sorts a pixel's volume fragments by depth; they are nearly sorted already. Kinds are not compared: the kind only
 * marks the first fragment of a run (a sequence without gaps, defined at the top of this file), and this mark must not
 * affect the order. */
static void sort_fragments_by_depth(fragment *items, int64_t count)
{
    for (int64_t i = 1; i < count; i++) {
        fragment moving = items[i];
        const uint32_t sign = moving.kind;
        int64_t to = i;
        for (; to > 0 && items[to - 1].t_in >= moving.t_in; to--) {
            fragment before = items[to - 1];
            before.kind = moving.kind = FRAGMENT_VOLUME;
            if (fragment_compare(&moving, &before) >= 0) break;
            items[to] = items[to - 1];
        }
        moving.kind = sign;
        items[to] = moving;
    }
}

/* Returns the error bound of a segment's end at t. If a segment of another rank begins or ends within this distance of
 * t, the cells of the two segments may touch. */
static float compute_segment_end_error(float t)
{
    return fmaxf(fabsf(t), 1) * RENDER_FACE_ERROR;
}

/* Moves the end of each folded fragment towards the eye by its error bound, so that compositing does not take fragments
 * of touching cells for overlapping ones (kernel_segments.h). Samples need no such margin. */
static void shorten_folded_segments(const render_folding *folding, fragment *items, int64_t count)
{
    for (int64_t i = 0; i < count && folding->has_segments; i++)
        items[i].t_out -= compute_segment_end_error(items[i].t_out);
}

/* Blends the `count` fragments of one run (a sequence without gaps), separately in each interval of the ray
 * (fragment_interval_number()). Stores the resulting fragments at `out`, and returns the address behind the last
 * one. */
static fragment *fold_gapless_fragments(const render_folding *folding, fragment *run, int64_t count, fragment *out)
{
    const bool is_alone = folding->job->is_alone;
    float begin = -INFINITY, end = INFINITY;
    run[0].kind = FRAGMENT_VOLUME;
    for (int64_t i = 0; i < count && !is_alone; i++) end = i && end > run[i].t_out ? end : run[i].t_out;
    if (!is_alone) begin = run[0].t_in;
    if (folding->has_segments && !is_alone) {
        begin += compute_segment_end_error(begin);
        end -= compute_segment_end_error(end);
    }
    for (int64_t i = 0, n; i < count; i += n) {
        const int32_t interval_number = fragment_interval_number(run[i].t_in);
        for (n = 1; i + n < count && fragment_interval_number(run[i + n].t_in) == interval_number;) n++;
        const int64_t made = fragment_fold_between(run + i, n, begin, end, run + i);
        shorten_folded_segments(folding, run + i, made);
        for (int64_t k = i; k < i + made; k++)
            if (fragment_changes_picture(&run[k])) *out++ = run[k];
    }
    return out;
}

static fragment *fold_pixel(const render_folding *folding, fragment *items, int64_t count, fragment *out)
{
    int64_t volumes = 0;
    for (int64_t i = 0; i < count; i++) {
        const bool is_mark = items[i].kind == FRAGMENT_LATE;
        if (items[i].kind < FRAGMENT_SURFACE && !is_mark) {
            items[volumes++] = items[i];
            continue;
        }
        *out = items[i];
        if (is_mark) out->kind = FRAGMENT_VOLUME;
        out++;
    }
    sort_fragments_by_depth(items, volumes);
    for (int64_t i = 0, n; i < volumes; i += n) {
        for (n = 1; i + n < volumes && items[i + n].kind == FRAGMENT_VOLUME;) n++;
        out = fold_gapless_fragments(folding, items + i, n, out);
    }
    return out;
}

bool render_fold(render_folding *folding, const pixel_area *area, fragment_list *list)
{
    const int64_t count = list->count, pixels = (int64_t)area->width * area->height;
    if (count == 0) return true;
    if (!reserve_folding(folding, count)) return false;
    sort_fragments_by_pixel(folding, area, list->items, count);
    fragment *out = list->items;
    for (int64_t k = 0; k < pixels; k++) {
        const int64_t own = folding->starts[k + 1] - folding->starts[k];
        if (own) out = fold_pixel(folding, folding->items + folding->starts[k], own, out);
    }
    list->count = out - list->items;
    return true;
}

void render_folding_free(render_folding *folding)
{
    base_free(folding->items);
    base_free(folding->starts);
}
