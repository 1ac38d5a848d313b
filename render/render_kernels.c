/* The kernels: this one file is compiled once per instruction set and exports one table (kernel_types.h). A tile finds
 * its surfaces first, so that volumes know where opaque ones end them. A tile is traced in one traversal, or packet by
 * packet. */
#include <math.h>

#include "kernel_segments.h"
#include "kernel_polyhedron_surface.h"
#include "kernel_polyhedron_volume.h"
#include "kernel_shown.h"
#include "kernel_spmd.h"
#include "kernel_tile_segments.h"
#include "kernel_tile_shown.h"
#include "kernel_tile_surface.h"
#include "kernel_tile_volume.h"

/* A tree over meshes: its leaves name meshes, which are traversed in their turn. */
typedef struct kernel_parent_state {
    const render_field *field;
    const kernel_interest *interest;
    vf t_low;
    const vf *t_high;
    kernel_leaf *leaf;
    void *state;
} kernel_parent_state;

static void kernel_parent_leaf(kernel_packet *p, void *opaque_state, int unused, const uint32_t *parts, int count,
                               vm rays)
{
    const kernel_parent_state *s = opaque_state;
    (void)unused;
    for (int n = 0; n < count; n++) {
        const int part = (int)parts[n];
        if (!s->field->ranges[part].low) continue;
        kernel_traverse(p, p->frame->job->parts[part].tree, &s->field->ranges[part], s->interest, rays, s->t_low,
                        s->t_high, part, s->leaf, s->state);
    }
}

SIMD_INLINE void kernel_trace_parts(kernel_packet *p, const render_field *field, const kernel_interest *interest,
                                    vf t_low, const vf *t_high, kernel_leaf *leaf, void *state)
{
    const render_job *job = p->frame->job;
    if (job->parent) {
        kernel_parent_state parent = {field, interest, t_low, t_high, leaf, state};
        kernel_traverse(p, job->parent, NULL, NULL, p->active, t_low, t_high, 0, kernel_parent_leaf, &parent);
        return;
    }
    for (int part = 0; part < job->part_count; part++)
        if (field->ranges[part].low)
            kernel_traverse(p, job->parts[part].tree, &field->ranges[part], interest, p->active, t_low, t_high, part,
                            leaf, state);
}

/* What a thread holds from tile to tile. */
typedef struct kernel_memory {
    kernel_surface_cache cache; /* first: kernel_thread's cache is this */
    kernel_tile_trace tile;
    kernel_tile_volume volume;
    kernel_tile_segments segments;
    kernel_tile_cells cells;
    kernel_finder finder;
} kernel_memory;

SIMD_INLINE kernel_tile_volume *kernel_tile_volume_of(kernel_tile_trace *t)
{
    return &((kernel_memory *)t->thread->cache)->volume;
}

SIMD_INLINE kernel_tile_segments *kernel_tile_segments_of(kernel_tile_trace *t)
{
    return &((kernel_memory *)t->thread->cache)->segments;
}

SIMD_INLINE kernel_tile_cells *kernel_tile_cells_of(kernel_tile_trace *t)
{
    return &((kernel_memory *)t->thread->cache)->cells;
}

static void trace_packet_volumes(kernel_packet *p, const kernel_hits *hits, int64_t first_fragment)
{
    kernel_thread *thread = p->thread;
    const double start = thread->now();
    if (p->frame->has_segments) {
        p->is_pencil = false; /* packet by packet, lines would not be used often enough to pay */
        if (p->frame->job->separate_samples)
            kernel_trace_apart(p);
        else
            kernel_trace_segments(p, first_fragment);
    } else {
        kernel_trace_volumes(p, hits);
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

/* Is one of the pixels of the rectangle to be traced? */
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
    if (t->frame->shown)
        kernel_tile_surfaces_shown(t);
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
    kernel_tile_segments_trace(t);
    t->thread->volume_seconds += t->thread->now() - start;
}

static void trace_tile_samples(kernel_tile_trace *t)
{
    const double start = t->thread->now();
    kernel_tile_volumes(t);
    t->thread->volume_seconds += t->thread->now() - start;
}

static void trace_tile(const kernel_frame *f, kernel_thread *thread, int x0, int y0)
{
    thread->serial++;
    if (!f->by_tiles) {
        trace_packets(f, thread, x0, y0);
        return;
    }
    kernel_tile_trace *t = &((kernel_memory *)thread->cache)->tile;
    kernel_tile_shown *items;
    if (f->shown && !f->volume_count && !kernel_shown_in_tile(f, x0, y0, &items)) return;
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

static void find_shown(const kernel_frame *f, kernel_thread *thread, const kernel_subtree *subtree,
                       kernel_shown_list *list, bool (*grow)(kernel_shown_list *list))
{
    kernel_finder *finder = &((kernel_memory *)thread->cache)->finder;
    kernel_finder_begin(finder, f, subtree);
    finder->list = list;
    finder->grow = grow;
    if (subtree->count)
        kernel_find_kept(finder, subtree->first, subtree->count);
    else
        kernel_find_shown(finder, subtree->node);
}

static void keep_crossed(const kernel_frame *f, kernel_thread *thread, const kernel_subtree *subtree,
                         kernel_keeper *keeper, bool (*grow)(kernel_keeper *keeper))
{
    kernel_finder *finder = &((kernel_memory *)thread->cache)->finder;
    kernel_finder_begin(finder, f, subtree);
    finder->keeper = keeper;
    finder->keep = grow;
    kernel_keep_subtree(finder, subtree->node);
}

/* Megabytes, most of which no tile of the frame may touch: only what is read before it is written is set. */
static void begin(void *cache)
{
    kernel_memory *m = cache;
    for (int i = 0; i < KERNEL_CACHE_CELLS; i++) m->cache.cells.cells[i].serial = 0;
    m->segments.depth = 0;
}

const kernel_table KERNEL_TABLE = {SIMD_WIDTH, sizeof(kernel_memory), begin, trace_tile, find_shown, keep_crossed};
