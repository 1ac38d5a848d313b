/* Owned pixels are merged slice by slice, slices dealt to threads: a slice's fragments are brought together by pixel
 * where they lie, then each pixel is blended. Nothing is allocated but two counters a slice and the result, and nothing
 * depends on which thread took which slice. */
#include "comp_pixels.h"

#include <math.h>

#include "comp.h"
#include "comp_bucket.h"
#include "memory.h"

typedef struct merging {
    const comp_layout *layout;
    const float *background;
    fragment *items;
    int64_t slices;
    int64_t *starts;       /* slices + 1, in items */
    int64_t *pixel_starts; /* slices + 1, in finished */
    image *out;
    comp_pixel *finished;
} merging;

void comp_pixels_store(image *out, const comp_pixel *from)
{
    for (int c = 0; c < 4; c++) out->rgba[4 * (int64_t)from->pixel + c] = from->rgba[c];
    out->depth[from->pixel] = from->depth;
}

void comp_pixels_clear(image *out, const float background[4])
{
    const int64_t count = (int64_t)out->width * out->height;
#pragma omp parallel for schedule(static)
    for (int64_t i = 0; i < count; i++) {
        for (int c = 0; c < 4; c++) out->rgba[4 * i + c] = background[c];
        out->depth[i] = INFINITY;
    }
}

static void sort_slices(merging *m)
{
#pragma omp parallel for schedule(dynamic, 1)
    for (int64_t s = 0; s < m->slices; s++)
        m->pixel_starts[s + 1] =
            comp_bucket_by_pixel(m->layout, m->items + m->starts[s], m->starts[s + 1] - m->starts[s]);
    m->pixel_starts[0] = 0;
    for (int64_t s = 0; s < m->slices; s++) m->pixel_starts[s + 1] += m->pixel_starts[s];
}

static void merge_slice(merging *m, int64_t slice)
{
    const int64_t end = m->starts[slice + 1];
    comp_pixel *next = m->finished ? m->finished + m->pixel_starts[slice] : NULL;
    for (int64_t i = m->starts[slice], after; i < end; i = after) {
        comp_pixel pixel = {.pixel = m->items[i].pixel};
        for (after = i + 1; after < end && m->items[after].pixel == pixel.pixel; after++) {
        }
        comp_merge_pixel(m->items + i, after - i, m->background, pixel.rgba, &pixel.depth);
        if (m->out)
            comp_pixels_store(m->out, &pixel);
        else
            *next++ = pixel;
    }
}

static insitu_status merge(merging *m, int64_t count, base_error *error)
{
    const size_t bytes = (size_t)(m->slices + 1) * sizeof(int64_t);
    m->starts = base_alloc(bytes);
    m->pixel_starts = base_alloc(bytes);
    if (!m->starts || !m->pixel_starts)
        return base_fail(error, INSITU_ERROR_MEMORY, "compositing: no memory for counters (%zu bytes)", 2 * bytes);
    comp_bucket_by_slice(m->layout, m->items, count, m->starts, m->slices);
    sort_slices(m);
    if (!m->out) {
        const size_t pixel_bytes = (size_t)m->pixel_starts[m->slices] * sizeof(comp_pixel);
        m->finished = base_alloc(pixel_bytes);
        if (!m->finished)
            return base_fail(error, INSITU_ERROR_MEMORY, "compositing: no memory for finished pixels (%zu bytes)",
                             pixel_bytes);
    }
#pragma omp parallel for schedule(dynamic, 1)
    for (int64_t s = 0; s < m->slices; s++) merge_slice(m, s);
    return INSITU_OK;
}

insitu_status comp_pixels_merge(const comp_layout *layout, int rank, fragment_list *fragments,
                                const float background[4], image *out, comp_pixel_list *finished, base_error *error)
{
    if (fragments->count == 0) {
        if (!out) *finished = (comp_pixel_list){NULL, 0};
        return INSITU_OK;
    }
    const int64_t owned = comp_layout_owned(layout, rank);
    merging m = {.layout = layout, .background = background, .items = fragments->items, .out = out};
    m.slices = (owned + comp_slice_pixels - 1) >> comp_slice_shift;
    const insitu_status status = merge(&m, fragments->count, error);
    if (status == INSITU_OK && !out) *finished = (comp_pixel_list){m.finished, m.pixel_starts[m.slices]};
    base_free(m.pixel_starts);
    base_free(m.starts);
    return status;
}
