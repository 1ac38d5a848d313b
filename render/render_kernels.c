/* The kernels: this one file is compiled once per instruction set and exports one table (kernel_types.h). A tile finds
 * its surfaces first, so that volumes know where opaque ones end them. It is traced by the cells that are binned there,
 * in one traversal, or packet by packet. */
#include "grid.h"
#include "kernel_arrays.h"
#include "kernel_batch.h"
#include "kernel_bins.h"
#include "kernel_bounds.h"
#include "kernel_candidates.h"
#include "kernel_cell.h"
#include "kernel_cell_cache.h"
#include "kernel_cell_values.h"
#include "kernel_differences.h"
#include "kernel_finder.h"
#include "kernel_hits.h"
#include "kernel_tile_queue.h"
#include "kernel_occlusion.h"
#include "kernel_occlusion_rays.h"
#include "kernel_packet.h"
#include "kernel_packet_surface.h"
#include "kernel_polys.h"
#include "kernel_prefetch.h"
#include "kernel_surface.h"
#include "kernel_tile.h"
#include "kernel_tile_cells.h"
#include "kernel_tile_segments.h"
#include "kernel_tile_surface.h"
#include "kernel_tile_trace.h"
#include "kernel_tile_volume.h"
#include "kernel_types.h"
#include "kernel_volume.h"
#include "pixel_set.h"
#include "render.h"
#include "simd.h"

/* ---- isosurfaces in the cells that are binned in a tile ---- */

/* Prefetches what is read first of a cell: its vertices' indices, or its active record. */
SIMD_INLINE void kernel_candidate_prefetch(const kernel_frame *f, const kernel_tile_candidate *candidate)
{
    const int part = (int)(candidate->source / RENDER_MAX_ISOVALUES);
    const kernel_active *active =
        kernel_active_of(f, f->isovalues[candidate->source % RENDER_MAX_ISOVALUES].surface, part);
    if (!active) {
        kernel_prefetch_indices(f->job->parts[part].cells, candidate->cell);
        return;
    }
    const float *record = active->records + (int64_t)candidate->cell * active->vertices * KERNEL_ACTIVE_FLOATS;
    for (int at = 0; at < active->vertices * KERNEL_ACTIVE_FLOATS; at += 16) __builtin_prefetch(record + at);
}

/* Cells whose vertices' indices are being prefetched, or that are traced alone. */
typedef struct kernel_pending {
    int count;
    const kernel_tile_candidate *items[SIMD_WIDTH];
} kernel_pending;

/* Prefetches the vertices of all pending cells, then traces them. */
static __attribute__((noinline)) void kernel_tile_meet_pending(kernel_tile_trace *t, kernel_tile_queue *m,
                                                               kernel_pending *w)
{
    kernel_batch *b = &m->batch;
    for (int n = 0; n < w->count; n++) {
        int part;
        kernel_tile_source(t, w->items[n]->source, &part);
        if (!b->count) kernel_batch_turn(t, b, part);
        if (kernel_active_of(t->frame, t->layer, part)) continue; /* all of it was asked for */
        if (b->layer == t->layer && b->part == part && kernel_is_for_batch(t, b, w->items[n]))
            continue; /* batches ask for theirs */
        kernel_prefetch_vertices(t->frame->job->parts[part].cells, &t->surface->layer->field.fields[part],
                                 w->items[n]->cell);
    }
    for (int n = 0; n < w->count; n++) {
        int part;
        const int value = kernel_tile_source(t, w->items[n]->source, &part);
        if (kernel_candidate_blocks(t, w->items[n])) kernel_tile_queue_add(t, m, w->items[n], part, value);
    }
    w->count = 0;
}

/* Traces the tile's opaque surfaces, or the transparent ones, which need the opaque ones to be known. */
static __attribute__((noinline)) void kernel_tile_trace_candidates(kernel_tile_trace *t, const kernel_by_depth *q,
                                                                   bool transparent)
{
    kernel_tile_queue meeting;
    kernel_pending pending = {0};
    kernel_tile_queue_begin(&meeting);
    for (int bin = 0; bin < KERNEL_DEPTHS && bin <= kernel_depth_bin(q, kernel_tile_far(t)); bin++)
        for (int i = q->first[bin]; i >= 0; i = q->items[i].next) {
            const kernel_tile_candidate *candidate = &q->items[i];
            const uint32_t source = candidate->source;
            const bool is_transparent =
                t->frame->isovalues[source % RENDER_MAX_ISOVALUES].surface >= t->frame->opaque_count;
            if (is_transparent != transparent || !kernel_candidate_blocks(t, candidate)) continue;
            kernel_candidate_prefetch(t->frame, candidate);
            pending.items[pending.count++] = candidate;
            if (pending.count == SIMD_WIDTH) kernel_tile_meet_pending(t, &meeting, &pending);
        }
    kernel_tile_meet_pending(t, &meeting, &pending);
    kernel_tile_queue_end(t, &meeting);
}

SIMD_INLINE void kernel_tile_surface_candidates(kernel_tile_trace *t)
{
    const kernel_frame *f = t->frame;
    kernel_tile_candidate *items;
    const int count = kernel_candidates_in_tile(f, t->tile.x0, t->tile.y0, &items);
    if (!count) return;
    kernel_by_depth by_depth;
    kernel_sort_by_depth(&by_depth, items, count);
    if (f->opaque_count) kernel_tile_trace_candidates(t, &by_depth, false);
    if (f->opaque_count < f->surface_count) kernel_tile_trace_candidates(t, &by_depth, true);
}

/* ---- tiles ---- */

/* The memory that a thread keeps from tile to tile. */
typedef struct kernel_memory {
    kernel_cell_cache packet_cells;
    kernel_poly polys[KERNEL_CACHE_CELLS]; /* of the cells in the same places */
    kernel_cell tile_cell;
    kernel_poly tile_poly;
    kernel_tile_trace tile;
    kernel_tile_volume volume;
    kernel_tile_segments segments;
    kernel_tile_cells cells;
    kernel_finder finder;
    kernel_tile_finder search;
} kernel_memory;

static int volume_turns(const kernel_frame *f)
{
    return f->volume_turns ? f->volume_turns : 1;
}

static void trace_packet_turn(kernel_packet *p, const kernel_hits *hits, int64_t first_fragment)
{
    if (p->frame->has_segments) {
        p->is_pencil = false; /* packet by packet, lines would not be used often enough to pay */
        if (p->frame->job->separate_samples)
            kernel_trace_apart(p);
        else
            kernel_trace_segments(p, first_fragment);
    } else {
        kernel_trace_volumes(p, hits);
    }
}

static void trace_packet_volumes(kernel_packet *p, const kernel_hits *hits, int64_t first_fragment)
{
    kernel_thread *thread = p->thread;
    const double start = thread->now();
    for (int turn = 0; turn < volume_turns(p->frame); turn++) {
        if (p->frame->volume_turns) kernel_packet_clip_volumes(p, turn);
        trace_packet_turn(p, hits, first_fragment);
    }
    thread->volume_seconds += thread->now() - start;
}

static void trace_packet(const kernel_frame *f, const kernel_tile *tile, kernel_thread *thread, int x0, int y0)
{
    kernel_packet p;
    kernel_hits hits;
    const int64_t first_fragment = thread->out->count;
    kernel_packet_begin(&p, f, tile, thread, x0, y0);
    kernel_packet_complete(&p);
    kernel_hits_begin(&hits);
    if (f->surface_count) {
        const double start = thread->now();
        kernel_trace_surfaces(&p, &hits);
        kernel_emit_opaque(&p, &hits);
        thread->surface_seconds += thread->now() - start;
    }
    if (f->volume_count) trace_packet_volumes(&p, &hits, first_fragment);
}

/* Tells whether one of the rectangle's pixels is to be traced. */
static bool is_wanted(const render_job *job, int x0, int y0, int columns, int rows)
{
    const int x1 = x0 + columns, y1 = y0 + rows;
    if (!job->pixels) return x0 < job->camera.width && y0 < job->camera.height;
    for (int y = y0; y < y1 && y < job->camera.height; y++)
        for (int x = x0; x < x1 && x < job->camera.width; x++)
            if (pixel_set_has(job->pixels, (int64_t)y * job->camera.width + x)) return true;
    return false;
}

static void trace_packets(const kernel_frame *f, kernel_thread *thread, int x0, int y0)
{
    kernel_tile tile;
    kernel_tile_setup(&tile, f, x0, y0);
    kernel_tile_rays(&tile, f);
    for (int y = y0; y < y0 + KERNEL_TILE; y += KERNEL_PACKET_ROWS)
        for (int x = x0; x < x0 + KERNEL_TILE; x += KERNEL_PACKET_COLUMNS)
            if (is_wanted(f->job, x, y, KERNEL_PACKET_COLUMNS, KERNEL_PACKET_ROWS))
                trace_packet(f, &tile, thread, x, y);
}

static unsigned wanted_blocks(const render_job *job, int x0, int y0)
{
    unsigned blocks = 0;
    for (int i = 0; i < KERNEL_BLOCKS; i++)
        if (is_wanted(job, x0 + i % KERNEL_BLOCKS_ACROSS * KERNEL_BLOCK, y0 + i / KERNEL_BLOCKS_ACROSS * KERNEL_BLOCK,
                      KERNEL_BLOCK, KERNEL_BLOCK))
            blocks |= 1u << i;
    return blocks;
}

static void trace_tile_surfaces(kernel_tile_trace *t)
{
    const double start = t->thread->now();
    if (t->frame->candidates)
        kernel_tile_surface_candidates(t);
    else
        kernel_tile_surfaces(t);
    for (unsigned begun = t->begun; begun; begun &= begun - 1)
        for (int n = 0; n < KERNEL_BLOCK_PACKETS; n++) {
            const int i = __builtin_ctz(begun) * KERNEL_BLOCK_PACKETS + n;
            kernel_emit_opaque(&t->packets[i], &t->hits[i]);
        }
    t->thread->surface_seconds += t->thread->now() - start;
}

/* Traces volumes packet by packet, each sample or segment as a fragment of its own. */
static void trace_tile_apart(kernel_tile_trace *t)
{
    for (unsigned left = t->wanted; left; left &= left - 1) {
        const int block = __builtin_ctz(left);
        kernel_block_begin(t, block);
        for (int n = 0; n < KERNEL_BLOCK_PACKETS; n++) {
            const int i = block * KERNEL_BLOCK_PACKETS + n;
            kernel_packet_complete(&t->packets[i]);
            trace_packet_volumes(&t->packets[i], &t->hits[i], t->thread->out->count);
        }
    }
}

static void trace_tile_segments(kernel_tile_trace *t)
{
    const double start = t->thread->now();
    for (t->turn = 0; t->turn < volume_turns(t->frame); t->turn++) kernel_tile_segments_trace(t);
    t->thread->volume_seconds += t->thread->now() - start;
}

static void trace_tile_samples(kernel_tile_trace *t)
{
    const double start = t->thread->now();
    for (t->turn = 0; t->turn < volume_turns(t->frame); t->turn++) kernel_tile_volumes(t);
    t->thread->volume_seconds += t->thread->now() - start;
}

/* May the tile see any tree's box? */
static bool is_covered(const kernel_frame *f, int x0, int y0)
{
    return x0 <= f->cover[0][1] && x0 + KERNEL_TILE > f->cover[0][0] && y0 <= f->cover[1][1] &&
           y0 + KERNEL_TILE > f->cover[1][0];
}

/* May the tile have samples or segments of volumes? */
static bool has_volume(const kernel_frame *f, int x0, int y0)
{
    kernel_tile_candidate *items;
    if (!f->volume_count || !is_covered(f, x0, y0)) return false;
    return !f->volume_candidates || kernel_bin(f, f->volume_candidates, f->volume_starts, x0, y0, &items);
}

/* May it have hits? */
static bool has_surface(const kernel_frame *f, int x0, int y0)
{
    kernel_tile_candidate *items;
    if (!f->surface_count) return false;
    return f->candidates ? kernel_candidates_in_tile(f, x0, y0, &items) : is_covered(f, x0, y0);
}

static bool begins_run(const kernel_frame *f, int x0, int y0)
{
    const int columns = (f->job->camera.width - 1) / KERNEL_TILE + 1;
    return (y0 / KERNEL_TILE * columns + x0 / KERNEL_TILE) % KERNEL_TILE_RUN == 0;
}

static void trace_tile(const kernel_frame *f, kernel_thread *thread, int x0, int y0)
{
    thread->serial++;
    if (!f->by_tiles) {
        trace_packets(f, thread, x0, y0);
        return;
    }
    if (begins_run(f, x0, y0)) kernel_depth_forget(&thread->tile_volume->depth);
    kernel_tile_trace *t = thread->tile;
    const bool fogs = has_volume(f, x0, y0);
    if (!fogs && !has_surface(f, x0, y0)) return;
    const unsigned wanted = wanted_blocks(f->job, x0, y0);
    if (!wanted) return;
    kernel_tile_begin(t, f, thread, x0, y0, wanted);
    if (f->surface_count) trace_tile_surfaces(t);
    if (!fogs) return;
    if (f->has_segments && f->job->separate_samples)
        trace_tile_apart(t);
    else if (f->has_segments)
        trace_tile_segments(t);
    else
        trace_tile_samples(t);
}

static void find_candidates(const kernel_frame *f, kernel_thread *thread, const kernel_subtree *subtree,
                            kernel_candidate_list *list, bool (*grow)(kernel_candidate_list *list))
{
    kernel_finder *finder = thread->finder;
    kernel_finder_begin(finder, f, subtree);
    finder->list = list;
    finder->grow = grow;
    if (subtree->count)
        kernel_find_active(finder, subtree->first, subtree->count);
    else
        kernel_find_candidates(finder, subtree->node);
}

static void write_active(const kernel_frame *f, kernel_thread *thread, const kernel_subtree *subtree,
                         kernel_active_writer *writer, bool (*grow)(kernel_active_writer *writer))
{
    kernel_finder *finder = thread->finder;
    kernel_finder_begin(finder, f, subtree);
    finder->writer = writer;
    finder->keep = grow;
    kernel_activate_subtree(finder, subtree->node);
}

/* Megabytes, most of which no tile of the frame may touch: only what is read before it is written is set. */
static void begin(kernel_thread *thread)
{
    kernel_memory *m = thread->memory;
    thread->cells = &m->packet_cells;
    thread->polys = m->polys;
    thread->tile = &m->tile;
    thread->tile_cells = &m->cells;
    thread->tile_volume = &m->volume;
    thread->tile_segments = &m->segments;
    thread->finder = &m->finder;
    m->tile.cell = &m->tile_cell;
    m->tile.poly = &m->tile_poly;
    m->tile.search = &m->search;
    for (int i = 0; i < KERNEL_CACHE_CELLS; i++) m->packet_cells.cells[i].serial = 0;
    m->segments.depth = 0;
}

const kernel_table KERNEL_TABLE = {SIMD_WIDTH,          sizeof(kernel_memory),  begin,
                                   trace_tile,          find_candidates,        write_active,
                                   kernel_occlude,      kernel_occlude_by_cell, kernel_sample_waiting,
                                   kernel_light_waiting};
