/* If there is a single rank, it owns all pixels, and the thread that has traced a tile has all fragments of the tile in
 * its cache. Fragments are therefore not collected. The thread blends and stores the pixels of the tile immediately,
 * with the background in empty pixels, and discards the fragments. The image is written once, there is no list of
 * fragments, and no thread waits for the last tile.
 *
 * The fragments of a pixel need not be consecutive. Their indices are sorted by pixel (counting sort). A pixel with one
 * fragment, the most frequent case, is blended from the fragment in place; the fragments of other pixels are copied to
 * a buffer first. */
#include "comp_tiles.h"

#include <assert.h>
#include <math.h>
#include <omp.h>
#include <string.h>
#if defined(__SSE2__)
#include <emmintrin.h>
#endif

#include "comp_pixels.h"
#include "memory.h"

/* The renderer's tiles have a width and height of ROW_PIXELS pixels. Larger tiles are processed correctly, but more
 * slowly. */
enum { ROW_PIXELS = 16, MOST_PIXELS = ROW_PIXELS * ROW_PIXELS };

/* A block of memory that grows without keeping its contents. */
typedef struct buffer {
    void *data;
    size_t bytes;
} buffer;

struct comp_tile_scratch {
    /* array of int64_t: for each pixel of the tile, the index in `order` of the pixel's first fragment; a final entry
     * has the number of fragments */
    buffer starts;
    buffer order;           /* array of int64_t: indices of fragments, sorted by pixel */
    buffer pixel_fragments; /* copies of one pixel's fragments; they are sorted in this buffer */
    int64_t fragments;
    double seconds;
    char padding[64]; /* padding that prevents two threads from writing to the same cache line */
};

static void *reserve_buffer(buffer *r, int64_t count, size_t size)
{
    const size_t bytes = (size_t)count * size;
    if (bytes <= r->bytes) return r->data;
    base_free(r->data);
    r->data = base_alloc(bytes + bytes / 2);
    r->bytes = r->data ? bytes + bytes / 2 : 0;
    return r->data;
}

insitu_status comp_tiles_begin(comp_tiles *tiles, const float background[4], int threads, bool finds_overlaps,
                               image *out, base_error *error)
{
    const int64_t pixels = (int64_t)out->width * out->height;
    *tiles = (comp_tiles){.background = background,
                          .out = out,
                          .inverse_width = 1 / (double)out->width,
                          .threads = threads > 0 ? threads : omp_get_max_threads()};
    const insitu_status status = comp_check_size(out, error);
    if (status) return status;
    tiles->scratch = base_calloc((size_t)tiles->threads, sizeof *tiles->scratch);
    if (finds_overlaps) tiles->overlaps = base_calloc(pixel_set_bytes(pixels), 1);
    if (tiles->scratch && (tiles->overlaps || !finds_overlaps)) return INSITU_OK;
    base_free(tiles->scratch);
    base_free(tiles->overlaps);
    tiles->scratch = NULL;
    tiles->overlaps = NULL;
    return base_fail(error, INSITU_ERROR_MEMORY, "compositing: no memory for a set of %lld pixels", (long long)pixels);
}

void comp_tiles_end(comp_tiles *tiles, comp_overlaps *overlaps, comp_statistics *statistics)
{
    double slowest = 0;
    *statistics = (comp_statistics){0};
    for (int i = 0; i < tiles->threads; i++) {
        comp_tile_scratch *own = &tiles->scratch[i];
        statistics->sent_fragments += own->fragments;
        slowest = fmax(slowest, own->seconds);
        base_free(own->starts.data);
        base_free(own->order.data);
        base_free(own->pixel_fragments.data);
    }
    statistics->merge_ms = 1e3 * slowest;
    base_free(tiles->scratch);
    const int64_t pixels = (int64_t)tiles->out->width * tiles->out->height;
    const int64_t found = tiles->overlaps ? pixel_set_count(tiles->overlaps, pixels) : 0;
    if (!found || !overlaps) base_free(tiles->overlaps);
    if (overlaps) *overlaps = (comp_overlaps){found, found ? tiles->overlaps : NULL};
}

static void store_background(const comp_tiles *tiles, int64_t pixel)
{
    memcpy(tiles->out->rgba + 4 * pixel, tiles->background, 4 * sizeof *tiles->background);
    if (tiles->out->depth) tiles->out->depth[pixel] = INFINITY;
}

static void clear_tile(const comp_tiles *tiles, const pixel_area *area)
{
    const int64_t width = tiles->out->width;
    float row[4 * ROW_PIXELS];
    for (int i = 0; i < 4 * ROW_PIXELS; i++) row[i] = tiles->background[i % 4];
    for (int64_t y = area->y; y < area->y + area->height; y++)
        for (int x = 0; x < area->width; x += ROW_PIXELS) {
            const int left = area->width - x, pixels = left < ROW_PIXELS ? left : ROW_PIXELS;
            const int64_t first = y * width + area->x + x;
            memcpy(tiles->out->rgba + 4 * first, row, 4 * (size_t)pixels * sizeof *row);
            for (int i = 0; tiles->out->depth && i < pixels; i++) tiles->out->depth[first + i] = INFINITY;
        }
}

/* Fills a tile that has no fragments with the background. The stores bypass the caches, so that they neither load the
 * overwritten cache lines nor evict lines that later tiles need. */
static void clear_empty_tile(const comp_tiles *tiles, const pixel_area *area)
{
#if defined(__SSE2__)
    const int64_t width = tiles->out->width;
    const __m128 colour = _mm_loadu_ps(tiles->background), endless = _mm_set1_ps(INFINITY);
    const bool is_whole = area->x % 4 == 0 && area->width % 4 == 0 && width % 4 == 0;
    if (is_whole && ((uintptr_t)tiles->out->rgba | (uintptr_t)tiles->out->depth) % sizeof colour == 0) {
        for (int64_t y = area->y; y < area->y + area->height; y++) {
            float *rgba = tiles->out->rgba + 4 * (y * width + area->x);
            float *depth = tiles->out->depth ? tiles->out->depth + y * width + area->x : NULL;
            for (int x = 0; x < area->width; x++) _mm_stream_ps(rgba + 4 * (int64_t)x, colour);
            for (int x = 0; depth && x < area->width; x += 4) _mm_stream_ps(depth + x, endless);
        }
        _mm_sfence();
        return;
    }
#endif
    clear_tile(tiles, area);
}

/* Returns the index that the pixel has in the area, whose pixels are counted row by row. The row is a quotient that is
 * rounded down. Half a pixel is added to the dividend, so that the quotient is further from an integer than its
 * rounding error, and the row is exact. */
static uint32_t find_index_in_area(const comp_tiles *tiles, const pixel_area *area, uint32_t pixel)
{
    const uint32_t width = (uint32_t)tiles->out->width;
    const uint32_t from = pixel - ((uint32_t)area->y * width + (uint32_t)area->x);
    const uint32_t row = (uint32_t)(((double)from + 0.5) * tiles->inverse_width);
    assert(row < (uint32_t)area->height && from - row * width < (uint32_t)area->width);
    return row * (uint32_t)area->width + (from - row * width);
}

/* Sorts the indices of fragments by pixel. After this, the fragments of pixel k of the area are items[order[j]], for j
 * from starts[k] to starts[k + 1] - 1. */
static void sort_by_pixel(const comp_tiles *tiles, const pixel_area *area, const fragment *items, int64_t count,
                          int64_t *starts, int64_t *order)
{
    const int64_t pixels = (int64_t)area->width * area->height;
    memset(starts, 0, (size_t)pixels * sizeof *starts);
    for (int64_t i = 0; i < count; i++) starts[find_index_in_area(tiles, area, items[i].pixel)]++;
    for (int64_t k = 1; k < pixels; k++) starts[k] += starts[k - 1];
    for (int64_t i = 0; i < count; i++) order[--starts[find_index_in_area(tiles, area, items[i].pixel)]] = i;
    starts[pixels] = count;
}

/* Returns one pixel's fragments as an array: copies them to the thread's buffer, or returns the address of a single
 * fragment in `items`. Returns NULL if memory ran out. */
static fragment *copy_fragments_of_pixel(comp_tile_scratch *own, fragment *items, const int64_t *order, int64_t count)
{
    if (count == 1) return &items[*order];
    fragment *pixel_fragments = reserve_buffer(&own->pixel_fragments, count, sizeof *pixel_fragments);
    for (int64_t i = 0; i < count && pixel_fragments; i++) pixel_fragments[i] = items[order[i]];
    return pixel_fragments;
}

static void blend_pixel(const comp_tiles *tiles, int64_t pixel, fragment *items, int64_t count)
{
    float depth;
    (tiles->out->is_folded ? comp_merge_folded_pixel : comp_merge_pixel)(items, count, tiles->background,
                                                                         tiles->out->rgba + 4 * pixel, &depth);
    if (tiles->out->depth) tiles->out->depth[pixel] = depth;
    if (tiles->overlaps && (tiles->out->is_folded ? comp_folded_pixel_overlaps : comp_pixel_overlaps)(items, count))
        comp_add_overlap(tiles->overlaps, (uint32_t)pixel);
}

/* Blends and stores a tile whose pixels have at most one fragment each. Returns false if a pixel has two or more; the
 * caller must then store the whole tile anew. */
static bool blend_single_fragments_of_tile(const comp_tiles *tiles, const pixel_area *area, fragment *items,
                                           int64_t count)
{
    const int64_t pixels = (int64_t)area->width * area->height;
    unsigned char seen[MOST_PIXELS] = {0};
    if (count > pixels || pixels > MOST_PIXELS) return false;
    if (count < pixels) clear_tile(tiles, area);
    for (int64_t i = 0; i < count; i++) {
        const uint32_t place = find_index_in_area(tiles, area, items[i].pixel);
        if (seen[place]) return false;
        seen[place] = 1;
        blend_pixel(tiles, items[i].pixel, &items[i], 1);
    }
    return true;
}

static bool blend_tile(const comp_tiles *tiles, comp_tile_scratch *own, const pixel_area *area, fragment *items,
                       int64_t count)
{
    if (blend_single_fragments_of_tile(tiles, area, items, count)) return true;
    const int64_t pixels = (int64_t)area->width * area->height;
    int64_t *starts = reserve_buffer(&own->starts, pixels + 1, sizeof *starts);
    int64_t *order = reserve_buffer(&own->order, count, sizeof *order);
    if (!starts || !order) return false;
    sort_by_pixel(tiles, area, items, count, starts, order);
    for (int64_t k = 0; k < pixels; k++) {
        const int64_t pixel = (area->y + k / area->width) * tiles->out->width + area->x + k % area->width;
        const int64_t own_count = starts[k + 1] - starts[k];
        if (!own_count) {
            store_background(tiles, pixel);
            continue;
        }
        fragment *collected = copy_fragments_of_pixel(own, items, order + starts[k], own_count);
        if (!collected) return false;
        blend_pixel(tiles, pixel, collected, own_count);
    }
    return true;
}

bool comp_tiles_blend(void *state, int thread, const pixel_area *area, fragment *items, int64_t count)
{
    comp_tiles *tiles = state;
    comp_tile_scratch *own = &tiles->scratch[thread];
    const double start = omp_get_wtime();
    bool is_ok = true;
    if (count)
        is_ok = blend_tile(tiles, own, area, items, count);
    else
        clear_empty_tile(tiles, area);
    own->fragments += count;
    own->seconds += omp_get_wtime() - start;
    return is_ok;
}
