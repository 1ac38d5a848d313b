/* Subtrees are dealt to threads, each of which lists the cells it finds and counts them by tile; then room is
 * made for each tile, and every thread bins its own cells. The bound on cells is a bound on memory and on time lost:
 * beyond one cell a pixel most of what would be listed is hidden, or smaller than a pixel. Of a volume nothing is
 * hidden: there a million may be listed in any case. */
#include "render_candidates.h"
#include "kernel_bins.h"
#include "kernel_types.h"
#include "render.h"
#include "render_kernels.h"
#include "render_subtrees.h"

#include <math.h>
#include <omp.h>
#include <string.h>

#include "memory.h"
#include "mmbvh.h"
#include "region.h"

enum { ITEMS = 1024, MOST_ITEMS = 64 * ITEMS, VOLUME_ITEMS = 1024 * ITEMS };

/* So many cells a pixel that their tree covers are small; of surfaces, cells in leaves that isovalues may cross
 * (docs/development/decisions/find.md). */
enum { SMALL_CELLS = 8, SMALL_CROSSED = 3, SAMPLES = 512 };

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

/* Bins the cells; at[tile] is the place of the tile's next one. */
static void bin_tiles(const kernel_candidate_chunk *chunk, int64_t across, uint32_t *at, kernel_tile_candidate *out)
{
    for (const kernel_candidate *s = chunk->items, *end = s + chunk->count; s < end; s++)
        for (int y = s->y0 / KERNEL_TILE; y <= s->y1 / KERNEL_TILE; y++) {
            const kernel_tile_span rows = kernel_span_in_tile(s->y0, s->y1, y * KERNEL_TILE);
            for (int x = s->x0 / KERNEL_TILE; x <= s->x1 / KERNEL_TILE; x++)
                out[at[y * across + x]++] =
                    kernel_candidate_in_tile(s, kernel_span_in_tile(s->x0, s->x1, x * KERNEL_TILE), rows);
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

/* ---- where cells are ---------------------------------------------------------------------------------------- */

/* The first and the last place of something along columns or rows of pixels. */
typedef struct span {
    double low, high;
} span;

/* Widens the spans, of columns and of rows, by a point in the space of trees. Returns its depth from the eye, or 1 for
 * orthographic cameras. */
static double widen(const kernel_frame *f, const double point[3], span spans[2])
{
    const render_camera *c = &f->job->camera;
    const render_space *s = &f->job->space;
    double right = 0, up = 0, forward = 0;
    for (int a = 0; a < 3; a++) {
        const double from_eye = point[a] / s->scale + s->origin[a] - c->eye[a];
        right += from_eye * c->right[a];
        up += from_eye * c->up[a];
        forward += from_eye * c->forward[a];
    }
    const double depth = c->is_orthographic ? 1 : forward;
    const double at[2] = {(right / depth - f->slope_x0) / f->slope_dx, (up / depth - f->slope_y0) / f->slope_dy};
    for (int a = 0; a < 2; a++) {
        spans[a].low = fmin(spans[a].low, at[a]);
        spans[a].high = fmax(spans[a].high, at[a]);
    }
    return depth;
}

/* Widens the spans by all corners of the tree's box, and returns the least of their depths. */
static double widen_by_tree(const kernel_frame *f, const mmbvh *tree, span spans[2])
{
    float lower[4], upper[4];
    double least = INFINITY;
    mmbvh_node_box(tree, 0, lower, upper);
    for (int corner = 0; corner < 8; corner++) {
        double point[3];
        for (int a = 0; a < 3; a++) point[a] = (double)(corner >> a & 1 ? upper[a] : lower[a]);
        least = fmin(widen(f, point, spans), least);
    }
    return least;
}

/* What parts cover of the picture. */
typedef struct coverage {
    double cells;
    double pixels; /* summed over the parts' boxes */
    span all[2];   /* of all boxes */
} coverage;

/* Measures the parts that have ranges, of a field or, NULL, all. False where one is not all before the eye. */
static bool measure_parts(const kernel_frame *f, const mmbvh_ranges *ranges, coverage *out)
{
    *out = (coverage){.all = {{INFINITY, -INFINITY}, {INFINITY, -INFINITY}}};
    for (int part = 0; part < f->job->part_count; part++) {
        const mmbvh *tree = f->job->parts[part].tree;
        span own[2] = {{INFINITY, -INFINITY}, {INFINITY, -INFINITY}};
        if ((ranges && !ranges[part].low) || !tree->node_count) continue;
        if (!(widen_by_tree(f, tree, own) > 0)) return false;
        for (int a = 0; a < 2; a++)
            out->all[a] = (span){fmin(own[a].low, out->all[a].low), fmax(own[a].high, out->all[a].high)};
        out->cells += (double)tree->cell_count;
        out->pixels += (own[0].high - own[0].low) * (own[1].high - own[1].low);
    }
    return true;
}

/* Are the volume's cells so small that to list them costs more than it spares? A listed cell is fetched twice, once for
 * its pixels and once for its samples; tiles that go down the trees themselves fetch it once. */
static bool is_of_small_cells(const kernel_frame *f)
{
    coverage c;
    return measure_parts(f, f->job->volumes[0].field.ranges, &c) && c.cells > SMALL_CELLS * c.pixels;
}

/* Counts of cells in leaves: all that were looked at, and those that isovalues may cross, each isovalue counted. */
typedef struct leaf_sample {
    double cells, crossed;
} leaf_sample;

/* Adds some of the part's nodes, about as many leaves among them as inner nodes. */
static void sample_leaves(const kernel_frame *f, const kernel_surface *s, int part, int64_t samples, leaf_sample *out)
{
    const mmbvh *tree = f->job->parts[part].tree;
    const mmbvh_ranges *ranges = &s->layer->field.ranges[part];
    if (!ranges->low || !tree->node_count) return;
    for (int64_t n = 0; n < samples; n++) {
        const int64_t node = (int64_t)(((double)n + 0.5) / (double)samples * (double)tree->node_count);
        const int count = mmbvh_node_count(tree, node);
        float low, high;
        memcpy(&low, ranges->low + node * ranges->stride, sizeof low);
        memcpy(&high, ranges->high + node * ranges->stride, sizeof high);
        out->cells += count;
        for (int i = 0; i < s->interest.count; i++)
            if (low <= s->interest.high[i] && high >= s->interest.low[i]) out->crossed += count;
    }
}

/* Where opaque surfaces have several cells a pixel most are hidden, or between pixels: tiles that go down the trees
 * themselves fetch fewer. */
bool render_surfaces_are_small(const kernel_frame *f)
{
    coverage c;
    double crossed = 0;
    int values = 0;
    if (f->has_transparent || !measure_parts(f, NULL, &c)) return false;
    const double all = (c.all[0].high - c.all[0].low) * (c.all[1].high - c.all[1].low);
    const double pixels = fmax(fmin(c.pixels, all), KERNEL_TILE * KERNEL_TILE); /* parts may be seen edge on */
    for (int s = 0; s < f->surface_count; s++) values += f->surfaces[s].layer->value_count;
    if (!(values * c.cells > SMALL_CROSSED * pixels)) return false;
    for (int s = 0; s < f->surface_count; s++) {
        leaf_sample leaves = {0, 0};
        double own = 0; /* cells of parts that have the field */
        for (int part = 0; part < f->job->part_count; part++) {
            const double held = (double)f->job->parts[part].tree->cell_count;
            if (!f->surfaces[s].layer->field.ranges[part].low) continue;
            sample_leaves(f, &f->surfaces[s], part, 1 + (int64_t)(SAMPLES * (held / c.cells)), &leaves);
            own += held;
        }
        if (leaves.cells > 0) crossed += leaves.crossed / leaves.cells * own;
    }
    return crossed > SMALL_CROSSED * pixels;
}

/* Rays and bounds of trees are off by what kernel_tree_planes() allows them, and pixels reach half a pixel beyond their
 * middles. */
void render_trees_cover(kernel_frame *f)
{
    const render_job *job = f->job;
    const int most[2] = {job->camera.width - 1, job->camera.height - 1};
    span spans[2] = {{INFINITY, -INFINITY}, {INFINITY, -INFINITY}};
    double least = INFINITY, size = 2;
    for (int part = 0; part < job->part_count; part++)
        if (job->parts[part].tree->node_count) least = fmin(widen_by_tree(f, job->parts[part].tree, spans), least);
    for (int a = 0; a < 3; a++)
        size = fmax(2 + fabs((job->camera.eye[a] - job->space.origin[a]) * job->space.scale), size);
    for (int a = 0; a < 2; a++) {
        const double pad = 1 + 32 * 6e-8 * size / (least * job->space.scale) / fabs(a ? f->slope_dy : f->slope_dx);
        const bool is_known = least > 0 && pad < 1e6 && isfinite(spans[a].low) && isfinite(spans[a].high);
        f->cover[a][0] = is_known ? (int)fmin(fmax(spans[a].low - pad, 0), most[a] + 1) : 0;
        f->cover[a][1] = is_known ? (int)fmax(fmin(spans[a].high + pad, most[a]), -1) : most[a];
    }
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
        region_enter();
        const int me = omp_get_thread_num();
        kernel_candidate_list *list = &s->lists[me];
#pragma omp for schedule(dynamic, 1) nowait
        for (int64_t i = 0; i < s->subtrees.count; i++) {
            list->is_full = list->is_full || !render_thread_begin(kernels, &thread_of[me]);
            if (!list->is_full) kernels->find_candidates(s->frame, &thread_of[me], &s->subtrees.items[i], list, grow);
        }
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
        region_leave();
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
    if (is_of_small_cells(frame)) return;
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
