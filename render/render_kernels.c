/* The kernels: this one file is compiled once per instruction set and exports one table (kernel_types.h). A tile finds
 * its surfaces first, so that volumes know where opaque ones end them. A tile is traced in one traversal, or packet by
 * packet. */
#include "kernel_bins.h"
#include "kernel_cell.h"
#include "kernel_cell_cache.h"
#include "kernel_finder.h"
#include "kernel_hits.h"
#include "kernel_packet.h"
#include "kernel_packet_surface.h"
#include "kernel_segments.h"
#include "kernel_candidates.h"
#include "kernel_surface.h"
#include "kernel_tile.h"
#include "kernel_tile_cells.h"
#include "kernel_tile_segments.h"
#include "kernel_tile_candidates.h"
#include "kernel_tile_surface.h"
#include "kernel_tile_trace.h"
#include "kernel_tile_volume.h"
#include "kernel_types.h"
#include "kernel_volume.h"
#include "pixel_set.h"
#include "render.h"
#include "simd.h"

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

/* Each as a fragment of its own: packet by packet. */
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

static void trace_tile(const kernel_frame *f, kernel_thread *thread, int x0, int y0)
{
    thread->serial++;
    if (!f->by_tiles) {
        trace_packets(f, thread, x0, y0);
        return;
    }
    kernel_tile_trace *t = thread->tile;
    kernel_tile_candidate *items;
    if (f->candidates && !f->volume_count && !kernel_candidates_in_tile(f, x0, y0, &items)) return;
    const unsigned wanted = wanted_blocks(f->job, x0, y0);
    if (!wanted) return;
    kernel_tile_begin(t, f, thread, x0, y0, wanted);
    if (f->surface_count) trace_tile_surfaces(t);
    if (!f->volume_count) return;
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
    for (int i = 0; i < KERNEL_CACHE_CELLS; i++) m->packet_cells.cells[i].serial = 0;
    m->segments.depth = 0;
}

const kernel_table KERNEL_TABLE = {SIMD_WIDTH, sizeof(kernel_memory), begin, trace_tile, find_candidates, write_active};
