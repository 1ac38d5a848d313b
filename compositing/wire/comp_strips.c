/* The renderer makes fragments tile by tile, so that the fragments of a strip form few contiguous ranges of the list.
 * Only these ranges are sorted by strip; fragments are not moved. Each thread finds the ranges of a part of the
 * list. */
#include "comp_strips.h"

#include <string.h>

#include "memory.h"
#include "region.h"

enum { LONGEST_SORTED = 64, LEAST_PART = 1 << 14, MOST_PARTS = 256 };

_Static_assert(sizeof(fragment) == (1 + COMP_WORDS) * sizeof(uint32_t), "a fragment is a pixel and words");

/* ---- ranges of fragments ---------------------------------------------------------------------------------------- */

/* The ranges that one thread found in its part of the list, in the order of the list. */
typedef struct part {
    comp_range *ranges;
    int64_t count, capacity;
    insitu_status status;
} part;

static bool add_range(part *p, comp_range range)
{
    if (p->count == p->capacity) {
        const int64_t more = p->capacity ? 2 * p->capacity : 1024;
        comp_range *grown = base_realloc(p->ranges, (size_t)more * sizeof *grown);
        if (!grown) {
            p->status = INSITU_ERROR_MEMORY;
            return false;
        }
        p->ranges = grown;
        p->capacity = more;
    }
    p->ranges[p->count++] = range;
    return true;
}

static void find_ranges(const comp_grid *grid, const fragment *items, int64_t first, int64_t end, part *p)
{
    const uint64_t pixels = (uint64_t)grid->width * grid->height;
    comp_range range = {0, (uint32_t)first, 0};
    for (int64_t i = first; i < end; i++) {
        if (items[i].pixel >= pixels) p->status = INSITU_ERROR_INTERNAL;
        if (p->status) return;
        const uint32_t strip = comp_find_strip_of_pixel(grid, items[i].pixel);
        if (strip != range.strip) {
            if (range.count && !add_range(p, range)) return;
            range = (comp_range){strip, (uint32_t)i, 0};
        }
        range.count++;
    }
    if (range.count) add_range(p, range);
}

/* Copies the ranges of all parts to out->ranges, sorted by strip (counting sort). out->starts must contain only zeros
 * before the call. */
static void sort_ranges(const part *parts, int part_count, comp_strips *out)
{
    uint32_t *const starts = out->starts, sum = 0;
    for (int k = 0; k < part_count; k++)
        for (int64_t i = 0; i < parts[k].count; i++) starts[parts[k].ranges[i].strip]++;
    for (uint32_t s = 0; s < out->grid->strips; s++) starts[s] = sum += starts[s];
    starts[out->grid->strips] = sum;
    for (int k = part_count; k-- > 0;)
        for (int64_t i = parts[k].count; i-- > 0;) out->ranges[--starts[parts[k].ranges[i].strip]] = parts[k].ranges[i];
}

static insitu_status concatenate_fragment_ranges(const part *parts, int count, comp_strips *out)
{
    int64_t ranges = 0;
    for (int k = 0; k < count; k++) {
        if (parts[k].status) return parts[k].status;
        ranges += parts[k].count;
    }
    out->ranges = base_alloc((size_t)ranges * sizeof *out->ranges);
    out->starts = base_calloc((size_t)out->grid->strips + 1, sizeof *out->starts);
    if (!out->ranges || !out->starts) return INSITU_ERROR_MEMORY;
    sort_ranges(parts, count, out);
    return INSITU_OK;
}

static int choose_part_count(const comp_grid *grid, int64_t count)
{
    const int64_t most = count / LEAST_PART + 1, threads = grid->threads < MOST_PARTS ? grid->threads : MOST_PARTS;
    return (int)(most < threads ? most : threads);
}

insitu_status comp_strips_make(const comp_grid *grid, const fragment_list *list, comp_strips *out, base_error *error)
{
    comp_strips made = {.grid = grid, .items = list->items};
    part parts[MOST_PARTS] = {{NULL, 0, 0, INSITU_OK}};
    const int count = choose_part_count(grid, list->count);
    if (list->count > UINT32_MAX)
        return base_fail(error, INSITU_ERROR_MEMORY,
                         "compositing: %lld fragments of one rank are more than can be composited",
                         (long long)list->count);
#pragma omp parallel num_threads(count)
    {
        region_enter();
#pragma omp for schedule(static, 1) nowait
        for (int k = 0; k < count; k++)
            find_ranges(grid, list->items, list->count * k / count, list->count * (k + 1) / count, &parts[k]);
        region_leave();
    }
    const insitu_status status = concatenate_fragment_ranges(parts, count, &made);
    for (int k = 0; k < count; k++) base_free(parts[k].ranges);
    if (!status) {
        *out = made;
        return INSITU_OK;
    }
    comp_strips_free(&made);
    return status == INSITU_ERROR_INTERNAL
               ? base_fail(error, status, "compositing: a fragment's pixel is not in the image")
               : base_fail(error, status, "compositing: no memory to sort %lld fragments", (long long)list->count);
}

void comp_strips_free(comp_strips *strips)
{
    base_free(strips->ranges);
    base_free(strips->starts);
    *strips = (comp_strips){0};
}

int64_t comp_strips_count_fragments(const comp_strips *strips, uint32_t strip)
{
    int64_t count = 0;
    for (uint32_t r = strips->starts[strip]; r < strips->starts[strip + 1]; r++) count += strips->ranges[r].count;
    return count;
}

/* ---- packing strips into sheets --------------------------------------------------------------------------------- */

/* Fills a sheet with all fragments of the strip; returns false if a pixel has more than one fragment. */
static bool fill_sheet_of_single_fragments(const comp_strips *s, uint32_t strip, comp_sheet *sheet)
{
    comp_sheet_begin(sheet, strip);
    for (uint32_t r = s->starts[strip]; r < s->starts[strip + 1]; r++) {
        const fragment *item = s->items + s->ranges[r].first;
        for (const fragment *end = item + s->ranges[r].count; item < end; item++) {
            const uint32_t at = comp_grid_index_in_strip(s->grid, item->pixel);
            if (comp_sheet_has(sheet, at)) return false;
            comp_sheet_put(sheet, at, item);
        }
    }
    return true;
}

/* Sorts the fragments of one pixel front to back, unless the pixel has very many. Sheet n gets the n-th fragment of
 * every pixel. If each pixel's fragments are sorted, neighbouring fragments of a sheet mostly belong to the same
 * surface, so that the sheet compresses well. */
static void sort_fragments_of_pixel(const fragment **order, uint32_t count)
{
    if (count > LONGEST_SORTED) return;
    for (uint32_t i = 1; i < count; i++) {
        const fragment *const moving = order[i];
        uint32_t to = i;
        for (; to > 0 && moving->t_in < order[to - 1]->t_in; to--) order[to] = order[to - 1];
        order[to] = moving;
    }
}

/* Lists the fragments of a strip in layers->order, sorted by pixel. On return, the fragments of pixel k begin at index
 * layers->ends[k]. Returns false if memory ran out. */
static bool list_fragments_by_pixel(const comp_strips *s, uint32_t strip, comp_layers *layers)
{
    const int64_t count = comp_strips_count_fragments(s, strip);
    uint32_t *const ends = layers->ends;
    if (layers->capacity < count) {
        base_free(layers->order);
        layers->order = base_alloc((size_t)(2 * count) * sizeof *layers->order);
        layers->capacity = layers->order ? 2 * count : 0;
        if (!layers->order) return false;
    }
    memset(ends, 0, sizeof layers->ends);
    for (uint32_t r = s->starts[strip]; r < s->starts[strip + 1]; r++)
        for (uint32_t i = 0; i < s->ranges[r].count; i++)
            ends[comp_grid_index_in_strip(s->grid, s->items[s->ranges[r].first + i].pixel)]++;
    for (int k = 1; k <= COMP_STRIP_PIXELS; k++) ends[k] += ends[k - 1];
    for (uint32_t r = s->starts[strip]; r < s->starts[strip + 1]; r++)
        for (uint32_t i = 0; i < s->ranges[r].count; i++) {
            const fragment *const item = s->items + s->ranges[r].first + i;
            layers->order[--ends[comp_grid_index_in_strip(s->grid, item->pixel)]] = item;
        }
    for (int k = 0; k < COMP_STRIP_PIXELS; k++) sort_fragments_of_pixel(layers->order + ends[k], ends[k + 1] - ends[k]);
    return true;
}

/* Fills a sheet with the fragment of index n of each pixel of the strip, for all pixels that have more than n
 * fragments. Returns the number of these pixels. */
static int fill_sheet_with_nth_fragments(const comp_layers *layers, uint32_t n, comp_sheet *sheet, uint32_t strip)
{
    int count = 0;
    comp_sheet_begin(sheet, strip);
    for (uint32_t k = 0; k < COMP_STRIP_PIXELS; k++) {
        if (layers->ends[k] + n >= layers->ends[k + 1]) continue;
        comp_sheet_put(sheet, k, layers->order[layers->ends[k] + n]);
        count++;
    }
    return count;
}

bool comp_strips_pass_sheets(const comp_strips *s, uint32_t strip, comp_layers *layers, comp_sheet_callback *take,
                             void *state)
{
    if (s->starts[strip] == s->starts[strip + 1]) return true;
    if (fill_sheet_of_single_fragments(s, strip, &layers->sheet))
        return take(state, &layers->sheet, (int)comp_strips_count_fragments(s, strip));
    if (!list_fragments_by_pixel(s, strip, layers)) return false;
    for (uint32_t n = 0, count; (count = (uint32_t)fill_sheet_with_nth_fragments(layers, n, &layers->sheet, strip)) > 0;
         n++)
        if (!take(state, &layers->sheet, (int)count)) return false;
    return true;
}

void comp_layers_free(comp_layers *layers)
{
    base_free(layers->order);
    layers->order = NULL;
    layers->capacity = 0;
}
