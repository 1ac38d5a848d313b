/* The kernels: this one file is compiled once per instruction set and exports one table (kernel_types.h). In each tile
 * surfaces are traced before volumes, because opaque hits end the rays. The cells to be traced are the tile's
 * candidates, if they have been found before; otherwise they are found by traversing the trees for this tile. */
#include "grid.h"
#include "kernel_bins.h"
#include "kernel_candidates.h"
#include "kernel_cell.h"
#include "kernel_cell_cache.h"
#include "kernel_differences.h"
#include "kernel_finder.h"
#include "kernel_hits.h"
#include "kernel_occlusion.h"
#include "kernel_occlusion_rays.h"
#include "kernel_packet.h"
#include "kernel_packet_surface.h"
#include "kernel_prefetch.h"
#include "kernel_tile.h"
#include "kernel_tile_cells.h"
#include "kernel_tile_queue.h"
#include "kernel_tile_segments.h"
#include "kernel_tile_surface.h"
#include "kernel_tile_trace.h"
#include "kernel_tile_volume.h"
#include "kernel_types.h"
#include "pixel_set.h"
#include "render.h"
#include "simd.h"

/* ---- isosurfaces in the cells that are binned in a tile ---- */

/* Sorts candidates by mesh part; within a part they stay in order of depth. Up to SIMD_WIDTH cells are traced together
 * (kernel_batch.h), but only cells of one part. Without sorting, cells of different parts would alternate, and few
 * cells would be traced together. */
static void kernel_sort_candidates_by_part(const kernel_tile_candidate **items, int count)
{
    for (int n = 1; n < count; n++) {
        const kernel_tile_candidate *item = items[n];
        const uint32_t part = item->source / RENDER_MAX_ISOVALUES;
        int at = n;
        for (; at > 0 && items[at - 1]->source / RENDER_MAX_ISOVALUES > part; at--) items[at] = items[at - 1];
        items[at] = item;
    }
}

/* Adds the cells in m->prefetched, whose connectivity has been prefetched, to the queues of cells to be traced. */
static __attribute__((noinline)) void kernel_tile_queue_prefetched(kernel_tile_trace *t, kernel_tile_search *m)
{
    const kernel_tile_candidate **items = m->prefetched;
    kernel_sort_candidates_by_part(items, m->prefetched_count);
    for (int n = 0; n < m->prefetched_count; n++) {
        int part;
        const int value = kernel_tile_set_layer_of_source(t, items[n]->source, &part);
        if (kernel_candidate_blocks(t, items[n])) kernel_tile_queue_add(t, m, items[n], part, value);
    }
    m->prefetched_count = 0;
}

/* Traces the surfaces in the tile's candidates q: the transparent ones if `transparent` is set, otherwise the opaque
 * ones, which must be traced first. */
static __attribute__((noinline)) void kernel_tile_trace_candidates(kernel_tile_trace *t, const kernel_bin *q,
                                                                   bool transparent)
{
    kernel_tile_search *queue = t->search;
    kernel_tile_queue_begin(queue);
    for (int bin = 0; bin < KERNEL_DEPTHS && bin <= kernel_depth_bin(q, kernel_tile_far(t)); bin++)
        for (int i = q->first[bin]; i >= 0; i = q->items[i].next) {
            const kernel_tile_candidate *candidate = &q->items[i];
            const uint32_t source = candidate->source;
            const bool is_transparent =
                t->frame->isovalue_surface[source % RENDER_MAX_ISOVALUES] >= t->frame->opaque_count;
            if (is_transparent != transparent || !kernel_candidate_blocks(t, candidate)) continue;
            kernel_prefetch_indices(t->frame->job->parts[source / RENDER_MAX_ISOVALUES].cells, candidate->cell);
            queue->prefetched[queue->prefetched_count++] = candidate;
            if (queue->prefetched_count == SIMD_WIDTH) kernel_tile_queue_prefetched(t, queue);
        }
    kernel_tile_queue_prefetched(t, queue);
    kernel_tile_queue_finish(t, queue);
}

SIMD_INLINE void kernel_tile_trace_binned_surfaces(kernel_tile_trace *t)
{
    const kernel_frame *f = t->frame;
    kernel_bin *bin = &t->thread->bin;
    if (!bin->count) return;
    kernel_sort_by_depth(bin);
    if (f->opaque_count) kernel_tile_trace_candidates(t, bin, false);
    if (f->opaque_count < f->surface_count) kernel_tile_trace_candidates(t, bin, true);
}

/* ---- tiles ---- */

/* The memory of one thread, which is used for all tiles of a frame that the thread traces. */
typedef struct kernel_memory {
    kernel_cell packet_cells[KERNEL_CACHE_CELLS];
    kernel_tile_trace tile;
    kernel_tile_volume volume;
    kernel_tile_segments segments;
    kernel_tile_cells cells;
    kernel_finder finder;
    kernel_tile_search search;
} kernel_memory;

/* Returns whether a pixel of the block whose upper left pixel is (x0, y0) must be traced. */
static bool has_active_pixel(const render_job *job, int x0, int y0)
{
    if (!job->pixels) return x0 < job->camera.width && y0 < job->camera.height;
    for (int y = y0; y < y0 + KERNEL_BLOCK && y < job->camera.height; y++)
        for (int x = x0; x < x0 + KERNEL_BLOCK && x < job->camera.width; x++)
            if (pixel_set_has(job->pixels, (int64_t)y * job->camera.width + x)) return true;
    return false;
}

static unsigned active_blocks(const render_job *job, int x0, int y0)
{
    unsigned blocks = 0;
    for (int i = 0; i < KERNEL_BLOCKS; i++)
        if (has_active_pixel(job, x0 + i % KERNEL_BLOCKS_ACROSS * KERNEL_BLOCK,
                             y0 + i / KERNEL_BLOCKS_ACROSS * KERNEL_BLOCK))
            blocks |= 1u << i;
    return blocks;
}

static void trace_tile_surfaces(kernel_tile_trace *t)
{
    const double start = render_read_clock();
    if (t->frame->candidates)
        kernel_tile_trace_binned_surfaces(t);
    else
        kernel_tile_trace_all_layers(t);
    for (unsigned begun = t->begun; begun; begun &= begun - 1)
        for (int n = 0; n < KERNEL_BLOCK_PACKETS; n++) {
            const int i = __builtin_ctz(begun) * KERNEL_BLOCK_PACKETS + n;
            kernel_emit_opaque_hits(&t->packets[i], &t->hits[i]);
        }
    t->thread->surface_seconds += render_read_clock() - start;
}

static void trace_tile_volumes(kernel_tile_trace *t)
{
    const kernel_frame *f = t->frame;
    const double start = render_read_clock();
    const int intervals = f->volume_intervals ? f->volume_intervals : 1;
    for (t->clip_interval = 0; t->clip_interval < intervals; t->clip_interval++) {
        if (f->has_segments)
            kernel_tile_integrate_volumes(t);
        else
            kernel_tile_sample_volumes(t);
    }
    t->thread->volume_seconds += render_read_clock() - start;
}

/* Returns whether the tile overlaps the rectangle of pixels in which a tree's bounding box may be visible
 * (kernel_frame.cover). */
static bool is_covered(const kernel_frame *f, int x0, int y0)
{
    return x0 <= f->cover[0][1] && x0 + KERNEL_TILE > f->cover[0][0] && y0 <= f->cover[1][1] &&
           y0 + KERNEL_TILE > f->cover[1][0];
}

/* Returns whether the tile may contain samples or segments of volumes. */
static bool has_volume(const kernel_frame *f, const kernel_thread *thread, int x0, int y0)
{
    if (!f->volume_count || !is_covered(f, x0, y0)) return false;
    return !f->volume_candidates || thread->volume_bin.count;
}

/* Returns whether the tile may contain hits on surfaces. */
static bool has_surface(const kernel_frame *f, const kernel_thread *thread, int x0, int y0)
{
    if (!f->surface_count) return false;
    return f->candidates ? thread->bin.count : is_covered(f, x0, y0);
}

static bool begins_task(const kernel_frame *f, int x0, int y0)
{
    const int columns = (f->job->camera.width - 1) / KERNEL_TILE + 1;
    return (y0 / KERNEL_TILE * columns + x0 / KERNEL_TILE) % KERNEL_TILES_PER_TASK == 0;
}

static void trace_tile(const kernel_frame *f, kernel_thread *thread, int x0, int y0)
{
    thread->serial++;
    if (begins_task(f, x0, y0)) kernel_depth_reset(thread->tile_volume);
    kernel_tile_trace *t = thread->tile;
    const bool fogs = has_volume(f, thread, x0, y0);
    if (!fogs && !has_surface(f, thread, x0, y0)) return;
    const unsigned wanted = active_blocks(f->job, x0, y0);
    if (!wanted) return;
    kernel_tile_begin(t, f, thread, x0, y0, wanted);
    if (f->surface_count) trace_tile_surfaces(t);
    if (fogs) trace_tile_volumes(t);
}

static void find_candidates(const kernel_frame *f, kernel_thread *thread, const kernel_subtree *subtree,
                            kernel_candidate_list *list, bool (*grow)(kernel_candidate_list *list))
{
    kernel_finder *finder = thread->finder;
    kernel_finder_begin(finder, f, subtree);
    finder->list = list;
    finder->grow = grow;
    kernel_find_candidates(finder, subtree->node);
}

/* Sets up a thread's memory. The memory has a size of megabytes, most of which may stay unused in a frame. So only
 * members that are read before they are written are initialized. */
static void begin(kernel_thread *thread)
{
    kernel_memory *m = thread->memory;
    thread->cells = m->packet_cells;
    thread->tile = &m->tile;
    thread->tile_cells = &m->cells;
    thread->tile_volume = &m->volume;
    thread->tile_segments = &m->segments;
    thread->finder = &m->finder;
    m->tile.search = &m->search;
    for (int i = 0; i < KERNEL_CACHE_CELLS; i++) m->packet_cells[i].serial = 0;
    m->segments.depth = 0;
}

const kernel_table KERNEL_TABLE = {SIMD_WIDTH,
                                   sizeof(kernel_memory),
                                   begin,
                                   trace_tile,
                                   find_candidates,
                                   kernel_occlude,
                                   kernel_occlude_by_cell,
                                   kernel_sample_pending,
                                   kernel_light_pending};
