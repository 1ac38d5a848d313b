/* Most pixels have one fragment, or hits of opaque surfaces, of which the nearest counts. So a strip's fragments are
 * joined in a sheet, 16 pixels at once, and blended so. What is left over, because it has to be blended with another in
 * its pixel, goes to a pile, and pixel by pixel through comp_merge_pixel().
 *
 * What an opaque surface hides is dropped, although volumes may come later that are in front of it: no merge looks
 * behind an opaque surface. */
#include "comp_owned.h"

#include <string.h>

#include "fragment_order.h"
#include "memory.h"

/* A list of fragments that is kept from strip to strip. */
typedef struct pile {
    fragment *items;
    int64_t count, capacity;
} pile;

/* A thread's memory. */
typedef struct merge_scratch {
    comp_sheet all, other, pixels;
    pile left, listed;                    /* left: .pixel is the number in the strip */
    uint32_t ends[COMP_STRIP_PIXELS + 1]; /* of each pixel's fragments in the list */
    comp_writer writer;
} merge_scratch;

/* Makes room for so many; what the pile held is kept. */
static bool reserve(pile *p, int64_t count)
{
    if (count <= p->capacity) return true;
    fragment *grown = base_realloc(p->items, (size_t)(count + count / 2) * sizeof *grown);
    if (!grown) return false;
    p->items = grown;
    p->capacity = count + count / 2;
    return true;
}

/* ---- joined -------------------------------------------------------------------------------------------------- */

static bool leave(pile *left, const fragment *item, uint32_t at)
{
    if (left->count == left->capacity && !reserve(left, left->count + 256)) return false;
    left->items[left->count] = *item;
    left->items[left->count++].pixel = at;
    return true;
}

/* Joins one that is in a pixel where there is another. */
static bool join_second(const fragment *item, uint32_t at, comp_sheet *all, pile *left)
{
    const fragment other = comp_sheet_get(all, at, item->pixel);
    if (!comp_is_opaque(item) || !comp_is_opaque(&other)) return leave(left, item, at);
    if (fragment_compare(item, &other) < 0) comp_sheet_put(all, at, item);
    return true;
}

static bool join_own(const comp_strips *own, uint32_t strip, comp_sheet *all, pile *left)
{
    for (uint32_t r = own->starts[strip]; r < own->starts[strip + 1]; r++) {
        const fragment *item = own->items + own->ranges[r].first;
        for (const fragment *end = item + own->ranges[r].count; item < end; item++) {
            const uint32_t at = comp_grid_at(own->grid, item->pixel);
            if (!comp_sheet_has(all, at))
                comp_sheet_put(all, at, item);
            else if (!join_second(item, at, all, left))
                return false;
        }
    }
    return true;
}

static bool join_other(merge_scratch *m)
{
    uint16_t left[COMP_ROWS];
    comp_sheet_join(&m->all, &m->other, left);
    for (uint32_t r = 0; r < COMP_ROWS; r++)
        for (unsigned bits = left[r]; bits; bits &= bits - 1) {
            const uint32_t at = r * COMP_LANES + (uint32_t)__builtin_ctz(bits);
            const fragment item = comp_sheet_get(&m->other, at, at);
            if (!leave(&m->left, &item, at)) return false;
        }
    return true;
}

static bool join_all(const comp_owned *owned, uint32_t strip, merge_scratch *m)
{
    const comp_arrivals *const come = &owned->arrivals;
    const uint32_t first = come->starts[strip];
    const bool has_own = owned->own->starts[strip] < owned->own->starts[strip + 1];
    m->left.count = 0;
    comp_sheet_begin(&m->all, strip);
    if (!join_own(owned->own, strip, &m->all, &m->left)) return false;
    for (uint32_t i = first; i < come->starts[strip + 1]; i++) {
        comp_sheet_read(come->sheets[i], COMP_WORDS, i > first || has_own ? &m->other : &m->all);
        if ((i > first || has_own) && !join_other(m)) return false;
    }
    return true;
}

/* ---- listed -------------------------------------------------------------------------------------------------- */

/* Lists what is left with what it has to be blended with, or all there is; that of pixel k then begins at ends[k]. */
static bool list_pixels(bool has_all, merge_scratch *m)
{
    uint32_t *const ends = m->ends;
    memset(ends, 0, sizeof m->ends);
    for (int64_t i = 0; i < m->left.count; i++) ends[m->left.items[i].pixel]++;
    for (uint32_t k = 0; k < COMP_STRIP_PIXELS; k++) ends[k] += ends[k] || (has_all && comp_sheet_has(&m->all, k));
    for (uint32_t k = 1; k <= COMP_STRIP_PIXELS; k++) ends[k] += ends[k - 1];
    if (!reserve(&m->listed, ends[COMP_STRIP_PIXELS])) return false;
    for (uint32_t k = COMP_STRIP_PIXELS; k-- > 0;)
        if (ends[k] > (k ? ends[k - 1] : 0)) m->listed.items[--ends[k]] = comp_sheet_get(&m->all, k, k);
    for (int64_t i = 0; i < m->left.count; i++) m->listed.items[--ends[m->left.items[i].pixel]] = m->left.items[i];
    return true;
}

static void put_pixel(comp_sheet *pixels, uint32_t at, const comp_pixel *pixel)
{
    uint32_t words[COMP_PIXEL_WORDS];
    memcpy(&words[0], &pixel->depth, sizeof pixel->depth);
    memcpy(&words[1], pixel->rgba, sizeof pixel->rgba);
    for (int w = 0; w < COMP_PIXEL_WORDS; w++) pixels->words[w][at] = words[w];
}

static void blend_listed(const comp_grid *grid, const comp_merged *merged, merge_scratch *m)
{
    for (uint32_t k = 0; k < COMP_STRIP_PIXELS; k++) {
        const uint32_t count = m->ends[k + 1] - m->ends[k];
        if (!count) continue;
        const comp_pixel pixel =
            comp_pixels_blend(merged, m->listed.items + m->ends[k], count, comp_grid_pixel(grid, m->all.strip, k));
        put_pixel(&m->pixels, k, &pixel);
    }
}

/* ---- strips -------------------------------------------------------------------------------------------------- */

static bool write_pixels(const comp_owned *owned, merge_scratch *m)
{
    const int count = comp_sheet_count(&m->pixels);
    unsigned char *at = comp_writer_room(&m->writer, (uint32_t)owned->place, comp_sheet_bound(count, COMP_PIXEL_WORDS),
                                         COMP_MESSAGE_BYTES);
    if (!at) return false;
    comp_writer_commit(&m->writer, comp_sheet_write(&m->pixels, COMP_PIXEL_WORDS, at), (uint32_t)count);
    return true;
}

static bool merge_strip(const comp_owned *owned, uint32_t strip, const comp_merged *merged, merge_scratch *m)
{
    if (!join_all(owned, strip, m)) return false;
    comp_sheet_finish(&m->all, merged->background, &m->pixels);
    if (m->left.count || merged->deep) {
        if (!list_pixels(merged->deep != NULL, m)) return false;
        blend_listed(owned->own->grid, merged, m);
    }
    if (!merged->out) return write_pixels(owned, m);
    comp_sheet_store(&m->pixels, owned->own->grid, merged->background, merged->out);
    return true;
}

/* Where nobody has anything. */
static void clear_strip(const comp_grid *grid, uint32_t strip, const comp_merged *merged, merge_scratch *m)
{
    comp_sheet_begin(&m->pixels, strip);
    comp_sheet_store(&m->pixels, grid, merged->background, merged->out);
}

static bool merge_strips(const comp_owned *owned, const comp_merged *merged, merge_scratch *m)
{
    bool is_well = m != NULL;
#pragma omp for schedule(dynamic, 16) nowait
    for (uint32_t s = 0; s < owned->own->grid->strips; s++) {
        const int32_t place = owned->owners->places[comp_grid_block(owned->own->grid, s)];
        if (is_well && place == owned->place)
            is_well = merge_strip(owned, s, merged, m);
        else if (is_well && place < 0 && merged->out)
            clear_strip(owned->own->grid, s, merged, m);
    }
    return is_well;
}

insitu_status comp_owned_merge(const comp_owned *owned, const comp_merged *merged, int parent, comp_messages *finished,
                               base_error *error)
{
    bool is_well = true;
    *finished = (comp_messages){NULL, NULL};
#pragma omp parallel num_threads(owned->own->grid->threads) reduction(&& : is_well)
    {
        merge_scratch *const m = base_alloc(sizeof *m);
        if (m) {
            m->left = m->listed = (pile){NULL, 0, 0};
            m->writer = (comp_writer){.rank = parent};
        }
        is_well = merge_strips(owned, merged, m);
        if (m) {
#pragma omp critical(comp_owned)
            comp_messages_append(finished, &m->writer.messages);
            base_free(m->left.items);
            base_free(m->listed.items);
        }
        base_free(m);
    }
    if (is_well) return INSITU_OK;
    comp_messages_free(finished);
    return base_fail(error, INSITU_ERROR_MEMORY, "compositing: no memory to merge the fragments of a rank's pixels");
}
