/* Finds candidates in parallel. Subtrees are distributed among threads. Each thread lists the candidates that it finds,
 * then sorts them by tile into bins of its own; threads do not wait for each other in between. The thread that traces a
 * tile gathers the tile's candidates from the bins of all threads. A bound on the number of cells limits memory and
 * wasted time: if there is more than one cell per pixel, most listed cells are hidden or smaller than a pixel. Cells of
 * a volume do not hide each other, so for a volume at least a million may be listed. */
#include "render_candidates.h"
#include "kernel_bins.h"
#include "kernel_types.h"
#include "render.h"
#include "render_kernels.h"
#include "render_subtrees.h"
#include "render_thread.h"

#include <math.h>
#include <omp.h>
#include <string.h>

#include "memory.h"
#include "mmbvh.h"
#include "region.h"

enum { ITEMS = 1024, MOST_ITEMS = 64 * ITEMS, VOLUME_ITEMS = 1024 * ITEMS };

/* SMALL_CELLS and SMALL_CROSSED are limits for the number of cells per pixel that the trees' bounding boxes cover in
 * the picture. If there are more cells per pixel, the cells count as small, and tiles traverse the trees themselves.
 * SMALL_CELLS: for volumes. SMALL_CROSSED: for surfaces; only cells in tree leaves whose range of values contains an
 * isovalue are counted (docs/development/decisions/find.md). SAMPLES: number of tree nodes from which the number of
 * these cells is estimated. */
enum { SMALL_CELLS = 8, SMALL_CROSSED = 3, SAMPLES = 512 };

/* ---- lists of candidates -------------------------------------------------------------------------------------- */

/* Adds a chunk of memory to the list. Returns false, and marks the list as full, if the maximum number of candidates is
 * reached or memory runs out. A full list stays full, because candidates are missing from it. */
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

/* ---- bins of the candidates of each tile ---------------------------------------------------------------------- */

/* The candidates that one thread has found, sorted by tile: those of a tile are items[starts[tile]] to
 * items[starts[tile + 1] - 1]. The bins of all threads that have searched are one array; `next` is NULL in the last. */
struct kernel_bins {
    kernel_candidate_list list; /* the candidates in the order in which they were found; empty after the search */
    kernel_tile_candidate *items;
    uint32_t *starts;
    struct kernel_bins *next;
};

static int64_t tiles_across(const kernel_frame *f)
{
    return (f->job->camera.width + KERNEL_TILE - 1) / KERNEL_TILE;
}

static int64_t tile_count(const kernel_frame *f)
{
    return tiles_across(f) * ((f->job->camera.height + KERNEL_TILE - 1) / KERNEL_TILE);
}

static void bins_free(struct kernel_bins *bins)
{
    for (struct kernel_bins *b = bins; b; b = b->next) {
        free_list(&b->list);
        base_free(b->items);
        base_free(b->starts);
    }
    base_free(bins);
}

/* Goes through the candidates of all chunks and increases at[tile] by 1 for each tile in which a candidate may be
 * visible. If `out` is not NULL, at[tile] is the index at which the tile's next candidate is stored in `out`. */
static void bin_candidates_by_tile(const kernel_candidate_chunk *chunk, int64_t across, uint32_t *at,
                                   kernel_tile_candidate *out)
{
    for (; chunk; chunk = chunk->before)
        for (const kernel_candidate *s = chunk->items, *end = s + chunk->count; s < end; s++)
            for (int y = s->y0 / KERNEL_TILE; y <= s->y1 / KERNEL_TILE; y++)
                for (int x = s->x0 / KERNEL_TILE; x <= s->x1 / KERNEL_TILE; x++) {
                    const uint32_t n = at[y * across + x]++;
                    if (out) out[n] = kernel_convert_candidate_to_tile(s, x * KERNEL_TILE, y * KERNEL_TILE);
                }
}

/* Sorts the candidates that one thread has found by tile; a candidate is stored once for each tile in which it may be
 * visible. Returns false if more than `most` would be stored, or if memory runs out. */
static bool bins_fill(struct kernel_bins *bin, int64_t across, int64_t tiles, int64_t most)
{
    uint32_t *starts = bin->starts;
    uint64_t sum = 0;
    bin_candidates_by_tile(bin->list.chunk, across, starts + 1, NULL);
    for (int64_t tile = 0; tile < tiles; tile++) {
        const uint32_t count = starts[1 + tile];
        /* index of the tile's first candidate; the second call of bin_candidates_by_tile() increases it to that of the
         * next tile's first candidate */
        starts[1 + tile] = (uint32_t)sum;
        sum += count;
    }
    if (sum > (uint64_t)most) return false;
    bin->items = base_alloc(sum * sizeof *bin->items);
    if (!bin->items) return false;
    bin_candidates_by_tile(bin->list.chunk, across, starts + 1, bin->items);
    return true;
}

static bool ensure_bin_capacity(kernel_bin *bin, int64_t count)
{
    if (count <= bin->capacity) return true;
    base_free(bin->buffer);
    bin->buffer = base_alloc((size_t)(2 * count) * sizeof *bin->buffer);
    bin->capacity = bin->buffer ? 2 * count : 0;
    return bin->buffer != NULL;
}

static int count_candidates_in_tile(const struct kernel_bins *bins, int64_t tile)
{
    return (int)(bins->starts[tile + 1] - bins->starts[tile]);
}

/* Gathers a tile's candidates in *bin. If a single thread has found all of them, bin->items points to that thread's
 * bins; otherwise they are copied to bin->buffer. Returns false if there is no memory. */
static bool gather_tile_candidates(const struct kernel_bins *bins, int64_t tile, kernel_bin *bin)
{
    const struct kernel_bins *last = NULL;
    int64_t count = 0;
    bin->count = 0;
    for (const struct kernel_bins *b = bins; b; b = b->next)
        if (count_candidates_in_tile(b, tile)) {
            last = b;
            count += count_candidates_in_tile(b, tile);
        }
    if (!last) return true;
    const bool is_shared = count_candidates_in_tile(last, tile) < count;
    if (is_shared && !ensure_bin_capacity(bin, count)) return false;
    bin->items = is_shared ? bin->buffer : last->items + last->starts[tile];
    bin->count = (int)count;
    kernel_tile_candidate *to = bin->items;
    for (const struct kernel_bins *b = bins; is_shared && b; b = b->next) {
        const int own = count_candidates_in_tile(b, tile);
        if (own) memcpy(to, b->items + b->starts[tile], (size_t)own * sizeof *to);
        to += own;
    }
    return true;
}

bool render_candidates_gather(const kernel_frame *frame, kernel_thread *thread, int x0, int y0)
{
    const int64_t tile = y0 / KERNEL_TILE * tiles_across(frame) + x0 / KERNEL_TILE;
    return gather_tile_candidates(frame->candidates, tile, &thread->bin) &&
           gather_tile_candidates(frame->volume_candidates, tile, &thread->volume_bin);
}

/* ---- numbers of cells per pixel, and bounding boxes in the picture -------------------------------------------- */

/* Extends the ranges of pixel columns (from spans[0][0] to spans[0][1]) and of rows (spans[1]) so that they contain a
 * point, which is given in the trees' coordinates. Returns the point's depth from the eye, or 1 if the camera is
 * orthographic. */
static double extend_spans_by_point(const kernel_frame *f, const double point[3], double spans[2][2])
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
        spans[a][0] = fmin(spans[a][0], at[a]);
        spans[a][1] = fmax(spans[a][1], at[a]);
    }
    return depth;
}

/* Extends the ranges of columns and rows (extend_spans_by_point()) by all corners of the tree's bounding box. Returns
 * the smallest depth of a corner. */
static double extend_spans_by_tree_box(const kernel_frame *f, const mmbvh *tree, double spans[2][2])
{
    float lower[4], upper[4];
    double least = INFINITY;
    mmbvh_node_box(tree, 0, lower, upper);
    for (int corner = 0; corner < 8; corner++) {
        double point[3];
        for (int a = 0; a < 3; a++) point[a] = (double)(corner >> a & 1 ? upper[a] : lower[a]);
        least = fmin(extend_spans_by_point(f, point, spans), least);
    }
    return least;
}

/* Measures the mesh parts on which the field exists (ranges[part].low is set), or all parts if ranges is NULL. *cells:
 * number of these parts' cells; *pixels: sum of the areas of their bounding boxes in the picture, in pixels; all:
 * ranges of columns and rows that these boxes together cover. Returns false if a part does not lie completely in front
 * of the eye. */
static bool measure_parts_in_picture(const kernel_frame *f, const mmbvh_ranges *ranges, double *cells, double *pixels,
                                     double all[2][2])
{
    *cells = *pixels = 0;
    all[0][0] = all[1][0] = INFINITY;
    all[0][1] = all[1][1] = -INFINITY;
    for (int part = 0; part < f->job->part_count; part++) {
        const mmbvh *tree = f->job->parts[part].tree;
        double own[2][2] = {{INFINITY, -INFINITY}, {INFINITY, -INFINITY}};
        if ((ranges && !ranges[part].low) || !tree->node_count) continue;
        if (!(extend_spans_by_tree_box(f, tree, own) > 0)) return false;
        for (int a = 0; a < 2; a++) {
            all[a][0] = fmin(own[a][0], all[a][0]);
            all[a][1] = fmax(own[a][1], all[a][1]);
        }
        *cells += (double)tree->cell_count;
        *pixels += (own[0][1] - own[0][0]) * (own[1][1] - own[1][0]);
    }
    return true;
}

/* Returns whether the volume's cells are so small that listing them as candidates costs more time than it saves. A
 * listed cell is fetched twice, once for its pixels and once for its samples; tiles that traverse the trees themselves
 * fetch it once. */
static bool volume_cells_are_small(const kernel_frame *f)
{
    double cells, pixels, all[2][2];
    return measure_parts_in_picture(f, f->job->volumes[0].field.ranges, &cells, &pixels, all) &&
           cells > SMALL_CELLS * pixels;
}

/* Visits `samples` nodes that are spread evenly over the part's tree, and counts the cells in those that are leaves.
 * Adds the number of these cells to *cells. For each isovalue, adds to *crossed the number of cells in leaves whose
 * range of values contains the isovalue. About half of the nodes are leaves. */
static void count_cells_in_sampled_leaves(const kernel_frame *f, const kernel_surface *s, int part, int64_t samples,
                                          double *cells, double *crossed)
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
        *cells += count;
        for (int i = 0; i < s->visible_values.count; i++) {
            const mmbvh_interval own = s->visible_values.intervals[i];
            if (low <= own.high && high >= own.low) *crossed += count;
        }
    }
}

/* If opaque surfaces have several cells per pixel, most of these cells are hidden or contain no pixel's centre. Tiles
 * that traverse the trees themselves read fewer of them. */
bool render_surfaces_are_small(const kernel_frame *f)
{
    double cells, boxes, all[2][2], crossed = 0;
    int values = 0;
    if (f->has_transparent || !measure_parts_in_picture(f, NULL, &cells, &boxes, all)) return false;
    /* at least the area of one tile, because the boxes of flat parts may have no area in the picture */
    const double pixels =
        fmax(fmin(boxes, (all[0][1] - all[0][0]) * (all[1][1] - all[1][0])), KERNEL_TILE * KERNEL_TILE);
    for (int s = 0; s < f->surface_count; s++) values += f->surfaces[s].layer->value_count;
    if (!(values * cells > SMALL_CROSSED * pixels)) return false;
    for (int s = 0; s < f->surface_count; s++) {
        double sampled = 0, sampled_crossed = 0;
        double own = 0; /* number of cells of the parts on which the field exists */
        for (int part = 0; part < f->job->part_count; part++) {
            const double held = (double)f->job->parts[part].tree->cell_count;
            if (!f->surfaces[s].layer->field.ranges[part].low) continue;
            count_cells_in_sampled_leaves(f, &f->surfaces[s], part, 1 + (int64_t)(SAMPLES * (held / cells)), &sampled,
                                          &sampled_crossed);
            own += held;
        }
        if (sampled > 0) crossed += sampled_crossed / sampled * own;
    }
    return crossed > SMALL_CROSSED * pixels;
}

/* The rectangle of pixels in frame->cover contains the projections of all trees' bounding boxes. It is extended by a
 * margin that covers the errors of rays and tree bounds for which kernel_compute_planes_for_tree_boxes() allows, and
 * the half pixel by which a pixel extends beyond its centre. */
void render_compute_tree_cover(kernel_frame *f)
{
    const render_job *job = f->job;
    const int most[2] = {job->camera.width - 1, job->camera.height - 1};
    double spans[2][2] = {{INFINITY, -INFINITY}, {INFINITY, -INFINITY}};
    double least = INFINITY, size = 2;
    for (int part = 0; part < job->part_count; part++)
        if (job->parts[part].tree->node_count)
            least = fmin(extend_spans_by_tree_box(f, job->parts[part].tree, spans), least);
    for (int a = 0; a < 3; a++)
        size = fmax(2 + fabs((job->camera.eye[a] - job->space.origin[a]) * job->space.scale), size);
    for (int a = 0; a < 2; a++) {
        const double pad = 1 + 32 * 6e-8 * size / (least * job->space.scale) / fabs(a ? f->slope_dy : f->slope_dx);
        const bool is_known = least > 0 && pad < 1e6 && isfinite(spans[a][0]) && isfinite(spans[a][1]);
        f->cover[a][0] = is_known ? (int)fmin(fmax(spans[a][0] - pad, 0), most[a] + 1) : 0;
        f->cover[a][1] = is_known ? (int)fmax(fmin(spans[a][1] + pad, most[a]), -1) : most[a];
    }
}

/* ---- parallel search for candidates --------------------------------------------------------------------------- */

/* Searches all subtrees in parallel. As soon as no subtree is left, each thread sorts its own candidates by tile,
 * without waiting for the other threads. most: maximum number of candidates that a thread may store in its bins; a
 * candidate counts once for each of its tiles. */
static void search_subtrees_in_parallel(const kernel_frame *frame, const kernel_subtree *subtrees, int64_t count,
                                        struct kernel_bins *bins, int64_t most, kernel_thread *thread_of, int threads)
{
    const kernel_table *kernels = render_kernels();
    const int64_t tiles = tile_count(frame);
#pragma omp parallel num_threads(threads)
    {
        region_enter();
        const int me = omp_get_thread_num();
        kernel_candidate_list *list = &bins[me].list;
#pragma omp for schedule(dynamic, 1) nowait
        for (int64_t i = 0; i < count; i++) {
            list->is_full = list->is_full || !render_thread_begin(frame, kernels, &thread_of[me]);
            if (!list->is_full) kernels->find_candidates(frame, &thread_of[me], &subtrees[i], list, grow);
        }
        if (list->chunk) list->chunk->count = list->count;
        list->is_full = list->is_full || !bins_fill(&bins[me], tiles_across(frame), tiles, most);
        region_leave();
    }
}

/* Creates each thread's list and bins. *bound: number of candidates that the lists of all threads together may contain.
 * Returns NULL if there is no memory. */
static struct kernel_bins *begin_bins(const kernel_frame *frame, int64_t *bound, int threads)
{
    struct kernel_bins *bins = base_calloc((size_t)threads, sizeof *bins);
    for (int t = 0; bins && t < threads; t++) {
        uint32_t *starts = base_calloc((size_t)(tile_count(frame) + 1), sizeof *starts);
        if (!starts) {
            bins_free(bins);
            return NULL;
        }
        if (t) bins[t - 1].next = &bins[t];
        bins[t].starts = starts;
        bins[t].list.bound = bound;
    }
    return bins;
}

/* Returns whether every thread has sorted all of its candidates into its bins, and the bins of all threads together
 * have at most `most` candidates. */
static bool is_complete(const struct kernel_bins *bins, int64_t tiles, int64_t most)
{
    int64_t count = 0;
    for (; bins; bins = bins->next) {
        if (bins->list.is_full) return false;
        count += bins->starts[tiles];
    }
    return count <= most;
}

/* Returns the binned candidates of all surfaces or, if is_volume is set, of the volume; NULL if there are too many or
 * memory runs out. */
static struct kernel_bins *find_and_bin_candidates(kernel_frame *frame, bool is_volume, kernel_thread *thread_of,
                                                   int threads)
{
    const int64_t pixels = (int64_t)frame->job->camera.width * frame->job->camera.height;
    const int64_t cells = is_volume && pixels < VOLUME_ITEMS ? VOLUME_ITEMS : pixels;
    int64_t bound = cells + ITEMS * (int64_t)threads;
    const int64_t most = 2 * bound;
    int64_t count;
    struct kernel_bins *bins = begin_bins(frame, &bound, threads);
    kernel_subtree *subtrees = render_subtrees(frame, is_volume ? -1 : 0, is_volume ? 0 : frame->surface_count, &count);
    const bool is_begun = bins && subtrees;
    if (is_begun) search_subtrees_in_parallel(frame, subtrees, count, bins, most, thread_of, threads);
    base_free(subtrees);
    if (!is_begun || !is_complete(bins, tile_count(frame), most)) {
        bins_free(bins);
        return NULL;
    }
    for (struct kernel_bins *b = bins; b; b = b->next) free_list(&b->list);
    return bins;
}

void render_candidates_find(kernel_frame *frame, kernel_thread *thread_of, int threads)
{
    frame->candidates = find_and_bin_candidates(frame, false, thread_of, threads);
}

void render_candidates_find_volume(kernel_frame *frame, kernel_thread *thread_of, int threads)
{
    if (volume_cells_are_small(frame)) return;
    frame->volume_candidates = find_and_bin_candidates(frame, true, thread_of, threads);
}

void render_candidates_free(kernel_frame *frame)
{
    bins_free(frame->candidates);
    bins_free(frame->volume_candidates);
    frame->candidates = frame->volume_candidates = NULL;
}
