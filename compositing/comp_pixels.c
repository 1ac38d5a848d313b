/* A single rank's list of fragments may fill most of its memory, unordered, and is longer than any cache. So the list
 * is cut into blocks that fit a cache, and pixels into slices. Threads first sort each block by slice in place; then
 * they take slices, collect a slice's pieces from all blocks by pixel in a scratch list, and blend:
 *
 *     block 0 | s0 | s1  | s2 |     block 1 | s0  | s1 | s2 |     block 2 ...
 *                 \______________________________/_____________________
 *                                                 slice 1 by pixel: blended, and forgotten
 *
 * Random access stays within the cache, all of it runs in parallel, and beyond the list itself it needs a table of
 * starts and one slice a thread. The result does not depend on which thread took what. */
#include "comp_pixels.h"

#include <math.h>
#include <omp.h>
#include <string.h>

#include "comp.h"
#include "comp_bucket.h"
#include "memory.h"

enum { block_fragments = 1 << 14, most_slices = 512, least_slice_shift = 8 };

typedef struct merging {
    const comp_layout *layout;
    const comp_merged *merged;
    fragment *items;
    int64_t count;
    uint32_t slice_shift;
    int64_t slices, blocks;
    int64_t *starts; /* row-major, blocks × (slices + 1), within the block */
} merging;

/* One thread's memory. */
typedef struct scratch {
    fragment *items;
    int64_t capacity;
    int64_t *starts; /* pixels of a slice + 1 */
} scratch;

void comp_pixels_store(image *out, const comp_pixel *from)
{
    memcpy(out->rgba + 4 * (int64_t)from->pixel, from->rgba, sizeof from->rgba);
    if (out->depth) out->depth[from->pixel] = from->depth;
}

void comp_pixels_clear(const comp_layout *layout, image *out, const float background[4])
{
    const int64_t count = (int64_t)out->width * out->height;
#pragma omp parallel for num_threads(layout->threads) schedule(static)
    for (int64_t i = 0; i < count; i++) {
        for (int c = 0; c < 4; c++) out->rgba[4 * i + c] = background[c];
        if (out->depth) out->depth[i] = INFINITY;
    }
}

static int64_t slice_fragments(const merging *m, int64_t slice)
{
    int64_t count = 0;
    for (const int64_t *starts = m->starts + slice, *end = m->starts + m->blocks * (m->slices + 1); starts < end;
         starts += m->slices + 1)
        count += starts[1] - starts[0];
    return count;
}

static void sort_blocks(merging *m)
{
#pragma omp parallel for num_threads(m->layout->threads) schedule(dynamic, 1)
    for (int64_t b = 0; b < m->blocks; b++) {
        const int64_t first = b * block_fragments, left = m->count - first;
        comp_bucket_by_slice(m->layout, m->slice_shift, m->items + first,
                             left < block_fragments ? left : block_fragments, m->starts + b * (m->slices + 1),
                             m->slices);
    }
}

static bool make_scratch(scratch *own, const merging *m, int64_t count)
{
    if (!own->starts) own->starts = base_alloc((((size_t)1 << m->slice_shift) + 1) * sizeof *own->starts);
    if (own->capacity < count) {
        base_free(own->items);
        own->items = base_alloc((size_t)count * sizeof *own->items);
        own->capacity = own->items ? count : 0;
    }
    return own->starts && own->capacity >= count;
}

/* Copies the slice's fragments to own->items, those of its k-th pixel to own->starts[k] .. own->starts[k + 1]. */
static void collect_slice(const merging *m, int64_t slice, int64_t count, scratch *own)
{
    const uint32_t slice_pixels = 1u << m->slice_shift;
    int64_t *const ends = own->starts;
    memset(ends, 0, slice_pixels * sizeof *ends);
    for (int pass = 0; pass < 2; pass++) {
        for (int64_t b = 0; b < m->blocks; b++) {
            const int64_t *starts = m->starts + b * (m->slices + 1) + slice;
            const fragment *block = m->items + b * block_fragments;
            for (int64_t i = starts[0]; i < starts[1]; i++) {
                const uint32_t k = comp_layout_index(m->layout, block[i].pixel) & (slice_pixels - 1);
                if (pass == 0)
                    ends[k]++;
                else
                    own->items[--ends[k]] = block[i];
            }
        }
        for (uint32_t k = 1; pass == 0 && k < slice_pixels; k++) ends[k] += ends[k - 1];
    }
    ends[slice_pixels] = count;
}

insitu_status comp_check_size(const image *out, base_error *error)
{
    if (out->width >= 1 && out->height >= 1 && (int64_t)out->width * out->height <= UINT32_MAX) return INSITU_OK;
    return base_fail(error, INSITU_ERROR_ARGUMENT, "compositing: no image of %d by %d pixels", out->width, out->height);
}

void comp_add_overlap(unsigned char *overlaps, uint32_t pixel)
{
    __atomic_fetch_or(&overlaps[pixel >> 3], (unsigned char)(1u << (pixel & 7)), __ATOMIC_RELAXED);
}

/* Merges the image's pixel. */
static comp_pixel blend(const comp_merged *merged, fragment *items, int64_t count, uint32_t pixel)
{
    comp_pixel blended = {.pixel = pixel};
    (merged->is_folded ? comp_merge_folded_pixel : comp_merge_pixel)(items, count, merged->background, blended.rgba,
                                                                     &blended.depth);
    if (merged->overlaps && (merged->is_folded ? comp_folded_pixel_overlaps : comp_pixel_overlaps)(items, count))
        comp_add_overlap(merged->overlaps, pixel);
    if (merged->deep) {
        for (int64_t i = 0; i < count; i++) items[i].pixel = pixel;
        comp_deep_add(&merged->deep[omp_get_thread_num()], items, count, merged->is_folded);
    }
    return blended;
}

static void blend_slice(const merging *m, scratch *own)
{
    for (uint32_t k = 0; k < 1u << m->slice_shift; k++) {
        fragment *const items = own->items + own->starts[k];
        const int64_t count = own->starts[k + 1] - own->starts[k];
        if (count == 0) continue;
        const comp_pixel pixel = blend(m->merged, items, count, items->pixel);
        comp_pixels_store(m->merged->out, &pixel);
    }
}

static bool merge_slices(merging *m)
{
    bool well = true;
#pragma omp parallel num_threads(m->layout->threads) reduction(&& : well)
    {
        scratch own = {NULL, 0, NULL};
#pragma omp for schedule(dynamic, 1)
        for (int64_t s = 0; s < m->slices; s++) {
            const int64_t count = slice_fragments(m, s);
            if (count == 0) continue;
            well = well && make_scratch(&own, m, count);
            if (!well) continue;
            collect_slice(m, s, count, &own);
            blend_slice(m, &own);
        }
        base_free(own.items);
        base_free(own.starts);
    }
    return well;
}

insitu_status comp_pixels_merge(const comp_layout *layout, fragment_list *fragments, const comp_merged *merged,
                                base_error *error)
{
    if (fragments->count == 0) return INSITU_OK;
    const int64_t owned = layout->pixel_count;
    merging m = {.layout = layout, .merged = merged};
    m.items = fragments->items;
    m.count = fragments->count;
    m.slice_shift = least_slice_shift;
    while (owned >> m.slice_shift >= most_slices) m.slice_shift++;
    m.slices = ((owned - 1) >> m.slice_shift) + 1;
    m.blocks = (m.count - 1) / block_fragments + 1;
    m.starts = base_alloc((size_t)(m.blocks * (m.slices + 1)) * sizeof *m.starts);
    if (m.starts) sort_blocks(&m);
    const bool well = m.starts && merge_slices(&m);
    base_free(m.starts);
    if (well) return INSITU_OK;
    return base_fail(error, INSITU_ERROR_MEMORY, "compositing: no memory to merge %lld fragments",
                     (long long)fragments->count);
}

/* ---- an owner's ---------------------------------------------------------------------------------------------- */

/* Number of owned indices that a thread takes at a time. */
enum { STRETCH = 256 };

typedef struct blending {
    const comp_layout *layout;
    uint32_t owner, pixels;
    const comp_owned *owned;
    const comp_merged *merged;
    comp_pixel *finished;
    int64_t *first; /* where each stretch's pixels begin in finished */
} blending;

static uint32_t stretch_end(const blending *b, int64_t stretch)
{
    const int64_t end = (stretch + 1) * STRETCH;
    return end < b->pixels ? (uint32_t)end : b->pixels;
}

static void count_finished(blending *b, int64_t stretches)
{
    int64_t count = 0;
    for (int64_t s = 0; s < stretches; s++) {
        b->first[s] = count;
        for (uint32_t k = (uint32_t)(s * STRETCH); k < stretch_end(b, s); k++)
            count += b->owned->starts[k + 1] > b->owned->starts[k];
    }
    b->first[stretches] = count;
}

static void blend_stretch(const blending *b, int64_t stretch)
{
    comp_pixel *next = b->finished ? b->finished + b->first[stretch] : NULL;
    for (uint32_t k = (uint32_t)(stretch * STRETCH); k < stretch_end(b, stretch); k++) {
        const uint32_t *starts = b->owned->starts + k;
        if (starts[1] == starts[0]) continue;
        comp_pixel pixel = blend(b->merged, b->owned->items + starts[0], starts[1] - starts[0],
                                 comp_layout_pixel(b->layout, b->owner, k));
        if (b->merged->out) {
            comp_pixels_store(b->merged->out, &pixel);
        } else {
            pixel.pixel = k;
            *next++ = pixel;
        }
    }
}

insitu_status comp_pixels_blend(const comp_layout *layout, uint32_t owner, const comp_owned *owned,
                                const comp_merged *merged, base_error *error)
{
    blending b = {layout, owner, comp_layout_owned(layout, (int)owner), owned, merged, NULL, NULL};
    const int64_t stretches = ((int64_t)b.pixels + STRETCH - 1) / STRETCH;
    *merged->finished = (comp_pixel_list){NULL, 0};
    if (!merged->out) {
        b.first = base_alloc((size_t)(stretches + 1) * sizeof *b.first);
        if (b.first) count_finished(&b, stretches);
        if (b.first) b.finished = base_alloc((size_t)b.first[stretches] * sizeof *b.finished);
        if (b.finished) *merged->finished = (comp_pixel_list){b.finished, b.first[stretches]};
    }
    const bool is_well = merged->out || b.finished;
    if (is_well) {
#pragma omp parallel for num_threads(layout->threads) schedule(dynamic, 1)
        for (int64_t s = 0; s < stretches; s++) blend_stretch(&b, s);
    }
    base_free(b.first);
    return is_well ? INSITU_OK
                   : base_fail(error, INSITU_ERROR_MEMORY, "compositing: no memory for %lld finished pixels",
                               (long long)b.pixels);
}
