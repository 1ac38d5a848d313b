/* Subtrees are dealt to threads, each of which lists the cells it finds and counts them by tile; then room is
 * made for each tile, and every thread bins its own cells. The bound on cells is a bound on memory and on time lost:
 * beyond one cell a pixel most of what would be listed is hidden, or smaller than a pixel. Of a volume nothing is
 * hidden: there a million may be listed in any case. */
#include "render_candidates.h"
#include "kernel_types.h"
#include "render.h"
#include "render_kernels.h"
#include "render_subtrees.h"

#include <omp.h>

#include "memory.h"

enum { ITEMS = 1024, MOST_ITEMS = 64 * ITEMS, VOLUME_ITEMS = 1024 * ITEMS, BLOCKS = KERNEL_TILE / KERNEL_BLOCK };

/* ---- subtrees ------------------------------------------------------------------------------------------------- */

/* Cuts the trees of all surfaces, or of the volume, into subtrees. */
static bool cut_trees(const kernel_frame *f, bool is_volume, render_subtrees *list)
{
    const render_job *job = f->job;
    const int first = is_volume ? -1 : 0, end = is_volume ? 0 : f->surface_count;
    if (!render_subtrees_begin(list, (int64_t)(end - first) * job->part_count)) return false;
    for (int s = first; s < end; s++) {
        const render_field *field = is_volume ? &job->volumes[0].field : &f->surfaces[s].layer->field;
        for (int part = 0; part < job->part_count; part++)
            if (field->ranges[part].low && job->parts[part].tree->node_count) render_subtrees_add(list, f, s, part);
    }
    return true;
}

/* ---- cells ---------------------------------------------------------------------------------------------------- */

/* Adds a chunk. A list that is full stays so, because cells that found no room are missing from it. */
static bool grow(kernel_candidate_list *list)
{
    if (list->is_full) return false;
    const int64_t twice = 2 * list->capacity, capacity = !twice ? ITEMS : twice < MOST_ITEMS ? twice : MOST_ITEMS;
    int64_t left;
#pragma omp atomic capture
    left = *list->bound -= capacity;
    kernel_candidate_chunk *chunk =
        left < 0 ? NULL : base_alloc(sizeof *chunk + (size_t)capacity * sizeof *chunk->items);
    list->is_full = !chunk;
    if (!chunk) return false;
    if (list->chunk) list->chunk->count = list->count;
    chunk->before = list->chunk;
    chunk->count = 0;
    list->chunk = chunk;
    list->items = chunk->items;
    list->count = 0;
    list->capacity = capacity;
    return true;
}

static void free_list(kernel_candidate_list *list)
{
    while (list->chunk) {
        kernel_candidate_chunk *before = list->chunk->before;
        base_free(list->chunk);
        list->chunk = before;
    }
}

/* ---- tiles ---------------------------------------------------------------------------------------------------- */

static int64_t tiles_across(const kernel_frame *f)
{
    return (f->job->camera.width + KERNEL_TILE - 1) / KERNEL_TILE;
}

static int64_t tile_count(const kernel_frame *f)
{
    return tiles_across(f) * ((f->job->camera.height + KERNEL_TILE - 1) / KERNEL_TILE);
}

/* Cuts pixels first .. last of a row or column to its n-th tile. */
typedef struct within {
    unsigned first, last;
} within;

static within within_tile(int first, int last, int tile)
{
    const int from = first - tile * KERNEL_TILE, to = last - tile * KERNEL_TILE;
    return (within){(unsigned)(from > 0 ? from : 0), (unsigned)(to < KERNEL_TILE - 1 ? to : KERNEL_TILE - 1)};
}

/* Returns the pixels' blocks as bits. */
static unsigned bits_of(within w)
{
    return ~0u << w.first / KERNEL_BLOCK & ((2u << w.last / KERNEL_BLOCK) - 1);
}

static kernel_tile_candidate shown_within(const kernel_candidate *s, within columns, within rows)
{
    /* A tile's rows of blocks, a bit each in the column of the first blocks. */
    static const uint16_t spread[1 << BLOCKS] = {0x0000, 0x0001, 0x0010, 0x0011, 0x0100, 0x0101, 0x0110, 0x0111,
                                                 0x1000, 0x1001, 0x1010, 0x1011, 0x1100, 0x1101, 0x1110, 0x1111};
    return (kernel_tile_candidate){
        .near = s->near,
        .far = s->far,
        .cell = s->cell,
        .source = s->source,
        .blocks = (uint16_t)(bits_of(columns) * spread[bits_of(rows)]),
        .box = (uint16_t)(columns.first | columns.last << 4 | rows.first << 8 | rows.last << 12)};
}

/* Bins the cells; at[tile] is the place of the tile's next one. */
static void bin_tiles(const kernel_candidate_chunk *chunk, int64_t across, uint32_t *at, kernel_tile_candidate *out)
{
    for (const kernel_candidate *s = chunk->items, *end = s + chunk->count; s < end; s++)
        for (int y = s->y0 / KERNEL_TILE; y <= s->y1 / KERNEL_TILE; y++) {
            const within rows = within_tile(s->y0, s->y1, y);
            for (int x = s->x0 / KERNEL_TILE; x <= s->x1 / KERNEL_TILE; x++)
                out[at[y * across + x]++] = shown_within(s, within_tile(s->x0, s->x1, x), rows);
        }
}

/* Replaces counts (threads × tiles) by the places where each thread's cells of each tile begin. Returns their sum. */
static uint64_t place_tiles(uint32_t *counts, int threads, int64_t tiles, uint32_t *starts)
{
    uint64_t sum = 0;
    for (int64_t tile = 0; tile < tiles; tile++) {
        starts[tile] = (uint32_t)sum;
        for (int t = 0; t < threads; t++) {
            const uint32_t count = counts[t * tiles + tile];
            counts[t * tiles + tile] = (uint32_t)sum;
            sum += count;
        }
    }
    starts[tiles] = (uint32_t)sum;
    return sum;
}

/* ---- all of it ------------------------------------------------------------------------------------------------ */

typedef struct search {
    kernel_frame *frame;
    render_subtrees subtrees;
    kernel_candidate_list *lists; /* one a thread */
    uint32_t *counts, *starts;
    kernel_tile_candidate *candidates;
    int64_t bound;
} search;

static void run(search *s, kernel_thread *thread_of, int threads)
{
    const kernel_table *kernels = render_kernels();
    const int64_t tiles = tile_count(s->frame), across = tiles_across(s->frame), most = 2 * s->bound;
    bool is_full = false;
#pragma omp parallel num_threads(threads)
    {
        const int me = omp_get_thread_num();
        kernel_candidate_list *list = &s->lists[me];
#pragma omp for schedule(dynamic, 1)
        for (int64_t i = 0; i < s->subtrees.count; i++)
            if (!list->is_full) kernels->find_candidates(s->frame, &thread_of[me], &s->subtrees.items[i], list, grow);
        if (list->chunk) list->chunk->count = list->count;
#pragma omp barrier
#pragma omp single
        {
            for (int t = 0; t < threads; t++) is_full = is_full || s->lists[t].is_full;
            const uint64_t count = is_full ? 0 : place_tiles(s->counts, threads, tiles, s->starts);
            is_full = is_full || count > (uint64_t)most;
            if (!is_full) s->candidates = base_alloc(count * sizeof *s->candidates);
        }
        for (const kernel_candidate_chunk *c = s->candidates ? list->chunk : NULL; c; c = c->before)
            bin_tiles(c, across, s->counts + me * tiles, s->candidates);
    }
}

/* Returns the candidates that the search found, or NULL. */
static kernel_tile_candidate *find(kernel_frame *frame, bool is_volume, kernel_thread *thread_of, int threads,
                                   uint32_t **starts)
{
    const int64_t tiles = tile_count(frame), pixels = (int64_t)frame->job->camera.width * frame->job->camera.height;
    const int64_t cells = is_volume && pixels < VOLUME_ITEMS ? VOLUME_ITEMS : pixels;
    search s = {.frame = frame, .bound = cells + ITEMS * (int64_t)threads};
    s.lists = base_calloc((size_t)threads, sizeof *s.lists);
    s.counts = base_calloc((size_t)(threads * tiles), sizeof *s.counts);
    s.starts = base_alloc((size_t)(tiles + 1) * sizeof *s.starts);
    if (s.lists && s.counts && s.starts && cut_trees(frame, is_volume, &s.subtrees)) {
        for (int t = 0; t < threads; t++)
            s.lists[t] = (kernel_candidate_list){
                .bound = &s.bound, .counts = s.counts + t * tiles, .tile_columns = (int)tiles_across(frame)};
        run(&s, thread_of, threads);
    }
    for (int t = 0; s.lists && t < threads; t++) free_list(&s.lists[t]);
    base_free(s.lists);
    base_free(s.counts);
    base_free(s.subtrees.items);
    if (!s.candidates) base_free(s.starts);
    *starts = s.candidates ? s.starts : NULL;
    return s.candidates;
}

void render_candidates_find(kernel_frame *frame, kernel_thread *thread_of, int threads)
{
    frame->candidates = find(frame, false, thread_of, threads, &frame->candidate_starts);
}

void render_candidates_find_volume(kernel_frame *frame, kernel_thread *thread_of, int threads)
{
    frame->volume_candidates = find(frame, true, thread_of, threads, &frame->volume_starts);
}

void render_candidates_free(kernel_frame *frame)
{
    base_free(frame->candidates);
    base_free(frame->candidate_starts);
    base_free(frame->volume_candidates);
    base_free(frame->volume_starts);
    frame->candidates = frame->volume_candidates = NULL;
    frame->candidate_starts = frame->volume_starts = NULL;
}
