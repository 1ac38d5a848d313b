/* The renderer makes fragments tile by tile, so those of a window are near each other in the list, and few windows are
 * filled at a time: a counting sort into a second list goes through both nearly in order. Each thread has a part of the
 * list and its own counts. */
#include "comp_windows.h"

#include <string.h>

#include "memory.h"

enum { WINDOW = 1 << COMP_RUN_SHIFT, LONGEST_SORTED = 64 };

_Static_assert(sizeof(fragment) == sizeof(uint32_t[COMP_RECORD_WORDS]), "a fragment is a record");

static inline uint64_t window_of(const comp_windows *w, uint32_t pixel)
{
    return (uint64_t)comp_layout_owner(w->layout, pixel) * w->per_owner +
           (comp_layout_index(w->layout, pixel) >> COMP_RUN_SHIFT);
}

/* Computes where each thread's part of each window begins; *total gets the number of fragments. */
static void add_counts(uint32_t *counts, uint64_t windows, int parts, uint32_t *starts)
{
    uint32_t at = 0;
    for (uint64_t k = 0; k < windows; k++) {
        starts[k] = at;
        for (int part = 0; part < parts; part++) {
            uint32_t *const count = &counts[(uint64_t)part * windows + k];
            const uint32_t own = *count;
            *count = at;
            at += own;
        }
    }
    starts[windows] = at;
}

static void sort(comp_windows *w, const fragment_list *list, uint32_t *counts, uint64_t windows, int parts)
{
#pragma omp parallel for num_threads(parts) schedule(static, 1)
    for (int part = 0; part < parts; part++)
        for (int64_t i = list->count * part / parts; i < list->count * (part + 1) / parts; i++)
            counts[(uint64_t)part * windows + window_of(w, list->items[i].pixel)]++;
    add_counts(counts, windows, parts, w->starts);
#pragma omp parallel for num_threads(parts) schedule(static, 1)
    for (int part = 0; part < parts; part++)
        for (int64_t i = list->count * part / parts; i < list->count * (part + 1) / parts; i++)
            w->items[counts[(uint64_t)part * windows + window_of(w, list->items[i].pixel)]++] = list->items[i];
}

static int parts_of(const comp_layout *layout, int64_t count)
{
    enum { LEAST_PART = 1 << 14 };
    const int64_t most = count / LEAST_PART + 1;
    return (int)(most < layout->threads ? most : layout->threads);
}

insitu_status comp_windows_make(const comp_layout *layout, fragment_list *list, comp_windows *out, base_error *error)
{
    comp_windows w = {.layout = layout};
    const int64_t round = (int64_t)layout->ranks << layout->run_shift;
    const int64_t most_owned = (layout->pixel_count + round - 1) / round << layout->run_shift;
    w.per_owner = (uint32_t)((most_owned + WINDOW - 1) / WINDOW);
    const uint64_t windows = (uint64_t)layout->ranks * w.per_owner;
    const int parts = parts_of(layout, list->count);
    if (list->count > UINT32_MAX)
        return base_fail(error, INSITU_ERROR_MEMORY, "compositing: %lld fragments are more than a rank can send",
                         (long long)list->count);
    uint32_t *const counts = base_calloc((size_t)parts * windows, sizeof *counts);
    w.items = base_alloc((size_t)list->count * sizeof *w.items);
    w.starts = base_alloc((size_t)(windows + 1) * sizeof *w.starts);
    if (!counts || !w.items || !w.starts) {
        base_free(counts);
        comp_windows_free(&w);
        return base_fail(error, INSITU_ERROR_MEMORY, "compositing: no memory to sort %lld fragments",
                         (long long)list->count);
    }
    sort(&w, list, counts, windows, parts);
    base_free(counts);
    base_free(list->items);
    *list = (fragment_list){0};
    *out = w;
    return INSITU_OK;
}

void comp_windows_free(comp_windows *windows)
{
    base_free(windows->items);
    base_free(windows->starts);
    *windows = (comp_windows){0};
}

/* ---- layers -------------------------------------------------------------------------------------------------- */

typedef struct walk {
    comp_block *block;
    comp_block_taker *take;
    void *state;
    bool goes_on;
} walk;

static inline void put(walk *to, const fragment *item, uint32_t index)
{
    uint32_t *record = to->block->records[to->block->count++];
    memcpy(record, item, sizeof *item);
    record[0] = index;
    if (to->block->count < COMP_BLOCK_RECORDS) return;
    to->goes_on = to->goes_on && to->take(to->state, to->block);
    to->block->count = 0;
}

/* Sorts a pixel's fragments front to back if they are few: then the first ones of neighbours are of one surface, and
 * compress well. */
static void sort_pixel(fragment *items, uint32_t count)
{
    if (count > LONGEST_SORTED) return;
    for (uint32_t i = 1; i < count; i++) {
        const fragment moving = items[i];
        uint32_t to = i;
        for (; to > 0 && moving.t_in < items[to - 1].t_in; to--) items[to] = items[to - 1];
        items[to] = moving;
    }
}

/* Sorts the window's fragments by pixel where they lie. ends[k] becomes the start of pixel k (comp_bucket.c). */
static void sort_window(const comp_layout *layout, fragment *items, uint32_t count, uint32_t ends[WINDOW + 1])
{
    memset(ends, 0, WINDOW * sizeof *ends);
    ends[WINDOW] = count;
    for (uint32_t i = 0; i < count; i++) ends[comp_layout_index(layout, items[i].pixel) % WINDOW]++;
    for (int k = 1; k < WINDOW; k++) ends[k] += ends[k - 1];
    for (uint32_t i = 0; i < count; i++) {
        if (i >= ends[comp_layout_index(layout, items[i].pixel) % WINDOW]) continue;
        fragment lifted = items[i];
        for (uint32_t to = count; to != i;) {
            to = --ends[comp_layout_index(layout, lifted.pixel) % WINDOW];
            const fragment next = items[to];
            items[to] = lifted;
            lifted = next;
        }
    }
    for (int k = 0; k < WINDOW; k++) sort_pixel(items + ends[k], ends[k + 1] - ends[k]);
}

/* Tells whether the window has one fragment a pixel, by rising pixel. Most windows are so. */
static bool is_in_order(const fragment *items, uint32_t count)
{
    if (count > WINDOW) return false;
    for (uint32_t i = 1; i < count; i++)
        if (items[i].pixel <= items[i - 1].pixel) return false;
    return true;
}

static void put_window(walk *to, const comp_layout *layout, fragment *items, uint32_t count, uint32_t first)
{
    if (is_in_order(items, count)) {
        for (uint32_t i = 0; i < count; i++)
            put(to, &items[i], first + comp_layout_index(layout, items[i].pixel) % WINDOW);
        return;
    }
    uint32_t begins[WINDOW + 1];
    sort_window(layout, items, count, begins);
    uint64_t left = 0;
    for (unsigned k = 0; k < WINDOW; k++) left |= (uint64_t)(begins[k + 1] > begins[k]) << k;
    for (uint32_t layer = 0; left; layer++)
        for (uint64_t these = left; these; these &= these - 1) {
            const unsigned k = (unsigned)__builtin_ctzll(these);
            put(to, &items[begins[k] + layer], first + k);
            if (begins[k] + layer + 1 == begins[k + 1]) left &= ~((uint64_t)1 << k);
        }
}

bool comp_windows_walk(const comp_windows *w, uint32_t owner, comp_block *block, comp_block_taker *take, void *state)
{
    walk to = {block, take, state, true};
    block->count = 0;
    for (uint32_t k = 0; k < w->per_owner && to.goes_on; k++) {
        const uint32_t *starts = w->starts + (uint64_t)owner * w->per_owner + k;
        if (starts[1] > starts[0])
            put_window(&to, w->layout, w->items + starts[0], starts[1] - starts[0], k << COMP_RUN_SHIFT);
    }
    if (block->count) to.goes_on = to.goes_on && take(state, block);
    return to.goes_on;
}
