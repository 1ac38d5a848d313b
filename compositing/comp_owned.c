/* Merges the fragments of the strips that a rank owns. Most pixels have one fragment, or have no other fragments than
 * hits of opaque surfaces, so that the nearest hit hides the others. A strip's fragments are therefore joined in a
 * sheet (comp_sheet.h), 16 pixels at a time, and blended there. Pixels in which several fragments must be blended are
 * called mixed: their fragments are listed and merged by comp_merge_pixel().
 *
 * Fragments behind an opaque surface are invisible. They are dropped, even if volumes in front of the surface arrive
 * later. */
#include "comp_owned.h"

#include <string.h>

#include "fragment_order.h"
#include "memory.h"
#include "region.h"

/* Working memory of a thread; its lists are kept from strip to strip. */
typedef struct merge_scratch {
    comp_sheet joined; /* sheet of the fragments joined so far, one per pixel */
    comp_sheet other;  /* the sheet that is joined next */
    comp_sheet pixels; /* the finished pixels */
    /* remaining: the fragments of mixed pixels (pixels with several fragments that must be blended), except the one in
     * `joined`; listed: all fragments of these pixels. In both lists, .pixel is the index of the pixel in the strip. */
    fragment_list remaining, listed;
    uint16_t mixed[COMP_ROWS]; /* for each row of the strip, the bit mask of the pixels that have several fragments
                                  to be blended; bit i is column i */
    /* For each pixel in the masks `mixed`: counts is the number of its fragments, and ends the index in `listed` behind
     * its last fragment. list_fragments_to_blend() reduces ends to the index of the pixel's first fragment. */
    uint32_t counts[COMP_STRIP_PIXELS], ends[COMP_STRIP_PIXELS];
    comp_writer writer;
} merge_scratch;

/* Ensures space for this number of fragments; the contents of the list are kept. */
static bool reserve_fragments(fragment_list *list, int64_t count)
{
    if (count <= list->capacity) return true;
    fragment *grown = base_realloc(list->items, (size_t)(count + count / 2) * sizeof *grown);
    if (!grown) return false;
    list->items = grown;
    list->capacity = count + count / 2;
    return true;
}

/* ---- joining the fragments of a strip --------------------------------------------------------------------------- */

/* Marks a pixel as mixed: all of its fragments will be listed, and merged by comp_merge_pixel(). Does nothing if the
 * pixel is marked already. The fragment that m->joined contains for the pixel is counted as its first fragment. */
static void mark_pixel_for_blending(merge_scratch *m, uint32_t at)
{
    const unsigned bit = 1u << at % COMP_LANES;
    if (m->mixed[at / COMP_LANES] & bit) return;
    m->mixed[at / COMP_LANES] = (uint16_t)(m->mixed[at / COMP_LANES] | bit);
    m->counts[at] = 1;
}

static bool add_remaining_fragment(merge_scratch *m, const fragment *item, uint32_t at)
{
    fragment_list *const left = &m->remaining;
    if (left->count == left->capacity && !reserve_fragments(left, left->count + 256)) return false;
    left->items[left->count] = *item;
    left->items[left->count++].pixel = at;
    mark_pixel_for_blending(m, at);
    m->counts[at]++;
    return true;
}

/* Adds a fragment for a pixel for which the sheet m->joined already contains one. If both are hits of opaque surfaces,
 * the sheet keeps the nearer one. Otherwise the fragments of the pixel must be blended, and the new fragment is listed
 * in m->remaining. */
static bool join_with_earlier_fragment(merge_scratch *m, const fragment *item, uint32_t at)
{
    const fragment other = comp_sheet_get(&m->joined, at, item->pixel);
    if (!comp_is_opaque(item) || !comp_is_opaque(&other)) return add_remaining_fragment(m, item, at);
    if (fragment_compare(item, &other) < 0) comp_sheet_put(&m->joined, at, item);
    return true;
}

static bool join_own_fragments(const comp_strips *own, uint32_t strip, merge_scratch *m)
{
    enum { AHEAD = 16 };
    const comp_grid grid = *own->grid;
    for (uint32_t r = own->starts[strip]; r < own->starts[strip + 1]; r++) {
        const fragment *item = own->items + own->ranges[r].first;
        for (const fragment *end = item + own->ranges[r].count; item < end; item++) {
            const uint32_t at = comp_grid_index_in_strip(&grid, item->pixel);
            __builtin_prefetch(item + AHEAD);
            if (!comp_sheet_has(&m->joined, at))
                comp_sheet_put(&m->joined, at, item);
            else if (!join_with_earlier_fragment(m, item, at))
                return false;
        }
    }
    return true;
}

static bool join_received_sheet(merge_scratch *m)
{
    uint16_t left[COMP_ROWS];
    comp_sheet_join(&m->joined, &m->other, left);
    for (uint32_t r = 0; r < COMP_ROWS; r++)
        for (unsigned bits = left[r]; bits; bits &= bits - 1) {
            const uint32_t at = r * COMP_LANES + (uint32_t)__builtin_ctz(bits);
            const fragment item = comp_sheet_get(&m->other, at, at);
            if (!add_remaining_fragment(m, &item, at)) return false;
        }
    return true;
}

static bool join_fragments_of_strip(const comp_owned *owned, uint32_t strip, merge_scratch *m)
{
    const comp_received *const come = &owned->arrivals;
    const uint32_t first = come->starts[strip];
    const bool has_own = owned->traced_strips->starts[strip] < owned->traced_strips->starts[strip + 1];
    m->remaining.count = 0;
    memset(m->mixed, 0, sizeof m->mixed);
    comp_sheet_begin(&m->joined, strip);
    if (!join_own_fragments(owned->traced_strips, strip, m)) return false;
    for (uint32_t i = first; i < come->starts[strip + 1]; i++) {
        comp_sheet_read(come->sheets[i], COMP_WORDS, i > first || has_own ? &m->other : &m->joined);
        if ((i > first || has_own) && !join_received_sheet(m)) return false;
    }
    return true;
}

/* ---- listing the fragments of pixels with several --------------------------------------------------------------- */

/* Returns the smallest index, at least `from`, of a pixel that is marked in m->mixed; COMP_STRIP_PIXELS if there is
 * none. */
static uint32_t find_next_pixel_to_blend(const merge_scratch *m, uint32_t from)
{
    for (uint32_t r = from / COMP_LANES; r < COMP_ROWS; r++) {
        const unsigned bits = m->mixed[r] & (r == from / COMP_LANES ? 0xffffu << from % COMP_LANES : 0xffffu);
        if (bits) return r * COMP_LANES + (uint32_t)__builtin_ctz(bits);
    }
    return COMP_STRIP_PIXELS;
}

/* Copies all fragments of the pixels that are marked in m->mixed to m->listed, sorted by pixel. On return, the
 * fragments of pixel k begin at index ends[k] of this list. Returns false if memory ran out. */
static bool list_fragments_to_blend(merge_scratch *m)
{
    uint32_t sum = 0;
    for (uint32_t k = find_next_pixel_to_blend(m, 0); k < COMP_STRIP_PIXELS; k = find_next_pixel_to_blend(m, k + 1)) {
        sum += m->counts[k];
        m->ends[k] = sum;
    }
    if (!reserve_fragments(&m->listed, sum)) return false;
    for (uint32_t k = find_next_pixel_to_blend(m, 0); k < COMP_STRIP_PIXELS; k = find_next_pixel_to_blend(m, k + 1))
        m->listed.items[--m->ends[k]] = comp_sheet_get(&m->joined, k, k);
    for (int64_t i = 0; i < m->remaining.count; i++)
        m->listed.items[--m->ends[m->remaining.items[i].pixel]] = m->remaining.items[i];
    return true;
}

/* Marks all pixels with a fragment as if they had several, because the samples of a deep picture are made from the list
 * of the fragments of marked pixels. */
static void mark_all_pixels_for_blending(merge_scratch *m)
{
    for (uint32_t k = 0; k < COMP_STRIP_PIXELS; k++)
        if (comp_sheet_has(&m->joined, k)) mark_pixel_for_blending(m, k);
}

static void store_pixel(comp_sheet *pixels, uint32_t at, const comp_pixel *pixel)
{
    uint32_t words[COMP_PIXEL_WORDS];
    memcpy(&words[0], &pixel->depth, sizeof pixel->depth);
    memcpy(&words[1], pixel->rgba, sizeof pixel->rgba);
    for (int w = 0; w < COMP_PIXEL_WORDS; w++) pixels->words[w][at] = words[w];
}

static void blend_pixels_with_several_fragments(const comp_grid *grid, const comp_merge_output *merged,
                                                merge_scratch *m)
{
    for (uint32_t k = find_next_pixel_to_blend(m, 0); k < COMP_STRIP_PIXELS; k = find_next_pixel_to_blend(m, k + 1)) {
        const comp_pixel pixel = comp_pixels_blend(merged, m->listed.items + m->ends[k], m->counts[k],
                                                   comp_find_pixel_of_strip(grid, m->joined.strip, k));
        store_pixel(&m->pixels, k, &pixel);
    }
}

/* ---- strips ----------------------------------------------------------------------------------------------------- */

/* Writes the finished pixels of a strip into a message. Strips without pixels are written too, in a few bytes, so that
 * rank 0 fills them with the background. */
static bool write_pixels(const comp_owned *owned, merge_scratch *m)
{
    const int count = comp_sheet_count_pixels(&m->pixels);
    unsigned char *at = comp_writer_reserve(&m->writer, (uint32_t)owned->place,
                                            comp_sheet_max_bytes(count, COMP_PIXEL_WORDS), COMP_MESSAGE_BYTES);
    if (!at) return false;
    comp_writer_commit(&m->writer, comp_sheet_write(&m->pixels, COMP_PIXEL_WORDS, at), (uint32_t)count);
    return true;
}

static bool merge_strip(const comp_owned *owned, uint32_t strip, const comp_merge_output *merged, merge_scratch *m)
{
    if (!join_fragments_of_strip(owned, strip, m)) return false;
    comp_sheet_finish(&m->joined, merged->background, &m->pixels);
    if (merged->deep) mark_all_pixels_for_blending(m);
    if (!list_fragments_to_blend(m)) return false;
    blend_pixels_with_several_fragments(owned->traced_strips->grid, merged, m);
    if (!merged->out) return write_pixels(owned, m);
    comp_sheet_store(&m->pixels, owned->traced_strips->grid, merged->background, merged->out);
    return true;
}

/* Stores the background in a strip without fragments. */
static void fill_with_background(const comp_grid *grid, uint32_t strip, const comp_merge_output *merged,
                                 merge_scratch *m)
{
    comp_sheet_begin(&m->pixels, strip);
    comp_sheet_store(&m->pixels, grid, merged->background, merged->out);
}

static bool merge_strips(const comp_owned *owned, const comp_merge_output *merged, merge_scratch *m)
{
    bool is_ok = m != NULL;
#pragma omp for schedule(dynamic, 16) nowait
    for (uint32_t s = 0; s < owned->traced_strips->grid->strips; s++) {
        const int32_t place = owned->owners->places[comp_find_block_of_strip(owned->traced_strips->grid, s)];
        if (is_ok && place == owned->place)
            is_ok = merge_strip(owned, s, merged, m);
        else if (is_ok && place < 0 && merged->out)
            fill_with_background(owned->traced_strips->grid, s, merged, m);
    }
    return is_ok;
}

insitu_status comp_merge_owned_strips(const comp_owned *owned, const comp_merge_output *merged, int parent,
                                      comp_messages *finished, base_error *error)
{
    bool is_ok = true;
    *finished = (comp_messages){NULL, NULL};
#pragma omp parallel num_threads(owned->traced_strips->grid->threads) reduction(&& : is_ok)
    {
        region_enter();
        merge_scratch *const m = base_alloc(sizeof *m);
        if (m) {
            m->remaining = m->listed = (fragment_list){NULL, 0, 0};
            m->writer = (comp_writer){.rank = parent};
        }
        is_ok = merge_strips(owned, merged, m);
        if (m) {
#pragma omp critical(comp_owned)
            comp_messages_append(finished, &m->writer.messages);
            base_free(m->remaining.items);
            base_free(m->listed.items);
        }
        base_free(m);
        region_leave();
    }
    if (is_ok) return INSITU_OK;
    comp_messages_free(finished);
    return base_fail(error, INSITU_ERROR_MEMORY, "compositing: no memory to merge the fragments of a rank's pixels");
}
