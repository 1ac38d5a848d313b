/* A list of fragments may be most of a rank's memory, in no order, and longer than any cache. So it is cut into blocks
 * that fit in one, and owned pixels into slices. Threads first sort each block by slice where it lies; then they take
 * slices, collect a slice's pieces from all blocks by pixel in a scratch list, and blend:
 *
 *     block 0 | s0 | s1  | s2 |     block 1 | s0  | s1 | s2 |     block 2 ...
 *                 \______________________________/_____________________
 *                                                 slice 1 by pixel: blended, and forgotten
 *
 * Nothing is walked at random but what lies in cache, all of it runs in parallel, and beyond the list itself there is a
 * table of starts and one slice a thread. Nothing of the result depends on which thread took what. */
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
    const float *background;
    fragment *items;
    int64_t count;
    uint32_t slice_shift;
    int64_t slices, blocks;
    int64_t *starts;       /* row-major, blocks × (slices + 1), within the block */
    int64_t *pixel_starts; /* slices + 1: room in finished, one pixel a fragment and at most the slice */
    int64_t *pixel_counts; /* slices: of pixels that have fragments */
    image *out;
    comp_pixel *finished;
    unsigned char *overlaps;
    comp_deep_list *deep;
} merging;

/* One thread's. */
typedef struct scratch {
    fragment *items;
    int64_t capacity;
    int64_t *starts; /* pixels of a slice + 1 */
} scratch;

void comp_pixels_store(image *out, const comp_pixel *from)
{
    for (int c = 0; c < 4; c++) out->rgba[4 * (int64_t)from->pixel + c] = from->rgba[c];
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
    const int64_t slice_pixels = (int64_t)1 << m->slice_shift;
    m->pixel_starts[0] = 0;
    for (int64_t s = 0; s < m->slices; s++) {
        const int64_t count = slice_fragments(m, s);
        m->pixel_starts[s + 1] = m->pixel_starts[s] + (count < slice_pixels ? count : slice_pixels);
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

/* The slice's fragments in own->items, those of its k-th pixel at own->starts[k] .. own->starts[k + 1]. */
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

static void blend_slice(merging *m, int64_t slice, scratch *own)
{
    comp_pixel *const first = m->finished ? m->finished + m->pixel_starts[slice] : NULL;
    int64_t pixels = 0;
    for (uint32_t k = 0; k < 1u << m->slice_shift; k++) {
        fragment *const items = own->items + own->starts[k];
        const int64_t count = own->starts[k + 1] - own->starts[k];
        if (count == 0) continue;
        comp_pixel pixel = {.pixel = items->pixel};
        comp_merge_pixel(items, count, m->background, pixel.rgba, &pixel.depth);
        if (m->overlaps && comp_pixel_overlaps(items, count)) comp_add_overlap(m->overlaps, pixel.pixel);
        if (m->deep) comp_deep_add(&m->deep[omp_get_thread_num()], items, count);
        if (m->out)
            comp_pixels_store(m->out, &pixel);
        else
            first[pixels] = pixel;
        pixels++;
    }
    m->pixel_counts[slice] = pixels;
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
            m->pixel_counts[s] = 0;
            if (count == 0) continue;
            well = well && make_scratch(&own, m, count);
            if (!well) continue;
            collect_slice(m, s, count, &own);
            blend_slice(m, s, &own);
        }
        base_free(own.items);
        base_free(own.starts);
    }
    return well;
}

/* Close the gaps between slices' pixels; returns how many there are. */
static int64_t close_up(merging *m)
{
    int64_t count = 0;
    for (int64_t s = 0; s < m->slices; s++) {
        memmove(m->finished + count, m->finished + m->pixel_starts[s], (size_t)m->pixel_counts[s] * sizeof(comp_pixel));
        count += m->pixel_counts[s];
    }
    return count;
}

static bool merge(merging *m)
{
    m->starts = base_alloc((size_t)(m->blocks * (m->slices + 1)) * sizeof *m->starts);
    m->pixel_starts = base_alloc((size_t)(m->slices + 1) * sizeof *m->pixel_starts);
    m->pixel_counts = base_alloc((size_t)m->slices * sizeof *m->pixel_counts);
    if (!m->starts || !m->pixel_starts || !m->pixel_counts) return false;
    sort_blocks(m);
    if (!m->out) {
        m->finished = base_alloc((size_t)m->pixel_starts[m->slices] * sizeof *m->finished);
        if (!m->finished) return false;
    }
    return merge_slices(m);
}

insitu_status comp_pixels_merge(const comp_layout *layout, int rank, fragment_list *fragments,
                                const comp_merged *merged, base_error *error)
{
    if (!merged->out) *merged->finished = (comp_pixel_list){NULL, 0};
    if (fragments->count == 0) return INSITU_OK;
    const int64_t owned = comp_layout_owned(layout, rank);
    merging m = {.layout = layout,
                 .background = merged->background,
                 .out = merged->out,
                 .overlaps = merged->overlaps,
                 .deep = merged->deep};
    m.items = fragments->items;
    m.count = fragments->count;
    m.slice_shift = least_slice_shift;
    while (owned >> m.slice_shift >= most_slices) m.slice_shift++;
    m.slices = ((owned - 1) >> m.slice_shift) + 1;
    m.blocks = (m.count - 1) / block_fragments + 1;
    const bool well = merge(&m);
    if (well && !m.out)
        *merged->finished = (comp_pixel_list){m.finished, close_up(&m)};
    else
        base_free(m.finished);
    base_free(m.pixel_counts);
    base_free(m.pixel_starts);
    base_free(m.starts);
    if (well) return INSITU_OK;
    return base_fail(error, INSITU_ERROR_MEMORY, "compositing: no memory to merge %lld fragments",
                     (long long)fragments->count);
}
